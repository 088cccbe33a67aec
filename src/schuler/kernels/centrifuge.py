"""What a centrifuge test tells of a platform's error coefficients: information matrices.

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

WIDTH = 10
"""Functions of time in a turn."""

MONOMIALS = 10
"""1, x, y, z, xx, yy, zz, xy, xz, yz: the forces that gyro drift depends on."""

#: gyro j, term m -> monomial, with the sign of the axes (I, O, S) of that gyro in p
_TERM = np.array(
    [[0, 1, 3, 2, 4, 5, 8, 7, 9, 6],
     [0, 2, 3, 1, 5, 4, 9, 7, 8, 6],
     [0, 3, 1, 2, 6, 5, 8, 9, 7, 4]], dtype=np.int64
)  # fmt: skip
_SIGN = np.array(
    [[1, 1, -1, 1, 1, 1, -1, 1, -1, 1],
     [1, 1, -1, -1, 1, 1, -1, -1, 1, 1],
     [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]], dtype=np.float64
)  # fmt: skip
_FIRST = np.array([1, 2, 3, 1, 2, 3, 1, 1, 2], dtype=np.int64)
_SECOND = np.array([0, 0, 0, 1, 2, 3, 2, 3, 3], dtype=np.int64)


ZYX, YZX = range(2)
"""Orders of the gimbals: Mz(gamma) My(beta) Mx(alpha), or My(gamma) Mz(beta) Mx(alpha)."""


@helper
def platform_matrix(alpha, beta, gamma, order):
    """Return C_r^p of an order of the gimbals, nine numbers by rows."""
    sa, ca = math.sin(alpha), math.cos(alpha)
    sb, cb = math.sin(beta), math.cos(beta)
    sg, cg = math.sin(gamma), math.cos(gamma)
    if order == YZX:
        return (
            cg * cb, cg * sb * ca + sg * sa, cg * sb * sa - sg * ca,
            -sb, cb * ca, cb * sa,
            sg * cb, sg * sb * ca - cg * sa, sg * sb * sa + cg * ca,
        )  # fmt: skip
    return (
        cg * cb, cg * sb * sa + sg * ca, -cg * sb * ca + sg * sa,
        -sg * cb, -sg * sb * sa + cg * ca, sg * sb * ca + cg * sa,
        sb, -cb * sa, cb * ca,
    )  # fmt: skip


@helper
def angle_rates(angles, order, p, q, r):
    """Return T (p, q, r): how the angles change when p turns at so much (eq. 15 for `YZX`)."""
    sb, cb = math.sin(angles[1]), math.cos(angles[1])
    sg, cg = math.sin(angles[2]), math.cos(angles[2])
    if order == YZX:
        a = (cg * p + sg * r) / cb
        return a, cg * r - sg * p, q + sb * a
    a = (cg * p - sg * q) / cb
    return a, sg * p + cg * q, r - sb * a


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
    """Add to `out` what one position tells, its attitude marginalised.

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
                    rows[c, used] = _SIGN[j, t] * products[h, _TERM[j, t], c]
                    rows[c, used + 1] = -_SIGN[h, t] * products[j, _TERM[h, t], c]
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
    _marginalise(sums, angles, order, prior, n, out)


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
        p, q = force[_FIRST[k]], force[_SECOND[k]]
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
        i, j = _FIRST[k] - 1, _SECOND[k] - 1
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
def _marginalise(sums, angles, order, prior, n, out):
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
def direct_accumulation(
    angles, order, force, omega, earth, samples, step, every, terms, weight, prior, out
):  # fmt: skip
    """Add to `out` what one position tells, sample by sample: the long way, for comparison.

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
            now[1 + a] = f[_FIRST[a]] * f[_SECOND[a]]
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
                row[used] = _SIGN[j, t_] * grown[_TERM[j, t_]] * f[1 + h]
                row[used + 1] = -_SIGN[h, t_] * grown[_TERM[h, t_]] * f[1 + j]
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
    _marginalise(sums, angles, order, prior, n, out)


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
