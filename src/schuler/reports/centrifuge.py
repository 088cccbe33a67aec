"""The page of ``schuler calibrate centrifuge``: what the test shows, and what it has found."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.centrifuge import CentrifugeTest
from schuler.reports.figure import bar, heatmap, scatter
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table

__all__ = ["correlation_figure", "platform_page"]

Array = NDArray[np.float64]


def correlation_figure(correlation: Array, names: tuple[str, ...]) -> Any:
    """Return the matrix of correlations as a picture."""
    picture = heatmap(
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


def platform_page(test: CentrifugeTest) -> Page:
    """Return the page of a centrifuge test: errors, observability, weak combinations, coefficients.

    Parameters
    ----------
    test : CentrifugeTest
    """
    found, plant, scheme = test.judgement, test.plant, test.scheme
    rows = test.rows()
    names = tuple(row["name"] for row in rows)
    weak = definition_table(
        [
            (f"{s:.2g}", "  ".join(f"{v:+.2f} {name}" for name, v in parts.items()))
            for s, parts in found.weakest
        ],
        "Weakest combinations: singular value, and the coefficients with most part in them",
    )
    forces = scheme.forces or (plant.force,) * len(scheme.positions)
    inputs = [
        ("gimbal order", ", ".join(plant.order)),
        ("rate of the arm", f"{plant.rate:g} deg/s"),
        ("noise", f"{plant.noise:g} ug at {plant.sampling:g} Hz"),
        ("attitude before a position", f"{1e3 * plant.attitude_prior:g} mrad"),
        ("commanded rate", ", ".join(f"{v:g}" for v in plant.commanded) + " deg/h"),
        ("servo error", ", ".join(f"{v:g}" for v in plant.servo_error) + " deg/h"),
        ("mounting of the gyros", ", ".join(f"{v:g}" for v in plant.gyro_mounting) + " arcsec"),
        ("dwell", f"{scheme.dwell:g} s"),
        *(
            (f"position {i}", ", ".join(f"{v:g}°" for v in row) + f"; {force:g} g")
            for i, (row, force) in enumerate(zip(scheme.positions, forces, strict=True), 1)
        ),
        *((name, f"{value:.5g}") for name, value in found.values.items()),
    ]  # fmt: skip
    worst = int(found.relative.argmax())
    sub = f"1 sigma of {names[worst]}, the worst of {len(names)}, of its published value"
    if test.fit is not None:
        sub += f"; mean squared innovation {test.fit.nis:.3f}"
    if test.nees is not None:
        sub += f"; squared error over covariance {test.nees:.2f} per coefficient (1 is right)"
    sections = [
        Section("Coefficients", html=_table(rows), drawings=[_accuracy(test, rows)]),
        Section(
            "Correlation",
            drawings=[
                Drawing(
                    "correlation",
                    correlation_figure(found.correlation, names),
                    "Correlation of the coefficients' errors after the test.",
                    "Matrix of correlations",
                )
            ],
        ),
        Section("Observability", html=weak, drawings=[_singular(found.singular)]),
        Section("Inputs", html=definition_table(inputs, "What was judged")),
    ]
    return Page(
        "Centrifuge test",
        "<h1>Centrifuge test of a platform</h1>"
        f'<p class="value">{found.relative[worst]:.3g} % '
        f'<span class="pm">worst relative sigma</span></p><p class="sub">{sub}.</p>',
        sections,
    )


def _accuracy(test: CentrifugeTest, rows: list[dict[str, Any]]) -> Drawing:
    """Draw errors over their sigma where the truth is known, else the relative sigmas."""
    names = [row["name"] for row in rows]
    if test.fit is None or test.truth is None:
        text = "1 sigma of each coefficient, in per cent of its published value."
        layout = plot_layout(360, "", "sigma, %", hovermode="closest")
        layout["yaxis"]["type"] = "log"
        layout["xaxis"].update(tickangle=-90, tickfont={"size": 9}, dtick=1)
        trace = bar(x=names, y=test.judgement.relative, marker={"color": BLUE},
                       hovertemplate="%{x}: %{y:.3g} %<extra></extra>")  # fmt: skip
        return Drawing("accuracy", figure_of([trace], layout), text)
    error = (test.fit.value - test.truth) / test.fit.sigma
    text = "Error of each estimate over its own sigma; two of three lie within the lines at 1."
    layout = plot_layout(360, "", "error / sigma", hovermode="closest")
    layout["xaxis"].update(tickangle=-90, tickfont={"size": 9}, dtick=1)
    layout["shapes"] = [
        {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y,
         "line": {"color": GREY, "dash": "dot"}} for y in (-1, 1)
    ]  # fmt: skip
    colours = [ORANGE if abs(v) > 3 else BLUE for v in error]
    trace = bar(x=names, y=error, marker={"color": colours},
                   hovertemplate="%{x}: %{y:.2f}<extra></extra>")  # fmt: skip
    return Drawing("errors over sigma", figure_of([trace], layout), text)


def _singular(values: Array) -> Drawing:
    layout = plot_layout(340, "number", "singular value", hovermode="closest")
    layout["yaxis"].update(type="log", dtick=1, exponentformat="power")
    trace = scatter(
        x=np.arange(1, len(values) + 1), y=values, mode="lines+markers",
        marker={"color": BLUE, "size": 6}, line={"color": BLUE, "width": 1},
        showlegend=False, hovertemplate="%{x}: %{y:.3g}<extra></extra>",
    )  # fmt: skip
    return Drawing(
        "singular values",
        figure_of([trace], layout),
        "Singular values of the information, each coefficient scaled to one.",
        "Singular values, falling",
    )


def _table(rows: list[dict[str, Any]]) -> str:
    def cell(value: float | None, form: str) -> str:
        return "–" if value is None else format(value, form)

    columns = ["unit", "sigma", "estimate", "true", "error, %", "published true",
               "published estimate"]  # fmt: skip
    body = []
    for row in rows:
        true, estimate = row["true"], row["estimate"]
        off = 100 * (estimate / true - 1) if estimate is not None and true else None
        body.append([
            escape(row["unit"]), cell(row["sigma"], ".3g"), cell(estimate, ".5g"),
            cell(true, ".5g"), cell(off, "+.2f"), cell(row["published_true"], "g"),
            cell(row["published_estimate"], "g"),
        ])  # fmt: skip
    # What was not simulated has no estimate and no truth.
    shown = [k for k in range(len(columns)) if any(cells[k] != "–" for cells in body)]
    lines = [
        f'<tr><th scope="row">{escape(row["name"])}</th>'
        + "".join(f"<td>{cells[k]}</td>" for k in shown) + "</tr>"
        for row, cells in zip(rows, body, strict=True)
    ]  # fmt: skip
    head = ("", *(columns[k] for k in shown))
    return (
        "<table><caption>Coefficients: what the test shows of them</caption><thead><tr>"
        + "".join(f'<th scope="col">{h}</th>' if h else "<td></td>" for h in head)
        + "</tr></thead><tbody>" + "".join(lines) + "</tbody></table>"
    )  # fmt: skip
