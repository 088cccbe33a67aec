"""Words of the field: what the glossary replaces stands nowhere in code, help or documentation."""

from __future__ import annotations

import re

import pytest

from tests.conftest import ROOT

#: what must not be written -> what to write
REPLACED = {
    r"rooms?|house": "package, module, space",
    r"doors?": "import, start",
    r"honest\w*": "consistent",
    r"shuts? out": "excluded, isolated",
    r"(?:go|goes|gone) on with": "resume, continue",
    r"believes?": "trust, take for",
    r"speaks?|spoken": "say; customary unit",
    r"hires?|staff": "start, workers",
    r"blames?|blamed": "isolate",
    r"add(?:ed|s)? in squares": "root sum square",
    r"by inertia alone": "free-inertial",
    r"standing vehicle": "stationary vehicle",
    r"on the spot": "in place",
    r"nobody said": "not given",
    r"(?:nobody|no one) knows?": "not known, not measured",
}
#: a vehicle's doors are slammed there
DOORS = {
    "src/schuler/motion/vehicle.py", "src/schuler/kernels/residuals.py", "docs/io.md",
    "docs/prefilter.md", "docs/simulate.md", "examples/scenarios/truck_with_crew.toml",
}  # fmt: skip
TEXTS = sorted(
    path
    for folder, pattern in (("src", "*.py"), ("docs", "*.md"), ("examples", "*"))
    for path in (ROOT / folder).rglob(pattern)
    if path.suffix in (".py", ".md", ".toml", ".ipynb")
)


@pytest.mark.parametrize("words", REPLACED, ids=REPLACED.get)
def test_a_replaced_word_stands_nowhere(words):
    pages = [*TEXTS, ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    found = []
    for path in pages:
        name = path.relative_to(ROOT).as_posix()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            hit = re.search(rf"(?<![\w`])(?:{words})(?![\w`(])", line, re.I)
            if hit and not (name in DOORS and hit[0].lower().startswith("door")):
                found.append(f"{name}:{number}: '{hit[0]}', write {REPLACED[words]}")
    assert not found, "\n".join(found)


def test_the_glossary_is_in_order_and_says_each_term_once():
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^\| ([^|]+) \| [^|]+ \|$", text, re.M)[1:]
    assert len(terms) > 40
    plain = [term.lower().replace("é", "e") for term in terms]
    assert plain == sorted(set(plain))
