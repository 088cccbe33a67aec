"""Sums of sinusoids with their derivatives: sway, vibration, sea."""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import kernel

_BLOCK = 64


@kernel
def add_lines(t, step, channel, frequency, phase, amplitude, path, angles):
    """Add lines a sin(w t + p), and their first and second derivative, to their channels.

    Parameters
    ----------
    t : (n,) float64
        s.
    step : float
        The even step of t, or 0 where it is uneven.
    channel : (k,) int64
        0 to 2 psi, theta, gamma, 3 to 5 east, north, up; ascending.
    frequency, phase, amplitude : (k,) float64
        rad/s, rad, rad or m.
    path, angles : (n, 3, 3) float64
        Value, rate and acceleration (last axis) of the ways and of the angles.
    """
    n = t.shape[0]
    lines = frequency.shape[0]
    table = np.empty((lines, 2, _BLOCK))
    if step != 0.0:
        # sin(x + k w h) from one table a line: no recurrence, so nothing drifts.
        for line in range(lines):
            for k in range(_BLOCK):
                table[line, 0, k] = math.cos(frequency[line] * step * k)
                table[line, 1, k] = math.sin(frequency[line] * step * k)
    value, rate, curve = np.zeros(_BLOCK), np.zeros(_BLOCK), np.zeros(_BLOCK)
    for begin in range(0, n, _BLOCK):
        m = min(_BLOCK, n - begin)
        for line in range(lines):
            w, a = frequency[line], amplitude[line]
            if step != 0.0:
                angle = w * t[begin] + phase[line]
                s0, c0 = a * math.sin(angle), a * math.cos(angle)
                cosine, sine = table[line, 0], table[line, 1]
                for k in range(m):
                    s = s0 * cosine[k] + c0 * sine[k]
                    value[k] += s
                    rate[k] += w * (c0 * cosine[k] - s0 * sine[k])
                    curve[k] -= w * w * s
            else:
                for k in range(m):
                    angle = w * t[begin + k] + phase[line]
                    s = a * math.sin(angle)
                    value[k] += s
                    rate[k] += w * a * math.cos(angle)
                    curve[k] -= w * w * s
            if line + 1 < lines and channel[line + 1] == channel[line]:
                continue
            c = channel[line]
            for k in range(m):
                if c < 3:
                    angles[begin + k, c, 0] += value[k]
                    angles[begin + k, c, 1] += rate[k]
                    angles[begin + k, c, 2] += curve[k]
                else:
                    path[begin + k, c - 3, 0] += value[k]
                    path[begin + k, c - 3, 1] += rate[k]
                    path[begin + k, c - 3, 2] += curve[k]
                value[k], rate[k], curve[k] = 0.0, 0.0, 0.0
