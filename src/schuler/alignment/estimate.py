"""Estimates from the tracker's running sums: an attitude with its covariance by source."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.bound import Position
from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.method import Estimate, Problem
from schuler.alignment.methods import Analytic, Inertial
from schuler.alignment.stationary.analytic import analytic_attitude
from schuler.alignment.stationary.disturbance import (
    analytic_disturbance,
    disturbance_levels,
    inertial_disturbance,
    noise_ratio,
)
from schuler.alignment.stationary.inertial import MINIMUM_ROWS, Residual, residual, solve
from schuler.alignment.stationary.optimal import OptimalAlignment, joint
from schuler.alignment.stationary.uncertainty import (
    Responses,
    analytic_responses,
    inertial_responses,
    instrument_budget,
    weighted_responses,
)
from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import ImuSpec

__all__ = [
    "QUIET",
    "analytic_estimate",
    "choose",
    "chosen_estimate",
    "inertial_attitude",
    "inertial_estimate",
    "mean_solution",
]

Array = NDArray[np.float64]

QUIET = 0.4
"""Noise power, relative to the specification, that chance makes less than once in a thousand."""

_QUIETEST = 0.01
"""Least part of the specified noise power that is believed: a record without noise is no record."""


def _check_length(h: History) -> None:
    if len(h) < MINIMUM_ROWS:
        raise InputError(
            f"the span from t = {h.start:.9g} s has only {h.samples} sample(s) "
            f"({h.duration:.3g} s), too few to align: take a longer one"
        )


def _believed(
    h: History, site: Site, spec: ImuSpec | None
) -> tuple[Residual, float | None, ImuSpec | None]:
    """Return what no attitude explains, its power, and the specification that is believed."""
    left = residual(h, site)
    ratio = None
    if spec:
        ratio = noise_ratio(left, site.gravity, spec)
        if ratio is not None and ratio < QUIET:
            spec = spec.with_white_noise(np.sqrt(max(ratio, _QUIETEST)))
    return left, ratio, spec


def _budget(h: History, responses: Responses, spec: ImuSpec | None) -> dict[str, Array]:
    angle, velocity = h.increments()
    if not spec:
        return {}
    return instrument_budget(responses, spec, angle / h.duration, velocity / h.duration)


def choose(
    best: OptimalAlignment, spec: ImuSpec | None, subsamples: int | None
) -> tuple[Inertial, str]:
    """Return the method for a history and the reason in a sentence.

    With a specification the optimal estimate is the choice on any base: it weighs the attitude of
    the base and gravity's turn by what the record shows of both. Without one its weights rest on
    the record alone, and are taken only on a base at rest, where they promise a clear gain.

    Parameters
    ----------
    best : OptimalAlignment
        The optimal estimate, which says what the record shows.
    spec : ImuSpec or None
    subsamples : int or None
        For the method.
    """
    dwells = len(best.dwells)
    if spec is not None:
        if dwells > 1:
            why = f"the unit was turned between {dwells} dwells, which shows its biases"
        elif dwells == 0:
            why = "the unit turns all the time, which shows its biases"
        elif best.still:
            why = "the base is at rest: its attitude and gravity both count"
        else:
            why = "the base moves: gravity's turn counts, weighted by the noise of the instrument"
        return Inertial("optimal", subsamples), why
    if dwells == 1 and best.still:
        return (
            Inertial("optimal", subsamples),
            "the base is at rest: its attitude and gravity both count",
        )
    return (
        Inertial("centred", subsamples),
        "no specification says how the noise of the instrument is to be weighed",
    )


def chosen_estimate(subsamples: int | None, problem: Problem) -> Estimate:
    """Return the estimate of the method that the record calls for."""
    h, site = problem.history, problem.site
    _check_length(h)
    left, ratio, spec = _believed(h, site, problem.spec)
    best = joint(h, site, spec, about=problem.about)
    method, why = choose(best, spec, subsamples)
    found = _inertial(method, problem, left, ratio, spec, best)
    return replace(found, why=why)


def inertial_estimate(method: Inertial, problem: Problem) -> Estimate:
    """Return the attitude in the inertial frame and its covariance by source."""
    _check_length(problem.history)
    return _inertial(method, problem, *_believed(problem.history, problem.site, problem.spec), None)


def inertial_attitude(method: Inertial, problem: Problem) -> Array:
    """Return the attitude in the inertial frame, mat_nb (3, 3), without its covariance."""
    if method.estimator == "optimal":
        return inertial_estimate(method, problem).attitude
    _check_length(problem.history)
    site = problem.site
    r = solve(problem.history, site.gravity, site.latitude, method.estimator)
    return _attitude(problem, r)


def _attitude(problem: Problem, r: Array) -> Array:
    """Return the attitude mat_nb (3, 3) at the wanted instant for R = C_ib0^i0."""
    h = problem.history
    tracked = quat_to_matrix(h.quat[-1]) if problem.at_end else np.eye(3)
    when = h.duration if problem.at_end else 0.0
    return np.asarray(inertial_to_local(when, problem.site.latitude) @ r @ tracked)


def _inertial(
    method: Inertial, problem: Problem, left: Residual, ratio: float | None, spec: ImuSpec | None,
    best: OptimalAlignment | None,
) -> Estimate:  # fmt: skip
    h, site, at_end = problem.history, problem.site, problem.at_end
    biases = bias_covariance = None
    positions: tuple[Position, ...] = ()
    sway = np.zeros((3, 3))
    if method.estimator == "optimal":
        best = best or joint(h, site, spec, about=problem.about)
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
        levels = disturbance_levels(left, site.gravity, spec, h.sampling_faults)
        responses = inertial_responses(h, r, site.gravity, site.latitude, method.estimator, at_end)
    attitude = _attitude(problem, r)
    c = inertial_to_local(h.duration if at_end else 0.0, site.latitude)
    disturbance = inertial_disturbance(left, levels, responses, site) + c @ sway @ c.T
    budget = _budget(h, responses, spec)
    budget["disturbance"] = disturbance
    return Estimate(
        method, attitude, budget, None, ratio, spec, biases, bias_covariance,
        positions=positions, best=best,
    )  # fmt: skip


def mean_solution(method: Analytic, problem: Problem) -> tuple[Array, float]:
    """Return the attitude from mean force and mean rate, mat_nb (3, 3), and its error, rad."""
    h = problem.history
    _check_length(h)
    angle, velocity = h.increments()
    return analytic_attitude(angle / h.duration, velocity / h.duration, problem.site, method.base)


def analytic_estimate(method: Analytic, problem: Problem) -> Estimate:
    """Return the attitude from mean force and mean rate and its covariance by source."""
    h, site, spec = problem.history, problem.site, problem.spec
    attitude, orthonormality = mean_solution(method, problem)
    responses = analytic_responses(h, attitude, site.gravity, site.earth_rate, method.base)
    budget = _budget(h, responses, spec)
    budget["disturbance"] = analytic_disturbance(h, attitude, responses)
    return Estimate(method, attitude, budget, orthonormality, None, spec)
