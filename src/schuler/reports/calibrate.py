"""The page of ``schuler calibrate poses``."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler.calibration import PosesFit
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table, graph_objects, write_page

__all__ = ["poses_report"]

Array = NDArray[np.float64]


def poses_report(fit: PosesFit, path: str | Path) -> None:
    """Write the page of a calibration by hand-held poses.

    Raises
    ------
    InputError
        If the file cannot be written.
    SchulerError
        If Plotly is not installed.
    """
    go = graph_objects()
    k = np.arange(1, len(fit.dwells) + 1)
    forces = figure_of(
        [
            go.Bar(
                x=k[rows], y=1e3 * fit.residual[rows], name=name, marker={"color": colour},
                hovertemplate="pose %{x}: %{y:.2f} mm/s²<extra></extra>",
            )
            for rows, name, colour in ((fit.used, "used", BLUE), (~fit.used, "left out", ORANGE))
            if rows.any()
        ],
        plot_layout(360, "pose", "|f| − gravity, mm/s²", hovermode="closest"),
    )  # fmt: skip
    c = fit.calibration
    sections = [
        Section(
            "Accelerometers",
            html=definition_table(
                [
                    (f"{axis}: bias", f"{c.accel_bias[i]:.7g} ± {c.sigma['accel_bias'][i]:.2g}")
                    for i, axis in enumerate("xyz")
                ]
                + [
                    (f"matrix {axis}", "  ".join(f"{v:.6g}" for v in c.accel_matrix[i]))
                    for i, axis in enumerate("xyz")
                ],
                "True = matrix (output − bias)",
            ),
            drawings=[
                Drawing(
                    forces, "By how much the length of the calibrated force misses gravity.",
                    "Residual of each pose",
                )
            ],
        )
    ]  # fmt: skip
    if fit.turn_error.size:
        degrees = np.rad2deg(fit.turn_angle)
        turns = figure_of(
            [
                go.Scatter(
                    x=degrees, y=np.rad2deg(y), name=name, mode="markers",
                    marker={"color": colour, "size": 8, "symbol": symbol},
                    hovertemplate="turned gravity by %{x:.1f}°: missed by %{y:.2f}°<extra></extra>",
                )
                for y, name, colour, symbol in (
                    (fit.turn_error_before, "scale as given", GREY, "x"),
                    (fit.turn_error, "calibrated", BLUE, "circle"),
                )
            ],
            plot_layout(
                400, "angle between gravity before and after the turn, deg",
                "gyros miss gravity by, deg", hovermode="closest",
            ),
        )  # fmt: skip
        turns.update_yaxes(type="log", dtick=1, exponentformat="power")
        rms = np.rad2deg(np.sqrt(np.mean(fit.turn_error**2)))
        sections.append(
            Section(
                "Gyros",
                html=definition_table(
                    [
                        (f"matrix {axis}", "  ".join(f"{v:.6g}" for v in c.gyro_matrix[i]))
                        for i, axis in enumerate("xyz")
                    ],
                    "rad/s = matrix (output − bias)",
                ),
                drawings=[
                    Drawing(
                        turns,
                        "The gyros turn gravity from one pose to the next; the accelerometers say "
                        f"where it is. Left of a miss: {rms:.2g}° rms.",
                        "Gravity-turn consistency of the gyros",
                    )
                ],
            )
        )
    items = "".join(f"<li>{escape(text)}</li>" for text in fit.unseen)
    sections.append(Section("What these poses do not show", html=f"<ul>{items}</ul>"))
    head = (
        f"<h1>Calibration by poses · {escape(c.name)}</h1>"
        f'<p class="value">{1e3 * fit.rms:.2f} mm/s² <span class="pm">rms</span></p>'
        f'<p class="sub">what |f| misses gravity by, over {int(fit.used.sum())} of '
        f"{len(fit.dwells)} poses; gravity {fit.gravity:g} m/s²</p>"
    )
    write_page(path, f"Calibration by poses: {c.name}", head, sections)
