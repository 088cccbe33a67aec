"""Layout of the error-state filter's arrays: one name for each entry, used by all its kernels.

Every array is float64 unless it is said otherwise. Matrices over the error state have rows padded
with zeros to a multiple of `PAD`, so that loops over a row need no remainder.
"""

from __future__ import annotations

PAD = 4
"""Rows of matrices are padded to a multiple of so many numbers."""


def padded(size: int) -> int:
    """Return the padded length of `size` error states."""
    return -(-size // PAD) * PAD


# Groups of error states; `at[group]` is the index of the first state of a group, or -1.
PHI = 0
VELOCITY = 1
POSITION = 2
GYRO_BIAS = 3
ACCELEROMETER_BIAS = 4
GYRO_MARKOV = 5
ACCELEROMETER_MARKOV = 6
GYRO_SCALE = 7
ACCELEROMETER_SCALE = 8
GYRO_MATRIX = 9
ACCELEROMETER_MATRIX = 10
FRAME_RATE = 11
BASE = 12
MOTION = 13
FLEXURE = 14  # angles and their rates: a second-order process
GROUPS = 15

# The nominal navigation, `state`.
TIME = 0
QUAT_NB = 1  # 4
V_N = 5  # 3
QUAT_NE = 8  # 4
HEIGHT = 12
ACCELERATION = 13  # 3, of the last update, n axes
DISPLACEMENT = 16  # 3, since the start, n axes; a fixed place only
QUAT_START = 19  # 4, attitude at the start
ANGLE_BEFORE = 23  # 3
VELOCITY_BEFORE = 26  # 3
RATE_B = 29  # 3, angular rate of the body in the last update
CONSUMED = 32  # part of the sample under way that is taken already
EPOCH_OPEN = 33  # 1 between the first and the last measurement of an epoch
EPOCH_TIME = 34
SAMPLES = 35
REFUSED = 36  # measurements that a gate or a robust rule refused
WEIGHED = 37  # measurements that a robust rule weighed down
RESETS = 38  # times that the lock-out guard widened the covariance
SQUARES = 39  # of this epoch: sum of squared normalised innovations
COUNT = 40  # of this epoch: scalar measurements taken
SPENT = 108  # 1 when the sums below have been used for a prediction
SUMS_END = 109
MEAN_ACCELERATION = 109  # 3, over the last `ACCELERATION_TIME`, n axes
# Sums since the last prediction, up to SUMS_END.
SPAN = 41
MEAN_C = 42  # 9, integral of C_b^n, by rows
MEAN_F = 51  # 3, integral of the specific force, n axes
GYRO_PRODUCT = 54  # 27, integral of C_ij w_k
FORCE_PRODUCT = 81  # 27, integral of C_ij f_k
RATE_NOW = 112  # 3, angular rate of the body at the end of the last update
MEAN_RATE = 115  # 3, the same over the last `ACCELERATION_TIME`
STATE_SIZE = 118

ACCELERATION_TIME = 0.2
"""Time over which acceleration and rate are averaged that a delay is multiplied by, s: noise of
single samples would make a delay look observable, and bias it towards zero."""

# Settings, `cfg`.
FIXED_PLACE = 0  # 1: latitude and height are known and do not change
EARTH = 1  # 3, Earth rate in n at a fixed place
GRAVITY = 4
FORCE_AT_REST = 5  # 1: gravity alone takes the tilt along, whatever the vehicle does
VERTICAL = 6  # 1: no vertical channel
STEP = 7  # longest step of a prediction, s
FEEDBACK = 8
CONING = 9
SCULLING = 10
HELD_HEIGHT = 11
CFG_SIZE = 12

# The kind of a measurement whose rows a user's own code gives; those of schuler's own are in
# `schuler.kernels.measurement_rows`.
CUSTOM = 9

# A row of the table of measurements.
M_TIME = 0
M_AID = 1
M_KIND = 2
M_VALUE = 3  # 3
M_SIGMA = 6  # 3; 0 where an axis is not measured
M_RATE = 9  # 3, rate of the body against n, and 3, its rate of change; where an aid has them
M_SIZE = 15

# What belongs to one aid, `aids[k]`.
A_LEVER = 0  # 3, from the IMU to the point that is measured, body axes
A_AT_LEVER = 3
A_DELAY = 4
A_AT_DELAY = 5
A_SCALE = 6
A_AT_SCALE = 7
A_MOUNT = 8  # 4, quaternion from body to the axes of the aid
A_AT_MOUNT = 12  # 3, one index for each axis
A_OFFSET = 15
A_AT_OFFSET = 16
A_BASELINE = 17  # 3
A_RULE = 20
A_LOW = 21
A_HIGH = 22
A_MEMORY = 23  # of the adaptive noise; 0: fixed
A_GATED = 24
A_GUARD_COUNT = 25
A_GUARD_TIME = 26
A_SOURCE = 27  # part of the budget that its noise belongs to
A_GATE = 28  # MOST_ROWS numbers: largest squared innovation by degrees of freedom
A_RATE_NOW = 34  # 1: the rate at the instant, not the mean of the last sample; 2: that of the row
A_SIZE = 35

PLAIN, HUBER, IGG3 = 0, 1, 2
"""Robust rules: none, weights of Huber, weights and refusals of IGG-III."""

# What an aid leaves behind, `aid_state[k]`.
S_REFUSED = 0  # epochs refused in a row
S_LAST = 1  # time of the last epoch that was taken
S_TAKEN = 2
S_NOISE = 3  # 6, adaptive variances
S_SIZE = 9

MOST_ROWS = 6
"""Scalar measurements that are judged together."""

# What is said of each measurement, `said[j]`.
D_INNOVATION = 0  # 3
D_SIGMA = 3  # 3, of the innovation
D_WEIGHT = 6  # least weight of its rows; 0 where it was refused
D_SIZE = 7

# Leading numbers of a row of the output; parameters (size) and variances (size) follow.
O_TIME = 0
O_QUAT = 1  # 4
O_V = 5  # 3
O_FRAME = 8  # 4
O_HEIGHT = 12
O_DISPLACEMENT = 13  # 3
O_SQUARES = 16
O_COUNT = 17
O_SIZE = 18

ALL_SAMPLES, AT_CUSTOM, TABLE_FULL = 0, 1, 2
"""Why `run` came back."""
