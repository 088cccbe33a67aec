"""Fisher information of linear measurements with correlated noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError

__all__ = ["covariance_of", "gls_information"]

Array = NDArray[np.float64]


def gls_information(h: Array, noise: Array) -> Array:
    """Return the information (n, n) of series of vector measurements.

    Measurement k is y_k = H_k x + e_k. Each component of e has the covariance `noise` over k,
    and the components are independent of one another, so the information is the sum over k and l
    of (noise^-1)_kl H_k^T H_l.

    Parameters
    ----------
    h : (m, a, n) float64
        Jacobians.
    noise : (m, m) float64
        Covariance of one component over the series.

    Raises
    ------
    InputError
        If the noise is not positive definite.

    Examples
    --------
    >>> h = np.ones((4, 1, 1))
    >>> gls_information(h, np.eye(4)).tolist()
    [[4.0]]
    """
    try:
        factor = np.linalg.cholesky(noise)
    except np.linalg.LinAlgError:
        raise InputError(
            "the measurements have no noise, or one that repeats itself: their information has "
            "no bound"
        ) from None
    m, a, n = h.shape
    white = np.linalg.solve(factor, h.reshape(m, a * n)).reshape(m * a, n)
    return np.asarray(white.T @ white)


def covariance_of(information: Array, names: tuple[str, ...]) -> Array:
    """Return the inverse of an information matrix (n, n).

    Parameters
    ----------
    information : (n, n) float64
    names : tuple of str
        What the unknowns are, for the error text.

    Raises
    ------
    InputError
        If a combination of unknowns is not observable, naming the one most in it.

    Examples
    --------
    >>> covariance_of(np.diag([4.0, 25.0]), ("bias", "drift")).tolist()
    [[0.25, 0.0], [0.0, 0.04]]
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    if values[0] <= 1e-13 * values[-1]:
        worst = names[int(np.argmax(np.abs(vectors[:, 0])))]
        raise InputError(f"not observable in these measurements: {worst}")
    inverse = (vectors / values) @ vectors.T
    return np.asarray(inverse / np.outer(scale, scale))
