"""Two series of vectors that one rotation maps into another: body's side and Earth's side.

Velocity: y = v in i0 less the integral of gravitation, x = integral of the force in ib0 and the
lever arm's velocity. Position: once more integrated. Body velocity: its rotated value belongs to
the body's side, and only gravitation and the Earth's rotation are left on the other.

y = C x + c (and c1 t for positions): what is unknown of the start is taken out of both series.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes
from schuler.attitude import skew
from schuler.earth import Site
from schuler.errors import InputError
from schuler.in_motion.body import BodyRows
from schuler.in_motion.earth_side import (
    earth_fixed,
    gravitation_integrals,
    inertial_velocity,
    local_axes,
    spun,
)

__all__ = ["Series", "body_velocity_series", "position_series", "velocity_series"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Series:
    """y (n, 3) in i0 and x (n, 3) in ib0, with what is not exact about them.

    Parameters
    ----------
    form : {"velocity", "position", "body velocity"}
    rows : BodyRows
    y, x : (n, 3) float64
        m/s, or m for positions.
    noise : (n, 3, 3) float64
        Covariance of the measurement in i0; for body velocity isotropic.
    nuisance : (n, q) float64
        Functions of time that are unknown: 1, and t for positions.
    by_turn : (n, 3, 3), (n, 3, 3) float64
        What x becomes by a gyro bias and by an accelerometer bias, ib0.
    slope : (n, 3) float64
        How x changes with time, for a delay.
    """

    form: str
    rows: BodyRows
    y: Array
    x: Array
    noise: Array
    nuisance: Array
    by_gyro: Array
    by_accelerometer: Array
    slope: Array

    def __len__(self) -> int:
        return len(self.y)

    @property
    def t(self) -> Array:
        """Instants, s since the start of the pass, (n,)."""
        return np.asarray(self.rows.time - self.rows.start)

    def between(self, first: int, last: int) -> Series:
        """Return rows first to last (as a slice); sums go on from the same start."""
        s = slice(first, last)
        rows = self.rows.pick(s)
        cut = {
            name: getattr(self, name)[s]
            for name in (
                "y", "x", "noise", "nuisance", "by_gyro", "by_accelerometer", "slope",
            )
        }  # fmt: skip
        return replace(self, rows=rows, **cut)


def _crosses(vectors: Array) -> Array:
    """Return matrices [v x] (n, 3, 3)."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    return np.stack(
        [np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], axis=-2
    )


def _with_start(rows: Array) -> Array:
    return np.concatenate([np.zeros((1, *rows.shape[1:])), rows])


def bias_effects(rows: BodyRows, lever: Array, once: bool) -> tuple[Array, Array]:
    """Return what a gyro and an accelerometer bias make of x, (n, 3, 3) each.

    A gyro bias eps turns ib0 by psi = -integral of C eps; the force's integral changes by that of
    [C f x] psi. Between rows C f is taken as it is on average.

    Parameters
    ----------
    rows : BodyRows
    lever : (3,) float64
        Of the point, body axes, m.
    once : bool
        Whether the force is integrated once, and not twice.
    """
    t = _with_start(rows.time - rows.start)
    turn, velocity, way = (_with_start(a) for a in (rows.turn, rows.velocity, rows.way))
    middle = 0.5 * (t[1:] + t[:-1])
    step = np.diff(turn, axis=0)
    psi = -turn[1:]
    mean_v = 0.5 * (velocity[1:] + velocity[:-1])
    first = np.cumsum(_crosses(mean_v) @ -step, axis=0)
    if once:
        arm = rows.turned(np.cross(rows.rate, lever))
        gyro = _crosses(rows.velocity + arm) @ psi - first - rows.mat_ib0_b @ skew(lever)
        return gyro, rows.turn
    mean_r = 0.5 * (way[1:] + way[:-1])
    arm = rows.turned(lever)
    moments = np.cumsum((middle[:, None, None] * _crosses(mean_v) - _crosses(mean_r)) @ -step, 0)
    last = t[1:, None, None]
    gyro = _crosses(rows.way + arm) @ psi - last * first + moments
    force = np.cumsum(step, axis=0) * last - np.cumsum(middle[:, None, None] * step, axis=0)
    return gyro, force


