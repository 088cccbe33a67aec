"""Hand-held poses: simulated ones with a known answer, a bad one, and the real record."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from schuler.calibration import calibrate_poses, find_rests
from schuler.errors import InputError
from tests.conftest import chi_square_band

G = 9.80665
BIAS = np.array([0.1, -0.2, 0.05])
MATRIX = np.array([[1.01, 0.003, -0.002], [0.0, 0.99, 0.004], [0.0, 0.0, 1.02]])
GYRO = np.array([[1.02, 0.01, -0.005], [-0.01, 0.98, 0.008], [0.003, -0.006, 1.01]])


def by_hand(rng, poses=24, rate=100.0, noise=0.02, first=12.0, hold=3.0, turns=None):
    """Return time, force, rate of an instrument turned from pose to pose (at random, or so)."""
    t, attitude, w = [], [], []
    q = Rotation.identity()
    for k in range(poses):
        rest = first if k == 0 else hold
        n = round(rest * rate)
        attitude += [q] * n
        w += [np.zeros(3)] * n
        axis = rng.normal(size=3)
        axis *= rng.uniform(1.2, 2.6) / np.linalg.norm(axis)
        if turns is not None:
            axis = np.array(turns[k], float)
        n = round(1.5 * rate)
        # A raised cosine: rest at both ends.
        rates = 1.0 - np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)
        w += [axis * r / 1.5 for r in rates]
        way = np.cumsum(rates) / n
        attitude += [q * Rotation.from_rotvec(axis * a) for a in way]
        q = q * Rotation.from_rotvec(axis * way[-1])
    t = np.arange(len(w)) / rate
    up = Rotation.concatenate(attitude).inv().apply([0.0, 0.0, G])
    w = np.array(w)
    f = up @ np.linalg.inv(MATRIX).T + BIAS + noise * rng.normal(size=up.shape)
    moving = np.linalg.norm(w, axis=1) > 0
    f[moving] += 0.5 * rng.normal(size=(int(moving.sum()), 3))
    rate_out = w @ np.linalg.inv(GYRO).T + 0.01 + 1e-4 * rng.normal(size=w.shape)
    return t, f, rate_out


def test_known_coefficients_come_back_and_sigma_is_honest():
    """30 seeded runs: nine numbers' normalised errors; false alarm 1e-3."""
    nees, runs = 0.0, 30
    for seed in range(runs):
        t, f, _ = by_hand(np.random.default_rng(seed))
        fit = calibrate_poses(t, f, gravity=G)
        upper = np.triu_indices(3)
        error = np.r_[fit.calibration.accel_bias - BIAS,
                      fit.calibration.accel_matrix[upper] - MATRIX[upper]]  # fmt: skip
        assert len(fit.dwells) == 24
        nees += error @ np.linalg.solve(fit.accel_covariance, error)
    # The covariance takes its scale from 15 degrees of freedom: E F(9, 15) = 15/13.
    low, high = chi_square_band(9 * runs, 1e-3)
    assert low < nees / (15 / 13) < 1.15 * high


def test_gyros_come_back_from_the_turns(rng):
    t, f, w = by_hand(rng)
    fit = calibrate_poses(t, f, w, gravity=G)
    sigma = fit.calibration.sigma["gyro_matrix"]
    np.testing.assert_allclose(fit.calibration.gyro_bias, 0.01, atol=1e-4)
    assert np.abs((fit.calibration.gyro_matrix - GYRO) / sigma).max() < 5.0
    assert sigma.max() < 5e-3
    assert np.sqrt(np.mean(fit.turn_error**2)) < 0.1 * np.sqrt(np.mean(fit.turn_error_before**2))


