"""Sums of squared differences of a phase at many lags at once, for Allan-type variances.

The phase is the running sum of a record's increments (angle, velocity). For a stream, work goes
in tiles of the newest point, all lags to a tile (`allan_sums`, `hadamard_sums`). For a phase that
is there whole, reading it is what takes the time: four differences, each a lag after the last,
are taken together, since they share most of their points (`allan_whole`, `hadamard_whole`).
"""

from __future__ import annotations

from schuler.kernels._jit import kernel, summing_kernel

TILE = 2048
"""Points to a tile."""

PIECE = 1024
"""Points that are taken together of a whole phase."""

SHORT = 32
"""Shorter lags leave too few points to a piece for four differences at a time."""


@kernel
def integrate(increments, offset, last, phase):
    """Write the running sums of increments, less a constant, behind the last point of each.

    Parameters
    ----------
    increments : (n, c) float64
    offset : (c,) float64
        Taken from each increment.
    last : (c,) float64
        The phase before; left ready for the next chunk.
    phase : (c, n) float64
        Written to.
    """
    n = increments.shape[0]
    for begin in range(0, n, TILE):
        end = min(begin + TILE, n)
        for j in range(increments.shape[1]):
            x, less = last[j], offset[j]
            for i in range(begin, end):
                x += increments[i, j] - less
                phase[j, i] = x
            last[j] = x


@summing_kernel
def allan_sums(x, low, first, lags, sums):
    """Add the squares of second differences x[e] - 2 x[e-m] + x[e-2m], for each lag m.

    Parameters
    ----------
    x : (n,) float64
        Phase.
    low : int
        First valid point: differences that reach before it are left out.
    first : int
        Only differences that end at this point or later are taken.
    lags : (k,) int64
        m, samples, from 1.
    sums : (k,) float64
        Added to; a tile's sum is taken several terms at a time, tiles one after the other.
    """
    n = x.shape[0]
    for begin in range(first, n, TILE):
        end = min(begin + TILE, n)
        for k in range(lags.shape[0]):
            m = lags[k]
            e = max(begin, low + 2 * m)
            if e >= end:
                continue
            a, b, c = x[e:end], x[e - m : end - m], x[e - 2 * m : end - 2 * m]
            total = 0.0
            for i in range(a.shape[0]):
                d = (a[i] - b[i]) - (b[i] - c[i])
                total += d * d
            sums[k] += total


@summing_kernel
def hadamard_sums(x, low, first, lags, sums):
    """Add the squares of third differences x[e] - 3 x[e-m] + 3 x[e-2m] - x[e-3m].

    Parameters as in `allan_sums`.
    """
    n = x.shape[0]
    for begin in range(first, n, TILE):
        end = min(begin + TILE, n)
        for k in range(lags.shape[0]):
            m = lags[k]
            e = max(begin, low + 3 * m)
            if e >= end:
                continue
            a, b = x[e:end], x[e - m : end - m]
            c, g = x[e - 2 * m : end - 2 * m], x[e - 3 * m : end - 3 * m]
            total = 0.0
            for i in range(a.shape[0]):
                d = (a[i] - g[i]) - 3.0 * (b[i] - c[i])
                total += d * d
            sums[k] += total


@summing_kernel
def allan_whole(x, lags, sums):
    """Add the squares of all second differences of a whole phase, for each lag m.

    Parameters
    ----------
    x : (n,) float64
        Phase.
    lags : (k,) int64
        m, samples, from 1.
    sums : (k,) float64
        Added to.
    """
    n = x.shape[0]
    for k in range(lags.shape[0]):
        m = lags[k]
        total = 0.0
        q = 2 * m
        while m >= SHORT and q + 4 * m <= n:
            for t in range(q, q + m, PIECE):
                w = min(PIECE, q + m - t)
                a, b, c = x[t - 2 * m : t - 2 * m + w], x[t - m : t - m + w], x[t : t + w]
                d, e = x[t + m : t + m + w], x[t + 2 * m : t + 2 * m + w]
                f = x[t + 3 * m : t + 3 * m + w]
                part = 0.0
                for i in range(w):
                    y1, y2, y3 = b[i] - a[i], c[i] - b[i], d[i] - c[i]
                    y4, y5 = e[i] - d[i], f[i] - e[i]
                    z1, z2, z3, z4 = y2 - y1, y3 - y2, y4 - y3, y5 - y4
                    part += z1 * z1 + z2 * z2 + z3 * z3 + z4 * z4
                total += part
            q += 4 * m
        for t in range(q, n, PIECE):
            w = min(PIECE, n - t)
            a, b, c = x[t - 2 * m : t - 2 * m + w], x[t - m : t - m + w], x[t : t + w]
            part = 0.0
            for i in range(w):
                z = (c[i] - b[i]) - (b[i] - a[i])
                part += z * z
            total += part
        sums[k] += total


@summing_kernel
def hadamard_whole(x, lags, sums):
    """Add the squares of all third differences of a whole phase; parameters as `allan_whole`."""
    n = x.shape[0]
    for k in range(lags.shape[0]):
        m = lags[k]
        total = 0.0
        q = 3 * m
        while m >= SHORT and q + 4 * m <= n:
            for t in range(q, q + m, PIECE):
                w = min(PIECE, q + m - t)
                a, b = x[t - 3 * m : t - 3 * m + w], x[t - 2 * m : t - 2 * m + w]
                c, d, e = x[t - m : t - m + w], x[t : t + w], x[t + m : t + m + w]
                f, g = x[t + 2 * m : t + 2 * m + w], x[t + 3 * m : t + 3 * m + w]
                part = 0.0
                for i in range(w):
                    z1 = (d[i] - a[i]) - 3.0 * (c[i] - b[i])
                    z2 = (e[i] - b[i]) - 3.0 * (d[i] - c[i])
                    z3 = (f[i] - c[i]) - 3.0 * (e[i] - d[i])
                    z4 = (g[i] - d[i]) - 3.0 * (f[i] - e[i])
                    part += z1 * z1 + z2 * z2 + z3 * z3 + z4 * z4
                total += part
            q += 4 * m
        for t in range(q, n, PIECE):
            w = min(PIECE, n - t)
            a, b = x[t - 3 * m : t - 3 * m + w], x[t - 2 * m : t - 2 * m + w]
            c, d = x[t - m : t - m + w], x[t : t + w]
            part = 0.0
            for i in range(w):
                z = (d[i] - a[i]) - 3.0 * (c[i] - b[i])
                part += z * z
            total += part
        sums[k] += total


@kernel
def total_edges(x, lags, sums):
    """Add the second differences that reach over an end of the phase, reflected there.

    Before the first point the phase goes on as 2 x[0] - x[-i], after the last in the same way
    (Howe 2000, "The total deviation approach to long-term characterization of frequency
    stability"). With `allan_sums` these are the sums of the total variance, one for each inner
    point.

    Parameters
    ----------
    x : (n,) float64
        Phase, whole.
    lags : (k,) int64
        m, at most n - 2.
    sums : (k,) float64
        Added to.
    """
    last = x.shape[0] - 1
    for k in range(lags.shape[0]):
        m = lags[k]
        total = 0.0
        for side in range(2):
            # Points less than m from the start, then those less than m from the end only.
            begin = 1 if side == 0 else max(last - m + 1, m)
            end = min(m, last) if side == 0 else last
            for i in range(begin, end):
                before = x[i - m] if i >= m else 2.0 * x[0] - x[m - i]
                after = x[i + m] if i + m <= last else 2.0 * x[last] - x[2 * last - i - m]
                d = before - 2.0 * x[i] + after
                total += d * d
        sums[k] += total
