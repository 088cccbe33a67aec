"""The commands `schuler array` and `schuler rotation run`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

import schuler as sc
from schuler.cli import cli as group
from schuler.constants import DEG_PER_HOUR
from schuler.errors import SchulerError
from tests.conftest import ROOT
from tests.test_docs import schema

CASE = ROOT / "examples" / "rotation" / "four_gyro.toml"


def run(*words):
    result = CliRunner().invoke(group, [str(w) for w in words])
    if isinstance(result.exception, SchulerError):
        return 2, str(result.exception), result.stdout
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result.exit_code, result.output, result.stdout


@pytest.mark.parametrize("words", [["array"], ["array", "figures"]])
def test_a_geometry_means_its_figures(words):
    code, _, out = run(*words, "symmetric4", "--json", "-")
    assert code == 0
    data = json.loads(out)
    schema("array").validate(data)
    assert data["subset_determinant"]["0,1,2"] == pytest.approx(0.7698, abs=1e-4)
    code, text, _ = run("array", "--mtbf", 1000, "cone4")
    assert code == 0
    assert "|det|" in text
    assert run("array", "nothing")[0] == 2


def test_help_names_both():
    text = run("array", "--help")[1]
    assert "figures" in text
    assert "faults" in text


def test_faults_of_a_record_with_five_gyros(tmp_path):
    rng = np.random.default_rng(1)
    n = 12000
    t = 0.01 * np.arange(1, n + 1)
    gyros = 1e-7 * rng.standard_normal((n, 5))
    gyros[(t > 80.0), 1] += 8.0 * DEG_PER_HOUR * 0.01
    force = np.tile([0.0, 0.0, 0.0981], (n, 1))
    sc.write(sc.ImuRecord(t, np.full(n, 0.01), gyros, force), tmp_path / "r.csv")
    code, text, out = run("array", "faults", tmp_path / "r.csv", "--array", "cone5", "--json", "-")
    assert code == 0, text
    data = json.loads(out)
    schema("array-faults").validate(data)
    assert [(e["action"], e["gyro"]) for e in data["events"]] == [("excluded", 2)]
    assert data["working"] == [1, 3, 4, 5]
    for words, said in (
        ([], "say the geometry"), (["--array", "cone6"], "no column for g6"),
        (["--array", "cone5", "--start", "5s"], "whole record"),
        (["--array", "cone5", "--reference", "10min"], "longer record"),
    ):  # fmt: skip
        code, text, _ = run("array", "faults", tmp_path / "r.csv", *words)
        assert code == 2
        assert said in text


def test_rotation_run_writes_what_is_asked(tmp_path):
    code, text, out = run("rotation", "run", CASE, "--heading", 300, "--table", tmp_path / "h.csv",
                          "--json", "-")  # fmt: skip
    assert code == 0, text
    data = json.loads(out)
    schema("rotation-history").validate(data)
    assert data["heading_deg"] == 300.0
    assert (tmp_path / "h.csv").read_text(encoding="utf-8").startswith("time_s,fixed_east_m")
    assert run("rotation", "run", CASE, "--picture", tmp_path / "h.gif")[0] == 2
