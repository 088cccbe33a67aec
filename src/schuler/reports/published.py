"""The page of ``schuler published``: printed figures beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from schuler.reports.figures import BLUE, GREEN, GREY, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Section, graph_objects, write_page

__all__ = ["published_report"]

_KEYS = ("printed", "document_method", "best", "limit")
_HEADS = ("printed", "by its method", "by schuler", "limit")


def _values(row: Mapping[str, Any]) -> tuple[float | None, ...]:
    return tuple(row[key] for key in _KEYS)


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def _table(found: Mapping[str, Any]) -> str:
    body = "".join(
        f"<tr><th scope='row' style='white-space:normal'>{escape(row['quantity'])}</th>"
        f"<td style='white-space:nowrap'>{escape(row['unit'])}</td>"
        + "".join(f"<td style='white-space:nowrap'>{_cell(v)}</td>" for v in _values(row))
        + f"<td style='min-width:15em'>{escape(row['note'])}</td></tr>"
        for row in found["rows"]
    )
    heads = ("quantity", "unit", *_HEADS, "note")
    return (
        f"<table><caption>{escape(found['citation'])}</caption><thead><tr>"
        + "".join(f'<th scope="col">{head}</th>' for head in heads)
        + f"</tr></thead><tbody>{body}</tbody></table>"
    )


def _drawing(name: str, found: Mapping[str, Any]) -> Drawing | None:
    """Draw the rows that have two figures at least, each over its printed one or the document's."""
    go = graph_objects()
    rows = [row for row in found["rows"] if sum(v is not None for v in _values(row)) > 1]
    # Spreads and errors fill a logarithmic axis; signed figures are for the table.
    rows = [row for row in rows if all(v is None or v > 0 for v in _values(row))]
    if not rows:
        return None
    names = [f"{row['quantity']}, {row['unit']}" for row in rows]
    marks = (("diamond", ORANGE), ("circle", GREY), ("square", BLUE), ("line-ns-open", GREEN))
    traces: list[Any] = []
    for k, (head, (symbol, colour)) in enumerate(zip(_HEADS, marks, strict=True)):
        picked = [(_values(row)[k], name) for row, name in zip(rows, names, strict=True)]
        picked = [(v, name) for v, name in picked if v is not None]
        if picked:
            traces.append(
                go.Scatter(
                    x=[v for v, _ in picked], y=[name for _, name in picked], mode="markers",
                    name=head, hovertemplate="%{x:.4g}",
                    marker={"symbol": symbol, "color": colour, "size": 9,
                            "line": {"width": 2, "color": colour}},
                )
            )  # fmt: skip
    layout = plot_layout(max(260, 90 + 24 * len(rows)), "", "")
    layout["xaxis"].update(type="log")
    layout["yaxis"].update(autorange="reversed", automargin=True)
    layout["hovermode"] = "y unified"
    text = "Printed figures beside ours and the limit, on a logarithmic axis."
    return Drawing(figure_of(traces, layout), text, f"{name}: {text}")


def published_report(data: Mapping[str, Any], path: str | Path) -> None:
    """Write the page of experiments.

    Parameters
    ----------
    data : mapping
        With the keys of the JSON schema `schuler.published/1`.
    path : str or Path
        The HTML file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    sections = []
    found = data["experiments"]
    for name, each in found.items():
        drawing = _drawing(name, each)
        errata = "".join(f"<li>{escape(text)}</li>" for text in each["errata"])
        sections.append(
            Section(
                f"{name} · {each['title']}",
                f"{_table(each)}<h3>Assumed, and contradictory</h3><ul>{errata}</ul>",
                [] if drawing is None else [drawing],
            )
        )
    count = sum(len(each["rows"]) for each in found.values())
    head = (
        "<h1>Published experiments, redone</h1>"
        f'<p class="value">{len(found)} <span class="pm">'
        f"document{'s' if len(found) > 1 else ''}</span></p>"
        f'<p class="sub">{count} figures: as printed, by the document’s method, by schuler’s best '
        "method on the same data, and the limit that no method beats</p>"
    )
    write_page(path, "Published experiments", head, sections)
