"""The least-squares fits behind a calibration by poses: the forces, and the turns between them."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.units import percent

__all__ = ["FULL", "SIX", "fit_forces", "fit_turns", "force_parts", "weakly_known"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: gyros that still miss gravity by so much after the fit were not understood
_MOST_TURN = 2.0 * DEG
#: the same of the accelerometers: the angle by which such an error tilts a level
_MOST_FORCE = 2.0 * DEG
#: gyros that miss gravity by so much before the fit may have other axes (rms of unit vectors)
_FAR = 0.2

FULL = 10
"""Poses from which on the axes of the accelerometers are found as well."""

SIX = 6
"""Poses that bias and scale need, and turns that the axes of the gyros need."""


def force_parts(x: Array) -> tuple[Array, Array]:
    """Return bias (3,) and matrix (3, 3) of the nine numbers that are fitted."""
    return x[:3], np.array([[x[3], x[4], x[5]], [0.0, x[6], x[7]], [0.0, 0.0, x[8]]])


def fit_forces(
    means: Array, gravity: float, noise: float
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Fit nine numbers to the poses' means; a pose five deviations off is left out.

    Six to nine poses show bias and scale. What is left of them is then no measure of their noise,
    so that of each pose's mean counts as well.
    """
    from scipy.optimize import least_squares

    used = np.ones(len(means), dtype=bool)
    if len(means) < SIX:
        raise InputError(
            f"bias and scale of the accelerometers need six poses or more, each axis up and down, "
            f"and there are {len(means)}; for their axes, ten or more"
        )
    full = len(means) >= FULL
    free = np.arange(9) if full else np.array([0, 1, 2, 3, 6, 8])
    low, high = means.min(axis=0), means.max(axis=0)
    half = 0.5 * (high - low)
    if half.min() < 0.2 * half.max():
        axis = "xyz"[int(np.argmin(half))]
        raise InputError(
            f"the poses hardly turn the {axis} accelerometer: put it up, down and level as well"
        )
    scale = gravity / half
    unit = np.concatenate([half, scale, scale[1:], scale[2:]])[[0, 1, 2, 3, 3, 3, 4, 4, 5]]
    x0 = np.concatenate([0.5 * (high + low), np.diag(scale)[np.triu_indices(3)]])

    def miss(y: Array, rows: Array) -> Array:
        step = np.zeros(9)
        step[free] = y
        bias, matrix = force_parts(x0 + step * unit)
        return np.asarray(np.linalg.norm((rows - bias) @ matrix.T, axis=1) - gravity)

    y = np.zeros(len(free))
    # Of six to nine poses none can be spared.
    for _ in range(6 if full else 0):
        fit = least_squares(miss, y, args=(means[used],), loss="soft_l1", f_scale=2e-4 * gravity)
        y = fit.x
        residual = miss(y, means)
        spread = 1.4826 * float(np.median(np.abs(residual[used])))
        good = np.abs(residual) <= max(5.0 * spread, 1e-9 * gravity)
        if (good == used).all() or good.sum() < FULL:
            break
        used = good
    fit = least_squares(miss, y, args=(means[used],), xtol=1e-14, ftol=1e-14)
    residual = miss(fit.x, means)
    # A fit that leaves out most of what it is made of has found nothing.
    kept = used if 2 * int(used.sum()) > len(means) else np.ones(len(means), dtype=bool)
    rms = float(np.sqrt(np.mean(residual[kept] ** 2)))
    if rms > gravity * np.sin(_MOST_FORCE):
        raise InputError(
            f"the poses miss gravity by {rms:.3g} m/s^2 after the fit, which is no error of an "
            "instrument: check the columns of the accelerometers, and that each pose is at rest"
        )
    information = fit.jac.T @ fit.jac
    values = np.linalg.eigvalsh(information)
    if values[0] < 1e-9 * values[-1]:
        raise InputError(
            f"the poses are too much alike to tell {'nine' if full else 'six'} numbers apart: add "
            "poses with each axis up, down, and half way between"
        )
    dof = int(used.sum()) - len(free)
    # In the force's unit: a pose's mean through the scale.
    own = (noise * float(np.mean(scale))) ** 2
    variance = float(np.sum(residual[used] ** 2)) / dof if dof > 0 else 0.0
    variance = variance if full else max(variance, own)
    cov, step = np.zeros((9, 9)), np.zeros(9)
    cov[np.ix_(free, free)] = np.linalg.inv(information) * variance
    step[free] = fit.x
    return x0 + step * unit, cov * np.outer(unit, unit), used, residual


