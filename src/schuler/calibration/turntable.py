"""Calibration on a turntable: six positions, rate tests, 12, 18 or 24 positions.

Orientations are known (the table's), so every dwell gives three equations linear in bias and
matrix: least squares with covariance. Sources: Titterton and Weston (2004), section 8.3-8.4; IEEE
Std 1293 for the multi-position tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.calibration.apply import Calibration
from schuler.errors import InputError

__all__ = ["TableFit", "combine", "rate_test", "scheme", "static_test"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TableFit:
    """One triad's bias and matrix: true = matrix (output - bias).

    Parameters
    ----------
    bias : (3,) float64
        In the output's units.
    matrix : (3, 3) float64
    covariance : (12, 12) float64
        Of the output's model, output = bias + model true: bias, then `model` by rows.
    model : (3, 3) float64
        Inverse of `matrix`.
    residual_rms : float
        Of the outputs.
    """

    bias: Array
    matrix: Array
    covariance: Array
    model: Array
    residual_rms: float

    @property
    def bias_sigma(self) -> Array:
        """1 sigma of the bias (3,)."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def matrix_sigma(self) -> Array:
        """1 sigma of the matrix (3, 3), to first order: d(M^-1) = -M^-1 dM M^-1."""
        change = np.kron(self.matrix, self.matrix.T)
        cov = change @ self.covariance[3:, 3:] @ change.T
        return np.asarray(np.sqrt(np.diag(cov)).reshape(3, 3))


def scheme(positions: int) -> Array:
    """Return the up direction in body axes (n, 3) of a known scheme of 6, 12, 18 or 24 positions.

    Six: each axis up and down. 12: the edges, two axes at 45 deg. 18: both. 24: the six, each
    turned to four headings (for a gyro that sees the Earth; up repeats).

    Raises
    ------
    InputError
        For another number.

    Examples
    --------
    >>> scheme(6)[0].tolist()
    [1.0, 0.0, 0.0]
    """
    faces = np.array([s * np.eye(3)[k] for k in range(3) for s in (1, -1)])
    edges = np.array(
        [
            (s * np.eye(3)[i] + r * np.eye(3)[j]) / np.sqrt(2)
            for i, j in ((0, 1), (0, 2), (1, 2))
            for s in (1, -1)
            for r in (1, -1)
        ]
    )
    known = {6: faces, 12: edges, 18: np.vstack([faces, edges]), 24: np.repeat(faces, 4, axis=0)}
    if positions not in known:
        raise InputError(f"known schemes have 6, 12, 18 or 24 positions, got {positions}")
    return known[positions]


def static_test(outputs: ArrayLike, truth: ArrayLike, sigma: float | None = None) -> TableFit:
    """Fit a triad to mean outputs in known positions, six or more.

    Parameters
    ----------
    outputs : (m, 3) array_like
        Mean output of each position.
    truth : (m, 3) array_like
        True force (gravity times up) or Earth rate in body axes.
    sigma : float, optional
        1 sigma of an output; from the residuals where left out.

    Raises
    ------
    InputError
        For shapes that do not fit, values that are not numbers, or positions too few or too alike.

    Examples
    --------
    >>> up = scheme(12)
    >>> fit = static_test(9.8 * up * 1.001 + 0.02, 9.8 * up)
    >>> fit.bias.round(4).tolist()
    [0.02, 0.02, 0.02]
    """
    y, x = np.asarray(outputs, np.float64), np.asarray(truth, np.float64)
    if y.ndim != 2 or y.shape != x.shape or y.shape[1] != 3:
        raise InputError(
            f"expected outputs and truth of one shape (m, 3), got {y.shape}, {x.shape}"
        )
    if not (np.isfinite(y).all() and np.isfinite(x).all()):
        raise InputError("outputs and truth must be finite numbers")
    if len(y) < 5 and sigma is None:
        raise InputError(f"four numbers an axis need five positions or more, got {len(y)}")
    size = float(np.sqrt(np.mean(x**2))) or 1.0
    design = np.column_stack([np.ones(len(x)), x / size])
    inner = design.T @ design
    values, vectors = np.linalg.eigh(inner)
    if values[0] < 1e-9 * values[-1]:
        most = ("the bias", "axis x", "axis y", "axis z")[int(np.argmax(np.abs(vectors[:, 0])))]
        raise InputError(
            f"{most} is not observable in these positions: turn every axis up and down"
        )
    inverse = np.linalg.inv(inner)
    theta = inverse @ design.T @ y
    residual = y - design @ theta
    dof = 3 * (len(y) - 4)
    rms = float(np.sqrt(np.mean(residual**2)))
    variance = sigma**2 if sigma is not None else float(np.sum(residual**2)) / max(dof, 1)
    back = np.array([1.0, size, size, size])
    one = variance * inverse / np.outer(back, back)
    covariance = np.zeros((12, 12))
    for i in range(3):
        index = np.r_[i, 3 + 3 * i : 6 + 3 * i]
        covariance[np.ix_(index, index)] = one
    model = theta[1:].T / size
    return TableFit(theta[0], np.asarray(np.linalg.inv(model), np.float64), covariance, model, rms)


def rate_test(
    outputs: ArrayLike, rates: ArrayLike, axes: ArrayLike, earth: ArrayLike | None = None,
    sigma: float | None = None,
) -> TableFit:  # fmt: skip
    """Fit gyros to mean outputs at known table rates about known axes.

    Whole turns are meant, over which the Earth's rate across the axis averages out.

    Parameters
    ----------
    outputs : (m, 3) array_like
    rates : (m,) array_like
        rad/s.
    axes : (m, 3) array_like
        The table's axis in body axes.
    earth : (m,) array_like, optional
        The Earth's rate along the axis, rad/s.
    sigma : float, optional
        1 sigma of an output.

    Examples
    --------
    >>> axes, rates = np.repeat(np.eye(3), 2, axis=0), np.tile([0.1, -0.1], 3)
    >>> fit = rate_test(axes * rates[:, None] * 1.002 + 1e-5, rates, axes)
    >>> (1e6 * fit.bias).round(2).tolist()
    [10.0, 10.0, 10.0]
    """
    rate, axis = np.asarray(rates, np.float64), np.asarray(axes, np.float64)
    if axis.shape != (len(rate), 3):
        raise InputError(f"expected one axis (3) to each of {len(rate)} rates, got {axis.shape}")
    length = np.linalg.norm(axis, axis=1)
    if not (length > 0).all():
        raise InputError("a table's axis must not be zero")
    along = rate + (0.0 if earth is None else np.asarray(earth, np.float64))
    return static_test(outputs, along[:, None] * axis / length[:, None], sigma)


def combine(gyro: TableFit, accel: TableFit, name: str = "turntable") -> Calibration:
    """Return the calibration of both triads.

    Examples
    --------
    >>> up, axes = scheme(12), np.repeat(np.eye(3), 2, axis=0)
    >>> rates = np.tile([0.1, -0.1], 3)
    >>> accel = static_test(9.8 * up + 0.02, 9.8 * up)
    >>> gyro = rate_test(axes * rates[:, None] + 1e-5, rates, axes)
    >>> combine(gyro, accel).accel_bias.round(3).tolist()
    [0.02, 0.02, 0.02]
    """
    return Calibration(
        gyro.bias, accel.bias, gyro.matrix, accel.matrix, name=name,
        sigma={"gyro_bias": gyro.bias_sigma, "accel_bias": accel.bias_sigma,
               "gyro_matrix": gyro.matrix_sigma, "accel_matrix": accel.matrix_sigma},
    )  # fmt: skip
