"""What stands where in the arrays of the resumable kernels, by name.

Apart from the kernels, so that reading a state loads no compiler. Frames as in the package's
docstring: ``quat_ib0_b`` maps body vectors to ib0.
"""

from __future__ import annotations

from schuler.kernels.fields import COUNT, TIME, Field, View

__all__ = [
    "LARGEST", "NODE_CAPACITY", "STRETCH_CAPACITY", "ErrorNoise", "ErrorStates",
    "InstrumentErrors", "IntakeRow",
    "IntakeState", "LocalRow", "PathRow", "SpikeRow", "StrapdownOptions", "StrapdownState",
    "StretchSums", "SummaryState", "TrackerNode", "TrackerState", "TrackerSums",
]  # fmt: skip

NODE_CAPACITY = 4097
"""Odd, so that dropping every other node keeps the first and the last."""

STRETCH_CAPACITY = 8192

LARGEST = 1e12
"""Beyond any instrument in any unit (SI); squares and sums of such values stay finite."""


class TrackerSums(View):
    """What is cumulative: the head of a state and of a node.

    ``gravity_*`` belong to b(t); the sums over updates are of values at their ends.
    """

    time = Field(low=0.0, high=1e10)  # since the start, s
    updates = Field(low=0.0, high=COUNT, whole=True)
    quat_ib0_b = Field(4, low=-1.1, high=1.1)  # body to ib0
    v_ib0 = Field(3)  # m/s
    sum_v = Field(3)
    sum_gravity = Field(3)
    sum_gravity_v = Field(3, 3)  # b v^T
    sum_xx = Field(low=0.0)  # b b^T, its upper triangle by rows
    sum_xy = Field()
    sum_xz = Field()
    sum_yy = Field(low=0.0)
    sum_yz = Field()
    sum_zz = Field(low=0.0)
    sum_dtheta = Field(3)  # body axes
    sum_dvel = Field(3)
    sum_rate = Field(low=0.0)  # |w|
    sum_rate2 = Field(low=0.0)
    sum_force = Field(low=0.0)  # |f|
    sum_force2 = Field(low=0.0)


class TrackerNode(TrackerSums):
    """A snapshot."""

    sum_quat = Field(4)  # of quat_ib0_b


class TrackerState(TrackerSums):
    """All that the next chunk needs.

    Examples
    --------
    >>> float(TrackerState.begin().samples)
    0.0
    """

    start = Field(low=-TIME, high=TIME)  # time stamp, s
    samples = Field(low=0.0, high=COUNT, whole=True)
    last_dtheta = Field(3)
    last_dvel = Field(3)
    waiting = Field(low=0.0, high=3.0, whole=True)  # samples for a full update
    waiting_samples = Field(4, 6)
    # The kernel writes a node at this index before it looks whether the table is full.
    nodes = Field(low=0.0, high=NODE_CAPACITY - 1.0, whole=True)
    spacing = Field(low=1.0, high=COUNT, whole=True)  # updates to a node
    since_node = Field(low=0.0, high=COUNT, whole=True)  # updates
    sum_quat = Field(4)

    @classmethod
    def begin(cls) -> TrackerState:
        """Return the state before the first sample."""
        state = cls.zeros()
        state.quat_ib0_b[0] = 1.0
        state.spacing = 1.0
        return state

    def node(self) -> TrackerNode:
        """Return what a snapshot holds now."""
        node = TrackerNode.zeros()
        node.data[: TrackerSums.size] = self.data[: TrackerSums.size]
        node.sum_quat = self.sum_quat
        return node


class StretchSums(View):
    """A row of the table."""

    end = Field(low=-TIME, high=TIME)  # time stamp, s
    duration = Field(low=0.0, high=1e10)
    samples = Field(low=0.0, high=COUNT, whole=True)
    sum_dtheta = Field(3)
    sum_dvel = Field(3)
    sum_rate2 = Field(low=0.0)  # |w|^2
    sum_force2 = Field(low=0.0)  # |f|^2
    sum_force = Field(low=0.0)
    largest_rate = Field(low=0.0)
    largest_force = Field(low=0.0)
    smallest_force = Field(low=0.0)


