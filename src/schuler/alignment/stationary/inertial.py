"""The frozen-inertial-frame estimators, and how each responds to errors in the velocity integral.

C_b^n(t) = C_i0^n(t) C_ib0^i0 C_b^ib0(t). The first is known from latitude and elapsed time, the
last comes from the gyros, and the middle one is constant: it turns v(t), the integral of the
force in ib0, into G(t), the theoretical integral in i0.

Its error phi_0 is linear in the errors e_k of v (in i0) at the instants of the history:
phi_0 = sum of W_k e_k. All of the uncertainty follows from these weights.

Sources: the inertial-frame method after Qin, Yan, Gu and Zheng (2005); the centred form is
Kabsch (1976) applied to velocity integrals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, Rows, gravity_direction, inertial_to_local
from schuler.alignment.stationary.integral_methods import FIELD, field_gain, field_solve
from schuler.attitude import skew
from schuler.earth import Site
from schuler.errors import InputError
from schuler.estimate.vectors import triad, triad_jacobian, wahba_svd
from schuler.kernels.states import TrackerNode

__all__ = ["MINIMUM_ROWS", "Residual", "Weights", "instants", "residual", "solve", "weights"]

Array = NDArray[np.float64]

BLOCKS = 256
"""Stretches into which a history is thinned for the responses."""

MINIMUM_ROWS = 11
"""Instants without which the record cannot show its own disturbance: with fewer, no mode of the
residual is free of the fit (see `disturbance`), and sigma would be nothing at all."""

STRETCHES = 256
"""Stretches over which the estimators of `integral_methods` take their means."""

FORCE_SPAN = 0.1
"""The force at an instant is the mean over at least so long (s)."""


def instants(h: History, estimator: str) -> list[int]:
    """Return the instants that an estimator differences: two spans (begin, end, begin, end)."""
    last = len(h) - 1
    middle = int(np.argmin(np.abs(h.t - 0.5 * h.duration)))
    if estimator == "integral-triad":
        return [0, middle, 0, last]
    if estimator == "instants-triad":
        spacing = h.duration / last
        width = min(max(int(np.ceil(FORCE_SPAN / spacing - 1e-6)), 1), max(last // 4, 1))
        begin = middle - width // 2
        return [begin, begin + width, last - width, last]
    return []


def _pair(series: Array, rows: list[int]) -> tuple[Array, Array]:
    """Return the two vectors of a TRIAD estimator out of a series at the instants."""
    a, b, c, d = rows
    return series[b] - series[a], series[d] - series[c]


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
        rows = instants(h, estimator)
        r1, r2 = _pair(h.theory(gravity, lat), rows)
        v1, v2 = _pair(h.velocity, rows)
        # The later vector carries the more signal: it is fitted exactly.
        return triad(r2, r1, v2, v1)
    if estimator in FIELD:
        return field_solve(h.thin(STRETCHES)[0], gravity, lat, estimator)
    n, sv, sb, sbv = h.sums()
    if estimator == "centred":
        sbv = sbv - np.outer(sb, sv) / n
    return wahba_svd(gravity * gravity_direction(lat)[:, None] * sbv)


@dataclass(frozen=True, eq=False)
class Weights:
    """How phi_0 responds to velocity errors: at single instants and over stretches.

    Parameters
    ----------
    rows : (j,) int64
        Instants of the whole history that enter alone (TRIAD, and the start).
    point : (j, 3, 3) float64
        phi_0 from an error at each of them.
    position : (j,) int64
        Where they are in the thinned history.
    block : (m, 3, 3) float64
        phi_0 from an error constant over one stretch of the thinned history.
    """

    rows: Rows
    point: Array
    position: Rows
    block: Array

    def nodal(self) -> Array:
        """Return weights (m + 1, 3, 3) on the thinned instants; a stretch gives half to each."""
        w = np.zeros((len(self.block) + 1, 3, 3))
        np.add.at(w, self.position, self.point)
        w[:-1] += 0.5 * self.block
        w[1:] += 0.5 * self.block
        return w

    def rotated(self, c: Array) -> Weights:
        """Return the weights with phi turned into another frame by the matrix c."""
        return replace(self, point=c @ self.point, block=c @ self.block)


def _triad_weights(theory: Array, rows: list[int]) -> Array:
    """Return the weights (4, 3, 3) of the instants."""
    r1, r2 = _pair(theory, rows)
    late, early = triad_jacobian(r2, r1)
    return np.stack([-early, early, -late, late])


def weights(
    h: History, gravity: float, lat: float, estimator: str, blocks: int
) -> tuple[Weights, History]:
    """Return the weights of an estimator on the errors of v, in i0, and the thinned history.

    For least squares phi_0 = A^-1 sum of G x e with A = sum of (|G|^2 I - G G^T), G centred or
    not; for TRIAD see `triad_jacobian`.
    """
    rows = instants(h, estimator)
    if rows:
        thin, position = h.thin(blocks, rows)
        point = _triad_weights(h.theory(gravity, lat), rows)
        block = np.zeros((len(thin) - 1, 3, 3))
        return Weights(np.array(rows, np.int64), point, position, block), thin
    if estimator in FIELD:
        thin, position = h.thin(STRETCHES, [0])
        block = field_gain(thin, gravity, lat, estimator)
        return Weights(np.zeros(1, np.int64), np.zeros((1, 3, 3)), position, block), thin
    thin, position = h.thin(blocks, [0])
    n = np.diff(thin.updates)
    d = gravity * gravity_direction(lat)
    mean = d * thin.block_means(TrackerNode.sum_gravity)
    if estimator == "centred":
        mean = mean - (n @ mean) / n.sum()
    s = thin.second_moments(estimator == "centred") * np.outer(d, d)
    a = np.trace(s) * np.eye(3) - s
    block = np.linalg.solve(a, n[:, None, None] * skew(mean))
    return Weights(np.zeros(1, np.int64), np.zeros((1, 3, 3)), position, block), thin


@dataclass(frozen=True, eq=False)
class Residual:
    """What the best attitude leaves of the velocity, in ENU.

    Parameters
    ----------
    t : (m,) float64
        Middle of each stretch, s since the start.
    dt : (m,) float64
        Length of each stretch, s.
    mean : (m, 3) float64
        Mean residual velocity over each stretch, m/s, without its mean over the record.
    instants : (k, 3) float64
        Residual velocity at every instant of the history, m/s, in i0.
    interval : float
        Sampling interval, s.
    """

    t: Array
    dt: Array
    mean: Array
    instants: Array
    interval: float

    @property
    def rms(self) -> Array:
        """Root mean square of the residual velocity, east, north, up, m/s, (3,)."""
        return np.asarray(np.sqrt(np.mean(self.mean**2, axis=0)))


def residual(h: History, site: Site, blocks: int = BLOCKS) -> Residual:
    """Return the residual velocity of the centred fit over a history.

    Examples
    --------
    >>> from schuler.alignment import residual
    >>> residual(sc.align(record, site, spec=spec).history, site).rms.shape
    (3,)
    """
    g, lat = site.gravity, site.latitude
    r = solve(h, g, lat, "centred")
    thin, _ = h.thin(blocks)
    mean = thin.block_means(TrackerNode.sum_v) @ r.T
    mean -= g * gravity_direction(lat) * thin.block_means(TrackerNode.sum_gravity)
    weight = np.diff(thin.updates)
    offset = weight @ mean / weight.sum()
    t = 0.5 * (thin.t[1:] + thin.t[:-1])
    local = np.einsum("iab,ib->ia", inertial_to_local(t, lat), mean - offset)
    instants = h.velocity @ r.T - h.theory(g, lat) - offset
    return Residual(t, np.diff(thin.t), local, instants, h.duration / max(h.samples, 1))
