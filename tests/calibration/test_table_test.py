"""Tests on a turntable from records: positions and turns, found and given."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import schuler as sc
from schuler.calibration import (
    Calibration,
    Position,
    RateTurn,
    calibrate_positions,
    calibrate_rates,
    positions_from_toml,
    turns_from_toml,
)
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.errors import InputError
from schuler.motion.turntable import Dwell, Turn, Turntable
from schuler.simulation import simulate
from tests.test_docs import schema

SITE = sc.Site(48.0, 11.0, 500.0)
ACCEL_BIAS = np.array([300.0, -200.0, 150.0]) * MICRO_G
ACCEL = np.array([[1.0002, 1e-4, 0.0], [-5e-5, 0.9999, 2e-4], [1e-4, 0.0, 1.0003]])
GYRO_BIAS = np.array([20.0, -10.0, 5.0]) * DEG_PER_HOUR
GYRO = np.array([[1.001, 2e-4, -1e-4], [0.0, 0.999, 1e-4], [1e-4, 0.0, 1.0005]])
SPEC = sc.ImuSpec.from_dict({
    "gyro": {"angle_random_walk": "0.01 deg/sqrt(h)"},
    "accelerometer": {"velocity_random_walk": "20 ug/sqrt(Hz)"},
})  # fmt: skip
#: turns that put each axis up and down in turn, and the attitudes (psi, theta, gamma) reached
SIX = [("gamma", 90), ("gamma", 90), ("gamma", 90), ("gamma", 90), ("theta", 90), ("theta", -180)]


def off(record):
    """Put the instrument's errors in."""
    span = record.dt[:, None]
    return replace(
        record, dtheta=record.dtheta @ GYRO.T + span * GYRO_BIAS,
        dvel=record.dvel @ ACCEL.T + span * ACCEL_BIAS,
    )  # fmt: skip


def table(turns, seconds=12.0):
    steps, attitudes, at = [Dwell(seconds)], [(0.0, 0.0, 0.0)], {"psi": 0, "theta": 0, "gamma": 0}
    for axis, angle in turns:
        steps += [Turn(axis, float(angle), 30.0, 60.0), Dwell(seconds)]
        at[axis] += angle
        attitudes.append((float(at["psi"]), float(at["theta"]), float(at["gamma"])))
    return Turntable(tuple(steps)), attitudes


@pytest.fixture(scope="module")
def six():
    """Seven dwells: the first and the fifth have z up."""
    motion, attitudes = table(SIX)
    made = simulate(motion, SITE, np.floor(motion.period), 100.0, SPEC, np.random.default_rng(1))
    return off(made.record), attitudes


def check_accelerometers(found, sigmas=5.0):
    c = found.calibration
    assert np.abs((c.accel_bias - ACCEL_BIAS) / c.sigma["accel_bias"]).max() < sigmas
    error = c.accel_matrix - np.linalg.inv(ACCEL)
    assert np.abs(error / c.sigma["accel_matrix"]).max() < sigmas
    assert np.abs(error).max() < 5e-5


def dwells_of(record, attitudes):
    """Cut the seven dwells out, as records of their own."""
    at, out = 1.0, []
    for k in range(len(attitudes)):
        out.append(record.between(at, at + 10.0))
        turn = Turn("gamma", float(SIX[k][1]) if k < len(SIX) else 90.0, 30.0, 60.0).time
        at += 12.0 + turn
    return out


def test_six_files_in_any_order_are_told_from_the_force(six):
    parts = dwells_of(*six)
    # The fifth dwell repeats the first.
    found = calibrate_positions([parts[k] for k in (5, 2, 0, 6, 1, 3)], SITE.gravity)
    assert found.found == ("accel_bias", "accel_matrix")
    check_accelerometers(found)


@pytest.mark.parametrize("times", [False, True])
def test_a_sequence_gives_all_that_it_shows(six, times):
    record, attitudes = six
    positions = [Position(a) for a in attitudes]
    if times:
        at, step = 1.0, 12.0
        positions = []
        for k, a in enumerate(attitudes):
            turn = Turn("gamma", float(SIX[k][1]) if k < len(SIX) else 90.0, 30.0, 60.0).time
            positions.append(Position(a, at, at + step - 2.0))
            at += step + turn
    found = calibrate_positions([record], SITE.gravity, positions=positions, site=SITE)
    assert found.found == ("accel_bias", "accel_matrix", "gyro_bias")
    check_accelerometers(found)
    # The Earth's rate leaves the gyros' unknown scale of 0.1 %: far below the noise here.
    c = found.calibration
    assert np.abs((c.gyro_bias - GYRO_BIAS) / c.sigma["gyro_bias"]).max() < 5.0
    schema("calibrate-table").validate(json.loads(json.dumps(found.to_dict(), allow_nan=False)))
    assert len(found.to_pandas()) == 7
    assert "7 dwells" in str(found)


