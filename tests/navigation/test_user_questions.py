"""What users of aided navigation ask for: levers, rest, wheels without fixes, poles, date line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.aiding import BodySpeed, GnssFixes
from schuler.attitude import multiply, quat_to_rotvec, rotate
from schuler.constants import DEG
from schuler.earth import Site, geocentric, moved
from schuler.motion import Manoeuvre, Route
from schuler.navigation import AidingOptions, Outages, navigate_aided
from schuler.navigation.lever import at_lever, rates
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import chi_square_band

from .test_aided import QUIET, SPEC, drive, route

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def rows_of(truth, path):
    """Return the rows of the truth at those of a path."""
    return truth.rows(np.searchsorted(truth.time, path.time - 1e-9))


def apart(path, truth):
    """Return distances (m) and misalignments (deg) of a path from the truth at its times."""
    here = geocentric(path.lat, path.lon, path.height)
    there = geocentric(truth.lat, truth.lon, truth.height)
    turn = multiply(path.quat_nb, truth.quat_nb * CONJUGATE)
    turn *= np.sign(turn[:, :1])
    return np.linalg.norm(here - there, axis=1), np.abs(quat_to_rotvec(turn)) / DEG


def fixes(truth, rng, sigma=0.03, **options):
    """Return four fixes a second with velocities, of a trajectory at 100 Hz."""
    t = truth.rows(np.arange(200, len(truth) - 1, 25))
    off = sigma * rng.standard_normal((len(t), 3))
    lat, lon, height = moved(t.lat, t.lon, t.height, off)
    v_n = t.v_n + 0.03 * rng.standard_normal((len(t), 3))
    return GnssFixes(t.time, lat, lon, height, sigma, v_n, 0.03, **options)


LEVER = np.array([0.6, 1.8, 1.2])


def test_velocity_of_an_antenna_on_a_lever_arm():
    rng = np.random.default_rng(5)
    made = simulate(route(), Site(40.0, 10.0, 100.0), 170.0, 100.0, SPEC, rng)
    antenna = at_lever(made.truth, LEVER)
    gnss = fixes(antenna, rng, lever=LEVER)
    found = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    _, z, sigma, weight = found.innovations["gnss_velocity"]
    late = slice(len(z) // 2, None)
    assert np.all(weight[late] > 0.0)
    assert np.sqrt(np.mean((z[late] / sigma[late]) ** 2)) == pytest.approx(1.0, abs=0.15)
    distance, turn = apart(found.path, rows_of(made.truth, found.path))
    assert distance[-1] < 0.15
    assert turn[-1, 2] < 0.3
    # Not told, it swings in each turn by a metre a second, and is seen.
    blind = navigate_aided(
        made.record, replace(gnss, lever=(0.0, 0.0, 0.0)), spec=SPEC, options=QUIET
    )
    assert not blind.consistent
    # Not told but asked for, it is found.
    asked = replace(gnss, lever=(0.0, 0.0, 0.0), estimate=("lever",))
    value, spread = navigate_aided(made.record, asked, spec=SPEC, options=QUIET).estimated[
        "lever_m"
    ]["gnss"]
    assert np.all(np.abs(np.array(value) - LEVER) < 4.0 * np.array(spread) + 0.01)
    assert max(spread[:2]) < 0.02
    assert spread[2] > 0.5  # a level road does not show how high an antenna is


def test_heading_stays_at_rest_by_the_zero_rate():
    """After a drive the unit stands for four minutes, and its fixes show no heading."""
    poor = GRADES["industrial-mems"]
    legs = [Manoeuvre(15.0), Manoeuvre(10.0, speed=12.0)]
    legs += [Manoeuvre(8.0, turn=turn) for turn in (90.0, -60.0, 90.0)]
    legs += [Manoeuvre(10.0, speed=-12.0), Manoeuvre(240.0)]
    rng = np.random.default_rng(8)
    made = simulate(Route(legs, heading=40.0), Site(40.0, 10.0), 299.0, 100.0, poor, rng)
    gnss = fixes(made.truth, rng)
    drift = {}
    for rest in (False, True):
        options = AidingOptions(vibration=0.01, zero_velocity=rest)
        found = navigate_aided(made.record, gnss, spec=poor, options=options)
        _, turn = apart(found.path, rows_of(made.truth, found.path))
        parked = found.path.time > 65.0
        drift[rest] = np.ptp(turn[parked, 2])
        sigma = np.sqrt(found.path.variances[-1, 2]) / DEG
        assert turn[-1, 2] < 4.0 * sigma
    assert found.used["zero_rate"] > 300
    assert drift[True] < 0.25 * drift[False]
    assert drift[True] < 0.2


def test_wheels_alone_after_a_start():
    made, gnss = drive(11)
    truth = made.truth
    begun = np.asarray(gnss.time) < 60.0
    speed = 1.01 * np.linalg.norm(truth.v_n[::10], axis=1)
    speed = speed + 0.02 * np.random.default_rng(1).standard_normal(len(speed))
    wheels = BodySpeed(truth.time[::10], speed, 0.05, estimate=("scale",))
    options = replace(QUIET, non_holonomic=True)
    found = navigate_aided(
        made.record, gnss.rows(begun), spec=SPEC, speeds=[wheels], options=options
    )
    far = float(np.sum(np.linalg.norm(truth.v_n[6000:], axis=1)) * 0.01)
    distance, _ = apart(found.path, rows_of(truth, found.path))
    free = navigate_aided(made.record, gnss.rows(begun), spec=SPEC, options=QUIET)
    alone, _ = apart(free.path, rows_of(truth, free.path))
    assert found.path.time[-1] == made.record.end
    assert distance[-1] < 0.003 * far
    assert distance[-1] < 0.5 * alone[-1]
    assert found.gaps[-1][1] - found.gaps[-1][0] > 100.0


def test_the_constraint_holds_at_the_rear_axle():
    """The IMU is 1.5 m before the axle: in a turn it moves sideways by 0.3 m/s."""
    lever = np.array([0.2, 1.5, 0.4])
    exact = simulate(route(), Site(40.0, 10.0, 100.0), 170.0, 100.0)
    axle = exact.truth
    imu = at_lever(axle, lever)
    swing = np.cross(rates(axle), rotate(axle.quat_nb, np.broadcast_to(lever, (len(axle), 3))))
    more = rotate(axle.quat_nb[1:] * CONJUGATE, np.diff(swing, axis=0))
    rng = np.random.default_rng(6)
    made = simulate(route(), Site(40.0, 10.0, 100.0), 170.0, 100.0, SPEC, rng)
    record = replace(made.record, dvel=made.record.dvel + more)
    gnss = fixes(imu, rng)
    options = replace(QUIET, non_holonomic=True, constraint_sigma=0.02)
    ratio = {}
    for name, told in (("axle", -lever), ("imu", (0.0, 0.0, 0.0))):
        told_options = replace(options, constraint_lever=told)
        found = navigate_aided(record, gnss, spec=SPEC, options=told_options)
        _, z, sigma, _ = found.innovations["non_holonomic"]
        ratio[name] = np.sqrt(np.mean((z[:, 0] / sigma[:, 0]) ** 2))
    assert ratio["axle"] < 0.5
    assert ratio["imu"] > 1.5
    asked = replace(options, constraint_estimate=("mount", "lever"))
    estimated = navigate_aided(record, gnss, spec=SPEC, options=asked).estimated
    value, spread = (np.array(x) for x in estimated["lever_m"]["non_holonomic"])
    assert abs(value[1] + lever[1]) < 4.0 * spread[1]
    assert spread[1] < 0.1


TURNS = [
    Manoeuvre(8.0), Manoeuvre(10.0, speed=12.0), Manoeuvre(8.0, turn=40.0), Manoeuvre(30.0),
    Manoeuvre(8.0, turn=-60.0), Manoeuvre(16.0),
]  # fmt: skip
ALONG = [
    Manoeuvre(8.0), Manoeuvre(10.0, speed=12.0), Manoeuvre(10.0, speed=-5.0),
    Manoeuvre(10.0, speed=8.0), Manoeuvre(40.0),
]  # fmt: skip


@pytest.mark.parametrize(
    ("place", "heading", "legs"),
    [((10.0, 179.999), 80.0, TURNS), ((10.0, -179.999), 280.0, TURNS), ((89.996, 30.0), 0.0, ALONG),
     ((-89.996, 30.0), 180.0, ALONG)],
    ids=["date line eastwards", "date line westwards", "north pole", "south pole"],
)  # fmt: skip
def test_a_drive_over_the_date_line_and_the_poles(place, heading, legs):
    rng = np.random.default_rng(1)
    made = simulate(Route(legs, heading=heading), Site(*place, 20.0), 78.0, 100.0, SPEC, rng)
    truth = made.truth
    turned = np.abs(np.diff(truth.lon)).max()
    assert turned > 3.0  # half a turn over a pole, a whole one over the date line
    assert np.abs(truth.lat).max() <= np.pi / 2
    found = navigate_aided(
        made.record, fixes(truth, rng), spec=SPEC, options=replace(QUIET, smooth=True),
        outages=Outages(4.0, 12.0, settle=20.0),
    )  # fmt: skip
    assert found.consistent
    assert not any(found.refused.values())
    assert found.outages["forward"]["rms_horizontal_m"] < 0.2
    for path, most in (
        (found.path, 0.05),
        (found.forward, 0.3),
        (found.at_samples(made.record), 0.05),
    ):
        there = rows_of(truth, path)
        distance, turn = apart(path, there)
        settled = path.time > 25.0
        assert distance[settled].max() < most
        assert np.all(np.abs(path.lon) <= np.pi)
        # A heading counts from the north: beside a pole a centimetre turns it.
        clear = settled & (np.abs(there.lat) < np.pi / 2 - 5.0 / 6.4e6)
        assert turn[clear].max() < 0.4
        assert np.abs(path.v_n - there.v_n)[clear].max() < 0.15


def test_another_point_has_its_own_sigma():
    """Six smoothed runs, a point 20 m away: errors over sigma at five instants of each.

    Attitude counts there: without it a position's sigma would be two thirds of what it is. The
    mean square of 90 such ratios, which five instants of a run share in part, is taken for 30
    free ones: false alarm 2e-3 each.
    """
    far = np.array([3.0, 20.0, 1.0])
    squares, plain = [], []
    for seed in range(6):
        rng = np.random.default_rng([seed, 3])
        made = simulate(route(), Site(40.0, 10.0, 100.0), 120.0, 100.0, SPEC, rng)
        gnss = fixes(made.truth, rng)
        found = navigate_aided(made.record, gnss, spec=SPEC, options=replace(QUIET, smooth=True))
        point = found.at_point(made.record, far)
        truth = at_lever(rows_of(made.truth, point), far, rates_at(made.truth, point.time))
        k = np.linspace(len(point) // 4, len(point) - 2, 5).astype(int)
        off = np.column_stack([
            (point.lon - truth.lon) * 6.385e6 * np.cos(truth.lat),
            (point.lat - truth.lat) * 6.36e6, point.height - truth.height,
        ])[k]  # fmt: skip
        sigma = np.sqrt(point.known("variances")[k, 6:9])
        squares.append((off / sigma) ** 2)
        plain.append(np.sqrt(found.path.known("variances")[k, 6:9]) / sigma)
    low, high = (x / 30.0 for x in chi_square_band(30, 2e-3))
    assert low < np.mean(squares) < high
    assert np.min(plain) < 0.7
    first = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    assert first.at_point(made.record, far).variances is None


def rates_at(truth, time):
    """Return the body's rate at times, from the truth's attitudes."""
    rate = rates(truth)
    return np.column_stack([np.interp(time, truth.time, column) for column in rate.T])
