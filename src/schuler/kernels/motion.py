"""Sums of sinusoids with their derivatives: sway, vibration, sea."""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import kernel

_BLOCK = 64


@kernel
def sum_lines(t, step, frequency, phase, amplitude, out):
    """Add lines a sin(w t + p), and their first and second derivative, to `out`.

    Parameters
    ----------
    t : (n,) float64
        s.
    step : float
        The even step of t, or 0 where it is uneven.
    frequency, phase, amplitude : (k,) float64
        rad/s, rad, any unit.
    out : (n, 3) float64
        Value, rate and acceleration.
    """
    n = t.shape[0]
    cos_table = np.empty(_BLOCK)
    sin_table = np.empty(_BLOCK)
    value = np.zeros(n)
    rate = np.zeros(n)
    curve = np.zeros(n)
    for line in range(frequency.shape[0]):
        w, p, a = frequency[line], phase[line], amplitude[line]
        if a == 0.0:
            continue
        if step == 0.0:
            for i in range(n):
                angle = w * t[i] + p
                s, c = a * math.sin(angle), a * math.cos(angle)
                value[i] += s
                rate[i] += w * c
                curve[i] -= w * w * s
            continue
        # sin(x + k w h) from one table a line: no recurrence, so nothing drifts.
        for k in range(_BLOCK):
            cos_table[k] = math.cos(w * step * k)
            sin_table[k] = math.sin(w * step * k)
        for begin in range(0, n, _BLOCK):
            angle = w * t[begin] + p
            s0, c0 = a * math.sin(angle), a * math.cos(angle)
            # Slices: their indices need no check for being negative, so the loop is vectorised.
            end = min(begin + _BLOCK, n)
            some, more, most = value[begin:end], rate[begin:end], curve[begin:end]
            for i in range(end - begin):
                s = s0 * cos_table[i] + c0 * sin_table[i]
                some[i] += s
                more[i] += w * (c0 * cos_table[i] - s0 * sin_table[i])
                most[i] -= w * w * s
    for i in range(n):
        out[i, 0] += value[i]
        out[i, 1] += rate[i]
        out[i, 2] += curve[i]
