"""Pages of ``schuler calibrate``: hand-held poses, and what a centrifuge test shows."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.calibration import PosesFit
from schuler.centrifuge import (
    Judgement,
    Plant,
    PlatformFit,
    coefficient_names,
    coefficient_units,
    published_truth,
)
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table, graph_objects, write_page

__all__ = ["platform_report", "poses_report"]

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


def correlation_figure(correlation: Array, names: tuple[str, ...]) -> Any:
    """Return the matrix of correlations as a picture."""
    go = graph_objects()
    picture = go.Heatmap(
        z=correlation, x=list(names), y=list(names), zmin=-1, zmax=1, colorscale="RdBu",
        colorbar={"title": "ρ", "thickness": 14},
        hovertemplate="%{x}, %{y}: %{z:.3f}<extra></extra>",
    )  # fmt: skip
    layout = plot_layout(820, "", "", hovermode="closest")
    layout["xaxis"].update(tickangle=-90, tickfont={"size": 9}, showgrid=False, dtick=1)
    layout["yaxis"].update(
        autorange="reversed", tickfont={"size": 9}, showgrid=False, dtick=1, automargin=True
    )
    return figure_of([picture], layout)


def platform_report(
    plant: Plant, positions: Array, dwell: float, found: Judgement, fit: PlatformFit | None,
    path: str | Path,
) -> None:  # fmt: skip
    """Write the page of a centrifuge test: observability, weak combinations, the coefficients.

    Raises
    ------
    InputError
        If the file cannot be written.
    SchulerError
        If Plotly is not installed.
    """
    go = graph_objects()
    names = coefficient_names(plant.d_oo)
    units, factor = coefficient_units(plant.d_oo)
    layout = plot_layout(340, "number", "singular value", hovermode="closest")
    layout["yaxis"].update(type="log", dtick=1, exponentformat="power")
    singular = figure_of(
        [
            go.Scatter(
                x=np.arange(1, len(names) + 1), y=found.singular, mode="lines+markers",
                marker={"color": BLUE, "size": 6}, line={"color": BLUE, "width": 1},
                showlegend=False, hovertemplate="%{x}: %{y:.3g}<extra></extra>",
            )
        ],
        layout,
    )  # fmt: skip
    weak = definition_table(
        [
            (f"{s:.2g}", "  ".join(f"{v:+.2f} {name}" for name, v in parts.items()))
            for s, parts in found.weakest
        ],
        "Weakest combinations: singular value, and the coefficients with most part in them",
    )
    truth = published_truth() / factor if not plant.d_oo else None
    body = []
    for k, name in enumerate(names):
        cells = [name, units[k], f"{found.sigma[k] / factor[k]:.3g}", f"{found.relative[k]:.2f} %"]
        if truth is not None:
            cells.append(f"{truth[k]:g}")
            value = None if fit is None else fit.value[k] / factor[k]
            cells.append("–" if value is None else f"{value:.5g}")
            cells.append("–" if value is None else f"{100 * (value / truth[k] - 1):+.2f} %")
        body.append(
            f'<tr><th scope="row">{escape(cells[0])}</th>'
            + "".join(f"<td>{escape(c)}</td>" for c in cells[1:])
            + "</tr>"
        )
    head = ["", "unit", "sigma", "of published", "published", "estimate", "error"][: len(cells)]
    table = (
        "<table><caption>Coefficients: what the test shows of them</caption><thead><tr>"
        + "".join(f'<th scope="col">{h}</th>' if h else "<td></td>" for h in head)
        + "</tr></thead><tbody>"
        + "".join(body) + "</tbody></table>"
    )  # fmt: skip
    rows = [
        ("force", f"{plant.force:g} g"), ("rate of the arm", f"{plant.rate:g} deg/s"),
        ("noise", f"{plant.noise:g} ug at {plant.sampling:g} Hz"),
        ("attitude before a position", f"{1e3 * plant.attitude_prior:g} mrad"),
        ("dwell", f"{dwell:g} s"),
        *(
            (f"position {i}", ", ".join(f"{v:g}°" for v in row))
            for i, row in enumerate(positions, 1)
        ),
        *((name, f"{value:.5g}") for name, value in found.values.items()),
    ]  # fmt: skip
    write_page(
        path,
        "Centrifuge test",
        "<h1>Centrifuge test of a platform</h1>"
        f'<p class="value">Σ|ρ| {found.values["sum-rho"]:.1f}</p>'
        f'<p class="sub">over all pairs of {len(names)} coefficients; worst sigma '
        f"{found.relative.max():.3g} % of a published coefficient</p>",
        [
            Section(
                "Correlation",
                drawings=[
                    Drawing(
                        correlation_figure(found.correlation, names),
                        "Correlation of the coefficients' errors after the test.",
                        "Matrix of correlations",
                    )
                ],
            ),
            Section(
                "Observability",
                html=weak,
                drawings=[
                    Drawing(
                        singular,
                        "Singular values of the information, each coefficient scaled to one.",
                        "Singular values, falling",
                    )
                ],
            ),
            Section("Coefficients", html=table),
            Section("Inputs", html=definition_table(rows, "What was judged")),
        ],
    )
