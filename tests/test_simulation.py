"""A simulated record says what its motion did, by roads that the simulator does not take."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from schuler.attitude import rotate
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE, MICRO_G
from schuler.earth import Site, geocentric
from schuler.errors import InputError
from schuler.motion import (
    DisturbedVehicle,
    Manoeuvre,
    Route,
    Sea,
    Static,
    four_position,
    moored_ship,
)
from schuler.sensors import GRADES, ImuSpec
from schuler.simulation import Simulation, simulate

Array = NDArray[np.float64]
SITE = Site(40.0, 116.0, 50.0)
FOG = GRADES["navigation-fog"]
EARTH_N = EARTH_RATE * np.array([0.0, np.cos(SITE.latitude), np.sin(SITE.latitude)])


def body_to_local(euler: Array) -> Rotation:
    """Return C_b^n of (psi, theta, gamma): turns about z, then x, then y, each the new one."""
    return Rotation.from_euler("ZXY", euler)


def vehicle(seed: int = 3, duration: float = 20.0) -> DisturbedVehicle:
    return DisturbedVehicle.draw(
        np.random.default_rng(seed), duration, heading=200.0, pitch=2.0, roll=-3.0
    )


# -- the base at rest ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heading", "pitch", "roll", "rate", "force"),
    [
        # North level: the Earth's rate is front and up, the force is up.
        (0, 0, 0, ("0", "n", "u"), ("0", "0", "1")),
        # East: north is on the left.
        (90, 0, 0, ("-n", "0", "u"), ("0", "0", "1")),
        (180, 0, 0, ("0", "-n", "u"), ("0", "0", "1")),
        # Nose straight up to 30 deg: the force has a part along the front axis.
        (0, 30, 0, ("0", "n c + u s", "-n s + u c"), ("0", "s", "c")),
        # Rolled 30 deg (right side down): the force has a part along minus the right axis.
        (0, 0, 30, ("-u s", "n", "u c"), ("-s", "0", "c")),
    ],
)
def test_conventions(heading, pitch, roll, rate, force):
    values = {"0": 0.0, "1": 1.0, "n": EARTH_N[1], "u": EARTH_N[2], "s": 0.5, "c": np.sqrt(0.75)}

    def value(text: str) -> float:
        total = 0.0
        for term in text.split(" + "):
            sign = -1.0 if term.startswith("-") else 1.0
            total += sign * float(np.prod([values[x] for x in term.lstrip("-").split()]))
        return total

    r = simulate(Static(heading, pitch, roll), SITE, 10.0, 50.0).record
    w, f = ((x / r.dt[:, None]).mean(axis=0) for x in (r.dtheta, r.dvel))
    np.testing.assert_allclose(w, [value(x) for x in rate], atol=1e-12 * EARTH_RATE)
    np.testing.assert_allclose(f, [SITE.gravity * value(x) for x in force], atol=1e-11)


def test_a_base_at_rest_is_the_same_in_every_sample():
    made = simulate(Static(30.0, 1.0, -2.0), SITE, 60.0, 100.0)
    r = made.record
    np.testing.assert_allclose(np.ptp(r.dtheta, axis=0), 0.0, atol=1e-20)
    np.testing.assert_allclose(np.ptp(r.dvel, axis=0), 0.0, atol=1e-14)
    assert len(r) == 6000
    np.testing.assert_allclose(r.time, 0.01 * np.arange(1, 6001), rtol=1e-14)
    np.testing.assert_allclose(made.euler, made.euler[:1].repeat(6001, axis=0), atol=1e-15)
    assert made.heading_deg() == pytest.approx(30.0, abs=1e-12)
    assert made.heading_deg("start") == pytest.approx(30.0, abs=1e-12)


def test_start_shifts_the_clock_only():
    a, b = (simulate(vehicle(), SITE, 2.0, 100.0, start=s) for s in (0.0, 1000.0))
    np.testing.assert_allclose(b.record.time - 1000.0, a.record.time, atol=1e-9)
    np.testing.assert_array_equal(a.record.dtheta, b.record.dtheta)
    np.testing.assert_array_equal(a.record.dvel, b.record.dvel)


# -- increments integrate back ---------------------------------------------------------

MOTIONS = [
    *(pytest.param(kind, marks=pytest.mark.compiled) for kind in ("vehicle", "ship")), "table",
]  # fmt: skip


@pytest.mark.parametrize("kind", MOTIONS)
def test_angles_integrate_back(kind):
    """Plain products of small rotations, with the two-term coning of Savage, meet the truth."""
    motion = {
        "vehicle": vehicle(),
        "ship": moored_ship(np.random.default_rng(2), Sea(1.5, 6.0), heading=70.0),
        "table": four_position(2.0),
    }[kind]
    made = simulate(motion, SITE, 20.0, 800.0)
    d = made.record.dtheta
    before = np.vstack([np.zeros(3), d[:-1]])
    turns = Rotation.from_rotvec(d + np.cross(before, d) / 12.0)
    q = body_to_local(made.euler[0])
    for turn in turns:
        q = q * turn
    # Seen from n, which turns with the Earth, and with the way over it (a metre: 1.6e-7 rad).
    east, north, _ = np.diff(motion.track(np.array([0.0, 20.0])).path[:, :, 0], axis=0)[0]
    way = np.array([-north, east, east * np.tan(SITE.latitude)]) / 6.37e6
    q = Rotation.from_rotvec(-EARTH_N * 20.0 - way) * q
    off = (q * body_to_local(made.euler[-1]).inv()).magnitude()
    assert off < 5e-9


@pytest.mark.compiled
def test_forces_integrate_back():
    """The forces in i0 make gravity's integral and the velocity of the displacement, no more."""
    motion, duration, rate = vehicle(), 20.0, 400.0
    made = simulate(motion, SITE, duration, rate)
    t = made.record.time - 0.5 * made.record.dt
    middle = body_to_local(
        # Attitude at the middles, from the motion itself.
        motion.track(t).angles[:, 0, :, 0]
    )
    force = middle.apply(made.record.dvel) * rate
    path = motion.track(t).path
    v = path[:, :, 1]
    expected = path[:, :, 2] + np.cross(2 * EARTH_N, v) + [0.0, 0.0, SITE.gravity]
    # Midpoint rule: off by h^2/24 of the second derivative, here below 1e-4 of the disturbance;
    # the height changes gravity by 3e-6 a metre.
    scale = np.abs(path[:, :, 2]).max()
    assert np.abs(force - expected).max() < 2e-3 * scale
    # Sums leave of it only the ends.
    assert np.abs((force - expected).mean(axis=0)).max() < 1e-5 * scale


