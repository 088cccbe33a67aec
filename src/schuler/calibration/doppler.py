"""Scale factor and mounting of a Doppler log, from a reference with attitude and velocity.

The log measures ``y = (1 + k) R (C^T v + w x l)``: velocity over ground in body axes, turned by its
mounting. Scale and rotation of least squares follow in closed form from one singular value
decomposition (Umeyama, IEEE PAMI 13, 1991, without a translation); their sigma from the residuals,
whose correlation from row to row is counted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import permutations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.aiding import BodyVelocity
from schuler.attitude import multiply, nearest_quat, quat_to_matrix, quat_to_rotvec, skew
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.trajectory import Trajectory

__all__ = ["BodyVelocityFit", "fit_body_velocity"]

Array = NDArray[np.float64]

_FEWEST = 10
_WRONG = 0.2
"""Residual beside the speed from which on the axes are not what they are said to be."""

_OUTLIER = 5.0
"""Robust sigmas beyond which a row is left out."""

_ROUNDS = 5
_SLOW = 0.1
"""Speed (m/s, rms) below which nothing shows."""

_TURNED = 60.0 * DEG
"""A mounting beyond this is more likely a frame that was not said rightly."""

_PRIOR = 10.0 * DEG
"""1-sigma of a mounting before anything is measured, for what is not observable in the data."""

_UNSEEN = 5.0 * DEG
"""1-sigma of a mounting angle beyond which it is not observable."""


@dataclass(frozen=True, eq=False)
class BodyVelocityFit(Result):
    """Scale factor and mounting of a Doppler log.

    Parameters
    ----------
    scale, scale_sigma : float
        The log measures 1 + scale times the true velocity.
    mount, mount_sigma : (3,) float64
        Rotation vector from right, forward, up of the body to those of the sensor, and its 1-sigma
        about the sensor's axes, rad.
    residual : (3,) float64
        Root mean square along the sensor's axes (right, forward, up), m/s.
    reverse_gain : float
        Factor of least squares the other way round, of the reference on the log: smaller than
        `gain` by the share of noise in the log. Other programs state it.
    speed : float
        Root mean square of the velocity that was measured, m/s.
    rows, left_out : int
        Rows that were used, and rows that lay far off.
    span : (float, float)
        First and last time, s.
    name : str
    warnings : tuple of str
    """

    scale: float
    scale_sigma: float
    mount: Array = field(repr=False)
    mount_sigma: Array = field(repr=False)
    residual: Array = field(repr=False)
    reverse_gain: float
    speed: float
    rows: int
    left_out: int
    span: tuple[float, float]
    name: str = "dvl"
    warnings: tuple[str, ...] = ()

    @property
    def residual_rms(self) -> float:
        """Root mean square of all three axes together, m/s."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def gain(self) -> float:
        """What the measured velocity is multiplied by to become the true one."""
        return 1.0 / (1.0 + self.scale)

    def to_dict(self) -> dict[str, Any]:
        """Return what the JSON schema `schuler.calibrate-dvl/1` has."""
        return {
            "name": self.name, "scale": self.scale, "scale_sigma": self.scale_sigma,
            "gain": self.gain, "reverse_gain": self.reverse_gain,
            "mount_deg": [float(x) / DEG for x in self.mount],
            "mount_sigma_deg": [float(x) / DEG for x in self.mount_sigma],
            "residual_rms_m_s": self.residual_rms,
            "residual_m_s": [float(x) for x in self.residual], "speed_rms_m_s": self.speed,
            "rows": self.rows, "left_out": self.left_out, "start_s": self.span[0],
            "end_s": self.span[1], "warnings": list(self.warnings),
        }  # fmt: skip

    def __str__(self) -> str:
        turn = ", ".join(
            f"{m / DEG:.3f} ± {s / DEG:.2g}"
            for m, s in zip(self.mount, self.mount_sigma, strict=True)
        )
        axes = ", ".join(f"{x:.3g}" for x in self.residual)
        return (
            f"{self.name}: scale factor {self.scale:+.5f} ± {self.scale_sigma:.2g} (gain "
            f"{self.gain:.5f})\n"
            f"mounting  {turn} deg (rotation vector, right, forward, up)\n"
            f"residual  {self.residual_rms:.3g} m/s rms ({axes}) at {self.speed:.3g} m/s rms\n"
            f"rows      {self.rows}, {self.left_out} left out"
        )


