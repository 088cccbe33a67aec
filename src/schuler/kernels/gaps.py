"""What stands in for lost rows: interpolation where it foretells, means where it makes noise.

A quintic through three neighbours on each side follows a vehicle's sway, and multiplies the noise
of a quiet one (by up to seven, in the middle of eight lost rows). So each way of filling is tried
on the rows before the gap, as if some of them had been lost, and that which gives their sum best
is taken, for each channel by itself.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels._jit import helper, kernel

SHORT = 8
"""Lost rows running that are filled one by one; more are bridged by one sample."""

HISTORY = 512
"""Rows that are kept before a gap."""

_TRIED = 128
"""Rows on which ways of filling are tried."""

_LEAST = 8
"""Trials that decide; with fewer the polynomial is taken."""

_BETTER = 2.0
"""A polynomial's squared error must be so many times smaller: a few trials scatter."""


FILLED, _TOTAL, _COST, _NODES = 8, 16, 17, 18
WORK = (19, 16)
"""Scratch of `fill`: weights, from row 8 on what is filled (as a row's values), and sums."""


@helper
def _weights(side, lost, work):
    """Set Lagrange's weights (lost, 2 side) on `side` rows before and after a gap."""
    for a in range(side):
        work[_NODES, a] = a - side + 1.0
        work[_NODES, side + a] = lost + 1.0 + a
    for k in range(lost):
        for a in range(2 * side):
            work[k, a] = 1.0
            for b in range(2 * side):
                if a != b:
                    node = work[_NODES, b]
                    work[k, a] *= (k + 1.0 - node) / (work[_NODES, a] - node)


@kernel
def fill(history, newest, before, rows, i, after, lost, work):
    """Find values for rows lost before row i.

    Parameters
    ----------
    history : (HISTORY, 6) float64
        The last values, ring-wise.
    newest, before : int
        How many values went into it, and how many of them are there.
    rows : (n, ROW) float64
        Row i and those after it.
    i, after : int
        The row after the gap, and how many follow without another (it included).
    lost : int
        `SHORT` at most.
    work : (19, 16) float64
        Scratch; rows 8 to 8 + lost are left with the values in columns 2 to 7.
    """
    h = history.shape[0]
    past = min(before, _TRIED)
    for j in range(6):
        work[_COST, j] = np.inf
    for way in range(3):
        # Where rows are wanting, a way is that of fewer.
        side = min(before, after)
        if way == 2:
            side = min(max(lost, 3), side)
            for k in range(lost):
                for a in range(2 * side):
                    work[k, a] = 0.5 / side
        else:
            side = min(3 - way, side)
            _weights(side, lost, work)
        for a in range(2 * side):
            work[_TOTAL, a] = 0.0
        for k in range(lost):
            for a in range(2 * side):
                work[_TOTAL, a] += work[k, a]
        trials = past - 2 * side - lost + 1
        for j in range(6):
            cost = 0.0
            for p in range(max(trials, 0)):
                # Oldest row of this trial: as many before the newest.
                base = newest - past + p
                off = 0.0
                for a in range(side):
                    off += work[_TOTAL, a] * history[(base + a) % h, j]
                    off += work[_TOTAL, side + a] * history[(base + side + lost + a) % h, j]
                for k in range(lost):
                    off -= history[(base + side + k) % h, j]
                cost += off * off
            cost = cost / trials if trials >= _LEAST else float(way)
            if way < 2:
                cost *= _BETTER
            if cost < work[_COST, j]:
                work[_COST, j] = cost
                for k in range(lost):
                    v = 0.0
                    for a in range(side):
                        v += work[k, a] * history[(newest - side + a) % h, j]
                        v += work[k, side + a] * rows[i + a, 2 + j]
                    work[FILLED + k, 2 + j] = v


@kernel
def bridge(history, newest, before, rows, i, after, work):
    """Find the mean of the rows on both sides of a long gap; parameters as for `fill`."""
    h = history.shape[0]
    for j in range(6):
        earlier = 0.0
        for a in range(before):
            earlier += history[(newest - before + a) % h, j]
        later = 0.0
        for a in range(after):
            later += rows[i + a, 2 + j]
        work[FILLED, 2 + j] = 0.5 * (earlier / before + later / after)
