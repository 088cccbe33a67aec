"""Objectives of centrifuge schemes, many candidates at a time.

An objective is a number to be made small, of the covariance P of the coefficients in units of
their wanted accuracy: 0 the sum of |rho| over pairs, 1 the mean of sigma^2 (A), 2 log det P / n
(D), 3 the largest eigenvalue of P (E), 4 the largest sigma.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels._jit import kernel
from schuler.kernels.centrifuge import invert_information, position_information

SUM_RHO, MEAN_SQUARE, LOG_DET, LARGEST_EIGENVALUE, LARGEST_SIGMA = range(5)
HOPELESS = 1e6
"""The objective of a scheme in which a coefficient is not observable."""


@kernel
def objective(information, wanted, kind, work, inverse):
    """Return the objective of an information matrix; `inverse` is left with its inverse.

    Parameters
    ----------
    information : (n, n) float64
    wanted : (n,) float64
        Accuracy that counts as one, in the unknowns' units.
    kind : int
        As in the module's text.
    work, inverse : (n, n) float64
        Scratch.
    """
    n = information.shape[0]
    if not invert_information(information, work, inverse):
        return HOPELESS
    value = 0.0
    if kind == SUM_RHO:
        for i in range(n):
            row = 0.0
            for j in range(i):
                row += abs(inverse[i, j]) / math.sqrt(inverse[j, j])
            value += row / math.sqrt(inverse[i, i])
    elif kind == MEAN_SQUARE:
        for i in range(n):
            value += inverse[i, i] / (wanted[i] * wanted[i])
        value /= n
    elif kind == LOG_DET:
        # `work` holds the inverse of the factor of the matrix with its diagonal scaled to one.
        for i in range(n):
            value += (
                2.0 * math.log(work[i, i]) - math.log(information[i, i]) - 2.0 * math.log(wanted[i])
            )
        value /= n
    elif kind == LARGEST_EIGENVALUE:
        value = _largest_eigenvalue(inverse, wanted)
    else:
        for i in range(n):
            value = max(value, math.sqrt(inverse[i, i]) / wanted[i])
    return value


@kernel
def _largest_eigenvalue(matrix, wanted):
    """Return the largest eigenvalue of a matrix in units of `wanted`, by the power method."""
    n = matrix.shape[0]
    x = np.ones(n)
    y = np.empty(n)
    value = 0.0
    for _ in range(300):
        size = 0.0
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += matrix[i, j] / (wanted[i] * wanted[j]) * x[j]
            y[i] = total
            size += total * total
        size = math.sqrt(size)
        for i in range(n):
            x[i] = y[i] / size
        if abs(size - value) <= 1e-6 * size:
            return size
        value = size
    return value


@kernel
def scheme_values(schemes, order, nodes, blend, root, omega, terms, prior, wanted, kind, out):
    """Fill `out` (m,) with the objectives of schemes (m, p, 3), rad, of an order of the gimbals.

    The tables are those of `schuler.kernels.centrifuge.many_positions`, of one level.
    """
    n = 3 * terms + 18
    scratch = np.zeros(51 * 51 + 1200 + nodes.shape[1] * 10)
    information = np.zeros((n, n))
    work = np.zeros((n, n))
    inverse = np.zeros((n, n))
    for k in range(schemes.shape[0]):
        information[:] = 0.0
        for p in range(schemes.shape[1]):
            position_information(
                schemes[k, p], order, nodes[0], blend[0], root[0], omega[0], terms, prior,
                scratch, information,
            )  # fmt: skip
        out[k] = objective(information, wanted, kind, work, inverse)


@kernel
def exchange(table, chosen, limit, wanted, kind):
    """Improve a choice of positions by exchanging one at a time while that helps.

    Fedorov's exchange (1972), a position's best substitute at a time.

    Parameters
    ----------
    table : (c, n, n) float64
        Information of the candidates.
    chosen : (p,) int64
        Rows of the table; improved in place.
    limit : int
        Evaluations at most, about.
    wanted, kind
        As in `objective`.

    Returns
    -------
    (float, int)
        The objective reached and the evaluations spent.
    """
    n = table.shape[1]
    work = np.zeros((n, n))
    inverse = np.zeros((n, n))
    total = np.zeros((n, n))
    trial = np.zeros((n, n))
    for p in range(chosen.shape[0]):
        total += table[chosen[p]]
    best = objective(total, wanted, kind, work, inverse)
    spent = 1
    since = 0
    p = 0
    while since < chosen.shape[0] and spent < limit:
        found = chosen[p]
        for c in range(table.shape[0]):
            for i in range(n):
                for j in range(n):
                    trial[i, j] = total[i, j] - table[chosen[p], i, j] + table[c, i, j]
            value = objective(trial, wanted, kind, work, inverse)
            if value < best * (1.0 - 1e-9) - 1e-12:
                best = value
                found = c
        spent += table.shape[0]
        if found == chosen[p]:
            since += 1
        else:
            # Summed afresh, so that no rounding is carried along.
            chosen[p] = found
            total[:] = 0.0
            for q in range(chosen.shape[0]):
                total += table[chosen[q]]
            since = 1
        p = (p + 1) % chosen.shape[0]
    return best, spent