def fit_body_velocity(
    dvl: BodyVelocity, trajectory: Trajectory, *, leave_out: float = 0.1
) -> BodyVelocityFit:
    """Find the scale factor and the mounting of a Doppler log.

    Parameters
    ----------
    dvl : BodyVelocity
        Its lever arm counts; its scale and mounting are what is found, and do not.
    trajectory : Trajectory
        With velocity and attitude, on the same clock.
    leave_out : float
        Share of rows that may be left out as outliers, beyond five robust sigmas; more than that
        are no outliers.

    Raises
    ------
    InputError
        If they share fewer than ten rows, nothing moves, or no rotation turns one into the other:
        then the axes that fit are named.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler.trajectory import Trajectory
    >>> t = np.arange(60.0)
    >>> v = np.column_stack([np.sin(0.2 * t), 2.0 + 0.5 * np.cos(0.1 * t), 0.2 * np.sin(t)])
    >>> still = np.tile([1.0, 0.0, 0.0, 0.0], (60, 1))
    >>> path = Trajectory(t, np.zeros(60), np.zeros(60), np.zeros(60), v, still)
    >>> fit = fit_body_velocity(BodyVelocity(t, 1.02 * v), path)
    >>> print(f"{fit.scale:.3f} {fit.rows}")
    0.020 60
    """
    time, seen = np.asarray(dvl.time), np.asarray(dvl.velocity)
    inside = (time >= trajectory.time[0]) & (time <= trajectory.time[-1])
    if inside.sum() < _FEWEST:
        raise InputError(
            f"{dvl.name}: its times from t = {time[0]:.9g} to {time[-1]:.9g} s and those of the "
            f"reference from {trajectory.time[0]:.9g} to {trajectory.time[-1]:.9g} s share "
            f"{int(inside.sum())} rows, and ten are needed"
        )
    time, seen = time[inside], seen[inside]
    true = _body(trajectory, np.asarray(dvl.lever), time)
    speed = float(np.sqrt(np.mean(np.sum(true**2, axis=1))))
    if speed < _SLOW:
        raise InputError(f"{dvl.name}: the reference moves at {speed:.2g} m/s rms: nothing shows")
    if not 0.0 <= leave_out < 0.5:
        raise InputError(f"leave_out must be from 0 to below 0.5, got {leave_out}")
    keep = np.ones(len(time), bool)
    for _ in range(_ROUNDS):
        gain, turn = _similarity(true[keep], seen[keep])
        off = seen - gain * true @ turn.T
        size = np.linalg.norm(off, axis=1)
        bound = _OUTLIER * np.median(size[keep]) / 1.54
        bound = max(bound, float(np.quantile(size, 1.0 - leave_out)))
        fresh = size <= max(bound, 1e-9)
        if np.array_equal(fresh, keep) or fresh.sum() < _FEWEST:
            break
        keep = fresh
    gain, turn = _similarity(true[keep], seen[keep])
    variance = float(np.mean((seen - gain * true @ turn.T)[keep] ** 2))
    gain, turn = _similarity(true[keep], seen[keep], variance / (2.0 * _PRIOR**2))
    off = (seen - gain * true @ turn.T)[keep]
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    if rms > _WRONG * speed or not 0.5 < gain < 2.0:
        raise InputError(
            f"{dvl.name}: no rotation and scale factor turn the reference into its velocities: "
            f"{rms:.3g} m/s rms are left of {speed:.3g} m/s, with a factor of {gain:.3g}; "
            f"{_advice(true, seen)}"
        )
    scale_sigma, mount_sigma = _sigma(off, gain, true[keep] @ turn.T)
    mount = quat_to_rotvec(nearest_quat(turn))
    warnings = []
    blind = [name for name, s in zip(("right", "forward", "up"), mount_sigma, strict=True)
             if s > _UNSEEN]  # fmt: skip
    if blind:
        warnings.append(
            f"the mounting about {' and '.join(blind)} is not observable: the vehicle moves along "
            "that axis alone; drive sideways or up as well"
        )
    angle = float(np.linalg.norm(mount))
    if angle > _TURNED:
        warnings.append(
            f"the sensor's axes are turned by {angle / DEG:.0f} deg against the body's: if it is "
            "not mounted so, its frame is another (RFU, FRD or FLU)"
        )
    measured = float(np.sqrt(np.mean(np.sum(seen[keep] ** 2, axis=1))))
    return BodyVelocityFit(
        gain - 1.0, scale_sigma, np.asarray(mount), mount_sigma, np.sqrt(np.mean(off**2, axis=0)),
        _similarity(seen[keep], true[keep])[0], measured, int(keep.sum()),
        int((~keep).sum()), (float(time[0]), float(time[-1])), dvl.name, tuple(warnings),
    )  # fmt: skip


