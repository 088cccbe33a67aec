"""The page of ``schuler plan``: the search, the schemes found, and the trade between them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from schuler.centrifuge import PUBLISHED_POSITIONS, Plan, judge
from schuler.centrifuge.scorecard import LABELS
from schuler.reports.centrifuge import correlation_figure
from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table

__all__ = ["one_plan_page", "plan_page"]


def plan_page(plans: Sequence[Plan]) -> Page:
    """Return the page of one plan, or of several with different numbers of positions."""
    from schuler.centrifuge import coefficient_names

    best = min(plans, key=lambda p: p.objective)
    problem = best.problem
    name = problem.objective.name
    sections = []
    if len(plans) > 1:
        sections.append(
            Section("The trade", html=_by_objective(plans), drawings=[_trade(plans, name)])
        )
    found = judge(problem.plant, best.positions, problem.dwell)
    scheme = [
        (f"position {k}", ", ".join(f"{v:g}°" for v in row))
        for k, row in enumerate(best.positions, 1)
    ]
    sections += [
        *(
            [Section("The search", drawings=[_search(plans, name)])]
            if any(len(plan.history) > 1 for plan in plans)
            else []
        ),
        Section(
            "The scheme",
            html=definition_table(scheme, "Alpha, beta, gamma") + _scorecard(best),
            drawings=[
                _positions(best),
                Drawing(
                    "correlation",
                    correlation_figure(found.correlation, coefficient_names()),
                    "Correlation of the coefficients' errors after the scheme.",
                    "Matrix of correlations",
                ),
            ],
        ),
    ]
    told = best.scorecard.headline
    head = (
        "<h1>Plan of a centrifuge test</h1>"
        f'<p class="value">{best.objective:.4g} <span class="pm">{LABELS[name]}</span></p>'
        f'<p class="sub">{len(best.positions)} positions of {problem.dwell:g} s; {escape(told)}. '
        f"Worst sigma {100 * best.worst_relative_sigma:.3g} % of a coefficient. The search cost "
        f"{sum(p.evaluations for p in plans)} evaluations, "
        f"{sum(p.seconds for p in plans):.1f} s; the test takes "
        f"{len(best.positions) * problem.dwell:g} s at its positions.</p>"
    )
    return Page("Plan of a centrifuge test", head, sections)


def one_plan_page(plan: Plan) -> Page:
    """Return the page of one plan."""
    return plan_page([plan])


def _scorecard(plan: Plan) -> str:
    """Return the table of all objectives: this plan, the published scheme, the best found."""

    def cell(value: float | None) -> str:
        return f"<td>{'–' if value is None else f'{value:.4g}'}</td>"

    body = "".join(
        f'<tr><th scope="row">{escape(LABELS[row["name"]])}'
        + (" (optimised)" if row["name"] == plan.scorecard.optimised else "")
        + "</th>" + "".join(cell(row[key]) for key in ("plan", "published", "best")) + "</tr>"
        for row in plan.scorecard.rows()
    )  # fmt: skip
    head = "".join(f'<th scope="col">{h}</th>' for h in ("this plan", "published", "best found"))
    return (
        "<table><caption>By every objective; the best is what a search for that objective alone "
        f"finds</caption><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _by_objective(plans: Sequence[Plan]) -> str:
    """Return the table of all objectives by the number of positions, the least of each in bold."""

    def cell(value: float, least: float) -> str:
        if not np.isfinite(value):
            return "<td>–</td>"
        return (
            f"<td><strong>{value:.4g}</strong></td>" if value == least else f"<td>{value:.4g}</td>"
        )

    body = ""
    for key, label in LABELS.items():
        values = [plan.scorecard.plan[key] for plan in plans]
        body += (
            f'<tr><th scope="row">{escape(label)}</th>'
            + "".join(cell(value, min(values)) for value in values) + "</tr>"
        )  # fmt: skip
    head = "".join(f'<th scope="col">{len(plan.positions)}</th>' for plan in plans)
    return (
        "<table><caption>By every objective, for each number of positions; the least is bold"
        f"</caption><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _search(plans: Sequence[Plan], name: str) -> Drawing:
    traces: list[Any] = []
    for plan in plans:
        if not plan.history:
            continue
        seconds, _, value = (np.array(v) for v in zip(*plan.history, strict=True))
        traces.append(
            scatter(
                x=seconds, y=value, mode="lines+markers", line={"shape": "hv"},
                name=f"{len(plan.positions)} positions",
                hovertemplate="%{x:.1f} s: %{y:.4g}<extra></extra>",
            )
        )  # fmt: skip
    layout = plot_layout(360, "time, s", f"best {LABELS[name]}", hovermode="closest")
    caption = "The best value so far; each mark is a round from a start of its own."
    return Drawing("search", figure_of(traces, layout), caption)


def _positions(plan: Plan) -> Drawing:
    printed = np.array(PUBLISHED_POSITIONS, float)
    layout = plot_layout(440, "alpha, deg", "gamma, deg", hovermode="closest")
    for axis in ("xaxis", "yaxis"):
        layout[axis].update(range=[-8, 368], dtick=45)
    figure = figure_of(
        [
            scatter(
                x=rows[:, 0], y=rows[:, 2], mode="markers", name=name,
                marker={"color": colour, "size": 12, "symbol": symbol},
                hovertemplate="alpha %{x:g}°, gamma %{y:g}°<extra></extra>",
            )
            for rows, name, colour, symbol in (
                (plan.positions, "this plan", BLUE, "circle"),
                (printed, "published", GREY, "x"),
            )
        ],
        layout,
    )  # fmt: skip
    return Drawing(
        "positions", figure, "Where the platform is put.", "Positions of plan and publication"
    )


def _trade(plans: Sequence[Plan], name: str) -> Drawing:
    count = [len(p.positions) for p in plans]
    layout = plot_layout(400, "positions", LABELS[name], hovermode="closest")
    layout["xaxis"].update(dtick=1)
    # Largest sigma over wanted and the worst sigma in per cent are one curve.
    other = "sum-rho" if name in ("min-max", "time") else "min-max"
    layout["yaxis2"] = {
        "title": {"text": LABELS[other]}, "overlaying": "y", "side": "right",
        "rangemode": "tozero", "showgrid": False,
    }  # fmt: skip
    layout["margin"] = {**layout.get("margin", {}), "r": 70}
    figure = figure_of(
        [
            scatter(
                x=count, y=[p.objective for p in plans], name=name, mode="lines+markers",
                line={"color": BLUE},
            ),
            scatter(
                x=count, y=[p.scorecard.plan[other] for p in plans], name=other,
                mode="lines+markers", line={"color": ORANGE, "dash": "dash"}, yaxis="y2",
            ),
        ],
        layout,
    )  # fmt: skip
    return Drawing(
        "trade",
        figure, "What more positions are worth, by the objective that was made small and another.",
        "Two objectives against the number of positions",
    )  # fmt: skip
