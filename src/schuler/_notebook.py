"""How records and results show themselves in a notebook: a headline, then a table or text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

__all__ = ["Shown", "bar", "card"]


def bar(share: float) -> str:
    """Return a bar as long as a share (0 to 1), in the colour of the notebook's text."""
    width = 100.0 * min(max(share, 0.0), 1.0)
    return (
        '<div style="display:inline-block;height:.7em;background:currentColor;opacity:.55;'
        f'width:{width:.0f}px;margin-left:.7em" role="img" aria-label="{width:.0f} %"></div>'
    )


def card(headline: str, rows: Iterable[tuple[str, str]], notes: Iterable[str] = ()) -> str:
    """Return HTML: a headline, names with values, and warnings.

    Parameters
    ----------
    headline : str
        Plain text.
    rows : iterable of (str, str)
        Name as plain text, value as HTML that is already escaped.
    notes : iterable of str
        Plain text.
    """
    left = 'style="text-align:left;font-weight:normal;opacity:.7"'
    body = "".join(
        f'<tr><th scope="row" {left}>{escape(name)}</th>'
        f'<td style="text-align:left">{value}</td></tr>'
        for name, value in rows
    )
    table = f"<table><tbody>{body}</tbody></table>" if body else ""
    said = "".join(f"<li>{escape(text)}</li>" for text in notes)
    return f"<div><strong>{escape(headline)}</strong>{table}" + (
        f"<ul>{said}</ul></div>" if said else "</div>"
    )


class Shown:
    """A result that a notebook shows: what ``str`` says of it, or its plain values as a table."""

    def _repr_html_(self) -> str:
        if type(self).__str__ is not object.__str__:
            headline, _, rest = str(self).partition("\n")
            if rest[:1] in ("", "\n") or "  " not in headline.strip():
                text = f"<pre>{escape(rest.strip(chr(10)))}</pre>" if rest.strip() else ""
                return f"<div><strong>{escape(headline)}</strong>{text}</div>"
            return f"<div><pre>{escape(str(self))}</pre></div>"
        values: Mapping[str, Any] = self.to_dict()  # type: ignore[attr-defined]
        rows = [(name, text) for name, value in values.items() if (text := _text(value))]
        return card(type(self).__name__, rows)


def _text(value: Any) -> str:
    """Return a value in HTML, or nothing where it is too much for a line."""
    if value is None or isinstance(value, bool | str):
        return "–" if value is None else escape(str(value))
    if isinstance(value, int | float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple) and len(value) <= 9:
        parts = [_text(v) for v in value]
        return ", ".join(parts) if parts and all(parts) else ""
    if isinstance(value, Mapping) and len(value) <= 9:
        named = [(escape(str(k)), _text(v)) for k, v in value.items()]
        return ", ".join(f"{k} {v}" for k, v in named) if all(v for _, v in named) else ""
    return ""
