"""``schuler align``, ``info`` and ``demo`` from end to end; files in, text, JSON and pages out."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

import schuler as sc
from schuler.alignment import METHODS
from schuler.cli import cli
from schuler.constants import EARTH_RATE
from schuler.earth import Site
from schuler.record import ImuRecord

from .conftest import HEADING, PLACE, SITE, Ran, as_text, found

Array = NDArray[np.float64]
Run = Callable[..., Ran]

SPEC = """
name = "mine"
[gyro]
bias = "0.02 deg/h"
angle_random_walk = "0.003 deg/sqrt(h)"
[accelerometer]
bias = "50 ug"
velocity_random_walk = "20 ug/sqrt(Hz)"
"""


def off_arcmin(heading: float) -> float:
    return ((heading - HEADING + 180.0) % 360.0 - 180.0) * 60.0


def result(run: Run, *arguments: object) -> dict[str, object]:
    """Run align with ``--json -`` and return the result."""
    ran = run("align", *arguments, "--json", "-")
    assert ran.code == 0, ran.err
    data: dict[str, object] = found(ran.out)
    return data


def as_record(table: Array) -> ImuRecord:
    """Return the record that mean rates mean, made without any reader."""
    dt = np.diff(table[:, 0], prepend=0.0)
    return ImuRecord(
        table[:, 0], dt, table[:, 1:4] * dt[:, None], table[:, 4:] * dt[:, None], name="truck"
    )


#: what each command says of a file that says nothing itself
ASSUMED = "note: assumed: axes right-forward-up (RFU); units rad/s and m/s^2\n"


# -- what is printed and written -------------------------------------------------------


def test_text(run: Run, csv: Path) -> None:
    ran = run("align", csv, *PLACE, "--spec", "navigation-fog")
    assert ran.code == 0
    assert ran.err == ASSUMED
    lines = ran.out.splitlines()
    assert lines[0].startswith("heading ")
    assert "± " in lines[0]
    assert "limit" in lines[0]
    assert lines[1].startswith("pitch 1.0")
    assert "optimal, 59.95 s, 1199 samples, attitude at the end" in lines[2]
    assert lines[3].startswith("chosen because the base ")
    assert lines[-1].startswith("heading budget (1 sigma): ")
    assert "gyro bias" in lines[-1]


def test_json_is_pure_and_complete(run: Run, csv: Path) -> None:
    ran = run("align", csv, *PLACE, "--spec", "navigation-fog", "--json", "-")
    data = found(ran.out)
    assert ran.err == ASSUMED
    assert data["schema"] == "schuler.alignment/3"
    sigma = data["sigma_arcmin"]["up"]
    # Six sigma: one false alarm in 5e8 seeds.
    assert abs(off_arcmin(data["heading_deg"])) < 6 * sigma
    assert sum(data["budget_arcmin2"].values()) == pytest.approx(sigma**2, rel=1e-12)
    assert data["limit_arcmin"]["up"] <= sigma
    fix = sc.align(sc.read(csv), SITE, spec="navigation-fog")
    data.pop("assumed")  # of the file, which a record does not know
    assert data == {k: v for k, v in json.loads(fix.to_json()).items() if k != "assumed"}


@pytest.mark.parametrize("more", [(), ("--spec", "navigation-fog"), ("--windows", "20s")])
def test_json_fits_its_schema(run: Run, csv: Path, root: Path, more: tuple[str, ...]) -> None:
    import jsonschema

    path = root / "docs" / "alignment.schema.json"
    if not path.is_file():
        pytest.skip(f"there is no {path.relative_to(root)} yet")
    schema = json.loads(path.read_text(encoding="utf-8"))
    for method in METHODS:
        if method == "gyrocompass" and "--windows" in more:
            continue  # its loops do not settle in 20 s
        jsonschema.validate(result(run, csv, *PLACE, "--method", method, *more), schema)


def test_files_are_whole(run: Run, csv: Path, tmp_path: Path) -> None:
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    out.write_text("old")
    ran = run("align", csv, *PLACE, "--json", out, "--report", page, "--windows", "20s")
    assert ran.code == 0
    assert found(out.read_text()) == result(run, csv, *PLACE, "--windows", "20s")
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert text.endswith("</html>\n")
    assert "Repeatability" in text
    assert str(csv) in text
    assert {p.name for p in tmp_path.iterdir()} == {"truck.csv", "out.json", "out.html"}


def test_a_failure_keeps_the_old_result(run: Run, csv: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    out.write_text("old")
    assert run("align", csv, *PLACE, "--json", out, "--start", "59.8").code == 2
    assert out.read_text() == "old"
    assert {p.name for p in tmp_path.iterdir()} == {"truck.csv", "out.json"}


def test_through_click_s_own_runner(csv: Path) -> None:
    ran = CliRunner().invoke(cli, ["align", str(csv), *PLACE, "--json", "-"])
    assert ran.exit_code == 0
    assert json.loads(ran.stdout)["schema"] == "schuler.alignment/3"
    assert ran.stderr.startswith(f"{ASSUMED}warning: no instrument specification")


# -- options ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_methods(run: Run, csv: Path, method: str) -> None:
    data = result(run, csv, *PLACE, "--method", method, "--spec", "navigation-fog")
    assert data["method"]["name"] == ("optimal" if method == "auto" else method)
    sigma: dict[str, float] = data["sigma_arcmin"]  # type: ignore[assignment]
    assert abs(off_arcmin(float(data["heading_deg"]))) < 6 * sigma["up"]  # type: ignore[arg-type]


def test_method_in_capitals(run: Run, csv: Path) -> None:
    assert result(run, csv, *PLACE, "--method", "Wahba")["method"]["name"] == "wahba"


def test_a_specification_file(run: Run, csv: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(SPEC)
    place = (*PLACE, "--method", "centred")
    mine = result(run, csv, *place, "--spec", path)
    grade = result(run, csv, *place, "--spec", "navigation-fog")
    none = result(run, csv, *place)
    assert none["limit_arcmin"] is None
    share = [d["budget_arcmin2"]["gyro_bias"] for d in (mine, grade)]  # type: ignore[index]
    assert share[0] == pytest.approx(4 * share[1], rel=1e-9)
    assert mine["heading_deg"] == grade["heading_deg"] == none["heading_deg"]
    assert set(none["budget_arcmin2"]) == {"disturbance", "gyro_bias", "gravity"}  # type: ignore[call-overload]


def test_windows(run: Run, csv: Path) -> None:
    ran = run("align", csv, *PLACE, "--windows", "20s", "--at", "start")
    assert ran.code == 0
    lines = ran.out.splitlines()
    assert lines[0].split() == ["start", "s", "end", "s", "heading", "deg", "pitch", "deg",
                                "roll", "deg", "sigma"]  # fmt: skip
    data = result(run, csv, *PLACE, "--windows", "20s", "--at", "start")
    each = data["windows"]
    assert isinstance(each, list)
    assert len(each) == 3 or len(each) == 2
    assert lines[1 + len(each)].startswith(f"{len(each)} windows of 20 s: mean heading ")
    record = sc.read(csv)
    for window in each:
        fix = sc.align(record.between(window["start_s"], window["end_s"]), SITE, at="start")
        assert window["heading_deg"] == pytest.approx(fix.heading_deg, abs=1e-9)
    assert (
        result(run, csv, *PLACE, "--windows", "0.333333333333333333min")["windows"]
        == (result(run, csv, *PLACE, "--windows", "20")["windows"])
    )


def test_at(run: Run, tmp_path: Path) -> None:
    """On a turning base the two instants differ by what it has turned: 3 deg."""
    turn, dt = np.deg2rad(0.05), 0.05
    h = turn * dt * np.arange(1201)
    north, up = EARTH_RATE * np.cos(SITE.latitude), EARTH_RATE * np.sin(SITE.latitude)
    dtheta = np.column_stack(
        [
            north * np.diff(np.cos(h)) / turn,
            north * np.diff(np.sin(h)) / turn,
            np.full(1200, (up - turn) * dt),
        ]
    )
    dvel = np.tile([0.0, 0.0, SITE.gravity * dt], (1200, 1))
    record = ImuRecord(dt * np.arange(1, 1201), np.full(1200, dt), dtheta, dvel, name="turning")
    sc.write(record, tmp_path / "turning.parquet")
    start, end = (
        result(run, tmp_path / "turning.parquet", *PLACE, "--at", at)["heading_deg"]
        for at in ("start", "end")
    )
    assert float(end) - float(start) == pytest.approx(3.0, abs=1e-6)  # type: ignore[arg-type]
    assert end == pytest.approx(3.0, abs=1e-4)


def test_start_and_stop(run: Run, csv: Path, original: Array) -> None:
    data = result(run, csv, *PLACE, "--start", "10s", "--stop", "0.5min", "--mean-rates")
    fix = sc.align(as_record(original).between(10.0, 30.0), SITE)
    assert data["time"]["samples"] == 400  # type: ignore[index]
    assert data["time"]["end"] == pytest.approx(30.0)  # type: ignore[index]
    assert data["heading_deg"] == pytest.approx(fix.heading_deg, abs=1e-6)


def test_mean_rates(run: Run, csv: Path, original: Array) -> None:
    fix = sc.align(as_record(original), SITE)
    data = result(run, csv, *PLACE, "--mean-rates")
    assert data["time"]["samples"] == 1200  # type: ignore[index]
    assert data["heading_deg"] == pytest.approx(fix.heading_deg, abs=1e-6)
    plain = result(run, csv, *PLACE, "--instantaneous-rates")
    assert plain["time"]["samples"] == 1199  # type: ignore[index]
    assert plain == result(run, csv, *PLACE)


def test_units_and_columns(run: Run, original: Array, tmp_path: Path) -> None:
    """The same record in another program's order and units is the same record."""
    path = tmp_path / "other.txt"
    other = original[:, [4, 5, 6, 1, 2, 3, 0]] / 9.80665
    other[:, 3:6] = np.rad2deg(original[:, 1:4])
    other[:, 6] = 1e3 * original[:, 0]
    path.write_text(as_text(other, None, ";"))
    data = result(run, path, *PLACE, "--columns", "ax,ay,az,gx,gy,gz,t", "--gyro", "deg/s",
                  "--accel", "g", "--time", "ms")  # fmt: skip
    plain = tmp_path / "plain.csv"
    plain.write_text(as_text(original))
    expected = result(run, plain, *PLACE)
    for key in ("heading_deg", "pitch_deg", "roll_deg"):
        assert data[key] == pytest.approx(expected[key], abs=1e-7)


