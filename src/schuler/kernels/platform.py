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
from schuler.kernels.gimbals import angle_rates, platform_matrix


@helper
def _force(angles, order, harmonics, c, s, f):
    m = platform_matrix(angles[0], angles[1], angles[2], order)
    x = harmonics[0, 0] + harmonics[1, 0] * c + harmonics[2, 0] * s
    y = harmonics[0, 1] + harmonics[1, 1] * c + harmonics[2, 1] * s
    z = harmonics[0, 2] + harmonics[1, 2] * c + harmonics[2, 2] * s
    f[0] = 1.0
    for a in range(3):
        f[1 + a] = m[3 * a] * x + m[3 * a + 1] * y + m[3 * a + 2] * z


@helper
def _gyro_terms(axes, j, f, mono):
    """Fill what the ten coefficients of gyro j are multiplied by; its axes are I, O, S."""
    i = axes[j, 0, 0] * f[1] + axes[j, 0, 1] * f[2] + axes[j, 0, 2] * f[3]
    o = axes[j, 1, 0] * f[1] + axes[j, 1, 1] * f[2] + axes[j, 1, 2] * f[3]
    s = axes[j, 2, 0] * f[1] + axes[j, 2, 1] * f[2] + axes[j, 2, 2] * f[3]
    mono[j, 0], mono[j, 1], mono[j, 2], mono[j, 3] = 1.0, i, o, s
    mono[j, 4], mono[j, 5] = i * i, s * s
    mono[j, 6], mono[j, 7], mono[j, 8], mono[j, 9] = i * o, i * s, o * s, o * o


@helper
def _rates(x, terms, angles, order, axes, turning, harmonics, earth, c, s, f, mono, rate):
    """Fill the force, the gyros' terms, the angles' rates -T (w + C earth), and w (eq. 18)."""
    _force(angles, order, harmonics, c, s, f)
    m = platform_matrix(angles[0], angles[1], angles[2], order)
    for a in range(3):
        rate[3 + a] = turning[a]
    for j in range(3):
        _gyro_terms(axes, j, f, mono)
        drift = 0.0
        for t in range(terms):
            drift += x[3 * t + j] * mono[j, t]
        for a in range(3):
            rate[3 + a] += axes[j, 0, a] * drift
    p = rate[3] + m[0] * earth[0] + m[1] * earth[1] + m[2] * earth[2]
    q = rate[4] + m[3] * earth[0] + m[4] * earth[1] + m[5] * earth[2]
    r = rate[5] + m[6] * earth[0] + m[7] * earth[1] + m[8] * earth[2]
    rate[0], rate[1], rate[2] = angle_rates(angles, order, -p, -q, -r)


@helper
def _output(x, at, i, f, h):
    """Return output i; fill its derivatives by k0 .. kIP (0-4), mounting (5, 6), force (7-9)."""
    own = f[1 + i]
    if i == 1:
        own += x[at + 15] * f[1]
    elif i == 2:
        own += x[at + 16] * f[1] + x[at + 17] * f[2]
    # P is at right angles to I as the mounting angles have it (eq. 2 and 3).
    other = f[2]
    if i == 1:
        other = -f[3]
    elif i == 2:
        other -= x[at + 17] * f[3]
    k1, k2, k3, kp = x[at + 3 + i], x[at + 6 + i], x[at + 9 + i], x[at + 12 + i]
    slope = 1.0 + k1 + own * (2.0 * k2 + 3.0 * own * k3) + kp * other
    h[0] = 1.0
    h[1] = own
    h[2] = own * own
    h[3] = own * own * own
    h[4] = own * other
    h[5] = slope * f[1] if i > 0 else 0.0
    h[6] = slope * f[2] - kp * own * f[3] if i == 2 else 0.0
    h[7] = h[8] = h[9] = 0.0
    h[7 + i] = slope
    if i == 1:
        h[7] += slope * x[at + 15]
        h[9] -= kp * own
    elif i == 2:
        h[7] += slope * x[at + 16]
        h[8] += slope * x[at + 17] + kp * own
        h[9] -= kp * own * x[at + 17]
    else:
        h[8] += kp * own
    return x[at + i] + own * (1.0 + k1 + own * (k2 + own * k3) + kp * other)


