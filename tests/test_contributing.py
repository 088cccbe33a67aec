"""The worked examples of CONTRIBUTING, made in a copy of the tree by the files that it names."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import textwrap

import pytest

pytestmark = pytest.mark.compiled

PLACES = re.compile(r'<!-- test: in (\S+), before "((?:[^"\\]|\\.)*)" -->\n```\w+\n(.*?)```', re.S)


def changes(root, heading):
    """Return the files, places and texts of a section's example."""
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text[text.index(f"## {heading}") :].split("\n## ")[0]
    found = [
        (name, place.replace('\\"', '"').replace("\\n", "\n"), code)
        for name, place, code in PLACES.findall(section)
    ]
    assert found, heading
    return found


def changed(root, folder, heading):
    """Copy what is changed, with the example in it; return the names of the files."""
    shutil.copytree(
        root / "src", folder / "src", ignore=shutil.ignore_patterns("__pycache__", "compiled")
    )
    names = []
    for name, place, code in changes(root, heading):
        target = folder / name
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(root / name, target)
        text = target.read_text(encoding="utf-8")
        assert text.count(place) == 1, f"{name}: {place}"
        # The page's formatter takes the indentation off what is Python by itself.
        indent = place[: len(place) - len(place.lstrip(" "))]
        lines = textwrap.indent(textwrap.dedent(code), indent).rstrip() + "\n"
        lines += "\n" if lines.lstrip().startswith("@") else ""
        target.write_text(text.replace(place, lines + place), encoding="utf-8")
        names.append(name)
    return set(names)


def run(folder, code):
    """Run code with the changed package, its kernels uncompiled."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=folder, timeout=120,
        env={"PYTHONPATH": str(folder / "src"), "NUMBA_DISABLE_JIT": "1", "PATH": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


QUANTITY = """
import json
import numpy as np
import schuler as sc
time = np.arange(1, 401) / 20.0
site = sc.Site(48.0)
turn = np.array([0.0, 0.05, 0.0])
force = np.array([-np.sin(0.05), 0.0, np.cos(0.05)]) * site.gravity
record = sc.ImuRecord(
    time, np.full(400, 0.05), np.tile(site.earth_rate, (400, 1)) * 0.05,
    np.tile(force, (400, 1)) * 0.05,
)
print(json.dumps(sc.align(record, site, "analytic").to_dict()))
"""


def test_a_quantity_takes_three_files(root, tmp_path):
    names = changed(root, tmp_path, "Adding a quantity to a result")
    assert len(names) == 3
    document = json.loads(run(tmp_path, QUANTITY))
    assert document["tilt_deg"] == pytest.approx(2.865, abs=0.01)
    from jsonschema import Draft202012Validator

    schema = json.loads((tmp_path / "docs/alignment.schema.json").read_text(encoding="utf-8"))
    Draft202012Validator(schema).validate(document)
    # Without its key in the schema the document is refused.
    old = json.loads((root / "docs/alignment.schema.json").read_text(encoding="utf-8"))
    assert not Draft202012Validator(old).is_valid(document)


MEASUREMENT = """
import numpy as np
import schuler as sc
from schuler import ins
from schuler.ins.measurements import HorizontalSpeed
from schuler.motion import Route
site = sc.Site(48.0)
made = sc.simulate(Route([], heading=60.0, speed=10.0), site, 3.0, 20.0)
layout = ins.Layout(["phi", "velocity", "position"])
noise = ins.ProcessNoise.of(layout, {})
start = made.truth.v_n[0] + [0.6, 0.6, 0.0]
p = np.diag(np.repeat([1e-10, 1.0, 1e-2], 3))
speed = HorizontalSpeed([1.0, 2.0], [[10.0, 0.0, 0.0]] * 2, [[0.01, 0.0, 0.0]] * 2)
flt = ins.ErrorStateFilter(layout, site, made.truth.quat_nb[0], p, noise, [speed], v_n=start)
flt.update(made.record)
print(np.hypot(*flt.v_n[:2]), np.hypot(*start[:2]))
"""


def test_a_kind_of_measurement_takes_two_files(root, tmp_path):
    names = changed(root, tmp_path, "Adding a kind of measurement")
    assert len(names) == 2
    after, before = map(float, run(tmp_path, MEASUREMENT).split())
    assert before > 10.7
    assert after == pytest.approx(10.0, abs=0.03)
