"""Information of a centrifuge test summed sample by sample, which checks the closed form."""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import kernel
from schuler.kernels.centrifuge import FIRST, MONOMIALS, SECOND, SIGN, TERM, marginalise
from schuler.kernels.gimbals import platform_matrix


@kernel
def direct_accumulation(
    angles, order, force, omega, earth, samples, step, every, terms, weight, prior, out
):  # fmt: skip
    """Add to `out` the information of one position, sample by sample: the long way, for comparison.

    Parameters
    ----------
    angles : (3,) float64
        alpha, beta, gamma at the start, rad.
    order : int
        Of the gimbals.
    force : (3, 3) float64
        a, b, c of the base's force a + b cos wt + c sin wt, g.
    omega, earth : float, (3,) float64
        Rates of the arm and of the base, rad/s.
    samples, step, every : int, float, int
        Steps of the integration (Adams-Moulton), their length (s), steps to a measurement.
    terms, weight, prior
        Terms of a gyro; 1 / variance of a measurement, 1/g^2; information of an Euler angle.
    out : (n, n) float64
        Added to, both triangles.
    """
    n = 3 * terms + 18
    full = n + 3
    sums = np.zeros((full, full))
    m = platform_matrix(angles[0], angles[1], angles[2], order)
    f = np.zeros(4)
    f[0] = 1.0
    before = np.zeros(MONOMIALS)
    earlier = np.zeros(MONOMIALS)
    now = np.zeros(MONOMIALS)
    grown = np.zeros(MONOMIALS)
    row = np.zeros(full)
    index = np.zeros(full, np.int64)
    rate = math.sqrt(earth[0] ** 2 + earth[1] ** 2 + earth[2] ** 2)
    for k in range(samples + 1):
        t = k * step
        c, s = math.cos(omega * t), math.sin(omega * t)
        # The base turns with the Earth, the platform does not: exp([w t x]) by Rodrigues.
        x = force[0, 0] + force[1, 0] * c + force[2, 0] * s
        y = force[0, 1] + force[1, 1] * c + force[2, 1] * s
        z = force[0, 2] + force[1, 2] * c + force[2, 2] * s
        a1 = math.sin(rate * t) / rate if rate > 0.0 else 0.0
        a2 = (1.0 - math.cos(rate * t)) / (rate * rate) if rate > 0.0 else 0.0
        u = earth[1] * z - earth[2] * y
        v = earth[2] * x - earth[0] * z
        w = earth[0] * y - earth[1] * x
        x += a1 * u + a2 * (earth[1] * w - earth[2] * v)
        y += a1 * v + a2 * (earth[2] * u - earth[0] * w)
        z += a1 * w + a2 * (earth[0] * v - earth[1] * u)
        for a in range(3):
            f[1 + a] = m[3 * a] * x + m[3 * a + 1] * y + m[3 * a + 2] * z
        now[0] = 1.0
        for a in range(9):
            now[1 + a] = f[FIRST[a]] * f[SECOND[a]]
        for a in range(MONOMIALS):
            if k == 1:
                grown[a] = 0.5 * step * (before[a] + now[a])
            elif k > 1:
                grown[a] += step / 12.0 * (5.0 * now[a] + 8.0 * before[a] - earlier[a])
            earlier[a], before[a] = before[a], now[a]
        if k == 0 or k % every != 0:
            continue
        for i in range(3):
            j, h = (i + 1) % 3, (i + 2) % 3
            used = 0
            for t_ in range(terms):
                row[used] = SIGN[j, t_] * grown[TERM[j, t_]] * f[1 + h]
                row[used + 1] = -SIGN[h, t_] * grown[TERM[h, t_]] * f[1 + j]
                index[used], index[used + 1] = 3 * t_ + j, 3 * t_ + h
                used += 2
            value = 1.0
            for which in range(4):
                row[used] = value
                index[used] = 3 * terms + 3 * which + i
                value *= f[1 + i]
                used += 1
            row[used] = f[1] * f[2] if i == 0 else (-f[2] * f[3] if i == 1 else f[3] * f[2])
            index[used] = 3 * terms + 12 + i
            used += 1
            for which in range(i):
                row[used] = f[1 + which]
                index[used] = 3 * terms + 15 + (0 if i == 1 else 1 + which)
                used += 1
            row[used], row[used + 1] = f[1 + h], -f[1 + j]
            index[used], index[used + 1] = n + j, n + h
            used += 2
            for r in range(used):
                for q in range(used):
                    if index[r] >= index[q]:
                        sums[index[r], index[q]] += weight * row[r] * row[q]
    marginalise(sums, angles, order, prior, n, out)
