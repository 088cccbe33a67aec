"""Two records of one pose: equal as often as the test says, different where they are."""

from __future__ import annotations

import json

import numpy as np
import pytest

import schuler as sc
from schuler.alignment import compare_records
from schuler.motion import Static
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import chi_square_band

SITE = sc.Site(40.0)
FOG = "navigation-fog"


def fix(seed: int, heading: float = 30.0, pitch: float = 1.0) -> sc.Alignment:
    rng = np.random.default_rng(seed)
    pose = Static(heading, pitch, -2.0)
    return sc.align(simulate(pose, SITE, 60.0, 20.0, GRADES[FOG], rng).record, SITE, spec=FOG)


def test_the_chi_square_of_equal_poses_is_chi_square() -> None:
    """20 pairs of instruments: the sum within 99.9 % of chi-square with 60 degrees of freedom."""
    runs = 20
    total = sum(compare_records(fix(k), fix(100 + k)).chi_square for k in range(runs))
    low, high = chi_square_band(3 * runs, 0.001)
    assert low < total < high


def test_a_pose_that_is_another_is_said() -> None:
    first = fix(1)
    found = compare_records(first, fix(2, heading=31.0, pitch=1.05), ("monday", "tuesday"))
    assert not found.equal
    assert found.probability < 1e-6
    # phi is that of the second: heading clockwise from north, so phi up is its negative in psi.
    assert found.phi[2] == pytest.approx(np.radians(1.0), abs=4.5 * found.sigma[2])
    assert "the poses differ" in str(found)
    same = compare_records(first, first)
    assert same.equal
    assert same.chi_square == pytest.approx(0.0, abs=1e-20)


def test_it_is_a_command(tmp_path) -> None:

    from schuler.cli import main
    from tests.test_docs import schema

    for k, name in enumerate("ab"):
        rng = np.random.default_rng(k)
        made = simulate(Static(30.0), SITE, 60.0, 20.0, GRADES[FOG], rng)
        sc.write(made.record, tmp_path / f"{name}.parquet")
    files = [str(tmp_path / f"{name}.parquet") for name in "ab"]
    out = tmp_path / "r.json"
    with pytest.raises(SystemExit) as stop:
        main(["compare", "--records", *files, "--lat", "40", "--spec", FOG, "--json", str(out)])
    assert stop.value.code == 0
    data = json.loads(out.read_text())
    schema("record-comparison").validate(data)
    assert data["equal"] is True
    assert [row["axis"] for row in data["rows"]] == ["east", "north", "up"]
