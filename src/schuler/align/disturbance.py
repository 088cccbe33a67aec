"""The disturbance that a record itself shows, and what it does to the attitude.

The velocity that is left when the best (centred) attitude has explained what it can is the
motion of the vehicle and the noise of the instrument. A constant, a ramp and a parabola in it
look like an attitude error, so the fit has swallowed them; the modes above (discrete Legendre
polynomials of order 3 and up, east and north) are free of it. Their powers are fitted by three
shapes, white velocity c, white force b and white rate a, on top of what the specification says
of the noise, and the fit is carried down to the swallowed modes by the same responses that the
instrument's errors go through.

How steeply the powers rise towards the low modes is poorly known from one record, so no single
best fit is taken: the covariance is the posterior mean over a grid of (c, b, a), log-uniform,
with no steep part beyond the level at which it alone would make the lowest modes. On the real
record of the benchmark this gives normalised errors of rms about one, window by window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from schuler.align.history import History, gravity_direction, inertial_to_local
from schuler.align.inertial import Weights, solve
from schuler.align.uncertainty import BLOCKS, Responses, part_covariance
from schuler.earth import Site
from schuler.sensors import ImuSpec

__all__ = ["Residual", "analytic_disturbance", "inertial_disturbance", "noise_ratio", "residual"]

Array = NDArray[np.float64]

FIRST_MODE, LAST_MODE = 3, 24
LOWEST = 6
"""Mode powers (three orders, east and north) that set the scale of the grid."""

_OUTLIER = 16.27
"""Chi-square of three degrees of freedom that one in a thousand exceeds."""

_GRID = tuple(np.logspace(low, high, 11) for low, high in ((-3.0, 0.4), (-4.0, 0.2), (-6.0, 0.0)))


@dataclass(frozen=True, eq=False)
class Residual:
    """What the best attitude leaves of the velocity, in ENU.

    Parameters
    ----------
    t : (m,) float64
        Middle of each stretch, s since the start.
    dt : (m,) float64
        Length of each stretch, s.
    mean : (m, 3) float64
        Mean residual velocity over each stretch, m/s, without its mean over the record.
    instants : (k, 3) float64
        Residual velocity at every instant of the history, m/s, in i0.
    interval : float
        Sampling interval, s.
    """

    t: Array
    dt: Array
    mean: Array
    instants: Array
    interval: float

    @property
    def rms(self) -> Array:
        """Root mean square of the residual velocity, east, north, up, m/s, (3,)."""
        return np.asarray(np.sqrt(np.mean(self.mean**2, axis=0)))


def residual(h: History, site: Site, blocks: int = BLOCKS) -> Residual:
    """Return the residual velocity of the centred fit over a history."""
    g, lat = site.gravity, site.latitude
    r = solve(h, g, lat, "centred")
    thin, _ = h.thin(blocks)
    mean = thin.block_means(slice(9, 12)) @ r.T
    mean -= g * gravity_direction(lat) * thin.block_means(slice(12, 15))
    weight = np.diff(thin.updates)
    offset = weight @ mean / weight.sum()
    t = 0.5 * (thin.t[1:] + thin.t[:-1])
    local = np.einsum("iab,ib->ia", inertial_to_local(t, lat), mean - offset)
    instants = h.velocity @ r.T - h.theory(g, lat) - offset
    return Residual(t, np.diff(thin.t), local, instants, h.duration / max(h.samples, 1))


@lru_cache(maxsize=8)
def _modes(m: int, last: int) -> Array:
    """Return the orthonormal discrete Legendre modes FIRST_MODE to `last`, (m, k)."""
    x = (np.arange(m) + 0.5) * (2.0 / m) - 1.0
    q, _ = np.linalg.qr(np.polynomial.legendre.legvander(x, last))
    return np.asarray(q[:, FIRST_MODE:])


def _integrals(modes: Array, dt: Array, gravity: float) -> tuple[Array, Array]:
    """Return how the modes answer to force and rate increments in each stretch, (m, k) each."""
    once = np.cumsum(modes[::-1], axis=0)[::-1] - 0.5 * modes
    ramp = once * dt[:, None]
    return once, gravity * (np.cumsum(ramp[::-1], axis=0)[::-1] - 0.5 * ramp)


@dataclass(frozen=True, eq=False)
class _Powers:
    """Powers of the modes, east plus north (k,), and what one axis of each shape makes (3, k).

    `known` (k,) is what the specification's noise makes of one axis.
    """

    power: Array
    shapes: Array
    known: Array


def _powers(res: Residual, gravity: float, spec: ImuSpec | None) -> _Powers | None:
    m = len(res.t)
    last = min(LAST_MODE, m // 2)
    if last < FIRST_MODE + 2:
        return None
    modes = _modes(m, last)
    power = np.sum((modes.T @ res.mean[:, :2]) ** 2, axis=1)
    force, rate = _integrals(modes, res.dt, gravity)
    step = res.dt[:, None]
    shapes = np.stack(
        [(modes**2 / step).sum(axis=0), (force**2 * step).sum(axis=0), (rate**2 * step).sum(axis=0)]
    )
    known = np.zeros(len(power))
    if spec is not None:
        for part, response in ((spec.accelerometer, force), (spec.gyro, rate)):
            # Biases stay out: their residual lies in the modes that are left out.
            noise = replace(part, bias=0.0)
            for cov in part_covariance(noise, response[:, :, None], res.dt, res.interval).values():
                known += np.diag(cov)
    return _Powers(power, shapes, known)


def noise_ratio(res: Residual, gravity: float, spec: ImuSpec) -> float | None:
    """Return the power of the residual over that which a specification's noise makes.

    About one for an instrument as specified on a base at rest; its standard deviation is then
    0.2. Far below one, the instrument is better than its specification. None where it cannot be
    told.
    """
    found = _powers(res, gravity, spec)
    if found is None or not np.all(found.known > 0):
        return None
    return float(np.mean(0.5 * found.power / found.known))


def _fit(res: Residual, gravity: float, spec: ImuSpec | None) -> Array:
    """Return the posterior mean of (c, b, a), (3,)."""
    found = _powers(res, gravity, spec)
    if found is None:
        return np.zeros(3)
    power, shapes = found.power, found.shapes
    few = LOWEST // 2
    scale = np.mean(0.5 * power[:few] / shapes[:, :few], axis=1)
    scale[0] = np.mean(0.5 * power / shapes[0])
    if not np.all(scale > 0):
        return np.zeros(3)
    grid = np.stack(
        [a.ravel() for a in np.meshgrid(*(s * g for s, g in zip(scale, _GRID, strict=True)))]
    )
    level = grid.T @ shapes + found.known
    # East and north share a level: two degrees of freedom to a mode.
    log = -(np.log(level) + 0.5 * power / level).sum(axis=1)
    weight = np.exp(log - log.max())
    return np.asarray(grid @ weight / weight.sum())


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


def inertial_disturbance(
    res: Residual, responses: Responses, site: Site, spec: ImuSpec | None
) -> Array:
    """Return the covariance of phi (3, 3), rad^2, that the disturbance in the residual makes."""
    w = responses.weights
    assert w is not None
    c, b, a = _fit(res, site.gravity, spec)
    # The disturbance is horizontal: up does not enter the level axes to first order.
    local = inertial_to_local(responses.t, site.latitude)[:, :2]
    level = np.einsum("iba,ibc->iac", local, local)
    dt = responses.dt
    out = c * np.einsum("iab,ibc,idc,i->ad", w.block, level, w.block, 1.0 / dt)
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
    for columns, v in ((slice(30, 33), responses.gyro[0]), (slice(33, 36), responses.accel[0])):
        scatter: dict[int, Array] = {}
        for parts in (4, 8, 16):
            edges = np.linspace(0.0, h.duration, parts + 1)
            ends = np.column_stack([np.interp(edges, t, x) for x in h.rows[:, columns].T])
            means = np.diff(ends, axis=0) * parts
            scatter[parts] = np.cov(means.T) / parts
        few, many = np.trace(scatter[4]), np.trace(scatter[16])
        # White rates: the same for any number of parts; bounded angles: as their number.
        slope = float(np.clip(np.log(max(many, 1e-300) / max(few, 1e-300)) / np.log(4.0), 0.0, 1.0))
        s = c_nb @ (scatter[8] * 8.0**-slope) @ c_nb.T
        out += v @ s @ v.T
    return out
