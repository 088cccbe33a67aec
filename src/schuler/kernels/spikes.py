"""Single bad samples: found by interpolation from their neighbours, and replaced by it.

For each channel, the interpolation with the smallest variance of its residuals is taken
(`schuler.kernels.residuals`). A value is a spike when

* its residual is larger than `SIGMAS` standard deviations, than `BEYOND` times the largest residual
  that stood alone and was no spike, and than three steps of the channel's resolution;
* it alone is off: with it replaced, the residuals of both neighbours are ordinary, those near by
  are `LOCAL` times smaller, and it equals no neighbour (a value that repeats was held);
* the other triad's residuals are ordinary in the row and in those beside it: a blow moves both;
* those of its own triad's other channels are ordinary beside it.

Of a residual that is more than `FAR` times its limit, the other channels' may be larger than
ordinary as far as it is: no blow moves one channel so much further than all others.

Where an interval is long enough for a blow, an accelerometer's spike must also be larger than one
(`set_smallest`).
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import _UNCOMPILED, kernel
from schuler.kernels.residuals import (
    AHEAD,
    BEYOND,
    BLOCK,
    DOUBTFUL,
    KEPT,
    LEAST,
    LOCAL,
    ORDINARY,
    QUIET,
    REACH,
    SETTING,
    SIGMAS,
    best_way,
    calm_near,
    is_ordinary,
    is_uneven,
    learn,
    learn_rows,
    limit_of,
    look_over,
    median_of,
    renew,
    residual_of,
    set_smallest,
    update,
)

__all__ = [
    "AHEAD", "KEPT", "LEAST", "REACH", "SETTING", "WORK", "learn", "screen", "set_smallest",
]  # fmt: skip

FAR = 30.0

_BLOCKS = not _UNCOMPILED
"""Whether blocks of rows are looked at together; as Python they take longer than their rows."""

_FORETOLD, _SPREAD, _WANTED, _CALM, _LIMITS, _SIZES = range(6)
WORK = (6, KEPT)
"""Scratch of `screen`: for each channel what the judgement of an edge finds, limits, residuals."""


@kernel
def _edge(rows, at, inward, count, settings, work):
    """Judge the first or the last row, which has neighbours on one side only.

    Parameters
    ----------
    rows : (n, ROW) float64
    at, inward : int
        The row, and 1 (first) or -1 (last): the way to its neighbours.
    count : int
        Rows to learn from.
    settings : (6, SETTING) float64
        The smallest spike is looked at.
    work : WORK float64
        Filled: what the neighbours foretell, how far that usually is off, and which channels are
        off (1).
    """
    for j in range(6):
        c = 2 + j
        best = np.inf
        work[_WANTED, j] = 0.0
        work[_CALM, j] = 1.0
        smallest = 0.0
        for k in range(1, count + 1):
            step = abs(rows[at + inward * k, c] - rows[at + inward * (k + 1), c])
            if step > 0.0 and (smallest == 0.0 or step < smallest):
                smallest = step
        for way in range(4):
            value = 0.0
            off = 0.0
            for k in range(count + 1):
                p = at + inward * k
                a, b, d = rows[p + inward, c], rows[p + 2 * inward, c], rows[p + 3 * inward, c]
                if way == 0:
                    guess = (a + b + d) / 3.0
                elif way == 1:
                    guess = 2.0 * a - b
                elif way == 2:
                    guess = 3.0 * (a - b) + d
                else:
                    guess = 4.0 * (a + d) - 6.0 * b - rows[p + 4 * inward, c]
                r = abs(rows[p, c] - guess)
                if k == 0:
                    value, off = guess, r
                else:
                    work[_SIZES, k - 1] = r
            sigma = 1.4826 * median_of(work[_SIZES], count)
            if sigma < best:
                best = sigma
                most = work[_SIZES, 0]
                for k in range(1, count):
                    most = max(most, work[_SIZES, k])
                work[_FORETOLD, j], work[_SPREAD, j] = value, sigma
                limit = max(SIGMAS * sigma, BEYOND * most, 3.0 * smallest, settings[j, 7])
                there = off > limit and rows[at, c] != rows[at + inward, c]
                work[_WANTED, j] = 1.0 if there else 0.0
                work[_CALM, j] = 1.0 if off <= max(ORDINARY * sigma, most, smallest) else 0.0
    for j in range(6):
        first = 3 if j < 3 else 0
        for k in range(first, first + 3):
            work[_WANTED, j] *= work[_CALM, k]


@kernel
def _shaken(rows, settings, i, n, first, slack):
    """Say whether a triad is shaken in a row or beside it."""
    for p in range(max(i - 1, 0), min(i + 2, n)):
        for j in range(first, first + 3):
            if not is_ordinary(rows, settings[j], p, n, 2 + j, False, 0.0, slack):
                return True
    return False


@kernel
def _moved(rows, settings, i, n, own, slack):
    """Say whether another channel of the same triad is shaken beside a row.

    In the row itself it may be bad, too: there its value is left out of the judgement.
    """
    first = 0 if own < 3 else 3
    for j in range(first, first + 3):
        if j == own:
            continue
        c = 2 + j
        s = settings[j]
        value = rows[i, c]
        way = best_way(s, i, n, REACH)
        rows[i, c] = value - residual_of(rows, i, c, way)
        spread = math.sqrt(s[way])
        calm = is_ordinary(rows, s, i - 1, n, c, False, spread, slack) and is_ordinary(
            rows, s, i + 1, n, c, False, spread, slack
        )
        rows[i, c] = value
        if not calm:
            return True
    return False


@kernel
def _note(rows, i, j, value, found, spikes):
    """Write a spike that has been replaced; return the number of spikes."""
    found[spikes, 0], found[spikes, 1], found[spikes, 2] = rows[i, 0], rows[i, 1], j
    found[spikes, 3], found[spikes, 4] = value, rows[i, 2 + j]
    return spikes + 1


@kernel
def _judge_edge(rows, n, at, count, settings, found, spikes, work):
    """Look at the first or the last row; return the number of spikes."""
    inward = 1 if at == 0 else -1
    if is_uneven(rows, at, n):
        return spikes
    _edge(rows, at, inward, count - REACH - 2, settings, work)
    for j in range(6):
        if work[_WANTED, j] == 0.0 or spikes >= found.shape[0]:
            continue
        value = rows[at, 2 + j]
        rows[at, 2 + j] = work[_FORETOLD, j]
        # A spike in the second row would spoil what is foretold, and show in the third.
        if is_ordinary(
            rows, settings[j], at + inward, n, 2 + j, True, work[_SPREAD, j]
        ) and is_ordinary(rows, settings[j], at + 2 * inward, n, 2 + j, True, work[_SPREAD, j]):
            spikes = _note(rows, at, j, value, found, spikes)
        else:
            rows[at, 2 + j] = value
    return spikes


@kernel
def _judge(rows, n, i, j, settings, found, spikes):
    """Look at a channel of a row between others; return the number of spikes."""
    c = 2 + j
    s = settings[j]
    way = best_way(s, i, n, REACH)
    r = residual_of(rows, i, c, way)
    value = rows[i, c]
    if r * r <= limit_of(settings, j, way) or value == rows[i - 1, c] or value == rows[i + 1, c]:
        return spikes
    if is_uneven(rows, i, n):
        return spikes
    # No blow moves one channel `FAR` times as far as all others, each in parts of its own noise.
    limit = max(math.sqrt(limit_of(settings, j, way)), 1e-150)
    slack = max(1.0, abs(r) / (FAR * limit))
    if _shaken(rows, settings, i, n, 3 if j < 3 else 0, slack) or _moved(
        rows, settings, i, n, j, slack
    ):
        return spikes
    rows[i, c] = value - r
    spread = math.sqrt(s[way])
    if (
        spikes < found.shape[0]
        and is_ordinary(rows, s, i - 1, n, c, True, spread)
        and is_ordinary(rows, s, i + 1, n, c, True, spread)
        and calm_near(rows, s, i, n, c, abs(r) / LOCAL)
    ):
        return _note(rows, i, j, value, found, spikes)
    rows[i, c] = value
    return spikes


@kernel
def screen(rows, n, begin, first, close, settings, found, work, ways):
    """Look at each row that enough follow, and replace its spikes.

    Parameters
    ----------
    rows : (n, ROW) float64
        Changed where a spike is found. Those before `begin` have been looked at.
    n, begin : int
        Rows there are, and the first to look at; `begin` is 0 at the start of a record only.
    first : int
        At the start of a record: rows to learn its first row's likely value from.
    close : bool
        No row follows.
    settings : (6, SETTING) float64
    found : (m, 5) float64
        Filled with row number, time, channel, the value as it came and what took its place.
    work : WORK float64
    ways : (6,) int64
        Scratch.

    Returns
    -------
    (int, int)
        First row that was not looked at, and the number of spikes.
    """
    # Nothing, but no literal: of a literal 0 Numba would compile all that takes it once more.
    spikes = min(begin, 0)
    ended = False
    limits = work[_LIMITS]
    renew(settings, ways, limits)
    # The last row that is unlike its neighbours: near it nothing is learnt.
    odd = -1
    for k in range(max(begin - 2 * REACH, 0), begin):
        if rows[k, 10] != 0.0:
            odd = k
    slow = -1
    i = begin
    while i < n if close else i + AHEAD < n:
        if _BLOCKS and slow < i and i >= 2 * REACH and i + BLOCK + AHEAD <= n:
            found_over = look_over(rows, i, i + BLOCK, settings, work)
            if found_over != DOUBTFUL:
                quiet = found_over == QUIET
                learn_rows(rows, i - REACH, i + BLOCK - REACH, n, settings, quiet, work)
                renew(settings, ways, limits)
                i += BLOCK
                continue
            # Row by row from here to the block's end.
            slow = i + BLOCK - 1
        if i == 0:
            spikes = _judge_edge(rows, n, i, min(first, KEPT), settings, found, spikes, work)
        if close and not ended and i + AHEAD >= n:
            # Before the rows beside it, whose residuals it would spoil.
            spikes = _judge_edge(rows, n, n - 1, min(n, KEPT), settings, found, spikes, work)
            ended = True
        if REACH <= i < n - REACH:
            for j in range(6):
                r = residual_of(rows, i, 2 + j, ways[j])
                if r * r > limits[j]:
                    spikes = _judge(rows, n, i, j, settings, found, spikes)
        elif 0 < i < n - 1:
            for j in range(6):
                spikes = _judge(rows, n, i, j, settings, found, spikes)
        if rows[i, 10] != 0.0:
            odd = i
        if i >= 2 * REACH and odd <= i - 2 * REACH:
            update(rows, i - REACH, n, settings, ways, limits)
        i += 1
    return i, spikes