def turned(rates, axes):
    """A record of constant rates about body axes, a dwell before each, without noise."""
    rng = np.random.default_rng(2)
    earth = 7.292115e-5 * np.sin(SITE.latitude)
    rows = []
    for rate, axis in zip(rates, axes, strict=True):
        rows += [np.zeros((300, 3))]
        n = round(360.0 / abs(rate) * 100.0 * 1.3)
        rows += [np.tile((rate * DEG + earth) * np.asarray(axis), (n, 1))]
    rows += [np.zeros((300, 3))]
    w = np.vstack(rows)
    n = len(w)
    r = sc.ImuRecord(0.01 * np.arange(1, n + 1), np.full(n, 0.01), 0.01 * w,
                     np.tile([0.0, 0.0, 0.098], (n, 1)))  # fmt: skip
    return off(replace(r, dtheta=r.dtheta + 1e-7 * rng.standard_normal((n, 3))))


RATES = [60.0, -60.0] * 3
AXES = [axis for axis in np.eye(3) for _ in range(2)]


@pytest.mark.parametrize("given", [False, True])
def test_a_rate_test_finds_bias_scale_and_axes(given):
    record = turned(RATES, AXES)
    turns = []
    for k, (rate, axis) in enumerate(zip(RATES, AXES, strict=True)):
        begin = 3.0 + k * (7.8 + 3.0)
        times = (begin + 0.5, begin + 7.5) if given else (None, None)
        turns.append(RateTurn(tuple(axis), rate * DEG, (0.0, 0.0, 1.0), *times))
    found = calibrate_rates(record, turns, SITE)
    c = found.calibration
    np.testing.assert_allclose(c.gyro_matrix, np.linalg.inv(GYRO), atol=2e-5)
    np.testing.assert_allclose(c.gyro_bias, GYRO_BIAS, atol=2.0 * DEG_PER_HOUR)
    schema("calibrate-table").validate(json.loads(json.dumps(found.to_dict(), allow_nan=False)))


def test_one_file_holds_both_tests(six, tmp_path):
    record, attitudes = six
    turns = [RateTurn(tuple(a), r * DEG) for r, a in zip(RATES, AXES, strict=True)]
    rates = calibrate_rates(turned(RATES, AXES), turns, SITE).calibration
    both = calibrate_positions([record], SITE.gravity, positions=[Position(a) for a in attitudes],
                               site=SITE, base=rates)  # fmt: skip
    np.testing.assert_array_equal(both.calibration.gyro_matrix, rates.gyro_matrix)
    both.calibration.to_toml(tmp_path / "both.toml")
    back = Calibration.from_toml(tmp_path / "both.toml")
    fixed = back.apply(record)
    force = fixed.between(1.0, 11.0).accel.mean(axis=0)
    np.testing.assert_allclose(force, [0, 0, SITE.gravity], atol=5e-4)


def test_wrong_sequences_are_one_sentence(six):
    record, attitudes = six
    positions = [Position(a) for a in attitudes]
    for given, said in (
        (positions[::-1], "deg from where the sequence"), (positions[:3], "found 7 dwells"),
        (6, "found 7 dwells"), ([Position(a, 1.0, 1.01) for a in attitudes], "samples"),
        ([Position(attitudes[0], 1.0, 5.0), *positions[1:]], "start and stop of each"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            calibrate_positions([record], SITE.gravity, positions=given)
    level = [record.between(1.0, 11.0)] * 6
    with pytest.raises(InputError, match="have up along"):
        calibrate_positions(level, SITE.gravity)
    turns = [RateTurn((0.0, 0.0, 1.0), 1.0)]
    with pytest.raises(InputError, match="stretches of constant rate"):
        calibrate_rates(turned(RATES, AXES), turns, SITE)


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (positions_from_toml, "x = 1", "unknown key"),
        (positions_from_toml, "", "expected tables"),
        (positions_from_toml, "[[position]]\nattitude = [1]", "psi, theta, gamma"),
        (positions_from_toml, "[[position]]\nattitude = [1,2,3]\nstart = 3", "start and stop"),
        (turns_from_toml, "[[turn]]\naxis = 'q'\nrate = '1 deg/s'", "three numbers"),
        (turns_from_toml, "[[turn]]\naxis = 'x'\nrate = '0 deg/s'", "rate of zero"),
        (turns_from_toml, "[[turn]]\naxis = [0,0,0]\nrate = '1 deg/s'", "not be zero"),
        (turns_from_toml, "[[turn]]\naxis = 'x'\nrate = '1 m'", "rate"),
    ],
)
def test_a_bad_sequence_s_file_is_one_sentence(tmp_path, read, text, said):
    path = tmp_path / "s.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read(path)
