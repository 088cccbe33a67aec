"""`schuler navigate`, `array` and `rotation`: what a stranger types and what comes back."""

from __future__ import annotations

import json
import shutil

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest

import schuler as sc
from schuler.earth import Site
from schuler.io import read_trajectory, write_trajectory
from schuler.motion import Manoeuvre, Route, Static
from schuler.sensors import named_array
from schuler.simulation import simulate
from tests.conftest import ROOT

COLUMNS = ",".join(
    ("time_s", *(f"d{w}_{a}_{u}" for w, u in (("theta", "rad"), ("vel", "mps")) for a in "xyz"))
)
PLACE = ("--lat", "40", "--lon", "116", "--height", "50")


def schema(name):
    """Return the validator of a published schema."""
    loaded = json.loads((ROOT / "docs" / f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(loaded)
    return jsonschema.Draft202012Validator(loaded)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Return a folder with a minute's drive and its truth."""
    folder = tmp_path_factory.mktemp("drive")
    made = simulate(
        Route([Manoeuvre(30, speed=15), Manoeuvre(30, turn=90)], heading=20.0),
        Site(40.0, 116.0, 50.0), 60.0,
    )  # fmt: skip
    sc.write(made.record, folder / "drive.parquet")
    write_trajectory(made.truth, folder / "drive.truth.parquet")
    return folder


def test_reference_record_through_the_command(run, reference_dir, tmp_path):
    """The issue's own figure: N, E, D within 0.01 m, attitude within 1e-6 deg."""
    done = run(
        "navigate", reference_dir / "pyins_traj.csv", "--columns", COLUMNS, "--gyro", "rad",
        "--accel", "m/s", "--axes", "FRD", "--lat", "34.2", "--lon", "108.9", "--height", "100",
        "--heading", "40", "--pitch", "0.38941834231", "--roll", "0",
        "--velocity", "38.567256581,45.962666587,0", "--gravity", "somigliana1",
        "--reference", reference_dir / "pyins_traj_truth_10hz.csv", "--json", "-",
    )  # fmt: skip
    assert done.code == 0, done.err
    data = json.loads(done.out)
    schema("navigation").validate(data)
    error = data["error"]
    assert max(abs(error[k]) for k in ("north_m", "east_m", "down_m")) < 0.01
    assert max(abs(error[f"{k}_deg"]) for k in ("heading", "pitch", "roll")) < 1e-6
    assert data["final"]["time_s"] == 600.0


def test_a_drive_with_everything(run, drive, tmp_path):
    out, page = tmp_path / "path.parquet", tmp_path / "n.html"
    done = run(
        "navigate", drive / "drive.parquet", *PLACE, "--heading", "20", "--spec", "navigation-rlg",
        "--reference", drive / "drive.truth.parquet", "--out", out, "--json", "-",
        "--report", page,
    )  # fmt: skip
    assert done.code == 0, done.err
    data = json.loads(done.out)
    schema("navigation").validate(data)
    assert abs(data["error"]["north_m"]) < 1e-3
    assert data["sigma"]["position_enu_m"][0] > 0.0
    table = pq.read_table(out)
    assert table.num_rows == 6001
    assert table["lat [deg]"][-1].as_py() == data["final"]["lat_deg"]
    assert "sigma_horizontal [m]" in table.column_names
    assert "Against the reference" in page.read_text(encoding="utf-8")
    # A path is a reference in its turn.
    assert len(read_trajectory(out)) == 6001


def test_align_first_then_navigate(run, tmp_path):
    made = simulate(Static(33.0), Site(40.0, 116.0, 50.0), 120.0)
    sc.write(made.record, tmp_path / "still.parquet")
    done = run("navigate", tmp_path / "still.parquet", *PLACE, "--align", "60s", "--json", "-")
    assert done.code == 0, done.err
    data = json.loads(done.out)
    schema("navigation").validate(data)
    assert data["start"]["time_s"] == pytest.approx(60.0)
    assert data["alignment"]["heading_deg"] == pytest.approx(33.0, abs=1e-4)
    assert data["final"]["time_s"] == pytest.approx(120.0)
    assert data["final"]["lat_deg"] == pytest.approx(40.0, abs=1e-6)


def test_mean_rates_of_four_gyros_in_a_file(run, tmp_path):
    made = simulate(Static(30.0), Site(40.0, 116.0, 50.0), 60.0)
    r = named_array("symmetric4").measure(made.record)
    table = np.column_stack([r.time, r.gyro, r.accel])
    np.savetxt(tmp_path / "four.csv", table, delimiter=",", comments="", fmt="%.17g",
               header="t,g1,g2,g3,g4,ax,ay,az")  # fmt: skip
    words = (tmp_path / "four.csv", "--mean-rates", "--array", "symmetric4", *PLACE)
    done = run("navigate", *words, "--heading", "30", "--json", "-")
    assert done.code == 0, done.err
    assert json.loads(done.out)["final"]["lat_deg"] == pytest.approx(40.0, abs=1e-9)
    done = run("align", *words, "--json", "-")
    assert json.loads(done.out)["heading_deg"] == pytest.approx(30.0, abs=1e-4)
    done = run("navigate", *words[:2], *PLACE, "--heading", "30")
    assert done.code == 2
    assert "no column for gx, gy, gz" in done.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--lat", "40"), "the start's attitude is needed"),
        (("--heading", "20"), "the start's place is needed"),
        ((*PLACE, "--heading", "20", "--align", "30s"), "leave out --heading"),
        ((*PLACE, "--align", "100s"), "takes the whole record"),
        ((*PLACE, "--heading", "20", "--velocity", "1,2"), "three numbers"),
        ((*PLACE, "--heading", "20", "--gravity", "moon"), "gravity must be one of"),
        ((*PLACE, "--heading", "20", "--vertical", "up"), "vertical must be one of"),
        ((*PLACE, "--heading", "20", "--every", "0"), "from 1 to"),
        ((*PLACE, "--heading", "20", "--out", "x.xml"), "expected a name in .parquet"),
        ((*PLACE, "--heading", "20", "--reference", "nothing.csv"), "no such file"),
        ((*PLACE, "--heading", "20", "--json", "no/where.json"), "no folder"),
    ],
)
def test_one_sentence_for_what_is_wrong(run, drive, words, sentence):
    done = run("navigate", drive / "drive.parquet", *words)
    assert done.code == 2
    assert sentence in done.err
    assert len(done.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t,lat,lon\n0,1,2\n1,1,2\n", "height not found"),
        ("t,lat,lon,h\n0,1,2,3\n", "two whole rows"),
        ("t,lat,lon,h\n1,1,2,3\n0,1,2,3\n", "does not advance"),
        ("t,lat,lon,h\n0,1,2,3\n1,x,2,3\n", "not a number"),
        ("t,lat,lon,h\n0,100,2,3\n1,100,2,3\n", "out of range"),
        ("t,lat,lon,h\n0,1,2,3\n1,2\n", "cut short"),
        ("t,lat,lon,h,alt\n0,1,2,3,4\n1,1,2,3,4\n", "could both be height"),
        ("t,lat,lon,h\n900,40,116,50\n901,40,116,50\n", "no time in common"),
    ],
)
def test_bad_references_are_said(run, drive, tmp_path, text, sentence):
    file = tmp_path / "r.csv"
    file.write_text(text, encoding="utf-8")
    done = run("navigate", drive / "drive.parquet", *PLACE, "--heading", "20", "--reference", file)
    assert done.code == 2
    assert sentence in done.err


