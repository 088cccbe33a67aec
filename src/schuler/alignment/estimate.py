"""From a history to an attitude with its covariance by source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.bound import Position
from schuler.alignment.choose import choose
from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.methods import Analytic, Auto, Fine, Gyrocompass, Inertial
from schuler.alignment.stationary.analytic import analytic_attitude
from schuler.alignment.stationary.disturbance import (
    analytic_disturbance,
    disturbance_levels,
    inertial_disturbance,
    noise_ratio,
    residual,
)
from schuler.alignment.stationary.inertial import MINIMUM_ROWS, solve
from schuler.alignment.stationary.kalman import FinePass
from schuler.alignment.stationary.optimal import Joint, Linearisation, joint
from schuler.alignment.stationary.uncertainty import (
    analytic_responses,
    inertial_responses,
    instrument_budget,
    weighted_responses,
)
from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import ImuSpec

__all__ = ["QUIET", "Estimate", "estimate"]

Array = NDArray[np.float64]

QUIET = 0.4
"""Noise power, relative to the specification, that chance makes less than once in a thousand."""

_QUIETEST = 0.01
"""Least part of the specified noise power that is believed: a record without noise is no record."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """An attitude with its covariance, before it becomes an `Alignment`.

    Parameters
    ----------
    method : Inertial, Analytic, Fine or Gyrocompass
        What made it.
    attitude : (3, 3) float64
        C_b^n.
    budget : dict of str to (3, 3) float64
        Covariance of phi by source, rad^2.
    orthonormality : float or None
        Error of the analytic method, rad.
    noise_ratio : float or None
        How the residual's power compares with the specification's white noise.
    spec : ImuSpec or None
        What was used: a record that is surely quieter than its instrument is said to be has its
        white noise scaled down.
    biases, bias_covariance : (6,), (6, 6) float64 or None
        Where they were estimated.
    why : str
        Why the method was chosen, where it was.
    passed : FinePass or None
        What a filter said on its way.
    positions : tuple of Position
        The dwells, where there are several.
    best : Joint or None
        The optimal estimate, where it was made on the way.
    """

    method: Inertial | Analytic | Fine | Gyrocompass
    attitude: Array
    budget: dict[str, Array]
    orthonormality: float | None
    noise_ratio: float | None
    spec: ImuSpec | None
    biases: Array | None = None
    bias_covariance: Array | None = None
    why: str = ""
    passed: FinePass | None = None
    positions: tuple[Position, ...] = ()
    best: Joint | None = None

    @property
    def covariance(self) -> Array:
        """Sum of the budget, rad^2, (3, 3)."""
        return np.asarray(sum(self.budget.values(), np.zeros((3, 3))))


def estimate(
    h: History, site: Site, method: Inertial | Analytic | Auto, spec: ImuSpec | None, at_end: bool,
    about: Linearisation | None = None,
) -> Estimate:  # fmt: skip
    """Return the attitude of a history and its covariance by source.

    `about` is as of `joint`.
    """
    if len(h) < MINIMUM_ROWS:
        raise InputError(
            f"the span from t = {h.start:.9g} s has only {h.samples} sample(s) "
            f"({h.duration:.3g} s), too few to align: take a longer one"
        )
    orthonormality = None
    ratio = None
    why = ""
    biases = bias_covariance = None
    positions: tuple[Position, ...] = ()
    best = None
    if not isinstance(method, Analytic):
        left = residual(h, site)
        if spec:
            ratio = noise_ratio(left, site.gravity, spec)
            if ratio is not None and ratio < QUIET:
                spec = spec.with_white_noise(np.sqrt(max(ratio, _QUIETEST)))
    if isinstance(method, Auto):
        best = joint(h, site, spec, about=about)
        method, why = choose(best, spec, method.subsamples)
    if isinstance(method, Inertial):
        sway = np.zeros((3, 3))
        if method.estimator == "optimal":
            best = best or joint(h, site, spec, about=about)
            answer = best.end if at_end else best.start
            r, sway, levels = best.rotation, answer.sway, best.levels
            if at_end:
                r = np.asarray(quat_to_matrix(rotvec_to_quat(-best.end_turn)) @ r)
            if spec is not None and len(best.dwells) != 1:
                # One dwell shows no bias apart from the attitude.
                biases, bias_covariance = best.biases, best.covariance[3:, 3:]
            if len(best.dwells) > 1:
                positions = tuple(best.positions(site))
            responses = weighted_responses(
                best.history, answer.weights, answer.angle, best.attitude, site.gravity,
                site.latitude, at_end,
            )  # fmt: skip
        else:
            r = solve(h, site.gravity, site.latitude, method.estimator)
            levels = disturbance_levels(left, site.gravity, spec)
            responses = inertial_responses(
                h, r, site.gravity, site.latitude, method.estimator, at_end
            )
        tracked = quat_to_matrix(h.quat[-1]) if at_end else np.eye(3)
        when = h.duration if at_end else 0.0
        attitude = inertial_to_local(when, site.latitude) @ r @ tracked
        c = inertial_to_local(when, site.latitude)
        disturbance = inertial_disturbance(left, levels, responses, site) + c @ sway @ c.T
    else:
        angle, velocity = h.increments()
        attitude, orthonormality = analytic_attitude(
            angle / h.duration, velocity / h.duration, site, method.base
        )
        responses = analytic_responses(h, attitude, site.gravity, site.earth_rate, method.base)
        disturbance = analytic_disturbance(h, attitude, responses)
    angle, velocity = h.increments()
    mean_rate, mean_force = angle / h.duration, velocity / h.duration
    budget = instrument_budget(responses, spec, mean_rate, mean_force) if spec else {}
    budget["disturbance"] = disturbance
    return Estimate(
        method, attitude, budget, orthonormality, ratio, spec, biases, bias_covariance, why,
        positions=positions, best=best,
    )  # fmt: skip