def test_a_bad_pose_is_left_out_and_named(rng):
    t, f, _ = by_hand(rng)
    clean = calibrate_poses(t, f, gravity=G)
    a, b = clean.dwells[7]
    f[a:b] += 0.15
    fit = calibrate_poses(t, f, gravity=G)
    assert not fit.used[7]
    assert fit.used.sum() >= 22
    assert any("pose 8 was left out" in text for text in fit.unseen)
    sigma = np.sqrt(np.diag(fit.accel_covariance))[:3]
    assert np.abs((fit.calibration.accel_bias - BIAS) / sigma).max() < 5.0


def test_poses_too_much_alike_are_refused(rng):
    t, f, _ = by_hand(rng)
    flat = f.copy()
    flat[:, 2] = G + 0.02 * rng.normal(size=len(f))
    with pytest.raises(InputError, match="hardly turn the z accelerometer"):
        calibrate_poses(t, flat, gravity=G, dwells=calibrate_poses(t, f, gravity=G).dwells)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda t, f: (t[:150], f[:150]), "too short"),
        (lambda t, f: (t, np.where(np.arange(len(t))[:, None] == 70, np.nan, f)), "row 71"),
        (lambda t, f: (t[::-1], f), "does not come after"),
        (lambda t, f: (t, f[:, :2]), "expected shape"),
        (lambda t, f: (t[:2500], f[:2500]), "six poses or more"),
    ],
)
def test_bad_input_is_one_sentence(change, text, rng):
    t, f, _ = by_hand(rng)
    with pytest.raises(InputError, match=text):
        calibrate_poses(*change(t, f), gravity=G)


@pytest.mark.realdata
def test_the_real_record_of_38_poses(data_dir):
    folder = data_dir / "imu_tk_xsens_multipos"
    a, g = (np.loadtxt(folder / f"xsens_{name}.mat") for name in ("acc", "gyro"))
    fit = calibrate_poses(a[:, 0], a[:, 1:], g[:, 1:], gravity=9.8066, gyro_scale=1 / 6258,
                          initial=50.0, counts=True)  # fmt: skip
    assert len(fit.dwells) == 38
    assert fit.used.all()
    assert fit.rms <= 1.05e-3
    # The independent fit, to its printed digits.
    np.testing.assert_allclose(fit.calibration.accel_bias, [33123.7, 33275.1, 32364.5], atol=0.2)
    np.testing.assert_allclose(np.linalg.norm(fit.calibration.accel_matrix, axis=0),
                               [2.4104e-3, 2.4243e-3, 2.4092e-3], atol=1e-6)  # fmt: skip
    np.testing.assert_allclose(fit.calibration.gyro_bias, [32777.2, 32459.8, 32511.9], atol=1.0)
    assert np.rad2deg(np.sqrt(np.mean(fit.turn_error**2))) < 1.0
    assert fit.turn_error.size == 37


def test_dwells_do_not_depend_on_the_unit(rng):
    t, f, _ = by_hand(rng)
    np.testing.assert_array_equal(find_rests(t, f), find_rests(t, 1000.0 * f + 3e4))


def test_a_steady_turn_about_the_vertical_is_no_pose(rng):
    n = 6000
    t = 0.01 * np.arange(n)
    f = np.tile([0.0, 0.0, G], (n, 1)) + 0.02 * rng.normal(size=(n, 3))
    w = 1e-3 * rng.normal(size=(n, 3))
    w[2000:4000, 2] += 0.3
    assert len(find_rests(t, f)) == 1
    found = find_rests(t, f, w)
    assert len(found) == 2
    assert found[0, 1] <= 2000
    assert found[1, 0] >= 4000


def six_positions():
    """Return the rotations (rad, body) that lay an instrument on each of its six faces."""
    q = np.pi / 2
    return [(q, 0, 0), (q, 0, 0), (q, 0, 0), (0, 0, q), (0, 0, 2 * q), (0.0, 0.0, 0.01)]