class SummaryState(View):
    """What the next chunk needs.

    Squared second differences of rate and force show the noise; those of new values alone are for
    a sensor that runs slower than the record.
    """

    rows = Field(low=0.0, high=STRETCH_CAPACITY - 1.0, whole=True)  # complete ones
    length = Field(low=1.0, high=COUNT, whole=True)  # wanted, of a stretch, s
    samples = Field(low=0.0, high=COUNT, whole=True)
    differences2 = Field(2, low=0.0)  # of rate and force, summed
    differences = Field(low=0.0, high=COUNT, whole=True)  # how many
    last_values = Field(6)
    values_before = Field(6)
    new_differences2 = Field(2, low=0.0)
    new_differences = Field(low=0.0, high=COUNT, whole=True)
    values_before_new = Field(6)
    new_values = Field(low=0.0, high=COUNT, whole=True)


class IntakeRow(View):
    """A row on its way."""

    number = Field(low=1.0, high=COUNT, whole=True)  # of the row
    time = Field(low=-TIME, high=TIME)
    values = Field(6, low=-LARGEST, high=LARGEST)
    interval = Field(low=0.0, high=1e10)  # where it is known exactly, else 0
    lost = Field(low=0.0, high=COUNT, whole=True)  # rows to fill in before it
    # Time that is missing before it (s), or -1 where the row's own interval is not like the others.
    missing = Field(low=-1.0, high=1e10)


class IntakeState(View):
    """What the next chunk needs, and what was counted; all zero at the start."""

    rows = Field(low=0.0, high=COUNT, whole=True)  # seen
    started = Field(low=0.0, high=1.0, whole=True)  # a valid row has been seen
    three = Field(low=0.0, high=1.0, whole=True)  # two are integrated: the three-point formula
    last_time = Field(low=-TIME, high=TIME)  # of the last valid row
    last_interval = Field(low=0.0, high=1e10)  # that ended at the last integrated row
    last_integrated = Field(6, low=-LARGEST, high=LARGEST)
    before_integrated = Field(6, low=-LARGEST, high=LARGEST)
    not_finite = Field(low=0.0, high=COUNT, whole=True)  # rows dropped
    repeated = Field(low=0.0, high=COUNT, whole=True)  # rows dropped
    gaps = Field(low=0.0, high=COUNT, whole=True)  # bridged
    longest_gap = Field(low=0.0)  # s
    sum_dt = Field(low=0.0)  # of regular intervals
    sum_dt2 = Field(low=0.0)
    regular = Field(low=0.0, high=COUNT, whole=True)  # intervals
    first_gap_time = Field()
    first_gap_row = Field(low=0.0, high=COUNT, whole=True)
    bad_row = Field(low=0.0, high=COUNT, whole=True)  # the first that is not finite
    bad_channel = Field(low=0.0, high=5.0, whole=True)
    bad_time = Field()
    _unused = Field()
    largest = Field(6, low=0.0, high=LARGEST)  # |value|
    equal_run = Field(6, low=0.0, high=COUNT, whole=True)  # current run of equal values
    run_at_largest = Field(6, low=0.0, high=COUNT, whole=True)  # the longest
    rows_at_largest = Field(6, low=0.0, high=COUNT, whole=True)  # in runs of 3 or more
    longest_run = Field(6, low=0.0, high=COUNT, whole=True)
    sum_values = Field(6)
    sum_values2 = Field(6, low=0.0)
    integrated = Field(low=0.0, high=COUNT, whole=True)  # rows that came, none of the filled
    shortest_dt = Field(low=0.0, high=1e10)  # regular
    longest_dt = Field(low=0.0, high=1e10)  # regular
    first_time = Field(low=-TIME, high=TIME)  # of the first valid row
    sum_norms = Field(2, low=0.0)  # |gyro|, |accel|
    opened = Field(low=0.0, high=1.0, whole=True)  # a row has been integrated
    done_time = Field(low=-TIME, high=TIME)  # of the last integrated row
    last_values = Field(6, low=-LARGEST, high=LARGEST)  # of the last valid row, as they came
    # For gyros and for accelerometers: run of rows in which no value changes, changes, shortest and
    # longest run between two changes.
    holds = Field(2, 4, low=0.0, high=COUNT, whole=True)
    last_came = Field(6, low=-LARGEST, high=LARGEST)  # of the last integrated row that came
    history = Field(low=0.0, high=COUNT, whole=True)  # rows since the last long gap
    interpolated = Field(low=0.0, high=COUNT, whole=True)  # samples
    _reserved = Field(2)


