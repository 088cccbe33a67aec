"""A mounting of any size, from what both units feel: the directions of force and rate.

Both are vectors that the master has in its axes and the slave in its own (Wahba's problem). Gravity
shows two angles at once; the third needs a rate about a level axis, or an acceleration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.transfer.master import forces_of
from schuler.attitude import nearest_quat, quat_to_matrix
from schuler.constants import STANDARD_GRAVITY
from schuler.record import ImuRecord
from schuler.trajectory import Trajectory

__all__ = ["coarse_mounting"]

Array = NDArray[np.float64]

_RATE = 0.02
"""A rate of this size (rad/s) counts as much as gravity."""

_NEAR = 0.02
"""Weight of what was known before, beside gravity's: it decides where the motion shows nothing."""

_LEAST_INTERVAL = 0.2
"""Rows of the master are taken so far apart, s: noise of its velocity is then small beside g."""


def coarse_mounting(record: ImuRecord, master: Trajectory, delay: float, known: Array) -> Array:
    """Return the quaternion (4,) from the slave's body to the master's.

    Parameters
    ----------
    record : ImuRecord
    master : Trajectory
    delay : float
        A row of the master stamped t is valid at t - delay, s.
    known : (4,) float64
        What was thought of it before.
    """
    due = master.time - delay
    inside = np.flatnonzero((due >= record.start) & (due <= record.end))
    step = max(1, int(np.ceil(_LEAST_INTERVAL / float(np.median(np.diff(master.time))))))
    rows = inside[::step]
    before = quat_to_matrix(known)
    if len(rows) < 3:
        return known
    rate, force = forces_of(master.rows(rows))
    edges = np.concatenate([[record.start], record.time])
    span = np.diff(due[rows])[:, None]

    def mean(increments: Array) -> Array:
        total = np.vstack([np.zeros(3), np.cumsum(increments, axis=0)])
        at = np.column_stack([np.interp(due[rows], edges, c) for c in total.T])
        return np.asarray(np.diff(at, axis=0) / span)

    measured_force, turn = mean(record.dvel), mean(record.dtheta)
    gravity = STANDARD_GRAVITY**2
    pairs = (
        force.T @ measured_force / gravity + rate.T @ turn / _RATE**2 + _NEAR * len(span) * before
    )
    u, _, vt = np.linalg.svd(pairs)
    return nearest_quat(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)
