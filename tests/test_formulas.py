"""The manual's formulas: each is understood, and drawn as what it says."""

from __future__ import annotations

import html
import importlib.util
import re
import sys
from collections.abc import Iterator
from types import ModuleType

import pytest

from tests.conftest import ROOT

PAGES = sorted((ROOT / "docs").rglob("*.md"))
_CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_TEX = re.compile(r"\$\$(?P<display>.+?)\$\$|(?<!\\)\$(?P<inline>\S(?:[^$]*?\S)?)\$", re.DOTALL)


@pytest.fixture(scope="module")
def formulas() -> ModuleType:
    pytest.importorskip("latex2mathml", reason="the documentation's extra is not installed")
    spec = importlib.util.spec_from_file_location("formulas", ROOT / "docs" / "formulas.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def written() -> Iterator[tuple[str, str, bool]]:
    """Give each formula of the manual with its page and whether it stands by itself."""
    for page in PAGES:
        for found in _TEX.finditer(_CODE.sub("", page.read_text(encoding="utf-8"))):
            display = found["display"] is not None
            yield page.name, found["display"] or found["inline"], display


def test_every_formula_of_the_manual_is_understood(formulas: ModuleType) -> None:
    all_of_them = list(written())
    assert len(all_of_them) > 60
    assert sum(display for _, _, display in all_of_them) >= 6
    for page, tex, display in all_of_them:
        out = formulas.to_mathml(tex, display)
        assert re.fullmatch(r"<math .*</math>", out, re.DOTALL), (page, tex)
        assert f'display="{"block" if display else "inline"}"' in out


def test_no_formula_is_left_in_letters() -> None:
    """What only formulas have, as integrals and Greek letters with an index, is set as one."""
    for page in PAGES:
        text = _TEX.sub("", _CODE.sub("", page.read_text(encoding="utf-8")))
        left = re.findall(r"[∫∬Σ∇]|[φεΩ][_(]|[ᵀĈḠ]|cosL|tanL|<sup>", text)
        assert left == [], page.name


def test_functions_signs_and_what_is_read_aloud(formulas: ModuleType) -> None:
    out = formulas.to_mathml(r"x = -\omega \cos L & y < 1")
    assert 'alttext="x = -\\omega \\cos L &amp; y &lt; 1"' in out
    plain = html.unescape(re.sub(r"<mspace[^>]*></mspace>", "~", out))
    assert '<mo form="prefix">−</mo>' in plain
    assert "<mi>ω</mi>~<mi>cos</mi>~<mi>L</mi>" in plain
    # A difference keeps the space of an operator.
    assert "prefix" not in formulas.to_mathml("a - b")


def test_formulas_of_a_page_are_set_and_code_is_left(formulas: ModuleType) -> None:
    page = (
        '<p><span class="arithmatex">\\(a &lt; b\\)</span> <code>$$x$$</code></p>'
        '<div class="arithmatex">\\[\na = b\n\\]</div>'
    )
    out = formulas.typeset(page)
    assert out.count("<math ") == 2
    assert '<div class="formula"><math alttext="a = b"' in out
    assert "<code>$$x$$</code>" in out


@pytest.mark.parametrize(
    "page",
    [
        r'<span class="arithmatex">\(\nosuchthing x\)</span>',
        "<p>a formula with no empty line before it: $$ a = b $$</p>",
    ],
)
def test_what_is_not_understood_stops_the_build(formulas: ModuleType, page: str) -> None:
    with pytest.raises(formulas.FormulaError):
        formulas.typeset(page)
