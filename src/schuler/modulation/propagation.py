"""Errors of a navigator at rest, linear and exact in time: what a rotating IMU leaves after hours.

At rest the error equations have constant coefficients, so that the error at the end is a weighted
sum of the instrument's errors, turned into n: x(T) = sum of Phi(T - t) u(t) dt. The weights depend
on the latitude alone and the turned errors on the scheme alone; a heading only turns one against
the other. So all headings and latitudes cost one pass over the scheme. The vertical channel is
held (its error is not of this kind).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec
from schuler.constants import DEG, EARTH_RATE
from schuler.earth import gravity
from schuler.errors import InputError
from schuler.kernels.states import InstrumentErrors
from schuler.motion.rotation import Scheme
from schuler.navigation.error_model import error_matrix

__all__ = ["TriadErrors", "Turned", "end_errors", "error_series", "turned"]

Array = NDArray[np.float64]

STEP = 10.0
"""Spacing of the weights, s: a fortieth of a radian of the Schuler tone in its square."""

FINE = 0.5
"""Spacing at which a scheme's attitude is looked at, s."""


@dataclass(frozen=True, eq=False)
class TriadErrors:
    """What three gyros and three accelerometers do wrong: measured = true + M true + bias.

    Parameters
    ----------
    gyro_bias, accel_bias : (3,) array_like
        rad/s and m/s^2.
    gyro_matrix, accel_matrix : (3, 3) array_like
        Scale factor errors on the diagonal, misalignment beside it.
    earth_seen : bool
        Whether the gyros' matrix acts on the Earth's rate too, as it does; a computation that lets
        it act on the table's rate alone says False.

    Examples
    --------
    >>> TriadErrors(np.full(3, 5e-8), np.zeros(3)).gyro_bias.shape
    (3,)
    """

    gyro_bias: ArrayLike = (0.0, 0.0, 0.0)
    accel_bias: ArrayLike = (0.0, 0.0, 0.0)
    gyro_matrix: ArrayLike = field(default_factory=lambda: np.zeros((3, 3)))
    accel_matrix: ArrayLike = field(default_factory=lambda: np.zeros((3, 3)))
    earth_seen: bool = True

    def __post_init__(self) -> None:
        for name, shape in (("gyro_bias", (3,)), ("accel_bias", (3,)),
                            ("gyro_matrix", (3, 3)), ("accel_matrix", (3, 3))):  # fmt: skip
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise InputError(f"{name} must be finite and of shape {shape}, got {value.shape}")
            object.__setattr__(self, name, value)

    def row(self, walks: tuple[float, float] = (0.0, 0.0)) -> Array:
        """Return `InstrumentErrors` as the kernel `many` takes them, with the random walks."""
        out = InstrumentErrors.zeros()
        out.gyro_bias, out.gyro_matrix = np.asarray(self.gyro_bias), np.asarray(self.gyro_matrix)
        out.accel_bias, out.accel_matrix = (
            np.asarray(self.accel_bias),
            np.asarray(self.accel_matrix),
        )
        out.angle_walk, out.velocity_walk = walks
        return out.data


@dataclass(frozen=True, eq=False)
class Turned:
    """A scheme's attitude, integrated over steps; everything that a heading or latitude needs.

    Parameters
    ----------
    step : float
        s.
    attitude : (n, 3, 3) float64
        Integral of C (IMU to the table's base) over each step, s.
    fine : (n, m, 3, 3) float64
        C at the middles of the fine intervals.
    turn : (n, m, 3) float64
        The table's own turn over each fine interval, in the IMU's axes, rad.
    """

    step: float
    attitude: Array
    fine: Array = field(repr=False)
    turn: Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.attitude)

    @cached_property
    def _still(self) -> bool:
        return not np.any(self.turn)

    def driven(self, bias: Array, matrix: Array, base: Array, own: bool) -> Array:
        """Return the integrals over each step of C (bias + M (C^T base + table)), (n, 3).

        Parameters
        ----------
        bias : (3,), matrix : (3, 3)
        base : (3,) float64
            The true vector in the table's base.
        own : bool
            Whether the table's own rate is measured as well.
        """
        out = self.attitude @ bias
        if np.any(matrix):
            dt = self.step / self.fine.shape[1]
            seen = np.einsum("nmji,j->nmi", self.fine, base) * dt
            if own:
                seen = seen + self.turn
            out = out + np.einsum("nmij,jk,nmk->ni", self.fine, matrix, seen)
        return np.asarray(out)


def turned(scheme: Scheme, duration: float, step: float = STEP) -> Turned:
    """Integrate a scheme's attitude over steps.

    Raises
    ------
    InputError
        If the duration is shorter than two steps.

    Examples
    --------
    >>> from schuler.motion import named_scheme
    >>> whole = turned(named_scheme("four-position"), 600.0)
    >>> len(whole.attitude)
    60
    """
    n = round(duration / step)
    if n < 2:
        raise InputError(f"a propagation needs {2 * step:g} s at least, got {duration:g} s")
    m = round(step / FINE)
    h = step / m
    edge = scheme.quaternion(h * np.arange(n * m + 1))
    middle = scheme.quaternion(h * (np.arange(n * m) + 0.5))
    turn = quat_to_rotvec(multiply(edge[:-1] * [1.0, -1.0, -1.0, -1.0], edge[1:]))
    # The rotation vector is in both ends' axes; the middle's see it the same to third order.
    ends, mid = quat_to_matrix(edge), quat_to_matrix(middle)
    simpson = h / 6.0 * (ends[:-1] + 4.0 * mid + ends[1:])
    return Turned(
        step,
        simpson.reshape(n, m, 3, 3).sum(axis=1),
        mid.reshape(n, m, 3, 3),
        turn.reshape(n, m, 3),
    )


