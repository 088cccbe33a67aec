"""What stands in for lost rows: interpolation where it foretells, means where it makes noise.

A quintic through three neighbours on each side follows a vehicle's sway, and multiplies the noise
of a quiet one (by up to seven, in the middle of eight lost rows). So each way of filling is tried
on the rows before the gap, as if some of them had been lost, and that which gives their sum best
is taken, for each channel by itself.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels._jit import kernel

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


@kernel
def _weights(side, lost):
    """Return Lagrange's weights (lost, 2 side) on `side` rows before and after a gap."""
    nodes = np.empty(2 * side)
    for a in range(side):
        nodes[a] = a - side + 1.0
        nodes[side + a] = lost + 1.0 + a
    out = np.ones((lost, 2 * side))
    for k in range(lost):
        for a in range(2 * side):
            for b in range(2 * side):
                if a != b:
                    out[k, a] *= (k + 1.0 - nodes[b]) / (nodes[a] - nodes[b])
    return out


@kernel
def _mean_weights(side, lost):
    """Return the weights of a mean over `side` rows before and after a gap."""
    return np.full((lost, 2 * side), 0.5 / side)


@kernel
def fill(history, newest, before, rows, i, after, lost):
    """Return values (lost, 6) for rows lost before row i.

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
    """
    h = history.shape[0]
    out = np.empty((lost, 6))
    sides = np.array([3, 2, min(max(lost, 3), min(before, after))])
    for way in range(2):
        # Where rows are wanting, a way is that of fewer.
        sides[way] = min(sides[way], min(before, after))
    past = min(before, _TRIED)
    best = np.full(6, np.inf)
    for way in range(3):
        side = sides[way]
        w = _weights(side, lost) if way < 2 else _mean_weights(side, lost)
        total = np.zeros(2 * side)
        for k in range(lost):
            for a in range(2 * side):
                total[a] += w[k, a]
        trials = past - 2 * side - lost + 1
        for j in range(6):
            cost = 0.0
            for p in range(max(trials, 0)):
                # Oldest row of this trial: as many before the newest.
                base = newest - past + p
                off = 0.0
                for a in range(side):
                    off += total[a] * history[(base + a) % h, j]
                    off += total[side + a] * history[(base + side + lost + a) % h, j]
                for k in range(lost):
                    off -= history[(base + side + k) % h, j]
                cost += off * off
            cost = cost / trials if trials >= _LEAST else float(way)
            if way < 2:
                cost *= _BETTER
            if cost < best[j]:
                best[j] = cost
                for k in range(lost):
                    v = 0.0
                    for a in range(side):
                        v += w[k, a] * history[(newest - side + a) % h, j]
                        v += w[k, side + a] * rows[i + a, 2 + j]
                    out[k, j] = v
    return out


@kernel
def bridge(history, newest, before, rows, i, after):
    """Return the mean (6,) of the rows on both sides of a long gap; parameters as for `fill`."""
    h = history.shape[0]
    out = np.zeros(6)
    for j in range(6):
        earlier = 0.0
        for a in range(before):
            earlier += history[(newest - before + a) % h, j]
        later = 0.0
        for a in range(after):
            later += rows[i + a, 2 + j]
        out[j] = 0.5 * (earlier / before + later / after)
    return out
