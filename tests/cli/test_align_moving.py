"""``schuler align`` with aids: text, JSON against its schema, report, and wrong input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.io import write
from tests.alignment.moving.routes import body_speed, fixes, heading_error, noisy
from tests.in_motion.test_coarse import simulated

from .conftest import Ran

Run = Callable[..., Ran]
PLACE = ("--lat", "40", "--lon", "10", "--height", "100")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("drive")
    made = simulated("car")
    rng = np.random.default_rng(1)
    gnss, speed = fixes(made, rng=rng), body_speed(made, sigma=0.02, rng=rng)
    write(noisy(made, "navigation-fog", rng), folder / "imu.parquet")
    rows = np.column_stack([gnss.time, gnss.lat / DEG, gnss.lon / DEG, gnss.height, gnss.v_n])
    head = "time [s],lat [deg],lon [deg],height [m],ve [m/s],vn [m/s],vu [m/s]"
    np.savetxt(folder / "gnss.csv", rows, "%.10g", ",", header=head, comments="")
    np.savetxt(
        folder / "place.csv",
        rows[:, :4],
        "%.10g",
        ",",
        header="time [s],lat [deg],lon [deg],height [m]",
        comments="",
    )
    rows = np.searchsorted(made.truth.time, gnss.time[1:] - 1e-6)
    heading = np.rad2deg(psi_to_heading(quat_to_euler(made.truth.quat_nb[rows])[:, 0]))
    columns = [gnss.time[1:], heading + 0.2 * rng.standard_normal(len(rows))]
    np.savetxt(folder / "hdg.csv", np.column_stack(columns), "%.8g", ",",
               header="time [s],heading [deg]", comments="")  # fmt: skip
    columns = [gnss.time[1:], made.truth.height[rows] + 2.0]
    np.savetxt(folder / "baro.csv", np.column_stack(columns), "%.8g", ",",
               header="time [s],height [m]", comments="")  # fmt: skip
    value = np.asarray(speed.value)
    np.savetxt(folder / "dvl.csv", np.column_stack([speed.time, value]), "%.8g", ",",
               header="time,vx,vy,vz", comments="")  # fmt: skip
    np.savetxt(folder / "can.csv", np.column_stack([speed.time, value[:, 1]]), "%.8g", ",",
               header="time,speed", comments="")  # fmt: skip
    return {name: folder / file for name, file in (
        ("I", "imu.parquet"), ("G", "gnss.csv"), ("P", "place.csv"), ("D", "dvl.csv"),
        ("O", "can.csv"), ("H", "hdg.csv"), ("B", "baro.csv"))}  # fmt: skip


def arguments(files: dict[str, Path], *words: object) -> list[object]:
    return [files.get(str(word), word) for word in words]


@pytest.mark.parametrize(
    ("more", "form"),
    [
        (("--gnss", "G"), "velocity"),
        (("--gnss", "P", "--estimate", "delay,lever"), "position"),
        (("--gnss", "G", "--odometer", "O", "--estimate", "scale,mount"), "velocity"),
        (
            (
                "--gnss",
                "G",
                "--heading-file",
                "H",
                "--height-file",
                "B",
                "--height-offset",
                "5,3600",
            ),
            "velocity",
        ),
        (("--dvl", "D", *PLACE), "body velocity"),
        (("--odometer", "O", *PLACE, "--at", "start"), "body velocity"),
    ],
)
def test_json_fits_its_schema(
    run: Run, files: dict[str, Path], root: Path, more: tuple[str, ...], form: str
) -> None:
    schema = json.loads((root / "docs" / "alignment.schema.json").read_text(encoding="utf-8"))
    ran = run(*arguments(files, "align", "I", *more, "--spec", "navigation-fog", "--json", "-"))
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    jsonschema.Draft202012Validator(schema).validate(data)
    assert data["aids"]["form"] == form
    assert sum(data["budget_arcmin2"].values()) == pytest.approx(data["sigma_arcmin"]["up"] ** 2)
    made = simulated("car")
    true = made.truth.quat_nb[0 if "start" in more else -1]
    error = heading_error(np.array(data["quaternion_wxyz"]), true) / ARCMIN
    assert abs(error[2]) < 4.5 * data["sigma_arcmin"]["up"]


def test_text_and_report(run: Run, files: dict[str, Path], tmp_path: Path) -> None:
    page = tmp_path / "drive.html"
    ran = run(*arguments(files, "align", "I", "--gnss", "G", "--from", "+10s", "--to", "50s",
                         "--spec", "navigation-fog", "--report", page))  # fmt: skip
    assert ran.code == 0, ran.err
    assert ran.out.startswith("heading ")
    assert "moving: 41 gnss, 41 gnss_velocity" in ran.out
    assert "heading budget (1 sigma): aiding " in ran.out
    text = page.read_text(encoding="utf-8")
    for words in ("What was measured", "Convergence", "Where the uncertainty comes from"):
        assert words in text
    assert "Repeatability" not in text


def test_a_moving_record_without_aids_says_what_it_needs(run: Run, files: dict[str, Path]) -> None:
    ran = run("align", files["I"], "--lat", "40")
    assert "no heading" in ran.out
    assert any("the vehicle moves" in line and "--gnss FILE" in line for line in ran.warnings)


def test_windows_of_a_drive(run: Run, files: dict[str, Path], root: Path, tmp_path: Path) -> None:
    schema = json.loads((root / "docs" / "alignment.schema.json").read_text(encoding="utf-8"))
    command = arguments(files, "align", "I", "--gnss", "G", "--spec", "navigation-fog")
    ran = run(*command, "--windows", "25s", "--json", tmp_path / "w.json")
    assert ran.code == 0, ran.err
    assert "median difference to the smoothed heading of the whole" in ran.out
    data = json.loads((tmp_path / "w.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    assert len(data["windows"]) >= 2
    assert data["windows_refused"] == []
    for each in data["windows"]:
        # Once in 16,000 windows by chance.
        assert abs(each["difference_arcmin"]) < 4.0 * each["difference_sigma_arcmin"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--lever", "0,0,1"), "--lever is for an alignment in motion"),
        (("--vibration", "0.1"), "--vibration is for an alignment in motion"),
        (("--gnss", "G", "--method", "kalman"), "method of its own"),
        (("--gnss", "G", "--windows", "20h"), "no window of 72000 s is full"),
        (("--gnss", "G", "--follow"), "only text can"),
        (("--gnss", "G", "--estimate", "scale"), "those of --odometer or --dvl"),
        (("--dvl", "D", *PLACE, "--estimate", "delay"), "those of --gnss"),
        (("--dvl", "D", *PLACE, "--delay", "0.1"), "--delay is for --gnss"),
        (("--dvl", "D", *PLACE, "--lever", "0,0,1"), "--lever is for --gnss"),
        (("--gnss", "G", "--dvl-frame", "FRD"), "--dvl-frame is for --dvl"),
        (("--dvl", "D"), "give the site"),
        (("--gnss", "G", "--lever", "1,2"), "--lever: expected three numbers"),
        (("--gnss", "G", "--to", "3s"), "4 measurements lie between"),
        (("--gnss", "I"), "latitude"),
    ],
)
def test_wrong_options(run: Run, files: dict[str, Path], more: tuple[str, ...], words: str) -> None:
    ran = run(*arguments(files, "align", "I", *more))
    assert ran.code == 2
    assert words in ran.err
    assert "Traceback" not in ran.err


def test_options_of_headings_need_their_files(run: Run, files: dict[str, Path]) -> None:
    for words, said in (
        (("--gnss", "G", "--baseline", "1,0,0"), "--baseline goes with --heading-file"),
        (("--gnss", "G", "--height-offset", "1,1"), "--height-offset goes with --height-file"),
        (("--heading-file", "H"), "is for an alignment in motion"),
    ):
        ran = run(*arguments(files, "align", "I", *words, "--spec", "navigation-fog"))
        assert (ran.code, ran.err.count("\n")) == (2, 1)
        assert said in ran.err
