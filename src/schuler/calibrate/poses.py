"""Calibration by hand: an instrument put down in many poses, no turntable.

In every pose the calibrated force has the length of gravity, which shows bias, scale and axes of
the accelerometers (nine numbers); between poses the gyros must turn gravity from where it was seen
to where it is seen (nine numbers). Source: Tedaldi, Pretto and Menegatti (2014), A robust and easy
to implement method for IMU calibration without external equipments, ICRA.

What poses cannot show: a turn of the accelerometers' own frame (x is the first axis, y lies in the
plane of the first two), and the gyros' bias apart from the Earth's rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.calibrate.apply import Calibration
from schuler.constants import STANDARD_GRAVITY
from schuler.errors import InputError

__all__ = ["PosesFit", "calibrate_poses", "find_dwells"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class PosesFit:
    """What hand-held poses tell.

    Parameters
    ----------
    calibration : Calibration
    dwells : (m, 2) int64
        First sample of each pose and the one after its last.
    used : (m,) bool
        False: a bad pose, left out.
    residual : (m,) float64
        |f| - gravity of each pose, m/s^2.
    accel_covariance, gyro_covariance : (9, 9) float64
        Of bias and the six of the matrix (rows: 00, 01, 02, 11, 12, 22), and of the gyros' matrix
        by rows; NaN without gyros.
    turn_angle, turn_error : (k,) float64
        Angle between gravity before and after a turn, and what the gyros miss it by, rad.
    turn_error_before : (k,) float64
        The same with the gyros' given scale.
    unseen : list of str
        What these poses do not show, or only weakly.
    gravity : float
        m/s^2.
    """

    calibration: Calibration
    dwells: Index
    used: NDArray[np.bool_]
    residual: Array
    accel_covariance: Array
    gyro_covariance: Array
    turn_angle: Array
    turn_error: Array
    turn_error_before: Array
    unseen: list[str]
    gravity: float

    @property
    def rms(self) -> float:
        """Root mean square of |f| - gravity over the poses used, m/s^2."""
        return float(np.sqrt(np.mean(self.residual[self.used] ** 2)))


def find_dwells(
    time: ArrayLike, accel: ArrayLike, gyro: ArrayLike | None = None, *, window: float = 1.0,
    initial: float = 10.0, factor: float = 5.0, shortest: float = 2.0,
) -> Index:  # fmt: skip
    """Find when an instrument lies still: the variance over a window stays small.

    Parameters
    ----------
    time : (n,) array_like
        s.
    accel : (n, 3) array_like
        In any unit.
    gyro : (n, 3) array_like, optional
        In any unit; a turn about the vertical is seen by the gyros only.
    window : float
        Length of the moving variance, s.
    initial : float
        The instrument is known to lie still for so long at the start, s.
    factor : float
        So many times the deviation of then is still rest.
    shortest : float
        A dwell lasts so long at least, s.

    Returns
    -------
    (m, 2) int64
        First sample of each dwell, and the one after its last.

    Raises
    ------
    InputError
        If the record is too short, or does not begin at rest.
    """
    t, f = np.asarray(time, np.float64), np.asarray(accel, np.float64)
    step = float(np.median(np.diff(t))) if len(t) > 2 else np.inf
    half = max(1, round(0.5 * window / step)) if np.isfinite(step) and step > 0 else 0
    if half == 0 or t[-1] - t[0] < initial + shortest:
        raise InputError(
            f"the record is too short to find poses: it needs {initial:g} s of rest and a pose more"
        )
    a = np.clip(np.arange(len(t)) - half, 0, None)
    b = np.clip(np.arange(len(t)) + half + 1, None, len(t))
    begin = t - t[0] < initial
    still = np.ones(len(t), dtype=bool)
    for x in (f,) if gyro is None else (f, np.asarray(gyro, np.float64)):
        centred = x - x[begin].mean(axis=0)
        sums = np.vstack([np.zeros((1, 3)), np.cumsum(centred, axis=0)])
        squares = np.vstack([np.zeros((1, 3)), np.cumsum(centred**2, axis=0)])
        n = (b - a)[:, None]
        mean = (sums[b] - sums[a]) / n
        variance = np.sum((squares[b] - squares[a]) / n - mean**2, axis=1)
        rest = max(float(np.median(variance[begin])), np.finfo(float).tiny)
        still &= variance < factor**2 * rest
        if x is not f:
            # A steady turn about the vertical moves no force, and has no variance.
            still &= np.sum(mean**2, axis=1) < factor**2 * rest
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.view(np.int8), [0]])))
    dwells = edges.reshape(-1, 2)
    # The window reaches over the edges: still there means still half a window further.
    long_enough = t[dwells[:, 1] - 1] - t[dwells[:, 0]] >= shortest
    found = dwells[long_enough]
    if not len(found) or found[0, 0] > half:
        raise InputError(
            f"the record does not begin with {initial:g} s of rest, by which the poses are found"
        )
    return found.astype(np.int64)


def calibrate_poses(
    time: ArrayLike, accel: ArrayLike, gyro: ArrayLike | None = None, *,
    gravity: float = STANDARD_GRAVITY, gyro_scale: float = 1.0, dwells: Index | None = None,
    initial: float = 10.0, counts: bool = False, name: str = "poses",
) -> PosesFit:  # fmt: skip
    """Calibrate from a record of many poses.

    Parameters
    ----------
    time : (n,) array_like
        s.
    accel : (n, 3) array_like
        m/s^2 or counts.
    gyro : (n, 3) array_like, optional
        rad/s or counts, instantaneous.
    gravity : float
        m/s^2.
    gyro_scale : float
        rad/s a unit of the gyros' output, roughly: where the search begins.
    dwells : (m, 2) int64, optional
        The poses, where they are known.
    initial : float
        Rest at the start, s.
    counts : bool
        The outputs are counts.
    name : str

    Raises
    ------
    InputError
        For values that are not numbers, fewer than nine good poses, or poses too much alike.
    """
    t, f = np.asarray(time, np.float64), np.asarray(accel, np.float64)
    w = None if gyro is None else np.ascontiguousarray(gyro, dtype=np.float64)
    for label, array, shape in (("time", t, t.shape[:1]), ("accel", f, (len(t), 3)),
                                ("gyro", w, (len(t), 3))):  # fmt: skip
        if array is None:
            continue
        if array.shape != shape:
            raise InputError(f"{label}: expected shape {shape}, got {array.shape}")
        if not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array.reshape(len(t), -1)).all(axis=1))[0])
            raise InputError(f"{label}: row {row + 1} holds a value that is not a finite number")
    if len(t) > 1 and not (np.diff(t) > 0).all():
        row = int(np.flatnonzero(~(np.diff(t) > 0))[0])
        raise InputError(f"time: row {row + 2} does not come after the row before")
    found = (
        find_dwells(t, f, w, initial=initial) if dwells is None else np.asarray(dwells, np.int64)
    )
    means = np.array([f[a:b].mean(axis=0) for a, b in found])
    x, cov, used, residual = _fit_forces(means, gravity)
    bias, matrix = _force_parts(x)
    sigma = np.sqrt(np.diag(cov))
    unseen = _weak(sigma, matrix, used, residual)
    parts = {
        "accel_bias": bias, "accel_matrix": matrix,
    }  # fmt: skip
    spread = {"accel_bias": sigma[:3], "accel_matrix": _force_parts(np.r_[0, 0, 0, sigma[3:]])[1]}
    gyro_cov = np.full((9, 9), np.nan)
    angle = error = before = np.zeros(0)
    if w is not None:
        g, gyro_cov, angle, error, before, rest = _fit_turns(
            t, w, found, used, means, bias, matrix, gyro_scale
        )
        parts |= {"gyro_bias": rest, "gyro_matrix": g}
        spread |= {"gyro_matrix": np.sqrt(np.diag(gyro_cov)).reshape(3, 3)}
        weak = spread["gyro_matrix"] / np.linalg.norm(g, axis=1)[:, None]
        if (weak > 0.02).any():
            i, j = np.unravel_index(int(np.argmax(weak)), (3, 3))
            unseen.append(
                f"gyro {'xyz'[i]}, part along {'xyz'[j]}: known to {100 * weak[i, j]:.2g} % only"
            )
    calibration = Calibration(
        **parts, input="counts" if counts else "SI", name=name, sigma=spread
    )  # fmt: skip
    return PosesFit(calibration, found, used, residual, cov, gyro_cov, angle, error, before,
                    unseen, gravity)  # fmt: skip


def _force_parts(x: Array) -> tuple[Array, Array]:
    return x[:3], np.array([[x[3], x[4], x[5]], [0.0, x[6], x[7]], [0.0, 0.0, x[8]]])


def _fit_forces(means: Array, gravity: float) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Fit nine numbers to the poses' means; a pose five deviations off is left out."""
    from scipy.optimize import least_squares

    used = np.ones(len(means), dtype=bool)
    if len(means) < 10:
        raise InputError(
            f"nine numbers of the accelerometers need ten poses or more, and there are {len(means)}"
        )
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
        bias, matrix = _force_parts(x0 + y * unit)
        return np.asarray(np.linalg.norm((rows - bias) @ matrix.T, axis=1) - gravity)

    y = np.zeros(9)
    for _ in range(6):
        fit = least_squares(miss, y, args=(means[used],), loss="soft_l1", f_scale=2e-4 * gravity)
        y = fit.x
        residual = miss(y, means)
        spread = 1.4826 * float(np.median(np.abs(residual[used])))
        good = np.abs(residual) <= max(5.0 * spread, 1e-9 * gravity)
        if (good == used).all() or good.sum() < 10:
            break
        used = good
    fit = least_squares(miss, y, args=(means[used],), xtol=1e-14, ftol=1e-14)
    residual = miss(fit.x, means)
    information = fit.jac.T @ fit.jac
    values = np.linalg.eigvalsh(information)
    if values[0] < 1e-9 * values[-1]:
        raise InputError(
            "the poses are too much alike to tell nine numbers apart: add poses with each axis up, "
            "down, and half way between"
        )
    dof = max(int(used.sum()) - 9, 1)
    cov = np.linalg.inv(information) * float(np.sum(residual[used] ** 2)) / dof
    return x0 + fit.x * unit, cov * np.outer(unit, unit), used, residual


