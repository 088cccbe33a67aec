"""From an estimate to a result that the record does not contradict.

The record is held against what must be true (`schuler.alignment.consistency`). Where it needs a
larger gyro bias than was assumed, the estimate is made again with that bias; where the bias hides
the Earth's rate, only the level is left, which the accelerometers give.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.consistency import FALSE_ALARM, Contradiction, check
from schuler.alignment.debias import bias_sigma, with_gyro_bias, without_gyro_bias
from schuler.alignment.estimate import QUIET
from schuler.alignment.history import History
from schuler.alignment.method import Estimate
from schuler.alignment.methods import Analytic
from schuler.alignment.moving.notice import moving_notice
from schuler.alignment.stationary.analytic import analytic_attitude
from schuler.alignment.stationary.optimal import Linearisation, joint
from schuler.attitude import quat_to_matrix
from schuler.constants import ARCMIN, DEG_PER_HOUR, EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import Summary
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["UNIFORM_SIGMA", "Assessment", "assess", "capped", "notices"]

Array = NDArray[np.float64]
Again = Callable[[History, ImuSpec, Linearisation | None], Estimate]

UNIFORM_SIGMA = np.pi / np.sqrt(3.0)
"""1-sigma of an angle of which nothing is known, rad: 104 deg."""

_BIAS_MISSING = (
    "no instrument specification was given: sigma holds the disturbance seen in the record and a "
    "gyro bias as large as its noise could hide, but no larger one and no accelerometer bias (say "
    "--spec navigation-fog, or a TOML file)"
)
_NO_BIAS = (
    "the specification '{}' holds no gyro bias, as one of an Allan analysis: sigma is how well the "
    "heading repeats while the bias stays, not how far it is from north (allan --save-spec takes "
    "--gyro-bias)"
)

_PROVEN = 0.05
"""Turn (rad) by the gyros, with the force at rest in the body, that is surely a bias."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """An estimate, and what the record says against it.

    Parameters
    ----------
    estimate : Estimate
        With an uncertainty that holds what contradicts it.
    contradictions : tuple of Contradiction
    notes : tuple of str
        What was found and is no contradiction.
    """

    estimate: Estimate
    contradictions: tuple[Contradiction, ...]
    notes: tuple[str, ...]


def assess(
    h: History, summary: Summary, site: Site, spec: ImuSpec | None, found: Estimate,
    again: Again, latitude_known: bool = True,
) -> Assessment:  # fmt: skip
    """Hold an estimate against its record.

    Parameters
    ----------
    h : History
    summary : Summary
    site : Site
    spec : ImuSpec or None
        The instrument as it was specified.
    found : Estimate
    again : callable
        Makes the estimate for another history and specification, and what it is linear about.
    latitude_known : bool
        False where the site's was found in the same record.
    """
    whole = h
    if _turns_only_by_gyros(h, summary):
        bias = float(np.linalg.norm(summary.mean_rate))
        contradictions: tuple[Contradiction, ...] = ()
        if spec is not None and bias > 4.6 * bias_sigma(spec.gyro, site.gravity):
            contradictions = (Contradiction("earth-rate", _bias_text(bias, spec)),)
        return Assessment(_level_only(h, summary, site, spec), contradictions, (_NO_HEADING,))
    hidden = False
    try:
        if spec is not None and found.best is not None:
            first = found
            h, found, settled = _relinearised(h, spec, found, again)
            if not settled and len(found.positions) > 1:
                return Assessment(_unknown(found), (), (_NOT_SETTLED,))
            horizontal = EARTH_RATE * np.cos(site.latitude)
            if not settled and bias_sigma(spec.gyro, site.gravity) > horizontal:
                # Where the last step led is chance. The first one's test holds: it is linear.
                h, found, hidden = whole, first, True
                if first.best is not None and len(first.best.dwells) > 1:
                    return Assessment(_unknown(first), (), (_NOT_SETTLED,))
        best = found.best if found.best is not None else joint(h, site, found.spec)
        result = check(h, best, summary, site, found.spec, latitude_known)
    except np.linalg.LinAlgError:
        raise InputError(
            "the record's values fix no attitude that could be tested: check its columns, units "
            "and rows (schuler info shows them)"
        ) from None
    if len(best.dwells) > 1 and not found.positions:
        # Whatever the method, the bound is that of all positions.
        found = replace(found, positions=tuple(best.positions(site)))
    notes: list[str] = []
    if hidden or result.least_bias > EARTH_RATE * np.cos(site.latitude):
        found = _level_only(h, summary, site, spec)
        notes.append(_NO_HEADING)
    elif result.least_bias > 0.0:
        wider = found.spec or ImuSpec(GyroSpec(), AccelerometerSpec(), name="none")
        try:
            wider = with_gyro_bias(wider, result.least_bias)
            _, larger, settled = _relinearised(whole, wider, again(whole, wider, None), again)
            if not settled and len(larger.positions) > 1:
                larger = _unknown(larger)
        except (InputError, np.linalg.LinAlgError):
            larger = _level_only(h, summary, site, spec)
        if spec is None:
            larger = replace(larger, spec=None)
            small = result.least_bias * h.duration < ARCMIN
            if small and "gyro_bias" in larger.budget:
                # It moves no estimate: only what is said of it has to grow.
                budget = {**found.budget, "gyro_bias": larger.budget["gyro_bias"]}
                larger = replace(found, budget=budget)
        if spec is not None and "gyro_bias" in larger.budget and not larger.positions:
            # The estimate stays: a wider prior would give its weights away.
            budget = {**larger.budget, "gyro_bias": _STUDENT**2 * larger.budget["gyro_bias"]}
            larger = replace(larger, budget=budget)
        found = larger
    shown = result.earth_rate
    if spec is None and result.least_bias == 0.0 and shown is not None and shown.hidden_bias > 0.0:
        # No gyro is without a bias, and no record shows one that is smaller than its noise.
        angle = shown.hidden_bias / (EARTH_RATE * np.cos(site.latitude))
        budget = {**found.budget, "gyro_bias": np.diag([0.0, 0.0, angle**2])}
        found = replace(found, budget=budget)
    if result.least_bias > 0.0 and spec is None:
        notes.append(
            "the record shows a gyro bias of at least "
            f"{result.least_bias / DEG_PER_HOUR:.2g} deg/h, which sigma holds"
        )
    elif result.least_bias > 0.0 and shown is not None and shown.probability >= FALSE_ALARM:
        notes.append(
            f"the record shows a gyro bias of about {result.least_bias / DEG_PER_HOUR:.2g} deg/h, "
            f"as one good record in {1.0 / shown.probability:.0f} of the specified instrument "
            f"does: sigma holds {_STUDENT * result.least_bias / DEG_PER_HOUR:.2g} deg/h, as two "
            "numbers show the size of a bias no better"
        )
    if spec is not None and shown is not None and not found.positions:
        # Several positions show the biases, and their heading rests on more than the mean rate.
        found = _with_seen_rate(found, shown.north / (EARTH_RATE * np.cos(site.latitude)))
    if any(each.kind == "axes" for each in result.contradictions):
        found = _without_heading(found)
    return Assessment(found, result.contradictions, tuple(notes))


def _relinearised(
    h: History, spec: ImuSpec, found: Estimate, again: Again
) -> tuple[History, Estimate, bool]:
    """Return a history without the gyro bias that it shows, and the estimate of it.

    The estimate is linear in the attitude and the bias: where these are far from what it is linear
    about, as with a bias that turns the base far over the record, it is made again about them. The
    last value says whether it settled at an attitude that the first one could know.
    """
    whole = h
    settled = True
    for lap in range(_ROUNDS):
        best = found.best
        if best is None:
            break
        bias = best.biases[:3]
        turned = float(np.linalg.norm(bias - best.about.gyro_bias)) * h.duration
        moved = 0.5 * float(np.linalg.norm(best.rotation - best.about.rotation))
        if turned < _SQUARE and moved < _FAR:
            break
        # From so far away there may be other attitudes that fit as well.
        settled = settled and moved < _FARTHEST and lap < _ROUNDS - 1
        h = without_gyro_bias(whole, bias)
        found = again(h, spec, Linearisation(best.rotation, bias))
    return h, found, settled


_STUDENT = 2.26
"""What sigma holds of the bias that refutes a specification, in parts of the likely one.

