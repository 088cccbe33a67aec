"""Calibration by hand: an instrument put down in many poses, no turntable.

In every pose the calibrated force has the length of gravity, which shows bias, scale and axes of
the accelerometers (nine numbers; from six to nine poses only bias and scale, six numbers). Between
poses the gyros must turn gravity from where it was seen to where it is seen (nine numbers; their
scale alone from three turns). Source: Tedaldi, Pretto and Menegatti (2014), A robust and easy to
implement method for IMU calibration without external equipments, ICRA.

What poses cannot show: a turn of the accelerometers' own frame (x is the first axis, y lies in the
plane of the first two), and the gyros' bias apart from the Earth's rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._result import Result
from schuler.calibration.apply import Calibration
from schuler.constants import DEG
from schuler.errors import InputError

__all__ = ["PosesFit", "calibrate_poses", "find_rests"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: gyros that still miss gravity by so much after the fit were not understood
_MOST_TURN = 2.0 * DEG
#: the same of the accelerometers: the angle by which such an error tilts a level
_MOST_FORCE = 2.0 * DEG
#: gyros that miss gravity by so much before the fit may have other axes (rms of unit vectors)
_FAR = 0.2
_FULL, _SIX = 10, 6


@dataclass(frozen=True, eq=False)
class PosesFit(Result):
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
        What is not observable from these poses, or only weakly.
    gravity : float
        m/s^2.
    remarks : tuple of str
        What was found of the axes: gyros that are exchanged or reversed.
    gravity_from : str
        Where gravity is from, in words.
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
    remarks: tuple[str, ...] = ()
    gravity_from: str = "as given"

    @property
    def rms(self) -> float:
        """Root mean square of |f| - gravity over the poses used, m/s^2."""
        return float(np.sqrt(np.mean(self.residual[self.used] ** 2)))

    def columns(self) -> dict[str, Any]:
        """Return a row to each pose: whether it was used, and by how much it misses gravity."""
        return {
            "pose": list(range(1, len(self.dwells) + 1)),
            "used": self.used.tolist(),
            "residual [m/s^2]": self.residual.tolist(),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the result with the keys of the JSON schema `schuler.calibrate-poses/2`."""
        c = self.calibration
        out: dict[str, Any] = {
            "schema": "schuler.calibrate-poses/2",
            "input": c.input,
            "poses": len(self.dwells),
            "used": int(self.used.sum()),
            "gravity_m_s2": self.gravity,
            "residual_rms_m_s2": self.rms,
            "residual_m_s2": self.residual.tolist(),
            "accelerometer": {
                "bias": c.accel_bias.tolist(), "matrix": c.accel_matrix.tolist(),
                "bias_sigma": c.sigma["accel_bias"].tolist(),
                "matrix_sigma": c.sigma["accel_matrix"].tolist(),
            },
            "gyro": None,
            "turn_error_rms_deg": None,
            "turn_error_before_rms_deg": None,
            "unseen": self.unseen,
            "remarks": list(self.remarks),
            "gravity_from": self.gravity_from,
        }  # fmt: skip
        if self.turn_error.size:
            out["gyro"] = {
                "bias": c.gyro_bias.tolist(), "matrix": c.gyro_matrix.tolist(),
                "matrix_sigma": c.sigma["gyro_matrix"].tolist(),
            }  # fmt: skip
            for key, values in (
                ("turn_error_rms_deg", self.turn_error),
                ("turn_error_before_rms_deg", self.turn_error_before),
            ):
                out[key] = float(np.rad2deg(np.sqrt(np.mean(values**2))))
        return out

    def __str__(self) -> str:
        c = self.calibration
        lines = [
            f"{len(self.dwells)} poses, {int(self.used.sum())} used; |f| - gravity "
            f"{1e3 * self.rms:.3f} mm/s^2 rms, "
            f"{1e3 * np.abs(self.residual[self.used]).max():.3f} largest",
            f"gravity {self.gravity:.6f} m/s^2, {self.gravity_from}",
        ]
        unit = "counts" if c.input == "counts" else "m/s^2"
        for k, axis in enumerate("xyz"):
            row = "  ".join(f"{v:12.6g}" for v in c.accel_matrix[k])
            lines.append(
                f"accelerometer {axis}: bias {c.accel_bias[k]:12.6g} ± "
                f"{c.sigma['accel_bias'][k]:.2g} {unit}   matrix {row}"
            )
        if self.turn_error.size:
            for k, axis in enumerate("xyz"):
                row = "  ".join(f"{v:12.6g}" for v in c.gyro_matrix[k])
                lines.append(
                    f"gyro {axis}: bias {c.gyro_bias[k]:12.6g}   matrix {row}   ± "
                    f"{c.sigma['gyro_matrix'][k].max():.2g}"
                )
            rms = [
                np.rad2deg(np.sqrt(np.mean(v**2)))
                for v in (self.turn_error_before, self.turn_error)
            ]
            lines.append(
                f"{self.turn_error.size} turns: the gyros miss gravity by {rms[1]:.3g} deg rms "
                f"({rms[0]:.3g} with the scale as given)"
            )
        lines += [text if "left out" in text else f"not observable: {text}" for text in self.unseen]
        return "\n".join(lines)


