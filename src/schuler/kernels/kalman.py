"""Kalman filtering of small dense systems: prediction, scalar updates, smoothing.

The covariance is kept in Joseph's form, by symmetric formulas on its upper half, so that it stays
symmetric and positive whatever the gain is.
"""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel


@kernel
def propagate(p, phi, q, work, n):
    """Turn P (n, n) into phi P phi^T + diag(q), phi being sparse.

    Parameters
    ----------
    p, phi, work : (>= n, >= n) float64
        Covariance, transition matrix, room to work.
    q : (>= n,) float64
        Variances that are added.
    n : int
        States.
    """
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            a = phi[i, k]
            if a != 0.0:
                for j in range(n):
                    work[i, j] += a * p[k, j]
    for i in range(n):
        for j in range(i, n):
            p[i, j] = 0.0
        for k in range(n):
            a = phi[i, k]
            if a != 0.0:
                # Row i of phi with row j of (phi P): the product is symmetric.
                for j in range(i, n):
                    p[i, j] += a * work[j, k]
        p[i, i] += q[i]
    for i in range(n):
        for j in range(i + 1, n):
            p[j, i] = p[i, j]


@kernel
def gain_of(p, h, r, ph, k, n):
    """Fill ph = P h and the gain k for a scalar measurement; return the innovation's variance."""
    s = r
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += p[i, j] * h[j]
        ph[i] = total
    for i in range(n):
        s += h[i] * ph[i]
    g = 1.0 / s
    for i in range(n):
        k[i] = g * ph[i]
    return s


@kernel
def joseph(p, h, ph, k, r, spare, n):
    """Turn P into (I - k h^T) P (I - k h^T)^T + r k k^T for any gain k; ph is P h.

    One side after the other: multiplied out, the small rest of a large covariance would be lost.
    """
    for i in range(n):
        total = 0.0
        for j in range(n):
            p[i, j] -= k[i] * ph[j]
            total += p[i, j] * h[j]
        spare[i] = total - r * k[i]
    for i in range(n):
        a = spare[i]
        for j in range(i, n):
            p[i, j] -= a * k[j]
    for i in range(n):
        for j in range(i + 1, n):
            p[j, i] = p[i, j]


@kernel
def step(p, x, phi, q, z, h, r, work, ph, k, spare, n):
    """Predict and take len(z) scalar measurements: one step of a plain filter.

    Parameters
    ----------
    p, phi, work : (n, n) float64
    x, q, ph, k, spare : (n,) float64
    z, r : (m,) float64
        Measurements and their variances.
    h : (m, n) float64
        Their rows.
    n : int
    """
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += phi[i, j] * x[j]
        ph[i] = total
    for i in range(n):
        x[i] = ph[i]
    propagate(p, phi, q, work, n)
    for m in range(z.shape[0]):
        gain_of(p, h[m], r[m], ph, k, n)
        e = z[m]
        for i in range(n):
            e -= h[m, i] * x[i]
        for i in range(n):
            x[i] += k[i] * e
        joseph(p, h[m], ph, k, r[m], spare, n)


@kernel
def smooth(keep, n, xs, ps, work, spare):
    """Smooth backwards (Rauch, Tung and Striebel, 1965) over the rows of a pass.

    Parameters
    ----------
    keep : (k, 2n + 3n^2) float64
        As `fine` left it, feedback off.
    n : int
    xs, ps : (k, n), (k, n, n) float64
        Filled with the smoothed error states and covariances.
    work, spare : (n, n) float64
        Room to work.
    """
    last = keep.shape[0] - 1
    one, two, three = 2 * n, 2 * n + n * n, 2 * n + 2 * n * n
    for j in range(n):
        xs[last, j] = keep[last, n + j]
        for m in range(n):
            ps[last, j, m] = keep[last, two + n * j + m]
    for i in range(last - 1, -1, -1):
        # Gain P phi^T P_next^-1, solved row by row with the Cholesky factor of what comes next.
        for j in range(n):
            for m in range(n):
                work[j, m] = keep[i + 1, one + n * j + m]
        for j in range(n):
            for m in range(j + 1):
                total = work[j, m]
                for c in range(m):
                    total -= work[j, c] * work[m, c]
                if j == m:
                    work[j, j] = math.sqrt(max(total, 1e-300))
                else:
                    work[j, m] = total / work[m, m]
        for j in range(n):
            for m in range(n):
                total = 0.0
                for c in range(n):
                    total += keep[i, two + n * j + c] * keep[i + 1, three + n * m + c]
                spare[j, m] = total
            for m in range(n):
                total = spare[j, m]
                for c in range(m):
                    total -= work[m, c] * spare[j, c]
                spare[j, m] = total / work[m, m]
            for m in range(n - 1, -1, -1):
                total = spare[j, m]
                for c in range(m + 1, n):
                    total -= work[c, m] * spare[j, c]
                spare[j, m] = total / work[m, m]
        for j in range(n):
            total = keep[i, n + j]
            for c in range(n):
                total += spare[j, c] * (xs[i + 1, c] - keep[i + 1, c])
            xs[i, j] = total
        for j in range(n):
            for m in range(n):
                total = 0.0
                for c in range(n):
                    total += spare[j, c] * (ps[i + 1, c, m] - keep[i + 1, one + n * c + m])
                work[j, m] = total
        for j in range(n):
            for m in range(j, n):
                total = keep[i, two + n * j + m]
                for c in range(n):
                    total += work[j, c] * spare[m, c]
                ps[i, j, m] = total
                ps[i, m, j] = total
