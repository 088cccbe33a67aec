"""The examples in docstrings run, with the names that `docs/api.md` lists."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import pytest

import schuler
from schuler.io import registry
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
    # An example registers a reader.
    monkeypatch.setattr(registry, "_registered", {})
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
    assert len(EXAMPLES) > 250
    for test in EXAMPLES:
        skipped = [e.source for e in test.examples if doctest.SKIP in e.options]
        assert not skipped, f"{test.name}: {skipped}"


def public() -> dict[str, object]:
    """Return the functions and classes of packages' `__all__` and of `docs/api`, by full name."""
    found = {}
    packages = [m.name for m in pkgutil.iter_modules(schuler.__path__, "schuler.")]
    listed = [
        name
        for page in sorted((ROOT / "docs" / "api").glob("*.md"))
        for name in re.findall(r"^::: ([\w.]+)", page.read_text(encoding="utf-8"), re.M)
    ]
    for name in [*packages, *listed]:
        leaf = name.rpartition(".")[2]
        if leaf.startswith("_") or name == "schuler.cli":
            continue
        try:
            module = importlib.import_module(name)
        except ImportError:
            owner = importlib.import_module(name.rpartition(".")[0])
            things = [getattr(owner, leaf)]
        else:
            things = [getattr(module, each) for each in getattr(module, "__all__", ())]
        for thing in things:
            if inspect.isfunction(thing) or inspect.isclass(thing):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return found


def returned(names: dict[str, object]) -> set[str]:
    """Return the words in the return annotations of public functions and methods of others."""
    out: set[str] = set()
    for thing in names.values():
        given = vars(thing) if inspect.isclass(thing) else {thing.__name__: thing}
        for name, each in given.items():
            function = each.fget if isinstance(each, property) else each
            if inspect.isfunction(function) and not name.startswith("_"):
                words = set(re.findall(r"\w+", str(function.__annotations__.get("return", ""))))
                out |= words - {thing.__name__}
    return out


#: functions whose shortest call takes seconds
SLOW = {
    "schuler.published.run",
    "schuler.centrifuge.plan.explore",
    "schuler.centrifuge.plan.compare_objectives",
}


def test_every_public_name_has_an_example():
    # A class that functions return is in the example of one of them.
    names = public()
    assert len(names) > 350
    results = returned(names)
    without = [
        name
        for name, thing in names.items()
        if ">>>" not in (thing.__doc__ or "")
        and not (inspect.isclass(thing) and thing.__name__ in results)
    ]
    assert sorted(without) == sorted(SLOW)


def test_every_method_of_what_schuler_exports_is_called_in_an_example():
    sources = "\n".join(each.source for test in EXAMPLES for each in test.examples)
    called = set(re.findall(r"\.(\w+)", sources))
    without = []
    for exported in (getattr(schuler, name) for name in schuler.__all__):
        owners = exported.__mro__ if inspect.isclass(exported) else ()
        for owner in owners:
            if not owner.__module__.startswith("schuler."):
                continue
            for name, each in vars(owner).items():
                function = getattr(each, "__func__", each)
                if inspect.isfunction(function) and not name.startswith("_"):
                    without += [] if name in called else [f"{owner.__name__}.{name}"]
    assert not without
