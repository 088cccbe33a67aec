"""The page of ``schuler campaign``: whether errors scatter as sigma says."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.campaigns.run import Results
from schuler.campaigns.scatter import Scatter
from schuler.constants import ARCMIN
from schuler.reports.figure import bar, scatter
from schuler.reports.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    figure_of,
    line_of,
    plot_layout,
)
from schuler.reports.page import Drawing, Page, Section, definition_table

__all__ = ["campaign_page", "results_page", "scatter_page"]

Array = NDArray[np.float64]

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, GREY)
_MOST_DRAWN = 12
"""Places and methods that get figures of their own; the table has all."""


def campaign_page(
    scatters: Sequence[Scatter],
    name: str,
    inputs: Sequence[tuple[str, str]],
) -> Page:
    """Return the page.

    Parameters
    ----------
    scatters : sequence of Scatter
        One for each place of the sweep and method.
    name : str
        Of the scenario.
    inputs : sequence of (str, str)
        What it was made of, for the last table.
    """
    sections = [Section("Summary", html=_table(scatters))]
    if len(scatters) > 1:
        sections.append(_comparison(scatters))
    for one in scatters[:_MOST_DRAWN]:
        title = " · ".join(filter(None, (one.label, one.method)))
        text = (
            f"Heading errors of {one.runs} runs: rms {one.rms:.3g}′, stated sigma "
            f"{one.predicted:.3g}′. Bars: what was found; curve: what sigma promised."
        )
        quantiles = (
            "Heading error over its sigma, sorted, against the normal distribution. On the line: "
            "consistent; steeper: sigma promises too much; flatter: too little. Shade: where 99 of "
            "100 consistent points lie, each by itself."
        )
        sections.append(
            Section(
                title,
                drawings=[
                    Drawing(f"errors {title}", histogram(one), text),
                    Drawing(f"quantiles {title}", quantile_plot(one), quantiles),
                ],
            )
        )
    if len(scatters) > _MOST_DRAWN:
        more = len(scatters) - _MOST_DRAWN
        note = f"<p>{more} more places and methods are in the table and the results alone.</p>"
        sections.append(Section("Not drawn", html=note))
    sections.append(Section("Inputs", html=definition_table(inputs, "What this was made of")))
    return Page(f"Campaign: {name}", _headline(scatters, name), sections)


def results_page(results: Results) -> Page:
    """Return the page of a campaign's results."""
    campaign = results.campaign
    scenario = campaign.scenario
    inputs = [
        ("scenario", scenario.name),
        ("motion", scenario.kind),
        ("site", f"{scenario.site.lat:g} deg N, {scenario.site.lon:g} deg E, "
         f"{scenario.site.height:g} m"),
        ("record", f"{scenario.duration:g} s at {scenario.rate:g} Hz"),
        ("instrument", "without errors" if scenario.spec is None else scenario.spec.name),
        ("runs", f"{campaign.runs} at each of {len(campaign.points)} place(s)"),
        *((f"sweep of {key}", ", ".join(map(str, v))) for key, v in campaign.sweep.items()),
        ("seed", str(scenario.seed)),
        ("attitude at", f"the {scenario.at}"),
        ("results", str(results.path)),
        ("SHA-256 of the scenario", scenario.digest),
    ]  # fmt: skip
    return campaign_page(results.scatters(), scenario.name, inputs)


def scatter_page(found: Scatter) -> Page:
    """Return the page of one place and method of a campaign."""
    inputs = [("method", found.method), ("runs", str(found.runs))]
    inputs += [(key, str(value)) for key, value in found.values.items()]
    return campaign_page([found], found.label or found.method, inputs)


def _headline(scatters: Sequence[Scatter], name: str) -> str:
    first = scatters[0]
    low, high = first.nees_band
    facts = [
        (f"{first.predicted:.3g}′", "stated sigma, rms"),
        ("no spec" if first.bound is None else f"{first.bound:.3g}′", "limit"),
        ("-" if first.ratio is None else f"{first.ratio:.2f}", "rms over limit"),
        (f"{first.nees_ratio:.2f}", f"NEES / 3, consistent in {low:.2f} to {high:.2f}"),
        (f"{first.runs}", "runs"),
    ]
    items = "".join(f"<li><b>{escape(v)}</b><span>{escape(t)}</span></li>" for v, t in facts)
    where = " · ".join(filter(None, (first.label, first.method)))
    more = f" (the first of {len(scatters)} places and methods)" if len(scatters) > 1 else ""
    return (
        f"<h1>Campaign · {escape(name)}</h1>"
        f'<p class="value">{first.rms:.3g}′ <span class="pm">rms</span></p>'
        f'<p class="sub">Heading error against the truth, {escape(where)}{more}</p>'
        f'<ul class="facts">{items}</ul>'
    )


