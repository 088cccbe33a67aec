r"""Formulas of the pages: TeX between dollars becomes MathML, which browsers draw without a script.

``$...$`` stands in a line and ``$$...$$`` by itself. `pymdownx.arithmatex` finds them and hands
them on as ``\(...\)`` and ``\[...\]``, which `typeset` replaces when the page is HTML.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
_NAMES = "<mi>(?:sin|cos|tan|log|det|ln|exp)</mi>"
_BEFORE = re.compile(rf"(?<=</mi>|</mn>|msub>|msup>|frac>)(?={_NAMES})")
_AFTER = re.compile(rf"({_NAMES})(?=<m(?:i|n|sub|sup|sqrt|frac))")
_SIGN = re.compile(
    r"(<mo[^>]*>(?:&#x0003D;|&#x00028;|\(|&#x0002C;|,)</mo>)<mo>(&#x02212;|&#x0002B;)"
)
_SPACE = '<mspace width="0.17em"></mspace>'
_UNSET = re.compile(r"<(pre|code)\b.*?</\1>|<[^>]*>", re.DOTALL)
_LEFT_OVER = re.compile(r"\\[A-Za-z]+")


class FormulaError(ValueError):
    """A formula that is not understood."""


def to_mathml(tex: str, display: bool = False) -> str:
    """Return a formula as a ``math`` element, its TeX as the text for those who do not see it.

    Raises
    ------
    FormulaError
        If it has a command that is not known.
    """
    out = convert(" ".join(tex.split()), display="block" if display else "inline")
    if left := _LEFT_OVER.search(re.sub(r"<[^>]*>", "", out)):
        raise FormulaError(f"'{tex}': {left[0]} is not known")
    # A function's name stands apart from its argument and from the factor before it.
    out = _BEFORE.sub(_SPACE, _AFTER.sub(rf"\1{_SPACE}", out))
    # A sign, not a difference: browsers would leave the space of an operator about it.
    out = _SIGN.sub(r'\1<mo form="prefix">\2', out)
    return out.replace("<math ", f'<math alttext="{html.escape(tex.strip())}" ', 1)


def typeset(page: str) -> str:
    """Return a page's HTML with each formula as MathML.

    Raises
    ------
    FormulaError
        If one is not understood, or not found because no empty line stands before it.
    """

    def one(match: re.Match[str]) -> str:
        display = match["tag"] == "div"
        found = to_mathml(html.unescape(match["tex"]), display)
        return f'<div class="formula">{found}</div>' if display else found

    out = _FORMULA.sub(one, page)
    if "$$" in _UNSET.sub("", out):
        raise FormulaError("$$ is left in the text: a formula by itself needs empty lines about it")
    return out
