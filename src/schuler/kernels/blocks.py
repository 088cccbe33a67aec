"""Sums over stretches of about a second, for what a record looks like.

When the table is full, neighbours are joined and the wanted length doubles: constant memory for
any length and any chunking.
"""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel
from schuler.kernels.states import STRETCH_CAPACITY, StretchSums, SummaryState

CAPACITY = STRETCH_CAPACITY
ROW = StretchSums.size
STATE_SIZE = SummaryState.size

SAME = 1e-9
"""Rates that differ by less repeat, but for rounding."""


@kernel
def summarise(state, table, time, dt, dtheta, dvel, values=None):
    """Feed a chunk of samples; row `rows` of the table is the stretch under way.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        `SummaryState`; zero but for the wanted length at the start.
    table : (CAPACITY, ROW) float64
        `StretchSums` by `StretchSums`; zero at the start.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    values : (n, 6) float64, optional
        The rates as they came, to judge noise by; those of the increments when not given.
    """
    for i in range(time.shape[0]):
        k = int(state[0])
        r = 1.0 / dt[i]
        w2 = 0.0
        f2 = 0.0
        dw2 = 0.0
        df2 = 0.0
        new = state[2] == 0.0
        for j in range(3):
            w, f = dtheta[i, j] * r, dvel[i, j] * r
            table[k, 3 + j] += dtheta[i, j]
            table[k, 6 + j] += dvel[i, j]
            w2 += w * w
            f2 += f * f
            if values is not None:
                w, f = values[i, j], values[i, 3 + j]
            # The second difference is blind to slow motion: what is left is noise.
            a = w - 2.0 * state[6 + j] + state[12 + j]
            b = f - 2.0 * state[9 + j] + state[15 + j]
            dw2 += a * a
            df2 += b * b
            new = (
                new
                or abs(w - state[6 + j]) > SAME * abs(w)
                or (abs(f - state[9 + j]) > SAME * abs(f))
            )
        if new:
            # A sensor that runs slower than the record repeats its values.
            ew2 = 0.0
            ef2 = 0.0
            for j in range(3):
                w, f = dtheta[i, j] * r, dvel[i, j] * r
                if values is not None:
                    w, f = values[i, j], values[i, 3 + j]
                a = w - 2.0 * state[6 + j] + state[21 + j]
                b = f - 2.0 * state[9 + j] + state[24 + j]
                ew2 += a * a
                ef2 += b * b
                state[21 + j], state[24 + j] = state[6 + j], state[9 + j]
            state[27] += 1.0
            if state[27] > 2.0:
                state[18] += ew2
                state[19] += ef2
                state[20] += 1.0
        for j in range(3):
            w, f = dtheta[i, j] * r, dvel[i, j] * r
            if values is not None:
                w, f = values[i, j], values[i, 3 + j]
            state[12 + j], state[15 + j] = state[6 + j], state[9 + j]
            state[6 + j], state[9 + j] = w, f
        state[2] += 1.0
        if state[2] > 2.0:
            state[3] += dw2
            state[4] += df2
            state[5] += 1.0
        f1 = math.sqrt(f2)
        table[k, 14] = f1 if table[k, 2] == 0.0 else min(table[k, 14], f1)
        table[k, 0] = time[i]
        table[k, 1] += dt[i]
        table[k, 2] += 1.0
        table[k, 9] += w2
        table[k, 10] += f2
        table[k, 11] += f1
        table[k, 12] = max(table[k, 12], math.sqrt(w2))
        table[k, 13] = max(table[k, 13], f1)
        if table[k, 1] < state[1] - 0.5 * dt[i]:
            continue
        k += 1
        if k == table.shape[0]:
            k //= 2
            for h in range(k):
                for c in range(1, 12):
                    table[h, c] = table[2 * h, c] + table[2 * h + 1, c]
                table[h, 12] = max(table[2 * h, 12], table[2 * h + 1, 12])
                table[h, 13] = max(table[2 * h, 13], table[2 * h + 1, 13])
                table[h, 14] = min(table[2 * h, 14], table[2 * h + 1, 14])
                table[h, 0] = table[2 * h + 1, 0]
            for h in range(k, table.shape[0]):
                for c in range(table.shape[1]):
                    table[h, c] = 0.0
            state[1] *= 2.0
        state[0] = k
