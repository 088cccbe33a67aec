"""What the saved state of a live alignment may hold, checked before it is taken up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from schuler.io.packets import LARGEST_FORCE, LARGEST_RATE, LARGEST_TIME
from schuler.kernels.fields import COUNT, Field, View
from schuler.kernels.layout import LayoutError, check_arrays, check_intake, view_layout
from schuler.kernels.states import LARGEST, IntakeRow, IntakeState, TrackerState
from schuler.kernels.tracker_layout import check_aligner

__all__ = ["HeldSample", "LayoutError", "check_packets", "check_state"]

Array = NDArray[np.float64]


class HeldSample(View):
    """A sample that is not aligned yet."""

    number = Field(low=0.0, high=COUNT, whole=True)
    time = Field(low=-LARGEST_TIME, high=LARGEST_TIME)
    values = Field(6, low=-LARGEST, high=LARGEST)


class Order(View):
    """Where the packets are."""

    expected = Field(low=-1.0, high=COUNT, whole=True)
    counts = Field(4, low=0.0, high=COUNT, whole=True)


_LAYOUT = {
    "held": view_layout(HeldSample, (0, 4096)),
    "before": view_layout(HeldSample, (0, 3)),
    "order": view_layout(Order),
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
    check_packets(arrays, depth, kind)
    check_aligner(arrays)
    samples = TrackerState(arrays["tracker"]).samples
    before, intake = HeldSample(arrays["before"]), IntakeState(arrays["intake"])
    # The intake holds rows back until those after them show that they are good.
    nominal = arrays["intake_nominal"][0]
    if nominal and not (
        samples and len(before.data) and intake.last_time == before.time[-1]
        and intake.done_time == arrays["tracker_tail"][0, -1]
    ):  # fmt: skip
        raise LayoutError("the arrays end at different times")
    if not nominal and samples:
        raise LayoutError("array 'tracker' has samples that the intake did not give")


def check_packets(arrays: Mapping[str, Array], depth: int, kind: str) -> None:
    """Check what a saved state holds of samples that are not aligned yet.

    Parameters
    ----------
    arrays, depth, kind
        As of `check_state`.

    Raises
    ------
    LayoutError
        Saying which array breaks the layout, and where.
    """
    check_intake(arrays)
    check_arrays(arrays, _LAYOUT)
    held, before = HeldSample(arrays["held"]), HeldSample(arrays["before"])
    expected = Order(arrays["order"]).expected
    many, some = len(held.data), len(before.data)
    if many > depth or len(np.unique(held.number)) < many:
        raise LayoutError("array 'held' has more samples than are held, or one twice")
    if many and held.number.min() < expected:
        raise LayoutError("array 'held' has samples that came long ago")
    if (
        np.any(np.diff(before.number) <= 0) or np.any(np.diff(before.time) <= 0)
        or (some and before.number[-1] + 1 > expected)
    ):  # fmt: skip
        raise LayoutError("array 'before' is out of order")
    _check_samples(arrays, kind)


def _check_samples(arrays: Mapping[str, Array], kind: str) -> None:
    """Check that samples that are not aligned yet are those of a stationary vehicle."""
    most = _OVERSHOOT
    if kind == "increments":
        times = np.concatenate([arrays["intake_times"], np.sort(HeldSample(arrays["held"]).time)])
        nominal = float(arrays["intake_nominal"][0])
        if not nominal and len(times) < 2:
            return
        most *= nominal or float(np.median(np.abs(np.diff(times))))
    intake = IntakeState(arrays["intake"])
    rows = np.vstack([
        HeldSample(arrays["held"]).values, HeldSample(arrays["before"]).values,
        arrays["intake_rows"], intake.last_integrated, intake.before_integrated,
        IntakeRow(arrays["intake_pending"]).values, arrays["intake_history"],
    ])  # fmt: skip
    if np.any(np.abs(rows[:, :3]) > most * LARGEST_RATE) or np.any(
        np.abs(rows[:, 3:]) > most * LARGEST_FORCE
    ):
        raise LayoutError("a sample has a value that no stationary vehicle gives")