def weakly_known(
    sigma: Array, matrix: Array, used: NDArray[np.bool_], residual: Array
) -> list[str]:
    """Return what the poses do not show, or only weakly, each in a sentence."""
    out = [
        "a turn of the accelerometers' frame: x is their first axis, and y lies in the plane of "
        "the first two",
        "the gyros' bias apart from the Earth's rate",
    ]
    names = ("scale x", "axes xy", "axes xz", "scale y", "axes yz", "scale z")
    diagonal = np.diag(matrix)[[0, 0, 0, 1, 1, 2]]
    out += [
        f"accelerometer {name}: known to {percent(s)} only"
        for name, s in zip(names, sigma[3:] / diagonal, strict=True)
        if s > 2e-3
    ]
    out += [
        f"pose {k + 1} was left out: it misses gravity by {1e3 * residual[k]:.3g} mm/s^2"
        for k in np.flatnonzero(~used)
    ]
    return out


def fit_turns(
    t: Array, w: Array, dwells: Index, used: NDArray[np.bool_], means: Array, bias: Array,
    matrix: Array, scale: float,
) -> tuple[Array, Array, Array, Array, Array, Array, tuple[str, ...]]:  # fmt: skip
    """Fit the gyros' matrix to the turns between poses; their scale alone to less than six."""
    from scipy.optimize import least_squares

    from schuler.kernels.turns import turned_directions

    up = (means - bias) @ matrix.T
    up /= np.linalg.norm(up, axis=1)[:, None]
    rest = np.array([w[a:b].mean(axis=0) for a, b in dwells])
    kept = np.flatnonzero(used[:-1] & used[1:])
    if len(kept) < 3:
        raise InputError(
            f"the scale of the gyros needs three turns between good poses, got {len(kept)}"
        )
    full = len(kept) >= SIX
    # From the middle of a pose to the middle of the next, so that no motion is missed.
    middle = dwells.sum(axis=1) // 2
    starts, stops = middle[kept], middle[kept + 1]
    zero = 0.5 * (rest[kept] + rest[kept + 1])
    before, after = np.ascontiguousarray(up[kept]), up[kept + 1]
    out = np.empty_like(before)

    def miss(y: Array) -> Array:
        m = scale * (y.reshape(3, 3) if full else np.diag(y) @ start)
        turned_directions(starts, stops, t, w, zero, m, before, out)
        return (out - after).ravel()

    start = np.eye(3)
    first = np.linalg.norm(miss(start.ravel() if full else np.ones(3)).reshape(-1, 3), axis=1)
    remarks: tuple[str, ...] = ()
    if np.sqrt(np.mean(first**2)) > _FAR:

        def off(matrix: Array) -> float:
            turned_directions(starts, stops, t, w, zero, scale * matrix, before, out)
            return float(np.mean(np.sum((out - after) ** 2, axis=1)))

        found = min(_signed_permutations(), key=off)
        if off(found) < 0.1 * off(start):
            start, remarks = found, (_exchanged(found),)
    y = start.ravel() if full else np.ones(3)
    fit = least_squares(miss, y, loss="soft_l1", f_scale=0.01, x_scale=0.1)
    fit = least_squares(miss, fit.x, x_scale=0.1)
    error = fit.fun.reshape(-1, 3)
    rms = float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
    if rms > _MOST_TURN:
        raise InputError(
            f"the gyros miss gravity by {rms / DEG:.3g} deg a turn after the fit, which is no "
            "error of an instrument: check their columns, their unit and the times"
        )
    # Each turn compares two angles: a direction has no third.
    dof = max(2 * len(kept) - len(y), 1)
    cov = np.linalg.pinv(fit.jac.T @ fit.jac) * float(np.sum(error**2)) / dof
    matrix_found = fit.x.reshape(3, 3) if full else np.diag(fit.x) @ start
    if not full:
        # The parts that are not fitted have no covariance.
        wide = np.zeros((9, 9))
        places = np.flatnonzero(start.ravel())
        wide[np.ix_(places, places)] = cov
        cov = wide
    angle = np.arccos(np.clip(np.sum(before * after, axis=1), -1.0, 1.0))
    return (
        scale * matrix_found, scale**2 * cov, angle, np.linalg.norm(error, axis=1), first,
        rest[0], remarks,
    )  # fmt: skip


def _signed_permutations() -> list[Array]:
    """Return the 48 ways in which three axes can be exchanged and reversed."""
    return [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]


def _exchanged(matrix: Array) -> str:
    """Say how the gyros' axes lie in those of the accelerometers."""
    parts = []
    for k in range(3):
        j = int(np.argmax(np.abs(matrix[k])))
        if j != k or matrix[k, j] < 0:
            parts.append(f"{'xyz'[k]} is {'-' if matrix[k, j] < 0 else ''}{'xyz'[j]} of the gyros")
    return (
        f"the gyros' axes are not those of the accelerometers: {', '.join(parts)}; the matrix puts "
        "it right, but check the order and the sign of the columns of both"
    )
