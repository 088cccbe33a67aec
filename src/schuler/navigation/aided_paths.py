"""Paths of an aided navigation, forward and smoothed, out of the wander frame of its filter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import multiply, rotvec_to_quat
from schuler.earth import moved
from schuler.ins import ErrorStateFilter
from schuler.ins.frames import east_angle
from schuler.kernels.states import ErrorStates
from schuler.trajectory import Trajectory

if TYPE_CHECKING:
    from schuler.ins import Smoothed

__all__ = ["error_variances", "in_level_axes", "path_in_level_axes", "smoothed_path"]

Array = NDArray[np.float64]


def in_level_axes(covariances: Array, quat_ne: Array) -> Array:
    """Return covariances (n, 9, 9) of the wander frame in East-North-Up."""
    _, _, angle = east_angle(quat_ne)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.tile(np.eye(9), (len(angle), 1, 1))
    for k in (0, 3, 6):
        turn[:, k, k], turn[:, k, k + 1], turn[:, k + 1, k], turn[:, k + 1, k + 1] = c, s, -s, c
    return np.asarray(turn @ covariances @ turn.transpose(0, 2, 1))


def _turned(vector: Array, angle: Array) -> Array:
    """Return vectors of the wander frame in East-North-Up."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([
        c * vector[:, 0] + s * vector[:, 1], -s * vector[:, 0] + c * vector[:, 1], vector[:, 2]
    ])  # fmt: skip


def path_in_level_axes(
    time: Array, quat: Array, v: Array, quat_ne: Array, height: Array, variances: Array,
    off: Array | None, name: str, covariance: Array | None = None,
) -> Trajectory:  # fmt: skip
    """Return a trajectory of what a filter had in its wander frame, less an error of position.

    `covariance` is that of the error states at the end, in that frame.
    """
    lat, lon, angle = east_angle(quat_ne)
    turn = np.zeros((len(time), 3))
    turn[:, 2] = -angle
    quat_nb = multiply(rotvec_to_quat(turn), quat)
    if off is not None:
        lat, lon, height = moved(lat, lon, height, -_turned(off, angle))
    lon = (lon + np.pi) % (2.0 * np.pi) - np.pi
    if covariance is not None:
        c, s = np.cos(angle[-1]), np.sin(angle[-1])
        turn = np.eye(len(covariance))
        for k in (0, 3, 6):
            turn[k : k + 2, k : k + 2] = [[c, s], [-s, c]]
        covariance = turn @ covariance @ turn.T
    return Trajectory(
        time, lat, lon, height, _turned(v, angle), quat_nb, variances, covariance, name=name
    )


def error_variances(flt: ErrorStateFilter, of: Any) -> Array:
    """Return the variances of the error states (n, 15) that a trajectory has."""
    out = ErrorStates.size
    groups = ("phi", "velocity", "position", "gyro_bias", "accelerometer_bias")
    table = np.column_stack([of(name) for name in groups])
    assert table.shape[1] == out
    return table


def smoothed_path(flt: ErrorStateFilter, smoothed: Smoothed, name: str) -> Trajectory:
    """Return the smoothed trajectory at the epochs."""
    history = smoothed.history
    quat, v = smoothed.quat_nb[1:], smoothed.v_n[1:]
    off = smoothed.error[1:, flt.layout["position"]]
    variances = error_variances(flt, lambda group: smoothed.sigma(group)[1:] ** 2)
    # At the end the smoother knows what the filter does.
    covariance = flt.covariance[: ErrorStates.size, : ErrorStates.size]
    return path_in_level_axes(
        history.time, quat, v, history.quat_ne, history.height, variances, off, name, covariance
    )
