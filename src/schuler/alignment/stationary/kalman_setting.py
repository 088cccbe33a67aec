"""States, prior, noise and measurements of a stationary Kalman alignment: its filter's setting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.intervals import Intervals
from schuler.alignment.methods import KalmanAlignment
from schuler.alignment.stationary.optimal import OptimalAlignment
from schuler.attitude import (
    multiply,
    quat_to_rotvec,
)
from schuler.constants import DEG, EARTH_RATE
from schuler.earth import Site
from schuler.ins import (
    ConstantBase,
    ErrorStateFilter,
    GroupNoise,
    Handling,
    Layout,
    Measurement,
    ProcessNoise,
    ZeroDisplacement,
    ZeroForce,
    ZeroVelocity,
    instrument_noise,
    instrument_prior,
)
from schuler.sensors import ImuSpec

__all__ = ["KalmanSetting", "vehicle_motion"]

Array = NDArray[np.float64]


_MEMORY = 0.02
"""Part of the adaptive noise that each innovation makes."""

_TINY = 1e-9
"""Least variance of a measured velocity or force, and sigma of a displacement or rotation."""

_TILT, _VELOCITY = 1.0 * DEG, 1.0
"""Prior of the start, 1 sigma: so wide that it adds no information."""

_WIDER = 20.0
"""Sigma of the start over that of the optimal estimate: the record counts twice by 1/400."""

_START = 3.0
"""Sigma of a start that was chosen over its own: it comes from the same record."""

_TILTED = 3.0 * DEG
"""Tilt from which on ten states have an eleventh: the third accelerometer's bias."""

_LEVER, _BASE = 1.0, 0.1
"""Prior of a lever arm (m) and of the attitude of the base (rad)."""


