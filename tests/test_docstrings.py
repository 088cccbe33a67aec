"""The examples in docstrings run, with the names that `docs/api.md` lists."""

from __future__ import annotations

import ast
import doctest
import importlib
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.docstring_names import namespace

pytestmark = pytest.mark.compiled

SOURCES = ROOT / "src" / "schuler"


def examples() -> list[doctest.DocTest]:
    """Return the examples of each docstring that has some, read without importing its module."""
    found = []
    for path in sorted(SOURCES.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if ">>>" not in text:
            continue
        place = path.relative_to(SOURCES).with_suffix("").as_posix().replace("/", ".")
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.FunctionDef | ast.ClassDef):
                continue
            docstring = ast.get_docstring(node) or ""
            if ">>>" in docstring:
                name = f"{place}.{node.name}"
                test = doctest.DocTestParser().get_doctest(docstring, {}, name, str(path), 0)
                found.append(test)
    return found


EXAMPLES = examples()


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("examples")
        patch.chdir(folder)
        return folder, namespace()


@pytest.mark.parametrize("test", EXAMPLES, ids=lambda test: test.name)
def test_an_example_gives_what_it_shows(test, names, monkeypatch):
    folder, given = names
    monkeypatch.chdir(folder)
    module = importlib.import_module("schuler." + test.name.rpartition(".")[0].removesuffix(
        ".__init__"))  # fmt: skip
    test.globs = {**vars(module), **given}
    said: list[str] = []
    runner = doctest.DocTestRunner(
        optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE, verbose=False
    )
    outcome = runner.run(test, out=said.append)
    assert outcome.failed == 0, "".join(said)


def test_no_example_is_left_out():
    assert len(EXAMPLES) > 80
    for test in EXAMPLES:
        skipped = [e.source for e in test.examples if doctest.SKIP in e.options]
        assert not skipped, f"{test.name}: {skipped}"
