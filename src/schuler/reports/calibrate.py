"""Pages of ``schuler calibrate``: hand-held poses, and tests on a turntable."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler.calibration import PosesFit, TableTest
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table, graph_objects, write_page

__all__ = ["poses_report", "table_report"]

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


def table_report(test: TableTest, path: str | Path) -> None:
    """Write the page of a test on a turntable.

    Parameters
    ----------
    test : TableTest
    path : str or Path
        The HTML file.

    Raises
    ------
    InputError
        If the file cannot be written.
    SchulerError
        If Plotly is not installed.
    """
    go = graph_objects()
    rates = test.kind == "rates"
    unit, factor = ("deg/h", DEG_PER_HOUR) if rates else ("ug", MICRO_G)
    one = "turn" if rates else "dwell"
    k = np.arange(1, len(test.stretches) + 1)
    left = figure_of(
        [
            go.Bar(
                x=k, y=test.residual[:, j] / factor, name=axis, marker={"color": colour},
                hovertemplate=f"{one} %{{x}}: %{{y:.3g}} {unit}<extra>{axis}</extra>",
            )
            for j, (axis, colour) in enumerate(zip("xyz", (BLUE, ORANGE, GREY), strict=True))
        ],
        plot_layout(360, one, f"residual, {unit}", hovermode="closest", barmode="group"),
    )  # fmt: skip
    text = f"What the fit leaves of each {one}, by axis."
    found = definition_table(
        [(line.partition(":")[0], line.partition(":")[2]) for line in str(test).splitlines()[1:]],
        "Found, with 1 sigma",
    )
    stretches = definition_table(
        [
            (f"{one} {i}", f"{a:.3f} to {b:.3f} s; true " + ", ".join(f"{v:.6f}" for v in row + 0.0)
             + (" rad/s" if rates else " m/s²"))
            for i, ((a, b), row) in enumerate(zip(test.stretches, test.truth, strict=True), 1)
        ],
        "Times, and what is true",
    )  # fmt: skip
    write_page(
        path,
        f"Calibration on a turntable: {test.calibration.name}",
        f"<h1>Turntable · {escape(test.calibration.name)}</h1>"
        f'<p class="value">{test.residual_rms / factor:.3g} {unit} '
        f'<span class="pm">left, rms</span></p>'
        f'<p class="sub">{len(k)} {one}s; found: '
        f"{escape(', '.join(test.found).replace('_', ' '))}.</p>",
        [
            Section("Residuals", drawings=[Drawing(left, text, text)]),
            Section("Coefficients", html=found),
            Section("Stretches", html=stretches),
        ],
    )