def _weak(sigma: Array, matrix: Array, used: NDArray[np.bool_], residual: Array) -> list[str]:
    out = [
        "a turn of the accelerometers' frame: x is their first axis, and y lies in the plane of "
        "the first two",
        "the gyros' bias apart from the Earth's rate",
    ]
    names = ("scale x", "axes xy", "axes xz", "scale y", "axes yz", "scale z")
    diagonal = np.diag(matrix)[[0, 0, 0, 1, 1, 2]]
    out += [
        f"accelerometer {name}: known to {100 * s:.2g} % only"
        for name, s in zip(names, sigma[3:] / diagonal, strict=True)
        if s > 2e-3
    ]
    out += [
        f"pose {k + 1} was left out: it misses gravity by {1e3 * residual[k]:.3g} mm/s^2"
        for k in np.flatnonzero(~used)
    ]
    return out


def _fit_turns(
    t: Array, w: Array, dwells: Index, used: NDArray[np.bool_], means: Array, bias: Array,
    matrix: Array, scale: float,
) -> tuple[Array, Array, Array, Array, Array, Array]:  # fmt: skip
    """Fit the gyros' matrix to the turns between poses."""
    from scipy.optimize import least_squares

    from schuler.kernels.turns import turned_directions

    up = (means - bias) @ matrix.T
    up /= np.linalg.norm(up, axis=1)[:, None]
    rest = np.array([w[a:b].mean(axis=0) for a, b in dwells])
    kept = np.flatnonzero(used[:-1] & used[1:])
    if len(kept) < 6:
        raise InputError(
            f"nine numbers of the gyros need six turns between good poses, got {len(kept)}"
        )
    # From the middle of a pose to the middle of the next, so that no motion is missed.
    middle = dwells.sum(axis=1) // 2
    starts, stops = middle[kept], middle[kept + 1]
    zero = 0.5 * (rest[kept] + rest[kept + 1])
    before, after = np.ascontiguousarray(up[kept]), up[kept + 1]
    out = np.empty_like(before)

    def miss(y: Array) -> Array:
        m = scale * y.reshape(3, 3)
        turned_directions(starts, stops, t, w, zero, m, before, out)
        return (out - after).ravel()

    y = np.eye(3).ravel()
    first = np.linalg.norm(miss(y).reshape(-1, 3), axis=1)
    fit = least_squares(miss, y, loss="soft_l1", f_scale=0.01, x_scale=0.1)
    fit = least_squares(miss, fit.x, x_scale=0.1)
    error = fit.fun.reshape(-1, 3)
    # Each turn compares two angles: a direction has no third.
    dof = max(2 * len(kept) - 9, 1)
    cov = np.linalg.pinv(fit.jac.T @ fit.jac) * float(np.sum(error**2)) / dof
    angle = np.arccos(np.clip(np.sum(before * after, axis=1), -1.0, 1.0))
    return (
        scale * fit.x.reshape(3, 3), scale**2 * cov, angle, np.linalg.norm(error, axis=1), first,
        rest[0],
    )  # fmt: skip
