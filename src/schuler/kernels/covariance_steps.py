"""Steps of a Kalman filter's covariance: prediction with a sparse transition, scalar updates.

The first `dynamic` states have full rows in the transition; all states behind them are constants
or first-order Gauss-Markov processes, whose rows hold one number on the diagonal. Matrices have
padded rows (`schuler.kernels.ins_layout`), and are symmetric to the last bit.
"""

from __future__ import annotations

from schuler.kernels._jit import kernel

WIDTH = 12
"""Columns of the dynamic block, padded."""


@kernel
def find_columns(phi, columns, dynamic):
    """List, for each three rows of `phi`, the columns that are not all zero.

    Parameters
    ----------
    phi : (>= dynamic, size) float64
    columns : (>= dynamic / 3, size + 1) int64
        Filled: their count, then the columns.
    dynamic : int
    """
    for b in range(dynamic // 3):
        count = 0
        i = 3 * b
        for k in range(phi.shape[1]):
            if phi[i, k] != 0.0 or phi[i + 1, k] != 0.0 or phi[i + 2, k] != 0.0:
                count += 1
                columns[b, count] = k
        columns[b, 0] = count


@kernel
def _multiply(phi, columns, m, out, dynamic, width):
    """Fill out (dynamic, width) with phi m, three rows by four columns at a time."""
    for b in range(dynamic // 3):
        i = 3 * b
        count = columns[b, 0]
        for j in range(0, width, 4):
            a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = c0 = c1 = c2 = c3 = 0.0
            for n in range(1, count + 1):
                k = columns[b, n]
                f, g, h = phi[i, k], phi[i + 1, k], phi[i + 2, k]
                x0, x1, x2, x3 = m[k, j], m[k, j + 1], m[k, j + 2], m[k, j + 3]
                a0 += f * x0
                a1 += f * x1
                a2 += f * x2
                a3 += f * x3
                b0 += g * x0
                b1 += g * x1
                b2 += g * x2
                b3 += g * x3
                c0 += h * x0
                c1 += h * x1
                c2 += h * x2
                c3 += h * x3
            out[i, j], out[i, j + 1], out[i, j + 2], out[i, j + 3] = a0, a1, a2, a3
            out[i + 1, j], out[i + 1, j + 1] = b0, b1
            out[i + 1, j + 2], out[i + 1, j + 3] = b2, b3
            out[i + 2, j], out[i + 2, j + 1] = c0, c1
            out[i + 2, j + 2], out[i + 2, j + 3] = c2, c3


@kernel
def predict(p, phi, columns, decay, noise, work, flipped, block, dynamic):
    """Turn P (size, size) into Phi P Phi^T + diag(noise).

    Parameters
    ----------
    p : (size, size) float64
    phi : (>= dynamic, size) float64
        Rows of the transition for the dynamic states.
    columns : (>= dynamic / 3, size + 1) int64
        As `find_columns` leaves them.
    decay : (size,) float64
        The transition's diagonal for the others.
    noise : (size,) float64
    work, flipped, block : (>= dynamic, size), (size, WIDTH), (>= dynamic, WIDTH) float64
        Scratch arrays.
    dynamic : int
        A multiple of three.
    """
    size = p.shape[0]
    _multiply(phi, columns, p, work, dynamic, size)
    for i in range(dynamic):
        for k in range(size):
            flipped[k, i] = work[i, k]
    _multiply(phi, columns, flipped, block, dynamic, WIDTH)
    for i in range(dynamic):
        for j in range(i, dynamic):
            p[i, j] = block[i, j]
            p[j, i] = block[i, j]
        for j in range(dynamic, size):
            a = work[i, j] * decay[j]
            p[i, j] = a
            p[j, i] = a
    for i in range(dynamic, size):
        a = decay[i]
        for j in range(dynamic, size):
            p[i, j] *= a * decay[j]
    for i in range(size):
        p[i, i] += noise[i]


@kernel
def chain_transition(chain, phi, columns, decay, work, dynamic):
    """Turn the transition so far (size, size) into that with one more step behind it."""
    size = chain.shape[0]
    _multiply(phi, columns, chain, work, dynamic, size)
    for i in range(dynamic, size):
        a = decay[i]
        for j in range(size):
            chain[i, j] *= a
    for i in range(dynamic):
        for j in range(size):
            chain[i, j] = work[i, j]


@kernel
def move_state(x, phi, decay, line, dynamic):
    """Turn the error state x (size,) into Phi x; line (size,) is a scratch array."""
    size = x.shape[0]
    for i in range(dynamic):
        total = 0.0
        for k in range(size):
            total += phi[i, k] * x[k]
        line[i] = total
    for i in range(dynamic, size):
        x[i] *= decay[i]
    for i in range(dynamic):
        x[i] = line[i]


@kernel
def sparse_product(p, h, ph):
    """Fill ph (size,) with P h for a row h (size,) of few numbers; return h P h."""
    size = p.shape[0]
    for i in range(size):
        ph[i] = 0.0
    for k in range(size):
        a = h[k]
        if a != 0.0:
            for i in range(size):
                ph[i] += a * p[k, i]
    total = 0.0
    for k in range(size):
        total += h[k] * ph[k]
    return total


@kernel
def apply_gain(p, h, ph, gain, r, spare):
    """Turn P into (I - K h) P (I - K h)^T + r K K^T for any gain; ph is P h.

    One side after the other: multiplied out, the small rest of a large covariance would be lost
    (Joseph's form; Bucy and Joseph, 1968).
    """
    size = p.shape[0]
    for i in range(size):
        spare[i] = -r * gain[i]
    for k in range(size):
        a = h[k]
        if a != 0.0:
            for i in range(size):
                spare[i] += a * (p[k, i] - gain[i] * ph[k])
    for i in range(size):
        a, b, c = gain[i], spare[i], ph[i]
        # Left of the diagonal the numbers of the column: the same products, the same sum.
        for j in range(size):
            right = (p[i, j] - a * ph[j]) - b * gain[j]
            left = (p[i, j] - gain[j] * c) - spare[j] * a
            p[i, j] = left if j < i else right


@kernel
def joint_square(e, s, count):
    """Return e^T S^-1 e for the leading `count` numbers; S (count, count) is overwritten.

    A direction without variance counts for nothing unless the innovation lies in it, where the
    square is infinite.
    """
    total = 0.0
    for i in range(count):
        for j in range(i + 1):
            a = s[i, j]
            for k in range(j):
                a -= s[i, k] * s[j, k]
            if i == j:
                s[i, i] = a**0.5 if a > 0.0 else 0.0
            else:
                s[i, j] = a / s[j, j] if s[j, j] > 0.0 else 0.0
        a = e[i]
        for k in range(i):
            a -= s[i, k] * e[k]
        # e is overwritten by its whitened form.
        if s[i, i] > 0.0:
            e[i] = a / s[i, i]
        else:
            e[i] = 0.0
            if a != 0.0:
                return 1e300
        total += e[i] * e[i]
    return total
