"""The master's navigation as a source of measurements: rows, rates, and values between rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.earth import earth_rate, gravity, transport_rate
from schuler.errors import InputError
from schuler.trajectory import Trajectory

__all__ = [
    "MasterNoise",
    "MasterRates",
    "MasterState",
    "forces_of",
    "rates_of",
    "state_at",
    "thinned",
]

Array = NDArray[np.float64]

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])

_EVEN = 0.01
"""Part of an interval by which steps of the master may differ for its rate to be taken there."""

_STEP = 0.1
"""Rows of the master are so far apart at least where its rate is taken, s."""


@dataclass(frozen=True)
class MasterNoise:
    """1 sigma of what a master says, each axis, white from row to row.

    Parameters
    ----------
    attitude : float
        rad.
    velocity : float
        m/s.
    position : float
        m.

    Raises
    ------
    InputError
        If one of them is not a positive number.

    Examples
    --------
    >>> MasterNoise(attitude=1e-4, velocity=0.05)
    MasterNoise(attitude=0.0001, velocity=0.05, position=0.5)
    """

    attitude: float = 2e-4
    velocity: float = 0.02
    position: float = 0.5

    def __post_init__(self) -> None:
        for name in ("attitude", "velocity", "position"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"the master's {name} needs a positive 1-sigma, got {value}")


@dataclass(frozen=True, eq=False)
class MasterState:
    """A master at instants.

    Parameters
    ----------
    lat, lon, height : (n,) float64
        rad, m.
    v_n : (n, 3) float64
        m/s.
    quat_nb : (n, 4) float64
        Its own body to East-North-Up.
    """

    lat: Array
    lon: Array
    height: Array
    v_n: Array
    quat_nb: Array


def state_at(master: Trajectory, time: Array) -> MasterState:
    """Return the master at instants (n,), s; linear between rows, its ends beyond them."""
    t = master.time
    lat, height = (np.interp(time, t, x) for x in (master.lat, master.height))
    lon = np.interp(time, t, np.unwrap(master.lon))
    v_n = np.column_stack([np.interp(time, t, c) for c in master.known("v_n").T])
    quat = master.known("quat_nb")
    k = np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 2)
    part = np.clip((time - t[k]) / (t[k + 1] - t[k]), 0.0, 1.0)
    step = quat_to_rotvec(multiply(quat[k] * _CONJUGATE, quat[k + 1]))
    between = np.asarray(multiply(quat[k], rotvec_to_quat(part[:, None] * step)))
    return MasterState(lat, (lon + np.pi) % (2.0 * np.pi) - np.pi, height, v_n, between)


@dataclass(frozen=True, eq=False)
class MasterRates:
    """Rates of a master at some of its rows, its own body axes.

    Parameters
    ----------
    rows : (n,) int64
    against_n, inertial, change : (n, 3) float64
        Against n, against inertial space, and the rate of change of the former; rad/s, rad/s^2.
    step : float
        Between rows that were compared, s: with a sigma s of the attitude that of a rate is 0.95 s
        over the step.
    """

    rows: NDArray[np.int64]
    against_n: Array
    inertial: Array
    change: Array
    step: float


def rates_of(master: Trajectory) -> MasterRates:
    """Return rates by central differences of the attitude, of fourth order.

    Rows without two even steps on each side have none. Steps are a tenth of a second at least.
    """
    t, quat = master.time, master.known("quat_nb")
    m = max(1, round(_STEP / float(np.median(np.diff(t)))))
    k = np.arange(2 * m, len(t) - 2 * m)
    step = (t[k + 2 * m] - t[k - 2 * m]) / 4.0
    even = np.ones(len(k), bool)
    for j in (-2, -1, 1, 2):
        even &= np.abs(t[k + j * m] - t[k] - j * step) < _EVEN * step
    k, step = k[even], step[even][:, None]
    back = quat[k] * _CONJUGATE

    def turned(j: int) -> Array:
        return quat_to_rotvec(multiply(back, quat[k + j * m]))

    one, other = turned(1), turned(-1)
    rate = (8.0 * (one - other) - (turned(2) - turned(-2))) / (12.0 * step)
    v = master.known("v_n")[k]
    frame = earth_rate(master.lat[k]) + transport_rate(
        master.lat[k], master.height[k], v[:, 0], v[:, 1]
    )
    inertial = rate + np.einsum("iab,ia->ib", quat_to_matrix(quat[k]), frame)
    typical = float(np.median(step)) if len(k) else _STEP
    return MasterRates(k, rate, inertial, (one + other) / step**2, typical)


def forces_of(master: Trajectory) -> tuple[Array, Array]:
    """Return mean rate and specific force between rows, body axes at the rows' middle, (n, 3)."""
    t, quat, v = master.time, master.known("quat_nb"), master.known("v_n")
    dt = np.diff(t)[:, None]
    step = quat_to_rotvec(multiply(quat[:-1] * _CONJUGATE, quat[1:]))
    middle = quat_to_matrix(np.asarray(multiply(quat[:-1], rotvec_to_quat(0.5 * step))))
    lat, height = master.lat[:-1], master.height[:-1]
    force = np.diff(v, axis=0) / dt
    force[:, 2] += gravity(lat, height)
    # What Coriolis takes is a thousandth of gravity at the speed of an aircraft.
    return step / dt, np.einsum("iab,ia->ib", middle, force)


def thinned(time: Array, rate: float) -> NDArray[np.int64]:
    """Return rows that follow each other at no more than a rate, Hz."""
    least = (1.0 - 1e-6) / rate
    kept, last = [], -np.inf
    for k, now in enumerate(time):
        if now - last >= least:
            kept.append(k)
            last = now
    return np.array(kept, np.int64)
