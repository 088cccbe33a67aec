"""The optimal linear estimate of attitude and biases: all that the record tells, weighted.

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

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.bound import Position
from schuler.alignment.history import History, Rows, gravity_direction, inertial_to_local
from schuler.alignment.stationary.disturbance import (
    Levels,
    angle_powers,
    posterior,
    velocity_levels,
    velocity_powers,
)
from schuler.alignment.stationary.dwells import find_dwells
from schuler.alignment.stationary.inertial import Weights, solve
from schuler.alignment.stationary.normal_equations import NormalEquations
from schuler.alignment.stationary.uncertainty import mean_attitude, part_covariance
from schuler.attitude import (
    multiply,
    nearest_quat,
    quat_to_euler,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
    skew,
)
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.kernels.states import TrackerNode
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["Linearisation", "OptimalAlignment", "joint"]

Array = NDArray[np.float64]

BLOCKS = 128
"""Stretches into which a history is thinned."""

PARTS = 4
"""Parts of a stretch in which its noise is looked at."""

LARGEST = 0.05
"""Turn of the base (rad) within a dwell beyond which its attitude is not taken for a constant."""

_LEAST_WHITE = 0.3 * MICRO_G
"""Least noise of the force, m/s^2/sqrt(Hz)."""

_FREE_GYRO, _FREE_ACCEL = 1e-6 * DEG_PER_HOUR, 1e-3 * MICRO_G
"""Biases (1 sigma) of an instrument that is not known to have any."""


@dataclass(frozen=True, eq=False)
class Answer:
    """How phi at one instant, in i0, answers to errors of the two series.

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
        How phi at the start and at the end, both in i0, answers to the series.
    end_turn : (3,) float64
        Turn in i0 by which the gyros' biases and noise, as far as they are estimated, have carried
        the tracked attitude at the end.
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


def _noise(
    part: GyroSpec | AccelerometerSpec, response: Array, dt: Array, interval: float
) -> Array:
    """Return the covariance (a, a) of quantities that answer to increments by (a, m)."""
    found = part_covariance(replace(part, bias=0.0), response.T[:, :, None], dt, interval)
    return np.asarray(sum(found.values(), np.zeros((len(response), len(response)))))