def test_axes(run: Run, original: Array, csv: Path, tmp_path: Path) -> None:
    """Front, right, down in the file: y, x, -z of right, front, up."""
    path = tmp_path / "frd.csv"
    path.write_text(as_text(original[:, [0, 2, 1, 3, 5, 4, 6]] * [1, 1, 1, -1, 1, 1, -1]))
    named, plain = result(run, path, *PLACE, "--axes", "FRD"), result(run, csv, *PLACE)
    assert plain.pop("assumed") == ["axes right-forward-up (RFU)", "units rad/s and m/s^2"]
    assert named.pop("assumed") == ["units rad/s and m/s^2"]
    assert named == plain


def test_save_mapping(run: Run, original: Array, tmp_path: Path) -> None:
    path, sidecar = tmp_path / "truck.txt", tmp_path / "truck.txt.toml"
    path.write_text(as_text(original * ([1] + [180 / np.pi] * 3 + [1 / 9.80665] * 3), None, ";"))
    said = ("--gyro", "deg/s", "--accel", "g", "--mean-rates")
    assert run("align", path, *said, "--save-mapping").code == 2  # no latitude
    assert not sidecar.exists()
    first = result(run, path, *PLACE, *said, "--save-mapping")
    assert sidecar.read_text() == 'gyro = "deg/s"\naccel = "g"\nmean_rates = true\n'
    assert result(run, path, *PLACE) == first
    # What is said later is added to what was said before.
    second = run("info", path, "--max-gap", "3", "--axes", "-y,x,z", "--save-mapping")
    assert second.code == 0
    assert sc.io.Mapping.from_toml(sidecar).said() == {
        "gyro": "deg/s", "accel": "g", "mean_rates": True, "axes": "-y,x,z",
    }  # fmt: skip
    assert run("align", "-", *PLACE, "--save-mapping").code == 2


