"""What the page of an alignment in motion has of its own: how the filter came to its heading."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import MovingAlignment, MovingWindows
from schuler.constants import ARCMIN, DEG
from schuler.ins import BodyVelocity
from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, GREY, ORANGE, POINTS, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table

__all__ = ["moving_sections", "windows_section"]

Array = NDArray[np.float64]

_TIME = "time since the start of the span, s"

_NAMED = 5
"""Windows without a heading that are named below the picture."""

_COLOURS = (BLUE, ORANGE, GREY)


def moving_sections(fix: MovingAlignment) -> list[Section]:
    """Return the sections of an alignment in motion."""
    found = fix.coarse
    rows = [
        ("measurements", ", ".join(f"{n} {name}" for name, n in fix.used.items())),
        ("refused", ", ".join(f"{n} {name}" for name, n in fix.refused.items() if n) or "none"),
        *([] if found is None else [
            ("coarse stage", f"from {found.form}, t = {found.window[0]:.6g} to "
             f"{found.window[1]:.6g} s, heading ± {found.heading_sigma / DEG:.2g} deg"),
        ]),
        ("passes of the filter", str(fix.passes)),
        ("mean squared innovation", f"{fix.mean_square:.3g} (1 where the noise is as it is said)"),
        ("velocity east, north, up", _with_sigma(fix.v_n, fix.v_sigma, "m/s")),
        ("position", f"{fix.site.lat:.8f} deg, {fix.site.lon:.8f} deg, {fix.site.height:.3f} m"),
        *((name.rstrip(":"), text) for name, text in fix.estimate_rows()),
    ]  # fmt: skip
    drawings = [_sigma(fix)]
    drawings += [_innovations(fix, name) for name in fix.innovations if fix.used[name]]
    return [
        Section("Convergence", drawings=drawings[:1]),
        Section("What was measured", html=definition_table(rows, "At the instant, ± 1 sigma"),
                drawings=drawings[1:]),
    ]  # fmt: skip


def _with_sigma(values: Array, sigma: Array, unit: str) -> str:
    told = ", ".join(f"{v:.4g} ± {s:.2g}" for v, s in zip(values, sigma, strict=True))
    return f"{told} {unit}"


def _thin(n: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).astype(np.int64))


def _sigma(fix: MovingAlignment) -> Drawing:
    epochs = fix.epochs
    k = _thin(len(epochs))
    sigma = epochs.sigma("phi")[k] / ARCMIN
    traces = [
        line_of(epochs.time[k] - fix.start, sigma[:, axis], name, colour)
        for axis, (name, colour) in enumerate(
            zip(("about east", "about north", "about up"), _COLOURS, strict=True)
        )
    ]
    layout = plot_layout(300, _TIME, "sigma, arcmin")
    layout["yaxis"]["type"] = "log"
    text = "1 sigma of the attitude after each measurement, from a start of which nothing is known."
    return Drawing("sigma", figure_of(traces, layout), text)


def _innovations(fix: MovingAlignment, aid: str) -> Drawing:
    time, z, sigma, weight = fix.innovations[aid]
    time = time - fix.start
    body = any(isinstance(each, BodyVelocity) and each.label == aid for each in fix.measured)
    names = ("right", "forward", "up") if body else ("east", "north", "up")
    k = _thin(len(time))
    traces: list[Any] = []
    for axis, colour in enumerate(_COLOURS):
        seen = sigma[k, axis] > 0.0
        if np.any(seen):
            ratio = z[k, axis][seen] / sigma[k, axis][seen]
            traces.append(line_of(time[k][seen], ratio, names[axis], colour))
    out = np.flatnonzero(weight == 0.0)[:POINTS]
    if len(out):
        worst = np.max(np.abs(z[out]) / np.maximum(sigma[out], 1e-12), axis=1)
        traces.append(
            scatter(
                x=time[out], y=worst, name="refused", mode="markers",
                marker={"color": "#CC3311", "symbol": "x", "size": 7},
            )
        )  # fmt: skip
    text = f"Predicted minus measured of {aid.replace('_', ' ')}, over its sigma: within 3."
    layout = plot_layout(260, _TIME, "innovation / sigma")
    return Drawing(f"innovations of {aid}".replace("_", " "), figure_of(traces, layout), text)


def windows_section(w: MovingWindows) -> Section:
    """Return the section of the windows of a drive."""
    time = np.array([each.time for each in w.each]) - w.whole.start
    off, sigma = w.off / DEG, w.off_sigma / DEG
    layout = plot_layout(320, _TIME, "window less smoothed, deg", hovermode="closest")
    edge: Array = np.array([0.0, w.whole.duration])
    traces = [
        line_of(edge, np.zeros(2), "smoothed heading of the whole", BLUE, hoverinfo="skip"),
        scatter(
            x=time, y=off, name="windows, ± 1 sigma", mode="markers",
            marker={"color": ORANGE, "size": 8},
            error_y={"type": "data", "array": sigma, "color": ORANGE, "thickness": 1.4},
            hovertemplate="%{x:.6g} s: %{y:.3f} deg<extra></extra>",
        ),
    ]  # fmt: skip
    refused = "".join(f" No heading from {a:.6g} to {b:.6g} s." for a, b, _ in w.refused[:_NAMED])
    return Section(
        "Windows",
        drawings=[
            Drawing(
                "windows",
                figure_of(traces, layout),
                f"{w}. Bars hold the sigma of both headings.{refused}",
                f"Differences of {len(w.each)} windows to the smoothed heading.",
            )
        ],
    )
