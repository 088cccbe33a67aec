"""Another point of the body: where an antenna or the centre of the ship is, and how fast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import multiply as qmul
from schuler.attitude import quat_to_rotvec, rotate, skew
from schuler.earth import moved
from schuler.errors import InputError
from schuler.trajectory import Trajectory

__all__ = ["at_lever", "rates"]

Array = NDArray[np.float64]


def at_lever(
    path: Trajectory, lever: ArrayLike, rate_n: ArrayLike | None = None,
    covariances: ArrayLike | None = None,
) -> Trajectory:  # fmt: skip
    """Return the path of a point at a lever arm from the IMU.

    Its velocity is v + w_nb x l. The attitude stays that of the body. The path has variances where
    covariances are given, for they need the correlation of attitude, velocity and position.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    lever : (3,) array_like
        From the IMU, in body axes (right, forward, up), m.
    rate_n : (n, 3) array_like, optional
        The body's rate against the level frame, rad/s; by default `rates` of the path, which needs
        every sample of a fast motion.
    covariances : (n, 9, 9) array_like, optional
        Of phi (rad), velocity (m/s) and position (m) of the path, East-North-Up.

    Raises
    ------
    InputError
        For a lever that is not three finite numbers, or a path of fewer than three rows or
        without velocity or attitude.

    Examples
    --------
    >>> antenna = at_lever(driven, [0.0, 0.0, 1.5])
    >>> round(float((antenna.height - driven.height)[0]), 2)
    1.5
    """
    l_b = np.asarray(lever, np.float64)
    if l_b.shape != (3,) or not np.all(np.isfinite(l_b)):
        raise InputError(f"a lever arm is three finite numbers in m, got {lever!r}")
    q, v_n = path.known("quat_nb"), path.known("v_n")
    w = rates(path) if rate_n is None else np.asarray(rate_n, np.float64)
    l_n = rotate(q, np.broadcast_to(l_b, (len(path), 3)))
    lat, lon, height = moved(path.lat, path.lon, path.height, l_n)
    variances = None
    if covariances is not None:
        variances = path.known("variances").copy()
        variances[:, :9] = _variances(np.asarray(covariances, np.float64), w, l_n)
    return Trajectory(
        path.time, lat, lon, height, v_n + np.cross(w, l_n), q, variances, name=path.name
    )


def _variances(covariances: Array, w: Array, l_n: Array) -> Array:
    """Return the variances (n, 9) of phi, and of velocity and position at the end of a lever arm.

    With C_found = (I - [phi x]) C_true the arm is off by l x phi, its velocity by w x (l x phi).
    """
    arm, rate = skew(l_n), skew(w)
    jacobian = np.tile(np.eye(9), (len(l_n), 1, 1))
    jacobian[:, 3:6, :3] = rate @ arm
    jacobian[:, 6:9, :3] = arm
    return np.asarray(np.einsum("nij,njk,nik->ni", jacobian, covariances, jacobian, optimize=True))


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
