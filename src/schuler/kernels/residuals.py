"""Residuals of interpolations, and what is ordinary among them: by what spikes are judged.

Three interpolations foretell a row: the mean of its two neighbours, the mean of three on each side,
and the cubic through two on each side. The variance of each one's residuals is a clipped
exponential average over every fourth row, so that neither spikes nor shocks raise it much; the
largest residual that stood alone is kept as well.

Setting of a channel (`SETTING` numbers): 0-2 variances, 3-5 largest residuals of the three
interpolations, 6 resolution (0 where no two values have differed yet), 7 smallest spike.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper, kernel
from schuler.kernels.lanes import (
    abs4,
    any_greater4,
    larger4,
    load_row4,
    smaller4,
    splat4,
    store_row4,
    where_greater4,
)

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

_BLOW, _PUSH = 4e-3, 0.09
"""A blow lasts longer than so many s, and changes the velocity by less than so many m/s."""

EVERY = 4.0
"""Every so many rows enter the variances."""

_ALPHA = 1.0 / 64.0
_CLIP = 9.0
BLOCK = 64
"""Rows that are looked at together."""
DOUBTFUL, CLEAR, QUIET = 0, 1, 2
_FADE = (1.0 - _ALPHA) ** BLOCK
"""Part of a variance that is left, at the least, when a block has been learnt from."""
_SIXTH = 1.0 / 6.0


@helper
def residual_of(rows, i, c, way):
    """Return a value less its interpolation; column c of row i."""
    if way == 0:
        return rows[i, c] - 0.5 * (rows[i - 1, c] + rows[i + 1, c])
    near = rows[i - 1, c] + rows[i + 1, c]
    far = rows[i - 2, c] + rows[i + 2, c]
    if way == 2:
        return rows[i, c] - _SIXTH * (4.0 * near - far)
    return rows[i, c] - _SIXTH * (near + far + rows[i - 3, c] + rows[i + 3, c])


@kernel
def reach_of(way):
    """Return how many rows an interpolation reaches on each side."""
    return 1 if way == 0 else (3 if way == 1 else 2)


@kernel
def best_way(setting, i, n, widest):
    """Return the interpolation with the smallest variance that the rows allow, -1 for none."""
    best = -1
    for way in range(3):
        r = reach_of(way)
        if r > widest or i - r < 0 or i + r >= n:
            continue
        if best < 0 or setting[way] < setting[best]:
            best = way
    return best


@kernel
def is_ordinary(rows, setting, i, n, c, seen, spread=0.0, slack=1.0):
    """Say whether a value is no further off its interpolation than many (or, `seen`, any) were.

    `spread` is what else its neighbours may be off by (1 sigma); `slack` times as far is ordinary.
    """
    way = best_way(setting, i, n, 2)
    if way < 0:
        return True
    limit = max(ORDINARY * max(math.sqrt(setting[way]), spread), setting[6])
    if seen:
        limit = max(limit, setting[3 + way])
    return abs(residual_of(rows, i, c, way)) <= slack * limit


@kernel
def calm_near(rows, setting, i, n, c, limit):
    """Say whether no row near by is further off its interpolation than a limit."""
    for p in range(max(i - AHEAD + 2, 1), min(i + AHEAD - 1, n - 1)):
        way = best_way(setting, p, n, 2)
        if abs(residual_of(rows, p, c, way)) > limit:
            return False
    return True


@kernel
def stands_alone(rows, setting, i, n, c, r):
    """Say whether a residual stands alone: with the value replaced, all is calm near by."""
    value = rows[i, c]
    limit = abs(r) / ALIKE
    rows[i, c] = value - r
    # The row itself first: while the base is shaken, an interpolation that is not the best is off
    # by as much in each row.
    calm = abs(residual_of(rows, i, c, best_way(setting, i, n, 2))) <= limit
    calm = calm and calm_near(rows, setting, i, n, c, limit)
    rows[i, c] = value
    return calm


@kernel
def is_uneven(rows, i, n):
    """Say whether a row of another length is near, whose value is not like the others."""
    least = 0.0
    for k in range(max(i - REACH, 0), min(i + REACH + 1, n)):
        least = min(least, rows[k, 10])
    return least < 0.0


@kernel
def set_smallest(settings, nominal, increments):
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
def median_of(values, n):
    """Return the median of the first values, which come out in another order."""
    half = n // 2
    low, high = 0, n - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if half <= j:
            high = j
        elif half >= i:
            low = i
        else:
            break
    if n % 2:
        return values[half]
    below = values[0]
    for k in range(1, half):
        below = max(below, values[k])
    return 0.5 * (below + values[half])


@kernel
def learn(rows, count, settings, size):
    """Fill the settings (6, SETTING) from the first rows: medians, which no spike moves.

    Parameters
    ----------
    rows : (n, ROW) float64
    count : int
        Rows to look at, `LEAST` or more.
    settings : (6, SETTING) float64
        Zero, but for the smallest spike; filled.
    size : (count,) float64
        Scratch.
    """
    for j in range(6):
        c = 2 + j
        s = settings[j]
        for i in range(1, count):
            step = abs(rows[i, c] - rows[i - 1, c])
            if step > 0.0 and (s[6] == 0.0 or step < s[6]):
                s[6] = step
        for way in range(3):
            for i in range(REACH, count - REACH):
                size[i - REACH] = abs(residual_of(rows, i, c, way))
            s[way] = (1.4826 * median_of(size, count - 2 * REACH)) ** 2
        # The largest but for one event, which may be a spike.
        way = best_way(s, REACH, 2 * REACH + 1, REACH)
        worst, at = -1.0, 0
        for i in range(REACH, count - REACH):
            r = abs(residual_of(rows, i, c, way))
            if r > worst:
                worst, at = r, i
        for way in range(3):
            for i in range(REACH, count - REACH):
                r = residual_of(rows, i, c, way)
                # Counted as `screen` will, before which it has to hold off the first events.
                far = abs(i - at) > REACH and abs(r) > s[3 + way]
                if far and not is_uneven(rows, i, count) and stands_alone(rows, s, i, count, c, r):
                    s[3 + way] = abs(r)


@helper
def limit_of(settings, j, way):
    """Return the square of what a residual of one interpolation must exceed."""
    seen = BEYOND * settings[j, 3 + way]
    step = 3.0 * settings[j, 6]
    least = settings[j, 7]
    return max(
        SIGMAS * SIGMAS * settings[j, way], max(seen * seen, max(step * step, least * least))
    )


@helper
def take_in(rows, i, settings, j, r0, r1, r2):
    """Take a channel's residuals into its variances."""
    step = abs(rows[i, 2 + j] - rows[i - 1, 2 + j])
    rounding = settings[j, 6]
    if step > 0.0 and (rounding == 0.0 or step < rounding):
        settings[j, 6] = rounding = step
    # Rounding alone has a twelfth of the squared step.
    least = rounding * rounding * (_CLIP / 12.0)
    v0, v1, v2 = settings[j, 0], settings[j, 1], settings[j, 2]
    settings[j, 0] = v0 + _ALPHA * (min(r0 * r0, max(_CLIP * v0, least)) - v0)
    settings[j, 1] = v1 + _ALPHA * (min(r1 * r1, max(_CLIP * v1, least)) - v1)
    settings[j, 2] = v2 + _ALPHA * (min(r2 * r2, max(_CLIP * v2, least)) - v2)


