"""From rows of a file to increments, one row at a time: rows are checked, then integrated.

`check` takes rows as they come and passes on those that are valid; `schuler.kernels.spikes.screen`
then replaces single bad samples; `integrate` fills gaps and makes increments.
"""

from __future__ import annotations

import math

from schuler.kernels._jit import helper, kernel
from schuler.kernels.gaps import FILLED, HISTORY, SHORT, bridge, fill
from schuler.kernels.lanes import (
    abs4,
    any_at_least4,
    larger4,
    load_row4,
    splat4,
    store_row4,
    where_equal4,
)
from schuler.kernels.states import LARGEST, IntakeRow, IntakeState

ROW = IntakeRow.size
STATE_SIZE = IntakeState.size

_LOOKED_AT = (94, 36, 54, 30, 42, 48, 60, 66)
"""Where the state keeps of each channel: last value, run, longest run, largest size, the longest
run there and its rows, sum, sum of squares."""
_LOOKS = 8

OK, BACKWARD, REPEATED, GAP, BAD_TIME, OVERLAP, TOO_LARGE = 0, 1, 2, 3, 4, 5, 6
RATES, MEAN_RATES, INCREMENTS = 0, 1, 2


@kernel
def check(state, nominal, max_gap, t, x, out, steps=None):
    """Check rows, and pass on those that are valid.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    nominal, max_gap : float
        Nominal interval, and the longest interval that is bridged (s).
    t, x : (n,), (n, 6) float64
        Time and gyro, accelerometer values in SI and body axes.
    out : (n, ROW) float64
        Filled with the valid rows.
    steps : (n,) float64, optional
        Interval lengths that are known exactly: a gap is time that no interval covers.

    Returns
    -------
    (int, int, int)
        Rows written, error code (`OK` ...) and the row in this chunk that made it.
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
                    if x[i, j] != state[80 + j]:
                        return m, REPEATED, i
                state[18] += 1.0
                continue
            if steps is not None and steps[i] > dt + 1e-3 * nominal:
                return m, OVERLAP, i
        else:
            state[75] = ti

        missing = 0.0
        if started and dt > 1.5 * nominal:
            missing = dt - nominal if steps is None else dt - steps[i]
            if (dt if steps is None else missing) > max_gap:
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

        out[m, 0] = state[0]
        out[m, 1] = ti
        for j in range(6):
            out[m, 2 + j] = x[i, j]
            state[80 + j] = x[i, j]
        out[m, 8] = 0.0 if steps is None else steps[i]
        # Intervals that are known stay as they are, holes included.
        lost = missing > 0.5 * nominal and steps is None
        out[m, 9] = max(1.0, math.floor(missing / nominal + 0.5)) if lost else 0.0
        odd = steps is not None and abs(steps[i] - nominal) > 0.2 * nominal
        out[m, 10] = -1.0 if odd else (missing if missing > 0.5 * nominal else 0.0)
        m += 1
        state[1] = 1.0
        state[3] = ti
    return m, OK, -1


@kernel
def look(state, rows, begin, end, work):
    """Count what the channels look like: extremes, runs, sums.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    rows : (n, ROW) float64
    begin, end : int
        Rows to look at.
    work : (>= 8, >= 4) float64
        Scratch.
    """
    if begin == end:
        return
    first = state[72] == 0.0
    state[72] += end - begin
    for part in range(2):
        x, y, z = 2 + 3 * part, 3 + 3 * part, 4 + 3 * part
        k = 86 + 4 * part
        run, changes, shortest, longest = state[k], state[k + 1], state[k + 2], state[k + 3]
        a, b, c = state[92 + x], state[92 + y], state[92 + z]
        total = state[76 + part]
        for i in range(begin, end):
            d, e, f = rows[i, x], rows[i, y], rows[i, z]
            if (first and i == begin) or (d == a and e == b and f == c):
                run += 1.0
            else:
                if changes >= 1.0:
                    shortest = run if changes == 1.0 else min(shortest, run)
                    longest = max(longest, run)
                changes += 1.0
                run = 1.0
            a, b, c = d, e, f
            total += math.sqrt(d * d + e * e + f * f)
        state[k], state[k + 1], state[k + 2], state[k + 3] = run, changes, shortest, longest
        state[76 + part] = total
    # Four channels at a time; the last two numbers of the second group are no channels.
    one = splat4(1.0)
    for group in range(0, 8, 4):
        c = 2 + group
        channels = min(4, 6 - group)
        for k in range(4):
            for what in range(_LOOKS):
                there = k < channels
                work[what, k] = state[_LOOKED_AT[what] + group + k] if there else 0.0
            if k >= channels:
                # Of what is no channel nothing is the largest.
                work[3, k] = math.inf
        before, run, most = load_row4(work, 0, 0), load_row4(work, 1, 0), load_row4(work, 2, 0)
        largest, total, squares = (
            load_row4(work, 3, 0),
            load_row4(work, 6, 0),
            load_row4(work, 7, 0),
        )
        for i in range(begin, end):
            v = load_row4(rows, i, c)
            a = abs4(v)
            run = where_equal4(v, before, run + one, one) if not (first and i == begin) else one
            before = v
            most = larger4(run, most)
            if any_at_least4(a, largest):
                store_row4(work, 1, 0, run)
                for k in range(channels):
                    size, length = abs(rows[i, c + k]), work[1, k]
                    if size > work[3, k]:
                        work[3, k], work[4, k], work[5, k] = size, length, 0.0
                    elif size == work[3, k]:
                        work[4, k] = max(work[4, k], length)
                        if length == 3.0:
                            work[5, k] += 3.0
                        elif length > 3.0:
                            work[5, k] += 1.0
                largest = load_row4(work, 3, 0)
            total = total + v
            squares = squares + v * v
        store_row4(work, 0, 0, before)
        store_row4(work, 1, 0, run)
        store_row4(work, 2, 0, most)
        store_row4(work, 6, 0, total)
        store_row4(work, 7, 0, squares)
        for k in range(channels):
            for what in range(_LOOKS):
                state[_LOOKED_AT[what] + group + k] = work[what, k]


@helper
def _store(turn, push, m, j, value):
    """Write an increment of channel j, 0 to 5."""
    if j < 3:
        turn[m, j] = value
    else:
        push[m, j - 3] = value


@kernel
def _plain(state, history, kind, m, rows, begin, end, out_t, out_dt, turn, push, values):
    """Integrate rows without gaps that follow an integrated one; return the number of samples."""
    last, before = state[79], state[4]
    even = state[2] == 1.0
    for i in range(begin, end):
        ti, step = rows[i, 1], rows[i, 8]
        dt = ti - last
        out_t[m] = ti
        out_dt[m] = dt if step == 0.0 else step
        if kind == RATES:
            three = even and abs(dt - before) < 0.01 * dt
            for j in range(6):
                v = rows[i, 2 + j]
                left = rows[i - 1, 2 + j] if i > begin else state[5 + j]
                if three:
                    left2 = rows[i - 2, 2 + j] if i > begin + 1 else (
                        state[5 + j] if i > begin else state[11 + j]
                    )  # fmt: skip
                    s = (5.0 * v + 8.0 * left - left2) / 12.0
                else:
                    s = 0.5 * (v + left)
                _store(turn, push, m, j, s * dt)
                values[m + 1, j] = v
        elif kind == MEAN_RATES:
            for j in range(6):
                _store(turn, push, m, j, rows[i, 2 + j] * dt)
        else:
            for j in range(6):
                _store(turn, push, m, j, rows[i, 2 + j])
        m += 1
        last, before, even = ti, dt, True
    n = end - begin
    for j in range(6):
        state[11 + j] = rows[end - 2, 2 + j] if n > 1 else state[5 + j]
        state[5 + j] = rows[end - 1, 2 + j]
    # Only the last of them stay in the history.
    for i in range(max(begin, end - HISTORY), end):
        slot = (int(state[100]) + i - begin) & (HISTORY - 1)
        for j in range(6):
            history[slot, j] = rows[i, 2 + j]
    state[100] += n
    state[2], state[4], state[79] = 1.0, before, last
    return m


@helper
def _put(state, history, kind, m, ti, dt, step, x, r, out_t, out_dt, turn, push, values):
    """Integrate one row of six values, x[r, 2] on; return the number of samples.

    Row m + 1 of `values` is filled with what came, row 0 of a record's first with its opening row.
    """
    started = state[78] == 1.0
    if kind == RATES:
        if started:
            # Three points (Adams-Moulton) on an even grid, the trapezoid elsewhere.
            even = state[2] == 1.0 and abs(dt - state[4]) < 0.01 * dt
            for j in range(6):
                v = x[r, 2 + j]
                if even:
                    s = (5.0 * v + 8.0 * state[5 + j] - state[11 + j]) / 12.0
                else:
                    s = 0.5 * (v + state[5 + j])
                _store(turn, push, m, j, s * dt)
                values[m + 1, j] = v
            out_t[m] = ti
            out_dt[m] = dt
            m += 1
        else:
            for j in range(6):
                values[0, j] = x[r, 2 + j]
    else:
        length = dt if step == 0.0 else step
        for j in range(6):
            value = x[r, 2 + j] * dt if kind == MEAN_RATES else x[r, 2 + j]
            _store(turn, push, m, j, value)
        out_t[m] = ti
        out_dt[m] = length
        m += 1
    if started:
        state[2] = 1.0
        state[4] = dt
    slot = int(state[100]) & (HISTORY - 1)
    for j in range(6):
        if started:
            state[11 + j] = state[5 + j]
        state[5 + j] = x[r, 2 + j]
        history[slot, j] = x[r, 2 + j]
    state[100] += 1.0
    state[78] = 1.0
    state[79] = ti
    return m


@kernel
def integrate(
    state, history, kind, nominal, rows, begin, end, close, work, out_t, out_dt, turn, push, values
):
    """Turn rows that are checked and screened into increments, gaps filled.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    history : (HISTORY, 6) float64
        The last values, ring-wise.
    kind : int
        `RATES` (instantaneous), `MEAN_RATES` (over the interval that ends at the row) or
        `INCREMENTS`.
    nominal : float
        Nominal interval, s.
    rows : (n, ROW) float64
    begin, end : int
        Rows to take.
    close : bool
        Nothing comes after `end`: a gap is filled by what there is.
    work : (19, 16) float64
        Scratch (`schuler.kernels.gaps.WORK`).
    out_t, out_dt, turn, push : (m,), (m,), (m, 3), (m, 3) float64
        Filled with the samples: times, intervals, angle and velocity increments.
    values : (m + 1, 6) float64
        For `RATES`: the values at the samples' ends, after that at the first one's start.

    Returns
    -------
    (int, int)
        Samples written, and the first row that was not taken, as it waits for rows after a gap.
    """
    # Nothing, but no literal: of a literal 0 Numba would compile all that takes it once more.
    m = min(begin, 0)
    for j in range(6):
        values[0, j] = state[5 + j]
    i = begin
    while i < end:
        lost = int(rows[i, 9])
        if lost == 0 and state[78] == 1.0:
            stop = i + 1
            while stop < end and rows[stop, 9] == 0.0:
                stop += 1
            look(state, rows, i, stop, work)
            m = _plain(state, history, kind, m, rows, i, stop, out_t, out_dt, turn, push, values)
            i = stop
            continue
        ti = rows[i, 1]
        step = rows[i, 8]
        dt = nominal if state[78] == 0.0 else ti - state[79]
        if lost > 0 and state[78] == 1.0:
            # Rows that follow without another gap.
            wanted = min(max(lost, 3), HISTORY)
            after = 1
            while after < wanted and i + after < end and rows[i + after, 9] == 0.0:
                after += 1
            if after < wanted and i + after == end and not close:
                return m, i
            before = int(min(state[100], HISTORY))
            newest = int(state[100])
            start = state[79]
            span = rows[i, 10]
            if lost <= SHORT:
                part = dt / (lost + 1.0)
                fill(history, newest, before, rows, i, after, lost, work)
                # Increments belong to nominal intervals; what is filled has its own length.
                scale = span / (lost * nominal) if kind == INCREMENTS else 1.0
                for k in range(lost):
                    for j in range(6):
                        work[FILLED + k, 2 + j] *= scale
                    m = _put(state, history, kind, m, start + (k + 1) * part, part, 0.0,
                             work, FILLED + k, out_t, out_dt, turn, push, values)  # fmt: skip
                dt = part
            else:
                # One sample, up to the end of this row's interval.
                bridge(history, newest, min(before, wanted), rows, i, after, work)
                state[100] = 0.0
                slot = m
                m = _put(state, history, kind, m, ti, dt, 0.0, rows, i,
                         out_t, out_dt, turn, push, values)  # fmt: skip
                for j in range(6):
                    if kind == RATES:
                        value = work[FILLED, 2 + j] * dt
                    elif kind == MEAN_RATES:
                        value = work[FILLED, 2 + j] * span + rows[i, 2 + j] * (dt - span)
                    else:
                        value = work[FILLED, 2 + j] * (span / nominal) + rows[i, 2 + j]
                    _store(turn, push, slot, j, value)
                state[2] = 0.0
                state[101] += lost
                look(state, rows, i, i + 1, work)
                i += 1
                continue
            state[101] += lost
        look(state, rows, i, i + 1, work)
        m = _put(state, history, kind, m, ti, dt, step, rows, i, out_t, out_dt, turn, push, values)
        i += 1
    return m, end
