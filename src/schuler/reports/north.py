"""The page of ``schuler north``: readings on an indexing table and the cosine through them."""

from __future__ import annotations

import numpy as np

from schuler.alignment.table_north import TableNorth
from schuler.constants import DEG, DEG_PER_HOUR
from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, GREY, figure_of, line_of, plot_layout
from schuler.reports.page import (
    Drawing,
    Page,
    Section,
    contradiction_box,
    definition_table,
)

__all__ = ["north_page"]


def north_page(found: TableNorth) -> Page:
    """Return the page.

    Parameters
    ----------
    found : TableNorth
    """
    theta = np.linspace(-180.0, 360.0, 361)
    wave = found.bias + found.amplitude * np.cos((theta - found.north_deg) * DEG)
    figure = figure_of(
        [
            line_of(theta, wave / DEG_PER_HOUR, "cosine", GREY),
            scatter(
                x=found.angles_deg, y=found.means / DEG_PER_HOUR, mode="markers", name="dwells",
                marker={"color": BLUE, "size": 9},
                error_y={"array": found.sigmas / DEG_PER_HOUR, "color": BLUE},
            ),
        ],
        plot_layout(420, "table angle, deg", "mean reading, deg/h"),
    )  # fmt: skip
    text = "Mean reading of each dwell against the table angle, and the cosine through them."
    sigma = f"{found.sigma_deg:.2g}°"
    head = (
        "<h1>North by an indexing table</h1>"
        + contradiction_box(found.contradictions)
        + f'<p class="value">{found.north_deg:.3f}° <span class="pm">± {sigma}</span>'
        '</p><p class="sub">table angle at which the input axis points north</p>'
    )
    rows = [
        (f"{a:g} deg", f"{m / DEG_PER_HOUR:.5f} ± {s / DEG_PER_HOUR:.2g} deg/h, {c} left out")
        for a, m, s, c in zip(
            found.angles_deg, found.means, found.sigmas, found.clipped, strict=True
        )
    ]
    rows += [
        ("bias", f"{found.bias / DEG_PER_HOUR:.4g} deg/h"),
        ("amplitude", f"{found.amplitude / DEG_PER_HOUR:.5g} deg/h"),
    ]
    return Page(
        "North by an indexing table", head,
        [
            Section("Readings", drawings=[Drawing("readings", figure, text)]),
            Section("Dwells", html=definition_table(rows, "Means without outliers")),
        ],
    )  # fmt: skip