def _turns(q: Array, r: Array, local: Array, dwells: tuple[tuple[int, int], ...]) -> Array:
    """Return the turn (m, 3) from the middle attitude of each dwell, east, north, up, rad."""
    attitude = multiply(nearest_quat(local @ r), q)
    out = np.zeros((len(q), 3))
    for begin, end in dwells:
        back = attitude[(begin + end) // 2] * [1.0, -1.0, -1.0, -1.0]
        part = attitude[begin:end]
        out[begin:end] = quat_to_rotvec(multiply(part, np.broadcast_to(back, part.shape)))
    return out


@dataclass(frozen=True, eq=False)
class _Series:
    """Both series: how they answer to the unknowns, and their noise.

    Parameters
    ----------
    design : (5, m, n) float64
        Attitude about east, north and up, velocity east and north; columns as `_COLUMNS` says.
    gyro : (2m, 2m) float64
        Covariance of attitude and velocity from the gyros' noise about one axis.
    gyro_end : (2m,) float64
        Covariance of both with the turn that this noise has made at the end.
    force, sway : (m, m), (3, m, m) float64
        Covariance of the velocity and of the attitude from all else.
    mean_sway : (3, m, m) float64
        The same of the attitude by the posterior mean, for the uncertainty.
    sway_levels : (3, 2) float64
        Its levels.
    attitude_rows, velocity_rows : (k,) int64
        Stretches that are used.
    """

    design: Array
    gyro: Array
    gyro_end: Array
    force: Array
    sway: Array
    mean_sway: Array
    sway_levels: Array
    attitude_rows: Rows
    velocity_rows: Rows


_COLUMNS = 11
"""phi_0 (3), gyro bias (3), accelerometer bias (3), velocity east and north in the middle; then
the attitude of each dwell (3)."""


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
    g, lat = site.gravity, site.latitude
    about = about or Linearisation(solve(h, g, lat, "centred"), np.zeros(3))
    r, removed = about.rotation, about.gyro_bias
    fine = h
    h, _ = h.thin(BLOCKS)
    dt, t = np.diff(h.t), 0.5 * (h.t[1:] + h.t[:-1])
    local = inertial_to_local(t, lat)
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
    interval = h.duration / max(h.samples, 1)
    levels = velocity_levels(velocity_powers(e, dt, interval, g, spec, dwells))
    turns = _turns(q, r, local, dwells)
    series = _series(h, site, spec, levels, local, attitude, turns, dwells)
    series = _with_tests(series, h, site, local, dwells)
    carried = np.einsum("iab,i->ab", attitude, dt)
    weighed = _weigh(series)
    normal = weighed.normal(turns, e)
    # Of a latitude that is not known, a turn of the base cannot be told apart.
    base_rate, at_rest = (0.0, 1.0) if free_latitude else normal.base_rate(*_bias_priors(spec))
    gain_a, gain_v, end_a, end_v, covariance, by_prior, by_base = _gains(
        series, weighed, spec, base_rate, carried, local[m // 2], free_latitude
    )
    # The prior of what is left of the bias is about the negative of what was taken off.
    shift, end_shift = np.split(by_prior @ -removed, [len(by_prior) - 3])
    latitude = np.zeros(2)
    biases = np.zeros(6)
    # Errors are phi^2, so a second step leaves nothing.
    for _ in range(2):
        e = np.einsum("iab,ib->ia", local[:, :2], velocity @ r.T - theory)
        turns = _turns(q, r, local, dwells)
        found = np.einsum("iab,ib->a", gain_v, e)
        found += np.einsum("iab,ib->a", gain_a, turns) + shift
        biases = found[3:9]
        at_end = np.einsum("iab,ib->a", end_v, e) + np.einsum("iab,ib->a", end_a, turns)
        at_end += end_shift
        if free_latitude:
            latitude = np.array([found[9], np.sqrt(covariance[9, 9])])
        r = np.asarray(quat_to_matrix(rotvec_to_quat(found[:3])) @ r)
    normal = weighed.normal(turns, e, removed)
    start = Answer.from_gains(
        gain_a[:, :3], gain_v[:, :3], local, series.mean_sway, base_rate * by_base[:3]
    )
    end = Answer.from_gains(end_a, end_v, local, series.mean_sway, base_rate * by_base[-3:])
    return OptimalAlignment(
        about, r, biases + np.concatenate([removed, np.zeros(3)]), covariance[:9, :9], start, end,
        found[:3] - at_end, levels, h, attitude,
        dwells, _share(series, gain_a, gain_v, local[m // 2, 2]), series.sway_levels,
        dwells == ((0, m),) and len(series.attitude_rows) > 0 and at_rest > 0.5, latitude,
        float(np.mean(turns[:, :2] ** 2) + 4.0 * np.mean(np.maximum(1.0 - size**2, 0.0))),
        normal,
    )  # fmt: skip


def _with_tests(
    series: _Series, h: History, site: Site, local: Array, dwells: tuple[tuple[int, int], ...]
) -> _Series:
    """Return the series with columns for the latitude and for a steady turn of the base."""
    step = 1e-5
    sides = []
    for sign in (-1.0, 1.0):
        there = Site((site.latitude + sign * step) / DEG, site.lon, site.height)
        direction = there.gravity * gravity_direction(there.latitude)
        sides.append(direction * h.block_means(TrackerNode.sum_gravity))
    # v is that of the true latitude, so the residual gains what G would.
    slope = np.einsum("iab,ib->ia", local[:, :2], (sides[1] - sides[0]) / (2.0 * step))
    columns = np.zeros((*series.design.shape[:2], 4))
    columns[3:, :, 0] = slope.T
    middle = 0.5 * (h.t[1:] + h.t[:-1])
    for begin, end in dwells:
        since = middle[begin:end] - middle[(begin + end) // 2]
        for axis in range(3):
            columns[axis, begin:end, 1 + axis] = since
    return replace(series, design=np.concatenate([series.design, columns], axis=2))


def _share(series: _Series, gain_a: Array, gain_v: Array, up: Array) -> float:
    """Return how much of a turn about the vertical the estimate takes from the attitude series."""
    signal = series.design[:, :, :3] @ up
    angle = np.einsum("a,iab,bi->", up, gain_a[:, :3], signal[:3])
    velocity = np.einsum("a,iab,bi->", up, gain_v[:, :3], signal[3:])
    return float(angle / (angle + velocity))


def _series(
    h: History, site: Site, spec: ImuSpec | None, levels: Levels, local: Array, attitude: Array,
    turns: Array, dwells: tuple[tuple[int, int], ...],
) -> _Series:  # fmt: skip
    g, lat = site.gravity, site.latitude
    dt = np.diff(h.t)
    m = len(dt)
    interval = h.duration / max(h.samples, 1)
    once = np.tril(np.ones((m, m)), -1) + 0.5 * np.eye(m)
    walk, double, short = _responses(dt)
    # The last row is the attitude at the end, which answers to all increments in full.
    stacked = np.vstack([walk, g * double, np.ones((1, walk.shape[1]))])

    # What the vehicle's motion and the instrument make of the series.
    d, c, b, a = levels.likely
    change = np.diff(np.eye(m), axis=1, prepend=0.0, append=0.0) / dt[:, None]
    wander = (walk * short) @ walk.T
    force = d * change @ change.T + np.diag(c / dt) + b * wander
    gyro = a * (stacked * short) @ stacked.T
    if spec is not None:
        # Means over stretches are no better than this, whatever an instrument is said to be.
        force += max(_LEAST_WHITE**2 - spec.accelerometer.white**2, 0.0) * wander
        force += _noise(spec.accelerometer, walk, short, interval)
        gyro += _noise(spec.gyro, stacked, short, interval)

    # Dwells whose attitude is steady enough to say something.
    steady = [d for d in dwells if d[1] - d[0] > 8 and np.abs(turns[d[0] : d[1]]).max() < LARGEST]
    sway = np.zeros((2, 3, m, m))
    levels_of_sway = np.zeros((3, 2))
    for axis in range(3) if steady else ():
        parts = [angle_powers(turns[i:j, axis], dt[i:j], gyro[i:j, i:j]) for i, j in steady]
        power, shapes, known = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
        level = posterior(power, shapes, known)
        levels_of_sway[axis] = level.mean
        for k, (white, walking) in enumerate((level.likely, level.mean)):
            sway[k, axis] = np.diag(white / dt) + walking * wander

    theta = _carried(once, attitude * dt[:, None, None])
    # A turned frame takes the force with it: theta x f.
    bend = _carried(once, -skew(np.diff(h.theory(g, lat), axis=0)) @ theta)
    theory = g * gravity_direction(lat) * h.block_means(TrackerNode.sum_gravity)
    design = np.zeros((5, m, _COLUMNS + 3 * len(dwells)))
    level_axes = local[:, :2]
    design[:3, :, :3] = -local.transpose(1, 0, 2)
    design[:3, :, 3:6] = (local @ theta).transpose(1, 0, 2)
    for k, (begin, end) in enumerate(dwells):
        for axis in range(3):
            design[axis, begin:end, _COLUMNS + 3 * k + axis] = 1.0
    design[3:, :, :3] = (level_axes @ skew(theory)).transpose(1, 0, 2)
    design[3:, :, 3:6] = (level_axes @ bend).transpose(1, 0, 2)
    design[3:, :, 6:9] = (level_axes @ theta).transpose(1, 0, 2)
    design[3:, :, 9:11] = (level_axes @ local[m // 2].T[:, :2]).transpose(1, 0, 2)
    none = np.zeros(0, np.int64)
    return _Series(
        design, gyro[:-1, :-1], gyro[:-1, -1], force, sway[0], sway[1], levels_of_sway,
        np.concatenate([none, *(np.arange(i, j) for i, j in steady)]),
        np.concatenate([none, *(np.arange(i, j) for i, j in dwells)]) if dwells else np.arange(m),
    )  # fmt: skip


def _responses(dt: Array) -> tuple[Array, Array, Array]:
    """Return how means over stretches answer to increments, once and twice summed.

    The increments are those of the stretches' parts: summed over whole ones, a random walk would
    have no noise at the highest frequency, and least squares would trust it there without end.

    Returns
    -------
    (m, k), (m, k), (k,) float64
        Responses, and the lengths of the parts, s.
    """
    short = np.repeat(dt / PARTS, PARTS)
    once = np.tril(np.ones((len(short), len(short))), -1) + 0.5 * np.eye(len(short))
    twice = (once * short) @ once
    shape = (len(dt), PARTS, len(short))
    return once.reshape(shape).mean(axis=1), twice.reshape(shape).mean(axis=1), short


def _carried(once: Array, steps: Array) -> Array:
    """Return the mean over each stretch of the running sum of steps (m, 3, 3)."""
    return np.asarray((once @ steps.reshape(len(steps), 9)).reshape(steps.shape))


@dataclass(frozen=True, eq=False)
class _Group:
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
class _Weighed:
    """Both series, weighted by their noise.

    Parameters
    ----------
    groups : tuple of _Group
    information : (n, n) float64
        Of all unknowns, without priors.
    """

    groups: tuple[_Group, ...]
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


def _weigh(series: _Series) -> _Weighed:
    m, n = series.design.shape[1:]
    information = np.zeros((n, n))
    groups: list[_Group] = []
    none = np.zeros(0, np.int64)
    # A turn about east takes the force north and a turn about north takes it west; a turn about
    # up takes it nowhere. So the series fall into three independent groups.
    for turn, move, sign in ((0, 4, -1.0), (1, 3, 1.0), (2, 3, 0.0)):
        rows_a, rows_v = series.attitude_rows, series.velocity_rows if sign else none
        chosen = np.concatenate([rows_a, m + rows_v])
        if not len(chosen):
            continue
        flip = np.repeat([1.0, sign], m)[chosen]
        noise = series.gyro[np.ix_(chosen, chosen)] * np.outer(flip, flip)
        k = len(rows_a)
        noise[:k, :k] += series.sway[turn][np.ix_(rows_a, rows_a)]
        noise[k:, k:] += series.force[np.ix_(rows_v, rows_v)]
        # A noise that is said to be nothing must not leave the inverse without digits.
        noise[np.diag_indices(len(chosen))] *= 1.0 + 1e-9
        noise[np.diag_indices(len(chosen))] += 1e-24
        jacobian = np.concatenate([series.design[turn][rows_a], series.design[move][rows_v]])
        end_turn = flip * series.gyro_end[chosen]
        solved = np.linalg.solve(noise, np.column_stack([jacobian, end_turn])).T
        information += solved[:-1] @ jacobian
        groups.append(_Group(turn, move - 3, rows_a, rows_v, jacobian, solved[:-1], solved[-1]))
    return _Weighed(tuple(groups), information)


def _bias_priors(spec: ImuSpec | None) -> tuple[float, float]:
    """Return the 1-sigma of a gyro's and an accelerometer's bias, rad/s and m/s^2."""
    if spec is None:
        return _FREE_GYRO, _FREE_ACCEL
    return max(spec.gyro.bias, _FREE_GYRO), max(spec.accelerometer.bias, _FREE_ACCEL)


def _gains(
    series: _Series, weighed: _Weighed, spec: ImuSpec | None, base_rate: float, carried: Array,
    local: Array, free_latitude: bool,
) -> tuple[Array, Array, Array, Array, Array, Array, Array]:  # fmt: skip
    """Return what a unit of attitude (m, k, 3) and of velocity (m, k, 2) makes of the unknowns.

    Then the same of phi at the end, which the gyros' biases and noise have carried on (best linear
    prediction: what the residuals say of the noise up to the end is part of it); the covariance
    (k, k) of phi_0 and the biases, and of the latitude where it is free; and how all of these, and
    phi at the end, answer to the mean (3,) of the gyro biases' prior, and to a turn of the base.

    Parameters
    ----------
    series : _Series
    weighed : _Weighed
    spec : ImuSpec or None
    base_rate : float
        1-sigma of a steady turn of the base about each axis, rad/s.
    carried : (3, 3) float64
        Turn in i0 at the end for a unit of gyro bias, s.
    local : (3, 3) float64
        C_i0^n in the middle.
    free_latitude : bool
    """
    m, n = series.design.shape[1:]
    information = weighed.information
    prior = np.zeros(n)
    prior[3:9] = np.repeat(1.0 / np.square(_bias_priors(spec)), 3)
    prior[NormalEquations.BASE_RATE] = 1.0 / max(base_rate, _FREE_GYRO) ** 2
    end = np.zeros((3, n))
    end[:, :3], end[:, 3:6] = np.eye(3), -carried
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