def _body(trajectory: Trajectory, lever: Array, time: Array) -> Array:
    """Return the reference's velocity at the sensor in body axes at some times, (n, 3)."""
    v_n, quat = trajectory.known("v_n"), trajectory.known("quat_nb")
    stamps = trajectory.time
    body = np.einsum("iba,ib->ia", quat_to_matrix(quat), v_n)
    if np.any(lever):
        step = multiply(quat[:-1] * [1.0, -1.0, -1.0, -1.0], quat[1:])
        rate = quat_to_rotvec(step) / np.diff(stamps)[:, None]
        middle = 0.5 * (stamps[1:] + stamps[:-1])
        whole = np.column_stack([np.interp(stamps, middle, w) for w in np.asarray(rate).T])
        body = body + np.cross(whole, lever)
    return np.column_stack([np.interp(time, stamps, c) for c in body.T])


def _similarity(true: Array, seen: Array, weight: float = 0.0) -> tuple[float, Array]:
    """Return the factor and the rotation of least squares from one series to the other.

    With a weight, of all rotations that fit alike it is the least one.
    """
    products = seen.T @ true
    u, _, vt = np.linalg.svd(products + weight * np.eye(3))
    turn = (u * np.array([1.0, 1.0, np.linalg.det(u @ vt)])) @ vt
    return float(np.sum(products * turn) / np.sum(true**2)), turn


def _sigma(off: Array, gain: float, turned: Array) -> tuple[float, Array]:
    """Return 1-sigma of the factor and of the rotation about the sensor's axes."""
    information = np.zeros((4, 4))
    for row in turned:
        jacobian = np.column_stack([row, -gain * skew(row)])
        information += jacobian.T @ jacobian
    count = len(off)
    variance = float(np.sum(off**2)) / max(3 * count - 4, 1)
    centred = off - off.mean(axis=0)
    scatter = float(np.sum(centred**2))
    alike = float(np.sum(centred[1:] * centred[:-1])) / scatter if scatter > 0.0 else 0.0
    alike = min(max(alike, 0.0), 0.99)
    # Residuals that are alike from row to row are fewer than they seem.
    variance *= (1.0 + alike) / (1.0 - alike)
    prior = np.diag([0.0, *3 * [1.0 / _PRIOR**2]])
    covariance = np.linalg.inv(information / max(variance, 1e-24) + prior)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return float(spread[0]), np.asarray(spread[1:])


def _advice(true: Array, seen: Array) -> str:
    """Name the axes, read otherwise, that fit: only rotations are tried by the fit itself."""
    best, told = _WRONG, "are the clock, the axes and the units right?"
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turned = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(turned) > 0.0:
                continue
            other = seen @ turned.T
            gain, turn = _similarity(true, other)
            left = float(np.sqrt(np.mean((other - gain * true @ turn.T) ** 2)))
            left /= max(float(np.sqrt(np.mean(true**2))), 1e-12)
            if left < best and 0.5 < gain < 2.0:
                best = left
                told = "its axes are left-handed: one of them has its sign turned"
    return told