@kernel
def renew(settings, ways, limits):
    """Choose each channel's interpolation, and what a spike must exceed."""
    for j in range(6):
        best = 0
        if settings[j, 1] < settings[j, best]:
            best = 1
        if settings[j, 2] < settings[j, best]:
            best = 2
        ways[j] = best
        limits[j] = limit_of(settings, j, best)


@kernel
def look_over(rows, begin, end, settings, work):
    """Return whether a row from begin to end - 1 may be a spike, or is no even one (`DOUBTFUL`).

    Limits are those that the settings cannot fall below while the rows are learnt from. `QUIET`
    stands for rows of which no residual exceeds the largest so far, `CLEAR` for the others.

    Parameters
    ----------
    rows : (n, ROW) float64
    begin, end : int
        Rows that would be judged; those from `begin` - `REACH` would be learnt from.
    settings : (6, SETTING) float64
    work : (m, >= 4) float64
        Scratch; the first three rows are used.
    """
    for k in range(begin - 2 * REACH, end + REACH):
        if rows[k, 10] != 0.0:
            return DOUBTFUL
    found = QUIET
    start = begin - REACH
    sixth = splat4(_SIXTH)
    # Two groups of channels: the last two numbers of the second one are no channels.
    for first in range(0, 8, 4):
        c = 2 + first
        most0 = most1 = most2 = splat4(0.0)
        a, b = load_row4(rows, start - 3, c), load_row4(rows, start - 2, c)
        d, x = load_row4(rows, start - 1, c), load_row4(rows, start, c)
        e, f = load_row4(rows, start + 1, c), load_row4(rows, start + 2, c)
        for k in range(start, end):
            g = load_row4(rows, k + 3, c)
            near = d + e
            far = b + f
            most0 = larger4(abs4(x - 0.5 * near), most0)
            most1 = larger4(abs4(x - sixth * (near + far + a + g)), most1)
            most2 = larger4(abs4(x - sixth * (4.0 * near - far)), most2)
            a, b, d, x, e, f = b, d, x, e, f, g
        store_row4(work, 0, 0, most0)
        store_row4(work, 1, 0, most1)
        store_row4(work, 2, 0, most2)
        for j in range(first, min(first + 4, 6)):
            for way in range(3):
                seen = BEYOND * settings[j, 3 + way]
                least = settings[j, 7]
                limit = max(
                    _FADE * SIGMAS * SIGMAS * settings[j, way], max(seen * seen, least * least)
                )
                most = work[way, j - first]
                if most * most > limit:
                    return DOUBTFUL
                if most > settings[j, 3 + way]:
                    found = CLEAR
    return found


