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

from schuler.constants import EARTH_RATE
from schuler.kernels import blocks, gaps, intake, spikes, tracking

__all__ = ["ArrayLayout", "Entries", "LayoutError", "check_aligner", "check_arrays",
           "check_intake", "check_summary", "check_tracker"]  # fmt: skip

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
            Entries(18, 19, 0.0), Entries(20, 20, 0.0, COUNT, True),
            Entries(27, 27, 0.0, COUNT, True),
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

_PENDING = 4.0 * gaps.HISTORY
"""More rows never wait: those behind a long gap, those to be judged and their neighbours."""

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
            Entries(75, 75, -1e12, 1e12), Entries(76, 77, 0.0), Entries(78, 78, 0.0, 1.0, True),
            Entries(79, 79, -1e12, 1e12), Entries(80, 85, -_VALUE, _VALUE),
            Entries(86, 93, 0.0, COUNT, True), Entries(94, 99, -_VALUE, _VALUE),
            Entries(100, 101, 0.0, COUNT, True),
        ),
    ),
    "intake_nominal": ArrayLayout(((1, 1),), (Entries(0, 0, 0.0, 1e10),)),
    "intake_times": ArrayLayout(((0, 255),), (Entries(0, 254, -1e12, 1e12),)),
    "intake_rows": ArrayLayout(((0, 255), (6, 6)), (Entries(0, 5, -_VALUE, _VALUE),)),
    "intake_pending": ArrayLayout(
        ((0, int(_PENDING)), (intake.ROW,) * 2),
        (
            Entries(0, 0, 1.0, COUNT, True), Entries(1, 1, -1e12, 1e12),
            Entries(2, 7, -_VALUE, _VALUE), Entries(8, 8, 0.0, 1e10),
            Entries(9, 9, 0.0, COUNT, True), Entries(10, 10, -1.0, 1e10),
        ),
    ),
    "intake_progress": ArrayLayout(
        ((4, 4),),
        (Entries(0, 0, 0.0, 1.0, True), Entries(1, 2, 0.0, _PENDING, True),
         Entries(3, 3, 0.0, 1.0, True)),
    ),
    "intake_settings": ArrayLayout(((6, 6), (spikes.SETTING,) * 2), (Entries(0, 7, 0.0),)),
    "intake_history": ArrayLayout(
        ((gaps.HISTORY,) * 2, (6, 6)), (Entries(0, 5, -_VALUE * 100, _VALUE * 100),)
    ),
    "intake_spikes": ArrayLayout(
        ((0, 1 << 20), (5, 5)),
        (
            Entries(0, 0, 1.0, COUNT, True), Entries(1, 1, -1e12, 1e12),
            Entries(2, 2, 0.0, 5.0, True), Entries(3, 3, -_VALUE, _VALUE),
        ),
    ),
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
        empty = not len(nodes) and not tail.size and not n_sub and np.array_equal(s, start)
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
        # Samples that wait are in the plain sums of the state only.
        same = np.arange(tracking.ROW)
        same = same[(same < 30) | (same >= tracking.PLAIN) | (s[48] == 0.0)]
        _require(np.array_equal(rows[-2, same], rows[-1, same]), "the last node is not the state")
        rows = rows[:-1]
    length = np.linalg.norm(rows[:, 2:6], axis=1)
    _require(np.all(np.abs(length - 1.0) < UNIT), "an attitude is not a unit quaternion")
    end = float(tail[0, -1] - s[40]) if tail.shape[1] else 0.0
    _check_sums(rows, end)
    _require(np.all(np.abs(s[42:45]) <= RATE), "the last angle increment is beyond any instrument")
    _require(np.all(np.abs(s[45:48]) <= FORCE), "the last velocity increment is too large")
    waits = np.abs(s[49 : 49 + 6 * int(s[48])].reshape(-1, 2, 3)).max(axis=(0, 2), initial=0.0)
    _require(waits[0] <= RATE and waits[1] <= FORCE, "a sample that waits is too large")
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


