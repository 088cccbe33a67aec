"""North with one gyro on an indexing table, simulated and real."""

from __future__ import annotations

import json

import numpy as np
import pytest

from schuler.alignment.table_north import load_readings, robust_mean, table_north
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError

ANGLES = {"7-1": 120, "7-2": 240, "7-3": 0, "7-4": 0, "7-5": 120, "7-6": 240, "7-7": 180,
          "7-8": 180, "6-1": 0, "6-2": 180, "6-3": 0}  # fmt: skip


def turn(rng, angles, north, sigma=0.5, n=200, lat=35.0):
    wave = EARTH_RATE * np.cos(lat * DEG) * np.cos((np.array(angles) - north) * DEG)
    return [w + 0.3 * DEG_PER_HOUR + sigma * DEG_PER_HOUR * rng.normal(size=n) for w in wave]


@pytest.mark.parametrize("lat", [None, 35.0 * DEG])
def test_normalised_errors(lat):
    """400 runs: the variance of the normalised error of north inside its 99 % band."""
    angles = [0, 90, 180, 270, 0, 90, 180, 270]
    z = []
    for seed in range(400):
        rng = np.random.default_rng(seed)
        north = rng.uniform(-180, 180)
        found = table_north(angles, turn(rng, angles, north), latitude=lat)
        z.append(((found.north_deg - north + 180) % 360 - 180) / found.sigma_deg)
    # Sigma is the larger of scatter and noise, so a little too large.
    assert 0.6 < np.mean(np.square(z)) < 1.2


@pytest.mark.parametrize("lat", [None, 35.0 * DEG])
def test_good_readings_are_consistent(lat):
    """400 runs at a false-alarm rate of 3e-4: more than two have a probability of 3e-4."""
    alarms = 0
    for seed in range(400):
        rng = np.random.default_rng(seed)
        angles = [0, 120, 240] if seed % 2 else [0, 90, 180, 270]
        alarms += not table_north(angles, turn(rng, angles, 20.0), latitude=lat).consistent
    assert alarms <= 2


@pytest.mark.parametrize(
    ("factor", "lat", "words"),
    [
        (3600.0, 35.0, "values an hour read as values a second"),
        (1.0 / 3600.0, 35.0, "values a second read as values an hour"),
        (np.pi / 180.0, 35.0, "radians read as degrees"),
        (1.0, 55.0, "latitude 55 deg"),
        (1.3, None, "check the unit"),
    ],
)
def test_an_amplitude_that_cannot_be(rng, factor, lat, words):
    angles = [0, 120, 240, 180]
    readings = [factor * r for r in turn(rng, angles, 20.0, sigma=0.3)]
    found = table_north(angles, readings, latitude=None if lat is None else lat * DEG)
    assert not found.consistent
    assert words in found.contradictions[0]
    assert str(found).startswith("INCONSISTENT: ")
    assert found.to_dict()["contradictions"] == list(found.contradictions)


def test_outliers_do_no_harm():
    rng = np.random.default_rng(1)
    x = rng.normal(size=500)
    clean, _, _ = robust_mean(x)
    x[::20] += 50.0
    mean, error, left = robust_mean(x)
    assert abs(mean - clean) < 3 * error
    assert left >= 25


@pytest.mark.realdata
def test_real_turntable(data_dir):
    folder = data_dir / "fog_singleaxis_turntable"
    read = {k: load_readings(folder / f"{k}.txt", DEG_PER_HOUR) for k in ANGLES}

    def north(names):
        return table_north([ANGLES[k] for k in names], [read[k] for k in names])

    whole = north(list(ANGLES))
    assert whole.north_deg == pytest.approx(-157.57, abs=0.1)
    one, two = north(["7-3", "7-1", "7-2", "7-7"]), north(["7-4", "7-5", "7-6", "7-8"])
    assert abs(one.north_deg - two.north_deg) < 1.0
    assert abs(one.north_deg - two.north_deg) < 3 * np.hypot(one.sigma_deg, two.sigma_deg)
    assert [len(read[k]) for k in ("7-1", "6-3")] == [100, 1800]


@pytest.mark.parametrize(
    ("angles", "text"),
    [([0, 180], "do not fix"), ([0, 90, 180, 45], "one angle a dwell"),
     ([0, np.nan, 180], "finite")],
)  # fmt: skip
def test_bad_input(angles, text):
    readings = [np.ones(10)] * min(len(angles), 3)
    with pytest.raises(InputError, match=text):
        table_north(angles, readings)


def test_command(tmp_path, capsys):
    from schuler.cli import main

    rng = np.random.default_rng(2)
    names = []
    for k, x in enumerate(turn(rng, [0, 120, 240], 40.0)):
        names.append(str(tmp_path / f"{k}.txt"))
        rows = "\n".join(f"{i}, {v / DEG_PER_HOUR}" for i, v in enumerate(x))
        (tmp_path / f"{k}.txt").write_bytes(b"\xca\xfd head\n" + rows.encode())
    report = tmp_path / "north.html"
    with pytest.raises(SystemExit) as done:
        main(["north", *names, "--angles", "0,120,240", "--json", "-", "--report", str(report)])
    assert done.value.code == 0
    data = json.loads(capsys.readouterr().out)
    assert data["north_deg"] == pytest.approx(40.0, abs=4 * data["sigma_deg"] + 0.5)
    assert "North by an indexing table" in report.read_text()
    with pytest.raises(SystemExit) as done:
        main(["north", *names, "--angles", "0,120"])
    assert done.value.code == 2
    assert "one angle" in capsys.readouterr().err
