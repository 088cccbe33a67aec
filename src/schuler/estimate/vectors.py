"""Attitude from pairs of vectors: TRIAD, Wahba's problem, and the centred form.

All work on running sums, so that a record of any length is a few numbers. The wanted rotation
R turns observed vectors v into reference vectors r: r = R v. The attitude error phi is defined
by R_est = (I - [phi x]) R, phi in the reference frame; covariances are of phi, rad^2.

Sources: Black (1964); Wahba (1965); Davenport's q-method after Keat (1977); Markley (1988) for
the SVD; Shuster and Oh (1981) for TRIAD's covariance; Kabsch (1976) for the centred form, which is
Wahba's problem with an unknown constant offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

__all__ = [
    "VectorSums",
    "davenport",
    "triad",
    "triad_covariance",
    "triad_jacobian",
    "wahba_covariance",
    "wahba_svd",
]

Array = NDArray[np.float64]


@dataclass
class VectorSums:
    """Sufficient statistics of pairs (reference r, observed v).

    Parameters
    ----------
    weight : float
        Sum of weights.
    r, v : (3,) float64
        Weighted sums.
    rv, rr : (3, 3) float64
        Weighted sums of r v^T and r r^T.

    Examples
    --------
    >>> sums = VectorSums.empty()
    >>> sums.add(np.eye(3), np.eye(3)[[1, 2, 0]])
    >>> sums.solve().round(9)[0].tolist()
    [0.0, 1.0, 0.0]
    """

    weight: float
    r: Array
    v: Array
    rv: Array
    rr: Array

    @classmethod
    def empty(cls) -> VectorSums:
        """Return sums of nothing."""
        return cls(0.0, np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)))

    def add(self, reference: ArrayLike, observed: ArrayLike, weight: ArrayLike = 1.0) -> None:
        """Add pairs: (n, 3) or (3,) arrays with weights (n,) or one for all."""
        r = np.atleast_2d(np.asarray(reference, np.float64))
        v = np.atleast_2d(np.asarray(observed, np.float64))
        if r.shape != v.shape or r.shape[1] != 3:
            raise InputError(f"expected two arrays of shape (n, 3), got {r.shape} and {v.shape}")
        w = np.broadcast_to(np.asarray(weight, np.float64), (len(r),))
        self.weight += float(w.sum())
        self.r = self.r + w @ r
        self.v = self.v + w @ v
        self.rv = self.rv + (r * w[:, None]).T @ v
        self.rr = self.rr + (r * w[:, None]).T @ r

    def centred(self) -> VectorSums:
        """Return the sums with both series centred: a constant offset drops out."""
        if self.weight <= 0:
            raise InputError("no vector pairs to centre")
        rbar, vbar = self.r / self.weight, self.v / self.weight
        return VectorSums(
            self.weight,
            np.zeros(3),
            np.zeros(3),
            self.rv - self.weight * np.outer(rbar, vbar),
            self.rr - self.weight * np.outer(rbar, rbar),
        )

    def solve(self) -> Array:
        """Return the rotation matrix (3, 3) that maps observed to reference vectors."""
        return wahba_svd(self.rv)

    def covariance(self, variance: float) -> Array:
        """Return the covariance of phi for white noise of a variance per axis and unit weight."""
        return wahba_covariance(self.rr, variance)


def _unit(v: ArrayLike, name: str) -> Array:
    a = np.asarray(v, np.float64)
    norm = float(np.linalg.norm(a))
    if not (np.isfinite(norm) and norm > 0):
        raise InputError(f"vector {name} is zero or not finite: no direction")
    return a / norm


def _frame(first: Array, second: Array) -> Array:
    x = _unit(first, "one")
    cross = np.cross(x, _unit(second, "two"))
    size = float(np.linalg.norm(cross))
    if size < 1e-12:
        raise InputError("the two vectors are parallel: they do not fix an attitude")
    z = cross / size
    return np.column_stack([x, z, np.cross(x, z)])


def triad(r1: ArrayLike, r2: ArrayLike, v1: ArrayLike, v2: ArrayLike) -> Array:
    """Return the rotation of observed vectors v1, v2 into references r1, r2.

    The first pair is fitted exactly (up to length), the second in its half plane: the Gram-Schmidt
    process starts from the first. Give the better known pair first.

    Raises
    ------
    InputError
        If a vector is zero or the two are parallel.

    Examples
    --------
    >>> up, north = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    >>> triad(up, north, up, [-1.0, 0.0, 0.0]).round(3)[0].tolist()
    [0.0, 1.0, 0.0]
    """
    reference = _frame(np.asarray(r1, np.float64), np.asarray(r2, np.float64))
    observed = _frame(np.asarray(v1, np.float64), np.asarray(v2, np.float64))
    return reference @ observed.T


def triad_jacobian(r1: ArrayLike, r2: ArrayLike) -> tuple[Array, Array]:
    """Return how phi of `triad` responds to errors of the two observed vectors, (3, 3) each.

    The errors are those of R v, in the reference frame and in the vectors' unit; phi is linear in
    them as long as they are small.

    Raises
    ------
    InputError
        If a vector is zero or the two are parallel.

    Examples
    --------
    >>> first, second = triad_jacobian([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    >>> first.shape
    (3, 3)
    """
    a, b = _unit(r1, "one"), _unit(r2, "two")
    m = np.cross(a, b)
    s = float(np.linalg.norm(m))
    if s < 1e-12:
        raise InputError("the two vectors are parallel: they do not fix an attitude")
    n = m / s
    p = np.cross(n, a)
    # The tilts about n and p come from the first pair alone, the turn about a from both planes.
    j1 = np.outer(n, p) - np.outer(p, n) - np.outer(a, n) * (float(a @ b) / s)
    j2 = np.outer(a, n) / s
    return j1 / float(np.linalg.norm(r1)), j2 / float(np.linalg.norm(r2))


def triad_covariance(r1: ArrayLike, r2: ArrayLike, variance1: float, variance2: float) -> Array:
    """Return the covariance of phi (3, 3) of `triad`, for noise per axis of the unit vectors.

    Parameters
    ----------
    r1, r2 : (3,) array_like
        Reference directions.
    variance1, variance2 : float
        Variance of each unit vector's error across its direction, rad^2.

    Examples
    --------
    >>> p = triad_covariance([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 1e-8, 1e-6)
    >>> round(float(p[2, 2] ** 0.5), 6)
    0.001
    """
    j1, j2 = triad_jacobian(_unit(r1, "one"), _unit(r2, "two"))
    return variance1 * (j1 @ j1.T) + variance2 * (j2 @ j2.T)


def wahba_svd(b: ArrayLike) -> Array:
    """Return the rotation that maximises tr(R^T B) for B = sum of r v^T (Markley, 1988).

    Raises
    ------
    InputError
        If B is not finite or does not fix the attitude (rank below two).

    Examples
    --------
    >>> wahba_svd(np.diag([3.0, 2.0, 1.0])).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    m = np.asarray(b, np.float64)
    if not np.all(np.isfinite(m)):
        raise InputError("the vector sums are not finite")
    u, s, vt = np.linalg.svd(m)
    if s[1] <= 1e-14 * max(s[0], 1e-300):
        raise InputError("the vectors all lie on one line: they do not fix an attitude")
    d = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((u * np.array([1.0, 1.0, d])) @ vt)


def davenport(b: ArrayLike) -> Array:
    """Return the optimal quaternion (w, x, y, z), w >= 0, by Davenport's q-method.

    The same answer as `wahba_svd`, through the largest eigenvector of the 4x4 K matrix.

    Examples
    --------
    >>> davenport(np.diag([3.0, 2.0, 1.0])).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    m = np.asarray(b, np.float64)
    if not np.all(np.isfinite(m)):
        raise InputError("the vector sums are not finite")
    z = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    k = np.empty((4, 4))
    k[0, 0] = np.trace(m)
    k[0, 1:] = z
    k[1:, 0] = z
    k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
    values, vectors = np.linalg.eigh(k)
    if values[3] - values[2] <= 1e-14 * max(abs(values[3]), 1e-300):
        raise InputError("the vectors all lie on one line: they do not fix an attitude")
    q = vectors[:, 3]
    return np.asarray(q if q[0] >= 0 else -q)


def wahba_covariance(rr: ArrayLike, variance: float) -> Array:
    """Return the covariance of phi for white noise of a variance per axis on each vector.

    The information is A = tr(S) I - S with S = sum of r r^T: phi = A^-1 sum of r x e.

    Raises
    ------
    InputError
        If S is not finite or the references all lie on one line.

    Examples
    --------
    >>> wahba_covariance(np.diag([1.0, 1.0, 1.0]), 1e-6).round(9).tolist()[0]
    [5e-07, 0.0, 0.0]
    """
    s = np.asarray(rr, np.float64)
    if not np.all(np.isfinite(s)):
        raise InputError("the vector sums are not finite")
    a = np.trace(s) * np.eye(3) - s
    weakest, _, strongest = np.linalg.eigvalsh(a)
    if weakest <= 1e-14 * max(strongest, 1e-300):
        raise InputError("the vectors all lie on one line: they do not fix an attitude")
    return np.asarray(variance * np.linalg.inv(a))