Two numbers show its size, the rate's excess up and north; the part east, which turns the heading,
is then Student's with two degrees of freedom: two sigma (95.4 %) of it are 2.26 times as large.
"""

_ROUNDS = 6

_SQUARE = 0.01
"""Turn (rad) by an estimated bias over the record beyond which its square may count."""

_FAR = 0.05
"""Rotation (rad) beyond which what was linear is not."""

_FARTHEST = 0.5
"""Rotation (rad) from which on steps need not lead to the best attitude."""

_NO_HEADING = (
    "the gyros' bias hides the Earth's rate: the level is that of the accelerometers, and there is "
    "no heading"
)


_NOT_SETTLED = (
    "the gyros' biases turn the base so far between the positions that several attitudes may fit "
    "the record: nothing is said of it; take gyros with a smaller bias, or one position"
)


def _bias_text(bias: float, spec: ImuSpec) -> str:
    return (
        f"the gyros turn by {bias / DEG_PER_HOUR:.3g} deg/h while the force rests in the body: a "
        f"bias of that size, where {spec.gyro.bias / DEG_PER_HOUR:.3g} deg/h is specified"
    )


def _turns_only_by_gyros(h: History, summary: Summary) -> bool:
    """Say whether the gyros claim a turn across gravity that the force does not show."""
    table = summary.stretch_sums
    third = len(table.data) // 3
    if third < 2:
        return False
    first, last = (part.sum(axis=0) for part in (table.sum_dvel[:third], table.sum_dvel[-third:]))
    a, b = first / np.linalg.norm(first), last / np.linalg.norm(last)
    seen = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    # From the middle of the first third to the middle of the last.
    turn = table.sum_dtheta.sum(axis=0) * (2.0 / 3.0)
    across = float(np.linalg.norm(turn - (turn @ a) * a))
    # Angles that do not commute add up to more than the attitude turns: it must have turned too.
    tracked = a @ quat_to_matrix(h.quat)
    n = len(tracked) // 3
    begin, end = tracked[:n].mean(axis=0), tracked[-n:].mean(axis=0)
    size = float(np.linalg.norm(begin) * np.linalg.norm(end))
    # Vectors that point everywhere have a short mean.
    turned = float(np.arccos(np.clip(begin @ end / size, -1.0, 1.0))) if size > 0.9 else np.pi
    earth = EARTH_RATE * summary.duration
    return min(across, turned) > _PROVEN + earth and seen < 0.2 * across


def _level_only(h: History, summary: Summary, site: Site, spec: ImuSpec | None) -> Estimate:
    """Return the level that the mean force gives, the gyro bias, and no heading."""
    angle, velocity = h.increments()
    rate, force = angle / h.duration, velocity / h.duration
    up = force / np.linalg.norm(force)
    level_rate = rate - (rate @ up) * up
    if np.linalg.norm(level_rate) <= 1e-3 * np.linalg.norm(rate):
        # Any direction will do: the heading is unknown.
        level_rate = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    attitude, _ = analytic_attitude(level_rate + EARTH_RATE * up, force, site, "gravity")
    gravity = site.gravity
    edges = np.linspace(0.0, h.duration, 9)
    ends = np.column_stack([np.interp(edges, h.t, x) for x in h.nodes.sum_dvel.T])
    scatter = np.cov((np.diff(ends, axis=0) * (8.0 / h.duration)).T) / 8.0
    tilt = attitude @ scatter @ attitude.T / gravity**2
    budget = {"disturbance": np.diag([tilt[1, 1], tilt[0, 0], 0.0])}
    prior = 0.0 if spec is None else bias_sigma(spec.accelerometer, gravity)
    budget["accelerometer_bias"] = np.diag([1.0, 1.0, 0.0]) * (prior / gravity) ** 2
    budget["gyro_bias"] = np.diag([0.0, 0.0, UNIFORM_SIGMA**2])
    _, level, vertical = site.earth_rate
    across = np.eye(3) - np.outer(up, up)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = 0.5 * level**2 * across
    covariance[:3, :3] += np.eye(3) * (summary.noise_gyro**2 / h.duration)
    covariance[3:, 3:] = np.eye(3) * prior**2
    biases = np.concatenate([rate - vertical * up, np.zeros(3)])
    return Estimate(
        Analytic(), attitude, budget, None, None, spec, biases, covariance,
        why="the gyros' bias is far above the Earth's rate: only the level can be found",
    )  # fmt: skip


def _with_seen_rate(found: Estimate, excess: float) -> Estimate:
    """Widen a heading whose gyros saw less horizontal rate than the Earth's.

    The direction of a vector of length s, drawn about one of known length r with variance v in each
    component, has the information r s / v (von Mises); the estimate, being linear, gives r r / v.

    Parameters
    ----------
    found : Estimate
    excess : float
        Of the horizontal rate over the Earth's, in parts of this.
    """
    if excess >= 0.0:
        return found
    scale = np.diag([1.0, 1.0, 1.0 / np.sqrt(max(1.0 + excess, _LEAST_RATE))])
    return replace(
        found, budget={name: scale @ part @ scale for name, part in found.budget.items()}
    )


_LEAST_RATE = 1e-4
"""Part of the Earth's horizontal rate below which none was seen."""


