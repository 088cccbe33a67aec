"""Attitude at the start of a record by the velocities of its GNSS fixes.

The gyros carry the body's axes from the start on; the velocity that the force makes in them,
beside the velocity that the antenna had, fixes their attitude (two series of vectors, both centred,
so that the velocity at the start need not be known). Over a minute the Earth's rotation does not
count beside what it is for: a start from which a filter converges.

Source: Wu and Pan (2013), optimisation-based alignment; Wahba's problem by Davenport's SVD.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.attitude import nearest_quat, quat_to_matrix, rotvec_to_quat, skew
from schuler.constants import DEG
from schuler.earth import gravity
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["MotionStart", "motion_start"]

Array = NDArray[np.float64]

_LONGEST = 120.0
"""Length of a span beyond which the Earth's rotation counts, s."""

_GOOD = 2.0 * DEG
"""1-sigma of the heading at which a span is long enough."""

_ENOUGH = 20.0 * DEG
"""1-sigma of the heading beyond which there is no start."""

_VELOCITY = 0.15
"""Least 1-sigma of a difference of velocities, m/s: vibration, and the delay of receivers."""

_FIRST, _STEP = 5.0, 5.0
"""Spans end so long after the first motion, and later by so much, s."""


@dataclass(frozen=True, eq=False)
class MotionStart:
    """An attitude at the start of a record.

    Parameters
    ----------
    quat_nb : (4,) float64
    sigma : (3,) float64
        1-sigma of phi (east, north, up), rad.
    span : float
        Length of record that it took, s.
    """

    quat_nb: Array
    sigma: Array
    span: float


def motion_start(
    record: ImuRecord, fixes: GnssFixes, gyro_bias: Array | None = None
) -> MotionStart:
    """Return the attitude at the start of a record.

    Parameters
    ----------
    record : ImuRecord
    fixes : GnssFixes
        With velocities.
    gyro_bias : (3,) float64, optional
        What the gyros read at rest, rad/s.

    Raises
    ------
    InputError
        If the fixes have no velocity, or no acceleration shows the heading.
    """
    from schuler.kernels.quat import quat_chain_many

    if fixes.v_n is None:
        raise InputError(
            f"{fixes.name}: an attitude is found from velocities, and the fixes have none; give "
            "the attitude at the start"
        )
    time = np.asarray(fixes.time) - fixes.delay
    v_n, speed = np.asarray(fixes.v_n), np.linalg.norm(fixes.v_n, axis=1)
    bias = np.zeros(3) if gyro_bias is None else gyro_bias
    begin = record.start
    inside = (time > begin) & (time <= record.end)
    time, v_n, speed = time[inside], v_n[inside], speed[inside]
    if len(time) < 4:
        raise InputError(f"{fixes.name}: fewer than four fixes lie within the record")
    moving = np.flatnonzero(speed > 1.0)
    if not len(moving):
        raise InputError(
            f"{fixes.name}: the vehicle does not move (at most {speed.max():.2g} m/s): align at "
            "rest, or give the attitude at the start"
        )
    first = float(time[moving[0]])
    last = min(float(time[-1]), first + _LONGEST)
    rows = record.between(None, last)
    quat = np.empty((len(rows) + 1, 4))
    quat[0] = [1.0, 0.0, 0.0, 0.0]
    quat_chain_many(rotvec_to_quat(rows.dtheta - bias * rows.dt[:, None]), quat)
    middle = quat_to_matrix(nearest_rows(quat[:-1] + quat[1:]))
    carried = np.concatenate([np.zeros((1, 3)), np.cumsum(
        np.einsum("iab,ib->ia", middle, rows.dvel), axis=0)])  # fmt: skip
    stamps = np.concatenate([[begin], rows.time])
    x = np.column_stack([np.interp(time, stamps, c) for c in carried.T])
    g = float(gravity(float(np.asarray(fixes.lat)[0]), float(np.asarray(fixes.height)[0])))
    y = v_n + np.array([0.0, 0.0, g]) * (time - begin)[:, None]
    best: MotionStart | None = None
    end = first + _FIRST
    while True:
        # Rest before the motion shows the level; a minute of it is enough.
        part = (time <= end) & (time >= first - 60.0)
        if part.sum() >= 6:
            found = _solved(x[part], y[part], end - begin)
            if best is None or found.sigma[2] < best.sigma[2]:
                best = found
            if best.sigma[2] < _GOOD:
                break
        if end >= last:
            break
        end = min(end + _STEP, last)
    if best is None or best.sigma[2] > _ENOUGH:
        raise InputError(
            f"{fixes.name}: the first {last - begin:.4g} s show no heading: nothing accelerates "
            "enough; brake or turn, take a later --start, or give the attitude at the start"
        )
    return best


def nearest_rows(quat: Array) -> Array:
    """Return rows of quaternions with length one."""
    return np.asarray(quat / np.linalg.norm(quat, axis=1)[:, None])


def _solved(x: Array, y: Array, span: float) -> MotionStart:
    """Return the rotation from x to y, both centred, with its 1-sigma."""
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    u, _, vt = np.linalg.svd(y.T @ x)
    turn = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    mat_nb = u @ turn @ vt
    left = y - x @ mat_nb.T
    sigma = max(float(np.sqrt(np.mean(left**2))), _VELOCITY)
    information = np.zeros((3, 3))
    for row in y:
        cross = skew(row)
        information += cross.T @ cross
    # Velocities of neighbouring fixes are filtered by the receiver: half of them count.
    covariance = 2.0 * sigma**2 * np.linalg.pinv(information, hermitian=True)
    return MotionStart(nearest_quat(mat_nb), np.sqrt(np.diag(covariance)), span)
