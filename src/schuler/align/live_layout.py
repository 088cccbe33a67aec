"""What the saved state of a live alignment may hold, checked before it is taken up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from schuler.io.packets import LARGEST_TIME
from schuler.kernels.intake import LARGEST
from schuler.kernels.layout import (
    COUNT,
    ArrayLayout,
    Entries,
    LayoutError,
    check_aligner,
    check_arrays,
    check_intake,
)

__all__ = ["LayoutError", "check_state"]

Array = NDArray[np.float64]

_SAMPLE = (
    Entries(0, 0, 0.0, COUNT, True),
    Entries(1, 1, -LARGEST_TIME, LARGEST_TIME),
    Entries(2, 7, -LARGEST, LARGEST),
)
_LAYOUT = {
    "held": ArrayLayout(((0, 4096), (8, 8)), _SAMPLE),
    "before": ArrayLayout(((0, 3), (8, 8)), _SAMPLE),
    "order": ArrayLayout(
        ((5, 5),), (Entries(0, 0, -1.0, COUNT, True), Entries(1, 4, 0.0, COUNT, True))
    ),
}


def check_state(arrays: Mapping[str, Array], depth: int) -> None:
    """Check the arrays of a saved state, each alone and against one another.

    Parameters
    ----------
    arrays : dict of str to array
    depth : int
        Samples that may be held.

    Raises
    ------
    LayoutError
        Saying which array breaks the layout, and where.
    """
    check_intake(arrays)
    check_aligner(arrays)
    check_arrays(arrays, _LAYOUT)
    held, before, expected = arrays["held"], arrays["before"], arrays["order"][0]
    samples, last = arrays["tracker"][41], float(arrays["intake"][3])
    numbers = held[:, 0]
    if len(held) > depth or len(np.unique(numbers)) < len(held):
        raise LayoutError("array 'held' has more samples than are held, or one twice")
    if len(held) and numbers.min() < expected:
        raise LayoutError("array 'held' has samples that came long ago")
    if np.any(np.diff(before[:, :2], axis=0) <= 0) or (
        len(before) and before[-1, 0] + 1 > expected
    ):
        raise LayoutError("array 'before' is out of order")
    if arrays["intake_nominal"][0] and not (
        samples and len(before) and last == before[-1, 1] == arrays["tracker_tail"][0, -1]
    ):
        raise LayoutError("the arrays end at different times")
    if not arrays["intake_nominal"][0] and samples:
        raise LayoutError("array 'tracker' has samples that the intake did not give")
