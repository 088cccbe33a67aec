"""The page of ``schuler navigate``: where it went, and how far off a reference it is."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from schuler.constants import ARCMIN
from schuler.earth import radii
from schuler.navigation import Evaluation, FreeNavigation
from schuler.navigation.evaluate import NAUTICAL_MILE
from schuler.reports.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    POINTS,
    figure_of,
    line_of,
    plot_layout,
)
from schuler.reports.page import Drawing, Page, Section, definition_table
from schuler.trajectory import Trajectory

__all__ = ["evaluation_page", "free_page", "local_way", "navigation_page"]


def navigation_page(path: Trajectory, evaluation: Evaluation | None = None) -> Page:
    """Return the page.

    Parameters
    ----------
    path : Trajectory
    evaluation : Evaluation or None
        Against a reference.
    """
    f = path.final
    rows = [
        ("time", f"{path.time[0]:.9g} to {path.time[-1]:.9g} s"),
        ("latitude", f"{f['lat_deg']:.8f} deg"),
        ("longitude", f"{f['lon_deg']:.8f} deg"),
        ("height", f"{f['height_m']:.3f} m"),
        ("velocity east, north, up", ", ".join(f"{v:.4f}" for v in f["velocity_enu"]) + " m/s"),
        ("heading, pitch, roll",
         f"{f['heading_deg']:.5f}, {f['pitch_deg']:.5f}, {f['roll_deg']:.5f} deg"),
    ]  # fmt: skip
    sigma = path.sigma
    if sigma is not None:
        for name, key, unit in (
            ("sigma of position east, north, up", "position_enu_m", "m"),
            ("sigma of velocity", "velocity_enu", "m/s"),
            ("sigma of phi", "phi_enu_arcmin", "arcmin"),
        ):
            rows.append((name, ", ".join(f"{v:.4g}" for v in sigma[key]) + f" {unit}"))
    sections = [Section("Where it went", drawings=[_track(path), _height(path)])]
    value = "by free-inertial navigation"
    sub = f"{path.time[-1] - path.time[0]:.6g} s; no reference was given"
    if evaluation is not None:
        e = evaluation.to_dict()
        value = f"{e['horizontal_m']:.4g} m off horizontally"
        sub = _drift(evaluation) + (
            f"{path.time[-1] - path.time[0]:.6g} s against {escape(e['reference'])}: "
            f"{e['north_m']:.4g} m north, {e['east_m']:.4g} east, {e['up_m']:.4g} up; "
            f"{e['nmi_per_h']:.3g} nmi/h"
        )
        if sigma is not None:
            spread = float(np.hypot(*sigma["position_enu_m"][:2]))
            sub += f"; 1 sigma of it {spread:.3g} m"
        rows.append(("median horizontal error", f"{e['cep_m']:.4g} m"))
        sections.append(Section("Against the reference", drawings=_errors(evaluation)))
    sections.append(Section("At the end", html=definition_table(rows, "The last row")))
    head = (
        f"<h1>Navigation · {escape(path.name)}</h1>"
        f'<p class="value">{value}</p><p class="sub">{sub}.</p>'
    )
    return Page(f"Navigation: {path.name}", head, sections)


def _drift(e: Evaluation) -> str:
    """Return in words how far the path had drifted after an hour, where it lasts one."""
    hours = (e.time - e.start) / 3600.0
    if hours[-1] < 1.0:
        return ""
    drift = float(np.interp(1.0, hours, e.radial)) / NAUTICAL_MILE
    return f"drift {drift:.3g} nmi in the first hour; "


def free_page(found: FreeNavigation) -> Page:
    """Return the page of a free-inertial navigation."""
    return navigation_page(found.path, found.evaluation)


def evaluation_page(e: Evaluation) -> Page:
    """Return the page of a path's errors against a reference."""
    figures = e.to_dict()
    head = (
        "<h1>Errors of a path</h1>"
        f'<p class="value">{figures["horizontal_m"]:.4g} m off</p><p class="sub">horizontally at '
        f"the end, against {escape(e.reference)}; {figures['nmi_per_h']:.3g} nmi/h.</p>"
    )
    return Page(
        f"Errors against {e.reference}", head,
        [Section("Against the reference", drawings=_errors(e))],
    )  # fmt: skip


def _thinned(n: int) -> Any:
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).astype(int))


def local_way(path: Trajectory, origin: Trajectory) -> tuple[Any, Any]:
    """Return east and north of the first point of another trajectory, m."""
    lat, lon, _ = path.position.T
    first, beside, up = origin.position[0]
    rm, rn = radii(first)
    east = (np.unwrap(lon) - beside + np.pi) % (2.0 * np.pi) - np.pi
    x = np.unwrap(east) * np.cos(first) * (float(rn) + up)
    return x, (lat - first) * (float(rm) + up)


def _track(path: Trajectory) -> Drawing:
    k = _thinned(len(path))
    x, y = local_way(path.rows(k), path)
    layout = plot_layout(460, "east, m", "north, m", hovermode="closest")
    layout["yaxis"]["scaleanchor"] = "x"
    text = "The way over ground, from the start."
    return Drawing("way", figure_of([line_of(x, y, "way", BLUE)], layout), text)


def _height(path: Trajectory) -> Drawing:
    k = _thinned(len(path))
    text = "Height above the ellipsoid."
    trace = line_of(path.time[k], path.position[k, 2], "height", BLUE)
    return Drawing(
        "height", figure_of([trace], plot_layout(260, "time, s", "height, m")), text, text
    )


def _errors(e: Evaluation) -> list[Drawing]:
    k = _thinned(len(e.time))
    t = e.time[k]
    colours = (BLUE, ORANGE, GREY)
    out = []

    def draw(what: str, values: Any, unit: str, text: str) -> None:
        layout = plot_layout(300, "time, s", f"{what} error, {unit}")
        traces = [
            line_of(t, values[k, j], name, colours[j], hovertemplate="%{y:.4g}")
            for j, name in enumerate(("east", "north", "up"))
        ]
        out.append(Drawing(f"{what} error", figure_of(traces, layout), text))

    draw("position", e.position, "m", "Position error, path minus reference.")
    if e.velocity is not None:
        draw("velocity", e.velocity, "m/s", "Velocity error.")
    if e.phi is not None:
        draw("attitude", e.phi / ARCMIN, "arcmin", "Misalignment phi of the attitude.")
    out[0].figure.data.append(
        line_of(t, e.radial[k], "horizontal", GREEN, hovertemplate="%{y:.4g}")
    )  # fmt: skip
    return out
