"""Single bad samples: found by interpolation from their neighbours, and replaced by it.

Three interpolations foretell a row: the mean of its two neighbours, the mean of three on each side,
and the cubic through two on each side. For each channel, that with the smallest variance of its
residuals is taken. A value is a spike when

* its residual is larger than `SIGMAS` standard deviations, than `BEYOND` times the largest residual
  that was not a spike, and than three steps of the channel's resolution;
* it alone is off: with it replaced, the residuals of both neighbours are ordinary, and it equals
  none of them (a value that repeats was held);
* the other triad's residuals are ordinary in the row and in those beside it: a blow moves both;
* those of its own triad's other channels are ordinary beside it.

Where an interval is long enough for a blow, an accelerometer's spike must also be larger than one
(`smallest`). The variance is a clipped exponential average, so that neither spikes nor shocks raise
it much.

Setting of a channel (`SETTING` numbers): 0-2 variances, 3-5 largest residuals of the three
interpolations, 6 resolution (0 where no two values have differed yet), 7 smallest spike.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper, kernel

SETTING = 8

SIGMAS = 10.0
BEYOND = 2.5
LOCAL = 3.0
ALIKE = 1.2
ORDINARY = 5.0
"""Residuals below so many standard deviations are ordinary."""

REACH = 3
"""Rows that an interpolation reaches on each side."""

KEPT = 64
"""Rows that are kept behind the one that is looked at, for the end of a record."""

AHEAD = 8
"""Rows that have to follow before one is judged."""

LEAST = 24
"""Of fewer rows nothing can be told."""

_BLOW, _PUSH = 4e-3, 0.05
"""A blow lasts longer than so many s, and changes the velocity by less than so many m/s."""

_ALPHA = 1.0 / 256.0
_CLIP = 9.0
_SIXTH = 1.0 / 6.0


@helper
def _residual(rows, i, c, way):
    """Return a value less its interpolation; column c of row i."""
    if way == 0:
        return rows[i, c] - 0.5 * (rows[i - 1, c] + rows[i + 1, c])
    near = rows[i - 1, c] + rows[i + 1, c]
    far = rows[i - 2, c] + rows[i + 2, c]
    if way == 2:
        return rows[i, c] - _SIXTH * (4.0 * near - far)
    return rows[i, c] - _SIXTH * (near + far + rows[i - 3, c] + rows[i + 3, c])


@kernel
def _reach(way):
    return 1 if way == 0 else (3 if way == 1 else 2)


@kernel
def _best(setting, i, n, widest):
    """Return the interpolation with the smallest variance that the rows allow, -1 for none."""
    best = -1
    for way in range(3):
        r = _reach(way)
        if r > widest or i - r < 0 or i + r >= n:
            continue
        if best < 0 or setting[way] < setting[best]:
            best = way
    return best


@kernel
def _ordinary(rows, setting, i, n, c, seen, spread=0.0):
    """Say whether a value is no further off its interpolation than many (or, `seen`, any) were.

    `spread` is what else its neighbours may be off by (1 sigma).
    """
    way = _best(setting, i, n, 2)
    if way < 0:
        return True
    limit = max(ORDINARY * max(math.sqrt(setting[way]), spread), setting[6])
    if seen:
        limit = max(limit, setting[3 + way])
    return abs(_residual(rows, i, c, way)) <= limit


@kernel
def _calm(rows, setting, i, n, c, limit):
    """Say whether no row near by is further off its interpolation than a limit."""
    for p in range(max(i - AHEAD + 2, 1), min(i + AHEAD - 1, n - 1)):
        way = _best(setting, p, n, 2)
        if abs(_residual(rows, p, c, way)) > limit:
            return False
    return True


@kernel
def _isolated(rows, setting, i, n, c, r):
    """Say whether a residual stands alone: with the value replaced, all is calm near by."""
    value = rows[i, c]
    rows[i, c] = value - r
    calm = _calm(rows, setting, i, n, c, abs(r) / ALIKE)
    rows[i, c] = value
    return calm


@kernel
def _uneven(rows, i, n):
    """Say whether a row of another length is near, whose value is not like the others."""
    least = 0.0
    for k in range(max(i - REACH, 0), min(i + REACH + 1, n)):
        least = min(least, rows[k, 10])
    return least < 0.0


@kernel
def smallest(settings, nominal, increments):
    """Set the smallest spike of each channel: none of a gyro, a slammed door's push of the others.

    Parameters
    ----------
    settings : (6, SETTING) float64
        Changed.
    nominal : float
        Interval, s.
    increments : bool
        Values are increments, and no rates.
    """
    if nominal < _BLOW:
        return
    for j in range(3, 6):
        settings[j, 7] = _PUSH if increments else _PUSH / nominal


@kernel
def learn(rows, count, settings):
    """Fill the settings (6, SETTING) from the first rows: medians, which no spike moves.

    Parameters
    ----------
    rows : (n, ROW) float64
    count : int
        Rows to look at, `LEAST` or more.
    settings : (6, SETTING) float64
        Zero, but for the smallest spike; filled.
    """
    for j in range(6):
        c = 2 + j
        s = settings[j]
        for i in range(1, count):
            step = abs(rows[i, c] - rows[i - 1, c])
            if step > 0.0 and (s[6] == 0.0 or step < s[6]):
                s[6] = step
        size = np.empty(count - 2 * REACH)
        for way in range(3):
            for i in range(REACH, count - REACH):
                size[i - REACH] = abs(_residual(rows, i, c, way))
            s[way] = (1.4826 * np.median(size)) ** 2
        # The largest but for one event, which may be a spike.
        way = _best(s, REACH, 2 * REACH + 1, REACH)
        worst, at = -1.0, 0
        for i in range(REACH, count - REACH):
            r = abs(_residual(rows, i, c, way))
            if r > worst:
                worst, at = r, i
        for way in range(3):
            for i in range(REACH, count - REACH):
                r = _residual(rows, i, c, way)
                # Counted as `screen` will, before which it has to hold off the first events.
                far = abs(i - at) > REACH and abs(r) > s[3 + way]
                if far and not _uneven(rows, i, count) and _isolated(rows, s, i, count, c, r):
                    s[3 + way] = abs(r)


@helper
def _limit(settings, j, way):
    """Return the square of what a residual of one interpolation must exceed."""
    seen = BEYOND * settings[j, 3 + way]
    step = 3.0 * settings[j, 6]
    least = settings[j, 7]
    return max(
        SIGMAS * SIGMAS * settings[j, way], max(seen * seen, max(step * step, least * least))
    )


@kernel
def _update(rows, i, n, settings, ways, limits):
    """Take the residuals of a row into the settings; renew the best ways and their limits."""
    for j in range(6):
        c = 2 + j
        x, left, right = rows[i, c], rows[i - 1, c], rows[i + 1, c]
        step = abs(x - left)
        rounding = settings[j, 6]
        if step > 0.0 and (rounding == 0.0 or step < rounding):
            settings[j, 6] = rounding = step
        near = left + right
        far = rows[i - 2, c] + rows[i + 2, c]
        r0 = x - 0.5 * near
        r1 = x - _SIXTH * (near + far + rows[i - 3, c] + rows[i + 3, c])
        r2 = x - _SIXTH * (4.0 * near - far)
        # Rounding alone has a twelfth of the squared step.
        least = rounding * rounding * (_CLIP / 12.0)
        v0, v1, v2 = settings[j, 0], settings[j, 1], settings[j, 2]
        v0 += _ALPHA * (min(r0 * r0, max(_CLIP * v0, least)) - v0)
        v1 += _ALPHA * (min(r1 * r1, max(_CLIP * v1, least)) - v1)
        v2 += _ALPHA * (min(r2 * r2, max(_CLIP * v2, least)) - v2)
        settings[j, 0], settings[j, 1], settings[j, 2] = v0, v1, v2
        if abs(r0) > settings[j, 3] and _isolated(rows, settings[j], i, n, c, r0):
            settings[j, 3] = abs(r0)
        if abs(r1) > settings[j, 4] and _isolated(rows, settings[j], i, n, c, r1):
            settings[j, 4] = abs(r1)
        if abs(r2) > settings[j, 5] and _isolated(rows, settings[j], i, n, c, r2):
            settings[j, 5] = abs(r2)
        best, v = 0, v0
        if v1 < v:
            best, v = 1, v1
        if v2 < v:
            best, v = 2, v2
        ways[j] = best
        limits[j] = _limit(settings, j, best)


@kernel
def _edge(rows, at, inward, count, settings, wanted, spread):
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
    wanted : (6,) bool
        Filled: which channels are off.
    spread : (6,) float64
        Filled: how far what is foretold usually is off.

    Returns
    -------
    (6,) float64
        What the neighbours foretell.
    """
    foretold = np.zeros(6)
    calm = np.ones(6, np.bool_)
    size = np.empty(count)
    for j in range(6):
        c = 2 + j
        best = np.inf
        wanted[j] = False
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
                    size[k - 1] = r
            sigma = 1.4826 * np.median(size)
            if sigma < best:
                best = spread[j] = sigma
                most = size.max()
                foretold[j] = value
                limit = max(SIGMAS * sigma, BEYOND * most, 3.0 * smallest, settings[j, 7])
                wanted[j] = off > limit and rows[at, c] != rows[at + inward, c]
                calm[j] = off <= max(ORDINARY * sigma, most, smallest)
    for j in range(6):
        first = 3 if j < 3 else 0
        for k in range(first, first + 3):
            wanted[j] = wanted[j] and calm[k]
    return foretold