def _without_heading(found: Estimate) -> Estimate:
    """Return an estimate whose heading is unknown, as its axes are."""
    budget = dict(found.budget)
    budget["contradiction"] = np.diag([0.0, 0.0, UNIFORM_SIGMA**2])
    return replace(found, budget=budget)


def _unknown(found: Estimate) -> Estimate:
    """Return an estimate of which nothing is known, neither the level."""
    budget = {**found.budget, "not_settled": np.eye(3) * UNIFORM_SIGMA**2}
    return replace(found, budget=budget)


def capped(budget: dict[str, Array]) -> dict[str, Array]:
    """Return a budget whose variance about each axis is no larger than that of an unknown angle."""
    total = np.sum([np.diag(cov) for cov in budget.values()], axis=0)
    scale = np.diag(np.minimum(1.0, UNIFORM_SIGMA / np.sqrt(np.maximum(total, 1e-300))))
    if np.all(np.diag(scale) == 1.0):
        return budget
    return {name: scale @ cov @ scale for name, cov in budget.items()}


def notices(
    found: Estimate, spec: ImuSpec | None, h: History, sigma: float, contradicted: bool
) -> list[str]:
    """Return what a user should know of a sigma: what it lacks, and why it is large.

    Parameters
    ----------
    found : Estimate
    spec : ImuSpec or None
        The instrument as it was specified.
    h : History
    sigma : float
        Of the heading, arcmin.
    contradicted : bool
    """
    out = []
    if spec is None:
        out.append(_BIAS_MISSING)
    else:
        if not spec.gyro.bias:
            out.append(_NO_BIAS.format(spec.name))
        if found.noise_ratio is not None and found.noise_ratio < QUIET:
            out.append(
                f"the record has {found.noise_ratio:.2g} times the noise power of the "
                f"specification '{spec.name}', too little for chance: the white noise in "
                "sigma and limit was scaled down to what the record shows"
            )
    if sigma > 600.0 or contradicted:
        notice = moving_notice(h)
        out += [] if notice is None else [notice]
    if sigma > 600.0:
        out.append(
            f"sigma of the heading is {sigma / 60:.0f} deg: this record, or this instrument, "
            "cannot tell north"
        )
    return out