def vehicle_motion(h: History, r: Array, site: Site, step: float) -> tuple[float, float, float]:
    """Return the variances of the vehicle's velocity, displacement and turn, of one axis.

    Taken from the residual velocity and the tracked attitude without what is slower than four
    steps, where attitude errors are.
    """
    g, lat = site.gravity, site.latitude
    e = h.velocity @ r.T - h.theory(g, lat)
    level = np.einsum("iab,ib->ia", inertial_to_local(h.t, lat), e)[:, :2]
    width = int(max(3, round(4.0 * step * (len(h) - 1) / h.duration)))
    if len(level) < 2 * width:
        width = max(3, len(level) // 4)

    def fast(x: Array) -> Array:
        kernel = np.full(width, 1.0 / width)
        slow = np.column_stack([np.convolve(c, kernel, "valid") for c in x.T])
        begin = (width - 1) // 2
        return np.asarray(x[begin : begin + len(slow)] - slow)

    quick = fast(level)
    spacing = h.duration / (len(h) - 1)
    place = fast(np.cumsum(quick, axis=0) * spacing)
    back = h.quat[len(h) // 2] * [1.0, -1.0, -1.0, -1.0]
    turn = fast(quat_to_rotvec(multiply(h.quat, np.broadcast_to(back, h.quat.shape))))
    return float(np.mean(quick**2)), float(np.mean(place**2)), float(np.mean(turn**2))


@dataclass(frozen=True, eq=False)
class KalmanSetting:
    """What all passes over a record share."""

    known: OptimalAlignment
    motion: tuple[float, float, float]
    site: Site
    method: KalmanAlignment
    spec: ImuSpec | None
    intervals: Intervals
    start_sigma: Array | None

    @property
    def tilted(self) -> bool:
        """Whether the third accelerometer has a part in the horizontal force."""
        local = inertial_to_local(self.known.history.t[1:], self.site.latitude)
        up = np.einsum("ia,iab->ib", local[:, 2], self.known.attitude)
        return bool(np.any(up[:, 2] < np.cos(_TILTED)))

    @property
    def wander(self) -> bool:
        """Whether the axes are level and of unknown azimuth."""
        return self.method.azimuth == "large"

    def aids(self, times: Array) -> list[Measurement]:
        """Return what is known to be zero or constant, at the ends of intervals."""
        method = self.method
        velocity, displacement, turn = self.motion
        step = float(np.mean(self.intervals.record.dt))
        sway = self.known.sway_levels.max(axis=0)
        handling = Handling(robust=method.robust, adaptive=_MEMORY if method.adaptive else 0.0)
        lever = ("lever",) if method.lever else ()
        axes = np.array([1.0, 1.0, 0.0 if method.states == 10 else 1.0])
        options: dict[str, Any] = {"handling": handling, "name": "point"}
        aids: list[Measurement] = []
        if method.measurement == "velocity":
            sigma = method.noise or np.sqrt(max(velocity, _TINY))
            aids.append(ZeroVelocity(times, 0.0, sigma * axes, estimate=lever, **options))
        elif method.measurement == "displacement":
            # A coloured motion is a state: what is left of it is small.
            known = max(1e-3 * displacement if method.coloured else displacement, _TINY**2)
            sigma = method.noise or np.sqrt(known)
            aids.append(ZeroDisplacement(times, 0.0, sigma * axes, estimate=lever, **options))
        if method.base and self.known.steady:
            sigma = np.sqrt(max(sway[0] / step, turn, _TINY**2))
            aids.append(ConstantBase(times, 0.0, sigma, handling=handling))
        if method.measurement == "force":
            sigma = method.noise or np.sqrt(max(velocity * 2.0 / step**2, _TINY))
            aids.append(ZeroForce(times, 0.0, sigma, **options))
        return aids

    @property
    def removed(self) -> Array:
        """Biases that were taken off the history, (6,)."""
        return np.concatenate([self.known.about.gyro_bias, np.zeros(3)])

    def open(
        self, q: Array, biases: Array, *, first: bool = True, backward: bool = False,
        feedback: bool, smooth: bool = False,
    ) -> ErrorStateFilter:  # fmt: skip
        """Return a filter after a pass over the intervals.

        Parameters
        ----------
        q, biases : (4,), (6,) float64
            Estimates at the start; biases are those that the history still has.
        first : bool
            The prior is still that of the whole bias, of which a part was taken off.
        backward, feedback, smooth : bool
        """
        method, site = self.method, self.site
        intervals = self.intervals.reversed() if backward else self.intervals
        aids = self.aids(intervals.record.time)
        layout = Layout([
            "phi", "velocity",
            *(["position"] if method.states == 15 else []),
            "frame_rate" if self.wander else "gyro_bias", "accelerometer_bias",
            *(["motion"] if method.coloured else []),
            *(group for aid in aids for group in aid.groups),
        ])  # fmt: skip
        noise, sigma = self._noise(layout), self._prior(layout)
        earth = site.earth_rate * (-1.0 if backward else 1.0)
        if self.wander:
            earth = earth * [0.0, 0.0, 1.0]
        start: dict[str, Array] = {"accelerometer_bias": biases[3:]}
        if not self.wander:
            start["gyro_bias"] = -biases[:3] if backward else biases[:3]
        error = np.zeros(layout.size)
        if first and not self.wander:
            error[layout["gyro_bias"]] = -self.known.about.gyro_bias
        f = ErrorStateFilter(
            layout, site, q, np.diag(sigma**2), noise, aids, parameters=start, fixed_place=True,
            earth_rate=earth, error_state=error, feedback=feedback, budget=not smooth,
            smooth=smooth, step=float(np.max(intervals.record.dt)), force_at_rest=True,
            vertical=method.states != 10,
        )  # fmt: skip
        return f.update(intervals.record, intervals.inside)

    def _noise(self, layout: Layout) -> ProcessNoise:
        _, walk, force, rate = self.known.levels.mean
        sway = self.known.sway_levels.max(axis=0)
        noise = instrument_noise(layout, self.spec)
        for group, more, source in (
            ("phi", rate, "gyro_angle_random_walk"),
            ("velocity", force, "accelerometer_velocity_random_walk"),
        ):
            # What the record shows beyond the specification.
            known = np.asarray(noise[group].walk) if group in noise else 0.0
            noise[group] = GroupNoise(known + more, source=source)
        noise["position"] = GroupNoise(walk, source="disturbance")
        noise["base"] = GroupNoise(sway[1], source="disturbance")
        noise["motion"] = GroupNoise(
            0.0, float(np.sqrt(self.motion[1])), self.method.motion_time, "disturbance"
        )
        return ProcessNoise.of(layout, {n: each for n, each in noise.items() if n in layout})

    def _prior(self, layout: Layout) -> Array:
        """Return 1 sigma of each state at the start."""
        displacement = self.motion[1]
        local = inertial_to_local(0.0, self.site.latitude)
        start = np.diag(local @ self.known.covariance[:3, :3] @ local.T)
        north = EARTH_RATE * np.cos(self.site.latitude)
        level = self.method.states == 10
        phi = _WIDER * np.sqrt(start)
        if self.start_sigma is not None:
            phi = np.maximum(phi, _START * self.start_sigma)
        sigma: dict[str, ArrayLike] = {
            # Corrections by feedback are linear only as long as they are small.
            "phi": np.clip(phi, 0.1 * _TILT, 10.0 * _TILT),
            "velocity": np.array([1.0, 1.0, 0.0 if level else 1.0]) * _VELOCITY,
            "position": np.sqrt(max(displacement, 1e-8)), "motion": np.sqrt(displacement),
            "frame_rate": (north, north, 0.0), "base": _BASE, "point.lever": _LEVER,
            **instrument_prior(layout, self.spec),
        }  # fmt: skip
        if self.wander:
            sigma["phi"] = (_TILT, _TILT, 1e-8)
        if level and not self.tilted:
            sigma["accelerometer_bias"] = sigma["accelerometer_bias"] * np.array([1.0, 1.0, 0.0])
        out = np.zeros(layout.size)
        for group in layout:
            out[layout[group]] = sigma[group]
        return out
