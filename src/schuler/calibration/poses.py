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

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.calibration.apply import Calibration
from schuler.calibration.poses_fit import (
    FULL,
    SIX,
    fit_forces,
    fit_turns,
    force_parts,
    weakly_known,
)
from schuler.calibration.poses_result import PosesFit
from schuler.calibration.rests import find_rests
from schuler.errors import InputError
from schuler.units import percent

__all__ = ["PosesFit", "calibrate_poses", "find_rests"]

Index = NDArray[np.int64]


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
    x, cov, used, residual = fit_forces(means, gravity, float(np.mean(spread_of_mean or [0.0])))
    bias, matrix = force_parts(x)
    sigma = np.sqrt(np.diag(cov))
    unseen = weakly_known(sigma, matrix, used, residual)
    if len(means) < FULL:
        unseen.append(
            f"the axes of the accelerometers, one to another: {len(means)} poses show bias and "
            f"scale; {FULL} or more show the axes as well"
        )
    remarks: tuple[str, ...] = ()
    parts = {
        "accel_bias": bias, "accel_matrix": matrix,
    }  # fmt: skip
    spread = {"accel_bias": sigma[:3], "accel_matrix": force_parts(np.r_[0, 0, 0, sigma[3:]])[1]}
    gyro_cov = np.full((9, 9), np.nan)
    angle = error = before = np.zeros(0)
    if w is not None:
        g, gyro_cov, angle, error, before, rest, remarks = fit_turns(
            t, w, found, used, means, bias, matrix, gyro_scale
        )
        if len(angle) < SIX:
            unseen.append(
                f"the axes of the gyros: {len(angle)} turns show their scale; {SIX} or more show "
                "the axes as well"
            )
        parts |= {"gyro_bias": rest, "gyro_matrix": g}
        spread |= {"gyro_matrix": np.sqrt(np.diag(gyro_cov)).reshape(3, 3)}
        weak = spread["gyro_matrix"] / np.linalg.norm(g, axis=1)[:, None]
        if (weak > 0.02).any():
            i, j = np.unravel_index(int(np.argmax(weak)), (3, 3))
            unseen.append(
                f"gyro {'xyz'[i]}, part along {'xyz'[j]}: known to {percent(weak[i, j])} only"
            )
    calibration = Calibration(
        **parts, input="counts" if counts else "SI", name=name, sigma=spread
    )  # fmt: skip
    return PosesFit(calibration, found, used, residual, cov, gyro_cov, angle, error, before,
                    unseen, gravity, remarks)  # fmt: skip
