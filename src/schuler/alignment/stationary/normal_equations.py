"""Normal equations of the optimal estimate, without priors, and what they say of a base that turns.

A base that settles turns steadily, and looks to the attitude series like an error of heading. About
east and north gravity shows such a turn. How large it is there says how large it may be about up,
where nothing shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG_PER_HOUR

__all__ = ["NormalEquations"]

Array = NDArray[np.float64]

_LARGEST_BASE_RATE = 1.0 * DEG_PER_HOUR
"""More than so much (1-sigma) no stationary vehicle turns steadily over minutes."""

_STILL = 0.9
"""Probability that a base does not turn, before the record is seen."""

_SIZES = np.concatenate([[0.0], np.geomspace(0.5, 1000.0, 40)])
"""Rates of the base that are tried, over the noise of what is seen of them."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of attitude and velocity for all unknowns, without priors.

    Parameters
    ----------
    information : (n, n) float64
        J^T N^-1 J.
    right : (n,) float64
        J^T N^-1 y.

    The unknowns are phi_0 (3), gyro bias (3, rad/s), accelerometer bias (3, m/s^2), velocity east
    and north (2), the attitude of each dwell (3 each), the latitude (1, rad) and a steady turn of
    the base about east, north and up (3, rad/s), which only the attitude shows.
    """

    information: Array
    right: Array

    GYRO = slice(3, 6)
    ACCEL = slice(6, 9)
    LATITUDE = -4
    BASE_RATE = slice(-3, None)

    def solve(self, prior_sigma: Array) -> tuple[Array, Array]:
        """Return estimate (n,) and covariance (n, n) for 1-sigma priors about zero.

        Parameters
        ----------
        prior_sigma : (n,) float64
            Infinite for an unknown without a prior, zero for one that is known to be zero.
        """
        free = prior_sigma > 0
        weight = np.where(np.isinf(prior_sigma), 0.0, 1.0 / np.where(free, prior_sigma, 1.0) ** 2)
        a = (self.information + np.diag(weight))[free][:, free]
        seen = np.diag(a) > 0
        scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, np.diag(a), 1.0)), 0.0)
        inverse = np.linalg.pinv(a * np.outer(scale, scale), rcond=1e-13, hermitian=True)
        part = inverse * np.outer(scale, scale)
        covariance = np.zeros_like(self.information)
        covariance[np.ix_(free, free)] = part
        value = np.zeros(len(self.right))
        value[free] = part @ self.right[free]
        return value, covariance

    def marginal(self, columns: slice, prior_sigma: Array) -> tuple[Array, Array]:
        """Return information (k, k) and right side (k,) of some unknowns, all else eliminated.

        Parameters
        ----------
        columns : slice
            `GYRO` or `ACCEL`.
        prior_sigma : (n,) float64
            As in `solve`; those of the unknowns themselves are not used.
        """
        free = prior_sigma > 0
        free[columns] = False
        # No unknown is quite free: a weak prior keeps the digits of the elimination.
        weak = np.full(len(prior_sigma), 1.0)
        weak[9:11], weak[self.BASE_RATE] = 100.0, 1e-3
        sigma = np.minimum(np.where(free, prior_sigma, 1.0), weak)
        rest = (self.information + np.diag(1.0 / sigma**2))[free][:, free]
        scale = 1.0 / np.sqrt(np.diag(rest))
        across = self.information[free, columns] * scale[:, None]
        both = np.column_stack([across, scale * self.right[free]])
        solved = np.linalg.solve(rest * np.outer(scale, scale), both)
        information = self.information[columns, columns] - across.T @ solved[:, :-1]
        right = self.right[columns] - across.T @ solved[:, -1]
        return 0.5 * (information + information.T), right

    def priors(self, gyro: float, accel: float, base_rate: tuple[float, float, float]) -> Array:
        """Return 1-sigma priors (n,) for `solve` and `marginal`: phi and velocity have none.

        Parameters
        ----------
        gyro, accel : float
            Of the biases, rad/s and m/s^2.
        base_rate : (float, float, float)
            Of a steady turn of the base about east, north and up, rad/s.
        """
        out = np.full(len(self.right), np.inf)
        out[self.GYRO], out[self.ACCEL] = gyro, accel
        out[self.LATITUDE] = 0.0
        out[self.BASE_RATE] = base_rate
        return out

    def base_rate(self, gyro: float, accel: float) -> tuple[float, float]:
        """Return the base's likely rate (1-sigma, rad/s) and the probability that it does not turn.

        The prior says with `_STILL` that the base does not turn at all; the rest is spread over
        sizes. Three axes turn alike, of which two are seen: the size of the third is known by a
        factor of a few only.

        Parameters
        ----------
        gyro, accel : float
            1-sigma of the biases, rad/s and m/s^2.
        """
        found, covariance = self.solve(self.priors(gyro, accel, (np.inf, np.inf, 0.0)))
        tilt, noise = found[-3:-1], covariance[-3:-1, -3:-1]
        if not np.all(np.diag(noise) > 0):
            return 0.0, 1.0
        unit = float(np.sqrt(np.diag(noise).mean()))
        sizes = _SIZES * unit
        # Determinant and inverse of noise + size^2 I, written out.
        a, d, b = noise[0, 0] + sizes**2, noise[1, 1] + sizes**2, noise[0, 1]
        size_of = a * d - b * b
        square = (d * tilt[0] ** 2 - 2.0 * b * tilt[0] * tilt[1] + a * tilt[1] ** 2) / size_of
        log = -0.5 * (np.log(size_of) + square)
        weight = np.exp(log - log.max())
        weight[1:] *= (1.0 - _STILL) / (_STILL * (len(sizes) - 1))
        weight /= weight.sum()
        size = float(np.sqrt(np.minimum(sizes, _LARGEST_BASE_RATE) ** 2 @ weight))
        return size, float(weight[0])
