"""The rotation between two series of vectors: Wahba's problem on centred sums, made robust.

Source: Markley (1988), the SVD; Yang (2002), the weights IGG-III.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.in_motion.series import Series

__all__ = ["LEAST_ROWS", "Sums", "residual_of", "robust_weights", "weights_igg3"]

Array = NDArray[np.float64]

LEAST_ROWS = 6
"""Fewer measurements are no alignment."""

_ROUNDS = 3
_LOW, _HIGH = 1.5, 4.0
"""IGG-III: full weight up to the first, none from the second on, in 1-sigma of one axis."""

_USUAL = 1.538
"""Median length of a vector of three unit normal numbers."""


class Sums:
    """Cumulative sums of two series: the rotation of any window of rows.

    Parameters
    ----------
    series : Series
    weights : (n,) float64
    """

    def __init__(self, series: Series, weights: Array) -> None:
        n = len(series)
        w = weights[:, None]
        q = series.nuisance
        self._q = q
        columns = [
            np.einsum("ia,ib->iab", w * series.y, series.x).reshape(n, -1),
            np.einsum("ia,ib->iab", w * q, series.y).reshape(n, -1),
            np.einsum("ia,ib->iab", w * q, series.x).reshape(n, -1),
            np.einsum("ia,ib->iab", w * q, q).reshape(n, -1),
        ]
        self._cuts = np.cumsum([c.shape[1] for c in columns])[:-1]
        self._table = np.concatenate(
            [np.zeros((1, self._cuts[-1] + columns[-1].shape[1])),
             np.cumsum(np.concatenate(columns, axis=1), axis=0)]
        )  # fmt: skip

    def rotation(self, first: int = 0, last: int | None = None) -> Array:
        """Return the rotation (3, 3) from x to y of rows first to last (as a slice)."""
        total = self._table[-1 if last is None else last] - self._table[first]
        yx, qy, qx, qq = np.split(total, self._cuts)
        k = self._q.shape[1]
        b = yx.reshape(3, 3) - qy.reshape(k, 3).T @ np.linalg.solve(
            qq.reshape(k, k), qx.reshape(k, 3)
        )
        u, _, vt = np.linalg.svd(b)
        return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def weights_igg3(u: Array) -> Array:
    """Return the weights of normalised residuals by IGG-III (Yang, 2002)."""
    middle = _LOW / np.maximum(u, 1e-12) * ((_HIGH - u) / (_HIGH - _LOW)) ** 2
    return np.where(u <= _LOW, 1.0, np.where(u >= _HIGH, 0.0, middle))


def robust_weights(series: Series, noise: float) -> Array:
    """Return a weight for each row, from residuals of rotations that were weighted so."""
    power = np.trace(series.noise, axis1=1, axis2=2) / 3.0
    base = np.median(power) / power
    weights = np.ones(len(series))
    for _ in range(_ROUNDS):
        mat = Sums(series, weights * base).rotation()
        size = np.linalg.norm(residual_of(series, mat, weights * base), axis=1) / np.sqrt(power)
        size /= noise
        usual = float(np.median(size[weights > 0.0])) / _USUAL
        # What is within the stated noise is no outlier, however small the others are.
        weights = weights_igg3(size / (max(usual, 1.0) * np.sqrt(3.0)))
        if np.sum(weights > 0.0) < LEAST_ROWS:
            raise InputError("the measurements contradict one another: no six of them agree")
    return weights


def residual_of(series: Series, mat: Array, weights: Array) -> Array:
    """Return what a rotation and the unknowns of the start leave of a series, (n, 3)."""
    left = series.y - series.x @ mat.T
    root = np.sqrt(weights)[:, None]
    fit, *_ = np.linalg.lstsq(root * series.nuisance, root * left, rcond=None)
    return np.asarray(left - series.nuisance @ fit)
