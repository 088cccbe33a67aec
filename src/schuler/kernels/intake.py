"""From rows of a file to increments, one row at a time: the door's compiled half.

State layout (float64, `STATE_SIZE` long), all zero at the start:

====== ======================================================================
0      rows seen
1      1 when a valid row has been seen
2      1 when the row before that is known too (for the three-point formula)
3      time of the last valid row
4      interval that ended at the last valid row (0 when unknown)
5-10   values of the last valid row
11-16  values of the row before it
17     rows dropped because a value was not finite
18     rows dropped because they repeat the row before
19     gaps bridged
20     longest gap, s
21     sum of dt, 22 sum of dt^2, 23 count of regular intervals (jitter)
24     time of the first gap, 25 row of the first gap
26     row of the first not-finite value, 27 its channel, 28 its time
30-35  largest |value|, 36-41 current run of equal values,
42-47  longest run at the largest |value|, 48-53 rows in such runs (of 3 or more)
54-59  longest run of equal values at all
60-65  sum of values, 66-71 sum of squares, 72 valid rows
73     shortest regular interval, 74 longest regular interval
75     time of the first valid row
76     sum of |gyro|, 77 sum of |accel|
====== ======================================================================
"""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel

STATE_SIZE = 80

OK, BACKWARD, REPEATED, GAP, BAD_TIME, OVERLAP, TOO_LARGE = 0, 1, 2, 3, 4, 5, 6
RATES, MEAN_RATES, INCREMENTS = 0, 1, 2

LARGEST = 1e12
"""Beyond any instrument in any unit (SI); squares and sums of such values stay finite."""


@kernel
def intake(state, kind, nominal, max_gap, t, x, out_t, out_dt, out, steps=None):
    """Check rows and turn them into increments.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    kind : int
        `RATES` (instantaneous), `MEAN_RATES` (over the interval that ends at the row) or
        `INCREMENTS`.
    nominal, max_gap : float
        Nominal interval, and the longest interval that is bridged (s).
    t, x : (n,), (n, 6) float64
        Time and gyro, accelerometer values in SI and body axes.
    out_t, out_dt, out : (n,), (n,), (n, 6) float64
        Filled with the samples.
    steps : (n,) float64, optional
        Interval lengths that are known exactly, for `INCREMENTS`: values are then taken as they
        are, and a gap is time that no interval covers.

    Returns
    -------
    (int, int, int)
        Samples written, error code (`OK` ...) and the row in this chunk that made it.
    """
    m = 0
    for i in range(t.shape[0]):
        state[0] += 1.0
        ti = t[i]
        if not math.isfinite(ti):
            return m, BAD_TIME, i
        bad = -1
        for j in range(6):
            if not math.isfinite(x[i, j]):
                bad = j
                break
        if bad >= 0:
            if state[17] == 0.0:
                state[26] = state[0]
                state[27] = bad
                state[28] = ti
            state[17] += 1.0
            continue
        for j in range(6):
            if abs(x[i, j]) > LARGEST:
                return m, TOO_LARGE, i
        started = state[1] == 1.0
        dt = nominal
        if started:
            dt = ti - state[3]
            if dt < 0.0:
                return m, BACKWARD, i
            if dt == 0.0:
                for j in range(6):
                    if x[i, j] != state[5 + j]:
                        return m, REPEATED, i
                state[18] += 1.0
                continue
            if steps is not None and steps[i] > dt + 1e-3 * nominal:
                return m, OVERLAP, i
        else:
            state[75] = ti

        # What the channels look like: extremes, runs, sums.
        state[72] += 1.0
        for j in range(6):
            v = x[i, j]
            a = abs(v)
            run = 1.0
            if started and v == state[5 + j]:
                run = state[36 + j] + 1.0
            state[36 + j] = run
            state[54 + j] = max(state[54 + j], run)
            if a > state[30 + j]:
                state[30 + j] = a
                state[42 + j] = run
                state[48 + j] = 0.0
            elif a == state[30 + j]:
                state[42 + j] = max(state[42 + j], run)
                if run == 3.0:
                    state[48 + j] += 3.0
                elif run > 3.0:
                    state[48 + j] += 1.0
            state[60 + j] += v
            state[66 + j] += v * v
        state[76] += math.sqrt(x[i, 0] ** 2 + x[i, 1] ** 2 + x[i, 2] ** 2)
        state[77] += math.sqrt(x[i, 3] ** 2 + x[i, 4] ** 2 + x[i, 5] ** 2)

        gap = started and dt > 1.5 * nominal
        if gap:
            missing = dt
            if steps is not None:
                missing = dt - steps[i]
            if missing > max_gap:
                return m, GAP, i
            if state[19] == 0.0:
                state[24] = state[3]
                state[25] = state[0]
            state[19] += 1.0
            state[20] = max(state[20], dt)
        elif started:
            state[21] += dt
            state[22] += dt * dt
            state[73] = dt if state[23] == 0.0 else min(state[73], dt)
            state[74] = max(state[74], dt)
            state[23] += 1.0

        if kind == RATES:
            if started:
                # Three points (Adams-Moulton) on an even grid, the trapezoid elsewhere.
                even = state[2] == 1.0 and abs(dt - state[4]) < 0.01 * dt
                for j in range(6):
                    if even:
                        s = (5.0 * x[i, j] + 8.0 * state[5 + j] - state[11 + j]) / 12.0
                    else:
                        s = 0.5 * (x[i, j] + state[5 + j])
                    out[m, j] = s * dt
                out_t[m] = ti
                out_dt[m] = dt
                m += 1
        else:
            # An increment that ends a gap covers one interval: its mean rate is held over the gap.
            s = dt
            if kind == INCREMENTS:
                s = dt / nominal if gap else 1.0
            if steps is not None:
                s = 1.0
                dt = steps[i]
            for j in range(6):
                out[m, j] = x[i, j] * s
            out_t[m] = ti
            out_dt[m] = dt
            m += 1

        if started:
            state[2] = 1.0
            state[4] = dt
            for j in range(6):
                state[11 + j] = state[5 + j]
        state[1] = 1.0
        state[3] = ti
        for j in range(6):
            state[5 + j] = x[i, j]
    return m, OK, -1
