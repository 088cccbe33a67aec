"""``schuler navigate --gnss``: text, JSON against its schema, and wrong input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from schuler.constants import DEG
from schuler.io import write
from tests.navigation.test_aided import drive

from .conftest import Ran

Run = Callable[..., Ran]


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
        (("--gnss", "G", "--align", "30s"), "--align is for free-inertial"),
        (("--gnss", "G", "--heading", "40"), "needs its place"),
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
