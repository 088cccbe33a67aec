"""The page of ``schuler rotation compare``: end errors over all headings and latitudes."""

from __future__ import annotations

from html import escape

import numpy as np

from schuler.constants import DEG_PER_HOUR
from schuler.modulation import RotationComparison, RotationHistory
from schuler.modulation.history import QUANTITIES
from schuler.reports.figure import heatmap
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table

__all__ = ["history_page", "rotation_page"]

_CURVES = (
    ("east_m", "north_m", "distance_m"), ("v_east_m_s", "v_north_m_s"),
    ("phi_east_arcmin", "phi_north_arcmin", "phi_up_arcmin"),
)  # fmt: skip
_COLOURS = {"fixed": GREY, "single_axis": ORANGE, "two_axis": BLUE}
_WORDS = {"fixed": "fixed", "single_axis": "one axis", "two_axis": "two axes"}


def rotation_page(found: RotationComparison) -> Page:
    """Return the page.

    Parameters
    ----------
    found : RotationComparison
    """
    case, m = found.case, found.metres()
    one = 100.0 * (1.0 - m["single_axis"] / m["fixed"])
    two = m["fixed"] / np.maximum(m["two_axis"], 1e-9)
    less = 100.0 * (1.0 - 1.0 / two)
    near = int(np.argmin(np.abs(case.latitudes - case.site.lat)))
    lat = float(case.latitudes[near])
    head = (
        f"<h1>Rotation · {escape(case.name)}</h1>"
        f'<p class="value">{np.median(one[near]):.0f} % <span class="pm">less by one axis, '
        f"{np.median(less[near]):.1f} % by two</span></p>"
        f'<p class="sub">Position error after {case.duration / 3600:g} h at latitude {lat:g}°, the '
        f"median over all headings: {one[near].min():.0f} to {one[near].max():.0f} % by one axis, "
        f"{less[near].min():.1f} to {less[near].max():.1f} % by two. Where one axis does harm, the "
        "errors of the fixed instrument cancel by chance.</p>"
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
        Section("Against heading", drawings=[Drawing("heading", figure_of(traces, layout), ends)]),
        Section(
            "All headings and latitudes",
            drawings=[
                _map("one axis", found, m["fixed"] / np.maximum(m["single_axis"], 1e-9),
                     "One axis: how many times smaller the error is than fixed; red is worse."),
                _map("two axes", found, two,
                     "Two axes, in the same colours: how many times smaller the error is."),
            ],
        ),
        Section("Inputs", html=definition_table(rows, "What was compared")),
    ]  # fmt: skip
    return Page(f"Rotation: {case.name}", head, sections)


def history_page(found: RotationHistory) -> Page:
    """Return the page of errors over the hours.

    Parameters
    ----------
    found : RotationHistory
    """
    case = found.case
    hours = found.time / 3600.0
    one, two = (found.reduction(name) for name in ("single_axis", "two_axis"))
    head = (
        f"<h1>Rotation · {escape(case.name)}</h1>"
        f'<p class="value">{one:.1f} % <span class="pm">less by one axis, {two:.1f} % by two'
        f'</span></p><p class="sub">Position error after {case.duration / 3600:g} h at rest, '
        f"latitude {case.site.lat:g}°, heading {case.heading % 360:g}°; another heading can give "
        "quite another figure.</p>"
    )
    sections = []
    for title, keys in zip(("Position", "Velocity", "Attitude"), _CURVES, strict=True):
        drawings = []
        for key in keys:
            words, unit = QUANTITIES[key]
            traces = [
                line_of(hours, table[key], _WORDS[name], _COLOURS[name],
                        hovertemplate=f"%{{y:.4g}} {unit}")
                for name, table in found.series.items()
            ]  # fmt: skip
            text = f"{words.capitalize()}, {unit}, over the hours."
            layout = plot_layout(300, "time, h", f"{words}, {unit}")
            drawings.append(Drawing(words, figure_of(traces, layout), text))
        sections.append(Section(title, drawings=drawings))
    rows = [
        ("array", case.array.name),
        ("single axis", f"{case.single.name}, period {case.single.period:.5g} s"),
        ("two axes", f"{case.double.name}, period {case.double.period:.5g} s"),
    ]
    sections.append(Section("Inputs", html=definition_table(rows, "What was propagated")))
    return Page(f"Rotation over the hours: {case.name}", head, sections)


def _map(name: str, found: RotationComparison, ratio: np.ndarray, text: str) -> Drawing:
    """Draw error fixed over error turned, by its logarithm: both maps have one scale."""
    case = found.case
    ticks = (0.1, 0.3, 1, 3, 10, 30, 100)
    trace = heatmap(
        x=case.headings, y=case.latitudes, z=np.log10(ratio), customdata=ratio, zmin=-2, zmax=2,
        colorscale=[[0, "#b2182b"], [0.5, "#f7f7f7"], [1, "#2166ac"]],
        colorbar={
            "title": {"text": "fixed / turned"}, "tickvals": np.log10(ticks).tolist(),
            "ticktext": [f"{t:g}" for t in ticks],
        },
        hovertemplate="heading %{x}, latitude %{y}: %{customdata:.3g} times<extra></extra>",
    )  # fmt: skip
    layout = plot_layout(380, "heading, deg", "latitude, deg", hovermode="closest")
    return Drawing(name, figure_of([trace], layout), text)