@kernel
def _shaken(rows, settings, i, n, first):
    """Say whether a triad is shaken in a row or beside it."""
    for p in range(max(i - 1, 0), min(i + 2, n)):
        for j in range(first, first + 3):
            if not _ordinary(rows, settings[j], p, n, 2 + j, False):
                return True
    return False


@kernel
def _moved(rows, settings, i, n, own):
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
        way = _best(s, i, n, REACH)
        rows[i, c] = value - _residual(rows, i, c, way)
        spread = math.sqrt(s[way])
        calm = _ordinary(rows, s, i - 1, n, c, False, spread) and _ordinary(
            rows, s, i + 1, n, c, False, spread
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
def _judge_edge(rows, n, at, count, settings, found, spikes):
    """Look at the first or the last row; return the number of spikes."""
    inward = 1 if at == 0 else -1
    if _uneven(rows, at, n):
        return spikes
    wanted = np.zeros(6, np.bool_)
    spread = np.zeros(6)
    foretold = _edge(rows, at, inward, count - REACH - 2, settings, wanted, spread)
    for j in range(6):
        if not wanted[j] or spikes >= found.shape[0]:
            continue
        value = rows[at, 2 + j]
        rows[at, 2 + j] = foretold[j]
        # A spike in the second row would spoil what is foretold, and show in the third.
        if _ordinary(rows, settings[j], at + inward, n, 2 + j, True, spread[j]) and _ordinary(
            rows, settings[j], at + 2 * inward, n, 2 + j, True, spread[j]
        ):
            spikes = _note(rows, at, j, value, found, spikes)
        else:
            rows[at, 2 + j] = value
    return spikes


@kernel
def _judge(rows, n, i, j, settings, found, spikes):
    """Look at a channel of a row between others; return the number of spikes."""
    c = 2 + j
    s = settings[j]
    way = _best(s, i, n, REACH)
    r = _residual(rows, i, c, way)
    value = rows[i, c]
    if r * r <= _limit(settings, j, way) or value == rows[i - 1, c] or value == rows[i + 1, c]:
        return spikes
    if _uneven(rows, i, n):
        return spikes
    if _shaken(rows, settings, i, n, 3 if j < 3 else 0) or _moved(rows, settings, i, n, j):
        return spikes
    rows[i, c] = value - r
    spread = math.sqrt(s[way])
    if (
        spikes < found.shape[0]
        and _ordinary(rows, s, i - 1, n, c, True, spread)
        and _ordinary(rows, s, i + 1, n, c, True, spread)
        and _calm(rows, s, i, n, c, abs(r) / LOCAL)
    ):
        return _note(rows, i, j, value, found, spikes)
    rows[i, c] = value
    return spikes


@kernel
def screen(rows, n, begin, first, close, settings, found):
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

    Returns
    -------
    (int, int)
        First row that was not looked at, and the number of spikes.
    """
    spikes = 0
    ended = False
    ways = np.zeros(6, np.int64)
    limits = np.zeros(6)
    for j in range(6):
        ways[j] = _best(settings[j], REACH, 2 * REACH + 1, REACH)
        limits[j] = _limit(settings, j, ways[j])
    # The last row that is unlike its neighbours: near it nothing is learnt.
    odd = -1
    for k in range(max(begin - 2 * REACH, 0), begin):
        if rows[k, 10] != 0.0:
            odd = k
    i = begin
    while i < n if close else i + AHEAD < n:
        if i == 0:
            spikes = _judge_edge(rows, n, 0, min(first, KEPT), settings, found, spikes)
        if close and not ended and i + AHEAD >= n:
            # Before the rows beside it, whose residuals it would spoil.
            spikes = _judge_edge(rows, n, n - 1, min(n, KEPT), settings, found, spikes)
            ended = True
        if REACH <= i < n - REACH:
            for j in range(6):
                r = _residual(rows, i, 2 + j, ways[j])
                if r * r > limits[j]:
                    spikes = _judge(rows, n, i, j, settings, found, spikes)
        elif 0 < i < n - 1:
            for j in range(6):
                spikes = _judge(rows, n, i, j, settings, found, spikes)
        if rows[i, 10] != 0.0:
            odd = i
        if i >= 2 * REACH and odd <= i - 2 * REACH:
            _update(rows, i - REACH, n, settings, ways, limits)
        i += 1
    return i, spikes
