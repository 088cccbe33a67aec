"""Extrema beyond the ends of a series, so that envelopes reach its ends: end conditions of EMD."""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper

MIRROR, PREDICT, LINEAR, PATTERN = 0, 1, 2, 3
"""How the extrema are continued."""

PAD = 2
"""Extrema that are added at each end."""

ORDER = 2
"""Order of the linear predictor of `predict_next`."""

LOOK_BACK = 200
"""Extrema before the end that are searched for likeness."""


@helper
def mirror_about(x, high, highs, low, lows, end, t, v, count, kind) -> int:
    """Add PAD extrema of one kind beyond an end by mirroring; return the new count.

    Parameters
    ----------
    x : (n,) float64
    high, low : indices of maxima and minima
    end : 0 for the left end, 1 for the right
    t, v : knots so far, to which is added in the order away from the end
    kind : 0 for maxima, 1 for minima
    """
    n = x.shape[0]
    edge = 0 if end == 0 else n - 1
    first_high = high[0] if end == 0 else high[highs - 1]
    first_low = low[0] if end == 0 else low[lows - 1]
    high_first = first_high < first_low if end == 0 else first_high > first_low
    # About the outermost extremum, unless the end itself reaches beyond the next one.
    if high_first:
        about = first_high if x[edge] > x[first_low] else edge
    else:
        about = first_low if x[edge] < x[first_high] else edge
    which, number = (high, highs) if kind == 0 else (low, lows)
    own_first = high_first if kind == 0 else not high_first
    skip = 0
    if about != edge and own_first:
        skip = 1
    take = PAD
    extra = False
    if about == edge and not own_first:
        # The end itself is an extremum of the other kind's neighbour.
        take = PAD - 1
        extra = True
    if extra:
        t[count] = float(edge)
        v[count] = x[edge]
        count += 1
    for k in range(take):
        j = skip + k
        if j >= number:
            break
        index = which[j] if end == 0 else which[number - 1 - j]
        where = 2.0 * about - index
        if (end == 0 and where >= 0.0 and index != about) or (
            end == 1 and where <= n - 1.0 and index != about
        ):
            where = 2.0 * edge - index
        t[count] = where
        v[count] = x[index]
        count += 1
    return count


@helper
def predict_next(v, other, number, others) -> float:
    """Return the next value of a sequence of extrema, by its likest past.

    Past places are ranked by |difference| of both kinds' values to the last pair; those count
    whose rise or fall into them, of both kinds, is as at the end. A linear predictor of order
    `ORDER` is fitted to what followed them, the likest with the most weight.
    """
    last = number - 1
    shift = others - number
    m00, m01, m02, m11, m12, m22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    r0, r1, r2 = 0.0, 0.0, 0.0
    scale = 0.0
    begin = max(ORDER, 1 - shift, last - LOOK_BACK)
    for i in range(begin, last):
        scale += abs(v[i + 1] - v[i])
    if last - begin < 1:
        return v[last] if last < 1 else 2.0 * v[last] - v[last - 1]
    scale = scale / (last - begin) + 1e-300
    rise = v[last] - v[last - 1]
    o = last + shift
    o_rise = 0.0
    if 1 <= o < others:
        o_rise = other[o] - other[o - 1]
    used = 0
    for i in range(begin, last):
        d = abs(v[i] - v[last])
        same = (v[i] - v[i - 1]) * rise > 0.0
        p = i + shift
        if 1 <= p < others and 1 <= o < others:
            d += abs(other[p] - other[o])
            same = same and (other[p] - other[p - 1]) * o_rise >= 0.0
        if not same:
            continue
        w = math.exp(-d / scale)
        # Steps, not values: a drift of the extrema goes on.
        a, b, c = v[i] - v[i - 1], v[i - 1] - v[i - 2], v[i + 1] - v[i]
        m00 += w
        m01 += w * a
        m02 += w * b
        m11 += w * a * a
        m12 += w * a * b
        m22 += w * b * b
        r0 += w * c
        r1 += w * c * a
        r2 += w * c * b
        used += 1
    step = 0.0
    for i in range(begin, last):
        step += (v[i + 1] - v[i]) / (last - begin)
    if used < 4 or m00 < 1e-12:
        return v[last] + step
    # Centred, with a ridge of a hundredth of the scatter: a few likenesses fix no two slopes.
    ma, mb, my = m01 / m00, m02 / m00, r0 / m00
    saa, sab, sbb = m11 / m00 - ma * ma, m12 / m00 - ma * mb, m22 / m00 - mb * mb
    sya, syb = r1 / m00 - my * ma, r2 / m00 - my * mb
    ridge = 0.01 * (saa + sbb) + 1e-300
    saa += ridge
    sbb += ridge
    det = saa * sbb - sab * sab
    ka, kb = (sya * sbb - syb * sab) / det, (syb * saa - sya * sab) / det
    a, b = v[last] - v[last - 1], v[last - 1] - v[last - 2]
    return v[last] + my + ka * (a - ma) + kb * (b - mb)


@helper
def solve_small(a, b) -> bool:
    """Solve a x = b in place by elimination with pivots; return False where a is singular."""
    n = b.shape[0]
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(a[i, j]))
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if abs(a[pivot, k]) <= 1e-9 * largest:
            return False
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            b[k], b[pivot] = b[pivot], b[k]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k, n):
                a[i, j] -= factor * a[k, j]
            b[i] -= factor * b[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]
    return True


