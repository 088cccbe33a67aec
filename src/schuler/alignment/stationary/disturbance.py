"""The disturbance that a record itself shows, and what it does to the attitude.

The velocity that is left when the best (centred) attitude has explained what it can is the
motion of the vehicle and the noise of the instrument. A constant, a ramp and a parabola in it
look like an attitude error, so the fit has swallowed them; the modes above (discrete Legendre
polynomials of order 3 and up, east and north) are free of it. Their powers are fitted by four
shapes, white displacement d, velocity c, force b and rate a, on top of what the specification says
of the noise, and the fit is carried down to the swallowed modes by the same responses that the
instrument's errors go through.

`Levels` says how strong each shape is; the covariance follows from the levels by the responses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.stationary.inertial import Residual, Weights
from schuler.alignment.stationary.series_noise import rounded_lengths
from schuler.alignment.stationary.uncertainty import Responses, part_covariance
from schuler.earth import Site
from schuler.kernels.levels import AXES, PAD, weigh_levels
from schuler.sensors import ImuSpec

__all__ = [
    "TURN_PRIORS",
    "LevelPrior",
    "Levels",
    "analytic_disturbance",
    "angle_powers",
    "disturbance_levels",
    "inertial_disturbance",
    "noise_ratio",
    "posterior",
    "velocity_levels",
    "velocity_powers",
]

Array = NDArray[np.float64]

FIRST_MODE, LAST_MODE = 3, 24

_OUTLIER = 16.27
"""Chi-square of three degrees of freedom that one in a thousand exceeds."""


@lru_cache(maxsize=8)
def _modes(m: int, last: int, first: int = FIRST_MODE) -> Array:
    """Return the orthonormal discrete Legendre modes `first` to `last`, (m, k)."""
    x = (np.arange(m) + 0.5) * (2.0 / m) - 1.0
    q, _ = np.linalg.qr(np.polynomial.legendre.legvander(x, last))
    return np.asarray(q[:, first:])


def _integrals(modes: Array, dt: Array, gravity: float) -> tuple[Array, Array]:
    """Return how the modes answer to force and rate increments in each stretch, (m, k) each."""
    once = np.cumsum(modes[::-1], axis=0)[::-1] - 0.5 * modes
    ramp = once * dt[:, None]
    return once, gravity * (np.cumsum(ramp[::-1], axis=0)[::-1] - 0.5 * ramp)


def velocity_powers(
    velocity: Array, dt: Array, interval: float, gravity: float, spec: ImuSpec | None,
    spans: tuple[tuple[int, int], ...] = (),
) -> tuple[Array, Array, Array] | None:  # fmt: skip
    """Return powers, shapes and known part of the modes of a residual velocity.

    Parameters
    ----------
    velocity : (m, 2) float64
        Mean over each stretch, east and north, m/s.
    dt : (m,) float64
        Length of each stretch, s.
    interval : float
        Sampling interval, s.
    gravity : float
        m/s^2.
    spec : ImuSpec or None
    spans : tuple of (int, int)
        Stretches [begin, end) that are looked at each for itself; all together where there are
        none.

    Returns
    -------
    (k,), (4, k), (k,) float64, or None
        Powers, east plus north; what a unit of white displacement, velocity, force and rate makes
        of one axis; what the specification's noise makes of one axis. None for a record without
        enough stretches.
    """
    parts = [
        _powers(velocity[i:j], dt[i:j], interval, gravity, spec)
        for i, j in spans or ((0, len(dt)),)
        if j - i >= 2 * (FIRST_MODE + 2)
    ]
    if not parts:
        return None
    power, shapes, known = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
    return power, shapes, known


def _powers(
    velocity: Array, dt: Array, interval: float, gravity: float, spec: ImuSpec | None
) -> tuple[Array, Array, Array]:
    modes, shapes, known = _velocity_shapes(rounded_lengths(dt), round(interval, 12), gravity, spec)
    return np.sum((modes.T @ velocity) ** 2, axis=1), shapes, known


@lru_cache(maxsize=16)
def _velocity_shapes(
    lengths: bytes, interval: float, gravity: float, spec: ImuSpec | None
) -> tuple[Array, Array, Array]:
    """Return modes, shapes and known part of `velocity_powers` for lengths of stretches."""
    dt = np.frombuffer(lengths)
    m = len(dt)
    modes = _modes(m, min(LAST_MODE, m // 2))
    force, rate = _integrals(modes, dt, gravity)
    step = dt[:, None]
    # A bounded displacement is in the mean velocity over a stretch with its change there.
    change = np.diff(modes / step, axis=0, prepend=0.0, append=0.0)
    shapes = np.stack(
        [
            (change**2).sum(axis=0),
            (modes**2 / step).sum(axis=0),
            (force**2 * step).sum(axis=0),
            (rate**2 * step).sum(axis=0),
        ]
    )
    known = np.zeros(modes.shape[1])
    if spec is not None:
        for part, response in ((spec.accelerometer, force), (spec.gyro, rate)):
            # Biases stay out: their residual lies in the modes that are left out.
            noise = replace(part, bias=0.0)
            for cov in part_covariance(noise, response[:, :, None], dt, interval).values():
                known += np.diag(cov)
    shapes.flags.writeable = known.flags.writeable = False
    return modes, shapes, known


def noise_ratio(res: Residual, gravity: float, spec: ImuSpec) -> float | None:
    """Return the power of the residual over that which a specification's noise makes.

    About one for an instrument as specified on a base at rest; its standard deviation is then
    0.2. Far below one, the instrument is better than its specification. None where it cannot be
    told.
    """
    found = velocity_powers(res.mean[:, :2], res.dt, res.interval, gravity, spec)
    if found is None or not np.all(found[2] > 0):
        return None
    return float(np.mean(0.5 * found[0] / found[2]))


def disturbance_levels(
    res: Residual, gravity: float, spec: ImuSpec | None, sampling_faults: bool
) -> Levels:
    """Return the levels of white displacement, velocity, force and rate in a residual.

    Parameters
    ----------
    res : Residual
    gravity : float
        m/s^2.
    spec : ImuSpec or None
    sampling_faults : bool
        Of the history (`History.sampling_faults`).
    """
    found = velocity_powers(res.mean[:, :2], res.dt, res.interval, gravity, spec)
    return velocity_levels(found, spec is not None and not sampling_faults)


def angle_powers(angle: Array, dt: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Return powers, shapes and known part of the modes of a base's turn about one axis.

    A constant and a slope are left out: attitude and heading look like that. The shapes are a
    bounded turn (white angle) and a wandering one (white rate).

    Parameters
    ----------
    angle : (m,) float64
        Mean turn over each stretch, rad.
    dt : (m,) float64
        s.
    noise : (m, m) float64
        Covariance that the gyros' noise makes.
    """
    modes, shapes = _angle_shapes(rounded_lengths(dt))
    known = np.sum(modes * (noise @ modes), axis=0)
    return (modes.T @ angle) ** 2, shapes, known


