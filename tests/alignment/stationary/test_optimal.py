"""The optimal estimate: beside the limit, on any base, with biases and consistent covariances."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

from schuler.alignment import Auto, Position, align, parse_method, position_limit
from schuler.alignment.stationary.optimal import find_dwells
from schuler.attitude import euler_to_quat, multiply, quat_to_rotvec, rotvec_to_quat
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.motion import DisturbedVehicle, Static
from schuler.motion.turntable import Dwell, Turn, Turntable
from schuler.sensors import GRADES, ImuSpec
from schuler.simulation import simulate
from tests.conftest import NORMAL_GRAVITY

QUIET = ImuSpec.from_dict(
    {
        "gyro": {"angle_random_walk": "0.001 deg/sqrt(h)"},
        "accelerometer": {"velocity_random_walk": "10 ug/sqrt(Hz)"},
    }
)
FOG = GRADES["navigation-fog"]
SITE = Site(40.0, **NORMAL_GRAVITY)


def errors(motion, duration, spec, site, seed, method="optimal", at="end", rate=20.0):
    """Return phi (3,) of an alignment, rad, and the alignment."""
    rng = np.random.default_rng([seed, 5])
    made = simulate(motion(rng), site, duration, rate, spec, rng)
    fix = align(made.record, site, method, spec, at=at)
    k = round((fix.time - made.start) / made.step)
    back = euler_to_quat(made.euler_at(k)) * [1.0, -1.0, -1.0, -1.0]
    return -quat_to_rotvec(multiply(fix.quat_nb, back)), fix


def many(runs, *args, **more):
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda seed: errors(*args, seed=seed, **more), range(runs)))
    phi = np.array([f[0] for f in found])
    nees = np.array([p @ np.linalg.solve(f.covariance, p) for p, f in found])
    limit = np.array([f.limit_arcmin for _, f in found])
    return phi / ARCMIN, nees, limit


def band(runs, freedom, level=0.99):
    """Return the band of a mean of chi-squares that is missed by chance once in a hundred."""
    return np.array(stats.chi2.interval(level, runs * freedom)) / runs


@pytest.mark.slow
def test_at_rest_it_reaches_the_limit():
    """White noise alone: within 5 % of the limit and the standard error of 150 runs."""
    phi, nees, limit = many(
        150,
        lambda rng: Static(rng.uniform(0, 360)),
        300.0,
        QUIET,
        Site(34.2, **NORMAL_GRAVITY),
    )
    spread = phi[:, 2].std() / limit[:, 2].mean()
    assert spread < 1.05 * (1 + 2.6 / np.sqrt(2 * 150))
    low, high = band(150, 3)
    # A disturbance can never be ruled out, so sigma may be somewhat too large, never too small.
    assert 0.75 * low < nees.mean() < high


@pytest.mark.slow
def test_on_a_rocking_vehicle_it_beats_the_centred_estimate():
    def vehicle(rng):
        return DisturbedVehicle.with_crew(rng, 300.0, heading=rng.uniform(0, 360))

    phi, nees, limit = many(80, vehicle, 300.0, FOG, SITE, rate=100.0)
    centred, _, _ = many(80, vehicle, 300.0, FOG, SITE, method="centred", rate=100.0)
    ratio = np.sqrt(np.mean(phi[:, 2] ** 2) / np.mean(limit[:, 2] ** 2))
    assert ratio < 1.15 * (1 + 1.0 / np.sqrt(2 * 80))
    assert np.mean(phi[:, 2] ** 2) < 1.05 * np.mean(centred[:, 2] ** 2)
    low, high = band(80, 3)
    assert low < nees.mean() < high


@pytest.mark.slow
def test_two_positions_show_the_biases():
    """Half a turn between two dwells: phi and biases inside their covariances, near the limit."""
    turn = Turn("psi", 180.0)
    table = Turntable([Dwell(300.0), turn, Dwell(300.0)], (30.0, 0.0, 0.0))
    rng = np.random.default_rng(3)
    runs = 60
    nees, up = [], []
    for seed in range(runs):
        rng = np.random.default_rng([seed, 8])
        gyro, accel = rng.normal(size=3) * FOG.gyro.bias, rng.normal(size=3)
        accel *= FOG.accelerometer.bias
        made = simulate(
            table, SITE, 600.0 + turn.time, 20.0, FOG, rng,
            gyro_bias=gyro, accel_bias=accel,
        )  # fmt: skip
        fix = align(made.record, SITE, spec=FOG, at="start")
        back = euler_to_quat(made.euler_at(0)) * [1.0, -1.0, -1.0, -1.0]
        phi = -quat_to_rotvec(multiply(fix.quat_nb, back))
        off = np.concatenate([fix.gyro_bias - gyro, fix.accel_bias - accel])
        nees.append(
            [
                phi @ np.linalg.solve(fix.covariance, phi),
                off @ np.linalg.solve(fix.bias_covariance, off),
            ]
        )
        up.append(phi[2] / ARCMIN)
    bound = position_limit(
        FOG, SITE, [Position(30.0), Position(210.0, turn=turn.time)]
    ).sigma_arcmin[2]
    assert np.sqrt(np.mean(np.square(up))) < 1.15 * bound * (1 + 2.6 / np.sqrt(2 * runs))
    for k, freedom in ((0, 3), (1, 6)):
        low, high = band(runs, freedom)
        assert 0.75 * low < np.mean(nees, axis=0)[k] < 1.05 * high


def test_without_a_specification_it_says_what_it_can():
    phi, fix = errors(lambda rng: Static(20.0), 120.0, QUIET, SITE, 1)
    rng = np.random.default_rng([1, 5])
    record = simulate(Static(20.0), SITE, 120.0, 20.0, QUIET, rng).record
    bare = align(record, SITE, "optimal")
    assert abs(bare.heading_deg - fix.heading_deg) * 60 < 4 * bare.sigma_arcmin[2]
    assert bare.gyro_bias is None
    assert set(bare.budget) == {"disturbance", "gyro_bias"}
    assert abs(phi[2]) < 4 * np.sqrt(fix.covariance[2, 2])


def test_auto_says_what_it_chose():
    _, still = errors(lambda rng: Static(20.0), 120.0, QUIET, SITE, 1, method="auto")
    assert (str(still.method), "at rest" in still.why) == ("optimal", True)
    _, crew = errors(
        lambda rng: DisturbedVehicle.draw(rng, 120.0),
        120.0,
        FOG,
        SITE,
        1,
        method="auto",
    )
    assert "moves" in crew.why
    rng = np.random.default_rng(2)
    truck = DisturbedVehicle.draw(rng, 60.0)
    bare = align(
        simulate(truck, SITE, 60.0, 100.0, FOG, rng).record,
        SITE,
    )
    assert (str(bare.method), "no specification" in bare.why) == ("centred", True)
    assert parse_method(None) == Auto()


def test_dwells():
    q = np.tile([1.0, 0.0, 0.0, 0.0], (40, 1))
    steady = np.full(40, True)
    assert find_dwells(q, steady) == ((0, 40),)
    q[20:] = rotvec_to_quat(np.array([0.0, 0.0, 1.0]))
    assert find_dwells(q, steady) == ((0, 19), (21, 40))
    steady[:18] = False
    assert find_dwells(q, steady) == ((21, 40),)
    spin = rotvec_to_quat(np.column_stack([np.zeros((40, 2)), 0.1 * np.arange(40)]))
    assert find_dwells(spin, np.full(40, True)) == ()


def test_the_last_dwell_shows_the_level_at_the_end():
    """Two tilted positions: what the accelerometers say last corrects what the gyros carried."""
    spec = ImuSpec.from_dict(
        {
            "gyro": {"bias": "0.1 deg/h", "angle_random_walk": "0.01 deg/sqrt(h)"},
            "accelerometer": {"bias": "100 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
        }
    )
    turns = [Turn("psi", 70.0), Turn("theta", -40.0), Turn("gamma", 43.0)]
    table = Turntable([Dwell(100.0), *turns, Dwell(100.0)], (100.0, 5.0, -3.0))
    duration, site, runs = (
        200.0 + sum(turn.time for turn in turns),
        Site(-28.0, **NORMAL_GRAVITY),
        12,
    )
    for method in ("auto", "kalman-10"):
        nees, tilt = [], []
        for seed in range(runs):
            rng = np.random.default_rng([seed, 9])
            made = simulate(table, site, duration, 20.0, spec, rng)
            fix = align(made.record, site, method, spec)
            back = fix.quat_nb * [1.0, -1.0, -1.0, -1.0]
            phi = quat_to_rotvec(multiply(made.truth.quat_nb[-1], back))
            assert fix.consistent
            assert not any("mean |w|" in text for text in fix.warnings)
            # The bound is that of both positions.
            assert fix.limit_arcmin[2] < 1.3 * fix.sigma_arcmin[2]
            nees.append(phi @ np.linalg.solve(fix.covariance, phi))
            tilt.append(phi[:2] / ARCMIN)
        # The turn that the gyros carried is known to 0.14' only.
        assert np.sqrt(np.mean(np.square(tilt))) < 0.1
        low, high = band(runs, 3)
        assert 0.7 * low < np.mean(nees) < high
