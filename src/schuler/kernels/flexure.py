"""Flexure between two mountings: a critically damped second-order Gauss-Markov process an axis.

    theta'' = -2 b theta' - b^2 theta + w,   E w^2 = 4 b^3 sigma^2

so that theta has the steady sigma, its rate b sigma, and the two do not correlate at one instant.
Its transition over t is exp(-b t) times a matrix of its own; the filter's diagonal has the
exponential, and `couple_flexure` the rest.

Source: Kain and Cloutier, Rapid transfer alignment for tactical weapon applications (1989).
"""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel


@kernel
def couple_flexure(x, p, parts, chain, first, t, b):
    """Apply the transition over t without its exponential, in place.

    Parameters
    ----------
    x, p, parts, chain : float64
        As in `schuler.kernels.error_state.run`.
    first : int
        Index of the first of three angles; their rates follow.
    t, b : float
        s and rad/s.
    """
    size = x.shape[0]
    m00, m01, m10, m11 = 1.0 + b * t, t, -b * b * t, 1.0 - b * t
    for k in range(3):
        i, j = first + k, first + 3 + k
        x[i], x[j] = m00 * x[i] + m01 * x[j], m10 * x[i] + m11 * x[j]
        for n in range(size):
            p[i, n], p[j, n] = m00 * p[i, n] + m01 * p[j, n], m10 * p[i, n] + m11 * p[j, n]
        for n in range(size):
            p[n, i], p[n, j] = m00 * p[n, i] + m01 * p[n, j], m10 * p[n, i] + m11 * p[n, j]
        for s in range(parts.shape[0]):
            c = parts[s]
            for n in range(size):
                c[i, n], c[j, n] = m00 * c[i, n] + m01 * c[j, n], m10 * c[i, n] + m11 * c[j, n]
            for n in range(size):
                c[n, i], c[n, j] = m00 * c[n, i] + m01 * c[n, j], m10 * c[n, i] + m11 * c[n, j]
        if chain.shape[0] > 0:
            for n in range(size):
                a, c0 = chain[i, n], chain[j, n]
                chain[i, n], chain[j, n] = m00 * a + m01 * c0, m10 * a + m11 * c0


@kernel
def drive_flexure(p, first, t, b, variance):
    """Add to p what drives the process over t: its steady covariance less what is left of it.

    Parameters
    ----------
    p : (size, size) float64
    first, t, b
        As in `couple_flexure`.
    variance : float
        Steady variance of an angle, rad^2.
    """
    left = math.exp(-2.0 * b * t)
    m00, m01, m10, m11 = 1.0 + b * t, t, -b * b * t, 1.0 - b * t
    angle, rate = variance, b * b * variance
    q00 = angle - left * (m00 * m00 * angle + m01 * m01 * rate)
    q01 = -left * (m00 * m10 * angle + m01 * m11 * rate)
    q11 = rate - left * (m10 * m10 * angle + m11 * m11 * rate)
    for k in range(3):
        i, j = first + k, first + 3 + k
        p[i, i] += q00
        p[i, j] += q01
        p[j, i] += q01
        p[j, j] += q11
