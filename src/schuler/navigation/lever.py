"""Another point of the body: where an antenna or the centre of the ship is, and how fast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import multiply as qmul
from schuler.attitude import quat_to_rotvec, rotate
from schuler.earth import moved
from schuler.errors import InputError
from schuler.trajectory import Trajectory

__all__ = ["at_lever", "rates"]

Array = NDArray[np.float64]


def at_lever(path: Trajectory, lever: ArrayLike, rate_n: ArrayLike | None = None) -> Trajectory:
    """Return the path of a point at a lever arm from the IMU.

    Its velocity is v + w_nb x l. The attitude stays that of the body; the path has no variances,
    for they need the correlation of attitude and position.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    lever : (3,) array_like
        From the IMU, in body axes (right, forward, up), m.
    rate_n : (n, 3) array_like, optional
        The body's rate against the level frame, rad/s; by default `rates` of the path, which wants
        every sample of a fast motion.

    Raises
    ------
    InputError
        For a lever that is not three finite numbers, or a path of fewer than three rows or
        without velocity or attitude.
    """
    l_b = np.asarray(lever, np.float64)
    if l_b.shape != (3,) or not np.all(np.isfinite(l_b)):
        raise InputError(f"a lever arm is three finite numbers in m, got {lever!r}")
    q, v_n = path.known("quat_nb"), path.known("v_n")
    w = rates(path) if rate_n is None else np.asarray(rate_n, np.float64)
    l_n = rotate(q, np.broadcast_to(l_b, (len(path), 3)))
    lat, lon, height = moved(path.lat, path.lon, path.height, l_n)
    return Trajectory(path.time, lat, lon, height, v_n + np.cross(w, l_n), q, name=path.name)


def rates(path: Trajectory) -> Array:
    """Return the body's rate against the level frame (n, 3), rad/s, by centred differences.

    Raises
    ------
    InputError
        For a path of fewer than three rows, or without attitude.
    """
    if len(path) < 3:
        raise InputError("a lever arm's velocity needs three rows of a path at least")
    q = path.known("quat_nb")
    back = q[:-1] * [1.0, -1.0, -1.0, -1.0]
    step = quat_to_rotvec(qmul(q[1:], back)) / np.diff(path.time)[:, None]
    return np.concatenate([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