@helper
def predict_by_pattern(v, other, number, others, order) -> float:
    """Return the next value of a sequence of extrema by the pattern of rises and falls.

    Past places are kept where both kinds' values rise or fall into them as at the end; of these,
    those with the more frequent pattern of what comes next. The order + 1 of them that are nearest
    in value (of both kinds together) fix the order + 1 coefficients of

        v[i + 1] = A_m v[i] + A_(m-1) v[i - 1] + ... + A_0 v[i - m],

    which then gives the next value from the last ones. Where fewer are alike, where they leave the
    coefficients open, or where the prediction leaves the range of all values by more than that
    range, the order is one less; without any, the last value stands.
    """
    last = number - 1
    shift = others - number
    end = last + shift
    if last < 1 or end < 1 or end >= others:
        return v[last]
    rise, o_rise = v[last] > v[last - 1], other[end] > other[end - 1]
    least, most = v[0], v[0]
    for i in range(number):
        least, most = min(least, v[i]), max(most, v[i])
    begin = max(1, 1 - shift)
    following = np.full(number, -1, np.int64)
    counts = np.zeros(4, np.int64)
    for i in range(begin, last):
        p = i + shift
        if p + 1 >= others:
            continue
        if (v[i] > v[i - 1]) != rise or (other[p] > other[p - 1]) != o_rise:
            continue
        following[i] = 2 * (v[i + 1] > v[i]) + (other[p + 1] > other[p])
        counts[following[i]] += 1
    wanted = np.argmax(counts)
    if counts[wanted] == 0:
        return v[last]
    alike = np.empty(counts[wanted], np.int64)
    distance = np.empty(counts[wanted])
    kept = 0
    for i in range(begin, last):
        if following[i] == wanted:
            alike[kept] = i
            distance[kept] = abs(v[i] - v[last]) + abs(other[i + shift] - other[end])
            kept += 1
    ranked = np.argsort(distance)
    for m in range(min(order, last - 1), -1, -1):
        size = m + 1
        a, b = np.empty((size, size)), np.empty(size)
        used = 0
        for k in range(kept):
            i = alike[ranked[k]]
            if used == size:
                break
            if i < m:
                continue
            for j in range(size):
                a[used, j] = v[i - j]
            b[used] = v[i + 1]
            used += 1
        if used < size or not solve_small(a, b):
            continue
        value = 0.0
        for j in range(size):
            value += b[j] * v[last - j]
        if abs(value - 0.5 * (least + most)) <= 1.5 * (most - least):
            return value
    return v[last]


@helper
def spread(index, number, x, flip, v) -> None:
    """Fill v with the values at extrema, in time's order or against it."""
    for i in range(number):
        v[i] = x[index[number - 1 - i]] if flip else x[index[i]]


@helper
def predict_beyond(
    x, high, highs, low, lows, rule, order, end, t, v, count, kind, own, rest
) -> int:
    """Add predicted extrema of one kind beyond an end; return the new count.

    The next value comes from `predict_next` or `predict_by_pattern`, the next time from the mean of
    the last few gaps.
    Values before the very end that lie outside what was predicted are knots themselves.
    """
    n = x.shape[0]
    which, number = (high, highs) if kind == 0 else (low, lows)
    other, others = (low, lows) if kind == 0 else (high, highs)
    spread(which, number, x, end == 0, own)
    spread(other, others, x, end == 0, rest)
    if rule == PATTERN:
        value = predict_by_pattern(own[:number], rest[:others], number, others, order)
    else:
        value = predict_next(own, rest, number, others)
    gaps = min(number - 1, 4)
    near = which[0] if end == 0 else which[number - 1]
    far = which[gaps] if end == 0 else which[number - 1 - gaps]
    gap = abs(near - far) / max(gaps, 1)
    way = -1.0 if end == 0 else 1.0
    edge = 0.0 if end == 0 else n - 1.0
    where = near + way * gap
    # The end may reach beyond the envelope before the predicted extremum comes.
    beyond = x[0] if end == 0 else x[n - 1]
    if (kind == 0 and beyond > max(value, x[near])) or (kind == 1 and beyond < min(value, x[near])):
        value = beyond
        where = edge
    if (end == 0 and where > edge) or (end == 1 and where < edge):
        where = edge
    t[count] = where
    v[count] = value
    count += 1
    t[count] = where + way * max(gap, 1.0)
    v[count] = 2.0 * value - x[near]
    return count + 1


@helper
def extend_line(x, high, highs, low, lows, end, t, v, count, kind) -> int:
    """Add extrema beyond an end on the line through the last two; return the new count."""
    n = x.shape[0]
    which, number = (high, highs) if kind == 0 else (low, lows)
    a = which[0] if end == 0 else which[number - 1]
    b = which[1] if end == 0 else which[number - 2]
    edge = 0.0 if end == 0 else n - 1.0
    value = x[a] + (x[a] - x[b]) / (a - b) * (edge - a)
    beyond = x[0] if end == 0 else x[n - 1]
    if (kind == 0 and beyond > value) or (kind == 1 and beyond < value):
        value = beyond
    t[count] = edge
    v[count] = value
    t[count + 1] = edge + (a - b)
    v[count + 1] = value
    return count + 2
