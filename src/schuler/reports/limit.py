"""The page of ``schuler limit``: sigma of the heading against time, for an instrument."""

from __future__ import annotations

from html import escape

import numpy as np

from schuler.alignment import PathTable
from schuler.alignment.limit_table import LimitTable, limit_table
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table

__all__ = ["limit_page", "path_page"]


def limit_page(found: LimitTable, interval: float = 0.01) -> Page:
    """Return the page.

    Parameters
    ----------
    found : LimitTable
        The curve runs from a tenth of its shortest time to ten times its longest.
    interval : float
        Sampling interval, s.
    """
    spec, site, positions = found.spec, found.site, found.positions
    times = [each.duration for each in found.limits]
    t = np.geomspace(0.1 * min(times), 10.0 * max(times), 81)
    curve = limit_table(spec, site, [float(x) for x in t], positions, interval)
    sigma = np.array([each.sigma_arcmin for each in curve.limits])
    layout = plot_layout(420, "time in all, s", "1 sigma, arcmin")
    for axis in ("xaxis", "yaxis"):
        layout[axis].update(type="log", exponentformat="power")
    figure = figure_of(
        [
            line_of(t, sigma[:, k], name, colour, hovertemplate="%{y:.4g}'")
            for k, name, colour in ((2, "up", BLUE), (0, "east", GREY), (1, "north", ORANGE))
        ],
        layout,
    )
    best = max(found.limits, key=lambda each: each.duration)
    rows = [
        ("instrument", spec.name),
        *(
            (f"{part} {key.replace('_', ' ')}", value)
            for part, values in spec.describe().items()
            for key, value in values.items()
        ),
        ("latitude", f"{site.lat:g} deg"),
        *(
            (
                f"position {k}",
                f"psi {p.heading_ccw_deg:g}, pitch {p.pitch_deg:g}, roll {p.roll_deg:g} deg, "
                f"{p.dwell:g} s",
            )
            for k, p in enumerate(positions, 1)
        ),
    ]
    head = (
        f"<h1>Limit of alignment · {escape(spec.name)}</h1>"
        f'<p class="value">{best.sigma_arcmin[2]:.3g}′ <span class="pm">at best</span></p>'
        f'<p class="sub">1 sigma of the heading after {max(times):g} s in {len(positions)} '
        f"position(s), latitude {site.lat:g}°. No method can do better.</p>"
    )
    caption = "The Cramér-Rao limit of phi (east, north, up) against the time used."
    return Page(
        f"Limit of alignment: {spec.name}",
        head,
        [
            Section("Against time", drawings=[Drawing("limit", figure, caption)]),
            Section("Inputs", html=definition_table(rows, "What this is the limit of")),
        ],
    )


def path_page(found: PathTable) -> Page:
    """Return the page of the bound on a path."""
    t = np.array([each.duration for each in found.limits])
    sigma = np.array([each.sigma_arcmin for each in found.limits])
    layout = plot_layout(420, "time on the path, s", "1 sigma, arcmin")
    layout["yaxis"].update(type="log")
    lines = [
        line_of(t, sigma[:, k], name, colour, hovertemplate="%{y:.4g}'")
        for k, name, colour in ((2, "up", BLUE), (0, "east", GREY), (1, "north", ORANGE))
    ]
    for line in lines:
        line["mode"] = "lines+markers"
    aids = " ".join(map(str, found.aids))
    head = (
        f"<h1>Limit of alignment on a path · {escape(found.path)}</h1>"
        f'<p class="value">{sigma[-1, 2]:.3g}′ <span class="pm">at the end</span></p>'
        f'<p class="sub">1 sigma of the heading after {t[-1]:g} s with {escape(aids)}, '
        f"{escape(found.spec.name)}. No method can do better.</p>"
    )
    text = "The Cramér-Rao limit of phi (east, north, up) against the time on the path."
    return Page(
        f"Limit of alignment on a path: {found.path}", head,
        [Section("Against time", drawings=[Drawing("limit", figure_of(lines, layout), text)])],
    )  # fmt: skip