def test_mapping_file(run: Run, csv: Path, tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text("mean_rates = true\n")
    data = result(run, csv, *PLACE, "--mapping", tmp_path / "m.toml")
    assert data == result(run, csv, *PLACE, "--mean-rates")


def test_place_of_the_file(run: Run, tmp_path: Path, original: Array) -> None:
    """A PSINS header says where the vehicle stands; an option says it better."""
    counts = original[:, 1:] * 0.05 / ([np.pi / 648000] * 3 + [1e-6 * 9.8] * 3)
    head = "% PSINS\n0 0 0 0 0 0\n40 116 50 0 50 9.8\n1 1 1 1 1 1\n"
    path = tmp_path / "truck.imu"
    path.write_text(head + as_text(counts, None, " "))
    assert result(run, path) == result(run, path, *PLACE)
    assert result(run, path, "--lat", "41") != result(run, path)


# -- info and demo ---------------------------------------------------------------------


def test_info(run: Run, csv: Path) -> None:
    ran = run("info", csv, *PLACE)
    assert ran.code == 0
    assert ran.err == ASSUMED
    assert "read as  instantaneous rates in rad/s and m/s^2 (assumed)" in ran.out
    assert "1199, 0.05 to 60 s" in ran.out
    assert "20 Hz" in ran.out
    ran = run("info", csv, *PLACE, "--json", "-")
    data = json.loads(ran.out)
    site = Site(40.0, 0.0, 50.0)
    assert data["norm_of_mean_force_m_s2"] == pytest.approx(site.gravity, abs=2e-3)
    # Gyro bias 0.01 deg/h an axis and 1.5' of random walk: 15.04 within 1 deg/h is 10 sigma.
    assert data["mean_rate_norm_deg_h"] == pytest.approx(15.04, abs=1.0)
    assert data["warnings"] == []
    assert data["dropped_rows"] == 0


def test_info_fits_its_schema(run: Run, csv: Path, root: Path) -> None:
    import jsonschema

    path = root / "docs" / "info.schema.json"
    if not path.is_file():
        pytest.skip(f"there is no {path.relative_to(root)} yet")
    schema = json.loads(path.read_text(encoding="utf-8"))
    for more in ((), PLACE):
        jsonschema.validate(json.loads(run("info", csv, *more, "--json", "-").out), schema)


def test_info_without_a_place(run: Run, csv: Path, tmp_path: Path) -> None:
    ran = run("info", csv, "--start", "30", "--json", tmp_path / "info.json")
    assert ran.code == 0
    assert "standard gravity" in ran.out
    assert json.loads((tmp_path / "info.json").read_text())["time"]["samples"] == 600


def test_demo(run: Run, tmp_path: Path) -> None:
    first = run("demo", "--out", tmp_path / "a" / "b", "--minutes", "1", "--seed", "3")
    assert first.code == 0
    names = {p.name for p in (tmp_path / "a" / "b").iterdir()}
    assert names == {"demo.parquet", "demo.html", "demo.json"}
    line = next(s for s in first.out.splitlines() if s.startswith("truth: heading 57."))
    # The stated error in sigma: above six, one in 5e8 seeds.
    assert float(line.split("(")[1].split()[0]) < 6
    run("demo", "--out", tmp_path / "c", "--minutes", "1", "--seed", "3")
    both = [found((tmp_path / d / "demo.json").read_text()) for d in ("a/b", "c")]
    assert both[0] == both[1]


def test_demo_without_plotly_has_no_report_and_says_so(run, tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    done = run("demo", "--out", tmp_path, "--minutes", "0.5")
    assert done.code == 0
    assert "report" not in done.out
    assert "pip install 'plotly>=" in done.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["demo.json", "demo.parquet"]


# -- as a process ----------------------------------------------------------------------


def schuler(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "schuler", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, check=False, **options,  # type: ignore[call-overload]
    )  # fmt: skip


def test_process(csv: Path, tmp_path: Path) -> None:
    done = schuler("align", csv, *PLACE, "--json", "-")
    assert done.returncode == 0
    assert json.loads(done.stdout)["schema"] == "schuler.alignment/3"
    assert done.stderr.count("\n") == 2
    done = schuler("align", tmp_path / "no.csv", *PLACE)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"schuler: {tmp_path / 'no.csv'}: there is no such file\n"


def test_process_with_piped_input(csv: Path) -> None:
    done = schuler("align", "-", *PLACE, "--json", "-", input=csv.read_text())
    whole = schuler("align", csv, *PLACE, "--json", "-")
    assert found(done.stdout) == found(whole.stdout)


@pytest.mark.skipif(os.name != "posix", reason="pipes end in another way there")
def test_a_reader_that_goes_away_is_no_traceback(csv: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "schuler", "align", str(csv), *PLACE],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        err = process.stderr.read()
        assert process.wait(60) == 1
    assert "Traceback" not in err
    assert "Broken" not in err


def test_the_latitude_is_found(run: Run, csv: Path) -> None:
    data = result(run, csv, "--find-latitude", "--spec", "navigation-fog")
    sigma = float(data["latitude_sigma_deg"])  # type: ignore[arg-type]
    assert abs(float(data["latitude_deg"]) - float(PLACE[1])) < 4 * sigma  # type: ignore[arg-type]
    ran = run("align", csv, "--find-latitude", "--method", "wahba")
    assert ran.code == 2
    assert "method of its own" in ran.err