def test_six_positions_show_bias_and_scale():
    """100 seeded runs of six positions: bias and scale within their sigma; false alarm 1e-3."""
    diagonal = np.diag([0, 0, 0])
    nees, runs, free = 0.0, 100, np.array([0, 1, 2, 3, 6, 8])
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        bias, scale = 0.2 * rng.normal(size=3), 1.0 + 0.02 * rng.normal(size=3)
        ups = np.vstack([np.eye(3), -np.eye(3)])
        means = (G * ups) / scale + bias
        n = 200
        f = np.repeat(means, n, axis=0) + 0.02 * rng.normal(size=(6 * n, 3))
        dwells = np.array([[k * n, (k + 1) * n] for k in range(6)])
        fit = calibrate_poses(0.01 * np.arange(6 * n), f, gravity=G, dwells=dwells)
        error = np.r_[fit.calibration.accel_bias - bias,
                      np.diag(fit.calibration.accel_matrix) - scale]  # fmt: skip
        nees += error @ np.linalg.solve(fit.accel_covariance[np.ix_(free, free)], error)
        np.testing.assert_array_equal(np.triu(fit.calibration.accel_matrix, 1), diagonal)
        assert any("10 or more show the axes" in text for text in fit.unseen)
    low, high = chi_square_band(6 * runs, 1e-3)
    assert low < nees < high


def test_few_turns_show_the_scale_of_the_gyros(rng):
    turns = six_positions()
    t, f, w = by_hand(rng, poses=6, turns=turns)
    fit = calibrate_poses(t, f, w, gravity=G)
    assert len(fit.dwells) == 6
    sigma = np.diag(fit.calibration.sigma["gyro_matrix"])
    assert fit.calibration.gyro_matrix[0, 1] == 0.0
    # The axes are off by a hundredth, which the scale alone cannot hold.
    off = np.diag(fit.calibration.gyro_matrix) - np.diag(GYRO)
    assert np.abs(off[0]) < 0.01 + 5 * sigma[0]
    with pytest.raises(InputError, match="six poses or more, each axis up and down"):
        calibrate_poses(t[:2200], f[:2200], w[:2200], gravity=G)


def test_poses_of_a_second_are_enough(rng):
    t, f, w = by_hand(rng, first=1.2, hold=1.1)
    fit = calibrate_poses(t, f, w, gravity=G)
    assert len(fit.dwells) == 24
    sigma = np.sqrt(np.diag(fit.accel_covariance))[:3]
    assert np.abs((fit.calibration.accel_bias - BIAS) / sigma).max() < 5.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]),
         "x is y of the gyros, y is x of the gyros, z is -z"),
        (np.diag([1.0, 1.0, -1.0]), "z is -z of the gyros"),
        (-np.eye(3), "x is -x of the gyros, y is -y of the gyros, z is -z of the gyros"),
    ],
)  # fmt: skip
def test_exchanged_and_reversed_gyros_are_named(change, words, rng):
    t, f, w = by_hand(rng)
    assert calibrate_poses(t, f, w, gravity=G).remarks == ()
    fit = calibrate_poses(t, f, w @ change.T, gravity=G)
    assert len(fit.remarks) == 1
    assert words in fit.remarks[0]
    sigma = fit.calibration.sigma["gyro_matrix"]
    assert (
        np.abs((fit.calibration.gyro_matrix @ change - GYRO) / np.abs(sigma @ np.abs(change))).max()
        < 6.0
    )


def test_what_is_no_error_of_an_instrument_is_refused(rng):
    t, f, w = by_hand(rng)
    with pytest.raises(InputError, match=r"the gyros miss gravity by .* deg a turn after"):
        calibrate_poses(t, f, w[::-1], gravity=G, dwells=find_rests(t, f))
    noisy = f + 2.0 * np.repeat(rng.normal(size=(len(f) // 100 + 1, 3)), 100, axis=0)[: len(f)]
    with pytest.raises(InputError, match="the poses miss gravity by"):
        calibrate_poses(t, noisy, gravity=G, dwells=find_rests(t, f))
