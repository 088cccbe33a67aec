"""``--save-run`` and the run that repeats it: the same bytes, the command line first, bad files."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from schuler.cli.navigate import command
from schuler.cli.run_file import _PLACES
from schuler.constants import DEG
from tests.navigation.test_aided import drive

from .test_aided import Run

#: what is in a mapping of its own, or says where to write and not what to do
ELSEWHERE = {
    "columns", "gyro", "accel", "time", "axes", "mean_rates", "rate", "start_time",
    "coning_corrected", "sculling_corrected", "array", "delimiter", "comment", "decimal",
    "skip_rows", "header", "variables", "format", "topic", "imu_type", "accel_file", "accel_topic",
    "mapping", "save_mapping", "save_run_to", "debug", "figures", "figure_format", "again", "quiet",
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder with a record in FRD, fixes and speeds."""
    folder = tmp_path_factory.mktemp("run")
    drove, gnss = drive(7, late=0.1, length=140.0)
    r = drove.record
    frd = [1, 0, 2], [1.0, 1.0, -1.0]
    rows = np.column_stack([r.time, *(x[:, frd[0]] * frd[1] for x in (r.dtheta, r.dvel))])
    np.savetxt(folder / "raw.csv", rows, "%.17g", ",")
    table = np.column_stack([gnss.time, gnss.lat / DEG, gnss.lon / DEG, gnss.height, gnss.v_n])
    head = "time [s],lat [deg],lon [deg],height [m],ve [m/s],vn [m/s],vu [m/s]"
    np.savetxt(folder / "gnss.csv", table, "%.10g", ",", header=head, comments="")
    speed = np.linalg.norm(drove.truth.v_n[::10], axis=1)
    odometer = np.column_stack([drove.truth.time[::10], speed])
    np.savetxt(folder / "odo.csv", odometer, "%.9g", ",", header="t,speed", comments="")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of that folder, which is the current one."""
    there = tmp_path / "run"
    shutil.copytree(made, there)
    monkeypatch.chdir(there)
    return there


SAID = (
    "raw.csv", "--gyro", "rad", "--accel", "m/s", "--axes", "FRD", "--stop", "+130s",
    "--gnss", "gnss.csv", "--gnss-sigma", "0.05,0.05", "--lever", "0,0.25,1", "--delay", "0.1",
    "--odometer", "odo.csv", "--nhc", "--estimate", "delay,mount", "--smooth",
    "--time-offset", "gnss=0", "--outage", "10s/20s", "--spec", "tactical-fog", "--every", "20",
    "--at", "antenna",
)  # fmt: skip


def test_every_option_has_a_place_in_the_file() -> None:
    named = {name for keys in _PLACES.values() for name in keys.values()}
    assert {param.name for param in command.params} == named | ELSEWHERE


def test_a_run_repeats_to_the_same_bytes(run: Run, folder: Path) -> None:
    ran = run("navigate", *SAID, "--out", "path.csv", "--json", "out.json",
              "--save-run", "run.toml")  # fmt: skip
    assert ran.code in (0, 3), ran.err
    first = [(folder / name).read_bytes() for name in ("path.csv", "out.json")]
    data = tomllib.loads((folder / "run.toml").read_text(encoding="utf-8"))
    assert data["schema"] == "schuler.run/1"
    assert data["mapping"] == {"gyro": "rad", "accel": "m/s", "axes": "FRD"}
    assert data["gnss"]["lever"] == "0,0.25,1"
    assert data["filter"] == {
        "nhc": True, "estimate": "delay,mount", "smooth": True, "outage": "10s/20s"
    }  # fmt: skip
    for name in ("path.csv", "out.json"):
        (folder / name).unlink()
    again = run("navigate", "run.toml")
    assert again.code == ran.code, again.err
    assert [(folder / name).read_bytes() for name in ("path.csv", "out.json")] == first
    assert (again.out, again.warnings) == (ran.out, ran.warnings)

    # Names are the run's own, from wherever it is repeated.
    moved = folder / "elsewhere"
    moved.mkdir()
    for name in ("raw.csv", "gnss.csv", "odo.csv", "run.toml"):
        shutil.copy(folder / name, moved / name)
    assert run("navigate", moved / "run.toml").code == ran.code
    assert (moved / "path.csv").read_bytes() == first[0]


def test_the_command_line_wins(run: Run, folder: Path) -> None:
    ran = run("navigate", *SAID, "--out", "path.csv", "--save-run", "run.toml")
    assert ran.code in (0, 3), ran.err
    first = (folder / "path.csv").read_bytes()
    again = run("navigate", "run.toml", "--no-nhc", "--every", "40", "--out", "other.csv",
                "--save-run", "other.toml")  # fmt: skip
    assert "non_holonomic" not in again.out
    assert (folder / "path.csv").read_bytes() == first
    rows = [len((folder / f"{n}.csv").read_text("utf-8").splitlines()) for n in ("path", "other")]
    assert rows[0] - 1 == pytest.approx(2 * (rows[1] - 1), abs=2)
    data = tomllib.loads((folder / "other.toml").read_text(encoding="utf-8"))
    assert (data["filter"]["nhc"], data["output"]["every"]) == (False, 40)
    assert data["mapping"]["axes"] == "FRD"
    # The run is read: nothing replaces it.
    ran = run("navigate", "run.toml", "--json", "run.toml", "--save-run", "run.toml")
    assert ran.code == 2


@pytest.mark.parametrize("option", ["--save-run", "--out"])
def test_a_run_is_never_replaced(run: Run, folder: Path, option: str) -> None:
    (folder / "run.toml").write_text(
        'schema = "schuler.run/1"\n[record]\nfile = "raw.csv"\n', encoding="utf-8"
    )
    (folder / "link.csv").symlink_to(folder / "run.toml")
    before = (folder / "run.toml").read_bytes()
    to = "run.toml" if option == "--save-run" else "link.csv"
    ran = run("navigate", "run.toml", "--lat", "40", "--heading", "3", option, to)
    assert (ran.code, "never replaces an input" in ran.err) == (2, True), ran.err
    assert (folder / "run.toml").read_bytes() == before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[record]\nfile = 'a.csv'", "is no run, which says schema"),
        ("[filter]\nsmoth = true", "[filter]: unknown key 'smoth'; did you mean 'smooth'?"),
        ("[filtre]\nsmooth = true", "unknown key 'filtre'; did you mean 'filter'?"),
        ("[mapping]\naxis = 'FRD'", "[mapping]: unknown key 'axis'; did you mean 'axes'?"),
        ("[mapping]\naxes = 3", "[mapping]: axes"),
        ("[filter]\nsmooth = 'yes'", "filter.smooth: expected true or false"),
        ("[filter]\nrobust = 'hubber'", "filter.robust: 'hubber' is not one of"),
        ("[gnss]\ndelay = true", "gnss.delay: expected no true or false"),
        ("[gnss]\ndelay = 100.0", "gnss.delay: expected a number from -10 to 10 s"),
        ("[gnss]\nlever = [[0, 1, 2]]", "gnss.lever: expected a number, a text or a list"),
        ("[gnss]\nfile = 3\n[gnss.x]\ny = 1", "unknown key 'x'"),
        ("gnss = 3", "[gnss]: expected a table"),
        ("[filter]\nnhc = true", "[record] needs file"),
        ("[record]\nfile = 'absent.csv'\n[gnss]\nfile = 'gnss.csv'", "absent.csv"),
        ("[record", "is not valid TOML"),
    ],
)
def test_bad_runs_are_one_sentence(run: Run, folder: Path, text: str, words: str) -> None:
    schema = "" if "schema" in words else 'schema = "schuler.run/1"\n'
    (folder / "run.toml").write_text(schema + text, encoding="utf-8")
    ran = run("navigate", "run.toml")
    assert ran.code == 2
    assert words in ran.err
    assert "Traceback" not in ran.err
    assert len(ran.err.splitlines()) == 1


def test_a_run_needs_a_file_that_can_be_read_again(run: Run, folder: Path) -> None:
    ran = run("navigate", "-", "--lat", "4", "--heading", "1", "--save-run", "run.toml")
    assert (ran.code, "standard input cannot be read again" in ran.err) == (2, True)
