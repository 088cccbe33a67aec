"""The figures of an alignment report, each a function of the result."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import Alignment, Convergence, Residual, Windows
from schuler.constants import DEG
from schuler.kernels.states import StretchSums
from schuler.record import Summary
from schuler.record.summary import joined_stretches
from schuler.reports.figure import Figure, bar, scatter
from schuler.units import significant

__all__ = [
    "budget",
    "convergence",
    "figure_of",
    "line_of",
    "parabola",
    "plot_layout",
    "raw",
    "residuals",
    "spectrum",
    "windows",
]

Array = NDArray[np.float64]

BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#8a94a0"
_BAND = "rgba(0,114,178,0.18)"
_SHADE = "rgba(230,159,0,0.16)"
POINTS = 1500
"""Most points to a line."""


def plot_layout(height: int, x: str, y: str, **more: Any) -> dict[str, Any]:
    """Return a layout in the style of all pages."""
    return {
        "height": height,
        "margin": {"l": 64, "r": 16, "t": 28, "b": 48},
        "font": {"size": 13},
        "hovermode": "x unified",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "xaxis": {"title": {"text": x}, "zeroline": False},
        # Marks may be wide: the title stands off from the widest.
        "yaxis": {
            "title": {"text": y, "standoff": 8},
            "zeroline": False,
            "automargin": True,
        },
        **more,
    }


def figure_of(traces: list[dict[str, Any]], layout: dict[str, Any]) -> Figure:
    """Return a figure of traces."""
    return Figure(traces, layout)


def line_of(x: Array, y: Array, name: str, colour: str, **more: Any) -> Any:
    """Return a line trace."""
    return scatter(
        x=np.round(x, 6), y=y, name=name, mode="lines", line={"color": colour, "width": 1.6}, **more
    )


def _band(x: Array, low: Array, high: Array, name: str, colour: str = _BAND) -> Any:
    return scatter(
        x=np.concatenate([x, x[::-1]]),
        y=np.concatenate([high, low[::-1]]),
        name=name,
        mode="lines",
        fill="toself",
        fillcolor=colour,
        line={"width": 0},
        hoverinfo="skip",
    )


def convergence(c: Convergence) -> Any:
    """Draw heading against the time used, with its 1-sigma band."""
    final, sigma = c.heading_deg[-1], c.sigma_arcmin / 60.0
    # The first instants are off by degrees: show what matters, the rest by zooming out.
    later = c.t >= 0.1 * c.t[-1]
    reach = 1.3 * float(np.max(np.abs(c.heading_deg[later] - final) + sigma[later]))
    layout = plot_layout(360, "time used, s", "heading, deg")
    layout["xaxis"].update(type="log")
    layout["yaxis"].update(range=[final - reach, final + reach], tickformat=".4~g")
    line = line_of(c.t, c.heading_deg, "heading", BLUE)
    line["hovertemplate"] = "%{y:.4f} deg"
    return figure_of(
        [_band(c.t, c.heading_deg - sigma, c.heading_deg + sigma, "± 1 sigma"), line], layout
    )


def _thin(blocks: Array, points: int) -> Array:
    """Join neighbouring stretches until there are at most `points`."""
    step = -(-len(blocks) // points)
    if step <= 1:
        return blocks
    return joined_stretches(blocks, np.arange(0, len(blocks), step))


def raw(summary: Summary, gravity: float) -> tuple[Any, Any]:
    """Draw |f| and |w| over the record with the disturbed stretches shaded."""
    each = StretchSums(_thin(summary.blocks, POINTS))
    t = each.end - 0.5 * each.duration
    shades = [
        {
            "type": "rect", "xref": "x", "yref": "paper", "x0": s.start, "x1": s.end,
            "y0": 0, "y1": 1, "fillcolor": _SHADE, "line": {"width": 0}, "layer": "below",
        }
        for s in summary.stretches
        if s.disturbed
    ]  # fmt: skip
    force = plot_layout(280, "time, s", "||f| - g|, m/s²", shapes=shades)
    force["yaxis"].update(type="log", exponentformat="power")
    mean = each.sum_force / each.samples
    rms = np.sqrt(np.maximum(each.sum_force2 / each.samples - gravity * (2 * mean - gravity), 0))
    largest = np.maximum(each.largest_force - gravity, gravity - each.smallest_force)
    vector = np.linalg.norm(each.sum_dvel, axis=1) / each.duration
    first = figure_of(
        [
            line_of(t, np.maximum(value, 1e-9), name, colour, hovertemplate="%{y:.3g} m/s²")
            for value, name, colour in (
                (largest, "largest", GREY),
                (rms, "rms", BLUE),
                (np.abs(vector - gravity), "of the mean", GREEN),
            )
        ],
        force,
    )
    rate = plot_layout(280, "time, s", "|w|, deg/s", shapes=shades)
    rate["yaxis"].update(type="log")
    second = figure_of(
        [
            line_of(t, np.maximum(value, 1e-12) / DEG, name, colour, hovertemplate="%{y:.3g} deg/s")
            for value, name, colour in (
                (each.largest_rate, "largest", GREY),
                (np.sqrt(each.sum_rate2 / each.samples), "rms", BLUE),
                (np.linalg.norm(each.sum_dtheta, axis=1) / each.duration, "of the mean", GREEN),
            )
        ],
        rate,
    )
    return first, second


def residuals(r: Residual, start: float) -> Any:
    """Draw the residual velocity without its parabola, which dwarfs the rest."""
    left = r.mean - parabola(r)
    layout = plot_layout(320, "time, s", "residual velocity, mm/s")
    return figure_of(
        [
            line_of(start + r.t, 1e3 * left[:, k], name, colour, hovertemplate="%{y:.3f} mm/s")
            for k, (name, colour) in enumerate((("east", BLUE), ("north", ORANGE), ("up", GREEN)))
        ],
        layout,
    )


def parabola(r: Residual) -> Array:
    """Return the parabola in each axis of a residual velocity by least squares, m/s, (n, 3)."""
    basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(r.t)), 2)
    return np.asarray(basis @ np.linalg.lstsq(basis, r.mean, rcond=None)[0], np.float64)


def spectrum(r: Residual) -> Any:
    """Draw the amplitude spectral density of the residual velocity without its parabola."""
    step = float(r.dt.mean())
    n = len(r.t)
    window = np.hanning(n)
    left = r.mean - parabola(r)
    power = np.abs(np.fft.rfft(left * window[:, None], axis=0)) ** 2
    density: Array = np.sqrt(2.0 * step * power / np.sum(window**2))[1:]
    f: Array = np.fft.rfftfreq(n, step)[1:].astype(np.float64)
    layout = plot_layout(320, "frequency, Hz", "mm/s/√Hz")
    layout["xaxis"].update(type="log")
    layout["yaxis"].update(type="log", exponentformat="power")
    return figure_of(
        [
            line_of(f, 1e3 * np.maximum(density[:, k], 1e-12), name, colour,
                  hovertemplate="%{y:.3g}")
            for k, (name, colour) in enumerate(
                (("east", BLUE), ("north", ORANGE), ("up", GREEN))
            )
        ],
        layout,
    )  # fmt: skip


def budget(fix: Alignment) -> Any:
    """Draw what each source adds to the heading's sigma, the total and the limit."""
    shares = sorted(fix.budget_arcmin2.items(), key=lambda item: item[1])
    total = float(fix.sigma_arcmin[2])
    names = [name.replace("_", " ") for name, _ in shares] + ["total"]
    values = [value**0.5 for _, value in shares] + [total]
    colours = [BLUE] * len(shares) + [GREY]
    bound = fix.limit_arcmin
    if bound is not None:
        # A bar of its own: a line at the limit would cross what is written beside the others.
        names.append("limit")
        values.append(float(bound[2]))
        colours.append(ORANGE)
    layout = plot_layout(
        120 + 34 * len(names), "1 sigma of heading, arcmin", "", showlegend=False,
        hovermode="closest",
    )  # fmt: skip
    layout["xaxis"].update(rangemode="tozero", range=[0, 1.3 * max(values)])
    trace = bar(
        x=values,
        y=names,
        orientation="h",
        marker={"color": colours},
        text=[f"{significant(v, 3)}'" for v in values],
        textposition="outside",
        cliponaxis=False,
        hovertemplate="%{y}: %{x:.4g}'<extra></extra>",
    )
    return figure_of([trace], layout)


