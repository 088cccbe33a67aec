"""The command ``schuler simulate``: files, what it says, and what it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pyarrow import parquet

import schuler as sc
from schuler.config import load_scenario
from tests.test_docs import schema

SCENE = """duration = "10 s"
rate = "50 Hz"
seed = 3
instrument = "navigation-fog"
[site]
lat = 40.0
height = 50
[motion]
kind = "vehicle"
heading = 30
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "truck.toml"
    path.write_text(SCENE)
    return path


def test_record_and_truth_are_written(run, scene, tmp_path):
    done = run("simulate", scene)
    assert (done.code, done.err) == (0, "wrote truck.parquet\nwrote truck.truth.parquet\n")
    assert "truck: vehicle, 10 s at 50 Hz, 500 samples, seed 3" in done.out
    assert "record truck.parquet, truth truck.truth.parquet" in done.out
    made = load_scenario(scene).run()
    back = sc.read(tmp_path / "truck.parquet")
    assert np.array_equal(back.dtheta, made.record.dtheta)
    assert np.array_equal(back.dvel, made.record.dvel)
    truth = parquet.read_table(tmp_path / "truck.truth.parquet")
    assert len(truth) == 501
    assert np.array_equal(truth["t [s]"].to_numpy(), made.truth.time)
    assert np.array_equal(truth["qw"].to_numpy(), made.truth.quat_nb[:, 0])
    assert truth["heading [deg]"].to_numpy()[-1] == pytest.approx(made.heading_deg(), abs=1e-12)
    assert truth["lat [deg]"].to_numpy() == pytest.approx(40.0, abs=1e-6)
    about = json.loads(truth.schema.metadata[b"schuler"])
    assert about["scenario"]["motion"]["heading"] == 30
    assert about["gyro_bias_deg_h"] == pytest.approx(np.degrees(made.gyro_bias) * 3600)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_other_formats_have_their_truth_beside_them(run, scene, tmp_path, suffix):
    assert run("simulate", scene, "--out", f"x{suffix}").code == 0
    assert len(sc.read(tmp_path / f"x{suffix}")) == 500
    assert (tmp_path / "x.truth.parquet").exists()


def test_json_says_what_was_made_and_nothing_else(run, scene):
    done = run("simulate", scene, "--seed", 8, "--run", 2, "--set", "duration=4 s", "--json", "-",
               "--truth", "t.parquet")  # fmt: skip
    data = json.loads(done.out)
    schema("simulation").validate(data)
    assert (data["seed"], data["run"], data["samples"]) == (8, 2, 200)
    assert data["truth"] == "t.parquet"
    assert data["instrument"] == "navigation-fog"


def test_run_k_is_that_of_the_campaign(run, scene, tmp_path):
    run("simulate", scene, "--run", 5)
    scenario = load_scenario(scene)
    made = scenario.run(scenario.sequence(5))
    assert np.array_equal(sc.read(tmp_path / "truck.parquet").dvel, made.record.dvel)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["gone.toml"], "gone.toml: cannot be read"),
        (["truck.toml", "--out", "x.imu"], "expected a name in .parquet or .csv or .npz or"),
        (["truck.toml", "--out", "no/x.csv"], "there is no folder 'no'"),
        (["truck.toml", "--truth", "x.csv"], "expected a name in .parquet"),
        (
            ["truck.toml", "--out", "x.parquet", "--truth", "x.parquet"],
            "--truth and --out both name x.parquet",
        ),
        (["truck.toml", "--set", "heading"], "expected key=value"),
        (["truck.toml", "--set", "a=1", "--set", "a=2"], "said twice"),
        (["truck.toml", "--set", "motion.heading=north"], "as set from outside: motion.heading"),
        (["truck.toml", "--seed", "-1"], "from 0 to"),
        (["truck.toml", "--run", "-1"], "from 0 to"),
        (["truck.toml", "--seed", "x"], "is not a whole number"),
    ],
)
def test_what_is_wrong_is_one_sentence(run, scene, arguments, words):
    done = run("simulate", *arguments)
    assert (done.code, done.out) == (2, "")
    assert words in done.err
    assert done.err.count("\n") == 1
    assert "Traceback" not in done.err
