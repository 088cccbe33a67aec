"""Information matrices of a centrifuge test: a platform's error coefficients.

The coefficients are constants, so a scheme is judged without a filter: the sensitivities of the
three accelerometer outputs are known functions of time, and the information is the sum of their
products. Forces are in g, drifts in rad/s. With phi the turn of the platform that its gyros'
drift has made, C = (I + [phi x]) C_nominal, phi' = eps and delta f = phi x f.

Unknowns: 3 m + j is term m of gyro j (x, y, z) with the terms F, I, O, S, II, SS, IO, IS, OS and,
where asked, OO; then 3 m + i for the terms k0, k1, k2, k3, kIP of accelerometer i; then the angles
th_py, th_pz, th_oz; then phi at the start, three.

**Closed form.** The force is a + b cos wt + c sin wt, slowly turned by the Earth. Over one turn of
the arm each sensitivity is a combination of ten functions of the time s since the turn's start,

    1, cos, sin, cos 2, sin 2, cos 3, sin 3, s, s cos, s sin,

whose sums of products over the samples of a turn are one constant matrix, L L^T. So a turn counts
as ten samples, L^T times the coefficients. From turn to turn all changes as a polynomial: two or
three nodes of the Gaussian quadrature for sums (`schuler.centrifuge.sums`) stand for the dwell.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import helper, kernel
from schuler.kernels.gimbals import angle_rates, platform_matrix

WIDTH = 10
"""Functions of time in a turn."""

MONOMIALS = 10
"""1, x, y, z, xx, yy, zz, xy, xz, yz: the forces that gyro drift depends on."""

#: gyro j, term m -> monomial, with the sign of the axes (I, O, S) of that gyro in p
TERM = np.array(
    [[0, 1, 3, 2, 4, 5, 8, 7, 9, 6],
     [0, 2, 3, 1, 5, 4, 9, 7, 8, 6],
     [0, 3, 1, 2, 6, 5, 8, 9, 7, 4]], dtype=np.int64
)  # fmt: skip
SIGN = np.array(
    [[1, 1, -1, 1, 1, 1, -1, 1, -1, 1],
     [1, 1, -1, -1, 1, 1, -1, -1, 1, 1],
     [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]], dtype=np.float64
)  # fmt: skip
FIRST = np.array([1, 2, 3, 1, 2, 3, 1, 1, 2], dtype=np.int64)
SECOND = np.array([0, 0, 0, 1, 2, 3, 2, 3, 3], dtype=np.int64)


@helper
def _times(a, b, out):
    """Multiply harmonics (0 to 2) by harmonics (0 to 1): `a` (5,), `b` (3,), into out (7,)."""
    out[0] = a[0] * b[0] + 0.5 * (a[1] * b[1] + a[2] * b[2])
    out[1] = a[0] * b[1] + a[1] * b[0] + 0.5 * (a[3] * b[1] + a[4] * b[2])
    out[2] = a[0] * b[2] + a[2] * b[0] + 0.5 * (a[4] * b[1] - a[3] * b[2])
    out[3] = a[3] * b[0] + 0.5 * (a[1] * b[1] - a[2] * b[2])
    out[4] = a[4] * b[0] + 0.5 * (a[1] * b[2] + a[2] * b[1])
    out[5] = 0.5 * (a[3] * b[1] - a[4] * b[2])
    out[6] = 0.5 * (a[3] * b[2] + a[4] * b[1])


@helper
def _whiten(raw, root, weight, width, out):
    """Return weight L^T raw: `root` is L (10, 10), lower."""
    for c in range(WIDTH):
        total = 0.0
        for r in range(c, width):
            total += root[r, c] * raw[r]
        out[c] = weight * total


@kernel
def position_information(angles, order, nodes, blend, root, omega, terms, prior, work, out):
    """Add to `out` the information of one position, its attitude marginalised.

    Parameters
    ----------
    angles : (3,) float64
        alpha, beta, gamma, rad.
    order : int
        Of the gimbals, `ZYX` or `YZX`.
    nodes : (q, 19) float64
        Weight of a node (turns over the noise's variance, 1/g^2), the force a, b, c in the base
        frame as the Earth has turned it by then, g, and how fast it turns these, g/s.
    blend : (q, q) float64
        Integrals of the mean drift up to each node from its values at the nodes, s.
    root : (10, 10) float64
        L, lower: the ten functions' mean products over a turn.
    omega : float
        Rate of the arm, rad/s.
    terms : int
        Terms of a gyro, 9 or 10.
    prior : float
        Information of each Euler angle at the start, 1/rad^2.
    work : float64
        Scratch, `work_size()`.
    out : (n, n) float64
        n = 3 terms + 18; added to, both triangles.
    """
    n = 3 * terms + 18
    full = n + 3
    sums = work[: full * full].reshape(full, full)
    at = full * full
    mono = work[at : at + MONOMIALS * 5].reshape(MONOMIALS, 5)
    at += MONOMIALS * 5
    mean = work[at : at + nodes.shape[0] * MONOMIALS].reshape(nodes.shape[0], MONOMIALS)
    at += nodes.shape[0] * MONOMIALS
    force = work[at : at + 12].reshape(4, 3)
    at += 12
    raw = work[at : at + WIDTH]
    at += WIDTH
    grown = work[at : at + 5]
    at += 5
    products = work[at : at + 3 * MONOMIALS * WIDTH].reshape(3, MONOMIALS, WIDTH)
    at += 3 * MONOMIALS * WIDTH
    rows = work[at : at + WIDTH * 32].reshape(WIDTH, 32)
    at += WIDTH * 32
    column = work[at : at + WIDTH]
    at += WIDTH
    power = work[at : at + 7]
    index = np.empty(32, np.int64)

    sums[:] = 0.0
    m = platform_matrix(angles[0], angles[1], angles[2], order)
    # The means first: what has grown until a node depends on all of them.
    for q in range(nodes.shape[0]):
        _harmonics(m, nodes[q], force, mono)
        _sine_growth(m, nodes[q], force, raw, column, mean[q])
        for k in range(MONOMIALS):
            # A sine that grows within each turn adds up from turn to turn.
            mean[q, k] = mono[k, 0] - mean[q, k] / omega
    for q in range(nodes.shape[0]):
        _harmonics(m, nodes[q], force, mono)
        weight = math.sqrt(nodes[q, 0])
        for k in range(MONOMIALS):
            start = 0.0
            for p in range(nodes.shape[0]):
                start += blend[q, p] * mean[p, k]
            grown[0] = start + (mono[k, 2] + 0.5 * mono[k, 4]) / omega
            grown[1] = -mono[k, 2] / omega
            grown[2] = mono[k, 1] / omega
            grown[3] = -0.5 * mono[k, 4] / omega
            grown[4] = 0.5 * mono[k, 3] / omega
            for a in range(3):
                _times(grown, force[1 + a], raw)
                for c in range(3):
                    raw[7 + c] = mono[k, 0] * force[1 + a, c]
                _whiten(raw, root, weight, WIDTH, products[a, k])
        for i in range(3):
            # Accelerometer i sees phi of the two other axes: delta f = phi x f.
            j, h = (i + 1) % 3, (i + 2) % 3
            used = 0
            for t in range(terms):
                for c in range(WIDTH):
                    rows[c, used] = SIGN[j, t] * products[h, TERM[j, t], c]
                    rows[c, used + 1] = -SIGN[h, t] * products[j, TERM[h, t], c]
                index[used], index[used + 1] = 3 * t + j, 3 * t + h
                used += 2
            for which in range(5):
                if which == 0:
                    raw[:7] = 0.0
                    raw[0] = 1.0
                elif which == 1:
                    _fill(force[1 + i], raw, 3)
                elif which == 2:
                    _fill(mono[4 + i], raw, 5)
                elif which == 3:
                    _times(mono[4 + i], force[1 + i], power)
                    _fill(power, raw, 7)
                else:
                    # P is y, -z, y.
                    _fill(mono[7 if i == 0 else 9], raw, 5)
                    if i == 1:
                        for c in range(5):
                            raw[c] = -raw[c]
                _whiten(raw, root, weight, 7, column)
                for c in range(WIDTH):
                    rows[c, used] = column[c]
                index[used] = 3 * terms + 3 * which + i
                used += 1
            if i > 0:
                for which in range(i):
                    _fill(force[1 + which], raw, 3)
                    _whiten(raw, root, weight, 3, column)
                    for c in range(WIDTH):
                        rows[c, used] = column[c]
                    index[used] = 3 * terms + 15 + (0 if i == 1 else 1 + which)
                    used += 1
            _fill(force[1 + h], raw, 3)
            _whiten(raw, root, weight, 3, column)
            for c in range(WIDTH):
                rows[c, used] = column[c]
            _fill(force[1 + j], raw, 3)
            _whiten(raw, root, weight, 3, column)
            for c in range(WIDTH):
                rows[c, used + 1] = -column[c]
            index[used], index[used + 1] = n + j, n + h
            used += 2
            for r in range(used):
                for c in range(r + 1):
                    total = 0.0
                    for k in range(WIDTH):
                        total += rows[k, r] * rows[k, c]
                    if index[r] >= index[c]:
                        sums[index[r], index[c]] += total
                    else:
                        sums[index[c], index[r]] += total
    marginalise(sums, angles, order, prior, n, out)


@helper
def _fill(source, raw, size):
    for c in range(7):
        raw[c] = source[c] if c < size else 0.0


@helper
def _harmonics(m, node, force, mono):
    """Fill the force (row 0 is one, then x, y, z) and its monomials, in p."""
    force[0, 0] = 1.0
    force[0, 1] = force[0, 2] = 0.0
    for a in range(3):
        for c in range(3):
            force[1 + a, c] = (
                m[3 * a] * node[1 + 3 * c]
                + m[3 * a + 1] * node[2 + 3 * c]
                + m[3 * a + 2] * node[3 + 3 * c]
            )
    mono[0, :] = 0.0
    mono[0, 0] = 1.0
    for k in range(9):
        p, q = force[FIRST[k]], force[SECOND[k]]
        mono[1 + k, 0] = p[0] * q[0] + 0.5 * (p[1] * q[1] + p[2] * q[2])
        mono[1 + k, 1] = p[0] * q[1] + p[1] * q[0]
        mono[1 + k, 2] = p[0] * q[2] + p[2] * q[0]
        mono[1 + k, 3] = 0.5 * (p[1] * q[1] - p[2] * q[2])
        mono[1 + k, 4] = 0.5 * (p[1] * q[2] + p[2] * q[1])


@helper
def _sine_growth(m, node, force, drift, work, out):
    """Fill `out` with how fast the monomials' sines grow: of the first plus half of the second."""
    for a in range(3):
        for c in range(3):
            work[3 * a + c] = (
                m[3 * a] * node[10 + 3 * c]
                + m[3 * a + 1] * node[11 + 3 * c]
                + m[3 * a + 2] * node[12 + 3 * c]
            )
    out[0] = 0.0
    for k in range(9):
        i, j = FIRST[k] - 1, SECOND[k] - 1
        p = force[1 + i]
        total = work[3 * i + 2]
        if j >= 0:
            q = force[1 + j]
            u, v = 3 * i, 3 * j
            total = (
                p[0] * work[v + 2]
                + p[2] * work[v]
                + q[0] * work[u + 2]
                + q[2] * work[u]
                + 0.25 * (p[1] * work[v + 2] + p[2] * work[v + 1])
                + 0.25 * (q[1] * work[u + 2] + q[2] * work[u + 1])
            )
        out[1 + k] = total


@helper
def marginalise(sums, angles, order, prior, n, out):
    """Add to `out` the information of the first n unknowns, the last three integrated out."""
    # phi = -(turn of p); the Euler angles turn by T times it: the prior is T^T T / sigma^2.
    t0, t1, t2 = (
        angle_rates(angles, order, 1.0, 0.0, 0.0),
        angle_rates(angles, order, 0.0, 1.0, 0.0),
        angle_rates(angles, order, 0.0, 0.0, 1.0),
    )
    a00 = sums[n, n] + prior * (t0[0] * t0[0] + t0[1] * t0[1] + t0[2] * t0[2])
    a10 = sums[n + 1, n] + prior * (t0[0] * t1[0] + t0[1] * t1[1] + t0[2] * t1[2])
    a11 = sums[n + 1, n + 1] + prior * (t1[0] * t1[0] + t1[1] * t1[1] + t1[2] * t1[2])
    a20 = sums[n + 2, n] + prior * (t0[0] * t2[0] + t0[1] * t2[1] + t0[2] * t2[2])
    a21 = sums[n + 2, n + 1] + prior * (t1[0] * t2[0] + t1[1] * t2[1] + t1[2] * t2[2])
    a22 = sums[n + 2, n + 2] + prior * (t2[0] * t2[0] + t2[1] * t2[1] + t2[2] * t2[2])
    l00 = math.sqrt(a00)
    l10 = a10 / l00
    l20 = a20 / l00
    l11 = math.sqrt(a11 - l10 * l10)
    l21 = (a21 - l20 * l10) / l11
    l22 = math.sqrt(a22 - l20 * l20 - l21 * l21)
    u, v, w = sums[n], sums[n + 1], sums[n + 2]
    for k in range(n):
        u[k] /= l00
        v[k] = (v[k] - l10 * u[k]) / l11
        w[k] = (w[k] - l20 * u[k] - l21 * v[k]) / l22
    for r in range(n):
        for c in range(r + 1):
            x = sums[r, c] - u[r] * u[c] - v[r] * v[c] - w[r] * w[c]
            out[r, c] += x
            if r != c:
                out[c, r] += x


def work_size(nodes: int) -> int:
    """Return how much scratch `position_information` needs for so many nodes."""
    return 51 * 51 + MONOMIALS * 5 + nodes * MONOMIALS + 12 + 5 + 33 * MONOMIALS + 342 + 64 + 32


@kernel
def many_positions(angles, order, level, nodes, blend, root, omega, terms, prior, out):
    """Fill `out` (p, n, n) with the information of p positions.

    `angles` is (p, 3), `order` that of the gimbals, `level` (p,) says which row of the tables
    `nodes` (levels, q, 19), `blend` (levels, q, q), `root` (levels, 10, 10) and `omega`
    (levels,) is each position's.
    """
    work = np.zeros(51 * 51 + 1200 + nodes.shape[1] * MONOMIALS)
    for p in range(angles.shape[0]):
        out[p] = 0.0
        k = level[p]
        position_information(
            angles[p], order, nodes[k], blend[k], root[k], omega[k], terms, prior, work, out[p]
        )


@kernel
def invert_information(information, work, out):
    """Invert a positive definite matrix by Cholesky, its diagonal scaled to one first.

    Parameters
    ----------
    information : (n, n) float64
    work : (n, n) float64
        Scratch.
    out : (n, n) float64
        The inverse, both triangles.

    Returns
    -------
    bool
        False where the matrix is not positive definite (`out` is then worthless).
    """
    n = information.shape[0]
    scale = np.empty(n)
    for i in range(n):
        if not information[i, i] > 0.0:
            return False
        scale[i] = 1.0 / math.sqrt(information[i, i])
    # L, then its inverse in place (both lower), then the product of the inverse with itself.
    for i in range(n):
        for j in range(i + 1):
            total = information[i, j] * scale[i] * scale[j]
            for k in range(j):
                total -= work[i, k] * work[j, k]
            if i == j:
                if not total > 1e-11:
                    return False
                work[i, i] = math.sqrt(total)
            else:
                work[i, j] = total / work[j, j]
    for i in range(n):
        for j in range(i):
            out[i, j] = work[i, j]
        for j in range(i):
            work[i, j] = 0.0
        r = 1.0 / work[i, i]
        for k in range(i):
            x = out[i, k]
            for j in range(k + 1):
                work[i, j] -= x * work[k, j]
        for j in range(i):
            work[i, j] *= r
        work[i, i] = r
    out[:] = 0.0
    for k in range(n):
        for i in range(k + 1):
            x = work[k, i]
            for j in range(i + 1):
                out[i, j] += x * work[k, j]
    for i in range(n):
        for j in range(i + 1):
            out[i, j] *= scale[i] * scale[j]
            out[j, i] = out[i, j]
    return True
