"""Gyros of an array compared by parity: false alarms as stated, faults named, four cannot tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import schuler as sc
from schuler.constants import DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError
from schuler.sensors.array_check import ArrayCheck, ArrayVerdict
from schuler.sensors.named_arrays import named_array

W = EARTH_RATE * np.array([-0.56, 0.36, 0.744])
#: 0.003 deg/sqrt(h) at 25 Hz, rad/s
NOISE = np.radians(0.003 / 60) * 5


def verdict(
    name: str, rng: np.random.Generator, fault: float = 0.0, *, sensor: int = 2, begin: int = 0,
    bias: float | None = None, n: int = 3000, pieces: int = 1,
) -> ArrayVerdict:  # fmt: skip
    """Return the verdict on a simulated array, whose gyro has a fault (deg/h) from a row on."""
    array = named_array(name)
    check = ArrayCheck(array, bias)
    values = array.h @ W + NOISE * rng.standard_normal((n, len(array)))
    if bias is not None:
        values += bias * rng.standard_normal(len(array))
    values[begin:, sensor] += fault * DEG_PER_HOUR
    for part in np.array_split(values, pieces):
        check.push(part)
    return check.verdict()


@pytest.mark.parametrize("name", ["dodecahedron", "symmetric4", "cone5", "triad-plus-one"])
@pytest.mark.parametrize("bias", [None, 0.01 * DEG_PER_HOUR, 1.0 * DEG_PER_HOUR])
def test_false_alarms_are_as_stated(name: str, bias: float | None) -> None:
    """400 seeded runs at 1e-3; more than five of them have a chance of 1e-5."""
    rng = np.random.default_rng(1)
    runs = [verdict(name, rng, bias=bias, n=1500) for _ in range(400)]
    alarms = sum(bool(v.notes or v.contradictions) for v in runs)
    assert alarms <= binom.isf(1e-5, 400, 1e-3)


@pytest.mark.parametrize("name", ["dodecahedron", "cone5", "cone6"])
@pytest.mark.parametrize("fault", [-20.0, 5.0, 2000.0])
@pytest.mark.parametrize("begin", [0, 2500])
def test_a_faulty_gyro_is_named(name: str, fault: float, begin: int) -> None:
    rng = np.random.default_rng(2)
    for sensor in range(len(named_array(name))):
        found = verdict(name, rng, fault, sensor=sensor, begin=begin)
        assert sensor not in found.working
        assert len(found.working) == len(named_array(name)) - 1
        assert found.notes[0].startswith(f"gyro {sensor + 1} was left out: it differs")
        assert found.contradictions == ()


@pytest.mark.parametrize("name", ["symmetric4", "tetrahedron", "skewed4", "triad-plus-one"])
def test_of_four_one_is_wrong_and_which_cannot_be_told(name: str) -> None:
    rng = np.random.default_rng(3)
    sensor = 2
    found = verdict(name, rng, 20.0, sensor=sensor)
    assert found.working == (0, 1, 2, 3)
    (text,) = found.contradictions
    assert text.startswith("the 4 gyros disagree by ")
    assert "one is wrong, and which cannot be told, or their biases are of that size" in text


def test_two_faults_are_not_blamed_on_one() -> None:
    rng = np.random.default_rng(4)
    array = named_array("dodecahedron")
    check = ArrayCheck(array)
    values = array.h @ W + NOISE * rng.standard_normal((3000, 6))
    values[:, 1] += 20 * DEG_PER_HOUR
    values[:, 4] -= 15 * DEG_PER_HOUR
    check.push(values)
    found = check.verdict()
    assert len(found.contradictions) == 1
    assert "more than one is wrong" in found.contradictions[0]


def test_a_twin_is_not_blamed_in_place_of_the_other() -> None:
    from schuler.sensors.array import SensorArray

    rng = np.random.default_rng(5)
    array = SensorArray(np.vstack([np.eye(3), [[0, 0, 1.0], [1, 1, 0.0]]]), "twins")
    check = ArrayCheck(array)
    values = array.h @ W + NOISE * rng.standard_normal((3000, 5))
    values[:, 2] += 20 * DEG_PER_HOUR
    check.push(values)
    assert check.verdict().working == (0, 1, 2, 3, 4)
    assert len(check.verdict().contradictions) == 1


def test_biases_within_the_specification_are_no_fault() -> None:
    rng = np.random.default_rng(6)
    one = 1.0 * DEG_PER_HOUR
    assert verdict("symmetric4", rng, 1.0, bias=one).contradictions == ()
    assert verdict("symmetric4", rng, 1.0).contradictions


def test_the_pieces_do_not_matter() -> None:
    whole = verdict("dodecahedron", np.random.default_rng(7), 3.0, n=400_000)
    parts = verdict("dodecahedron", np.random.default_rng(7), 3.0, n=400_000, pieces=37)
    assert whole == parts


def test_pieces_of_single_rows_are_taken() -> None:
    """A first piece of less than a group's rows fills no group."""
    one, whole = (ArrayCheck(named_array("cone5")) for _ in range(2))
    rates = np.random.default_rng(3).standard_normal((200, 5))
    for row in rates:
        one.push(row[None])
    whole.push(rates)
    assert one.verdict() == whole.verdict()


def test_a_short_record_says_nothing_and_a_bad_rate_is_refused() -> None:
    assert verdict("cone5", np.random.default_rng(8), 20.0, n=100).notes == ()
    with pytest.raises(InputError, match="false-alarm rate"):
        ArrayCheck(named_array("cone5"), false_alarm=0.9)


@pytest.mark.parametrize("units", ["rates", "increments"])
def test_a_record_is_fused_without_the_faulty_gyro(tmp_path: Path, units: str) -> None:
    rng = np.random.default_rng(9)
    t = 0.04 * np.arange(1, 3001)
    array = named_array("dodecahedron")
    gyros = array.h @ W + NOISE * rng.standard_normal((3000, 6))
    gyros[:, 2] += 20 * DEG_PER_HOUR
    force = np.tile([0.0, 0.0, 9.80905], (3000, 1))
    scale = 1.0 if units == "rates" else 0.04
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([t, scale * gyros, scale * force]), "%.15g", ",", comments="",
               header="time," + ",".join(f"g{k}" for k in range(1, 7)) + ",ax,ay,az")  # fmt: skip
    kind = {"mean_rates": True} if units == "rates" else {"gyro": "rad", "accel": "m/s"}
    source = sc.open_source(path, array="dodecahedron", **kind)
    mean = source.read().gyro.mean(axis=0)
    assert np.linalg.norm(mean - W) < 0.1 * DEG_PER_HOUR
    assert source.notes[0].startswith("gyro 3 was left out: it differs from the other 5 by +20")
    assert source.contradictions == []
    # A stretch is judged by itself, and nothing is said twice.
    part = source.read(start="+10s", stop="+60s")
    assert np.linalg.norm(part.gyro.mean(axis=0) - W) < 0.2 * DEG_PER_HOUR
    four = np.column_stack([t, scale * gyros[:, :4], scale * force])
    np.savetxt(path, four, "%.15g", ",", comments="", header="time,g1,g2,g3,g4,ax,ay,az")
    directions = named_array("dodecahedron").h[:4].tolist()
    (tmp_path / "four.toml").write_text(f"directions = {directions}\n", encoding="utf-8")
    source = sc.open_source(path, array=str(tmp_path / "four.toml"), **kind)
    source.read()
    assert len(source.contradictions) == 1
