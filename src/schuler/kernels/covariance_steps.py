"""Steps of a Kalman filter's covariance: prediction with a sparse transition, scalar updates.

The first `dynamic` states have full rows in the transition; all states behind them are constants
or first-order Gauss-Markov processes, whose rows hold one number on the diagonal. Matrices have
padded rows (`schuler.kernels.ins_layout`), and are symmetric to the last bit.
"""

from __future__ import annotations

from schuler.kernels._jit import kernel
from schuler.kernels.lanes import first_lanes, load4, load_row4, splat4, store4, store_row4

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
    """Fill out (dynamic, width) with phi m, three rows by eight columns at a time."""
    for b in range(dynamic // 3):
        i = 3 * b
        count = columns[b, 0]
        j = 0
        while j + 8 <= width:
            a0 = a1 = b0 = b1 = c0 = c1 = splat4(0.0)
            for n in range(1, count + 1):
                k = columns[b, n]
                x0, x1 = load_row4(m, k, j), load_row4(m, k, j + 4)
                f, g, h = splat4(phi[i, k]), splat4(phi[i + 1, k]), splat4(phi[i + 2, k])
                a0 = a0 + f * x0
                a1 = a1 + f * x1
                b0 = b0 + g * x0
                b1 = b1 + g * x1
                c0 = c0 + h * x0
                c1 = c1 + h * x1
            store_row4(out, i, j, a0)
            store_row4(out, i, j + 4, a1)
            store_row4(out, i + 1, j, b0)
            store_row4(out, i + 1, j + 4, b1)
            store_row4(out, i + 2, j, c0)
            store_row4(out, i + 2, j + 4, c1)
            j += 8
        if j < width:
            a0 = b0 = c0 = splat4(0.0)
            for n in range(1, count + 1):
                k = columns[b, n]
                x0 = load_row4(m, k, j)
                a0 = a0 + phi[i, k] * x0
                b0 = b0 + phi[i + 1, k] * x0
                c0 = c0 + phi[i + 2, k] * x0
            store_row4(out, i, j, a0)
            store_row4(out, i + 1, j, b0)
            store_row4(out, i + 2, j, c0)


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
    # Four columns at a time begin left of the dynamic states: what they overwrite comes after.
    start = dynamic - dynamic % 4
    for i in range(dynamic, size):
        a = decay[i]
        for j in range(start, size, 4):
            store_row4(p, i, j, load_row4(p, i, j) * (a * load4(decay, j)))
        for j in range(0, start, 4):
            store_row4(p, i, j, load_row4(flipped, i, j) * a)
        for j in range(start, dynamic):
            p[i, j] = flipped[i, j] * a
    for i in range(dynamic):
        for j in range(start, size, 4):
            store_row4(p, i, j, load_row4(work, i, j) * load4(decay, j))
    for i in range(dynamic):
        for j in range(i, dynamic):
            p[i, j] = block[i, j]
            p[j, i] = block[i, j]
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
def move_state(x, phi, columns, decay, line, dynamic):
    """Turn the error state x (size,) into Phi x; line (size,) is a scratch array."""
    for b in range(dynamic // 3):
        i = 3 * b
        t0 = t1 = t2 = 0.0
        for n in range(1, columns[b, 0] + 1):
            k = columns[b, n]
            t0 += phi[i, k] * x[k]
            t1 += phi[i + 1, k] * x[k]
            t2 += phi[i + 2, k] * x[k]
        line[i], line[i + 1], line[i + 2] = t0, t1, t2
    for i in range(dynamic, x.shape[0]):
        x[i] *= decay[i]
    for i in range(dynamic):
        x[i] = line[i]


@kernel
def sparse_product(p, h, ph):
    """Fill ph (size,) with P h for a row h (size,) of few numbers; return h P h."""
    size = p.shape[0]
    for j in range(0, size, 4):
        store4(ph, j, splat4(0.0))
    for k in range(size):
        a = h[k]
        if a != 0.0:
            for j in range(0, size, 4):
                store4(ph, j, load4(ph, j) + a * load_row4(p, k, j))
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
    for j in range(0, size, 4):
        store4(spare, j, -r * load4(gain, j))
    for k in range(size):
        a = h[k]
        if a != 0.0:
            c = ph[k]
            for j in range(0, size, 4):
                left = load_row4(p, k, j) - load4(gain, j) * c
                store4(spare, j, load4(spare, j) + a * left)
    for i in range(0, size, 4):
        a0, a1, a2, a3 = (splat4(gain[i]), splat4(gain[i + 1]), splat4(gain[i + 2]),
                          splat4(gain[i + 3]))  # fmt: skip
        b0, b1, b2, b3 = (splat4(spare[i]), splat4(spare[i + 1]), splat4(spare[i + 2]),
                          splat4(spare[i + 3]))  # fmt: skip
        c0, c1, c2, c3 = splat4(ph[i]), splat4(ph[i + 1]), splat4(ph[i + 2]), splat4(ph[i + 3])
        # Left of the diagonal the numbers of the column: the same products, the same sum.
        for j in range(0, i, 4):
            x, y = load4(gain, j), load4(spare, j)
            p0 = (load_row4(p, i, j) - x * c0) - y * a0
            p1 = (load_row4(p, i + 1, j) - x * c1) - y * a1
            p2 = (load_row4(p, i + 2, j) - x * c2) - y * a2
            p3 = (load_row4(p, i + 3, j) - x * c3) - y * a3
            store_row4(p, i, j, p0)
            store_row4(p, i + 1, j, p1)
            store_row4(p, i + 2, j, p2)
            store_row4(p, i + 3, j, p3)
        x, y, z = load4(gain, i), load4(spare, i), load4(ph, i)
        p0, p1, p2, p3 = (load_row4(p, i, i), load_row4(p, i + 1, i), load_row4(p, i + 2, i),
                          load_row4(p, i + 3, i))  # fmt: skip
        store_row4(p, i, i, (p0 - a0 * z) - b0 * x)
        store_row4(p, i + 1, i, first_lanes(1, (p1 - x * c1) - y * a1, (p1 - a1 * z) - b1 * x))
        store_row4(p, i + 2, i, first_lanes(2, (p2 - x * c2) - y * a2, (p2 - a2 * z) - b2 * x))
        store_row4(p, i + 3, i, first_lanes(3, (p3 - x * c3) - y * a3, (p3 - a3 * z) - b3 * x))
        for j in range(i + 4, size, 4):
            x, z = load4(gain, j), load4(ph, j)
            p0 = (load_row4(p, i, j) - a0 * z) - b0 * x
            p1 = (load_row4(p, i + 1, j) - a1 * z) - b1 * x
            p2 = (load_row4(p, i + 2, j) - a2 * z) - b2 * x
            p3 = (load_row4(p, i + 3, j) - a3 * z) - b3 * x
            store_row4(p, i, j, p0)
            store_row4(p, i + 1, j, p1)
            store_row4(p, i + 2, j, p2)
            store_row4(p, i + 3, j, p3)


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
