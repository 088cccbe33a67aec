"""Turntable tests, systematic calibration, and the calibration's file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import schuler as sc
from schuler.calibration import (
    Calibration,
    calibrate_systematic,
    combine,
    rate_test,
    scheme,
    static_test,
)
from schuler.calibration.systematic import NAMES
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.errors import InputError
from schuler.motion.turntable import Dwell, Turn, Turntable
from schuler.simulation import simulate
from tests.conftest import chi_square_band

G = 9.8
MODEL = np.array([[1.001, 2e-4, -3e-4], [1e-4, 0.999, 5e-4], [-2e-4, 3e-4, 1.002]])
BIAS = np.array([1e-3, -2e-3, 5e-4])


@pytest.mark.parametrize("positions", [6, 12, 18, 24])
def test_each_scheme_gives_bias_and_matrix_with_honest_sigma(positions):
    """100 runs, 12 numbers, known noise; false alarm 1e-3."""
    up = scheme(positions)
    assert up.shape == (positions, 3)
    np.testing.assert_allclose(np.linalg.norm(up, axis=1), 1.0)
    rng = np.random.default_rng(positions)
    nees = 0.0
    for _ in range(100):
        y = G * up @ MODEL.T + BIAS + 1e-3 * rng.normal(size=up.shape)
        fit = static_test(y, G * up, 1e-3)
        error = np.r_[fit.bias - BIAS, (fit.model - MODEL).ravel()]
        nees += error @ np.linalg.solve(fit.covariance, error)
    low, high = chi_square_band(1200, 1e-3)
    assert low < nees < high
    np.testing.assert_allclose(fit.matrix @ fit.model, np.eye(3), atol=1e-12)


def test_a_rate_test_gives_scale_and_axes(rng):
    rates = np.tile([-1.0, -0.5, 0.5, 1.0], 3)
    axes = np.repeat(np.eye(3), 4, axis=0)
    earth = np.full(12, 5e-5)
    y = (rates + earth)[:, None] * axes @ MODEL.T + 1e-5 + 1e-7 * rng.normal(size=(12, 3))
    fit = rate_test(y, rates, axes, earth)
    np.testing.assert_allclose(fit.model, MODEL, atol=1e-6)
    np.testing.assert_allclose(fit.bias, 1e-5, atol=2e-7)
    both = combine(fit, static_test(G * scheme(18) @ MODEL.T, G * scheme(18)))
    assert both.sigma["gyro_matrix"].shape == (3, 3)


def sequence():
    steps = []
    for axis, sign in (
        ("psi", 1), ("theta", 1), ("gamma", 1), ("psi", 1), ("gamma", 1), ("theta", -1),
        ("gamma", -1), ("psi", -1), ("theta", 1), ("gamma", 1), ("psi", -1), ("theta", -1),
    ):  # fmt: skip
        for _ in range(2):
            steps += [Dwell(15.0), Turn(axis, 90.0 * sign, 15.0, 20.0)]
    return Turntable((*steps, Dwell(20.0)))


@pytest.mark.slow
def test_systematic_calibration_finds_all_terms_from_velocity_alone():
    """One simulation, six sets of errors; 21 numbers, normalised; false alarm 1e-3 but one side.

    A navigator of 0.002 deg/sqrt(h) and 5 ug/sqrt(Hz); the sequence turns each axis up and down.
    """
    site, turntable = sc.Site(34.0, 108.0, 380.0), sequence()
    spec = sc.ImuSpec.from_dict(
        {"gyro": {"angle_random_walk": "0.002 deg/sqrt(h)"},
         "accelerometer": {"velocity_random_walk": "5 ug/sqrt(Hz)"}}
    )  # fmt: skip
    made = simulate(turntable, site, np.floor(turntable.period), 50.0, spec,
                    np.random.default_rng(4))  # fmt: skip
    r, start = made.record, made.truth.quat_nb[0]
    free = [k for k in range(24) if NAMES[k] not in
            ("accelerometer yx", "accelerometer zx", "accelerometer zy")]  # fmt: skip
    for seed in range(3):
        rng = np.random.default_rng(seed)
        true = np.zeros(24)
        true[:3] = rng.normal(0, 0.3 * DEG_PER_HOUR, 3)
        true[12:15] = rng.normal(0, 300 * MICRO_G, 3)
        true[3:12], true[15:] = rng.normal(0, 3e-4, 9), rng.normal(0, 3e-4, 9)
        true[[18, 21, 22]] = 0.0
        gyro, accel = (np.eye(3) + true[k : k + 9].reshape(3, 3) for k in (3, 15))
        bad = replace(
            r,
            dtheta=r.dtheta @ gyro.T + r.dt[:, None] * true[:3],
            dvel=r.dvel @ accel.T + r.dt[:, None] * true[12:15],
        )
        fit = calibrate_systematic(bad, site, start, gyro_noise=0.002 * DEG / 60,
                                   accel_noise=5 * MICRO_G)  # fmt: skip
        # The filter's matrix is that of the output, to first order: 3e-4 squared is 1e-7.
        error = (fit.value - true)[free]
        cov = fit.covariance[np.ix_(free, free)]
        nees = error @ np.linalg.solve(cov + np.diag(np.full(len(free), 1e-14)), error)
        assert nees < chi_square_band(len(free), 2e-3)[1]
        assert not fit.unseen
        # At rest the calibrated force is gravity: to 10 ug, where it was wrong by hundreds.
        for begin in (0.0, 25.0, 50.0):
            still = fit.calibration.apply(bad.between(begin, begin + 10.0))
            force = np.linalg.norm(still.dvel.sum(axis=0)) / still.dt.sum()
            assert abs(force - site.gravity) < 10 * MICRO_G


def test_systematic_calibration_says_what_a_short_sequence_does_not_show():
    site = sc.Site(34.0)
    still = Turntable((Dwell(20.0), Turn("psi", 90.0, 15.0, 20.0), Dwell(20.0)))
    record = simulate(still, site, 40.0, 50.0).record
    fit = calibrate_systematic(record, site, [1.0, 0.0, 0.0, 0.0])
    assert "gyro yy" in fit.unseen
    # A level gyro's bias tilts the platform more and more.
    assert "gyro bias x" not in fit.unseen


def test_a_file_comes_back_as_it_was(tmp_path, rng):
    c = Calibration(
        rng.normal(size=3), rng.normal(size=3), MODEL, MODEL.T, name="mine",
        sigma={"gyro_bias": np.ones(3), "accel_matrix": np.full((3, 3), 0.1)},
    )  # fmt: skip
    c.to_toml(tmp_path / "c.toml")
    back = Calibration.from_toml(tmp_path / "c.toml")
    for key in ("gyro_bias", "accel_bias", "gyro_matrix", "accel_matrix"):
        np.testing.assert_array_equal(getattr(back, key), getattr(c, key))
    assert back.name == "mine"
    np.testing.assert_array_equal(back.sigma["accel_matrix"], c.sigma["accel_matrix"])


def test_applying_undoes_the_instrument(rng):
    from schuler.record import ImuRecord

    t = 0.01 * np.arange(1, 101)
    w, f = rng.normal(size=(100, 3)), rng.normal(size=(100, 3))
    out = ImuRecord(t, np.full(100, 0.01), 0.01 * (w @ MODEL.T + BIAS), 0.01 * (f @ MODEL + 0.1))
    c = Calibration(BIAS, np.full(3, 0.1), np.linalg.inv(MODEL), np.linalg.inv(MODEL.T))
    back = c.apply(out)
    np.testing.assert_allclose(back.gyro, w, atol=1e-12)
    np.testing.assert_allclose(back.accel, f, atol=1e-12)
    pieces = list(c.each(out.chunks(7)))
    np.testing.assert_array_equal(np.vstack([p.dvel for p in pieces]), back.dvel)
    with pytest.raises(InputError, match="for raw counts"):
        Calibration(input="counts").apply(out)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "schema ="),
        ("not toml [", "not valid TOML"),
        ('schema = "schuler.calibration/1"\n[gyro]\nbias = [1, 2]', "gyro_bias must be 3"),
        ('schema = "schuler.calibration/1"\n[gyro]\nbias = "a"', "must be numbers"),
        ('schema = "schuler.calibration/1"\n[accel]\nscale = [1]', "unknown key 'scale'"),
        ('schema = "schuler.calibration/1"\ninput = "volts"', "SI or counts"),
        ('schema = "schuler.calibration/1"\n[accel]\nmatrix = [[1,0,0],[1,0,0],[0,0,1]]',
         "no inverse"),
        ('schema = "schuler.calibration/1"\n[accel]\nbias = [nan, 0, 0]', "finite"),
    ],
)  # fmt: skip
def test_a_bad_file_is_one_sentence(tmp_path, text, says):
    path = tmp_path / "c.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        Calibration.from_toml(path)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: scheme(7), "6, 12, 18 or 24"),
        (lambda: static_test(np.zeros((6, 3)), np.zeros((5, 3))), "one shape"),
        (lambda: static_test(np.zeros((6, 3)), np.tile([0, 0, G], (6, 1))), "is not observable"),
        (lambda: static_test(np.zeros((4, 3)), np.eye(4)[:, :3]), "five positions"),
        (lambda: static_test(np.full((6, 3), np.nan), scheme(6)), "finite"),
        (lambda: rate_test(np.zeros((6, 3)), np.ones(6), np.zeros((6, 3))), "must not be zero"),
        (lambda: Calibration.from_toml("nowhere.toml"), "cannot be read"),
    ],
)
def test_bad_input_is_one_sentence(call, text):
    with pytest.raises(InputError, match=text):
        call()
