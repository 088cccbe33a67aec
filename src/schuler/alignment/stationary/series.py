"""The two series of the optimal estimate: how they answer to the unknowns, and their noise.

Means over stretches of the velocity that the force makes in the held frame, and of the tracked
attitude; both linear in the unknowns of `schuler.alignment.stationary.gains`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, Rows, gravity_direction
from schuler.alignment.stationary.disturbance import TURN_PRIORS, Levels, angle_powers, posterior
from schuler.alignment.stationary.series_noise import specified_noise, white_noise
from schuler.attitude import multiply, nearest_quat, quat_to_rotvec, skew
from schuler.constants import DEG
from schuler.earth import Site
from schuler.kernels.states import TrackerNode
from schuler.sensors import ImuSpec

__all__ = ["Series", "make_series", "turns_from_middle", "with_tests"]

Array = NDArray[np.float64]

LARGEST = 0.05
"""Turn of the base (rad) within a dwell beyond which its attitude is not taken for a constant."""


@dataclass(frozen=True, eq=False)
class Series:
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


def turns_from_middle(
    q: Array, r: Array, local: Array, dwells: tuple[tuple[int, int], ...]
) -> Array:
    """Return the turn (m, 3) from the middle attitude of each dwell, east, north, up, rad.

    Parameters
    ----------
    q : (m, 4) float64
        quat_bi0 over each stretch.
    r : (3, 3) float64
        C_ib0^i0.
    local : (m, 4) float64
        quat_i0n.
    dwells : tuple of (int, int)
    """
    attitude = multiply(multiply(local, nearest_quat(r)), q)
    out = np.zeros((len(q), 3))
    for begin, end in dwells:
        back = attitude[(begin + end) // 2] * [1.0, -1.0, -1.0, -1.0]
        part = attitude[begin:end]
        out[begin:end] = quat_to_rotvec(multiply(part, np.broadcast_to(back, part.shape)))
    return out


def make_series(
    h: History, site: Site, spec: ImuSpec | None, levels: Levels, local: Array, attitude: Array,
    turns: Array, dwells: tuple[tuple[int, int], ...],
) -> Series:  # fmt: skip
    """Return how both series answer to the unknowns, and their noise.

    Parameters
    ----------
    h : History
        Thinned to m stretches.
    site : Site
    spec : ImuSpec or None
    levels : Levels
        Of the motion in the velocity.
    local, attitude : (m, 3, 3) float64
        C_i0^n and C_b^i0 over each stretch.
    turns : (m, 3) float64
        Of the base from the middle attitude of its dwell, east, north, up, rad.
    dwells : tuple of (int, int)
        Stretches [begin, end) in which the unit was not turned.
    """
    g, lat = site.gravity, site.latitude
    dt = np.diff(h.t)
    m = len(dt)
    interval = h.duration / max(h.samples, 1)
    # Means over a stretch are those at the ends of its updates, as the sums are.
    once = np.tril(np.ones((m, m)), -1) + np.diag(h.mean_shares())
    wander, unit = white_noise(dt, g)

    # What the vehicle's motion and the instrument make of the series.
    d, c, b, a = levels.likely
    force = b * wander
    flat = force.reshape(-1)
    flat[:: m + 1] += 2.0 * d / dt**2 + c / dt
    # White displacement is differenced: neighbours share an end.
    flat[1 :: m + 1] -= d / (dt[1:] * dt[:-1])
    flat[m :: m + 1] -= d / (dt[1:] * dt[:-1])
    gyro = a * unit
    if spec is not None:
        specified = specified_noise(dt, interval, g, spec)
        force += specified[0]
        gyro += specified[1]

    # Dwells whose attitude is steady enough to say something.
    steady = [d for d in dwells if d[1] - d[0] > 8 and np.abs(turns[d[0] : d[1]]).max() < LARGEST]
    sway = np.zeros((2, 3, m, m))
    levels_of_sway = np.zeros((3, 2))
    for axis in range(3) if steady else ():
        parts = [angle_powers(turns[i:j, axis], dt[i:j], gyro[i:j, i:j]) for i, j in steady]
        power, shapes, known = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
        level = posterior(power, shapes, known, TURN_PRIORS)
        levels_of_sway[axis] = level.mean
        for k, (white, walking) in enumerate((level.likely, level.mean)):
            sway[k, axis] = np.diag(white / dt) + walking * wander

    theta = _propagated(once, attitude * dt[:, None, None])
    # A turned frame takes the force with it: theta x f.
    tilt_effect = _propagated(once, -skew(np.diff(h.theory(g, lat), axis=0)) @ theta)
    theory = g * gravity_direction(lat) * h.block_means(TrackerNode.sum_gravity)
    design = np.zeros((5, m, _COLUMNS + 3 * len(dwells)))
    level_axes = local[:, :2]
    design[:3, :, :3] = -local.transpose(1, 0, 2)
    design[:3, :, 3:6] = (local @ theta).transpose(1, 0, 2)
    for k, (begin, end) in enumerate(dwells):
        for axis in range(3):
            design[axis, begin:end, _COLUMNS + 3 * k + axis] = 1.0
    design[3:, :, :3] = (level_axes @ skew(theory)).transpose(1, 0, 2)
    design[3:, :, 3:6] = (level_axes @ tilt_effect).transpose(1, 0, 2)
    design[3:, :, 6:9] = (level_axes @ theta).transpose(1, 0, 2)
    design[3:, :, 9:11] = (level_axes @ local[m // 2].T[:, :2]).transpose(1, 0, 2)
    none = np.zeros(0, np.int64)
    return Series(
        design, gyro[:-1, :-1], gyro[:-1, -1], force, sway[0], sway[1], levels_of_sway,
        np.concatenate([none, *(np.arange(i, j) for i, j in steady)]),
        np.concatenate([none, *(np.arange(i, j) for i, j in dwells)]) if dwells else np.arange(m),
    )  # fmt: skip


def _propagated(once: Array, steps: Array) -> Array:
    """Return the mean over each stretch of the running sum of steps (m, 3, 3)."""
    return np.asarray((once @ steps.reshape(len(steps), 9)).reshape(steps.shape))


def with_tests(
    series: Series, h: History, site: Site, local: Array, dwells: tuple[tuple[int, int], ...]
) -> Series:
    """Return the series with columns for the latitude and for a steady turn of the base."""
    step = 1e-5
    sides = []
    for sign in (-1.0, 1.0):
        there = replace(site, lat=(site.latitude + sign * step) / DEG)
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
