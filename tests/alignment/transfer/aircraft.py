"""An aircraft with a pod: the slave's record and its master's navigation, simulated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG
from schuler.earth import Site, radii
from schuler.motion import Lines, Manoeuvre, Route, Sum, Sway
from schuler.sensors import draw
from schuler.sensors.noise import Instrument
from schuler.simulation import simulate
from schuler.trajectory import Trajectory
from tests.alignment.moving.routes import noisy

SITE = Site(40.0, 10.0, 3000.0)
LEVER = np.array([0.6, 3.3, -0.4])
DELAY = 0.02
ATTITUDE, VELOCITY = 1e-4, 0.02
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


def rock():
    """Wing rock of 12 deg at 0.35 Hz."""
    sway = Sway(lines=(Lines("roll", [0.35], [12.0], [0.0]),))
    return Sum((Route([], heading=40.0, speed=200.0), sway))


def turn():
    """A coordinated turn of 45 deg within 20 s."""
    return Route([Manoeuvre(20.0, turn=45.0)], heading=40.0, speed=200.0, coordinated=True)


def straight():
    """Steady and straight."""
    return Route([], heading=40.0, speed=200.0)


PATHS = {"rock": (rock, 10.0), "turn": (turn, 20.0), "straight": (straight, 20.0)}


@cache
def clean(path: str, length: float):
    """Return a simulation of the pod without errors."""
    return simulate(PATHS[path][0](), SITE, length, 100.0, name="pod")


def bend(rng, count, step, sigma, time):
    """Return a critically damped second-order process (count, 3) by its exact transition."""
    b = 2.146 / time
    e = np.exp(-b * step)
    phi = e * np.array([[1.0 + b * step, step], [-b * b * step, 1.0 - b * step]])
    steady = np.diag([sigma**2, (b * sigma) ** 2])
    root = np.linalg.cholesky(steady - phi @ steady @ phi.T)
    x = np.sqrt(np.diag(steady))[:, None] * rng.standard_normal((2, 3))
    out = np.empty((count, 3))
    for k in range(count):
        out[k] = x[0]
        x = phi @ x + root @ rng.standard_normal((2, 3))
    return out


def master_of(made, mounting, *, rng=None, flexure=0.0, every=10, lever=LEVER, delay=DELAY):
    """Return what a master says of a pod's truth, late, with noise where a generator is given."""
    truth = made.truth
    k = np.arange(10, len(truth.time) - 10, every)
    q = truth.quat_nb
    mat = quat_to_matrix(q[k])

    def arm(j):
        return np.einsum("iab,b->ia", quat_to_matrix(q[j]), lever)

    swing = (8.0 * (arm(k + 1) - arm(k - 1)) - (arm(k + 2) - arm(k - 2))) / (12.0 * made.step)
    v, place = truth.v_n[k] + swing, np.einsum("iab,b->ia", mat, lever)
    quat = q[k]
    if flexure:
        angle = bend(rng, len(k), every * made.step, flexure, 0.5)
        quat = multiply(quat, rotvec_to_quat(-angle))
    quat = np.asarray(multiply(quat, np.asarray(mounting) * CONJUGATE))
    if rng is not None:
        quat = multiply(rotvec_to_quat(ATTITUDE * rng.standard_normal((len(k), 3))), quat)
        v = v + VELOCITY * rng.standard_normal(v.shape)
        place = place + 0.5 * rng.standard_normal(place.shape)
    meridian, transverse = radii(truth.lat[k])
    return Trajectory(
        truth.time[k] + delay, truth.lat[k] + place[:, 1] / (meridian + truth.height[k]),
        truth.lon[k] + place[:, 0] / ((transverse + truth.height[k]) * np.cos(truth.lat[k])),
        truth.height[k] + place[:, 2], v, np.asarray(quat), name="master",
    )  # fmt: skip


def mounted(rng):
    """Return a mounting of 1 deg about each axis, 1 sigma."""
    return rotvec_to_quat(1.0 * DEG * rng.standard_normal(3))


def with_errors(made, spec, rng):
    """Return the record of a simulation as an instrument would have it."""
    gyro, accelerometer = draw(spec.gyro, rng), draw(spec.accelerometer, rng)
    dtheta, dvel = made.record.dtheta.copy(), made.record.dvel.copy()
    Instrument(spec, gyro, accelerometer, made.step, rng).corrupt(dtheta, dvel)
    return replace(made.record, dtheta=dtheta, dvel=dvel)


def case(path, seed, *, flexure=0.0, length=None, **options):
    """Return record, master, truth and mounting of a run."""
    made = clean(path, length or PATHS[path][1])
    rng = np.random.default_rng(seed)
    mounting = mounted(rng)
    record = noisy(made, "tactical-fog", rng)
    return record, master_of(made, mounting, rng=rng, flexure=flexure, **options), made, mounting


def errors(fix, made, mounting):
    """Return phi, the mounting's error (slave axes), those of lever and delay."""
    k = int(np.argmin(np.abs(made.truth.time - fix.time)))
    assert abs(made.truth.time[k] - fix.time) < 1e-6
    phi = -quat_to_rotvec(multiply(fix.quat_nb, made.truth.quat_nb[k] * CONJUGATE))
    wrong = quat_to_rotvec(multiply(mounting * CONJUGATE, fix.mounting))
    return phi, wrong, fix.lever - LEVER, fix.delay[0] - DELAY
