"""One page, one look: HTML around figures, with everything inside and all text escaped.

Nothing is fetched: the drawing library is in the page. Text that comes from files goes through
`html.escape`; figures travel as JSON in script elements whose content cannot end them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path

from schuler import __version__
from schuler._files import replacing
from schuler.reports.figure import Figure, graph_objects

__all__ = ["Drawing", "Page", "Section", "contradiction_box", "definition_table", "write_page"]


_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)
"""What a browser may load: what is in the page, and nothing from a network."""

_LONG = 4
"""Sections from which a page has links to them."""

_TABLE = re.compile(r"<table.*?</table>", re.DOTALL)
_FEW_ROWS = 20
"""Rows of a table that is printed on one page."""

_CELL = re.compile(r"<td>([^<]+)</td>")
_SHORT = 36
"""Characters of a cell that is not broken: a number with its unit, not a sentence."""

_NAME = re.compile(r'<th scope="row">([^<]{1,16})</th>')
"""A short name of a row, which is not broken."""

_NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*e[-+]\d+")
_SPAN = r'<span class="whole">\g<0></span>'


@dataclass(frozen=True)
class Drawing:
    """A figure with its caption and what a screen reader says of it.

    Parameters
    ----------
    name : str
        What `figures` and ``--figures`` call it, plain words.
    figure : Figure
    caption : str
        Plain text.
    alt : str
        What a screen reader says of it, plain text; the caption when not given.
    """

    name: str
    figure: Figure
    caption: str
    alt: str = ""


@dataclass(frozen=True)
class Section:
    """A heading, then HTML (already escaped) and drawings."""

    title: str
    html: str = ""
    drawings: Sequence[Drawing] = ()


@dataclass(frozen=True)
class Page:
    """What a result shows: a title, a headline in HTML (already escaped), and sections."""

    title: str
    head_html: str
    sections: Sequence[Section]

    @property
    def drawings(self) -> list[Drawing]:
        """All drawings that show something, in their order."""
        return [d for section in self.sections for d in section.drawings if not d.figure.empty]


def contradiction_box(contradictions: Sequence[str]) -> str:
    """Return what a record contradicts, in a box of its own; nothing where there is nothing."""
    if not contradictions:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in contradictions)
    return f'<ul class="contradictions" aria-label="Inconsistent">{items}</ul>'


def definition_table(rows: Iterable[tuple[str, str]], caption: str) -> str:
    """Return an HTML table of names and values, escaped."""
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption>{escape(caption)}</caption><tbody>{body}</tbody></table>"


def _contents(sections: Sequence[Section]) -> str:
    """Return links to the sections of a page that is long."""
    if len(sections) < _LONG:
        return ""
    links = "".join(
        f'<a href="#section{count}">{escape(section.title)}</a>'
        for count, section in enumerate(sections, 1)
    )
    return f'<nav aria-label="Sections">{links}</nav>'


def _tables(html: str) -> str:
    """Return HTML whose tables can be scrolled by themselves, and whose numbers stay whole."""
    named = _NAME.sub(r'<th scope="row" class="whole">\1</th>', _TABLE.sub(_framed, html))
    return _CELL.sub(_whole, named)


def _framed(table: re.Match[str]) -> str:
    """Return a table in a frame that scrolls; a short one is not cut where it is printed."""
    short = " short" if table[0].count("<tr") <= _FEW_ROWS else ""
    return f'<div class="table{short}">{table[0]}</div>'


def _whole(cell: re.Match[str]) -> str:
    """Return a table's cell so that it, or each number in it, is not broken across lines."""
    if len(cell[1]) <= _SHORT:
        return f'<td class="whole">{cell[1]}</td>'
    return f"<td>{_NUMBER.sub(_SPAN, cell[1])}</td>"


def _script_json(data: str) -> str:
    """Return JSON that cannot close its script element or open a comment in it."""
    return data.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def write_page(page: Page, path: str | Path) -> None:
    """Write a page, whole or not at all.

    Parameters
    ----------
    page : Page
    path : str or Path
        The HTML file.

    Raises
    ------
    InputError
        If the file cannot be written.
    SchulerError
        If Plotly is not installed.
    """
    graph_objects()
    from plotly.offline import get_plotlyjs

    library = str(get_plotlyjs())
    assets = files("schuler.reports")
    style = assets.joinpath("page.css").read_text(encoding="utf-8")
    script = assets.joinpath("page.js").read_text(encoding="utf-8")
    parts: list[str] = []
    number = 0
    for count, section in enumerate(page.sections, 1):
        title = escape(section.title)
        parts.append(f'<section><h2 id="section{count}">{title}</h2>{_tables(section.html)}')
        for drawing in section.drawings:
            if drawing.figure.empty:
                continue
            number += 1
            data = _script_json(drawing.figure.to_plotly().to_json())
            parts.append(
                f'<figure data-name="{escape(drawing.name)}">'
                f'<div class="plot" id="plot{number}" role="img" '
                f'aria-label="{escape(drawing.alt or drawing.caption)}"></div>'
                f"<figcaption>{escape(drawing.caption)}</figcaption>"
                f'<script type="application/json" data-for="plot{number}">{data}</script></figure>'
            )
        parts.append("</section>")
    text = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{escape(page.title)}</title>'
        f"<style>{style}</style></head><body><header>{page.head_html}{_contents(page.sections)}</header><main>"
        f"{''.join(parts)}</main><footer>schuler {escape(__version__)} · "
        "drag over a figure to zoom, double-click to return</footer>"
        f"<script>{library}</script><script>{script}</script></body></html>\n"
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
