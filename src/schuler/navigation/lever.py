"""Another point of the body: where an antenna or the centre of the ship is, and how fast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import multiply as qmul
from schuler.attitude import quat_to_rotvec, rotate
from schuler.earth import radii
from schuler.errors import InputError
from schuler.trajectory import Trajectory

__all__ = ["at_lever"]

Array = NDArray[np.float64]


def at_lever(path: Trajectory, lever: ArrayLike) -> Trajectory:
    """Return the path of a point at a lever arm from the IMU.

    Its velocity is v + w_nb x l, with the body's rate against the level frame from the attitudes
    of neighbouring rows (centred differences: give every row for a fast motion).

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    lever : (3,) array_like
        From the IMU, in body axes (right, forward, up), m.

    Raises
    ------
    InputError
        For a lever that is not three finite numbers, or a path of fewer than three rows or
        without velocity or attitude.
    """
    l_b = np.asarray(lever, np.float64)
    if l_b.shape != (3,) or not np.all(np.isfinite(l_b)):
        raise InputError(f"a lever arm is three finite numbers in m, got {lever!r}")
    if len(path) < 3:
        raise InputError("a lever arm's velocity needs three rows of a path at least")
    q, t, v_n = path.known("quat_nb"), path.time, path.known("v_n")
    step = quat_to_rotvec(qmul(q[1:], q[:-1] * [1.0, -1.0, -1.0, -1.0])) / np.diff(t)[:, None]
    w = np.concatenate([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
    l_n = rotate(q, np.broadcast_to(l_b, (len(path), 3)))
    lat, lon, height = path.position.T
    rm, rn = radii(lat)
    return Trajectory(
        t,
        lat + l_n[:, 1] / (rm + height),
        lon + l_n[:, 0] / ((rn + height) * np.cos(lat)),
        height + l_n[:, 2],
        v_n + np.cross(w, l_n),
        q,
        name=path.name,
    )