def windows(w: Windows) -> Any:
    """Draw the heading of each window with its sigma, the mean and the spread."""
    mean = w.mean_heading_deg
    start = np.array([x.start for x in w.each])
    end = np.array([x.end for x in w.each])
    middle = 0.5 * (start + end)
    off = np.array([(x.heading_deg - mean + 180.0) % 360.0 - 180.0 for x in w.each]) * 60.0
    sigma = np.array([x.sigma_arcmin[2] for x in w.each])
    layout = plot_layout(340, "time, s", f"heading - {mean:.4f} deg, arcmin", hovermode="closest")
    std = w.std_heading_arcmin
    edge: Array = np.array([start[0], end[-1]])
    traces = []
    if std is not None:
        traces.append(_band(edge, np.full(2, -std), np.full(2, std), f"± {std:.2f}' (spread)"))
    traces.append(line_of(edge, np.zeros(2), f"mean {mean:.4f} deg", BLUE, hoverinfo="skip"))
    traces.append(
        scatter(
            x=middle, y=off, name="windows, ± 1 sigma predicted", mode="markers",
            marker={"color": ORANGE, "size": 8},
            error_y={"type": "data", "array": sigma, "color": ORANGE, "thickness": 1.4},
            hovertemplate="%{x:.6g} s: %{y:.2f}'<extra></extra>",
        )
    )  # fmt: skip
    return figure_of(traces, layout)