def _check_sums(rows: Array, end: float) -> None:
    """Check that cumulative rows (k, 44) grow as the samples between them let them.

    Over m updates that last T, attitude and velocity change by no more than the root of the sum of
    squared rates and forces times T; each sum changes by m times its term, but for that much.

    Parameters
    ----------
    rows : (k, 44) float64
        Nodes, and the state's own sums where it is no node.
    end : float
        Time of the last sample since the start, s; samples may wait for their update.
    """
    if len(rows) < 2:
        return
    t, step = rows[:-1, 0], np.diff(rows, axis=0)
    last = rows[:-1]
    m, span = step[:, 1], step[:, 0]
    _require(np.all(span > 0) and np.all(m > 0), "times of nodes do not increase")
    _require(np.all(step[:, [24, 27, 29, 36, 37, 38, 39]] >= 0), "a sum of squares shrinks")
    _require(
        np.all(step[:, 37] <= 4.0 * (m + 1.0) * RATE**2)
        and np.all(step[:, 39] <= 4.0 * (m + 1.0) * FORCE**2)
        # Each is no more than the root of its square's sum, times the root of how many.
        and np.all(step[:, 36] ** 2 <= 1.01 * (4.0 * m + 4.0) * step[:, 37])
        and np.all(step[:, 38] ** 2 <= 1.01 * (4.0 * m + 4.0) * step[:, 39]),
        "sums of rates are beyond any instrument",
    )
    whole = span.copy()
    whole[-1] = max(span[-1], end - t[-1])
    turn, push = (np.sqrt(step[:, c]) * whole for c in (37, 39))
    speed = np.abs(last[:, 6:9]).max(axis=1)
    # Coning and sculling corrections, and the rotation inside an update, are small parts of it.
    slack = 2.0
    late = rows[1:, 0]
    bounds = (
        (slice(2, 6), 0.0, turn), (slice(6, 9), 0.0, push),
        (slice(9, 12), m[:, None] * last[:, 6:9], m * push),
        (slice(12, 15), 0.0, m * late), (slice(15, 24), 0.0, m * late * (speed + push)),
        (slice(24, 30), 0.0, m * late**2),
        (slice(30, 33), 0.0, turn), (slice(33, 36), 0.0, push),
        (slice(40, 44), m[:, None] * last[:, 2:6], m * turn),
    )  # fmt: skip
    for columns, expected, bound in bounds:
        off = np.abs(step[:, columns] - expected)
        # The last term is rounding of what was summed before.
        most = slack * bound[:, None] + 1e-9 * (1.0 + np.abs(rows[1:, columns]))
        _require(
            np.all(off <= most),
            f"entries {columns.start} to {columns.stop - 1} of the tracker change faster than its "
            "samples let them",
        )
    # The sums that hold no measurement can be told from the times alone.
    b = np.stack(
        [np.sin(EARTH_RATE * rows[:, 0]) / EARTH_RATE,
         2.0 * np.sin(0.5 * EARTH_RATE * rows[:, 0]) ** 2 / EARTH_RATE, rows[:, 0]], axis=1,
    )  # fmt: skip
    off = np.abs(step[:, 12:15] - m[:, None] * b[:-1])
    _require(np.all(off <= 1.01 * (m * span)[:, None] + 1e-6), "sums of gravity fit no times")
    low, high = b[:-1], b[1:]
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    for column, (i, j) in enumerate(pairs, 24):
        most = m * span * (np.abs(high[:, i]) + np.abs(high[:, j]) + 2.0 * span) + 1e-6
        off = np.abs(step[:, column] - m * low[:, i] * low[:, j])
        _require(np.all(off <= 1.01 * most), "sums of products of gravity fit no times")
    for i in range(3):
        for j in range(3):
            v = last[:, 6 + j]
            most = m * (np.abs(low[:, i]) * slack * push + span * (np.abs(v) + slack * push)) + 1e-6
            off = np.abs(step[:, 15 + 3 * i + j] - m * low[:, i] * v)
            _require(np.all(off <= 1.01 * most), "sums of gravity and velocity fit no times")


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
    _require(
        s[5] == max(0.0, s[2] - 2.0) and s[20] == max(0.0, s[27] - 2.0) and s[27] <= s[2],
        "array 'summary' miscounts its differences",
    )
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


def check_aligner(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of an aligner: that of its tracker and that of its summary.

    Raises
    ------
    LayoutError
        If either breaks its layout, or they were not made of the same samples.
    """
    check_tracker(arrays)
    check_summary(arrays)
    s, total = arrays["tracker"], arrays["summary_table"].sum(axis=0)
    _require(s[41] == arrays["summary"][2], "two counts of samples differ")
    if s[41] == 0.0:
        return
    # The same sums, in another order.
    interval = total[1] / s[41]
    for mine, other, scale in (
        (s[30:33], total[3:6], s[36] * interval), (s[33:36], total[6:9], s[38] * interval),
        (s[37:40], total[9:12][[0, 2, 1]], s[37:40]),
    ):  # fmt: skip
        off = np.abs(mine - other)
        _require(np.all(off <= 1e-6 * scale + 1e-12), "tracker and summary sum other samples")
    # The end of the last stretch, and of the last sample.
    used = arrays["summary_table"][arrays["summary_table"][:, 2] > 0.0]
    _require(used[-1, 0] == arrays["tracker_tail"][0, -1], "tracker and summary end apart")


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
    rows_left, progress = arrays["intake_pending"], arrays["intake_progress"]
    opened, done, screened = progress[0], progress[1], progress[2]
    if nominal == 0.0 or not opened:
        _require(not s[72] and not s[1], "array 'intake' has rows and yet no interval")
        _require(not opened and not len(rows_left), "'intake_pending' has rows of no record")
        return
    _require(done <= screened <= len(rows_left), "'intake_progress' is beyond the rows that wait")
    _require(
        np.all(np.diff(rows_left[:, 0]) > 0) and np.all(np.diff(rows_left[:, 1]) > 0)
        and (not len(rows_left) or rows_left[-1, 1] == s[3]),
        "array 'intake_pending' is out of order",
    )  # fmt: skip
    _require(s[78] <= s[1] and s[79] <= s[3], "array 'intake' is integrated beyond its rows")
    _require((s[78] == 1.0) == (s[100] > 0.0), "array 'intake_history' has no last row")
    _require(not len(times), "'intake_times' has rows that the intake took already")
    _require(s[1] == (s[72] > 0.0), "array 'intake' has rows and yet no last row")
    _require(s[0] >= s[72] + s[17] + s[18], "array 'intake' miscounts its rows")
    _require(s[75] <= s[3] or not s[1], "array 'intake' ends before it begins")
    valid = s[0] - s[17] - s[18]
    _require(valid > s[23] + s[19] or not s[1], "array 'intake' miscounts its intervals")