@lru_cache(maxsize=16)
def _angle_shapes(lengths: bytes) -> tuple[Array, Array]:
    """Return modes and shapes of `angle_powers` for lengths of stretches."""
    dt = np.frombuffer(lengths)
    m = len(dt)
    modes = _modes(m, min(LAST_MODE, m // 2), 2)
    once, _ = _integrals(modes, dt, 1.0)
    step = dt[:, None]
    shapes = np.stack([(modes**2 / step).sum(axis=0), (once**2 * step).sum(axis=0)])
    shapes.flags.writeable = False
    return modes, shapes


def _at_points(w: Weights, instants: Array) -> Array:
    """Return the covariance from the weights on single instants, by the autocovariance.

    Where the residual at those very instants is beyond what the rest of the record makes likely
    (a jolt at the start), the shift that it makes is added as it is.
    """
    rows, point = w.rows, w.point.copy()
    # v is zero at the start whatever the motion was then: its residual there is an offset.
    point[0] -= w.point.sum(axis=0) + w.block.sum(axis=0)
    if np.abs(point).max() < 1e-9 * np.abs(w.block).max(initial=0.0):
        return np.zeros((3, 3))
    out = np.zeros((3, 3))
    e = instants[1:] - instants[1:].mean(axis=0)
    for i, at_i in zip(rows, point, strict=True):
        for j, at_j in zip(rows, point, strict=True):
            lag = min(abs(int(j - i)), len(e) - 1)
            s = e[: len(e) - lag].T @ e[lag:] / len(e)
            out += at_i @ (s if j >= i else s.T) @ at_j.T
    shift = np.einsum("iab,ib->a", point, instants[rows])
    if shift @ np.linalg.lstsq(out, shift, rcond=None)[0] > _OUTLIER:
        out += np.outer(shift, shift)
    return out


def inertial_disturbance(res: Residual, levels: Levels, responses: Responses, site: Site) -> Array:
    """Return the covariance of phi (3, 3), rad^2, that the disturbance in the residual makes."""
    w = responses.weights
    assert w is not None
    d, c, b, a = levels.mean
    # The disturbance is horizontal: up does not enter the level axes to first order.
    local = inertial_to_local(responses.t, site.latitude)[:, :2]
    level = np.einsum("iba,ibc->iac", local, local)
    dt = responses.dt
    out = c * np.einsum("iab,ibc,idc,i->ad", w.block, level, w.block, 1.0 / dt)
    change = np.diff(w.block / dt[:, None, None], axis=0, prepend=0.0, append=0.0)
    # At an instant between two stretches the level axes are those of either.
    level = np.concatenate([level, level[-1:]])
    out += d * np.einsum("iab,ibc,idc->ad", change, level, change)
    level = level[:-1]
    out += b * np.einsum("iab,ibc,idc,i->ad", responses.accel, level, responses.accel, dt)
    out += a * np.einsum("iab,idb,i->ad", responses.gyro, responses.gyro, dt)
    return np.asarray(out + _at_points(w, res.instants))


def analytic_disturbance(h: History, c_nb: Array, responses: Responses) -> Array:
    """Return the covariance of phi (3, 3), rad^2, from the scatter of the means over parts.

    A mean over the record is off by what it would be between records like it. That is read off
    the means over its eighths and, as a bounded motion averages out faster than a random walk,
    carried from eighths to the whole by the slope between quarters and sixteenths.
    """
    out = np.zeros((3, 3))
    t = h.t
    sums = h.nodes
    for total, v in ((sums.sum_dtheta, responses.gyro[0]), (sums.sum_dvel, responses.accel[0])):
        scatter: dict[int, Array] = {}
        for parts in (4, 8, 16):
            edges = np.linspace(0.0, h.duration, parts + 1)
            ends = np.column_stack([np.interp(edges, t, x) for x in total.T])
            means = np.diff(ends, axis=0) * parts
            scatter[parts] = np.cov(means.T) / parts
        few, many = np.trace(scatter[4]), np.trace(scatter[16])
        # White rates: the same for any number of parts; bounded angles: as their number.
        slope = float(np.clip(np.log(max(many, 1e-300) / max(few, 1e-300)) / np.log(4.0), 0.0, 1.0))
        s = c_nb @ (scatter[8] * 8.0**-slope) @ c_nb.T
        out += v @ s @ v.T
    return out


LOWEST = 6
"""Mode powers (three orders, east and north) that set the scale of the grid."""


@dataclass(frozen=True, eq=False)
class LevelPrior:
    """Levels of a shape that are tried, over the level at which it alone makes the powers.

    Parameters
    ----------
    tried : (n,) float64
    lowest : bool
        Whether it is to make the lowest modes alone, as a steep one does, or all.
    """

    tried: Array
    lowest: bool

    def levels(self, share: Array, shape: Array) -> Array:
        """Return the levels to try for the powers of one axis, (n,)."""
        few = LOWEST // 2 if self.lowest else len(share)
        return np.asarray(np.mean(share[:few] / shape[:few]) * self.tried)


_FLAT = LevelPrior(np.logspace(-3.0, 0.4, 9), lowest=False)
_STEEP = LevelPrior(np.logspace(-4.0, 0.05, 9), lowest=True)
_STEEPEST = LevelPrior(np.logspace(-6.0, -0.15, 9), lowest=True)
_STEEP_BESIDE_SPECIFIED = LevelPrior(np.logspace(-4.0, -0.5, 9), lowest=True)

_UNSPECIFIED = (_FLAT, _FLAT, _STEEP, _STEEPEST)
"""Of white displacement, velocity, force and rate."""
_SPECIFIED = (_FLAT, _FLAT, _STEEP_BESIDE_SPECIFIED)
"""Of white displacement, velocity and force."""
_BEYOND_SPECIFIED = 2.0
"""Log likelihood by which steeper shapes must be better to be more than the specification.

Gyros that are noisier than specified, or turn the force the wrong way, show so.
"""

TURN_PRIORS = (_STEEP, _STEEPEST)
"""Of a bounded turn and a wandering one (`angle_powers`)."""


@dataclass(frozen=True, eq=False)
class Levels:
    """How strong a disturbance is.

    Parameters
    ----------
    mean : (s,) float64
        Posterior mean, for the uncertainty.
    likely : (s,) float64
        For weights: nothing where no disturbance is the likelier reading, else the mean.
    log : float
        Logarithm of the greatest likelihood.
    """

    mean: Array
    likely: Array
    log: float = 0.0


def posterior(
    power: Array, shapes: Array, known: Array, priors: tuple[LevelPrior, ...], freedom: int = 1
) -> Levels:
    """Return the levels of shapes whose sum with `known` makes the powers.

    Half of the prior says that there is nothing but what is known; the other half is spread
    log-uniformly over levels up to that at which a shape alone makes the powers.

    Parameters
    ----------
    power : (k,) float64
        Power of each mode, the sum of `freedom` independent squares.
    shapes : (s, k) float64
        What a unit of each level makes of one square.
    known : (k,) float64
        What is there anyway.
    priors : (s,) tuple
        What is tried of each level.
    freedom : int
        Degrees of freedom of a power.
    """
    share = power / freedom
    nothing = np.zeros(len(shapes))
    # About one, whatever the unit: the kernel multiplies variances.
    unit = float(share.mean())
    tried = [prior.levels(share, shape) for prior, shape in zip(priors, shapes, strict=True)]
    if not all(np.all(axis > 0) for axis in tried):
        return Levels(nothing, nothing)
    axes = np.zeros((AXES, max(map(len, tried))))
    counts = np.ones(AXES, np.int64)
    modes = len(share)
    every = np.zeros((AXES, -(-modes // PAD) * PAD))
    of_share, of_known = np.zeros(every.shape[1]), np.ones(every.shape[1])
    of_share[:modes], of_known[:modes] = share / unit, known / unit
    for k, axis in enumerate(tried, AXES - len(tried)):
        axes[k, : len(axis)], counts[k] = axis, len(axis)
    every[AXES - len(tried) :, :modes] = shapes / unit
    out = np.zeros(2 + AXES)
    out[0] = freedom
    points = int(counts.prod())
    weigh_levels(
        of_share, every, of_known, axes, counts, np.empty_like(every), np.empty(points), out
    )
    shift = 0.5 * freedom * modes * np.log(unit)
    best, mean = float(out[0] - shift), out[2 + AXES - len(tried) :].copy()
    if not np.all(known > 0):
        return Levels(mean, mean, best)
    alone = -0.5 * freedom * float(np.sum(share / known + np.log(known)))
    odds = np.exp(min(alone - best, 700.0)) / (out[1] / points)
    mean = mean / (1.0 + odds)
    return Levels(mean, nothing if odds > 1.0 else mean, best)


def velocity_levels(found: tuple[Array, Array, Array] | None, specified: bool) -> Levels:
    """Return the levels of white displacement, velocity, force and rate of `velocity_powers`.

    Parameters
    ----------
    found : tuple, or None
    specified : bool
        Whether the instrument's noise is that of a specification, in samples as they came: what
        is interpolated over lost samples has an error of its own.
    """
    if found is None:
        return Levels(np.zeros(4), np.zeros(4))
    power, shapes, known = found
    # East and north share a level: two degrees of freedom to a mode.
    levels = posterior(power, shapes, known, _UNSPECIFIED, freedom=2)
    if not specified:
        return levels
    # Weights that are made for too steep a disturbance cost little, for too flat a one much.
    few = len(_SPECIFIED)
    held = posterior(power, shapes[:few], known, _SPECIFIED, freedom=2)
    if levels.log > held.log + _BEYOND_SPECIFIED:
        return levels
    return Levels(np.append(held.mean, np.zeros(len(shapes) - few)), levels.likely)
