"""Five routes on which alignment in motion is measured, and fixes of their antenna."""

from __future__ import annotations

import numpy as np

from schuler.aiding import BodySpeed, GnssFixes
from schuler.attitude import quat_to_matrix
from schuler.earth import Site, radii
from schuler.motion import Lines, Manoeuvre, Route, Sum, Sway
from schuler.simulation import simulate

SITE = Site(40.0, 10.0, 100.0)

_SPEEDS = (3, -5, 4, -3, 2, -4, 5, -2, 3, -4, 2, 1)
_TURNS = (90, -60, 90, 30, -90, -45, 90, -90, 60, -90, 45, 90)


def car(lever=(0.0, 0.0, 0.0)):
    """Speed, course and slope change in turn."""
    legs = []
    for speed, turn in zip(_SPEEDS, _TURNS, strict=True):
        legs += [
            Manoeuvre(12.0, speed=speed), Manoeuvre(8.0, turn=turn), Manoeuvre(8.0, climb=1.0),
            Manoeuvre(6.0, climb=-1.0),
        ]  # fmt: skip
    return Route(legs, heading=40.0, speed=12.0, lever=lever)


def straight():
    """Steady and straight."""
    return Route([], heading=40.0, speed=15.0)


def accel():
    """Straight, faster and slower."""
    legs = [Manoeuvre(10.0, speed=6.0), Manoeuvre(10.0, speed=-6.0), Manoeuvre(10.0)]
    return Route(10 * legs, heading=40.0, speed=10.0)


def plane():
    """Coordinated turns, up and down."""
    legs = [
        Manoeuvre(20.0, turn=60.0, climb=1.5), Manoeuvre(10.0),
        Manoeuvre(20.0, turn=-60.0, climb=-1.5), Manoeuvre(10.0),
    ]  # fmt: skip
    return Route(6 * legs, heading=40.0, speed=70.0, coordinated=True)


def ship():
    """Slow turns in a swell."""
    legs = [
        Manoeuvre(60.0), Manoeuvre(60.0, turn=20.0), Manoeuvre(60.0), Manoeuvre(60.0, turn=-30.0),
        Manoeuvre(60.0),
    ]  # fmt: skip
    lines = (
        Lines("roll", [0.11, 0.13, 0.09], [3.0, 2.0, 1.5], [0.3, 1.0, 2.0]),
        Lines("pitch", [0.16, 0.14], [1.0, 0.7], [0.2, 2.0]),
        Lines("heading", [0.1], [0.8], [1.0]),
        Lines("up", [0.12], [0.8], [1.5]),
    )
    return Sum((Route(legs, heading=40.0, speed=8.0), Sway(lines=lines)))


def walker(rng, legs=60):
    """A phone in a hand: steady walking with turns, and the sway of each step."""
    way = [Manoeuvre(3.0)]
    for _ in range(legs):
        turn = float(rng.choice([90, -90, 45, -60, 180]))
        way += [Manoeuvre(rng.uniform(8.0, 25.0)), Manoeuvre(2.0, turn=turn)]
        if rng.random() < 0.3:
            way += [Manoeuvre(1.0, speed=-1.4), Manoeuvre(5.0), Manoeuvre(1.0, speed=1.4)]
    step = 1.8 + 0.2 * rng.random()

    def phases(count):
        return list(rng.uniform(0.0, 2.0 * np.pi, count))

    lines = (
        Lines("roll", [0.5 * step, step, 0.05], [3.0, 1.0, 4.0], phases(3)),
        Lines("pitch", [step, 0.07], [2.0, 5.0], phases(2)),
        Lines("heading", [0.5 * step, 0.03], [3.0, 8.0], phases(2)),
        Lines("up", [step], [0.025], phases(1)), Lines("east", [0.5 * step], [0.015], phases(1)),
        Lines("north", [step], [0.02], phases(1)),
    )  # fmt: skip
    return Sum((Route(way, heading=rng.uniform(0.0, 360.0), speed=1.4), Sway(lines=lines)))


ROUTES = {"car": car, "accel": accel, "straight": straight, "plane": plane, "ship": ship}


def truth_of(motion, length, rate=100.0):
    """Return a simulation without errors."""
    return simulate(motion, SITE, length, rate)


def fixes(made, *, lever=(0.0, 0.0, 0.0), sigma=3.0, v_sigma=0.1, rng=None, every=1.0, first=0.0,
          velocity=True):  # fmt: skip
    """Return fixes of the antenna of a simulation, with noise where a generator is given.

    The antenna's velocity needs the body's rate: it is the increments' mean about the instant.
    """
    truth, step = made.truth, made.step
    each = round(every / step)
    k = np.arange(round(first / step), len(truth.time), each)
    m = quat_to_matrix(truth.quat_nb[k])
    v, place = truth.v_n[k], [x[k] for x in (truth.lat, truth.lon, truth.height)]
    lever = np.asarray(lever, float)
    if np.any(lever):
        arm = np.einsum("iab,b->ia", m, lever)
        place = _moved(place, arm)

        # Central differences of a fourth-order formula: the truth is smooth between its rows.
        def at(j):
            return np.einsum("iab,b->ia", quat_to_matrix(truth.quat_nb[j]), lever)

        inside = (k >= 2) & (k < len(truth.time) - 2)
        k, v, place = k[inside], v[inside], [x[inside] for x in place]
        slope = (8.0 * (at(k + 1) - at(k - 1)) - (at(k + 2) - at(k - 2))) / (12.0 * step)
        v = v + slope
    if rng is not None:
        place = _moved(place, sigma * rng.standard_normal((len(k), 3)))
        v = v + v_sigma * rng.standard_normal((len(k), 3))
    return GnssFixes(
        truth.time[k], *place, sigma, v if velocity else None, v_sigma, lever=lever
    )  # fmt: skip


def _moved(place, off):
    lat, lon, height = place
    meridian, transverse = radii(lat)
    return [
        lat + off[:, 1] / (meridian + height),
        lon + off[:, 0] / ((transverse + height) * np.cos(lat)), height + off[:, 2],
    ]  # fmt: skip


def body_speed(made, *, sigma=0.05, rng=None, every=1.0):
    """Return the velocity over ground in body axes."""
    truth = made.truth
    k = np.arange(0, len(truth.time), round(every / made.step))
    v = np.einsum("iab,ia->ib", quat_to_matrix(truth.quat_nb[k]), truth.v_n[k])
    if rng is not None:
        v = v + sigma * rng.standard_normal(v.shape)
    return BodySpeed(truth.time[k], v, sigma, name="dvl")


def heading_error(found_quat, true_quat):
    """Return the rotation vector (east, north, up) from truth to what was found, rad."""
    from schuler.attitude import multiply, quat_to_rotvec

    back = np.asarray(true_quat) * [1.0, -1.0, -1.0, -1.0]
    return -quat_to_rotvec(multiply(found_quat, back))


def noisy(made, grade, rng):
    """Return the record of a simulation as an instrument of a grade would have it."""
    from dataclasses import replace

    from schuler.sensors import GRADES, draw
    from schuler.sensors.noise import Instrument

    spec = GRADES[grade]
    gyro, accelerometer = draw(spec.gyro, rng), draw(spec.accelerometer, rng)
    dtheta, dvel = made.record.dtheta.copy(), made.record.dvel.copy()
    Instrument(spec, gyro, accelerometer, made.step, rng).corrupt(dtheta, dvel)
    return replace(made.record, dtheta=dtheta, dvel=dvel)
