"""What the saved state of a live alignment may hold, checked before it is taken up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from schuler.io.packets import LARGEST_FORCE, LARGEST_RATE, LARGEST_TIME
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


_OVERSHOOT = 4.0
"""Interpolation may go so many times beyond its neighbours."""


def check_state(arrays: Mapping[str, Array], depth: int, kind: str) -> None:
    """Check the arrays of a saved state, each alone and against one another.

    Parameters
    ----------
    arrays : dict of str to array
    depth : int
        Samples that may be held.
    kind : {"rates", "mean-rates", "increments"}
        What the values of samples are.

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
    # The intake holds rows back until those after them show that they are good.
    done = float(arrays["intake"][79])
    if arrays["intake_nominal"][0] and not (
        samples and len(before) and last == before[-1, 1] and done == arrays["tracker_tail"][0, -1]
    ):
        raise LayoutError("the arrays end at different times")
    if not arrays["intake_nominal"][0] and samples:
        raise LayoutError("array 'tracker' has samples that the intake did not give")
    _check_samples(arrays, kind)


def _check_samples(arrays: Mapping[str, Array], kind: str) -> None:
    """Check that samples that are not aligned yet are those of a stationary vehicle."""
    most = _OVERSHOOT
    if kind == "increments":
        times = np.concatenate([arrays["intake_times"], np.sort(arrays["held"][:, 1])])
        nominal = float(arrays["intake_nominal"][0])
        if not nominal and len(times) < 2:
            return
        most *= nominal or float(np.median(np.abs(np.diff(times))))
    last = arrays["intake"][5:17].reshape(2, 6)
    rows = np.vstack([
        arrays["held"][:, 2:], arrays["before"][:, 2:], arrays["intake_rows"], last,
        arrays["intake_pending"][:, 2:8], arrays["intake_history"],
    ])  # fmt: skip
    if np.any(np.abs(rows[:, :3]) > most * LARGEST_RATE) or np.any(
        np.abs(rows[:, 3:]) > most * LARGEST_FORCE
    ):
        raise LayoutError("a sample has a value that no stationary vehicle gives")
