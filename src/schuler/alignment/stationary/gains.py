"""From two series with their noise to the gains of the optimal estimate.

Generalised least squares with the specified biases as the prior, and the best linear prediction of
what the gyros' noise has made of the attitude at the end.

Source: Aitken (1935); Goldberger (1962) for the prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import Rows
from schuler.alignment.stationary.normal_equations import NormalEquations
from schuler.alignment.stationary.series import Series
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.sensors import ImuSpec

__all__ = ["Weighed", "bias_priors", "gains", "weigh"]

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
    prior[3:9] = np.repeat(1.0 / np.square(bias_priors(spec)), 3)
    prior[NormalEquations.BASE_RATE] = 1.0 / max(base_rate, _FREE_GYRO) ** 2
    end = np.zeros((3, n))
    end[:, :3], end[:, 3:6] = np.eye(3), -propagated
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
    by_prior = both[:, 3:6] * prior[3:6]
    return gain_a, gain_v, end_a, end_v, inverse[np.ix_(pick, pick)], by_prior, by_base
