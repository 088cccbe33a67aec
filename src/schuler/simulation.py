"""Motion and instrument to record and truth.

Truth takes another road than the navigator: rates and forces are exact functions of time, and
each increment is their integral by Gauss-Legendre quadrature, not the inverse of a strapdown
algorithm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.motion import Motion
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.sensors.draw import Imperfections, draw
from schuler.sensors.noise import Instrument, drop_out
from schuler.trajectory import Trajectory

__all__ = ["Simulation", "simulate"]

Array = NDArray[np.float64]

_GAUSS: tuple[Array, Array] = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = 0.5 + 0.5 * _GAUSS[0], 0.5 * _GAUSS[1]
"""Exact for polynomials of degree five inside one sampling interval."""

_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated record, its truth and the errors that were put in.

    Parameters
    ----------
    record : ImuRecord
    motion : Motion
    start, step : float
        Time of the start, and the sampling interval, s.
    v_n : (n + 1, 3) float64
        True velocity at the start and at each sample's time: east, north, up, m/s.
    position : (n + 1, 3) float64
        True latitude (rad), longitude (rad), height (m) along the route: latitude grows beyond 90
        deg where a meridian is followed over the pole, and longitude beyond 180; `truth` has both
        as on a map.
    gyro, accelerometer : Imperfections
        The constant errors of the instrument.

    Examples
    --------
    >>> made.record.rate, made.truth.quat_nb.shape
    (20.0, (1201, 4))
    """

    record: ImuRecord
    motion: Motion = field(repr=False)
    start: float
    step: float
    v_n: Array = field(repr=False)
    position: Array = field(repr=False)
    gyro: Imperfections = field(default_factory=Imperfections)
    accelerometer: Imperfections = field(default_factory=Imperfections)

    @cached_property
    def truth(self) -> Trajectory:
        """The true motion of the IMU at the start and at each sample's time."""
        n = len(self.v_n)
        parts = []
        for a in range(0, n, _CHUNK):
            k = np.arange(a, min(a + _CHUNK, n), dtype=np.float64)
            parts.append(self.motion.track(self.step * k).quat_nb)
        time = self.start + self.step * np.arange(n, dtype=np.float64)
        lat, lon, v_n, quat_nb = _over_the_pole(
            self.position[:, 0], self.position[:, 1], self.v_n, np.concatenate(parts)
        )
        return Trajectory(time, lat, lon, self.position[:, 2], v_n, quat_nb, name="truth")

    def euler_at(self, row: int) -> Array:
        """Return the true (psi, theta, gamma), rad, (3,), at a row (-1 is the end).

        Examples
        --------
        >>> np.degrees(made.euler_at(0)).round(3).tolist()[0]
        -30.0
        """
        k = row % len(self.v_n)
        return quat_to_euler(self.motion.track(np.array([self.step * k])).quat_nb[0])

    @property
    def euler(self) -> Array:
        """True (psi, theta, gamma), rad, at the start and at each sample's time, (n + 1, 3)."""
        return self.truth.euler

    @property
    def gyro_bias(self) -> Array:
        """The constant gyro bias that was put in, rad/s, (3,)."""
        return self.gyro.bias

    @property
    def accel_bias(self) -> Array:
        """The constant accelerometer bias that was put in, m/s^2, (3,)."""
        return self.accelerometer.bias

    def heading_deg(self, at: str = "end") -> float:
        """Return the true heading at the start or the end, deg."""
        psi = self.euler_at(0 if at == "start" else -1)[0]
        return float(psi_to_heading(psi)) / DEG


