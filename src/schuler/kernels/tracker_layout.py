"""What the saved state of a tracker, and of an aligner that owns one, may hold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_RATE
from schuler.kernels.fields import TIME, Field, View
from schuler.kernels.layout import (
    FORCE,
    RATE,
    ArrayLayout,
    check_arrays,
    check_summary,
    require,
    view_layout,
)
from schuler.kernels.states import (
    NODE_CAPACITY,
    StretchSums,
    SummaryState,
    TrackerNode,
    TrackerState,
    TrackerSums,
)

__all__ = ["check_aligner", "check_tracker"]

Array = NDArray[np.float64]


UNIT = 1e-9
"""A quaternion that is kept at length 1 to rounding is never so far off."""


class TrackerSetting(View):
    """How samples are put together."""

    subsamples = Field(low=0.0, high=4.0, whole=True)
    corrections = Field(2, low=0.0, high=1.0, whole=True)  # coning, sculling
    sampling_faults = Field(low=0.0, high=1.0, whole=True)


_TAIL = Field(4, low=-TIME, high=TIME)

_TAIL.name = "times"

TRACKER = {
    "tracker": view_layout(TrackerState),
    "tracker_nodes": view_layout(TrackerNode, (0, NODE_CAPACITY - 1)),
    "tracker_tail": ArrayLayout(((2, 2), (0, 4)), (_TAIL,)),
    "tracker_setting": view_layout(TrackerSetting),
}


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
        require(empty, "array 'tracker' has no samples and yet sums of samples")
        return
    waiting = int(s.waiting)
    require(n_sub >= 1, "array 'tracker_setting' has no samples to an update")
    require(waiting < n_sub, "array 'tracker' has more samples waiting than an update takes")
    require(
        s.samples == s.updates * n_sub + waiting, "array 'tracker' miscounts samples and updates"
    )
    spacing = float(s.spacing)
    require(np.log2(spacing) % 1.0 == 0.0, "array 'tracker' has an impossible spacing of nodes")
    require(count == s.nodes >= 1, "array 'tracker_nodes' has another length than is said")
    require(
        s.since_node < spacing and s.updates == (s.nodes - 1.0) * spacing + s.since_node
        and np.array_equal(nodes.updates, np.arange(count) * spacing),
        "array 'tracker' miscounts updates and nodes",
    )  # fmt: skip
    first = start.node().data
    require(np.array_equal(nodes.data[0], first), "array 'tracker_nodes' does not begin at rest")
    rows = np.vstack([nodes.data, s.node().data])
    if s.since_node == 0.0:
        # Samples that wait are in the plain sums of the state only.
        plain = np.zeros(TrackerNode.size, bool)
        plain[TrackerSums.sum_dtheta.start : TrackerSums.size] = waiting > 0
        require(np.array_equal(rows[-2, ~plain], rows[-1, ~plain]), "the last node is no state")
        rows = rows[:-1]
    length = np.linalg.norm(TrackerNode(rows).quat_ib0_b, axis=1)
    require(np.all(np.abs(length - 1.0) < UNIT), "an attitude is not a unit quaternion")
    end = float(tail[0, -1] - s.start) if tail.shape[1] else 0.0
    _check_sums(TrackerNode(rows), end)
    require(np.all(np.abs(s.last_dtheta) <= RATE), "the last angle is beyond any instrument")
    require(np.all(np.abs(s.last_dvel) <= FORCE), "the last velocity increment is too large")
    waits = np.abs(s.waiting_samples[:waiting].reshape(-1, 2, 3)).max(axis=(0, 2), initial=0.0)
    require(waits[0] <= RATE and waits[1] <= FORCE, "a sample that waits is too large")
    taken = min(4.0, float(s.samples))
    require(
        tail.shape[1] == taken and np.all(np.diff(tail[0]) > 0) and np.all(tail[1] > 0)
        and np.all(tail[1] < 1e10),
        "array 'tracker_tail' has no increasing times",
    )  # fmt: skip
    if waiting < taken and s.updates > 0.0:
        off = abs(tail[0, -1 - waiting] - s.start - s.time)
        most = 1e-9 * (1.0 + abs(s.start) + s.time)
        require(off <= most, "'tracker_tail' ends at another time")


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
    require(np.all(span > 0) and np.all(m > 0), "times of nodes do not increase")
    for growing in (
        step.sum_xx, step.sum_yy, step.sum_zz, step.sum_rate, step.sum_rate2, step.sum_force,
        step.sum_force2,
    ):  # fmt: skip
        require(np.all(growing >= 0), "a sum of squares shrinks")
    require(
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
        require(
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
    require(np.all(off <= 1.01 * (m * span)[:, None] + 1e-6), "sums of gravity fit no times")
    low, high = b[:-1], b[1:]
    pairs = (
        (step.sum_xx, 0, 0), (step.sum_xy, 0, 1), (step.sum_xz, 0, 2), (step.sum_yy, 1, 1),
        (step.sum_yz, 1, 2), (step.sum_zz, 2, 2),
    )  # fmt: skip
    for total, i, j in pairs:
        most = m * span * (np.abs(high[:, i]) + np.abs(high[:, j]) + 2.0 * span) + 1e-6
        off = np.abs(total - m * low[:, i] * low[:, j])
        require(np.all(off <= 1.01 * most), "sums of products of gravity fit no times")
    for i in range(3):
        for j in range(3):
            v = last.v_ib0[:, j]
            most = m * (np.abs(low[:, i]) * slack * push + span * (np.abs(v) + slack * push)) + 1e-6
            off = np.abs(step.sum_gravity_v[:, i, j] - m * low[:, i] * v)
            require(np.all(off <= 1.01 * most), "sums of gravity and velocity fit no times")


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
    require(s.samples == SummaryState(arrays["summary"]).samples, "two counts of samples differ")
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
        require(np.all(off <= 1e-6 * scale + 1e-12), "tracker and summary sum other samples")
    # The end of the last stretch, and of the last sample.
    table = StretchSums(arrays["summary_table"])
    end = table.end[table.samples > 0.0][-1]
    require(end == arrays["tracker_tail"][0, -1], "tracker and summary end apart")
