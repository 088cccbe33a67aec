"""The body of a moving vehicle from its start on, at instants of other measurements.

In ib0, the body frame frozen at the start: attitude, and the single and the double integral of the
force. Beside them the integral of the attitude's matrix, which says what a constant bias makes of
all three. An instant inside a sample divides its increments in proportion, and the pass goes on
with the whole sample, so that rows do not change the pass, nor does the chunking.

A row is written with the first sample that ends after its instant: the rate there is that of the
line through the mean rates of two neighbouring samples.
"""

from __future__ import annotations

from schuler.kernels._jit import kernel
from schuler.kernels.entries import four, put_four, put_three, three
from schuler.kernels.increments import coned, normalised, previous_pair, rotated_velocity
from schuler.kernels.quat import qexp, qmul, qrotate, quat_to_matrix
from schuler.kernels.vec import add, axpy, scale

__all__ = [
    "R_QUAT", "R_RATE", "R_SIZE", "R_TIME", "R_TURN", "R_VELOCITY", "R_WAY", "STATE_SIZE", "follow",
]  # fmt: skip

# The state; the start of a record is all zeros but for the quaternion.
QUAT = 0  # 4, body to ib0
VELOCITY = 4  # 3, integral of the force in ib0, m/s
WAY = 7  # 3, integral of that, m
TURN = 10  # 9, integral of the matrix from body to ib0, by rows, s
ANGLE_BEFORE = 19  # 3, the last sample
VELOCITY_BEFORE = 22  # 3
INTERVAL_BEFORE = 25  # 0 before the first sample
SAMPLES = 26
STATE_SIZE = 27

# A row.
R_TIME = 0
R_QUAT = 1  # 4
R_VELOCITY = 5  # 3
R_WAY = 8  # 3
R_TURN = 11  # 9
R_RATE = 20  # 3, angular rate, body axes, rad/s
R_SIZE = 23

_ROUNDING = 1e-6
"""An instant so little before the end of a sample is that end, s."""


@kernel
def follow(state, coning, sculling, time, dt, dtheta, dvel, due, closing, rows):
    """Feed a chunk of samples; return how many rows were written.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    coning, sculling : float
        1 to correct with the sample before, 0 where the instrument has done it.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    due : (m,) float64
        Instants that have no row yet, ascending, none before the chunk.
    closing : float
        1 where no sample follows: instants at the end of the last sample are due, too.
    rows : (m, R_SIZE) float64
    """
    s = state
    written = 0
    n = time.shape[0]
    for i in range(n):
        a = (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2])
        v = (dvel[i, 0], dvel[i, 1], dvel[i, 2])
        before_a, before_v = three(s, ANGLE_BEFORE), three(s, VELOCITY_BEFORE)
        step = dt[i]
        con, scu = previous_pair(before_a, before_v, a, v)
        q = four(s, QUAT)
        v0, r0 = three(s, VELOCITY), three(s, WAY)
        start = time[i] - step
        edge = time[i] - _ROUNDING
        if closing != 0.0 and i == n - 1:
            edge = time[i] + _ROUNDING
        while written < due.shape[0] and due[written] < edge:
            t = min(max(due[written] - start, 0.0), step)
            p = t / step
            # Corrections grow with the square of the part that is taken.
            u = rotated_velocity(sculling, scale(p, a), scale(p, v), scale(p * p, scu))
            dv = qrotate(q, u)
            half = qmul(q, qexp(scale(0.5 * p, a)))
            row = rows[written]
            row[R_TIME] = due[written]
            put_four(row, R_QUAT, normalised(qmul(q, qexp(axpy(coning * p * p, con, scale(p, a))))))
            put_three(row, R_VELOCITY, add(v0, dv))
            put_three(row, R_WAY, axpy(t, v0, axpy(0.5 * t, dv, r0)))
            m = quat_to_matrix(half)
            for k in range(3):
                for c in range(3):
                    row[R_TURN + 3 * k + c] = s[TURN + 3 * k + c] + t * m[k][c]
            rate = scale(1.0 / step, a)
            if s[INTERVAL_BEFORE] > 0.0:
                last = scale(1.0 / s[INTERVAL_BEFORE], before_a)
                # Means hold at the middle of their samples.
                part = (t + 0.5 * s[INTERVAL_BEFORE]) / (0.5 * (step + s[INTERVAL_BEFORE]))
                rate = axpy(part, rate, scale(1.0 - part, last))
            put_three(row, R_RATE, rate)
            written += 1
        dv = qrotate(q, rotated_velocity(sculling, a, v, scu))
        m = quat_to_matrix(qmul(q, qexp(scale(0.5, a))))
        for k in range(3):
            for c in range(3):
                s[TURN + 3 * k + c] += step * m[k][c]
        put_three(s, WAY, axpy(step, v0, axpy(0.5 * step, dv, r0)))
        put_three(s, VELOCITY, add(v0, dv))
        put_four(s, QUAT, normalised(qmul(q, qexp(coned(coning, before_a, a)))))
        put_three(s, ANGLE_BEFORE, a)
        put_three(s, VELOCITY_BEFORE, v)
        s[INTERVAL_BEFORE] = step
        s[SAMPLES] += 1.0
    return written
