"""The command ``schuler allan``: table, JSON, page, specification, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from schuler.sensors import ImuSpec

from .conftest import NAMES, PLACE, Ran, as_text

Run = Callable[..., Ran]
MEANS = ("--mean-rates",)


@pytest.fixture(scope="module")
def rates() -> np.ndarray:
    """Return 200 s at 20 Hz: a white gyro of 0.2 deg/sqrt(h) and 100 ug/sqrt(Hz), t and rates."""
    rng = np.random.default_rng(8)
    n = 4000
    gyro = rng.normal(size=(n, 3)) * np.radians(0.2) / 60.0 * np.sqrt(20.0)
    accel = rng.normal(size=(n, 3)) * 100e-6 * 9.80665 * np.sqrt(20.0) + [0.0, 0.0, 9.8]
    return np.column_stack([np.arange(1, n + 1) / 20.0, gyro, accel])


@pytest.fixture
def still(tmp_path: Path, rates: np.ndarray) -> Path:
    path = tmp_path / "still.csv"
    path.write_text(as_text(rates, NAMES))
    return path


def test_table_and_fit(run: Run, still: Path) -> None:
    ran = run("allan", still, *MEANS)
    assert ran.code == 0
    assert ran.err == "note: assumed: axes right-forward-up (RFU); units rad/s and m/s^2\n"
    lines = ran.out.splitlines()
    assert lines[0] == "allan deviation of still: 4000 samples, 200 s"
    assert lines[1].split() == ["tau", "s", *(f"gyro_{a}" for a in "xyz"), *(
        f"accel_{a}" for a in "xyz")]  # fmt: skip
    assert lines[2].split() == ["deg/h"] * 3 + ["ug"] * 3
    # 0.2 deg/sqrt(h) is 12 deg/h at 1 s, 12.3 at 0.95 s; 200 s give it to 4 %: five times that.
    one = next(line.split() for line in lines if line.split()[0] == "0.95")
    assert float(one[1]) == pytest.approx(12.0, rel=0.2)
    assert float(one[4]) == pytest.approx(100.0, rel=0.2)
    walks = [line.split("walk")[1].split() for line in lines if "angle random walk" in line]
    assert len(walks) == 3
    for value, _, sigma, unit, *_ in walks:
        assert abs(float(value) - 0.2) < 4.5 * float(sigma)
        assert unit == "deg/sqrt(h)"
    assert sum("<" in line and "bias instability" in line for line in lines) == 6


def test_json_fits_its_schema(run: Run, still: Path, root: Path) -> None:
    schema = json.loads((root / "docs" / "allan.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    check = jsonschema.Draft202012Validator(schema)
    for more in ((), ("--kind", "total"), ("--kind", "hadamard", "--taus", "0.1,1s,10 s")):
        ran = run("allan", still, *MEANS, "--json", "-", *more)
        assert ran.code == 0
        data = json.loads(ran.out)
        check.validate(data)
        assert data["assumed"] == ["axes right-forward-up (RFU)", "units rad/s and m/s^2"]
        assert all(
            len(channel[key]) == len(data["tau_s"])
            for channel in data["channels"].values()
            for key in ("adev", "lower", "upper")
        )
    # Three averaging times are no fit, which is said.
    assert data["channels"]["gyro_x"]["fit"] is None
    assert "6 octaves" in ran.err
    data["surprise"] = 1
    with pytest.raises(jsonschema.ValidationError):
        check.validate(data)


def test_channels_can_be_chosen(run: Run, still: Path) -> None:
    ran = run("allan", still, *MEANS, "--channel", "accel-z", "--channel", "gyro_x", "--json", "-")
    assert list(json.loads(ran.out)["channels"]) == ["gyro_x", "accel_z"]


def test_a_specification_goes_on_to_align(run: Run, still: Path, csv: Path) -> None:
    spec = still.with_name("mine.toml")
    assert run("allan", still, *MEANS, "--save-spec", spec).code == 0
    found = ImuSpec.from_toml(spec)
    # Three axes of 200 s: to 2 %, five times that.
    assert np.degrees(found.gyro.angle_random_walk) * 60 == pytest.approx(0.2, rel=0.1)
    ran = run("align", csv, *PLACE, "--spec", spec)
    assert ran.code == 0
    assert "heading" in ran.out


def test_a_specification_takes_what_no_record_shows(run: Run, still: Path) -> None:
    spec = still.with_name("with_bias.toml")
    more = ("--gyro-bias", "0.5 deg/h", "--accel-bias", "100 ug", "--note", "unit 7")
    assert run("allan", still, *MEANS, "--save-spec", spec, *more).code == 0
    found = ImuSpec.from_toml(spec)
    assert np.degrees(found.gyro.bias) * 3600 == pytest.approx(0.5)
    assert found.source.endswith("; unit 7")
    assert "holds no" not in spec.read_text(encoding="utf-8")


def test_spikes_are_named_and_may_be_kept(run: Run, tmp_path: Path) -> None:
    """White noise of 0.3 deg/sqrt(h) with three samples of 2000 deg/s, read at default options."""
    rng = np.random.default_rng(5)
    rows = np.column_stack(
        [np.arange(1, 6001) / 100, 0.05 * rng.normal(size=(6000, 3)),
         0.001 * rng.normal(size=(6000, 3)) + [0, 0, 1.0]]
    )  # fmt: skip
    rows[[1000, 2400, 4200], 1] = 2000.0
    path = tmp_path / "spike.csv"
    names = "time,gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],acc_x [g],acc_y [g],acc_z [g]"
    np.savetxt(path, rows, "%.6g", ",", header=names, comments="")
    ran = run("allan", path, "--json", "-")
    assert ran.code == 0
    fit = json.loads(ran.out)["channels"]["gyro_x"]["fit"]
    assert fit["angle_random_walk"]["value"] == pytest.approx(0.3, rel=0.03)
    assert "warning: 3 samples were left out as spikes: row 1001 (t = 10.01 s), gyro x, 2000" in (
        ran.err
    )
    kept = run("allan", path, "--keep-spikes", "--json", "-")
    assert "spike" not in kept.err
    assert json.loads(kept.out)["channels"]["gyro_x"]["adev"][0] > 1e5


def test_report(run: Run, still: Path) -> None:
    page = still.with_name("noise.html")
    assert run("allan", still, *MEANS, "--report", page).code == 0
    text = page.read_text(encoding="utf-8")
    for words in ("Gyros", "Accelerometers", "angle random walk", "deg/sqrt(h)", "Allan deviation"):
        assert words in text
    assert text.count('class="plot"') == 2
    # Without a fit there are curves alone.
    ran = run("allan", still, *MEANS, "--taus", "1,2", "--channel", "gyro-y", "--report", page)
    assert ran.code == 0
    assert page.read_text(encoding="utf-8").count('class="plot"') == 1


def test_part_of_a_record(run: Run, still: Path) -> None:
    ran = run("allan", still, *MEANS, "--start", "100", "--stop", "150s", "--kind", "total")
    assert ran.out.startswith("total deviation of still: 1000 samples, 50 s")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--channel", "gyro-w"), ["gyro_w", "gyro_x"]),
        (("--taus", "10ms"), ["0.01 s", "sampling interval", "0.05 s"]),
        (("--taus", "150s"), ["150 s", "too long", "200 s"]),
        (("--taus", "1,two"), ["--taus", "two"]),
        (("--taus", "3 m"), ["--taus", "length"]),
        (("--taus", "1s,2s", "--save-spec", "x.toml"), ["6 octaves"]),
        (("--kind", "modified"), ["modified", "hadamard"]),
        (("--stop", "0.3s"), ["sample(s)", "9"]),
        (("--json", "no/such/place.json"), ["no folder"]),
        (("--report", "no/such/place.html"), ["no folder"]),
        (("--save-spec", "no/such/place.toml"), ["no folder"]),
        (("--gyro-bias", "1 deg/h"), ["--gyro-bias", "--save-spec"]),
        (("--save-spec", "x.toml", "--gyro-bias", "1 ug"), ["--gyro-bias", "angular rate"]),
        (("--save-spec", "x.toml", "--accel-bias", "-1 ug"), ["--accel-bias", "negative"]),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    run: Run, still: Path, more: tuple[str, ...], words: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(still.parent)
    ran = run("allan", still, *MEANS, *more)
    assert ran.code == 2
    assert ran.out == ""
    assert len(ran.err.strip().splitlines()) == 1
    for word in words:
        assert word in ran.err


@pytest.mark.realdata
def test_a_moving_vehicle_is_said(run: Run, data_dir: Path) -> None:
    ran = run("allan", data_dir / "psins_lasergyro_vehicle" / "lasergyro.imu", "--json", "-")
    assert ran.code == 0
    assert "not the noise of an instrument at rest" in ran.err


@pytest.mark.realdata
def test_counts_of_a_mems_unit(run: Run, data_dir: Path) -> None:
    """The README's own figures: 2.3 to 2.6 deg/sqrt(h) and 512 to 719 ug at 1 s; to 1 %."""
    ran = run(
        "allan", data_dir / "adis16405_static_3h" / "adis16405_imu1.npz", "--rate", "100",
        "--variables", "gyro=gyro_counts,accel=accel_counts", "--gyro", "0.05 deg/s",
        "--accel", "0.00333 g", "--mean-rates", "--taus", "0.01,0.02,0.04,1", "--json", "-",
    )  # fmt: skip
    channels = json.loads(ran.out)["channels"]
    at_one = {name: channel["adev"][-1] for name, channel in channels.items()}
    assert all(2.3 * 60 < at_one[f"gyro_{a}"] < 2.65 * 60 for a in "xyz")
    assert all(507 < at_one[f"accel_{a}"] < 726 for a in "xyz")