class SpikeRow(View):
    """A sample that `schuler.kernels.spikes.screen` found."""

    row = Field(low=1.0, high=COUNT, whole=True)
    time = Field(low=-TIME, high=TIME)
    channel = Field(low=0.0, high=5.0, whole=True)
    value = Field(low=-LARGEST, high=LARGEST)
    replaced_by = Field()


class StrapdownState(View):
    """State of `schuler.kernels.strapdown.navigate`; n is the wander frame."""

    quat_nb = Field(4)
    v_n = Field(3)  # m/s
    quat_en = Field(4)  # n to the Earth's frame: position
    height = Field()  # m
    acceleration_n = Field(3)  # of the last update, m/s^2
    waiting_time = Field()  # of the samples that wait, s
    time = Field()  # of the last update, s
    updates = Field()
    damping = Field()  # integral of the height damping, m/s^2
    since_row = Field()  # updates to the next row
    mat_nb_dt = Field(3, 3)  # integral of mat_nb since the last covariance, s
    f_n_dt = Field(3)  # of the force, m/s
    dt = Field()  # time since the last covariance, s
    ellipsoid = Field(5)  # at the last look, as from `ellipsoid`
    looked_sine2 = Field()  # squared sine of latitude at the last look
    looked_height = Field()
    _unused = Field(2)
    last_dtheta = Field(3)
    last_dvel = Field(3)
    waiting = Field()  # samples for a full update
    waiting_samples = Field(4, 6)
    _reserved = Field(7)

    def row(self) -> PathRow:
        """Return where the navigation is, as a row of its path."""
        row = PathRow.zeros()
        row.time, row.height = self.time, self.height
        row.quat_nb, row.v_n, row.quat_en = self.quat_nb, self.v_n, self.quat_en
        return row


class PathRow(View):
    """A row of a path, as `navigate` leaves it."""

    time = Field()  # s
    quat_nb = Field(4)
    v_n = Field(3)  # m/s
    quat_en = Field(4)
    height = Field()  # m


class ErrorStates(View):
    """Error states of `schuler.kernels.covariance`, in the wander frame: estimate minus truth."""

    phi = Field(3)  # rad
    velocity = Field(3)  # m/s
    position = Field(3)  # m
    gyro_bias = Field(3)  # rad/s
    accel_bias = Field(3)  # m/s^2


class InstrumentErrors(View):
    """Errors of an instrument: measured = true + M true + bias, and random walks."""

    gyro_bias = Field(3)  # rad/s
    gyro_matrix = Field(3, 3)
    accel_bias = Field(3)  # m/s^2
    accel_matrix = Field(3, 3)
    angle_walk = Field()  # rad/sqrt(s)
    velocity_walk = Field()  # m/s/sqrt(s)


class ErrorNoise(View):
    """Power densities of an instrument, and the step of the covariance."""

    gyro_white = Field()  # rad^2/s
    accel_white = Field()  # m^2/s^3
    gyro_walk = Field()  # of the bias, rad^2/s^3
    accel_walk = Field()  # of the bias, m^2/s^5
    step = Field()  # s


class LocalRow(View):
    """A row of a path in East-North-Up, as `local` makes it."""

    time = Field()  # s
    quat_nb = Field(4)
    v_n = Field(3)  # east, north, up, m/s
    lat = Field()  # rad
    lon = Field()  # rad
    height = Field()  # m
    wander = Field()  # from east to the wander frame's x axis, counter-clockwise, rad


class StrapdownOptions(View):
    """Options of the strapdown kernel."""

    gravity_model = Field()
    gravity_value = Field()  # m/s^2, of the constant model
    vertical_mode = Field()
    damping_gains = Field(3)
    held_height = Field()  # m