@kernel
def learn_rows(rows, begin, end, n, settings, quiet, work):
    """Learn from rows that are no spikes, as `update` does from one after the other.

    Parameters
    ----------
    rows : (n, ROW) float64
    begin, end : int
        Rows to learn from.
    n : int
        Rows there are.
    settings : (6, SETTING) float64
        Changed.
    quiet : bool
        No residual exceeds the largest so far.
    work : (m, >= 32) float64
        Scratch; the first three rows are used.
    """
    sixth, zero = splat4(_SIXTH), splat4(0.0)
    for first in range(0, 8, 4):
        c = 2 + first
        channels = min(4, 6 - first)
        for k in range(4):
            for what in range(7):
                # Of what is no channel nothing is ever too large.
                none = 0.0 if what < 3 else np.inf
                work[0, 4 * what + k] = settings[first + k, what] if k < channels else none
            # Where no two values have differed yet, any step is smaller.
            if work[0, 24 + k] == 0.0:
                work[0, 24 + k] = np.inf
        v0, v1, v2 = load_row4(work, 0, 0), load_row4(work, 0, 4), load_row4(work, 0, 8)
        s0, s1, s2 = load_row4(work, 0, 12), load_row4(work, 0, 16), load_row4(work, 0, 20)
        rounding = load_row4(work, 0, 24)
        infinite = splat4(np.inf)
        for i in range(begin, end):
            taken = rows[i, 0] % EVERY == 0.0
            if quiet and not taken:
                continue
            a, b, d = (
                load_row4(rows, i - 3, c),
                load_row4(rows, i - 2, c),
                load_row4(rows, i - 1, c),
            )
            x, e = load_row4(rows, i, c), load_row4(rows, i + 1, c)
            f, g = load_row4(rows, i + 2, c), load_row4(rows, i + 3, c)
            near = d + e
            far = b + f
            r0 = x - 0.5 * near
            r1 = x - sixth * (near + far + a + g)
            r2 = x - sixth * (4.0 * near - far)
            if taken:
                step = abs4(x - d)
                rounding = smaller4(where_greater4(step, zero, step, infinite), rounding)
                # Rounding alone has a twelfth of the squared step.
                known = where_greater4(infinite, rounding, rounding, zero)
                least = known * known * (_CLIP / 12.0)
                v0 = v0 + _ALPHA * (smaller4(r0 * r0, larger4(_CLIP * v0, least)) - v0)
                v1 = v1 + _ALPHA * (smaller4(r1 * r1, larger4(_CLIP * v1, least)) - v1)
                v2 = v2 + _ALPHA * (smaller4(r2 * r2, larger4(_CLIP * v2, least)) - v2)
            for way in range(0 if quiet else 3):
                if way == 0:
                    r, seen = r0, s0
                elif way == 1:
                    r, seen = r1, s1
                else:
                    r, seen = r2, s2
                size = abs4(r)
                if not any_greater4(size, seen):
                    continue
                # What `stands_alone` would find first, but for the last digits.
                left = abs4(where_greater4(v0, v2, r2, r0) - r)
                most = where_greater4(size, seen, (1.0 + 1e-6) / ALIKE * size, zero - 1.0)
                if not any_greater4(most, left):
                    continue
                store_row4(work, 1, 0, size)
                store_row4(work, 2, 0, r)
                store_row4(work, 0, 0, v0)
                store_row4(work, 0, 4, v1)
                store_row4(work, 0, 8, v2)
                for k in range(channels):
                    j = first + k
                    if work[1, k] > settings[j, 3 + way]:
                        for what in range(3):
                            settings[j, what] = work[0, 4 * what + k]
                        if stands_alone(rows, settings[j], i, n, 2 + j, work[2, k]):
                            settings[j, 3 + way] = work[1, k]
                            work[0, 12 + 4 * way + k] = work[1, k]
                s0, s1, s2 = load_row4(work, 0, 12), load_row4(work, 0, 16), load_row4(work, 0, 20)
        store_row4(work, 0, 0, v0)
        store_row4(work, 0, 4, v1)
        store_row4(work, 0, 8, v2)
        store_row4(work, 0, 24, where_greater4(infinite, rounding, rounding, zero))
        for k in range(channels):
            for what in range(3):
                settings[first + k, what] = work[0, 4 * what + k]
            settings[first + k, 6] = work[0, 24 + k]


@kernel
def update(rows, i, n, settings, ways, limits):
    """Take the residuals of a row into the settings; renew the best ways and their limits."""
    for j in range(6):
        c = 2 + j
        near = rows[i - 1, c] + rows[i + 1, c]
        far = rows[i - 2, c] + rows[i + 2, c]
        r0 = rows[i, c] - 0.5 * near
        r1 = rows[i, c] - _SIXTH * (near + far + rows[i - 3, c] + rows[i + 3, c])
        r2 = rows[i, c] - _SIXTH * (4.0 * near - far)
        if rows[i, 0] % EVERY == 0.0:
            take_in(rows, i, settings, j, r0, r1, r2)
        if abs(r0) > settings[j, 3] and stands_alone(rows, settings[j], i, n, c, r0):
            settings[j, 3] = abs(r0)
        if abs(r1) > settings[j, 4] and stands_alone(rows, settings[j], i, n, c, r1):
            settings[j, 4] = abs(r1)
        if abs(r2) > settings[j, 5] and stands_alone(rows, settings[j], i, n, c, r2):
            settings[j, 5] = abs(r2)
    renew(settings, ways, limits)
