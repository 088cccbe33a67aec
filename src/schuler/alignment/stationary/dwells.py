"""Dwells of a unit that is turned between them, from the attitude that the gyros carry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import multiply, quat_to_rotvec

__all__ = ["find_dwells"]

Array = NDArray[np.float64]

TURN = 0.03
"""Change of attitude from one stretch to the next (rad) that is a turn and no sway."""

SHORTEST = 4
"""Stretches without a turn that make a dwell."""

SWAY = 0.15
"""Attitude from the mean of several dwells (rad) within which the changes may be a sway."""

FEW = 3
"""Changes of attitude that may be turns on purpose though they are small; more are a sway."""


def find_dwells(q: Array, steady: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """Return the stretches [begin, end) between turns; none where the unit never rests.

    Parameters
    ----------
    q : (m, 4) float64
        Mean attitude over each stretch, as unit quaternions.
    steady : (m,) bool
        Whether the mean is one of like attitudes; a stretch within which the unit turns far is
        part of a turn.
    """
    back = q[:-1] * [1.0, -1.0, -1.0, -1.0]
    change = np.linalg.norm(quat_to_rotvec(multiply(back, q[1:])), axis=1)
    turned = np.asarray(change > TURN)
    moving = np.logical_not(steady)
    moving[:-1] |= turned
    moving[1:] |= turned
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(np.int8)))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    found = [(int(i), int(j)) for i, j in pairs if j - i >= SHORTEST]
    if np.count_nonzero(np.diff(moving.astype(np.int8)) > 0) > FEW:
        found = _without_sway(q, found)
    return tuple(found)


def _without_sway(q: Array, dwells: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the dwells, of which those that a mere sway parts are one."""
    if _near(q):
        return [(0, len(q))]
    out = dwells[:1]
    for begin, end in dwells[1:]:
        first = out[-1][0]
        if _near(q[first:end]):
            out[-1] = (first, end)
        else:
            out.append((begin, end))
    return out


def _near(q: Array) -> bool:
    """Say whether all attitudes (m, 4) are near their mean."""
    signs = np.where(q @ q[0] < 0.0, -1.0, 1.0)[:, None]
    mean = (q * signs).sum(axis=0)
    size = np.linalg.norm(mean)
    if size < 0.9 * len(q):
        return False
    back = np.broadcast_to(mean / size * [1.0, -1.0, -1.0, -1.0], q.shape)
    return bool(np.linalg.norm(quat_to_rotvec(multiply(back, q)), axis=1).max() < SWAY)
