"""The public face: cheap to import, complete, and its rooms in order."""

from __future__ import annotations

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
    "module", ["earth", "attitude", "record", "sensors", "estimate.vectors", "calibrate"]
)
def test_rooms_import_their_compiled_and_heavy_parts_late(run_python, module):
    code = (
        f"import sys, schuler.{module};"
        "print(sorted({'numba', 'scipy', 'pyarrow'} & set(sys.modules)))"
    )
    assert run_python(code) == "[]"


def test_every_public_name_resolves():
    for name in schuler.__all__:
        assert getattr(schuler, name) is not None, name
    assert set(schuler.__all__) <= set(dir(schuler))


def test_every_public_name_can_be_called_whatever_was_imported_first(run_python):
    # Importing the room `schuler.align` binds its name in the package, over the function's.
    code = (
        "import schuler, schuler.align, schuler.report, schuler.io, schuler.simulate;"
        "print([n for n in schuler.__all__ if n[0] != '_' and not callable(getattr(schuler, n))])"
    )
    assert run_python(code) == "[]"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'schuler' has no attribute 'allign'"):
        _ = schuler.allign


def test_version_is_the_package_s(root):
    import tomllib

    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    assert schuler.__version__ == project["project"]["version"]


def test_rooms_import_downwards_only(root):
    command = Path(sys.executable).with_name("lint-imports")
    if not command.exists():
        pytest.skip(f"no import linter at {command}: install the dev extra")
    done = subprocess.run(
        [str(command), "--no-cache"], capture_output=True, text=True, cwd=root, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
