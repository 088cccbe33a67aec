"""The frozen-inertial-frame estimators, and how each answers to errors in the velocity integral.

C_b^n(t) = C_i0^n(t) C_ib0^i0 C_b^ib0(t). The first is known from latitude and elapsed time, the
last comes from the gyros, and the middle one is constant: it turns v(t), the integral of the
force in ib0, into G(t), the theoretical integral in i0.

Its error phi_0 is linear in the errors e_k of v (in i0) at the instants of the history:
phi_0 = sum of W_k e_k. All of the uncertainty follows from these weights.

Sources: the inertial-frame method after Qin, Yan, Gu and Zheng (2005); the centred form is
Kabsch (1976) applied to velocity integrals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.align.history import History, gravity_direction
from schuler.attitude import skew
from schuler.errors import InputError
from schuler.estimate.vectors import triad, wahba_svd

__all__ = ["MINIMUM_ROWS", "Weights", "solve", "weights"]

Array = NDArray[np.float64]

MINIMUM_ROWS = 5
"""Instants without which no estimator can work: two spans with two instants in each."""

FORCE_SPAN = 0.1
"""The force at an instant is the mean over at least so long (s)."""


def _instants(h: History) -> tuple[int, int, int]:
    """Return the middle instant, the last one, and the rows that a force takes."""
    last = len(h) - 1
    middle = int(np.argmin(np.abs(h.t - 0.5 * h.duration)))
    spacing = h.duration / last
    width = min(max(int(np.ceil(FORCE_SPAN / spacing - 1e-6)), 1), max(last // 4, 1))
    return middle, last, width


def _pair(h: History, series: Array, estimator: str) -> tuple[Array, Array]:
    """Return the two vectors of a TRIAD estimator out of a series at the instants."""
    middle, last, width = _instants(h)
    if estimator == "integral-triad":
        return series[middle] - series[0], series[last] - series[0]
    a = middle - width // 2
    return series[a + width] - series[a], series[last] - series[last - width]


def solve(h: History, gravity: float, lat: float, estimator: str) -> Array:
    """Return R = C_ib0^i0 (3, 3).

    Parameters
    ----------
    h : History
    gravity : float
        m/s^2.
    lat : float
        rad.
    estimator : str
        As in `Inertial`.

    Raises
    ------
    InputError
        If the record is too short or the vectors do not fix an attitude.
    """
    if len(h) < MINIMUM_ROWS:
        raise InputError(
            f"the record has only {h.samples} samples ({h.duration:.3g} s): too few to align"
        )
    if estimator in ("integral-triad", "instants-triad"):
        r1, r2 = _pair(h, h.theory(gravity, lat), estimator)
        v1, v2 = _pair(h, h.velocity, estimator)
        # The later vector carries the more signal: it is fitted exactly.
        return triad(r2, r1, v2, v1)
    n, sv, sb, sbv = h.sums()
    if estimator == "centred":
        sbv = sbv - np.outer(sb, sv) / n
    return wahba_svd(gravity * gravity_direction(lat)[:, None] * sbv)


class Weights:
    """How phi_0 answers to velocity errors: at the instants and over the stretches between.

    Attributes
    ----------
    point : (k, 3, 3) float64
        phi_0 from an error at one instant alone (zero for estimators that take means).
    block : (k - 1, 3, 3) float64
        phi_0 from an error constant over one stretch (zero for TRIAD).
    """

    def __init__(self, point: Array, block: Array) -> None:
        self.point = point
        self.block = block

    def nodal(self) -> Array:
        """Return the weights (k, 3, 3) on the instants; a stretch gives half to each end."""
        w = self.point.copy()
        w[:-1] += 0.5 * self.block
        w[1:] += 0.5 * self.block
        return w

    def offset(self) -> Array:
        """Return phi_0 from an error that is constant over the whole record, (3, 3)."""
        return np.asarray(self.point.sum(axis=0) + self.block.sum(axis=0))


def _triad_weights(h: History, theory: Array, estimator: str) -> Array:
    """Differentiate TRIAD at the two vectors and carry the result to the instants."""
    point = np.zeros((len(h), 3, 3))
    r1, r2 = _pair(h, theory, estimator)

    def tilt(d1: Array, d2: Array) -> Array:
        r = triad(r2, r1, r2 + d2, r1 + d1)
        # R_est = I - [phi x] about the truth.
        return -0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])

    step = 1e-6 * float(min(np.linalg.norm(r1), np.linalg.norm(r2)))
    j1, j2 = np.empty((3, 3)), np.empty((3, 3))
    zero = np.zeros(3)
    for axis in range(3):
        d = np.zeros(3)
        d[axis] = step
        j1[:, axis] = (tilt(d, zero) - tilt(-d, zero)) / (2 * step)
        j2[:, axis] = (tilt(zero, d) - tilt(zero, -d)) / (2 * step)
    middle, last, width = _instants(h)
    if estimator == "integral-triad":
        for row, j in ((middle, j1), (last, j2)):
            point[row] += j
            point[0] -= j
    else:
        a = middle - width // 2
        for low, high, j in ((a, a + width, j1), (last - width, last, j2)):
            point[high] += j
            point[low] -= j
    return point


def weights(h: History, gravity: float, lat: float, estimator: str) -> Weights:
    """Return the weights of an estimator on the errors of v, in i0 (see the module).

    For least squares phi_0 = A^-1 sum of G x e with A = sum of (|G|^2 I - G G^T), G centred or
    not; for TRIAD the derivative is taken numerically.
    """
    theory = h.theory(gravity, lat)
    k = len(h)
    if estimator in ("integral-triad", "instants-triad"):
        return Weights(_triad_weights(h, theory, estimator), np.zeros((k - 1, 3, 3)))
    n = np.diff(h.updates)
    mean = gravity * gravity_direction(lat) * h.block_means(slice(12, 15))
    if estimator == "centred":
        mean = mean - (n @ mean) / n.sum()
    a = np.einsum("i,ij,ij->", n, mean, mean) * np.eye(3) - np.einsum("i,ij,ik->jk", n, mean, mean)
    block = np.linalg.solve(a, n[:, None, None] * skew(mean))
    return Weights(np.zeros((k, 3, 3)), block)