def find_rests(
    time: ArrayLike, accel: ArrayLike, gyro: ArrayLike | None = None, *, window: float = 0.4,
    initial: float = 1.0, factor: float = 5.0, shortest: float = 1.0,
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

    Examples
    --------
    >>> time, rng = np.arange(0.0, 20.0, 0.01), np.random.default_rng(1)
    >>> accel = rng.normal(0.0, 0.01, (2000, 3)) + [0.0, 0.0, 9.8]
    >>> accel[900:1100] += np.sin(20.0 * time[900:1100])[:, None]
    >>> len(find_rests(time, accel))
    2
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
    inside = t[dwells[:, 1] - 1] - t[dwells[:, 0]] + 2 * half * step
    long_enough = inside >= 0.95 * shortest
    found = dwells[long_enough]
    if not len(found) or found[0, 0] > half:
        raise InputError(
            f"the record does not begin with {initial:g} s of rest, by which the poses are found "
            "(--initial)"
        )
    return found.astype(np.int64)


def calibrate_poses(
    time: ArrayLike, accel: ArrayLike, gyro: ArrayLike | None = None, *,
    gravity: float, gyro_scale: float = 1.0, dwells: Index | None = None,
    initial: float = 1.0, counts: bool = False, name: str = "poses",
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
        At the place, m/s^2, as `Site.gravity` gives it: it is the scale of the accelerometers.
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
        For values that are not numbers, fewer than six good poses, poses too much alike, or what
        is left after the fit and can be no error of an instrument.

    Examples
    --------
    >>> rng, time = np.random.default_rng(1), np.arange(0.0, 200.0, 0.05)
    >>> up = np.repeat(rng.standard_normal((20, 3)), 200, axis=0)
    >>> up /= np.linalg.norm(up, axis=1)[:, None]
    >>> accel = 9.81 * up + [0.05, 0.0, 0.0] + rng.normal(0.0, 0.003, (4000, 3))
    >>> poses = np.arange(0, 4000, 200)[:, None] + [0, 200]
    >>> fit = calibrate_poses(time, accel, gravity=9.81, dwells=poses, initial=5.0)
    >>> round(float(fit.calibration.accel_bias[0]), 2)
    0.05
    """
    for label, given in (("time", time), ("accel", accel), ("gyro", gyro)):
        if given is not None and not np.issubdtype(np.asarray(given).dtype, np.number):
            raise InputError(
                f"{label}: expected numbers, got {type(given).__name__}; of a record they are "
                "record.time, record.accel and record.gyro"
            )
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
    found = find_rests(t, f, w, initial=initial) if dwells is None else np.asarray(dwells, np.int64)
    means = np.array([f[a:b].mean(axis=0) for a, b in found])
    spread_of_mean = [f[a:b].std(axis=0).mean() / np.sqrt(b - a) for a, b in found]
    x, cov, used, residual = _fit_forces(means, gravity, float(np.mean(spread_of_mean or [0.0])))
    bias, matrix = _force_parts(x)
    sigma = np.sqrt(np.diag(cov))
    unseen = _weak(sigma, matrix, used, residual)
    if len(means) < _FULL:
        unseen.append(
            f"the axes of the accelerometers, one to another: {len(means)} poses show bias and "
            f"scale; {_FULL} or more show the axes as well"
        )
    remarks: tuple[str, ...] = ()
    parts = {
        "accel_bias": bias, "accel_matrix": matrix,
    }  # fmt: skip
    spread = {"accel_bias": sigma[:3], "accel_matrix": _force_parts(np.r_[0, 0, 0, sigma[3:]])[1]}
    gyro_cov = np.full((9, 9), np.nan)
    angle = error = before = np.zeros(0)
    if w is not None:
        g, gyro_cov, angle, error, before, rest, remarks = _fit_turns(
            t, w, found, used, means, bias, matrix, gyro_scale
        )
        if len(angle) < _SIX:
            unseen.append(
                f"the axes of the gyros: {len(angle)} turns show their scale; {_SIX} or more show "
                "the axes as well"
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
                    unseen, gravity, remarks)  # fmt: skip


def _force_parts(x: Array) -> tuple[Array, Array]:
    return x[:3], np.array([[x[3], x[4], x[5]], [0.0, x[6], x[7]], [0.0, 0.0, x[8]]])


def _fit_forces(
    means: Array, gravity: float, noise: float
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Fit nine numbers to the poses' means; a pose five deviations off is left out.

    Six to nine poses show bias and scale. What is left of them is then no measure of their noise,
    so that of each pose's mean counts as well.
    """
    from scipy.optimize import least_squares

    used = np.ones(len(means), dtype=bool)
    if len(means) < _SIX:
        raise InputError(
            f"bias and scale of the accelerometers need six poses or more, each axis up and down, "
            f"and there are {len(means)}; for their axes, ten or more"
        )
    full = len(means) >= _FULL
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
        bias, matrix = _force_parts(x0 + step * unit)
        return np.asarray(np.linalg.norm((rows - bias) @ matrix.T, axis=1) - gravity)

    y = np.zeros(len(free))
    # Of six to nine poses none can be spared.
    for _ in range(6 if full else 0):
        fit = least_squares(miss, y, args=(means[used],), loss="soft_l1", f_scale=2e-4 * gravity)
        y = fit.x
        residual = miss(y, means)
        spread = 1.4826 * float(np.median(np.abs(residual[used])))
        good = np.abs(residual) <= max(5.0 * spread, 1e-9 * gravity)
        if (good == used).all() or good.sum() < _FULL:
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
    full = len(kept) >= _SIX
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
