"""Attitude at the start of a record by the fixes of its first motion.

The coarse alignment of `schuler.in_motion` over the shortest span after the first motion that shows
the heading well: a start from which a filter converges. Rest before the motion shows the level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.attitude import nearest_quat, quat_to_matrix, rotvec_to_quat
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.in_motion.coarse import ENOUGH
from schuler.in_motion.start import Span
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec

__all__ = ["MotionStart", "motion_start"]

Array = NDArray[np.float64]

_LONGEST = 120.0
"""Longest span after the first motion, s: a start is all that is wanted."""

_GOOD = 2.0 * DEG
"""1-sigma of the heading at which a span is long enough."""

_STEP = 5.0
"""Spans end so long after the first motion, and later by so much, s."""

_REST = 60.0
"""More of a rest before the first motion is not looked at, s."""

_MOVES = 1.0
"""Speed of a vehicle that moves, m/s."""


@dataclass(frozen=True, eq=False)
class MotionStart:
    """An attitude at the start of a record.

    Parameters
    ----------
    quat_nb : (4,) float64
    sigma : (3,) float64
        1-sigma of phi (east, north, up), rad.
    span : float
        How long after the record's start it is found from, s.
    """

    quat_nb: Array
    sigma: Array
    span: float


def motion_start(
    record: ImuRecord, fixes: GnssFixes, spec: ImuSpec, gyro_bias: Array | None = None
) -> MotionStart:
    """Return the attitude at the start of a record.

    Parameters
    ----------
    record : ImuRecord
    fixes : GnssFixes
    spec : ImuSpec
        The instrument.
    gyro_bias : (3,) float64, optional
        What the gyros read at rest, rad/s.

    Raises
    ------
    InputError
        If the vehicle does not move, or no acceleration shows the heading.

    Examples
    --------
    >>> from schuler.navigation import motion_start
    >>> found = motion_start(drive, gnss, spec)
    >>> bool(found.sigma[2] < np.deg2rad(5.0))
    True
    """
    bias = np.zeros(3) if gyro_bias is None else gyro_bias
    time = np.asarray(fixes.time) - fixes.delay
    within = (time > record.start) & (time <= record.end)
    if within.sum() < 4:
        raise InputError(f"{fixes.name}: fewer than four fixes lie within the record")
    first = _first_motion(fixes.rows(within))
    begin = max(record.start, first - _REST)
    last = min(float(time[within][-1]), first + _LONGEST)
    best: MotionStart | None = None
    said = ""
    end = first
    while end < last:
        end = min(end + _STEP, last)
        try:
            found = _of_span(record, fixes, spec, bias, begin, end)
        except InputError as error:
            said = str(error)
            continue
        if best is None or found.sigma[2] < best.sigma[2]:
            best = found
        if best.sigma[2] < _GOOD:
            break
    if best is None or best.sigma[2] > ENOUGH:
        raise InputError(
            f"{said or fixes.name + ': nothing shows the heading'}; or take a later --start, or "
            "give the attitude at the start"
        )
    return best


def _first_motion(fixes: GnssFixes) -> float:
    """Return when the vehicle moves first, s."""
    time = np.asarray(fixes.time) - fixes.delay
    if fixes.v_n is not None:
        speed = np.linalg.norm(fixes.v_n, axis=1)
        moving = np.flatnonzero(speed > _MOVES)
        if not len(moving):
            raise InputError(
                f"{fixes.name}: the vehicle does not move (at most {speed.max():.2g} m/s): align "
                "at rest, or give the attitude at the start"
            )
        return float(time[moving[0]])
    way = fixes.local()
    far = np.linalg.norm(way - way[0], axis=1) > 5.0 * np.asarray(fixes.sigma).max() + 5.0
    if not far.any():
        raise InputError(
            f"{fixes.name}: the vehicle does not move beyond the fixes' sigma: align at rest, or "
            "give the attitude at the start"
        )
    return float(time[int(np.argmax(far))])


def _of_span(
    record: ImuRecord, fixes: GnssFixes, spec: ImuSpec, bias: Array, begin: float, end: float
) -> MotionStart:
    """Return the attitude at the record's start that a span of it shows."""
    from schuler.kernels.quat import quat_chain_many

    part = record.between(begin, end)
    k = int(np.searchsorted(np.asarray(fixes.time) - fixes.delay, part.start - 1e-9))
    lat, lon, height = (float(np.asarray(x)[k]) for x in (fixes.lat, fixes.lon, fixes.height))
    _, found = Span(part, fixes, spec, bias, Site(lat / DEG, lon / DEG, height)).coarse()
    variance = np.diag(found.covariance).copy()
    mat_nb = found.mat_nb
    before = record.between(None, part.start)
    if len(before):
        whole = bias + found.gyro_bias
        quat = np.empty((len(before) + 1, 4))
        quat[0] = [1.0, 0.0, 0.0, 0.0]
        quat_chain_many(rotvec_to_quat(before.dtheta - whole * before.dt[:, None]), quat)
        mat_nb = mat_nb @ quat_to_matrix(quat[-1]).T
        variance += (spec.gyro.bias * before.duration) ** 2
    return MotionStart(nearest_quat(mat_nb), np.sqrt(variance), part.end - record.start)