def simulate(
    motion: Motion,
    site: Site,
    duration: float,
    rate: float = 100.0,
    spec: ImuSpec | None = None,
    rng: np.random.Generator | None = None,
    *,
    start: float = 0.0,
    gyro_bias: Array | None = None,
    accel_bias: Array | None = None,
    gyro: Imperfections | None = None,
    accelerometer: Imperfections | None = None,
    temperature_rate: float = 0.0,
    name: str = "simulated",
) -> Simulation:
    """Simulate a record.

    Parameters
    ----------
    motion : Motion
    site : Site
        Where the IMU is at the start.
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
        Fixed biases, rad/s and m/s^2, in the place of drawn ones.
    gyro, accelerometer : Imperfections, optional
        Fixed constant errors, in the place of drawn ones.
    temperature_rate : float
        How fast the instrument warms, K/s.
    name : str
        Name of the record.

    Raises
    ------
    InputError
        For a bad duration or rate, or a specification without a generator.

    Examples
    --------
    >>> from schuler.motion import Static
    >>> made = sc.simulate(Static(heading=30.0), site, 60.0, 20.0, spec, np.random.default_rng(1))
    >>> round(made.heading_deg(), 6), len(made.record)
    (30.0, 1200)
    """
    if not hasattr(motion, "track"):
        raise InputError(
            f"motion: expected a motion, got {type(motion).__name__}; schuler.motion has them, as "
            "Static(heading=30.0)"
        )
    expect(site, Site, "site", "say schuler.Site(lat, lon, height)")
    if not (np.isfinite(duration) and np.isfinite(rate) and rate > 0 and duration * rate >= 1):
        raise InputError(
            f"duration and rate must make at least one sample, got {duration} s at {rate} Hz"
        )
    if spec is not None and rng is None:
        raise InputError("a specification needs a random generator: give rng")
    n = round(duration * rate)
    step = 1.0 / rate
    dtheta, dvel, v_n, position = _true_samples(motion, site, n, step)
    dt = np.full(n, step)
    if spec is not None and rng is not None:
        gyro = gyro or draw(spec.gyro, rng)
        accelerometer = accelerometer or draw(spec.accelerometer, rng)
    gyro, accelerometer = gyro or Imperfections(), accelerometer or Imperfections()
    if gyro_bias is not None:
        gyro = gyro.with_bias(gyro_bias)
    if accel_bias is not None:
        accelerometer = accelerometer.with_bias(accel_bias)
    instrument = Instrument(spec, gyro, accelerometer, step, rng, temperature_rate)
    instrument.corrupt(dtheta, dvel)
    time = start + step * np.arange(n + 1, dtype=np.float64)
    record = ImuRecord(time[1:], dt, dtheta, dvel, name=name)
    if spec is not None and spec.dropout and rng is not None:
        record = drop_out(record, spec.dropout, rng)
    return Simulation(record, motion, start, step, v_n, position, gyro, accelerometer)


def _over_the_pole(
    lat: Array, lon: Array, v_n: Array, quat_nb: Array
) -> tuple[Array, Array, Array, Array]:
    """Return latitude, longitude, velocity and attitude as on a map.

    Beyond a pole the axes of a route point south and west.
    """
    over = np.abs(lat) > 0.5 * np.pi
    if np.any(over):
        lat, lon, v_n, quat_nb = lat.copy(), lon.copy(), v_n.copy(), quat_nb.copy()
        lat[over] = np.copysign(np.pi, lat[over]) - lat[over]
        lon[over] += np.pi
        v_n[over, :2] *= -1.0
        # Half a turn about up, on the left: (0, 0, 0, 1) q.
        w, x, y, z = quat_nb[over].T
        quat_nb[over] = np.column_stack([-z, -y, x, w])
    beyond = np.abs(lon) > np.pi
    if np.any(beyond):
        lon = np.where(beyond, np.remainder(lon + np.pi, 2.0 * np.pi) - np.pi, lon)
    return lat, lon, v_n, quat_nb


def _true_samples(
    motion: Motion, site: Site, n: int, step: float
) -> tuple[Array, Array, Array, Array]:
    """Return the true angle and velocity increments (n, 3), velocity and position (n + 1, 3)."""
    from schuler.kernels.truth import BLOCK, ROWS, true_increments

    state = np.array([site.latitude, site.longitude, site.height, 0.0, 0.0])
    dtheta, dvel = np.empty((n, 3)), np.empty((n, 3))
    pose = np.empty((n + 1, 6))
    for a in range(0, n, _CHUNK):
        b = min(a + _CHUNK, n)
        track = motion.track(step * np.arange(a, b + 1, dtype=np.float64))
        frames = track.angles.shape[1]
        angles = np.ascontiguousarray(track.angles).reshape(b - a + 1, 3 * frames, 3)
        true_increments(
            state, step, np.ascontiguousarray(track.path), angles, track.levers,
            _NODES, _WEIGHTS, np.zeros((3, 6, BLOCK)), np.zeros((3 * frames, 6, BLOCK)),
            np.zeros((ROWS, BLOCK)), dtheta[a:b], dvel[a:b], pose[a : b + 1],
        )  # fmt: skip
    return dtheta, dvel, pose[:, :3], pose[:, 3:]