def test_reference_between_rows_is_interpolated(drive, tmp_path):
    """Truth at 100 Hz against a path of every 25th row: millimetres."""
    from schuler.navigation import Start, evaluate, navigate

    record = sc.read(drive / "drive.parquet")
    start = Start.from_angles(Site(40.0, 116.0, 50.0), 20.0)
    e = evaluate(navigate(record, start, every=25), read_trajectory(drive / "drive.truth.parquet"))
    assert len(e.time) == 6001
    assert np.abs(e.position).max() < 5e-3


def test_array_command_is_the_issue_s(run, tmp_path):
    done = run("array", "symmetric4", "--json", "-")
    assert done.code == 0, done.err
    data = json.loads(done.out)
    schema("array").validate(data)
    assert data["HtH"] == [[pytest.approx(4 / 3) if i == j else 0.0 for j in range(3)]
                           for i in range(3)]  # fmt: skip
    for lost in ("0,1,2", "0,1,3", "0,2,3", "1,2,3"):
        assert data["subset_variance"][lost] == [1.5, 1.5, 1.5]
    assert data["mtbf_h"] == pytest.approx(2916.667, abs=1e-3)
    assert data["mtbf_ratio_to_triad"] == pytest.approx(1.75)
    page = tmp_path / "a.html"
    done = run("array", "dodecahedron", "--coverage", "0.9", "--weibull", "1.5", "--report", page)
    assert done.code == 0, done.err
    assert "Variance of each axis" in page.read_text(encoding="utf-8")
    assert "is no array" in run("array", "cube").err
    assert "mean life" in run("array", "triad", "--mtbf", "0").err


def test_rotation_commands(run, tmp_path):
    file = tmp_path / "four.toml"
    shutil.copy(ROOT / "examples" / "rotation" / "four_gyro.toml", file)
    page = tmp_path / "r.html"
    done = run("rotation", "compare", file, "--json", "-", "--report", page)
    assert done.code == 0, done.err
    data = json.loads(done.out)
    schema("rotation").validate(data)
    row = next(r for r in data["rows"] if r["latitude_deg"] == 45.78 and r["psi_deg"] == 90.0)
    assert row["single_axis_reduction_percent"] == pytest.approx(31.9, abs=1.0)
    assert row["fixed_m"] > 10.0 * row["two_axis_m"]
    assert "All headings" in page.read_text(encoding="utf-8")
    done = run("rotation", "residual", "two-axis-16", "--json", "-")
    schema("residual").validate(json.loads(done.out))
    done = run(
        "rotation", "optimise", "--turns", "8", "--tries", "20", "--out", tmp_path / "o.toml"
    )
    assert done.code == 0, done.err
    assert "deg/h (1 sigma)" in done.out
    assert "step" in run("rotation", "residual", tmp_path / "o.toml").out
    file.write_text("duration = 3", encoding="utf-8")
    done = run("rotation", "compare", file)
    assert done.code == 2
    assert "four.toml" in done.err
