"""What the saved state of a kernel may hold: checked before a kernel computes with it.

A kernel takes its indices and counters from its state, without a check of its own: a state from a
file that breaks the layout would make it write outside its tables. `schuler.kernels.states` says
for each array which numbers it has and their ranges; here is what must hold between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_RATE
from schuler.kernels import gaps, spikes
from schuler.kernels.fields import COUNT, SUM, TIME, Field, View
from schuler.kernels.states import (
    LARGEST,
    NODE_CAPACITY,
    STRETCH_CAPACITY,
    IntakeRow,
    IntakeState,
    SpikeRow,
    StretchSums,
    SummaryState,
    TrackerNode,
    TrackerState,
    TrackerSums,
)

__all__ = ["COUNT", "ArrayLayout", "LayoutError", "check_aligner", "check_arrays",
           "check_intake", "check_summary", "check_tracker", "view_layout"]  # fmt: skip

Array = NDArray[np.float64]

RATE, FORCE = 1e3, 1e5
"""Beyond any angular rate (rad/s) and specific force (m/s^2) of a stationary vehicle."""

UNIT = 1e-9
"""A quaternion that is kept at length 1 to rounding is never so far off."""


class LayoutError(ValueError):
    """A saved state breaks the layout of its kernel; the text says where."""


@dataclass(frozen=True)
class ArrayLayout:
    """Shape and ranges of one array; all numbers must be finite.

    Parameters
    ----------
    shape : tuple of (int, int)
        Least and greatest size of each axis.
    fields : tuple of Field
        Ranges along the last axis.
    """

    shape: tuple[tuple[int, int], ...]
    fields: tuple[Field, ...] = ()

    def check(self, name: str, array: Array) -> None:
        """Raise LayoutError unless the array keeps the layout."""
        fits = array.ndim == len(self.shape) and all(
            low <= n <= high for n, (low, high) in zip(array.shape, self.shape, strict=True)
        )
        if array.dtype != np.float64 or not fits:
            raise LayoutError(f"array '{name}' has type {array.dtype} and shape {array.shape}")
        if not np.isfinite(array).all():
            raise LayoutError(f"array '{name}' has an entry that is not a finite number")
        if np.any(np.abs(array) > SUM):
            raise LayoutError(f"array '{name}' has an entry beyond any sum")
        for field in self.fields:
            part = array[..., field.slice]
            bad = (part < field.low) | (part > field.high)
            if field.whole:
                bad |= part != np.floor(part)
            if bad.any():
                kind = "a whole number" if field.whole else "a number"
                raise LayoutError(
                    f"array '{name}' holds {part[bad][0]:.6g} in entry '{field.name}', where "
                    f"{kind} from {field.low:g} to {field.high:g} belongs"
                )


def view_layout(view: type[View], *rows: tuple[int, int]) -> ArrayLayout:
    """Return the layout of an array that a view names.

    Parameters
    ----------
    view : type of View
    *rows : (int, int)
        Least and greatest size of each axis before the last.
    """
    return ArrayLayout((*rows, (view.size, view.size)), view.fields)


def series_layout(least: int, most: int, low: float, high: float) -> ArrayLayout:
    """Return the layout of a row of numbers with one range."""
    every = Field(most, low=low, high=high)
    every.name = "each"
    return ArrayLayout(((least, most),), (every,))


class Channels(View):
    """Values of six channels."""

    values = Field(6, low=-LARGEST, high=LARGEST)


class FilteredChannels(View):
    """Values of six channels, of which interpolation may be far off."""

    values = Field(6, low=-LARGEST * 100, high=LARGEST * 100)


class TrackerSetting(View):
    """How samples are put together."""

    subsamples = Field(low=0.0, high=4.0, whole=True)
    corrections = Field(2, low=0.0, high=1.0, whole=True)  # coning, sculling


class IntakeProgress(View):
    """How far the rows that wait have been taken."""

    opened = Field(low=0.0, high=1.0, whole=True)
    done = Field(low=0.0, high=4.0 * gaps.HISTORY, whole=True)
    screened = Field(low=0.0, high=4.0 * gaps.HISTORY, whole=True)
    keep_spikes = Field(low=0.0, high=1.0, whole=True)


class SpikeSetting(View):
    """Settings of a channel, as in `schuler.kernels.residuals`."""

    numbers = Field(spikes.SETTING, low=0.0)


_TAIL = Field(4, low=-TIME, high=TIME)
_TAIL.name = "times"

TRACKER = {
    "tracker": view_layout(TrackerState),
    "tracker_nodes": view_layout(TrackerNode, (0, NODE_CAPACITY - 1)),
    "tracker_tail": ArrayLayout(((2, 2), (0, 4)), (_TAIL,)),
    "tracker_setting": view_layout(TrackerSetting),
}

SUMMARY = {
    "summary": view_layout(SummaryState),
    "summary_table": view_layout(StretchSums, (1, STRETCH_CAPACITY)),
}

_PENDING = 4 * gaps.HISTORY
"""More rows never wait: those behind a long gap, those to be judged and their neighbours."""

INTAKE = {
    "intake": view_layout(IntakeState),
    "intake_nominal": series_layout(1, 1, 0.0, 1e10),
    "intake_times": series_layout(0, 255, -TIME, TIME),
    "intake_rows": view_layout(Channels, (0, 255)),
    "intake_pending": view_layout(IntakeRow, (0, _PENDING)),
    "intake_progress": view_layout(IntakeProgress),
    "intake_settings": view_layout(SpikeSetting, (6, 6)),
    "intake_history": view_layout(FilteredChannels, (gaps.HISTORY,) * 2),
    "intake_spikes": view_layout(SpikeRow, (0, 1 << 20)),
}


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
    s, tail = TrackerState(arrays["tracker"]), arrays["tracker_tail"]
    nodes = TrackerNode(arrays["tracker_nodes"])
    count = len(nodes.data)
    n_sub = int(TrackerSetting(arrays["tracker_setting"]).subsamples)
    start = TrackerState.begin()
    if s.samples == 0.0:
        empty = not count and not tail.size and not n_sub and np.array_equal(s.data, start.data)
        _require(empty, "array 'tracker' has no samples and yet sums of samples")
        return
    waiting = int(s.waiting)
    _require(n_sub >= 1, "array 'tracker_setting' has no samples to an update")
    _require(waiting < n_sub, "array 'tracker' has more samples waiting than an update takes")
    _require(
        s.samples == s.updates * n_sub + waiting, "array 'tracker' miscounts samples and updates"
    )
    spacing = float(s.spacing)
    _require(np.log2(spacing) % 1.0 == 0.0, "array 'tracker' has an impossible spacing of nodes")
    _require(count == s.nodes >= 1, "array 'tracker_nodes' has another length than is said")
    _require(
        s.since_node < spacing and s.updates == (s.nodes - 1.0) * spacing + s.since_node
        and np.array_equal(nodes.updates, np.arange(count) * spacing),
        "array 'tracker' miscounts updates and nodes",
    )  # fmt: skip
    first = start.node().data
    _require(np.array_equal(nodes.data[0], first), "array 'tracker_nodes' does not begin at rest")
    rows = np.vstack([nodes.data, s.node().data])
    if s.since_node == 0.0:
        # Samples that wait are in the plain sums of the state only.
        plain = np.zeros(TrackerNode.size, bool)
        plain[TrackerSums.sum_dtheta.start : TrackerSums.size] = waiting > 0
        _require(np.array_equal(rows[-2, ~plain], rows[-1, ~plain]), "the last node is no state")
        rows = rows[:-1]
    length = np.linalg.norm(TrackerNode(rows).quat_ib0_b, axis=1)
    _require(np.all(np.abs(length - 1.0) < UNIT), "an attitude is not a unit quaternion")
    end = float(tail[0, -1] - s.start) if tail.shape[1] else 0.0
    _check_sums(TrackerNode(rows), end)
    _require(np.all(np.abs(s.last_dtheta) <= RATE), "the last angle is beyond any instrument")
    _require(np.all(np.abs(s.last_dvel) <= FORCE), "the last velocity increment is too large")
    waits = np.abs(s.waiting_samples[:waiting].reshape(-1, 2, 3)).max(axis=(0, 2), initial=0.0)
    _require(waits[0] <= RATE and waits[1] <= FORCE, "a sample that waits is too large")
    taken = min(4.0, float(s.samples))
    _require(
        tail.shape[1] == taken and np.all(np.diff(tail[0]) > 0) and np.all(tail[1] > 0)
        and np.all(tail[1] < 1e10),
        "array 'tracker_tail' has no increasing times",
    )  # fmt: skip
    if waiting < taken and s.updates > 0.0:
        off = abs(tail[0, -1 - waiting] - s.start - s.time)
        most = 1e-9 * (1.0 + abs(s.start) + s.time)
        _require(off <= most, "'tracker_tail' ends at another time")


def _check_sums(rows: TrackerNode, end: float) -> None:
    """Check that cumulative rows grow as the samples between them let them.

    Over m updates that last T, attitude and velocity change by no more than the root of the sum of
    squared rates and forces times T; each sum changes by m times its term, but for that much.

    Parameters
    ----------
    rows : TrackerNode
        (k, 44): nodes, and the state's own sums where it is no node.
    end : float
        Time of the last sample since the start, s; samples may wait for their update.
    """
    if len(rows.data) < 2:
        return
    step, last = TrackerNode(np.diff(rows.data, axis=0)), TrackerNode(rows.data[:-1])
    t, m, span = last.time, step.updates, step.time
    _require(np.all(span > 0) and np.all(m > 0), "times of nodes do not increase")
    for growing in (
        step.sum_xx, step.sum_yy, step.sum_zz, step.sum_rate, step.sum_rate2, step.sum_force,
        step.sum_force2,
    ):  # fmt: skip
        _require(np.all(growing >= 0), "a sum of squares shrinks")
    _require(
        np.all(step.sum_rate2 <= 4.0 * (m + 1.0) * RATE**2)
        and np.all(step.sum_force2 <= 4.0 * (m + 1.0) * FORCE**2)
        # Each is no more than the root of its square's sum, times the root of how many.
        and np.all(step.sum_rate**2 <= 1.01 * (4.0 * m + 4.0) * step.sum_rate2)
        and np.all(step.sum_force**2 <= 1.01 * (4.0 * m + 4.0) * step.sum_force2),
        "sums of rates are beyond any instrument",
    )
    whole = span.copy()
    whole[-1] = max(span[-1], end - t[-1])
    turn, push = np.sqrt(step.sum_rate2) * whole, np.sqrt(step.sum_force2) * whole
    speed = np.abs(last.v_ib0).max(axis=1)
    # Coning and sculling corrections, and the rotation inside an update, are small parts of it.
    slack = 2.0
    late = rows.time[1:]
    sums = TrackerSums
    products = slice(sums.sum_xx.start, sums.sum_zz.start + 1)
    bounds = (
        (sums.quat_ib0_b.slice, 0.0, turn), (sums.v_ib0.slice, 0.0, push),
        (sums.sum_v.slice, m[:, None] * last.v_ib0, m * push),
        (sums.sum_gravity.slice, 0.0, m * late),
        (sums.sum_gravity_v.slice, 0.0, m * late * (speed + push)), (products, 0.0, m * late**2),
        (sums.sum_dtheta.slice, 0.0, turn), (sums.sum_dvel.slice, 0.0, push),
        (TrackerNode.sum_quat.slice, m[:, None] * last.quat_ib0_b, m * turn),
    )  # fmt: skip
    for columns, expected, bound in bounds:
        off = np.abs(step.data[:, columns] - expected)
        # The last term is rounding of what was summed before.
        most = slack * bound[:, None] + 1e-9 * (1.0 + np.abs(rows.data[1:, columns]))
        _require(
            np.all(off <= most),
            f"entries {columns.start} to {columns.stop - 1} of the tracker change faster than its "
            "samples let them",
        )
    # The sums that hold no measurement can be told from the times alone.
    angle = EARTH_RATE * rows.time
    b = np.stack(
        [np.sin(angle) / EARTH_RATE, 2.0 * np.sin(0.5 * angle) ** 2 / EARTH_RATE, rows.time], axis=1
    )
    off = np.abs(step.sum_gravity - m[:, None] * b[:-1])
    _require(np.all(off <= 1.01 * (m * span)[:, None] + 1e-6), "sums of gravity fit no times")
    low, high = b[:-1], b[1:]
    pairs = (
        (step.sum_xx, 0, 0), (step.sum_xy, 0, 1), (step.sum_xz, 0, 2), (step.sum_yy, 1, 1),
        (step.sum_yz, 1, 2), (step.sum_zz, 2, 2),
    )  # fmt: skip
    for total, i, j in pairs:
        most = m * span * (np.abs(high[:, i]) + np.abs(high[:, j]) + 2.0 * span) + 1e-6
        off = np.abs(total - m * low[:, i] * low[:, j])
        _require(np.all(off <= 1.01 * most), "sums of products of gravity fit no times")
    for i in range(3):
        for j in range(3):
            v = last.v_ib0[:, j]
            most = m * (np.abs(low[:, i]) * slack * push + span * (np.abs(v) + slack * push)) + 1e-6
            off = np.abs(step.sum_gravity_v[:, i, j] - m * low[:, i] * v)
            _require(np.all(off <= 1.01 * most), "sums of gravity and velocity fit no times")


def check_summary(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `blocks.summarise`.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, SUMMARY)
    s, table = SummaryState(arrays["summary"]), arrays["summary_table"]
    rows = int(s.rows)
    _require(np.log2(s.length) % 1.0 == 0.0, "array 'summary' has an impossible stretch length")
    _require(len(table) > rows, "array 'summary_table' has fewer rows than is said")
    _require(not table[rows + 1 :].any(), "array 'summary_table' has rows beyond its end")
    samples = StretchSums(table).samples
    _require(samples.sum() == s.samples, "array 'summary_table' miscounts its samples")
    _require(
        s.differences == max(0.0, s.samples - 2.0)
        and s.new_differences == max(0.0, s.new_values - 2.0) and s.new_values <= s.samples,
        "array 'summary' miscounts its differences",
    )  # fmt: skip
    used = StretchSums(table[: rows + int(samples[rows] > 0.0)])
    count = used.samples
    _require(
        np.all(count >= 1.0) and np.all(used.duration > 0.0) and np.all(np.diff(used.end) > 0),
        "array 'summary_table' has a stretch without samples or out of order",
    )
    for total, bound in ((used.sum_dtheta, RATE), (used.sum_dvel, FORCE)):
        most = bound * (used.duration[:, None] + 1.0)
        _require(np.all(np.abs(total) <= most), "a sum is beyond any instrument")
    _require(
        np.all(used.largest_rate <= RATE) and np.all(used.smallest_force <= used.largest_force)
        and np.all(used.largest_force <= FORCE),
        "array 'summary_table' has extremes beyond any instrument",
    )  # fmt: skip
    slack = 1.0 + 1e-9
    _require(
        np.all(used.sum_rate2 <= slack * count * used.largest_rate**2)
        and np.all(used.sum_force2 <= slack * count * used.largest_force**2)
        and np.all(used.sum_force <= slack * count * used.largest_force)
        and np.all(slack * used.sum_force >= count * used.smallest_force),
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
    s, total = TrackerState(arrays["tracker"]), StretchSums(arrays["summary_table"].sum(axis=0))
    _require(s.samples == SummaryState(arrays["summary"]).samples, "two counts of samples differ")
    if s.samples == 0.0:
        return
    # The same sums, in another order.
    interval = total.duration / s.samples
    for mine, other, scale in (
        (s.sum_dtheta, total.sum_dtheta, s.sum_rate * interval),
        (s.sum_dvel, total.sum_dvel, s.sum_force * interval),
        (s.sum_rate2, total.sum_rate2, s.sum_rate2), (s.sum_force, total.sum_force, s.sum_force),
        (s.sum_force2, total.sum_force2, s.sum_force2),
    ):  # fmt: skip
        off = np.abs(mine - other)
        _require(np.all(off <= 1e-6 * scale + 1e-12), "tracker and summary sum other samples")
    # The end of the last stretch, and of the last sample.
    table = StretchSums(arrays["summary_table"])
    end = table.end[table.samples > 0.0][-1]
    _require(end == arrays["tracker_tail"][0, -1], "tracker and summary end apart")


def check_intake(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `intake.intake` and of the rows that wait for their rate.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, INTAKE)
    s, nominal = IntakeState(arrays["intake"]), float(arrays["intake_nominal"][0])
    times, rows = arrays["intake_times"], arrays["intake_rows"]
    _require(len(times) == len(rows), "'intake_times' and 'intake_rows' differ in length")
    pending, progress = arrays["intake_pending"], IntakeProgress(arrays["intake_progress"])
    waiting = IntakeRow(pending)
    if nominal == 0.0 or not progress.opened:
        _require(not s.integrated and not s.started, "array 'intake' has rows and yet no interval")
        _require(not progress.opened and not len(pending), "'intake_pending' has rows of no record")
        return
    _require(
        progress.done <= progress.screened <= len(pending),
        "'intake_progress' is beyond the rows that wait",
    )
    _require(
        np.all(np.diff(waiting.number) > 0) and np.all(np.diff(waiting.time) > 0)
        and (not len(pending) or waiting.time[-1] == s.last_time),
        "array 'intake_pending' is out of order",
    )  # fmt: skip
    _require(
        s.opened <= s.started and s.done_time <= s.last_time,
        "array 'intake' is integrated beyond its rows",
    )
    _require((s.opened == 1.0) == (s.history > 0.0), "array 'intake_history' has no last row")
    _require(not len(times), "'intake_times' has rows that the intake took already")
    _require(s.started == (s.integrated > 0.0), "array 'intake' has rows and yet no last row")
    valid = s.rows - s.not_finite - s.repeated
    _require(valid >= s.integrated, "array 'intake' miscounts its rows")
    _require(s.first_time <= s.last_time or not s.started, "array 'intake' ends before it begins")
    _require(valid > s.regular + s.gaps or not s.started, "array 'intake' miscounts its intervals")