@pytest.mark.parametrize("kind", MOTIONS)
def test_increments_are_those_of_a_finer_quadrature(kind):
    """Eight times finer steps, summed, make the same increments."""
    motion = {
        "vehicle": vehicle(),
        "ship": moored_ship(np.random.default_rng(2), Sea(1.5, 6.0), heading=70.0),
        "table": four_position(2.0),
    }[kind]
    coarse = simulate(motion, SITE, 20.0, 200.0).record
    fine = simulate(motion, SITE, 20.0, 1600.0).record
    for name, unit in (("dtheta", 1.0), ("dvel", SITE.gravity)):
        a = getattr(coarse, name)
        b = getattr(fine, name).reshape(len(a), 8, 3).sum(axis=1)
        assert np.abs(a - b).max() < 1e-12 * unit


def test_truth_does_not_depend_on_the_rate():
    coarse, fine = (simulate(vehicle(), SITE, 20.0, rate) for rate in (50.0, 200.0))
    np.testing.assert_allclose(coarse.euler, fine.euler[::4], atol=1e-12)


# -- the instrument --------------------------------------------------------------------


def test_biases_come_out():
    gyro, accel = np.array([1.0, -2.0, 3.0]) * DEG_PER_HOUR, np.array([5.0, 6.0, -7.0]) * MICRO_G
    clean = simulate(vehicle(), SITE, 10.0, 100.0).record
    made = simulate(vehicle(), SITE, 10.0, 100.0, gyro_bias=gyro, accel_bias=accel)
    r = made.record
    np.testing.assert_allclose((r.dtheta - clean.dtheta) * 100.0, gyro[None].repeat(1000, 0),
                               rtol=1e-9)  # fmt: skip
    np.testing.assert_allclose((r.dvel - clean.dvel) * 100.0, accel[None].repeat(1000, 0),
                               rtol=1e-8)  # fmt: skip
    np.testing.assert_array_equal(made.gyro_bias, gyro)
    np.testing.assert_array_equal(made.accel_bias, accel)


