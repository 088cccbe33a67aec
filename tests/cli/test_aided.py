"""``schuler navigate --gnss``: text, JSON against its schema, and wrong input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from schuler.attitude import quat_to_matrix
from schuler.constants import DEG
from schuler.io import write, write_trajectory
from tests.navigation.test_aided import drive

from .conftest import Ran

Run = Callable[..., Ran]


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made, _ = drive(7, late=0.1)
    path = tmp_path_factory.mktemp("truth") / "truth.csv"
    write_trajectory(made.truth.rows(slice(0, None, 10)), path)
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("drive")
    made, gnss = drive(7, late=0.1)
    write(made.record, folder / "imu.parquet")
    rows = np.column_stack([gnss.time, gnss.lat / DEG, gnss.lon / DEG, gnss.height, gnss.v_n])
    head = "time [s],lat [deg],lon [deg],height [m],ve [m/s],vn [m/s],vu [m/s]"
    np.savetxt(folder / "gnss.csv", rows, "%.10g", ",", header=head, comments="")
    return folder / "imu.parquet", folder / "gnss.csv"


def test_json_fits_its_schema(run: Run, files: tuple[Path, Path], root: Path) -> None:
    schema = json.loads((root / "docs" / "navigation.schema.json").read_text(encoding="utf-8"))
    more = ("--nhc", "--zupt", "--estimate", "delay,lever", "--smooth", "--outage", "15s/30s",
            "--gnss-sigma", "0.05,0.05", "--spec", "tactical-fog")  # fmt: skip
    ran = run("navigate", files[0], "--gnss", files[1], *more, "--json", "-")
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    jsonschema.Draft202012Validator(schema).validate(data)
    value, sigma = data["estimated"]["delay_s"]["gnss"]
    assert abs(value - 0.1) < max(5.0 * sigma, 0.02)
    assert data["outages"]["count"] == 2
    assert data["consistent"]
    assert set(data["used"]) >= {"gnss", "gnss_velocity", "non_holonomic"}


def test_text_names_what_was_used(run: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    ran = run("navigate", files[0], "--gnss", files[1], "--out", tmp_path / "p.parquet",
              "--report", tmp_path / "p.html")  # fmt: skip
    assert ran.code == 0, ran.err
    assert "by aided navigation (" in ran.out
    assert "no specification was given" in ran.err
    assert (tmp_path / "p.parquet").is_file()
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "Innovations" in page
    assert "free-inertial" not in page


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--zupt",), "--zupt is for aided navigation: say --gnss"),
        (("--delay", "0"), "--delay is for aided navigation: say --gnss"),
        (("--gnss", "G", "--estimate", "scale"), "give one"),
        (("--gnss", "G", "--estimate", "mount"), "which show it"),
        (("--gnss", "G", "--estimate", "speed"), "'speed' is none of delay, lever"),
        (("--gnss", "G", "--lever", "1,2"), "--lever: expected three numbers"),
        (("--gnss", "G", "--gnss-sigma", "x"), "--gnss-sigma: expected two numbers"),
        (("--gnss", "G", "--outage", "45s/15s"), "shorter than its period"),
        (("--gnss", "G", "--reference", "no.csv"), "no.csv"),
        (("--gnss", "G", "--align", "30s"), "--align is for free-inertial"),
        (("--gnss", "G", "--heading", "40"), "needs its place"),
        (("--gnss", "G", "--wheels", "rear"), "--wheels goes with --odometer"),
        (("--gnss", "G", "--odometer-scale", "0.02"), "--odometer-scale goes with --odometer"),
        (("--gnss", "G", "--nhc-lever", "0,-1,0"), "--nhc-lever goes with --nhc"),
        (("--gnss", "G", "--nhc", "--nhc-lever", "0,-1"), "--nhc-lever: expected three numbers"),
        (("--gnss", "absent.csv"), "absent.csv"),
    ],
)
def test_wrong_options(
    run: Run, files: tuple[Path, Path], more: tuple[str, ...], words: str
) -> None:
    ran = run("navigate", files[0], *(files[1] if word == "G" else word for word in more))
    assert ran.code == 2
    assert words in ran.err
    assert "Traceback" not in ran.err


def test_all_aids_together(run: Run, files: tuple[Path, Path], root: Path) -> None:
    """A barometer on a clock of its own, headings of a baseline to the right, a Doppler log."""
    folder = files[0].parent
    made, _ = drive(7, late=0.1)
    truth = made.truth
    rows = np.arange(200, len(truth.time) - 100, 50)
    t, rng = truth.time[rows], np.random.default_rng(5)
    rotation = quat_to_matrix(truth.quat_nb[rows])
    body = np.einsum("iba,ib->ia", rotation, truth.v_n[rows])
    body = 1.01 * body + 0.02 * rng.standard_normal(body.shape)
    pressure = 101325.0 * (1.0 - 0.0065 / 288.15 * (truth.height[rows] + 12.0)) ** 5.25588
    right = np.degrees(np.arctan2(rotation[:, 0, 0], rotation[:, 1, 0]))
    tables = {
        "baro.csv": ("time,pressure [hPa]", np.column_stack([t + 18.0, 0.01 * pressure])),
        "heading.csv": ("time,heading [deg],sd [deg]", np.column_stack([t, right, 0 * t + 0.2])),
        "dvl.csv": ("time,vx,vy,vz,valid",
                    np.column_stack([t, body[:, [1, 0]], -body[:, 2], (t % 7 > 1)])),
    }  # fmt: skip
    for name, (head, table) in tables.items():
        np.savetxt(folder / name, table, "%.10g", ",", header=head, comments="")
    ran = run(
        "navigate", files[0], "--gnss", files[1], "--height-file", folder / "baro.csv",
        "--time-offset", "height=-18", "--height-offset", "30,86400", "--heading-file",
        folder / "heading.csv", "--baseline", "1,0,0", "--dvl", folder / "dvl.csv",
        "--dvl-frame", "FRD", "--estimate", "scale,mount", "--spec", "tactical-fog",
        "--vibration", "0.001", "--json", "-",
    )  # fmt: skip
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    schema = json.loads((root / "docs" / "navigation.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    assert set(data["used"]) >= {"gnss", "height", "heading", "dvl"}
    assert data["estimated"]["offset_m"]["height"][0] == pytest.approx(12.0, abs=1.0)
    assert data["estimated"]["doppler_scale"]["dvl"][0] == pytest.approx(0.01, abs=0.002)
    assert data["consistent"]
    assert any("rows of dvl were left out: " in text for text in data["warnings"])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--time-offset", "gnss=x"), "expected one of gnss, odometer"),
        (("--time-offset", "clock=1"), "expected one of gnss, odometer"),
        (("--time-offset", "dvl=1"), "no such aid is given"),
        (("--aid-topic", "dvl=/odom"), "which is given"),
        (("--dvl-frame", "FRD"), "--dvl-frame goes with --dvl"),
        (("--height-offset", "1,2"), "--height-offset goes with --height-file"),
        (("--baseline", "1,0,0"), "--baseline goes with --heading-file"),
        (("--height-file", "absent.csv"), "absent.csv: there is no such file"),
        (("--time-offset", "gnss=100000"), "an offset of the aid's times"),
    ],
)
def test_wrong_options_of_other_aids(
    run: Run, files: tuple[Path, Path], more: tuple[str, ...], words: str
) -> None:
    ran = run("navigate", files[0], "--gnss", files[1], *more)
    assert ran.code == 2
    assert words in ran.err


def test_pulses_from_the_rear_axle(run: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    made, _ = drive(7, late=0.1)
    way = np.cumsum(np.linalg.norm(made.truth.v_n, axis=1)) * 0.01
    rows = np.column_stack([made.truth.time, np.floor(way / 0.02)])
    np.savetxt(tmp_path / "p.csv", rows, "%.9g", ",", header="t,pulses", comments="")
    ran = run("navigate", files[0], "--gnss", files[1], "--odometer", tmp_path / "p.csv",
              "--odometer-scale", "0.0202", "--odometer-lever", "0,0,0", "--nhc", "--nhc-lever",
              "0,0,0", "--estimate", "scale,delay", "--spec", "tactical-fog", "--json",
              "-")  # fmt: skip
    assert ran.code == 0, ran.err
    value, sigma = json.loads(ran.out)["estimated"]["odometer_scale"]
    assert value == pytest.approx(0.01, abs=max(4.0 * sigma, 1e-3))
    assert "note: odometer: speed is pulses over 0.1 s" in ran.err


def test_a_reference_scores_path_and_sigma(
    run: Run, files: tuple[Path, Path], truth: Path, tmp_path: Path, root: Path
) -> None:
    schema = json.loads((root / "docs" / "navigation.schema.json").read_text(encoding="utf-8"))
    more = ("--delay", "0.1", "--gnss-sigma", "0.05,0.05", "--spec", "tactical-fog", "--vibration",
            "0.0001", "--smooth", "--reference", truth)  # fmt: skip
    ran = run("navigate", files[0], "--gnss", files[1], *more, "--json", tmp_path / "n.json",
              "--report", tmp_path / "n.html")  # fmt: skip
    assert ran.code == 0, ran.err
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    error = data["error"]
    assert error["horizontal_m"] < 0.1
    assert all(0.4 < ratio < 1.8 for ratio in error["normalised_rms"].values())
    assert "of its sigma rms" in ran.out
    page = (tmp_path / "n.html").read_text(encoding="utf-8")
    assert "Against the reference" in page
    assert "attitude error phi up" in page

    # Of another point it is as far off as the lever is long.
    ran = run("navigate", files[0], "--gnss", files[1], *more, "--at", "0,3,0", "--json", "-")
    far = json.loads(ran.out)["error"]
    assert far["horizontal_m"] == pytest.approx(3.0, abs=0.2)
