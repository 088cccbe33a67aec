"""Typeset the formulas, and put the pictures that `pictures` draws into the pages.

A picture is named as ``![what it shows](picture:name)``. All are drawn anew at each build, so none
can be older than the library, and go into the page itself, so that its text colour is theirs in the
light scheme and in the dark one.
"""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError

sys.path.insert(0, str(Path(__file__).resolve().parent))

import formulas
import pictures

_PICTURE = re.compile(r"!\[(?P<alt>[^\]]*)\]\(picture:(?P<name>[\w-]+)\)", re.DOTALL)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Replace each picture's reference by the picture."""

    def drawn(match: re.Match[str]) -> str:
        name, alt = match["name"], " ".join(match["alt"].split())
        where = page.file.src_uri
        if name not in pictures.PICTURES:
            raise PluginError(f"{where}: there is no picture '{name}' in docs/pictures.py")
        if len(alt) < 20:
            raise PluginError(f"{where}: say what the picture '{name}' shows, in its brackets")
        svg = pictures.draw(name)
        label = html.escape(alt)
        return f'<figure class="picture" role="img" aria-label="{label}">{svg}</figure>\n'

    return _PICTURE.sub(drawn, markdown)


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Typeset the formulas."""
    try:
        return formulas.typeset(content)
    except formulas.FormulaError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from None


_FETCHED = re.compile(
    r'<(?:script|img|iframe|link rel="stylesheet")[^>]+(?:src|href)="(?:https?:)?//[^"]*'
)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Refuse a page that would fetch something from a network."""
    if fetched := _FETCHED.search(output):
        raise PluginError(f"{page.file.src_uri}: fetches from a network: {fetched[0]}")
    return output
