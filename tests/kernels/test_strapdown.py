"""Truth against navigator: two roads that must meet."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.attitude import multiply
from schuler.earth import Site
from schuler.motion import (
    Band,
    Carried,
    Centrifuge,
    DisturbedVehicle,
    Lines,
    Manoeuvre,
    Route,
    Sea,
    Static,
    Sum,
    Sway,
    four_position,
    moored_ship,
    two_axis_16,
)
from schuler.navigation import Navigator, Start
from schuler.record import ImuRecord
from schuler.simulation import simulate
from tests.conftest import pieces

SITE = Site(40.0, 116.0, 50.0)


def flown(made, n_sub=1, cuts=()):
    """Return rows of time, quaternion, velocity and position from error-free increments."""
    truth, r = made.truth, made.record
    lat, lon, height = truth.position[0]
    start = Start(Site(np.rad2deg(lat), np.rad2deg(lon), height), truth.quat_nb[0],
                  truth.v_n[0])  # fmt: skip
    navigator = Navigator(start, subsamples=n_sub)
    for s in pieces(len(r), cuts):
        navigator.update(ImuRecord(r.time[s], r.dt[s], r.dtheta[s], r.dvel[s]))
    p = navigator.path()
    return np.column_stack([p.time, p.quat_nb, p.v_n, p.position])[1:]


def errors(made, n_sub=1):
    """Return the largest error of attitude (rad), velocity (m/s) and final position (m)."""
    rows = flown(made, n_sub)
    k = np.round((rows[:, 0] - made.record.start) * made.record.rate).astype(int)
    truth = made.truth
    turn = multiply(truth.quat_nb[k], rows[:, 1:5] * [1.0, -1.0, -1.0, -1.0])
    angle = 2.0 * np.linalg.norm(turn[:, 1:], axis=1)
    metres = np.abs(rows[-1, 8:] - truth.position[-1]) * [6.37e6, 4.9e6, 1.0]
    return angle.max(), np.abs(rows[:, 5:8] - truth.v_n[k]).max(), metres.max()


def rng(seed=2):
    return np.random.default_rng(seed)


def slow_sway(lever=(0.0, 0.0, 0.0)):
    bands = [
        Band("pitch", 0.3, 0.2, 1.0),
        Band("roll", 0.3, 0.2, 1.0),
        Band("heading", 0.1, 0.2, 1.0),
    ]
    return Sway.draw(rng(), bands, heading=40.0, lever=lever)


@pytest.mark.parametrize("motion", [Static(30.0, 2.0, -3.0), slow_sway()], ids=["static", "sway"])
def test_truth_and_navigator_agree(motion):
    """1e-9 rad and 1e-6 m/s over 100 s at 100 Hz."""
    angle, speed, _ = errors(simulate(motion, SITE, 100.0))
    assert angle < 1e-9
    assert speed < 1e-6


CASES = {
    "lever": (slow_sway((1.0, 2.0, 3.0)), 2e-9, 3e-6),
    "shaken": (DisturbedVehicle.draw(rng(), 60.0), 2e-8, 3e-6),
    "crew": (DisturbedVehicle.with_crew(rng(), 60.0), 2e-8, 3e-6),
    "four positions": (four_position(5.0), 1e-10, 1e-8),
    "two axes": (two_axis_16(2.0, rate=30.0, acceleration=60.0), 1e-7, 1e-6),
    "centrifuge": (Centrifuge(2.0, 60.0, 20.0, orientation=(10.0, 20.0, 30.0)), 1e-9, 3e-7),
    "arm without counter-rotation": (Centrifuge(2.0, 60.0, 0.0, False), 1e-9, 3e-6),
    "route": (
        Route(
            [Manoeuvre(20, speed=30), Manoeuvre(20, turn=90), Manoeuvre(10, climb=5),
             Manoeuvre(10, turn=-45, speed=-10)], heading=300.0, coordinated=True,
            lever=(0.5, 2.0, 1.0),
        ), 1e-9, 1e-6,
    ),
    "aircraft": (Route([Manoeuvre(30, turn=180), Manoeuvre(30, climb=3)], speed=250.0), 1e-9, 3e-6),
    "ship and table": (
        Carried(moored_ship(rng(), Sea(2.0, 8.0, 3.3)), four_position(5.0), (1.0, 2.0, 3.0)),
        2e-9, 1e-6,
    ),
    "route with sway": (Sum((Route([Manoeuvre(30, speed=20)]), slow_sway())), 2e-9, 1e-6),
}  # fmt: skip


@pytest.mark.compiled
@pytest.mark.parametrize("name", list(CASES))
def test_every_motion_is_consistent(name):
    motion, angle_bound, speed_bound = CASES[name]
    angle, speed, metres = errors(simulate(motion, SITE, 60.0))
    assert angle < angle_bound
    assert speed < speed_bound
    assert metres < 60.0 * 10.0 * max(speed, 1e-9) + 1e-3


def test_a_finer_step_shows_that_the_rest_is_the_navigator_s():
    """Between two sampling rates the disagreement falls as the navigator's order says."""
    motion = Sway.draw(rng(), [Band("pitch", 1.0, 1.0, 2.0), Band("roll", 1.0, 1.0, 2.0)])
    coarse, fine = (errors(simulate(motion, SITE, 20.0, rate))[0] for rate in (100.0, 400.0))
    assert fine < coarse / 4.0**2.8


@pytest.mark.parametrize("n_sub", [1, 2])
def test_pure_coning_shows_the_algorithm_s_error_and_no_more(n_sub):
    """pitch = a cos wt, roll = a sin wt: a drift of a^2 w (wh)^4 / 60 is left (Miller, 1983).

    h is the sample; one sample with the one before and two samples leave the same.
    """
    a, f, rate, duration = 1.0, 2.0, 50.0, 20.0
    w = 2 * np.pi * f
    cone = Sway(
        lines=(
            Lines("pitch", f, a, 0.5 * np.pi),
            Lines("roll", f, a, 0.0),
        )
    )
    made = simulate(cone, SITE, duration, rate)
    rows = flown(made, n_sub)
    k = np.round(rows[:, 0] * rate).astype(int)
    turn = 2 * multiply(rows[:, 1:5], made.truth.quat_nb[k] * [1.0, -1.0, -1.0, -1.0])
    slope = np.polyfit(rows[:, 0], turn[:, 3], 1)[0]
    amplitude = np.deg2rad(a)
    found = abs(slope) / (0.5 * amplitude**2 * w)
    assert found == pytest.approx((w / rate) ** 4 / 30.0, rel=0.02)


def test_chunking_does_not_matter():
    made = simulate(DisturbedVehicle.draw(rng(), 10.0), SITE, 10.0)
    for n_sub in (1, 2, 3):
        whole = flown(made, n_sub)
        assert np.array_equal(flown(made, n_sub, (1, 2, 77, 77, 500)), whole)


@pytest.mark.compiled
def test_longer_truth_is_the_same_truth():
    """Chunks of the simulator leave no seam."""
    motion = DisturbedVehicle.draw(rng(), 200.0)
    long, short = simulate(motion, SITE, 200.0), simulate(motion, SITE, 100.0)
    n = len(short.record)
    np.testing.assert_allclose(long.record.dtheta[:n], short.record.dtheta, rtol=0, atol=1e-15)
    np.testing.assert_allclose(long.record.dvel[:n], short.record.dvel, rtol=0, atol=1e-13)
    np.testing.assert_allclose(long.truth.position[:n], short.truth.position[:n], atol=1e-9)
