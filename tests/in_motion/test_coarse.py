"""Coarse alignment in motion: exact without noise, as good as the bound with it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from schuler.alignment.moving.path_bound import limit_on
from schuler.attitude import nearest_quat
from schuler.constants import ARCMIN
from schuler.earth import gravity
from schuler.in_motion.body import body_rows
from schuler.in_motion.coarse import coarse
from schuler.in_motion.earth_side import earth_fixed, from_earth, gravitation_integrals
from schuler.in_motion.rotation import Sums, weights_igg3
from schuler.in_motion.series import (
    body_velocity_series,
    position_series,
    velocity_series,
)
from schuler.sensors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec
from tests.alignment.moving.routes import (
    ROUTES,
    SITE,
    body_speed,
    fixes,
    heading_error,
    noisy,
    truth_of,
)
from tests.conftest import chi_square_band

PERFECT = ImuSpec(GyroSpec(), AccelerometerSpec(), name="perfect")
LEVER = (0.6, 1.0, 1.6)


@cache
def simulated(name, length=60.0):
    return truth_of(ROUTES[name](), length)


def ending(made, gnss):
    """Return a simulation that ends with the last fix."""
    k = round(float(gnss.time[-1]) / made.step)
    return replace(
        made, record=made.record.rows(0, k), v_n=made.v_n[: k + 1], position=made.position[: k + 1]
    )


def solved(made, record, aid, make, spec=PERFECT, **options):
    rows = body_rows(record, aid.time)
    truth, k = made.truth, len(record)
    return coarse(
        make(rows, aid), spec, (truth.lat[k], truth.lon[k]), record.end, rows.mat_ib0_b[-1],
        rows.turn[-1], **options,
    )  # fmt: skip


def error_of(found, made):
    return heading_error(nearest_quat(found.mat_nb), made.truth.quat_nb[-1]) / ARCMIN


@pytest.mark.parametrize("name", ROUTES)
@pytest.mark.parametrize("make", [velocity_series, position_series])
def test_without_noise_it_is_exact(name, make):
    """Below 0.001 arcmin; with a lever arm of 2 m below 0.01 arcmin."""
    for lever, bound in (((0.0, 0.0, 0.0), 1e-3), (LEVER, 1e-2)):
        made = simulated(name, 120.0)
        gnss = fixes(made, lever=lever)
        made = ending(made, gnss)
        found = solved(made, made.record, gnss, make)
        assert np.all(np.abs(error_of(found, made)) < bound)


def test_a_lever_arm_that_is_not_said_costs_arcminutes():
    made = simulated("ship", 120.0)
    gnss = fixes(made, lever=LEVER)
    made = ending(made, gnss)
    ignored = solved(made, made.record, replace(gnss, lever=(0.0, 0.0, 0.0)), velocity_series)
    assert abs(error_of(ignored, made)[2]) > 1.0


def test_body_velocity_needs_a_few_passes():
    """The path is not known at first: 44', 1.2', 0.03', 0.0005' after passes 1 to 4."""
    made = simulated("car", 120.0)
    speed = body_speed(made)
    errors, attitude = [], None
    for _ in range(4):
        found = solved(
            made, made.record, speed,
            lambda rows, aid, at=attitude: body_velocity_series(rows, aid, SITE, at),
        )  # fmt: skip
        attitude = found.mat_i0_ib0
        errors.append(abs(error_of(found, made)[2]))
    assert errors[0] < 60.0
    assert errors[1] < 2.0
    assert errors[2] < 0.1
    assert errors[3] < 0.002


@pytest.mark.parametrize(("name", "grade"), [("car", "tactical-fog"), ("plane", "navigation-fog")])
def test_with_noise_it_is_near_the_bound(name, grade):
    """40 runs of 60 s: rms of the heading, its sigma, and NEES of all three."""
    made, runs = simulated(name), 40
    spec = GRADES[grade]
    bound = limit_on(made.truth, spec, fixes(made), record=made.record).phi
    errors, sigma, nees = [], [], 0.0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, grade, rng)
        found = solved(made, record, gnss, velocity_series, spec)
        error = error_of(found, made) * ARCMIN
        errors.append(error[2])
        sigma.append(found.heading_sigma)
        nees += error @ np.linalg.solve(found.covariance, error)
    rms = np.sqrt(np.mean(np.square(errors)))
    assert rms < 1.3 * np.sqrt(bound[2, 2])
    # The rms of 40 runs is known to 11 %.
    assert rms == pytest.approx(np.sqrt(np.mean(np.square(sigma))), rel=0.25)
    low, high = chi_square_band(3 * runs, 0.002)
    assert low < nees < high


def test_bad_velocities_are_not_used():
    """5 % of the velocities 5 m/s off: within 10 % of the clean result, over 30 runs."""
    made, clean, bad = simulated("car"), [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, "navigation-fog", rng)
        off = rng.standard_normal((len(gnss), 3))
        off *= 5.0 / np.linalg.norm(off, axis=1)[:, None]
        wrong = rng.random(len(gnss)) < 0.05
        v = np.asarray(gnss.v_n) + np.where(wrong[:, None], off, 0.0)
        for out, each in ((clean, gnss), (bad, replace(gnss, v_n=v))):
            found = solved(made, record, each, velocity_series, GRADES["navigation-fog"])
            out.append(error_of(found, made)[2])
    assert found.refused == wrong.sum()
    assert np.std(bad) < 1.1 * np.std(clean)


def test_any_window_follows_from_the_sums():
    made = simulated("car")
    rng = np.random.default_rng(3)
    gnss = fixes(made, rng=rng)
    series = velocity_series(body_rows(noisy(made, "tactical-fog", rng), gnss.time), gnss)
    sums = Sums(series, np.ones(len(series)))
    for first, last in ((0, 61), (10, 40), (35, 61)):
        y, x = (a[first:last] - a[first:last].mean(axis=0) for a in (series.y, series.x))
        u, _, vt = np.linalg.svd(y.T @ x)
        direct = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        np.testing.assert_allclose(sums.rotation(first, last), direct, atol=1e-10)


def test_a_delay_is_found():
    made = simulated("car")
    gnss = fixes(made)
    t = np.asarray(gnss.time)
    inside = (t >= 1.0) & (t <= 59.0)
    late = replace(gnss.rows(inside), time=t[inside] + 0.1)
    rows = body_rows(made.record, late.time)
    series = velocity_series(rows, late)
    found = coarse(
        series, PERFECT, (SITE.latitude, SITE.longitude), rows.start, np.eye(3), np.zeros((3, 3)),
        estimate_delay=True, choose=False,
    )  # fmt: skip
    assert found.delay == pytest.approx(0.1, abs=0.01)


def test_the_window_is_the_one_with_the_least_sigma():
    """What the instrument gathers grows with the span: a coarse one has a shorter window."""
    made = simulated("car", 300.0)
    rng = np.random.default_rng(0)
    gnss = fixes(made, rng=rng)
    poor = GRADES["industrial-mems"]
    found = solved(made, noisy(made, "industrial-mems", rng), gnss, velocity_series, poor)
    whole = solved(
        made, noisy(made, "industrial-mems", rng), gnss, velocity_series, poor, choose=False
    )
    assert found.window[0] > 0.0
    assert found.heading_sigma < whole.heading_sigma


def test_weights_of_igg3_fall_from_one_to_nothing():
    u = np.array([0.0, 1.5, 2.0, 3.9, 4.0, 50.0])
    weights = weights_igg3(u)
    assert weights[0] == weights[1] == 1.0
    assert np.all(np.diff(weights[1:5]) < 0.0)
    assert np.all(weights[4:] == 0.0)


def test_places_go_to_the_earth_and_back():
    lat, lon = (
        np.deg2rad([-89.9, -30.0, 0.0, 45.0, 90.0]),
        np.deg2rad([-179.0, 10.0, 0.0, 90.0, 5.0]),
    )
    height = np.array([0.0, -50.0, 1e4, 100.0, 3e3])
    back = from_earth(earth_fixed(lat, lon, height))
    np.testing.assert_allclose(back[0], lat, atol=1e-12)
    np.testing.assert_allclose(back[1][:4], lon[:4], atol=1e-12)
    np.testing.assert_allclose(back[2], height, atol=1e-6)


def test_gravitation_holds_a_place_on_its_circle():
    """At rest the integral of gravitation and the force of rest make the Earth's rotation."""
    t = np.arange(0.0, 61.0)
    r = np.repeat(earth_fixed(*(np.array([a]) for a in (0.7, 0.2, 100.0))), len(t), axis=0)
    v, way = gravitation_integrals(t, r, np.zeros_like(r))
    size = np.linalg.norm(v[-1])
    # The mean of a vector of length |G| that turns by 0.25 deg.
    assert size == pytest.approx(60.0 * gravity(0.7, 100.0), rel=4e-3)
    np.testing.assert_allclose(way[-1], 30.0 * v[-1], rtol=5e-3, atol=0.2)
