"""Motion and instrument to record and truth.

Truth takes another road than the navigator: rates and forces are analytic functions of time, and
each increment is their integral by Gauss-Legendre quadrature, not the inverse of a strapdown
algorithm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import psi_to_heading, quat_to_matrix
from schuler.constants import DEG
from schuler.earth import Site, earth_rate, gravity, transport_rate
from schuler.errors import InputError
from schuler.motion import Motion
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.sensors.noise import corrupt

__all__ = ["Simulation", "simulate", "true_rate_and_force"]

Array = NDArray[np.float64]

_GAUSS: tuple[Array, Array] = np.polynomial.legendre.leggauss(4)
_NODES, _WEIGHTS = _GAUSS
"""Exact for polynomials of degree seven inside one sampling interval."""

_CHUNK = 20000


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated record and its truth.

    Parameters
    ----------
    record : ImuRecord
    euler : (n + 1, 3) float64
        True (psi, theta, gamma), rad, at the start and at each sample's time.
    gyro_bias, accel_bias : (3,) float64
        The constant biases that were put in, rad/s and m/s^2.
    """

    record: ImuRecord
    euler: Array
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    accel_bias: Array = field(default_factory=lambda: np.zeros(3))

    def heading_deg(self, at: str = "end") -> float:
        """Return the true heading at the start or the end, deg."""
        row = self.euler[0 if at == "start" else -1]
        return float(psi_to_heading(row[0])) / DEG


def true_rate_and_force(motion: Motion, site: Site, t: Array) -> tuple[Array, Array]:
    """Return the inertial rate and the specific force in body axes at times t (n,).

    w = C_n^b (w_ie + w_en) + w_nb and f = C_n^b (dv/dt + (2 w_ie + w_en) x v + g up).

    Returns
    -------
    (n, 3) float64, (n, 3) float64
        rad/s and m/s^2.
    """
    pose = motion.pose(t)
    up = pose.displacement[:, 2] + site.height
    lat = np.full(len(t), site.latitude)
    v = pose.velocity
    earth = earth_rate(lat)
    turn = transport_rate(lat, up, v[:, 0], v[:, 1])
    force = pose.acceleration + np.cross(2.0 * earth + turn, v)
    force[:, 2] += gravity(lat, up)
    c = quat_to_matrix(pose.quaternion)
    w = np.einsum("iab,ia->ib", c, earth + turn) + pose.body_rate()
    return w, np.einsum("iab,ia->ib", c, force)


def simulate(
    motion: Motion,
    site: Site,
    duration: float,
    rate: float = 100.0,
    spec: ImuSpec | None = None,
    rng: np.random.Generator | None = None,
    *,
    start: float = 0.0,
    gyro_bias: ArrayLike | None = None,
    accel_bias: ArrayLike | None = None,
    name: str = "simulated",
) -> Simulation:
    """Simulate a record of a standing vehicle.

    Parameters
    ----------
    motion : Motion
    site : Site
    duration : float
        s.
    rate : float
        Samples a second, Hz.
    spec : ImuSpec, optional
        The instrument; without it the increments are the truth.
    rng : numpy.random.Generator, optional
        Needed with a specification.
    start : float
        Time stamp of the start, s.
    gyro_bias, accel_bias : (3,) array_like, optional
        Fixed biases, rad/s and m/s^2; drawn from the specification when not given.
    name : str
        Name of the record.

    Raises
    ------
    InputError
        For a bad duration or rate, or a specification without a generator.
    """
    if not (np.isfinite(duration) and np.isfinite(rate) and rate > 0 and duration * rate >= 1):
        raise InputError(
            f"duration and rate must make at least one sample, got {duration} s at {rate} Hz"
        )
    if spec is not None and rng is None:
        raise InputError("a specification needs a random generator: give rng")
    n = round(duration * rate)
    step = 1.0 / rate
    dtheta, dvel = np.empty((n, 3)), np.empty((n, 3))
    for a in range(0, n, _CHUNK):
        k = np.arange(a, min(a + _CHUNK, n))
        t: Array = np.ravel((k[:, None] + 0.5 + 0.5 * _NODES) * step).astype(np.float64)
        w, f = true_rate_and_force(motion, site, t)
        for out, x in ((dtheta, w), (dvel, f)):
            out[k] = 0.5 * step * np.einsum("j,ijc->ic", _WEIGHTS, x.reshape(len(k), -1, 3))
    ends: Array = np.arange(n + 1, dtype=np.float64) * step
    euler = motion.pose(ends).euler
    time: Array = start + ends[1:]
    dt = np.full(n, step)
    biases = [np.zeros(3), np.zeros(3)]
    if spec is not None and rng is not None:
        gyro = corrupt(dtheta, dt, spec.gyro, rng, gyro_bias)
        accel = corrupt(dvel, dt, spec.accelerometer, rng, accel_bias)
        dtheta, dvel = gyro.increments, accel.increments
        biases = [gyro.bias, accel.bias]
    elif gyro_bias is not None or accel_bias is not None:
        for which, (x, b) in enumerate(((dtheta, gyro_bias), (dvel, accel_bias))):
            if b is not None:
                biases[which] = np.asarray(b, np.float64)
                x += biases[which] * step
    return Simulation(ImuRecord(time, dt, dtheta, dvel, name=name), euler, *biases)
