"""Empirical mode decomposition: extrema, end conditions, envelopes, sifting.

An envelope is the natural cubic spline through the extrema of one kind, continued beyond both
ends of the record by extrema that are mirrored (Rilling, Flandrin and Goncalves, 2003) or
predicted from the sequence of extrema itself: by a weighted fit, or by the pattern of rises and
falls as Yu, Zhang and Xia have it.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper, kernel
from schuler.kernels.end_conditions import (
    LINEAR,
    PAD,
    PATTERN,
    PREDICT,
    extend_line,
    mirror_about,
    predict_beyond,
)
from schuler.kernels.lanes import load4, store4

FIXED, STANDARD_DEVIATION, EVOLVED = 0, 1, 2
"""When sifting stops: after so many; by the change between sifts; by mean against amplitude."""


@helper
def find_extrema(x, high, low) -> tuple[int, int]:
    """Fill high and low with the indices of maxima and minima; return how many of each.

    A plateau counts once, at its middle.
    """
    highs = 0
    lows = 0
    slope = 0.0
    flat = 0
    for i in range(1, x.shape[0]):
        d = x[i] - x[i - 1]
        if d == 0.0:
            continue
        # Written down in any case, and counted where it is one: noise cannot be foretold by what
        # the processor guesses.
        middle = (flat + i - 1) // 2
        high[highs] = middle
        low[lows] = middle
        highs += 1 if (slope > 0.0) & (d < 0.0) else 0
        lows += 1 if (slope < 0.0) & (d > 0.0) else 0
        slope = d
        flat = i
    return highs, lows


@helper
def envelope(t, v, count, slope, work, four, n, out) -> None:
    """Fill out (n + 3) with the natural cubic spline through knots t, v at 0, 1, 2 ... n - 1.

    `four` holds 0, 1, 2, 3.
    """
    # Second derivatives by the tridiagonal algorithm. What does not wait for the knot before is
    # made first: the quotients of many knots at a time.
    for i in range(1, count - 1):
        left, right = t[i] - t[i - 1], t[i + 1] - t[i]
        d = (v[i + 1] - v[i]) / right - (v[i] - v[i - 1]) / left
        slope[i] = left / (left + right)
        work[i] = 6.0 * d / (left + right)
    slope[0] = 0.0
    work[0] = 0.0
    for i in range(1, count - 1):
        s = slope[i]
        p = s * slope[i - 1] + 2.0
        slope[i] = (s - 1.0) / p
        work[i] = (work[i] - s * work[i - 1]) / p
    slope[count - 1] = 0.0
    for i in range(count - 2, -1, -1):
        slope[i] = slope[i] * slope[i + 1] + work[i]
    k = 0
    i = 0
    while i < n:
        while k < count - 2 and t[k + 1] <= i:
            k += 1
        h = t[k + 1] - t[k]
        c0, c1 = slope[k], slope[k + 1]
        base, step = v[k], (v[k + 1] - v[k]) / h
        a1 = step - h * (2.0 * c0 + c1) / 6.0
        a2, a3 = 0.5 * c0, (c1 - c0) / (6.0 * h)
        stop = n
        if k < count - 2:
            stop = min(n, max(i + 1, math.ceil(t[k + 1])))
        # Four at a time, beyond the piece's end: the next one's are written after.
        for j in range(i, stop, 4):
            x = (j - t[k]) + load4(four, 0)
            store4(out, j, base + x * (a1 + x * (a2 + x * a3)))
        i = stop


@helper
def knots(x, high, highs, low, lows, rule, order, kind, t, v, side_t, side_v, own, rest) -> int:
    """Fill t, v with the knots of one envelope, ascending; return their number."""
    which, number = (high, highs) if kind == 0 else (low, lows)
    count = 0
    for end in range(2):
        added = 0
        if rule in (PREDICT, PATTERN):
            added = predict_beyond(
                x, high, highs, low, lows, rule, order, end, side_t, side_v, 0, kind, own, rest
            )
        elif rule == LINEAR:
            added = extend_line(x, high, highs, low, lows, end, side_t, side_v, 0, kind)
        else:
            added = mirror_about(x, high, highs, low, lows, end, side_t, side_v, 0, kind)
        if end == 0:
            for i in range(added - 1, -1, -1):
                if count == 0 or side_t[i] > t[count - 1]:
                    t[count], v[count] = side_t[i], side_v[i]
                    count += 1
            for i in range(number):
                if count == 0 or which[i] > t[count - 1]:
                    t[count], v[count] = float(which[i]), x[which[i]]
                    count += 1
        else:
            for i in range(added):
                if side_t[i] > t[count - 1]:
                    t[count], v[count] = side_t[i], side_v[i]
                    count += 1
    return count


@kernel
def sift(x, rule, order, stop, limit, threshold, mode):
    """Sift one mode out of a series.

    Parameters
    ----------
    x : (n,) float64
        The series.
    rule : int
        `MIRROR`, `PREDICT`, `LINEAR` or `PATTERN`.
    order : int
        Of the linear predictor of `PATTERN`.
    stop : int
        `FIXED`, `STANDARD_DEVIATION` or `EVOLVED`.
    limit : int
        Most siftings.
    threshold : float
        Of the stop rule.
    mode : (n,) float64
        Filled with the mode.

    Returns
    -------
    int
        Siftings done; 0 when there are too few extrema for a mode.
    """
    n = x.shape[0]
    high, low = np.empty(n // 2 + 2, np.int64), np.empty(n // 2 + 2, np.int64)
    size = n // 2 + 2 * PAD + 4
    t, v = np.empty(size), np.empty(size)
    slope, work = np.empty(size), np.empty(size)
    own, rest = np.empty(size), np.empty(size)
    side_t, side_v = np.empty(PAD + 2), np.empty(PAD + 2)
    upper, lower, four = np.empty(n + 3), np.empty(n + 3), np.empty(4)
    for i in range(4):
        four[i] = i
    for i in range(n):
        mode[i] = x[i]
    done = 0
    while done < limit:
        highs, lows = find_extrema(mode, high, low)
        if highs < 2 or lows < 2:
            break
        for kind in range(2):
            count = knots(
                mode, high, highs, low, lows, rule, order, kind, t, v, side_t, side_v, own, rest
            )
            envelope(t, v, count, slope, work, four, n, upper if kind == 0 else lower)
        if stop == EVOLVED and done > 0:
            # One place with far too large a mean is enough to go on.
            above = 0
            far = False
            for i in range(n):
                mean, wide = abs(0.5 * (upper[i] + lower[i])), abs(0.5 * (upper[i] - lower[i]))
                if mean > 10.0 * threshold * wide:
                    far = True
                    break
                above += mean > threshold * wide
            if not far and above <= 0.05 * n:
                break
        if stop == STANDARD_DEVIATION and done > 0:
            change, power = 0.0, 0.0
            for i in range(n):
                mean = 0.5 * (upper[i] + lower[i])
                change += mean * mean
                power += mode[i] * mode[i]
            if change <= threshold * power:
                break
        for i in range(n):
            mode[i] -= 0.5 * (upper[i] + lower[i])
        done += 1
    return done
