"""The page of ``schuler published``: printed figures beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, GREEN, GREY, ORANGE, PURPLE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section

__all__ = ["experiment_page", "experiments_page"]

_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, GREY)
_DASHES = ("solid", "dash", "dot")

_CLOSE = 0.1
"""Share of a printed figure within which it counts as met."""

_KEYS = ("printed", "document_method", "best", "limit")
_HEADS = ("printed", "by its method", "by schuler", "limit")


def _values(row: Mapping[str, Any]) -> tuple[float | None, ...]:
    return tuple(row[key] for key in _KEYS)


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def _table(found: Mapping[str, Any]) -> str:
    body = "".join(
        f'<tr><th scope="row" class="words">{escape(row["quantity"])}</th>'
        f"<td>{escape(row['unit'])}</td>"
        + "".join(f"<td>{_cell(v)}</td>" for v in _values(row))
        + f'<td class="words">{escape(row["note"])}</td></tr>'
        for row in found["rows"]
    )
    heads = ("quantity", "unit", *_HEADS, "note")
    return (
        f"<table><caption>{escape(found['citation'])}</caption><thead><tr>"
        + "".join(f'<th scope="col">{head}</th>' for head in heads)
        + f"</tr></thead><tbody>{body}</tbody></table>"
    )


def _positive(row: Mapping[str, Any]) -> bool:
    return all(value is None or value > 0.0 for value in _values(row))


def _drawings(name: str, found: Mapping[str, Any]) -> list[Drawing]:
    """Draw all rows, a drawing for each unit.

    Rows with a figure that is nought or negative have a drawing of their own with a linear axis, so
    that none is left out and the others keep a logarithmic one.
    """
    marks = (("diamond", ORANGE), ("circle", GREY), ("square", BLUE), ("line-ns-open", GREEN))
    rows = [row for row in found["rows"] if any(v is not None for v in _values(row))]
    out = []
    for unit, positive in dict.fromkeys((row["unit"], _positive(row)) for row in rows):
        own = [row for row in rows if (row["unit"], _positive(row)) == (unit, positive)]
        said = "no unit" if unit == "1" else unit
        traces: list[Any] = []
        for k, (head, (symbol, colour)) in enumerate(zip(_HEADS, marks, strict=True)):
            picked = [(_values(row)[k], row["quantity"]) for row in own]
            picked = [(v, quantity) for v, quantity in picked if v is not None]
            if picked:
                traces.append(
                    scatter(
                        x=[v for v, _ in picked], y=[quantity for _, quantity in picked],
                        mode="markers", name=head, hovertemplate="%{x:.4g}",
                        marker={"symbol": symbol, "color": colour, "size": 9,
                                "line": {"width": 2, "color": colour}},
                    )
                )  # fmt: skip
        layout = plot_layout(max(220, 110 + 24 * len(own)), f"figure, {said}", "")
        layout["xaxis"].update(type="log" if positive else "linear")
        # In the rows' order, whichever of them the first trace has.
        layout["yaxis"].update(
            automargin=True,
            categoryorder="array",
            categoryarray=[row["quantity"] for row in own],
            range=[len(own) - 0.5, -0.5],
        )
        layout["hovermode"] = "y unified"
        text = f"Printed figures beside ours and the limit, {said}"
        text += ", on a logarithmic axis." if positive else ", on a linear axis."
        title = f"{name} {unit}" + ("" if positive else ", signed")
        out.append(Drawing(title, figure_of(traces, layout), text, f"{name}: {text}"))
    return out


def _curves(figure: Any) -> Drawing:
    """Draw a figure of an experiment: lines, and points where there are few."""
    traces = []
    for k, curve in enumerate(figure.curves):
        few = len(curve.x) <= 60
        traces.append(
            scatter(
                x=[float(v) for v in curve.x], y=[float(v) for v in curve.y], name=curve.name,
                mode="lines+markers" if few else "lines", hovertemplate="%{y:.4g}",
                line={"color": _COLOURS[k % len(_COLOURS)], "width": 1.6,
                      "dash": _DASHES[k // len(_COLOURS) % len(_DASHES)]},
            )
        )  # fmt: skip
    layout = plot_layout(400, figure.x, figure.y)
    each = [float(v) for curve in figure.curves for v in curve.x]
    if each and all(v.is_integer() for v in each) and max(each) - min(each) <= 20.0:
        # Numbers of cases or modes: nothing lies between them.
        layout["xaxis"].update(dtick=1)
    if figure.log_y:
        layout["yaxis"].update(type="log", exponentformat="power")
    return Drawing(
        figure.title, figure_of(traces, layout), f"{figure.title}.", f"{figure.title}: lines."
    )


def experiment_page(found: Any) -> Page:
    """Return the page of one experiment (`schuler.published.Experiment`)."""
    return experiments_page([found])


def experiments_page(experiments: Sequence[Any]) -> Page:
    """Return the page of experiments.

    Parameters
    ----------
    experiments : sequence of schuler.published.Experiment
        That package imports this one's.
    """
    sections = []
    found = {each.name: each.to_dict() for each in experiments}
    drawn_by = {each.name: each.drawn for each in experiments}
    for name, each in found.items():
        drawn = [_curves(figure) for figure in drawn_by[name]]
        errata = "".join(f"<li>{escape(text)}</li>" for text in each["errata"])
        sections.append(
            Section(
                f"{name} · {each['title']}",
                f"{_table(each)}<h3>Assumed, and contradictory</h3><ul>{errata}</ul>",
                [*drawn, *_drawings(name, each)],
            )
        )
    rows = [row for each in found.values() for row in each["rows"]]
    printed = [row for row in rows if None not in (row["printed"], row["document_method"])]
    met = sum(
        abs(row["document_method"] - row["printed"]) <= _CLOSE * abs(row["printed"])
        for row in printed
    )
    value = (
        f'{met} of {len(printed)} <span class="pm">printed figures met within '
        f"{100 * _CLOSE:g} %</span>"
        if printed else "no figure is printed"
    )  # fmt: skip
    head = (
        "<h1>Published experiments, redone</h1>"
        f'<p class="value">{value}</p><p class="sub">by the document’s own method, in '
        f"{len(found)} document{'s' if len(found) > 1 else ''}. {len(rows)} figures: as printed, "
        "by the document’s method, by schuler’s best method on the same data, and the limit that "
        "no method beats.</p>"
    )
    return Page("Published experiments", head, sections)
