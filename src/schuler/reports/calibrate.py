"""Pages of ``schuler calibrate``: hand-held poses, and tests on a turntable."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import NDArray

from schuler.calibration import BodyVelocityFit, PosesFit, SystematicFit, TableTest
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.reports.figure import bar, scatter
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table
from schuler.units import percent

__all__ = ["doppler_page", "poses_page", "systematic_page", "table_page"]

Array = NDArray[np.float64]


def poses_page(fit: PosesFit) -> Page:
    """Return the page of a calibration by hand-held poses."""
    k = np.arange(1, len(fit.dwells) + 1)
    forces = figure_of(
        [
            bar(
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
                    "poses",
                    forces, "By how much the length of the calibrated force misses gravity.",
                    "Residual of each pose",
                )
            ],
        )
    ]  # fmt: skip
    if fit.turn_error.size:
        degrees = np.rad2deg(fit.turn_angle)
        layout = plot_layout(
            400, "angle between gravity before and after the turn, deg",
            "gyros miss gravity by, deg", hovermode="closest",
        )  # fmt: skip
        layout["yaxis"].update(type="log", dtick=1, exponentformat="power")
        turns = figure_of(
            [
                scatter(
                    x=degrees, y=np.rad2deg(y), name=name, mode="markers",
                    marker={"color": colour, "size": 8, "symbol": symbol},
                    hovertemplate="turned gravity by %{x:.1f}°: missed by %{y:.2f}°<extra></extra>",
                )
                for y, name, colour, symbol in (
                    (fit.turn_error_before, "scale as given", GREY, "x"),
                    (fit.turn_error, "calibrated", BLUE, "circle"),
                )
            ],
            layout,
        )  # fmt: skip
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
                        "turns",
                        turns,
                        "The gyros turn gravity from one pose to the next; the accelerometers say "
                        f"where it is. Left of a miss: {rms:.2g}° rms.",
                        "Gravity-turn consistency of the gyros",
                    )
                ],
            )
        )
    items = "".join(f"<li>{escape(text)}</li>" for text in fit.unseen)
    sections.append(Section("Not observable from these poses", html=f"<ul>{items}</ul>"))
    head = (
        f"<h1>Calibration by poses · {escape(c.name)}</h1>"
        f'<p class="value">{1e3 * fit.rms:.2f} mm/s² <span class="pm">rms</span></p>'
        f'<p class="sub">what |f| misses gravity by, over {int(fit.used.sum())} of '
        f"{len(fit.dwells)} poses; gravity {fit.gravity:g} m/s²</p>"
    )
    return Page(f"Calibration by poses: {c.name}", head, sections)


def table_page(test: TableTest) -> Page:
    """Return the page of a test on a turntable.

    Parameters
    ----------
    test : TableTest
    """
    rates = test.kind == "rates"
    unit, factor = ("deg/h", DEG_PER_HOUR) if rates else ("ug", MICRO_G)
    one = "turn" if rates else "dwell"
    k = np.arange(1, len(test.stretches) + 1)
    left = figure_of(
        [
            bar(
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
    return Page(
        f"Calibration on a turntable: {test.calibration.name}",
        f"<h1>Turntable · {escape(test.calibration.name)}</h1>"
        f'<p class="value">{test.residual_rms / factor:.3g} {unit} '
        f'<span class="pm">left, rms</span></p>'
        f'<p class="sub">{len(k)} {one}s; found: '
        f"{escape(', '.join(test.found).replace('_', ' '))}.</p>",
        [
            Section("Residuals", drawings=[Drawing("residuals", left, text)]),
            Section("Coefficients", html=found),
            Section("Stretches", html=stretches),
        ],
    )


def systematic_page(fit: SystematicFit) -> Page:
    """Return the page of a calibration by a navigator's errors: coefficients with their sigma."""
    rows = fit.rows()
    drawings = []
    for part, unit in (
        ("gyro bias", "deg/h"), ("accelerometer bias", "ug"), ("gyro", "ppm"),
        ("accelerometer", "ppm"),
    ):  # fmt: skip
        own = [row for row in rows if row["unit"] == unit and row["name"].startswith(part)]
        if not own:
            continue
        what = part if "bias" in part else f"{part} matrix"
        layout = plot_layout(120 + 34 * len(own), f"{what}, {unit}", "", hovermode="closest")
        layout["yaxis"].update(autorange="reversed")
        trace = scatter(
            x=[row["value"] for row in own], y=[row["name"] for row in own], mode="markers",
            name="found, ± 1 sigma", marker={"color": BLUE, "size": 8},
            error_x={"type": "data", "array": [row["sigma"] for row in own], "color": BLUE},
            hovertemplate="%{y}: %{x:.4g} " + unit + "<extra></extra>",
        )  # fmt: skip
        text = f"{what.capitalize()} of each axis, with 1 sigma."
        drawings.append(Drawing(what, figure_of([trace], layout), text))
    table = definition_table(
        [
            (row["name"], f"{row['value']:.5g} ± {row['sigma']:.2g} {row['unit']}"
             + ("" if row["seen"] else " (not observable)"))
            for row in rows
        ],
        "Coefficients, with 1 sigma",
    )  # fmt: skip
    name = fit.calibration.name
    head = (
        f"<h1>Systematic calibration · {escape(name)}</h1>"
        f'<p class="value">{len(rows) - len(fit.unseen)} <span class="pm">of {len(rows)} '
        "coefficients observed</span></p>"
        f'<p class="sub">Mean squared innovation {fit.nis:.3g} (1 where the noise is as it is said)'
        "</p>"
    )
    return Page(
        f"Systematic calibration: {name}", head,
        [Section("Estimates", html=table, drawings=drawings)],
    )  # fmt: skip


def doppler_page(fit: BodyVelocityFit) -> Page:
    """Return the page of a Doppler log's calibration: its mounting and what is left."""
    axes = ("right", "forward", "up")
    mount = plot_layout(300, "axis of the sensor", "mounting angle, deg", hovermode="closest")
    left = plot_layout(300, "axis of the sensor", "residual, m/s rms", hovermode="closest")
    left["yaxis"]["rangemode"] = "tozero"
    angles = scatter(
        x=list(axes), y=np.rad2deg(fit.mount), mode="markers", name="mounting, ± 1 sigma",
        marker={"color": BLUE, "size": 9},
        error_y={"type": "data", "array": np.rad2deg(fit.mount_sigma), "color": BLUE},
        hovertemplate="%{x}: %{y:.4g} deg<extra></extra>",
    )  # fmt: skip
    bars = bar(x=list(axes), y=fit.residual, name="residual", marker={"color": GREY},
               hovertemplate="%{x}: %{y:.3g} m/s<extra></extra>")  # fmt: skip
    told = "Rotation vector from the body's axes to the sensor's, with 1 sigma."
    rest = f"What the fit leaves of the velocity, at {fit.speed:.3g} m/s rms."
    head = (
        f"<h1>Doppler log · {escape(fit.name)}</h1>"
        f'<p class="value">{100 * fit.scale:+.3f} % <span class="pm">± '
        f"{percent(fit.scale_sigma)}</span></p>"
        f'<p class="sub">scale factor, from {fit.rows} rows; {fit.residual_rms:.3g} m/s rms left'
        "</p>"
    )
    return Page(
        f"Doppler log: {fit.name}", head,
        [
            Section("Mounting", drawings=[Drawing("mounting", figure_of([angles], mount), told)]),
            Section("Residuals", drawings=[Drawing("residuals", figure_of([bars], left), rest)]),
        ],
    )  # fmt: skip
