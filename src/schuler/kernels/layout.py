"""What the saved state of a kernel may hold: checked before a kernel computes with it.

A kernel takes its indices and counters from its state, without a check of its own: a state from a
file that breaks the layout would make it write outside its tables. Each table below says, for the
arrays of one kernel, the shape, the range of each entry and which entries are whole numbers; the
function beside it checks what must hold between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.kernels import blocks, intake, tracking

__all__ = ["ArrayLayout", "Entries", "LayoutError", "check_arrays", "check_intake",
           "check_summary", "check_tracker"]  # fmt: skip

Array = NDArray[np.float64]

COUNT = 2.0**53
"""Largest whole number that a float64 holds exactly."""

SUM = 1e40
"""No sum of a record, nor of its squares, comes near."""

RATE, FORCE = 1e3, 1e5
"""Beyond any angular rate (rad/s) and specific force (m/s^2) of a stationary vehicle."""

UNIT = 1e-9
"""A quaternion that is kept at length 1 to rounding is never so far off."""


class LayoutError(ValueError):
    """A saved state breaks the layout of its kernel; the text says where."""


@dataclass(frozen=True)
class Entries:
    """Entries of the last axis that share one range.

    Parameters
    ----------
    first, last : int
        From and to which entry, both included.
    low, high : float
        Range, both ends included.
    whole : bool
        Whole numbers only.
    """

    first: int
    last: int
    low: float = -SUM
    high: float = SUM
    whole: bool = False


@dataclass(frozen=True)
class ArrayLayout:
    """Shape and ranges of one array; entries that no `Entries` names must be finite.

    Parameters
    ----------
    shape : tuple of (int, int)
        Least and greatest size of each axis.
    entries : tuple of Entries
    """

    shape: tuple[tuple[int, int], ...]
    entries: tuple[Entries, ...] = ()

    def check(self, name: str, array: Array) -> None:
        """Raise LayoutError unless the array keeps the layout."""
        fits = array.ndim == len(self.shape) and all(
            low <= n <= high for n, (low, high) in zip(array.shape, self.shape, strict=True)
        )
        if array.dtype != np.float64 or not fits:
            raise LayoutError(f"array '{name}' has type {array.dtype} and shape {array.shape}")
        if not np.isfinite(array).all():
            raise LayoutError(f"array '{name}' has an entry that is not a finite number")
        for e in (Entries(0, self.shape[-1][1] - 1), *self.entries):
            part = array[..., e.first : e.last + 1]
            bad = (part < e.low) | (part > e.high)
            if e.whole:
                bad |= part != np.floor(part)
            if bad.any():
                kind = "a whole number" if e.whole else "a number"
                raise LayoutError(
                    f"array '{name}' holds {part[bad][0]:.6g} in entry {e.first} to {e.last}, "
                    f"where {kind} from {e.low:g} to {e.high:g} belongs"
                )


TRACKER = {
    "tracker": ArrayLayout(
        ((tracking.STATE_SIZE,) * 2,),
        (
            Entries(0, 0, 0.0, 1e10), Entries(1, 1, 0.0, COUNT, True), Entries(2, 5, -1.1, 1.1),
            Entries(24, 24, 0.0), Entries(27, 27, 0.0), Entries(29, 29, 0.0),
            Entries(36, 39, 0.0), Entries(40, 40, -1e12, 1e12), Entries(41, 41, 0.0, COUNT, True),
            Entries(48, 48, 0.0, 3.0, True),
            # The kernel writes a node at this index before it looks whether the table is full.
            Entries(73, 73, 0.0, tracking.NODE_CAPACITY - 1.0, True),
            Entries(74, 74, 1.0, COUNT, True), Entries(75, 75, 0.0, COUNT, True),
        ),
    ),
    "tracker_nodes": ArrayLayout(
        ((0, tracking.NODE_CAPACITY - 1), (tracking.ROW,) * 2),
        (
            Entries(0, 0, 0.0, 1e10), Entries(1, 1, 0.0, COUNT, True), Entries(2, 5, -1.1, 1.1),
            Entries(36, 39, 0.0),
        ),
    ),
    "tracker_tail": ArrayLayout(((2, 2), (0, 4)), (Entries(0, 3, -1e12, 1e12),)),
    "tracker_setting": ArrayLayout(
        ((3, 3),), (Entries(0, 0, 0.0, 4.0, True), Entries(1, 2, 0.0, 1.0, True))
    ),
}  # fmt: skip

SUMMARY = {
    "summary": ArrayLayout(
        ((blocks.STATE_SIZE,) * 2,),
        (
            Entries(0, 0, 0.0, blocks.CAPACITY - 1.0, True), Entries(1, 1, 1.0, COUNT, True),
            Entries(2, 2, 0.0, COUNT, True), Entries(3, 4, 0.0), Entries(5, 5, 0.0, COUNT, True),
        ),
    ),
    "summary_table": ArrayLayout(
        ((1, blocks.CAPACITY), (blocks.ROW,) * 2),
        (
            Entries(0, 0, -1e12, 1e12), Entries(1, 1, 0.0, 1e10), Entries(2, 2, 0.0, COUNT, True),
            Entries(9, 14, 0.0),
        ),
    ),
}  # fmt: skip

_VALUE = intake.LARGEST

INTAKE = {
    "intake": ArrayLayout(
        ((intake.STATE_SIZE,) * 2,),
        (
            Entries(0, 0, 0.0, COUNT, True), Entries(1, 2, 0.0, 1.0, True),
            Entries(3, 3, -1e12, 1e12), Entries(4, 4, 0.0, 1e10), Entries(5, 16, -_VALUE, _VALUE),
            Entries(17, 19, 0.0, COUNT, True), Entries(20, 22, 0.0),
            Entries(23, 23, 0.0, COUNT, True), Entries(25, 26, 0.0, COUNT, True),
            Entries(27, 27, 0.0, 5.0, True), Entries(30, 35, 0.0, _VALUE),
            Entries(36, 59, 0.0, COUNT, True), Entries(66, 71, 0.0),
            Entries(72, 72, 0.0, COUNT, True), Entries(73, 74, 0.0, 1e10),
            Entries(75, 75, -1e12, 1e12), Entries(76, 77, 0.0),
        ),
    ),
    "intake_nominal": ArrayLayout(((1, 1),), (Entries(0, 0, 0.0, 1e10),)),
    "intake_times": ArrayLayout(((0, 255),), (Entries(0, 254, -1e12, 1e12),)),
    "intake_rows": ArrayLayout(((0, 255), (6, 6)), (Entries(0, 5, -_VALUE, _VALUE),)),
}  # fmt: skip


def check_arrays(arrays: Mapping[str, Array], layouts: Mapping[str, ArrayLayout]) -> None:
    """Check presence, type, shape, finiteness and ranges.

    Raises
    ------
    LayoutError
        Saying which array breaks the layout, and where.
    """
    for name, layout in layouts.items():
        if name not in arrays:
            raise LayoutError(f"array '{name}' is missing")
        layout.check(name, arrays[name])


def _require(holds: object, text: str) -> None:
    if not holds:
        raise LayoutError(text)


def check_tracker(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `tracking.track` and of its owner.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, TRACKER)
    s, nodes, tail = arrays["tracker"], arrays["tracker_nodes"], arrays["tracker_tail"]
    n_sub = int(arrays["tracker_setting"][0])
    start = np.zeros(tracking.STATE_SIZE)
    start[2] = start[74] = 1.0
    if s[41] == 0.0:
        empty = not len(nodes) and not tail.shape[1] and np.array_equal(s, start)
        _require(empty, "array 'tracker' has no samples and yet sums of samples")
        return
    _require(n_sub >= 1, "array 'tracker_setting' has no samples to an update")
    _require(s[48] < n_sub, "array 'tracker' has more samples waiting than an update takes")
    _require(s[41] == s[1] * n_sub + s[48], "array 'tracker' miscounts samples and updates")
    spacing = s[74]
    _require(np.log2(spacing) % 1.0 == 0.0, "array 'tracker' has an impossible spacing of nodes")
    _require(len(nodes) == s[73] >= 1, "array 'tracker_nodes' has another length than is said")
    _require(
        s[75] < spacing and s[1] == (s[73] - 1.0) * spacing + s[75]
        and np.array_equal(nodes[:, 1], np.arange(len(nodes)) * spacing),
        "array 'tracker' miscounts updates and nodes",
    )  # fmt: skip
    first = np.concatenate([start[: tracking.PLAIN], np.zeros(4)])
    _require(np.array_equal(nodes[0], first), "array 'tracker_nodes' does not begin at rest")
    rows = np.vstack([nodes, np.concatenate([s[: tracking.PLAIN], s[76:80]])])
    if s[75] == 0.0:
        _require(np.array_equal(rows[-2, :30], rows[-1, :30]), "the last node is not the state's")
        rows = rows[:-1]
    length = np.linalg.norm(rows[:, 2:6], axis=1)
    _require(np.all(np.abs(length - 1.0) < UNIT), "an attitude is not a unit quaternion")
    _check_sums(rows, s, float(arrays["tracker_setting"][0]))
    waiting = int(s[48])
    taken = min(4.0, float(s[41]))
    _require(
        tail.shape[1] == taken and np.all(np.diff(tail[0]) > 0) and np.all(tail[1] > 0)
        and np.all(tail[1] < 1e10),
        "array 'tracker_tail' has no increasing times",
    )  # fmt: skip
    if waiting < taken and s[1] > 0.0:
        off = abs(tail[0, -1 - waiting] - s[40] - s[0])
        _require(off <= 1e-9 * (1.0 + abs(s[40]) + s[0]), "'tracker_tail' ends at another time")


def _check_sums(rows: Array, s: Array, n_sub: float) -> None:
    """Check that cumulative rows (k, 44) grow no faster than an instrument lets them."""
    t, n = rows[:, 0], rows[:, 1]
    _require(np.all(np.diff(t) > 0) and np.all(np.diff(n) > 0), "times of nodes do not increase")
    growing = rows[:, [24, 27, 29, 36, 37, 38, 39]]
    _require(np.all(np.diff(growing, axis=0) >= -1e-9 * (1.0 + growing[1:])), "a sum shrinks")
    # One second on top: samples that wait are in the plain sums already, before their update.
    span = t + 1.0
    count = n + 1.0
    velocity = FORCE * span
    bounds = (
        (slice(6, 9), velocity), (slice(9, 12), count * velocity), (slice(12, 15), count * span),
        (slice(15, 24), count * span * velocity), (slice(24, 30), count * span**2),
        (slice(30, 33), RATE * span), (slice(33, 36), velocity),
        (slice(36, 37), n_sub * count * RATE), (slice(37, 38), n_sub * count * RATE**2),
        (slice(38, 39), n_sub * count * FORCE), (slice(39, 40), n_sub * count * FORCE**2),
        (slice(40, 44), count),
    )  # fmt: skip
    for columns, bound in bounds:
        _require(
            np.all(np.abs(rows[:, columns]) <= bound[:, None]),
            f"sums {columns.start} to {columns.stop - 1} are beyond any instrument",
        )
    _require(np.all(np.abs(s[42:45]) <= RATE), "the last angle increment is beyond any instrument")
    _require(np.all(np.abs(s[45:48]) <= FORCE), "the last velocity increment is too large")
    waits = np.abs(s[49 : 49 + 6 * int(s[48])].reshape(-1, 2, 3)).max(axis=(0, 2), initial=0.0)
    _require(waits[0] <= RATE and waits[1] <= FORCE, "a sample that waits is too large")


def check_summary(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `blocks.summarise`.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, SUMMARY)
    s, table = arrays["summary"], arrays["summary_table"]
    rows = int(s[0])
    _require(np.log2(s[1]) % 1.0 == 0.0, "array 'summary' has an impossible length of stretches")
    _require(len(table) > rows, "array 'summary_table' has fewer rows than is said")
    _require(not table[rows + 1 :].any(), "array 'summary_table' has rows beyond its end")
    _require(table[:, 2].sum() == s[2], "array 'summary_table' miscounts its samples")
    _require(s[5] == max(0.0, s[2] - 2.0), "array 'summary' miscounts its differences")
    used = table[: rows + (table[rows, 2] > 0.0)]
    _require(
        np.all(used[:, 2] >= 1.0) and np.all(used[:, 1] > 0.0) and np.all(np.diff(used[:, 0]) > 0),
        "array 'summary_table' has a stretch without samples or out of order",
    )
    bounds = ((slice(3, 6), RATE), (slice(6, 9), FORCE))
    for columns, bound in bounds:
        most = bound * (used[:, 1:2] + 1.0)
        _require(np.all(np.abs(used[:, columns]) <= most), "a sum is beyond any instrument")
    _require(
        np.all(used[:, 12] <= RATE) and np.all(used[:, 14] <= used[:, 13])
        and np.all(used[:, 13] <= FORCE),
        "array 'summary_table' has extremes beyond any instrument",
    )  # fmt: skip
    count = used[:, 2]
    slack = 1.0 + 1e-9
    _require(
        np.all(used[:, 9] <= slack * count * used[:, 12] ** 2)
        and np.all(used[:, 10] <= slack * count * used[:, 13] ** 2)
        and np.all(used[:, 11] <= slack * count * used[:, 13])
        and np.all(slack * used[:, 11] >= count * used[:, 14]),
        "array 'summary_table' has sums that its extremes do not allow",
    )


def check_intake(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `intake.intake` and of the rows that wait for their rate.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, INTAKE)
    s, nominal = arrays["intake"], float(arrays["intake_nominal"][0])
    times, rows = arrays["intake_times"], arrays["intake_rows"]
    _require(len(times) == len(rows), "'intake_times' and 'intake_rows' differ in length")
    if nominal == 0.0:
        _require(not s[72] and not s[1], "array 'intake' has rows and yet no interval")
        return
    _require(not len(times), "'intake_times' has rows that the intake took already")
    _require(s[1] == (s[72] > 0.0), "array 'intake' has rows and yet no last row")
    _require(s[0] >= s[72] + s[17] + s[18], "array 'intake' miscounts its rows")
    _require(s[75] <= s[3] or not s[1], "array 'intake' ends before it begins")
    _require(s[72] > s[23] + s[19] or not s[1], "array 'intake' miscounts its intervals")
