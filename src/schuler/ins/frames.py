"""The wander frame, in which the filter navigates, and East-North-Up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import nearest_quat, quat_to_matrix

__all__ = ["east_angle", "frame_quaternion", "to_east_north_up"]

Array = NDArray[np.float64]


def east_angle(quat_ne: ArrayLike) -> tuple[Array, Array, Array]:
    """Return latitude, longitude, and the angle from the frame's x axis to east, rad.

    Parameters
    ----------
    quat_ne : (k, 4) array_like
        From the wander frame to the Earth's axes.
    """
    frame = quat_to_matrix(np.asarray(quat_ne, np.float64))
    up = frame[:, :, 2]
    lat, lon = np.arctan2(up[:, 2], np.hypot(up[:, 0], up[:, 1])), np.arctan2(up[:, 1], up[:, 0])
    east = np.column_stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)])
    x, y = np.einsum("ia,ia->i", frame[:, :, 0], east), np.einsum("ia,ia->i", frame[:, :, 1], east)
    return lat, lon, np.arctan2(y, x)


def to_east_north_up(angle: float) -> Array:
    """Return the rotation (3, 3) from the wander frame to East-North-Up."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def frame_quaternion(lat: float, lon: float) -> Array:
    """Return q_n^e (4,) of East-North-Up at a latitude and longitude, rad."""
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    columns = [[-so, co, 0.0], [-sl * co, -sl * so, cl], [cl * co, cl * so, sl]]
    return nearest_quat(np.array(columns).T)
