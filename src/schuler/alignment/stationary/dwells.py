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
    return tuple((int(i), int(j)) for i, j in pairs if j - i >= SHORTEST)
