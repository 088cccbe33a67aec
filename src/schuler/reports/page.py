"""One page, one look: HTML around figures, with everything inside and all text escaped.

Nothing is fetched: the drawing library is in the page. Text that comes from files goes through
`html.escape`; figures travel as JSON in script elements whose content cannot end them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path

from schuler import __version__
from schuler._files import replacing
from schuler.reports.figure import Figure, graph_objects

__all__ = ["Drawing", "Page", "Section", "contradiction_box", "definition_table", "write_page"]


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
        """All drawings, in their order."""
        return [drawing for section in self.sections for drawing in section.drawings]


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
    for section in page.sections:
        parts.append(f"<section><h2>{escape(section.title)}</h2>{section.html}")
        for drawing in section.drawings:
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
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{escape(page.title)}</title>'
        f"<style>{style}</style></head><body><header>{page.head_html}</header><main>"
        f"{''.join(parts)}</main><footer>schuler {escape(__version__)} · "
        "drag over a figure to zoom, double-click to return</footer>"
        f"<script>{library}</script><script>{script}</script></body></html>\n"
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