@kernel
def filter_position(
    x, off, cov, first, outputs, order, axes, turning, harmonics, omega, earth, step, every, terms,
    noise, walk, about, variant, innovation_sums,
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
    order : int
        Of the gimbals.
    axes : (3, 3, 3) float64
        Axes I, O, S (rows) of each gyro in p.
    turning : (3,) float64
        Commanded rate less the servo loop's error, in p, rad/s.
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
    innovation_sums : (2,) float64
        Sum of squared normalised innovations and their count; added to.
    """
    size = x.shape[0]
    n = size - 6
    at = 3 * terms
    angles = x[n : n + 3]
    f = np.zeros(4)
    mono = np.zeros((3, 10))
    mono_end = np.zeros((3, 10))
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
            _rates(x, terms, angles, order, axes, turning, harmonics, earth,
                   math.cos(omega * t), math.sin(omega * t), f, mono, rate)  # fmt: skip
            for a in range(3):
                guess[a] = angles[a] + step * rate[a]
            _slope(x, terms, axes, f, rate, slope)
            for j in range(3):
                for a in range(3):
                    phi[j, a] += step * slope[j, a]
            t += step
            _rates(x, terms, guess, order, axes, turning, harmonics, earth,
                   math.cos(omega * t), math.sin(omega * t), f, mono_end, ahead)  # fmt: skip
            for a in range(3):
                angles[a] += 0.5 * step * (rate[a] + ahead[a])
            for j in range(3):
                for q in range(terms):
                    grown[j, q] += 0.5 * step * (mono[j, q] + mono_end[j, q])
        for j in range(3):
            for c in range(size):
                rows[j, c] = cov[n + j, c]
            for g in range(3):
                if axes[g, 0, j] == 0.0:
                    continue
                for q in range(terms):
                    b = axes[g, 0, j] * grown[g, q]
                    for c in range(size):
                        rows[j, c] += b * cov[3 * q + g, c]
            for a in range(3):
                b = phi[j, a]
                for c in range(size):
                    rows[j, c] += b * cov[n + a, c]
        if about:
            for j in range(3):
                total = off[n + j]
                for g in range(3):
                    for q in range(terms):
                        total += axes[g, 0, j] * grown[g, q] * off[3 * q + g]
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
                    for g in range(3):
                        for q in range(terms):
                            total += axes[g, 0, i] * grown[g, q] * rows[j, 3 * q + g]
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
            _force(angles, order, harmonics, c_, s_, f)
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
            innovation_sums[0] += residual * residual / spread
            innovation_sums[1] += 1.0
            if about:
                for r in range(size):
                    off[r] += gain[r] * residual
            else:
                for r in range(n):
                    x[r] += gain[r] * residual
                for g in (n, n + 3):
                    small[0], small[1], small[2] = angle_rates(
                        x[g : g + 3], order, -gain[g] * residual, -gain[g + 1] * residual,
                        -gain[g + 2] * residual,
                    )  # fmt: skip
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
def _slope(x, terms, axes, f, rate, slope):
    """Fill how fast phi grows with phi: w x, and the drift's slope d eps / d f times -[f x]."""
    slope[0, 0] = slope[1, 1] = slope[2, 2] = 0.0
    slope[0, 1], slope[0, 2], slope[1, 2] = -rate[5], rate[4], -rate[3]
    slope[1, 0], slope[2, 0], slope[2, 1] = rate[5], -rate[4], rate[3]
    for j in range(3):
        i = axes[j, 0, 0] * f[1] + axes[j, 0, 1] * f[2] + axes[j, 0, 2] * f[3]
        o = axes[j, 1, 0] * f[1] + axes[j, 1, 1] * f[2] + axes[j, 1, 2] * f[3]
        s = axes[j, 2, 0] * f[1] + axes[j, 2, 1] * f[2] + axes[j, 2, 2] * f[3]
        io, is_, os = x[18 + j], x[21 + j], x[24 + j]
        oo = x[27 + j] if terms == 10 else 0.0
        di = x[3 + j] + 2.0 * x[12 + j] * i + io * o + is_ * s
        do = x[6 + j] + io * i + os * s + 2.0 * oo * o
        ds = x[9 + j] + 2.0 * x[15 + j] * s + is_ * i + os * o
        gx = di * axes[j, 0, 0] + do * axes[j, 1, 0] + ds * axes[j, 2, 0]
        gy = di * axes[j, 0, 1] + do * axes[j, 1, 1] + ds * axes[j, 2, 1]
        gz = di * axes[j, 0, 2] + do * axes[j, 1, 2] + ds * axes[j, 2, 2]
        for a in range(3):
            slope[a, 0] += axes[j, 0, a] * (gz * f[2] - gy * f[3])
            slope[a, 1] += axes[j, 0, a] * (gx * f[3] - gz * f[1])
            slope[a, 2] += axes[j, 0, a] * (gy * f[1] - gx * f[2])
