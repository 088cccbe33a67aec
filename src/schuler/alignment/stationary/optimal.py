"""The optimal linear estimate of attitude and biases: all the information in the record, weighted.

Two series see the same small attitude error phi_0 (in i0): the velocity that the force makes in
the frame that the gyros hold, which gravity's turn bends, and the attitude of the base itself as
the gyros carry it, which for a base at rest must not drift against the local level. Averaged over
stretches, both are linear in phi_0, in the biases of gyros and accelerometers, and in a few
constants that are not known (the velocity at the start, the attitude of each dwell). The noise of
both is known as well: what the specification says of the instrument, common to both, what the
vehicle's motion adds to the velocity, and how the base turns. Generalised least squares, with the
specified biases as the prior, is then the best that any linear method can do.

How much the attitude of the base may be trusted is read from the record: the powers of its modes
above the straight line, beside what the gyros' noise makes of them. On a base at rest the estimate
is as good as the plain mean of the gyros; on a rocking one this series has no weight, and gravity
alone is left. A unit that is turned between dwells shows its biases.

Source: Gauss-Markov theorem (Aitken, 1935) on the linearised inertial-frame equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.bound import Position
from schuler.alignment.history import History, gravity_direction, inertial_to_local
from schuler.alignment.stationary.disturbance import (
    Levels,
    velocity_levels,
    velocity_powers,
)
from schuler.alignment.stationary.gains import NormalEquations, bias_priors, gains, weigh
from schuler.alignment.stationary.inertial import Weights, solve
from schuler.alignment.stationary.series import Series, make_series, turns_from_middle, with_tests
from schuler.alignment.stationary.uncertainty import mean_attitude
from schuler.attitude import (
    multiply,
    nearest_quat,
    quat_to_euler,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
)
from schuler.constants import DEG
from schuler.earth import Site
from schuler.kernels.states import TrackerNode
from schuler.sensors import ImuSpec

__all__ = ["Linearisation", "OptimalAlignment", "find_dwells", "joint"]

Array = NDArray[np.float64]

BLOCKS = 128
"""Stretches into which a history is thinned."""


@dataclass(frozen=True, eq=False)
class Answer:
    """How phi at one instant, in i0, responds to errors of the two series.

    Parameters
    ----------
    weights : Weights
        From errors of the velocity.
    angle : (m, 3, 3) float64
        From errors of the attitude over each stretch.
    sway : (3, 3) float64
        Covariance that the base's own turning makes, rad^2.
    """

    weights: Weights
    angle: Array
    sway: Array

    @classmethod
    def from_gains(
        cls, gain_a: Array, gain_v: Array, local: Array, mean_sway: Array, base: Array
    ) -> Answer:
        """Make it of gains (m, 3, 3) and (m, 3, 2), series in the level frame `local`.

        `base` (3, 3) is what a steady turn of the base, as large as it may be, makes of phi.
        """
        sway = sum(
            (gain_a[:, :, k].T @ mean_sway[k] @ gain_a[:, :, k] for k in range(3)),
            np.zeros((3, 3)),
        )
        weights = Weights(
            np.zeros(1, np.int64), np.zeros((1, 3, 3)), np.zeros(1, np.int64),
            -gain_v @ local[:, :2],
        )  # fmt: skip
        return cls(weights, -gain_a @ local, np.asarray(sway + base @ base.T))


@dataclass(frozen=True, eq=False)
class Linearisation:
    """What the optimal estimate is linear about.

    Parameters
    ----------
    rotation : (3, 3) float64
        C_ib0^i0.
    gyro_bias : (3,) float64
        What was taken off the history (`without_gyro_bias`), rad/s: the prior is that of the whole
        bias, and so is what is estimated.
    """

    rotation: Array
    gyro_bias: Array


@dataclass(frozen=True, eq=False)
class OptimalAlignment:
    """The optimal estimate.

    Parameters
    ----------
    about : Linearisation
    rotation : (3, 3) float64
        R = C_ib0^i0.
    biases : (6,) float64
        Of gyros (rad/s) and accelerometers (m/s^2), body axes.
    covariance : (9, 9) float64
        Of phi_0 (in i0) and the biases.
    start, end : Answer
        How phi at the start and at the end, both in i0, responds to the series.
    end_turn : (3,) float64
        Turn in i0 by which the gyros' biases and noise, as far as they are estimated, move the
        tracked attitude at the end.
    levels : Levels
        Of the motion in the velocity (`disturbance_levels`).
    history : History
        Thinned to the stretches.
    attitude : (m, 3, 3) float64
        C_b^i0, the mean over each stretch.
    dwells : tuple of (int, int)
        Stretches [begin, end) in which the unit was not turned.
    share : float
        Part of the information on phi_0 about the vertical that the attitude of the base gives.
    sway_levels : (3, 2) float64
        Levels of a bounded and of a wandering turn of the base about east, north and up.
    steady : bool
        Whether the unit is on one base all the time that does not turn.
    latitude : (2,) float64
        How far the latitude is off, and its 1-sigma, rad; zero where it is taken for known.
    tilt : float
        Mean square of the base's sway, from stretch to stretch and within them, rad^2.
    normal : NormalEquations
        The whole problem without priors, for tests of what was taken for granted.
    """

    about: Linearisation
    rotation: Array
    biases: Array
    covariance: Array
    start: Answer
    end: Answer
    end_turn: Array
    levels: Levels
    history: History
    attitude: Array
    dwells: tuple[tuple[int, int], ...]
    share: float
    sway_levels: Array
    steady: bool
    latitude: Array
    tilt: float
    normal: NormalEquations

    def positions(self, site: Site) -> list[Position]:
        """Return the dwells as positions of a limit, with the turns between them as tracked."""
        h = self.history
        out = []
        before = 0
        for begin, end in self.dwells:
            middle = (begin + end) // 2
            t = 0.5 * (h.t[middle] + h.t[middle + 1])
            c = inertial_to_local(float(t), site.latitude) @ self.attitude[middle]
            psi, theta, gamma = quat_to_euler(nearest_quat(c)) / DEG
            turn = float(h.t[begin] - h.t[before]) if before else 0.0
            out.append(
                Position(float(psi), float(theta), float(gamma), float(h.t[end] - h.t[begin]), turn)
            )
            before = end
        return out

    @property
    def still(self) -> bool:
        """Whether the attitude of the base says more of the heading than gravity does."""
        return self.share > 0.5


def joint(
    h: History, site: Site, spec: ImuSpec | None, *, about: Linearisation | None = None,
    free_latitude: bool = False,
) -> OptimalAlignment:  # fmt: skip
    """Return the optimal estimate of a history.

    Parameters
    ----------
    h : History
    site : Site
    spec : ImuSpec or None
        The instrument; without one all noise is read from the record, and biases are taken for
        nothing.
    about : Linearisation, optional
        What the estimate is linear about; the centred estimate and no bias when not given.
    free_latitude : bool
        Estimate how far the latitude is off as well.

    Raises
    ------
    InputError
        As `schuler.alignment.stationary.inertial.solve`.
    """
    if about is None and not free_latitude:
        # Every method's result is held against it, and so are all of one record.
        kept = _found.setdefault(h, {})
        if (site, spec) not in kept:
            kept[site, spec] = _joint(h, site, spec, None, False)
        return kept[site, spec]
    return _joint(h, site, spec, about, free_latitude)


_found: WeakKeyDictionary[History, dict[tuple[Site, ImuSpec | None], OptimalAlignment]] = (
    WeakKeyDictionary()
)
"""What was found already, for as long as its history is there."""


def _joint(
    h: History, site: Site, spec: ImuSpec | None, about: Linearisation | None, free_latitude: bool
) -> OptimalAlignment:
    """See `joint`."""
    g, lat = site.gravity, site.latitude
    about = about or Linearisation(solve(h, g, lat, "centred"), np.zeros(3))
    r, removed = about.rotation, about.gyro_bias
    fine = h
    h, _ = h.thin(BLOCKS)
    dt = np.diff(h.t)
    interval = h.duration / max(h.samples, 1)
    # The mean over updates is that of the middle of a stretch only where no rows were lost: the
    # Earth turns further in half a second than the gyros' noise does.
    local = inertial_to_local(h.t[:-1] + h.mean_shares() * dt - 0.5 * interval, lat)
    quat_local = nearest_quat(local)
    theory = g * gravity_direction(lat) * h.block_means(TrackerNode.sum_gravity)
    velocity = h.block_means(TrackerNode.sum_v)
    q = h.block_means(TrackerNode.sum_quat)
    size = np.linalg.norm(q, axis=1)
    # Half a turn within a stretch leaves no mean: such a stretch is no part of a dwell.
    q = q / np.maximum(size, 1e-9)[:, None]
    dwells = find_dwells(q, size > 0.999)
    attitude = mean_attitude(fine, h, r)
    m = len(dt)
    e = np.einsum("iab,ib->ia", local[:, :2], velocity @ r.T - theory)
    powers = velocity_powers(e, dt, interval, g, spec, dwells)
    levels = velocity_levels(powers, spec is not None and not h.sampling_faults)
    turns = turns_from_middle(q, r, quat_local, dwells)
    series = make_series(h, site, spec, levels, local, attitude, turns, dwells)
    series = with_tests(series, h, site, local, dwells)
    propagated = np.einsum("iab,i->ab", attitude, dt)
    weighed = weigh(series)
    normal = weighed.normal(turns, e)
    # Of a latitude that is not known, a turn of the base cannot be told apart.
    base_rate, at_rest = (0.0, 1.0) if free_latitude else normal.base_rate(*bias_priors(spec))
    gain_a, gain_v, end_a, end_v, covariance, by_prior, by_base = gains(
        series, weighed, spec, base_rate, propagated, local[m // 2], free_latitude
    )
    # The prior of what is left of the bias is about the negative of what was taken off.
    shift, end_shift = np.split(by_prior @ -removed, [len(by_prior) - 3])
    latitude = np.zeros(2)
    biases = np.zeros(6)
    # Errors are phi^2, so a second step leaves nothing.
    for _ in range(2):
        e = np.einsum("iab,ib->ia", local[:, :2], velocity @ r.T - theory)
        turns = turns_from_middle(q, r, quat_local, dwells)
        found = np.einsum("iab,ib->a", gain_v, e)
        found += np.einsum("iab,ib->a", gain_a, turns) + shift
        biases = found[NormalEquations.BIASES]
        at_end = np.einsum("iab,ib->a", end_v, e) + np.einsum("iab,ib->a", end_a, turns)
        at_end += end_shift
        if free_latitude:
            latitude = np.array([found[-1], np.sqrt(covariance[-1, -1])])
        r = np.asarray(quat_to_matrix(rotvec_to_quat(found[NormalEquations.PHI])) @ r)
    normal = weighed.normal(turns, e, removed)
    start = Answer.from_gains(
        gain_a[:, :3], gain_v[:, :3], local, series.mean_sway, base_rate * by_base[:3]
    )
    end = Answer.from_gains(end_a, end_v, local, series.mean_sway, base_rate * by_base[-3:])
    return OptimalAlignment(
        about, r, biases + np.concatenate([removed, np.zeros(3)]), covariance[:9, :9], start, end,
        found[NormalEquations.PHI] - at_end, levels, h, attitude,
        dwells, _share(series, gain_a, gain_v, local[m // 2, 2]), series.sway_levels,
        dwells == ((0, m),) and len(series.attitude_rows) > 0 and at_rest > 0.5, latitude,
        float(np.mean(turns[:, :2] ** 2) + 4.0 * np.mean(np.maximum(1.0 - size**2, 0.0))),
        normal,
    )  # fmt: skip


def _share(series: Series, gain_a: Array, gain_v: Array, up: Array) -> float:
    """Return how much of a turn about the vertical the estimate takes from the attitude series."""
    signal = series.design[:, :, :3] @ up
    angle = np.einsum("a,iab,bi->", up, gain_a[:, :3], signal[:3])
    velocity = np.einsum("a,iab,bi->", up, gain_v[:, :3], signal[3:])
    return float(angle / (angle + velocity))


TURN = 0.03
"""Change of attitude from one stretch to the next (rad) that is a turn and no sway."""

SHORTEST = 4
"""Stretches without a turn that make a dwell."""

SWAY = 0.15
"""Attitude from the mean of several dwells (rad) within which the changes may be a sway."""

FEW = 3
"""Changes of attitude that may be turns on purpose though they are small; more are a sway."""


def find_dwells(q: Array, steady: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """Return the stretches [begin, end) between turns; none where the unit never rests.

    Parameters
    ----------
    q : (m, 4) float64
        Mean attitude over each stretch, as unit quaternions.
    steady : (m,) bool
        Whether the mean is one of like attitudes; a stretch within which the unit turns far is
        part of a turn.
    """
    back = q[:-1] * [1.0, -1.0, -1.0, -1.0]
    change = np.linalg.norm(quat_to_rotvec(multiply(back, q[1:])), axis=1)
    turned = np.asarray(change > TURN)
    moving = np.logical_not(steady)
    moving[:-1] |= turned
    moving[1:] |= turned
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(np.int8)))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    found = [(int(i), int(j)) for i, j in pairs if j - i >= SHORTEST]
    if np.count_nonzero(np.diff(moving.astype(np.int8)) > 0) > FEW:
        found = _without_sway(q, found)
    return tuple(found)


def _without_sway(q: Array, dwells: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the dwells, of which those that a mere sway parts are one."""
    if _near(q):
        return [(0, len(q))]
    out = dwells[:1]
    for begin, end in dwells[1:]:
        first = out[-1][0]
        if _near(q[first:end]):
            out[-1] = (first, end)
        else:
            out.append((begin, end))
    return out


def _near(q: Array) -> bool:
    """Say whether all attitudes (m, 4) are near their mean."""
    signs = np.where(q @ q[0] < 0.0, -1.0, 1.0)[:, None]
    mean = (q * signs).sum(axis=0)
    size = np.linalg.norm(mean)
    if size < 0.9 * len(q):
        return False
    back = np.broadcast_to(mean / size * [1.0, -1.0, -1.0, -1.0], q.shape)
    return bool(np.linalg.norm(quat_to_rotvec(multiply(back, q)), axis=1).max() < SWAY)
