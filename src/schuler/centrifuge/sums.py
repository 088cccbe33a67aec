"""Gaussian quadrature for sums: a few nodes that add a polynomial over many evenly spaced points.

Sources: Golub and Welsch (1969), Calculation of Gauss quadrature rules, for the discrete measure
on 0, 1, ..., n - 1; the Jacobi matrix by Lanczos (Gautschi, 2004, section 2.2.3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["node_integrals", "sum_nodes", "turn_products"]

Array = NDArray[np.float64]


def sum_nodes(points: int, order: int) -> tuple[Array, Array]:
    """Return nodes and weights (order,) with sum p(k), k < points, = sum of weight p(node).

    Exact for polynomials p of degree 2 order - 1 at most; where there are fewer points than
    `order`, the points themselves.
    """
    if points <= order:
        return np.arange(points, dtype=np.float64), np.ones(points)
    x = np.arange(points) - 0.5 * (points - 1)
    diagonal, off = np.zeros(order), np.zeros(order)
    before, now = np.zeros(points), np.full(points, points**-0.5)
    for k in range(order):
        ahead = x * now - (off[k - 1] * before if k else 0.0)
        diagonal[k] = ahead @ now
        ahead = ahead - diagonal[k] * now
        off[k] = np.linalg.norm(ahead)
        before, now = now, ahead / off[k]
    jacobi = np.diag(diagonal) + np.diag(off[:-1], 1) + np.diag(off[:-1], -1)
    values, vectors = np.linalg.eigh(jacobi)
    return values + 0.5 * (points - 1), points * vectors[0] ** 2


def node_integrals(nodes: Array) -> Array:
    """Return the matrix (q, q) from values at nodes + 1/2 to the integrals from 0 to each node.

    The values' polynomial through the q points is integrated exactly.
    """
    at = nodes + 0.5
    powers = np.arange(len(nodes))
    fit = np.linalg.inv(at[:, None] ** powers)
    return np.asarray(nodes[:, None] ** (powers + 1) / (powers + 1) @ fit)


def turn_products(samples: int, step: float) -> Array:
    """Return the sums (10, 10), over the samples of one turn, of products of its ten functions.

    The functions are 1, cos, sin, cos 2, sin 2, cos 3, sin 3 of the arm's angle, then the time s
    since the turn's start times 1, cos, sin; the samples stand at s = step, 2 step, ...
    """
    s = step * np.arange(1, samples + 1)
    angle = 2.0 * np.pi * np.arange(1, samples + 1) / samples
    c, n = np.cos(angle), np.sin(angle)
    columns = [np.ones(samples), c, n]
    for k in (2, 3):
        columns += [np.cos(k * angle), np.sin(k * angle)]
    matrix = np.column_stack([*columns, s, s * c, s * n])
    return np.asarray(matrix.T @ matrix)
