"""Loops of the noise generators and of the instrument, resumable."""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel

STATE_SIZE = 24
"""0-5 sums of the six channels before rounding, 6-11 after it, 12-17 spare, 18 seconds passed."""


@kernel
def gauss_markov(every, rho, kick, step, place, state, line, normal, out):
    """Add increments of a sum of first-order Gauss-Markov rates, or random walks, to `out`.

    The rates are drawn every so many samples; their sum is a straight line in between.

    Parameters
    ----------
    every : int
        Samples from draw to draw.
    rho, kick : (p,) float64
        New value = rho old + kick normal, for each process.
    step : float
        Sampling interval, s.
    place : (1,) int64
        Samples since the last draw; left ready for the next chunk.
    state : (p, m) float64
        The rate of each process at the next draw, rad/s.
    line : (m, 2) float64
        Their sum at the last draw and at the next.
    normal : (k, p, m) float64
        Unit normal numbers: one row a draw.
    out : (n, m) float64
        Increments.
    """
    used = 0
    at = place[0]
    part = 1.0 / every
    for i in range(out.shape[0]):
        if at == 0:
            for j in range(out.shape[1]):
                line[j, 0] = line[j, 1]
                total = 0.0
                for p in range(rho.shape[0]):
                    state[p, j] = rho[p] * state[p, j] + kick[p] * normal[used, p, j]
                    total += state[p, j]
                line[j, 1] = total
            used += 1
        u = (at + 0.5) * part
        for j in range(out.shape[1]):
            out[i, j] += step * (line[j, 0] + u * (line[j, 1] - line[j, 0]))
        at += 1
        if at == every:
            at = 0
    place[0] = at


@kernel
def measure(
    state, step, warm, bias, matrix, asymmetry, g1, g2, heat, most, grain, wn, fn, dtheta, dvel
):
    """Turn true increments plus noise into what an instrument says, in place.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        Left ready for the next chunk.
    step : float
        Sampling interval, s.
    warm : float
        Warming, K/s.
    bias, asymmetry, g2, heat : (6,) float64
        Of gyros, then accelerometers; rates.
    matrix : (6, 3) float64
        Scale and misalignment errors.
    g1 : (3, 3) float64
        g-sensitivity of the gyros.
    most : (6,) float64
        Largest rate that is measured; 0 is no limit.
    grain : (6,) float64
        Rounding step of the summed increments; 0 is none.
    wn, fn : (n, 3) float64
        Increments of noise.
    dtheta, dvel : (n, 3) float64
        True increments; replaced.
    """
    r = 1.0 / step
    for i in range(dtheta.shape[0]):
        fx, fy, fz = dvel[i, 0] * r, dvel[i, 1] * r, dvel[i, 2] * r
        kelvin = warm * (state[18] + 0.5 * step)
        state[18] += step
        for group in range(2):
            b = 3 * group
            out = dtheta if group == 0 else dvel
            noise = wn if group == 0 else fn
            x, y, z = out[i, 0], out[i, 1], out[i, 2]
            for j in range(3):
                c = b + j
                own = x if j == 0 else (y if j == 1 else z)
                f = fx if j == 0 else (fy if j == 1 else fz)
                rate = bias[c] + heat[c] * kelvin + g2[c] * f * f
                if group == 0:
                    rate += g1[j, 0] * fx + g1[j, 1] * fy + g1[j, 2] * fz
                value = own + matrix[c, 0] * x + matrix[c, 1] * y + matrix[c, 2] * z
                value += asymmetry[c] * abs(own) + step * rate + noise[i, j]
                if most[c] > 0.0:
                    value = max(-most[c] * step, min(most[c] * step, value))
                if grain[c] > 0.0:
                    state[c] += value
                    rounded = math.floor(state[c] / grain[c]) * grain[c]
                    value = rounded - state[6 + c]
                    state[6 + c] = rounded
                out[i, j] = value
