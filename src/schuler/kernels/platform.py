"""The platform's filter: 27 or 30 gyro and 18 accelerometer coefficients, three attitude angles.

The state holds the coefficients as in `schuler.kernels.centrifuge`, then alpha, beta, gamma, then
what these were at the start of the position (three passengers, which a second pass needs). Off and
covariance have in their places phi = -T^-1 (error of the angles), the small turn in p.
Measurements are taken one at a time; a plain covariance (variant 0) or a square root S of it, as
a full matrix, by Potter's update (variant 1; Maybeck, 1979, section 7.3).
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper, kernel
from schuler.kernels.centrifuge import _FIRST, _SECOND, _SIGN, _TERM, platform_matrix


@helper
def _force(angles, harmonics, c, s, f):
    m = platform_matrix(angles[0], angles[1], angles[2])
    x = harmonics[0, 0] + harmonics[1, 0] * c + harmonics[2, 0] * s
    y = harmonics[0, 1] + harmonics[1, 1] * c + harmonics[2, 1] * s
    z = harmonics[0, 2] + harmonics[1, 2] * c + harmonics[2, 2] * s
    f[0] = 1.0
    for a in range(3):
        f[1 + a] = m[3 * a] * x + m[3 * a + 1] * y + m[3 * a + 2] * z


@helper
def _rates(x, terms, angles, harmonics, earth, c, s, f, mono, rate):
    """Fill the force, its monomials and the rates of the angles, -T (eps + C w)."""
    _force(angles, harmonics, c, s, f)
    mono[0] = 1.0
    for a in range(9):
        mono[1 + a] = f[_FIRST[a]] * f[_SECOND[a]]
    m = platform_matrix(angles[0], angles[1], angles[2])
    for j in range(3):
        total = m[3 * j] * earth[0] + m[3 * j + 1] * earth[1] + m[3 * j + 2] * earth[2]
        for t in range(terms):
            total += x[3 * t + j] * _SIGN[j, t] * mono[_TERM[j, t]]
        rate[3 + j] = total
    turn(angles, -rate[3], -rate[4], -rate[5], rate)


@helper
def turn(angles, p, q, r, out):
    """Fill T (p, q, r): what the angles do when p turns by so much (eq. 15, for z, y, x)."""
    sb, cb = math.sin(angles[1]), math.cos(angles[1])
    sg, cg = math.sin(angles[2]), math.cos(angles[2])
    a = (cg * p - sg * q) / cb
    out[0] = a
    out[1] = sg * p + cg * q
    out[2] = r - sb * a


@helper
def _output(x, at, i, f, h):
    """Return output i; fill its derivatives by k0 .. kIP (0-4), mounting (5, 6), force (7-9)."""
    own = f[1 + i]
    if i == 1:
        own += x[at + 15] * f[1]
    elif i == 2:
        own += x[at + 16] * f[1] + x[at + 17] * f[2]
    other = -f[3] if i == 1 else f[2]
    k1, k2, k3, kp = x[at + 3 + i], x[at + 6 + i], x[at + 9 + i], x[at + 12 + i]
    slope = 1.0 + k1 + own * (2.0 * k2 + 3.0 * own * k3) + kp * other
    h[0] = 1.0
    h[1] = own
    h[2] = own * own
    h[3] = own * own * own
    h[4] = own * other
    h[5] = slope * f[1] if i > 0 else 0.0
    h[6] = slope * f[2] if i == 2 else 0.0
    h[7] = h[8] = h[9] = 0.0
    h[7 + i] = slope
    if i == 1:
        h[7] += slope * x[at + 15]
        h[9] -= kp * own
    elif i == 2:
        h[7] += slope * x[at + 16]
        h[8] += slope * x[at + 17] + kp * own
    else:
        h[8] += kp * own
    return x[at + i] + own * (1.0 + k1 + own * (k2 + own * k3) + kp * other)


@kernel
def filter_position(
    x, off, cov, first, outputs, harmonics, omega, earth, step, every, terms, noise, walk, about,
    variant, tally,
):  # fmt: skip
    """Feed output samples of one position; x, off and cov are left ready for more.

    Parameters
    ----------
    x : (n + 6,) float64
        The state: coefficients, the angles now, the angles at the position's start.
    off : (n + 6,) float64
        What the estimate is off from x, the turns as phi; zero unless `about`.
    cov : (n + 6, n + 6) float64
        Covariance of the estimate, or the square root of it.
    first : int
        Steps of the position that are done.
    outputs : (m, 3) float64
        Accelerometer outputs, g, one every `every` steps.
    harmonics, omega, earth
        The plant, as in `direct_accumulation`.
    step, every : float, int
        Step of the propagation, s; steps to a sample.
    terms : int
        Terms of a gyro.
    noise, walk : float
        Variance of an output, g^2; density of white drift noise, rad^2/s (variant 0 only).
    about : bool
        Linearise about x, which only moves as the plant does, and gather what is found in `off`;
        else about the estimate itself, which is x (the plain extended filter).
    variant : int
        0 covariance, 1 square root.
    tally : (2,) float64
        Sum of squared normalised innovations and their count; added to.
    """
    size = x.shape[0]
    n = size - 6
    at = 3 * terms
    angles = x[n : n + 3]
    f = np.zeros(4)
    mono = np.zeros(10)
    mono_end = np.zeros(10)
    rate = np.zeros(6)
    ahead = np.zeros(6)
    guess = np.zeros(3)
    grown = np.zeros((3, 10))
    phi = np.zeros((3, 3))
    slope = np.zeros((3, 3))
    rows = np.zeros((3, size))
    h = np.zeros(10)
    index = np.zeros(10, np.int64)
    value = np.zeros(10)
    v = np.zeros(size)
    gain = np.zeros(size)
    small = np.zeros(3)
    for k in range(outputs.shape[0]):
        grown[:] = 0.0
        phi[:] = 0.0
        for e in range(every):
            t = (first + k * every + e) * step
            _rates(x, terms, angles, harmonics, earth, math.cos(omega * t), math.sin(omega * t),
                   f, mono, rate)  # fmt: skip
            for a in range(3):
                guess[a] = angles[a] + step * rate[a]
            _slope(x, terms, f, slope)
            for j in range(3):
                for a in range(3):
                    phi[j, a] += step * slope[j, a]
            t += step
            _rates(x, terms, guess, harmonics, earth, math.cos(omega * t), math.sin(omega * t),
                   f, mono_end, ahead)  # fmt: skip
            for a in range(3):
                angles[a] += 0.5 * step * (rate[a] + ahead[a])
            for j in range(3):
                for q in range(terms):
                    w = _TERM[j, q]
                    grown[j, q] += 0.5 * step * _SIGN[j, q] * (mono[w] + mono_end[w])
        for j in range(3):
            for c in range(size):
                rows[j, c] = cov[n + j, c]
            for q in range(terms):
                b = grown[j, q]
                for c in range(size):
                    rows[j, c] += b * cov[3 * q + j, c]
            for a in range(3):
                b = phi[j, a]
                for c in range(size):
                    rows[j, c] += b * cov[n + a, c]
        if about:
            for j in range(3):
                total = off[n + j]
                for q in range(terms):
                    total += grown[j, q] * off[3 * q + j]
                for a in range(3):
                    total += phi[j, a] * off[n + a]
                small[j] = total
            for j in range(3):
                off[n + j] = small[j]
        if variant == 1:
            for j in range(3):
                for c in range(size):
                    cov[n + j, c] = rows[j, c]
        else:
            for j in range(3):
                for c in range(size):
                    if c < n or c >= n + 3:
                        cov[n + j, c] = cov[c, n + j] = rows[j, c]
            for j in range(3):
                for i in range(3):
                    total = rows[j, n + i]
                    for q in range(terms):
                        total += grown[i, q] * rows[j, 3 * q + i]
                    for a in range(3):
                        total += phi[i, a] * rows[j, n + a]
                    cov[n + j, n + i] = total
                cov[n + j, n + j] += walk * step * every
        t = (first + (k + 1) * every) * step
        c_, s_ = math.cos(omega * t), math.sin(omega * t)
        for i in range(3):
            for q in range(5):
                index[q] = at + 3 * q + i
            index[5] = at + 15 if i < 2 else at + 16
            index[6] = at + 17
            for q in range(3):
                index[7 + q] = n + q
            _force(angles, harmonics, c_, s_, f)
            y = _output(x, at, i, f, h)
            for q in range(7):
                value[q] = h[q]
            # delta f = phi x f
            value[7] = h[9] * f[2] - h[8] * f[3]
            value[8] = h[7] * f[3] - h[9] * f[1]
            value[9] = h[8] * f[1] - h[7] * f[2]
            residual = outputs[k, i] - y
            for q in range(10):
                residual -= value[q] * off[index[q]]
            v[:] = 0.0
            for q in range(10):
                b = value[q]
                for c in range(size):
                    v[c] += b * cov[index[q], c]
            spread = noise
            if variant == 1:
                for c in range(size):
                    spread += v[c] * v[c]
                for r in range(size):
                    total = 0.0
                    for c in range(size):
                        total += cov[r, c] * v[c]
                    gain[r] = total / spread
            else:
                for q in range(10):
                    spread += value[q] * v[index[q]]
                for r in range(size):
                    gain[r] = v[r] / spread
            tally[0] += residual * residual / spread
            tally[1] += 1.0
            if about:
                for r in range(size):
                    off[r] += gain[r] * residual
            else:
                for r in range(n):
                    x[r] += gain[r] * residual
                for g in (n, n + 3):
                    turn(x[g : g + 3], -gain[g] * residual, -gain[g + 1] * residual,
                         -gain[g + 2] * residual, small)  # fmt: skip
                    for r in range(3):
                        x[g + r] += small[r]
            if variant == 1:
                b = 1.0 / (1.0 + math.sqrt(noise / spread))
                for r in range(size):
                    w = b * gain[r]
                    for c in range(size):
                        cov[r, c] -= w * v[c]
            else:
                for r in range(size):
                    w = gain[r]
                    for c in range(size):
                        cov[r, c] -= w * v[c]


@helper
def _slope(x, terms, f, slope):
    """Fill how fast phi grows with phi: d eps / d f times -[f x]."""
    for j in range(3):
        gx = gy = gz = 0.0
        for t in range(1, terms):
            w = _TERM[j, t] - 1
            b = x[3 * t + j] * _SIGN[j, t]
            p, q = _FIRST[w], _SECOND[w]
            if q == 0:
                u, z = b, 0.0
            else:
                u, z = b * f[q], b * f[p]
            gx += (u if p == 1 else 0.0) + (z if q == 1 else 0.0)
            gy += (u if p == 2 else 0.0) + (z if q == 2 else 0.0)
            gz += (u if p == 3 else 0.0) + (z if q == 3 else 0.0)
        slope[j, 0] = gz * f[2] - gy * f[3]
        slope[j, 1] = gx * f[3] - gz * f[1]
        slope[j, 2] = gy * f[1] - gx * f[2]
