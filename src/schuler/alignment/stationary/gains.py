"""From two series with their noise to the normal equations and gains of the optimal estimate.

Generalised least squares with the specified biases as the prior, and the best linear prediction of
what the gyros' noise has made of the attitude at the end.

A base that settles turns steadily, and looks to the attitude series like an error of heading. About
east and north gravity shows such a turn. How large it is there says how large it may be about up,
where nothing shows it.

Source: Aitken (1935); Goldberger (1962) for the prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import Rows
from schuler.alignment.stationary.series import Series
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.sensors import ImuSpec

__all__ = ["NormalEquations", "Weighed", "bias_priors", "gains", "weigh"]

Array = NDArray[np.float64]

_FREE_GYRO, _FREE_ACCEL = 1e-6 * DEG_PER_HOUR, 1e-3 * MICRO_G
"""Biases (1 sigma) of an instrument that is not known to have any."""


@dataclass(frozen=True, eq=False)
class Group:
    """One of three independent groups of rows: what turns about one axis, and moves across it.

    Parameters
    ----------
    turn, move : int
        Axis of the attitude (0 to 2) and of the velocity (0, 1).
    attitude_rows, velocity_rows : (k,) int64
    jacobian : (a, n) float64
        Attitude rows first.
    weighted : (n, a) float64
        J^T N^-1.
    prediction : (a,) float64
        N^-1 times the covariance with the turn that the gyros' noise has made at the end.
    """

    turn: int
    move: int
    attitude_rows: Rows
    velocity_rows: Rows
    jacobian: Array
    weighted: Array
    prediction: Array


@dataclass(frozen=True, eq=False)
class Weighed:
    """Both series, weighted by their noise.

    Parameters
    ----------
    groups : tuple of Group
    information : (n, n) float64
        Of all unknowns, without priors.
    """

    groups: tuple[Group, ...]
    information: Array

    def normal(self, turns: Array, e: Array, removed: Array | None = None) -> NormalEquations:
        """Return the normal equations for turns (m, 3) and velocities (m, 2).

        `removed` (3,) is the gyro bias that was taken off.
        """
        right = np.zeros(len(self.information))
        for each in self.groups:
            rows = np.concatenate(
                [turns[each.attitude_rows, each.turn], e[each.velocity_rows, each.move]]
            )
            right += each.weighted @ rows
        if removed is not None:
            right += self.information[:, NormalEquations.GYRO] @ removed
        return NormalEquations(self.information, right)


def _of_rows(matrix: Array, rows: Rows) -> Array:
    """Return some rows and columns of a matrix; a view where they follow each other."""
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        which = slice(int(rows[0]), int(rows[-1]) + 1)
        return matrix[which, which]
    return matrix[np.ix_(rows, rows)]


def weigh(series: Series) -> Weighed:
    """Return the rows of both series in three independent groups, weighted by their noise."""
    m, n = series.design.shape[1:]
    information = np.zeros((n, n))
    groups: list[Group] = []
    none = np.zeros(0, np.int64)
    # A turn about east takes the force north and a turn about north takes it west; a turn about
    # up takes it nowhere. So the series fall into three independent groups.
    for turn, move, sign in ((0, 4, -1.0), (1, 3, 1.0), (2, 3, 0.0)):
        rows_a, rows_v = series.attitude_rows, series.velocity_rows if sign else none
        chosen = np.concatenate([rows_a, m + rows_v])
        if not len(chosen):
            continue
        flip = np.repeat([1.0, sign], m)[chosen]
        noise = _of_rows(series.gyro, chosen) * np.outer(flip, flip)
        k = len(rows_a)
        noise[:k, :k] += _of_rows(series.sway[turn], rows_a)
        noise[k:, k:] += _of_rows(series.force, rows_v)
        # A noise that is said to be nothing must not leave the inverse without digits.
        diagonal = noise.reshape(-1)[:: len(chosen) + 1]
        diagonal *= 1.0 + 1e-9
        diagonal += 1e-24
        jacobian = np.concatenate([series.design[turn][rows_a], series.design[move][rows_v]])
        end_turn = flip * series.gyro_end[chosen]
        solved = np.linalg.solve(noise, np.column_stack([jacobian, end_turn])).T
        information += solved[:-1] @ jacobian
        groups.append(Group(turn, move - 3, rows_a, rows_v, jacobian, solved[:-1], solved[-1]))
    return Weighed(tuple(groups), information)


def bias_priors(spec: ImuSpec | None) -> tuple[float, float]:
    """Return the 1-sigma of a gyro's and an accelerometer's bias, rad/s and m/s^2."""
    if spec is None:
        return _FREE_GYRO, _FREE_ACCEL
    return max(spec.gyro.bias, _FREE_GYRO), max(spec.accelerometer.bias, _FREE_ACCEL)


def gains(
    series: Series, weighed: Weighed, spec: ImuSpec | None, base_rate: float, propagated: Array,
    local: Array, free_latitude: bool,
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:  # fmt: skip
    """Return what a unit of attitude (m, k, 3) and of velocity (m, k, 2) makes of the unknowns.

    Then the same of phi at the end, which the gyros' biases and noise have propagated (best linear
    prediction: what the residuals say of the noise up to the end is part of it); the covariance
    (k, k) of phi_0 and the biases, and of the latitude where it is free; and how all of these, and
    phi at the end, answer to the mean (3,) of the gyro biases' prior, and to a turn of the base.

    Parameters
    ----------
    series : Series
    weighed : Weighed
    spec : ImuSpec or None
    base_rate : float
        1-sigma of a steady turn of the base about each axis, rad/s.
    propagated : (3, 3) float64
        Turn in i0 at the end for a unit of gyro bias, s.
    local : (3, 3) float64
        C_i0^n in the middle.
    free_latitude : bool
    """
    m, n = series.design.shape[1:]
    information = weighed.information
    prior = np.zeros(n)
    prior[NormalEquations.BIASES] = np.repeat(1.0 / np.square(bias_priors(spec)), 3)
    prior[NormalEquations.BASE_RATE] = 1.0 / max(base_rate, _FREE_GYRO) ** 2
    end = np.zeros((3, n))
    end[:, NormalEquations.PHI] = np.eye(3)
    end[:, NormalEquations.GYRO] = -propagated
    for each in weighed.groups:
        end += np.outer(local[each.turn], each.prediction @ each.jacobian)
    latitude = n + NormalEquations.LATITUDE
    used = np.array([k for k in range(n) if free_latitude or k != latitude])
    posterior = (information + np.diag(prior))[np.ix_(used, used)]
    seen = np.diag(posterior) > 0
    scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, np.diag(posterior), 1.0)), 0.0)
    scaled = posterior * np.outer(scale, scale) + np.diag(1.0 - seen)
    inverse = np.linalg.inv(scaled) * np.outer(scale, scale)
    pick = np.array([*range(9), latitude] if free_latitude else range(9))
    gain_a, gain_v = np.zeros((m, len(pick), 3)), np.zeros((m, len(pick), 2))
    end_a, end_v = np.zeros((m, 3, 3)), np.zeros((m, 3, 2))
    both = np.vstack([inverse[pick], end[:, used] @ inverse])
    by_base = np.zeros((len(both), 3))
    for each in weighed.groups:
        gain = (both @ each.weighted[used]).T
        gain[:, len(pick) :] -= np.outer(each.prediction, local[each.turn])
        by_base += gain.T @ each.jacobian[:, NormalEquations.BASE_RATE]
        here, there = np.split(gain, [len(each.attitude_rows)])
        at = each.attitude_rows, slice(None), each.turn
        gain_a[at], end_a[at] = np.split(here, [len(pick)], axis=1)
        at = each.velocity_rows, slice(None), each.move
        gain_v[at], end_v[at] = np.split(there, [len(pick)], axis=1)
    by_prior = both[:, NormalEquations.GYRO] * prior[NormalEquations.GYRO]
    return gain_a, gain_v, end_a, end_v, inverse[np.ix_(pick, pick)], by_prior, by_base


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

    PHI = slice(0, 3)
    GYRO = slice(3, 6)
    ACCEL = slice(6, 9)
    BIASES = slice(3, 9)
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

    def priors(
        self, gyro: float, accel: float, base_rate: tuple[float, float, float],
        latitude_known: bool = True,
    ) -> Array:  # fmt: skip
        """Return 1-sigma priors (n,) for `solve` and `marginal`: phi and velocity have none.

        Parameters
        ----------
        gyro, accel : float
            Of the biases, rad/s and m/s^2.
        base_rate : (float, float, float)
            Of a steady turn of the base about east, north and up, rad/s.
        latitude_known : bool
            Whether the site's is right; if not, it has no prior either.
        """
        out = np.full(len(self.right), np.inf)
        out[self.GYRO], out[self.ACCEL] = gyro, accel
        out[self.LATITUDE] = 0.0 if latitude_known else np.inf
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
