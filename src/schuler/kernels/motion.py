"""Sums of sinusoids with their derivatives: sway, vibration, sea."""

from __future__ import annotations

import math

from schuler.kernels._jit import summing_kernel

BLOCK = 64


@summing_kernel
def add_lines(t, cosines, sines, channel, frequency, phase, amplitude, path, angles, work):
    """Add lines a sin(w t + p), and their first and second derivative, to their channels.

    Parameters
    ----------
    t : (n,) float64
        s.
    cosines, sines : (BLOCK, k) float64
        cos and sin of w h j for row j, where t has the even step h; empty where it has not.
        With them there is no recurrence, so nothing drifts.
    channel : (k,) int64
        0 to 2 psi, theta, gamma, 3 to 5 east, north, up; ascending.
    frequency, phase, amplitude : (k,) float64
        rad/s, rad, rad or m.
    path, angles : (n, 3, 3) float64
        Value, rate and acceleration (last axis) of the ways and of the angles.
    work : (2, k) float64
        Scratch.
    """
    n = t.shape[0]
    lines = frequency.shape[0]
    even = cosines.shape[0] == BLOCK
    s0, c0 = work[0], work[1]
    for begin in range(0, n, BLOCK):
        m = min(BLOCK, n - begin)
        if even:
            for line in range(lines):
                angle = frequency[line] * t[begin] + phase[line]
                s0[line] = amplitude[line] * math.sin(angle)
                c0[line] = amplitude[line] * math.cos(angle)
        first = 0
        while first < lines:
            c = channel[first]
            last = first
            while last < lines and channel[last] == c:
                last += 1
            w, sa, ca = frequency[first:last], s0[first:last], c0[first:last]
            for k in range(m):
                value, rate, curve = 0.0, 0.0, 0.0
                if even:
                    cosine, sine = cosines[k, first:last], sines[k, first:last]
                    for j in range(last - first):
                        s = sa[j] * cosine[j] + ca[j] * sine[j]
                        value += s
                        rate += w[j] * (ca[j] * cosine[j] - sa[j] * sine[j])
                        curve -= w[j] * w[j] * s
                else:
                    for j in range(first, last):
                        angle = frequency[j] * t[begin + k] + phase[j]
                        s = amplitude[j] * math.sin(angle)
                        value += s
                        rate += frequency[j] * amplitude[j] * math.cos(angle)
                        curve -= frequency[j] * frequency[j] * s
                if c < 3:
                    angles[begin + k, c, 0] += value
                    angles[begin + k, c, 1] += rate
                    angles[begin + k, c, 2] += curve
                else:
                    path[begin + k, c - 3, 0] += value
                    path[begin + k, c - 3, 1] += rate
                    path[begin + k, c - 3, 2] += curve
            first = last