def _earth_path(fixes: GnssFixes, t: Array) -> tuple[Array, Array, Array]:
    """Return Earth-fixed places, velocities over ground, and mat_en, of the antenna."""
    lat, lon, height = (np.asarray(a, np.float64) for a in (fixes.lat, fixes.lon, fixes.height))
    r_e, axes = earth_fixed(lat, lon, height), local_axes(lat, lon)
    if fixes.v_n is not None:
        return r_e, np.einsum("iab,ib->ia", axes, np.asarray(fixes.v_n)), axes
    return r_e, np.gradient(r_e, t, axis=0), axes


def _noise(sigma: Array, axes: Array, t: Array) -> Array:
    """Return the covariance (n, 3, 3) in i0 of noise along East-North-Up."""
    root = spun(t[:, None], np.swapaxes(axes * sigma[:, None, :], 1, 2))
    return np.asarray(np.swapaxes(root, 1, 2) @ root)


def velocity_series(rows: BodyRows, fixes: GnssFixes) -> Series:
    """Return the series of GNSS velocities; rows are at the instants of the fixes.

    Raises
    ------
    InputError
        If the fixes have no velocity.
    """
    if fixes.v_n is None:
        raise InputError(f"{fixes.name}: these fixes have no velocity: use their positions")
    t = rows.time - rows.start
    r_e, v_e, axes = _earth_path(fixes, t)
    single, _ = gravitation_integrals(t, r_e, v_e)
    lever = np.asarray(fixes.lever, np.float64)
    x = rows.velocity + rows.turned(np.cross(rows.rate, lever))
    gyro, accel = bias_effects(rows, lever, True)
    return Series(
        "velocity", rows, inertial_velocity(t, r_e, v_e) - single, x,
        _noise(np.asarray(fixes.v_sigma), axes, t), np.ones((len(t), 1)), gyro, accel,
        np.gradient(rows.velocity, t, axis=0),
    )  # fmt: skip


def position_series(rows: BodyRows, fixes: GnssFixes) -> Series:
    """Return the series of GNSS positions; velocities of the fixes are not used."""
    t = rows.time - rows.start
    r_e, v_e, axes = _earth_path(replace(fixes, v_n=None), t)
    _, double = gravitation_integrals(t, r_e, v_e)
    lever = np.asarray(fixes.lever, np.float64)
    gyro, accel = bias_effects(rows, lever, False)
    r_i = spun(t, r_e)
    return Series(
        "position", rows, r_i - r_i[0] - double, rows.way + rows.turned(lever),
        _noise(np.asarray(fixes.sigma), axes, t), np.column_stack([np.ones_like(t), t]),
        gyro, accel, rows.velocity,
    )  # fmt: skip


def body_velocity_series(
    rows: BodyRows, speed: BodySpeed, site: Site, attitude: Array | None = None
) -> Series:
    """Return the series of velocities in body axes; rows are at their instants.

    Parameters
    ----------
    rows : BodyRows
    speed : BodySpeed
        Of a vehicle on wheels when it has one number: then it moves neither sideways nor up.
    site : Site
        Where the vehicle is at the first row.
    attitude : (3, 3) float64, optional
        mat_i0_ib0, where it is known roughly: carries the place along the path.
    """
    t = rows.time - rows.start
    value, _ = speed.triples()
    lever = np.asarray(speed.lever, np.float64)
    v_b = value - np.cross(rows.rate, lever)
    turned = rows.turned(v_b)
    start = earth_fixed(*(np.array([a]) for a in (site.latitude, site.longitude, site.height)))
    r_e, v_e = np.repeat(start, len(t), axis=0), np.zeros((len(t), 3))
    if attitude is not None:
        v_e = spun(-t, turned @ attitude.T)
        dt = np.diff(t)[:, None]
        r_e = r_e + _with_start(np.cumsum(0.5 * (v_e[1:] + v_e[:-1]) * dt, axis=0))
    single, _ = gravitation_integrals(t, r_e, v_e)
    gyro, accel = bias_effects(rows, np.zeros(3), True)
    # The velocity that is rotated turns with ib0, too; it is no integral of the force.
    gyro = gyro + _crosses(turned) @ rows.turn
    noise = np.broadcast_to(speed.sigma**2 * np.eye(3), (len(t), 3, 3))
    return Series(
        "body velocity", rows, inertial_velocity(t, r_e, np.zeros((len(t), 3))) - single,
        rows.velocity - turned, noise, np.ones((len(t), 1)), gyro, accel, np.zeros((len(t), 3)),
    )  # fmt: skip
