"""The public face: cheap to import, complete, and its modules in order."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import schuler


def test_importing_schuler_costs_nothing(run_python):
    code = (
        "import sys, schuler, schuler.units, schuler.errors, schuler.constants;"
        "heavy = {'numpy', 'numba', 'scipy', 'pyarrow', 'click', 'rich', 'plotly'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    assert run_python(code) == "[]"


@pytest.mark.parametrize(
    "module", ["earth", "attitude", "record", "sensors", "estimate.vectors", "calibration"]
)
def test_modules_import_their_compiled_and_heavy_parts_late(run_python, module):
    code = (
        f"import sys, schuler.{module};"
        "print(sorted({'numba', 'scipy', 'pyarrow'} & set(sys.modules)))"
    )
    assert run_python(code) == "[]"


def test_every_public_name_resolves():
    for name in schuler.__all__:
        assert getattr(schuler, name) is not None, name
    assert set(schuler.__all__) <= set(dir(schuler))


def test_every_public_name_is_a_function_or_class_whatever_was_imported_first(run_python):
    # Importing a subpackage binds its name in the package: none may be that of a function.
    code = (
        "import pkgutil, importlib, inspect, schuler;"
        "[importlib.import_module(m.name) for m in pkgutil.iter_modules(schuler.__path__, "
        "'schuler.') if m.name != 'schuler.__main__'];"
        "print([n for n in schuler.__all__ if n[0] != '_' and not (inspect.isfunction("
        "getattr(schuler, n)) or inspect.isclass(getattr(schuler, n)))])"
    )
    assert run_python(code) == "[]"


def test_type_checkers_see_every_public_name():
    source = Path(schuler.__file__).read_text(encoding="utf-8")
    for name in set(schuler.__all__) - {"__version__"}:
        assert f"import {name} as {name}\n" in source, name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'schuler' has no attribute 'allign'"):
        _ = schuler.allign


def test_version_is_the_package_s(root):
    import tomllib

    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    assert schuler.__version__ == project["project"]["version"]


def test_modules_import_downwards_only(root):
    command = Path(sys.executable).with_name("lint-imports")
    if not command.exists():
        pytest.skip(f"no import linter at {command}: install the dev extra")
    done = subprocess.run(
        [str(command), "--no-cache"], capture_output=True, text=True, cwd=root, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr


def layers(root):
    """Return the import layers of pyproject.toml, each a set of names."""
    import tomllib

    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    contract = project["tool"]["importlinter"]["contracts"][0]
    return [{name.strip(" ()") for name in layer.split("|")} for layer in contract["layers"]]


def test_contributing_states_the_import_rule(root):
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rule = re.search(r"^(    cli > .*\n(?:    .*\n)*)", text, re.M)[1]
    stated = [{name.strip() for name in layer.split("|")} for layer in rule.split(">")]
    private = {name for names in layers(root) for name in names if name.startswith("_")}
    assert stated == [names - private for names in layers(root) if names - private]


def test_contributing_s_table_names_every_module(root):
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    text = text[text.index("| module |") : text.index("**The import rule")]
    rows = re.findall(r"^\| ((?:`[a-z_]+/?` ?)+)\|", text, re.M)
    named = [name for row in rows for name in re.findall(r"`([a-z_]+/?)`", row)]
    tree = {
        f"{path.name}/" if path.is_dir() else path.stem
        for path in (root / "src" / "schuler").iterdir()
        if not path.name.startswith("_") and (path.suffix == ".py" or any(path.glob("*.py")))
    }
    assert sorted(named) == sorted(tree)
