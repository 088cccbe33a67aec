"""``schuler limit --path`` and ``schuler plan drive``: text, JSON, and wrong input."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

from schuler.io import write_trajectory
from tests.alignment.moving.routes import car, truth_of

from .conftest import Ran

Run = Callable[..., Ran]
ROUTE = """
duration = "60 s"
rate = "50 Hz"
instrument = "industrial-mems"
[site]
lat = 40.0
[motion]
kind = "route"
manoeuvres = [{ time = "10 s", speed = 12.0 }, { time = "30 s" }, { time = "10 s", turn = 90.0 }]
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("route")
    (folder / "route.toml").write_text(ROUTE, encoding="utf-8")
    truth = truth_of(car(), 60.0).truth
    write_trajectory(truth, folder / "car.parquet")
    write_trajectory(replace(truth, v_n=None), folder / "place.parquet")
    return {"R": folder / "route.toml", "C": folder / "car.parquet", "N": folder / "place.parquet"}


def arguments(files: dict[str, Path], *words: object) -> list[object]:
    return [files.get(str(word), word) for word in words]


@pytest.mark.parametrize("path", ["R", "C"])
def test_the_limit_of_a_path_fits_its_schema(
    run: Run, files: dict[str, Path], root: Path, path: str
) -> None:
    schema = json.loads((root / "docs" / "path-limit.schema.json").read_text(encoding="utf-8"))
    words = ("limit", "--path", path, "--spec", "tactical-fog", "--aid", "gnss=0.1m/s,3m@1Hz",
             "--aid", "odometer=0.1m/s@5Hz")  # fmt: skip
    ran = run(*arguments(files, *words, "--time", "60s,30s", "--json", "-"))
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    jsonschema.Draft202012Validator(schema).validate(data)
    assert data["spec"] == "tactical-fog"
    assert data["aids"] == ["gnss=0.1m/s,3m@1Hz", "odometer=0.1m/s@5Hz"]
    first, last = data["rows"]
    assert [first["time_s"], last["time_s"]] == pytest.approx([30.0, 60.0])
    assert last["sigma_arcmin"]["up"] < first["sigma_arcmin"]["up"]
    # The whole path where no time is said, and the same in words.
    ran = run(*arguments(files, *words))
    assert f"{last['sigma_arcmin']['up']:8.4g}'" in ran.out


@pytest.mark.parametrize("vehicle", ["car", "aircraft"])
def test_a_plan_fits_its_schema(run: Run, root: Path, vehicle: str) -> None:
    schema = json.loads((root / "docs" / "drive-plan.schema.json").read_text(encoding="utf-8"))
    words = ("plan", "drive", "--spec", "tactical-fog", "--vehicle", vehicle, "--time", "10s",
             "--before", "10s", "--speed", "30", "--lat", "-20")  # fmt: skip
    ran = run(*words, "--aid", "gnss=0.05m/s@2Hz", "--json", "-")
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    jsonschema.Draft202012Validator(schema).validate(data)
    assert data["aids"] == ["gnss=0.05m/s@2Hz"]
    names = [each["name"] for each in data["manoeuvres"]]
    assert ("wing rock" in names) == (vehicle == "aircraft")
    assert names[-1] == "straight"
    assert f"{names[0]} " in run(*words).out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("limit", "--path", "C", "--spec", "tactical-fog"), "say --aid"),
        (("limit", "--path", "C", "--spec", "tactical-fog", "--aid", "gnss"), "an aid is said as"),
        (("limit", "--path", "C", "--spec", "tactical-fog", "--aid", "gnss=1m", "--aid", "gnss=2m"),
         "gnss is there twice"),
        (("limit", "--path", "C", "--spec", "tactical-fog", "--aid", "gnss=1m", "--lat", "4"),
         "--lat is of an alignment at rest"),
        (("limit", "--path", "C", "--spec", "tactical-fog", "--aid", "gnss=1m", "--time", "2min"),
         "the path lasts 60 s"),
        (("limit", "--path", "N", "--spec", "tactical-fog", "--aid", "gnss=1m"), "has no velocity"),
        (("limit", "--spec", "tactical-fog", "--lat", "4", "--aid", "gnss=1m"), "say --path"),
        (("plan", "drive", "--spec", "tactical-fog", "--aid", "dvl=1m"), "dvl measures a velocity"),
        (("plan", "drive", "--spec", "tactical-fog", "--speed", "0"), "--speed"),
    ],
)  # fmt: skip
def test_wrong_input_is_named(
    run: Run, files: dict[str, Path], words: tuple[str, ...], said: str
) -> None:
    ran = run(*arguments(files, *words))
    assert ran.code == 2
    assert said in " ".join(ran.err.split()), ran.err
    assert not ran.out