@pytest.mark.compiled
def test_drawn_errors_have_their_size():
    """Biases over 400 draws, noise over 20 000 samples: five standard deviations of each rms."""
    site, still = SITE, Static(30.0)
    drawn = [simulate(still, site, 0.01, 100.0, FOG, np.random.default_rng(k)) for k in range(400)]
    for name, sigma in (("gyro_bias", FOG.gyro.bias), ("accel_bias", FOG.accelerometer.bias)):
        rms = np.sqrt(np.mean([getattr(s, name) ** 2 for s in drawn]))
        assert rms == pytest.approx(sigma, rel=5 / np.sqrt(2 * 1200))
    clean = simulate(still, site, 200.0, 100.0).record
    made = simulate(still, site, 200.0, 100.0, FOG, np.random.default_rng(6))
    for noisy, true, bias, part in (
        (made.record.dtheta, clean.dtheta, made.gyro_bias, FOG.gyro),
        (made.record.dvel, clean.dvel, made.accel_bias, FOG.accelerometer),
    ):
        rms = np.sqrt(np.mean((noisy - true - 0.01 * bias) ** 2))
        assert rms == pytest.approx(part.white * 0.1, rel=5 / np.sqrt(2 * 60_000))


def same(a: Simulation, b: Simulation) -> bool:
    return all(
        np.array_equal(getattr(a.record, x), getattr(b.record, x))
        for x in ("time", "dt", "dtheta", "dvel")
    )


@pytest.mark.parametrize("grade", GRADES)
def test_the_seed_decides(grade):
    spec = GRADES[grade]
    a, b, c = (
        simulate(vehicle(), SITE, 5.0, 100.0, spec, np.random.default_rng(s)) for s in (1, 1, 2)
    )
    assert same(a, b)
    assert not same(a, c)
    # What is drawn for the instrument leaves the truth alone.
    np.testing.assert_array_equal(a.euler, c.euler)


def test_no_noise_is_no_error():
    nothing = ImuSpec.from_dict({"gyro": {}, "accelerometer": {}})
    made = simulate(vehicle(), SITE, 5.0, 100.0, nothing, np.random.default_rng(1))
    clean = simulate(vehicle(), SITE, 5.0, 100.0)
    np.testing.assert_allclose(made.record.dtheta, clean.record.dtheta, atol=1e-18)
    np.testing.assert_allclose(made.record.dvel, clean.record.dvel, atol=1e-15)


# -- refusals --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("duration", "rate"),
    [(0.0, 100.0), (-1.0, 100.0), (1.0, 0.0), (1.0, -5.0), (np.nan, 100.0), (1.0, np.inf),
     (0.001, 100.0)],
)  # fmt: skip
def test_a_record_of_nothing(duration, rate):
    with pytest.raises(InputError, match="at least one sample"):
        simulate(Static(), SITE, duration, rate)


def test_hidden_random_numbers_are_refused():
    with pytest.raises(InputError, match="needs a random generator"):
        simulate(Static(), SITE, 1.0, 100.0, FOG)


def test_a_bias_of_the_wrong_shape():
    for key in ("gyro_bias", "accel_bias"):
        with pytest.raises(InputError, match="bias"):
            simulate(Static(), SITE, 1.0, 100.0, **{key: np.zeros(2)})


def test_a_tilted_start_is_in_degrees():
    made = simulate(Static(359.0, 10.0, -20.0), SITE, 1.0)
    np.testing.assert_allclose(made.euler[0] / DEG, [1.0, 10.0, -20.0], atol=1e-12)


def test_a_meridian_over_the_pole_is_as_on_a_map():
    """Position, velocity and attitude in the Earth's axes go straight on."""
    made = simulate(Route([Manoeuvre(20.0)], speed=20.0), Site(89.9990, 170.0), 20.0, 10.0)
    t = made.truth
    assert np.all(np.abs(t.lat) <= np.pi / 2)
    assert set(np.degrees(t.lon).round(6)) == {170.0, -10.0}
    place = geocentric(t.lat, t.lon, t.height)
    step = np.diff(place, axis=0)
    assert np.ptp(np.linalg.norm(step, axis=1)) < 1e-6
    sl, cl, so, co = np.sin(t.lat), np.cos(t.lat), np.sin(t.lon), np.cos(t.lon)
    north = np.column_stack([-sl * co, -sl * so, cl])
    # The vehicle goes straight on: 400 m bend its velocity by 6e-5.
    assert np.ptp(north * t.v_n[:, 1:2], axis=0).max() < 2e-3
    ahead = rotate(t.quat_nb, np.broadcast_to([0.0, 1.0, 0.0], (len(t), 3)))
    np.testing.assert_allclose(ahead * 20.0, t.v_n, atol=1e-9)
    assert np.sign(t.v_n[[0, -1], 1]).tolist() == [1.0, -1.0]
