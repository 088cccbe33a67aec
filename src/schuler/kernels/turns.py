"""Turns of an instrument between poses."""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel
from schuler.kernels.quat import qexp, qmul


@kernel
def turned_directions(starts, stops, time, rate, bias, matrix, before, out):
    """Fill `out` with where directions seen before each turn are seen after it, by the gyros.

    Parameters
    ----------
    starts, stops : (m,) int64
        First and last sample of each turn.
    time, rate : (n,), (n, 3) float64
        s and instantaneous gyro output.
    bias : (m, 3) float64
        The output without rate, for each turn.
    matrix : (3, 3) float64
        rad/s = matrix (output - bias).
    before : (m, 3) float64
        Directions in body axes before the turn.
    out : (m, 3) float64
        The same directions in body axes after it.
    """
    for k in range(starts.shape[0]):
        q = (1.0, 0.0, 0.0, 0.0)
        for i in range(starts[k], stops[k]):
            h = time[i + 1] - time[i]
            a = 0.5 * (rate[i, 0] + rate[i + 1, 0]) - bias[k, 0]
            b = 0.5 * (rate[i, 1] + rate[i + 1, 1]) - bias[k, 1]
            c = 0.5 * (rate[i, 2] + rate[i + 1, 2]) - bias[k, 2]
            q = qmul(q, qexp((
                h * (matrix[0, 0] * a + matrix[0, 1] * b + matrix[0, 2] * c),
                h * (matrix[1, 0] * a + matrix[1, 1] * b + matrix[1, 2] * c),
                h * (matrix[2, 0] * a + matrix[2, 1] * b + matrix[2, 2] * c),
            )))  # fmt: skip
        # The inverse turn: body axes turn, the direction stays.
        w, x, y, z = q
        n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * n, -x * n, -y * n, -z * n
        u, v, t = before[k, 0], before[k, 1], before[k, 2]
        tx, ty, tz = 2.0 * (y * t - z * v), 2.0 * (z * u - x * t), 2.0 * (x * v - y * u)
        out[k, 0] = u + w * tx + y * tz - z * ty
        out[k, 1] = v + w * ty + z * tx - x * tz
        out[k, 2] = t + w * tz + x * ty - y * tx