def _weights(lat: float, height: float, n: int, step: float) -> Array:
    """Return how the horizontal position at the end responds to u in each step, (n, 2, 5)."""
    from scipy.linalg import expm

    f = error_matrix(lat, height)
    whole, half = expm(f * step), expm(0.5 * f * step)
    out = np.empty((n, 2, 5))
    row = np.eye(7)[5:7]
    for k in range(n - 1, -1, -1):
        out[k] = (row @ half)[:, :5]
        row = row @ whole
    return out


def _yaw(heading: float) -> Array:
    c, s = np.cos(heading * DEG), np.sin(heading * DEG)
    # Clockwise from north.
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def end_errors(
    motion: Turned,
    errors: TriadErrors,
    latitudes: ArrayLike,
    headings: ArrayLike,
    height: float = 0.0,
) -> Array:
    """Return the position error at the end for each latitude and heading.

    Parameters
    ----------
    motion : Turned
        The scheme over the whole time.
    errors : TriadErrors
    latitudes, headings : (p,), (q,) array_like
        deg; heading of the table's base, clockwise from north.
    height : float
        m.

    Returns
    -------
    (p, q, 2) ndarray
        East and north, m.

    Examples
    --------
    >>> from schuler.motion import named_scheme
    >>> whole = turned(named_scheme("four-position"), 3600.0)
    >>> errors = TriadErrors([5e-8, 0.0, 0.0], np.zeros(3))
    >>> end_errors(whole, errors, [0.0, 48.0], [0.0]).shape
    (2, 1, 2)
    """
    lats = np.atleast_1d(np.asarray(latitudes, np.float64))
    heads = np.atleast_1d(np.asarray(headings, np.float64))
    out = np.empty((len(lats), len(heads), 2))
    n = len(motion)
    gyro_bias, accel_bias = np.asarray(errors.gyro_bias), np.asarray(errors.accel_bias)
    gyro_matrix, accel_matrix = np.asarray(errors.gyro_matrix), np.asarray(errors.accel_matrix)
    for i, lat in enumerate(lats * DEG):
        weights = _weights(lat, height, n, motion.step)
        g = float(gravity(lat, height))
        f = motion.driven(accel_bias, accel_matrix, np.array([0.0, 0.0, g]), own=False)
        spin = errors.earth_seen * EARTH_RATE * np.array([0.0, np.cos(lat), np.sin(lat)])
        # Earth's rate in the base is linear in cos and sin of the heading: three passes serve all.
        parts = [
            motion.driven(gyro_bias * (k == 2), gyro_matrix, base, own=k == 2)
            for k, base in enumerate((
                np.array([0.0, spin[1], 0.0]), np.array([-spin[1], 0.0, 0.0]),
                np.array([0.0, 0.0, spin[2]]),
            ))
        ]  # fmt: skip
        # w . x for each part, kept apart by component: (2, 3).
        a = [np.einsum("npj,nk->pjk", weights[:, :, :3], -part) for part in parts]
        b = np.einsum("npj,nk->pjk", weights[:, :, 3:], f)
        for j, head in enumerate(heads):
            yaw = _yaw(head)
            c, s = np.cos(head * DEG), np.sin(head * DEG)
            drive = c * a[0] + s * a[1] + a[2]
            out[i, j] = np.einsum("pjk,jk->p", drive, yaw) + np.einsum("pjk,jk->p", b, yaw[:2])
    return out


def error_series(
    motion: Turned, errors: TriadErrors, lat: float, heading: float, height: float = 0.0
) -> Array:
    """Return all error states after each step, (n + 1, 7), as in `STATES`; lat, heading in deg.

    Examples
    --------
    >>> from schuler.motion import named_scheme
    >>> whole = turned(named_scheme("fixed"), 600.0)
    >>> errors = TriadErrors([5e-8, 0.0, 0.0], np.zeros(3))
    >>> error_series(whole, errors, 48.0, 0.0).shape
    (61, 7)
    """
    from scipy.linalg import expm

    f = error_matrix(lat * DEG, height)
    whole, half = expm(f * motion.step), expm(0.5 * f * motion.step)
    yaw = _yaw(heading)
    spin = errors.earth_seen * EARTH_RATE * np.array([0.0, np.cos(lat * DEG), np.sin(lat * DEG)])
    up = np.array([0.0, 0.0, float(gravity(lat * DEG, height))])
    gyro = motion.driven(
        np.asarray(errors.gyro_bias), np.asarray(errors.gyro_matrix), yaw.T @ spin, own=True
    )
    accel = motion.driven(
        np.asarray(errors.accel_bias), np.asarray(errors.accel_matrix), up, own=False
    )
    u = np.zeros((len(motion), 7))
    u[:, :3] = -(gyro @ yaw.T)
    u[:, 3:5] = (accel @ yaw.T)[:, :2]
    u = u @ half.T
    out = np.zeros((len(motion) + 1, 7))
    for k in range(len(motion)):
        out[k + 1] = whole @ out[k] + u[k]
    return out