def _table(scatters: Sequence[Scatter]) -> str:
    heads = ("", "method", "runs", "mean", "std", "rms", "sigma", "limit", "rms / limit",
             "NEES / 3", "consistent within")  # fmt: skip
    rows = []
    for s in scatters:
        low, high = s.nees_band
        cells = (
            s.method, str(s.runs), f"{s.mean:+.3f}", _text(s.std), f"{s.rms:.3f}",
            f"{s.predicted:.3f}", _text(s.bound), _text(s.ratio),
            f"{s.nees_ratio:.2f}{'' if s.consistent else ' *'}", f"{low:.2f} to {high:.2f}",
        )  # fmt: skip
        body = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        rows.append(f'<tr><th scope="row">{escape(s.label or "all runs")}</th>{body}</tr>')
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    return (
        "<table><caption>Heading error, arcmin. * : the covariance is not consistent at 99 %."
        f"</caption><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def histogram(s: Scatter) -> Any:
    """Draw how heading errors lie, with the density that their sigmas promise."""
    error, sigma = s.heading_error / ARCMIN, s.sigma[:, 2] / ARCMIN
    reach = 1.05 * float(max(np.max(np.abs(error)), 3.0 * np.median(sigma)))
    bins = int(np.clip(2.0 * np.sqrt(s.runs), 8, 60))
    count, edges = np.histogram(error, bins, (-reach, reach))
    width = edges[1] - edges[0]
    x = np.linspace(-reach, reach, 241)
    # Each run promises a width of its own: the curve is the mean of their normals.
    u = x[:, None] / sigma
    promised = np.mean(np.exp(-0.5 * u**2) / (np.sqrt(2.0 * np.pi) * sigma), axis=1)
    layout = plot_layout(320, "heading error, arcmin", "runs", bargap=0.04, hovermode="closest")
    bars = bar(
        x=np.round(0.5 * (edges[1:] + edges[:-1]), 6), y=count, width=width, name="found",
        marker={"color": BLUE, "opacity": 0.55}, hovertemplate="%{x:.3g}': %{y}<extra></extra>",
    )  # fmt: skip
    curve = line_of(x, s.runs * width * promised, "promised by sigma", ORANGE, hoverinfo="skip")
    return figure_of([bars, curve], layout)


def quantile_plot(s: Scatter) -> Any:
    """Draw sorted errors over sigma against normal quantiles, with the band of chance."""
    from scipy.special import betaincinv, ndtri

    n = s.runs
    k = np.arange(1, n + 1)
    # At most 400 points say as much as all, and the ends are kept.
    keep = np.unique(np.round(np.linspace(0, n - 1, min(n, 400))).astype(np.int64))
    x: Array = ndtri((k - 0.5) / n)[keep]
    y: Array = np.sort(s.normalised)[keep]
    low: Array = ndtri(betaincinv(k, n + 1 - k, 0.005))[keep]
    high: Array = ndtri(1.0 - betaincinv(n + 1 - k, k, 0.005))[keep]
    shade = scatter(
        x=np.concatenate([x, x[::-1]]), y=np.concatenate([high, low[::-1]]), name="99 % of chance",
        mode="lines", fill="toself", fillcolor="rgba(0,114,178,0.14)", line={"width": 0},
        hoverinfo="skip",
    )  # fmt: skip
    points = scatter(
        x=np.round(x, 6), y=np.round(y, 6), name="runs", mode="markers",
        marker={"color": BLUE, "size": 5},
        hovertemplate="normal %{x:.2f}: %{y:.2f} sigma<extra></extra>",
    )  # fmt: skip
    line = line_of(x[[0, -1]], x[[0, -1]], "consistent", ORANGE, hoverinfo="skip")
    layout = plot_layout(
        380, "normal quantile", "heading error / sigma, sorted", hovermode="closest"
    )
    return figure_of([shade, line, points], layout)


def _comparison(scatters: Sequence[Scatter]) -> Section:
    """Draw rms, sigma and limit at each place, a colour for each method."""

    def place(s: Scatter) -> str:
        return ", ".join(map(str, s.values.values())) or "all runs"

    traces: list[Any] = []
    for method, colour in zip(
        dict.fromkeys(s.method for s in scatters), _COLOURS * len(scatters), strict=False
    ):
        mine = [s for s in scatters if s.method == method]
        at = [place(s) for s in mine]
        spread = [s.rms / np.sqrt(2.0 * s.runs) for s in mine]
        traces += [
            scatter(
                x=at, y=[s.rms for s in mine], name=f"{method}: rms", mode="lines+markers",
                line={"color": colour, "width": 1.6}, marker={"size": 8},
                error_y={"type": "data", "array": spread, "thickness": 1.2},
                hovertemplate="%{y:.3g}'",
            ),
            scatter(
                x=at, y=[s.predicted for s in mine], name=f"{method}: sigma", mode="lines+markers",
                line={"color": colour, "width": 1.4, "dash": "dash"},
                marker={"size": 8, "symbol": "circle-open"}, hovertemplate="%{y:.3g}'",
            ),
        ]  # fmt: skip
    bounds = {place(s): s.bound for s in scatters}
    if all(value is not None for value in bounds.values()):
        traces.append(
            scatter(
                x=list(bounds), y=list(bounds.values()), name="limit",
                mode="lines+markers", line={"color": GREY, "width": 1.4, "dash": "dot"},
                marker={"size": 7, "symbol": "line-ew-open"}, hovertemplate="%{y:.3g}'",
            )
        )  # fmt: skip
    layout = plot_layout(360, ", ".join(scatters[0].values), "heading, arcmin")
    layout["yaxis"].update(type="log")
    layout["xaxis"].update(type="category")
    caption = (
        "Rms of the heading error (bars: 1 sigma of chance), the sigma that was stated, and the "
        "limit of the instrument."
    )
    return Section(
        "Across the sweep", drawings=[Drawing("sweep", figure_of(traces, layout), caption)]
    )
