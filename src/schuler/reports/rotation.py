"""The page of ``schuler rotation compare``: end errors over all headings and latitudes."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from schuler.constants import DEG_PER_HOUR
from schuler.modulation import RotationComparison
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table, graph_objects, write_page

__all__ = ["rotation_report"]


def rotation_report(found: RotationComparison, path: str | Path) -> None:
    """Write the page.

    Parameters
    ----------
    found : RotationComparison
    path : str or Path
        The HTML file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    case, m = found.case, found.metres()
    one = 100.0 * (1.0 - m["single_axis"] / m["fixed"])
    two = m["fixed"] / np.maximum(m["two_axis"], 1e-9)
    near = int(np.argmin(np.abs(case.latitudes - case.site.lat)))
    lat = float(case.latitudes[near])
    head = (
        f"<h1>Rotation · {escape(case.name)}</h1>"
        f'<p class="value">{one[near].min():.0f} to {one[near].max():.0f} % '
        f'<span class="pm">by one axis</span></p>'
        f'<p class="sub">Reduction of the position error after {case.duration / 3600:g} h at '
        f"latitude {lat:g}°, over all headings; two axes make it at least {two[near].min():.1f} "
        "times smaller. Where one axis seems to do harm, the fixed errors cancel by luck.</p>"
    )
    e = case.errors
    rows = [
        ("array", case.array.name),
        ("fused gyro bias x, y, z",
         ", ".join(f"{v / DEG_PER_HOUR:.5f}" for v in np.asarray(e.gyro_bias)) + " deg/h"),
        ("accelerometer bias x, y, z",
         ", ".join(f"{v:.3g}" for v in np.asarray(e.accel_bias)) + " m/s^2"),
        ("fused scale factor x, y, z",
         ", ".join(f"{v * 1e6:.3g}" for v in np.diag(np.asarray(e.gyro_matrix))) + " ppm"),
        ("single axis", f"{case.single.name}, period {case.single.period:.5g} s"),
        ("two axes", f"{case.double.name}, period {case.double.period:.5g} s"),
        ("duration", f"{case.duration / 3600:g} h at rest"),
    ]  # fmt: skip
    heads = case.headings
    ends = "Position error at the end against heading; what one axis leaves is the vertical drift."
    traces = [
        line_of(heads, m[key][near], name, colour, hovertemplate="%{y:.1f} m")
        for key, name, colour in (
            ("fixed", "fixed", GREY), ("single_axis", "one axis", ORANGE), ("two_axis", "two axes",
                                                                          BLUE),
        )
    ]  # fmt: skip
    layout = plot_layout(360, f"heading, deg (latitude {lat:g} deg)", "error, m")
    layout["yaxis"]["rangemode"] = "tozero"
    sections = [
        Section("Against heading", drawings=[Drawing(figure_of(traces, layout), ends, ends)]),
        Section(
            "All headings and latitudes",
            drawings=[
                _map(found, one, "Reduction by one axis, %; red is worse than fixed (colours stop "
                     "at ±100).", "reduction, %"),
                _map(found, 100.0 * (1.0 - 1.0 / two), "Reduction by two axes, %.",
                     "reduction, %"),
            ],
        ),
        Section("Inputs", html=definition_table(rows, "What was compared")),
    ]  # fmt: skip
    write_page(path, f"Rotation: {case.name}", head, sections)


def _map(found: RotationComparison, values: np.ndarray, text: str, label: str) -> Drawing:
    go = graph_objects()
    case = found.case
    trace = go.Heatmap(
        x=case.headings, y=case.latitudes, z=np.round(values, 2), zmin=-100, zmax=100,
        colorscale=[[0, "#b2182b"], [0.5, "#f7f7f7"], [1, "#2166ac"]],
        colorbar={"title": {"text": label}},
        hovertemplate="heading %{x}, latitude %{y}: %{z:.1f} %<extra></extra>",
    )  # fmt: skip
    layout = plot_layout(380, "heading, deg", "latitude, deg", hovermode="closest")
    return Drawing(figure_of([trace], layout), text, text)
