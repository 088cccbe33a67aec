"""Kalman alignment of a stationary vehicle: a configuration of the error-state filter.

The filter runs over intervals of a history (`schuler.alignment.intervals`), not over samples: they
are exact integrals of them, so that a Kalman alignment streams in constant memory, is saved with
the history, and can begin anew at any time. It does so for each solution, because its start and
its noise are read from the whole record, as in `schuler.alignment.stationary.optimal`: the start is
the centred estimate, with a prior so wide that the record is not counted twice, and how much the
vehicle moves, and how far its attitude may be trusted, are the optimal estimate's levels. Kept
sample by sample instead, a filter would need them before it has seen the record.

Sources: Fang and Wan (1996) for the ten states; Rauch, Tung and Striebel (1965); Huber (1964) and
Yang's IGG-III (1994) for robust updates; Qin, Yan, Gu and Zheng (2005) for passes to and fro over
one record.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.intervals import Intervals
from schuler.alignment.methods import KalmanAlignment
from schuler.alignment.stationary.inertial import MINIMUM_ROWS, solve
from schuler.alignment.stationary.optimal import Linearisation, OptimalAlignment, joint
from schuler.attitude import (
    multiply,
    nearest_quat,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
)
from schuler.constants import DEG, EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError
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

__all__ = ["FilterHistory", "KalmanResult", "kalman_alignment", "vehicle_motion"]

Array = NDArray[np.float64]

_MEMORY = 0.02
"""Part of the adaptive noise that each innovation makes."""

_TINY = 1e-9
"""Least variance of a measured velocity or force, and sigma of a displacement or rotation."""

_TILT, _VELOCITY = 1.0 * DEG, 1.0
"""Prior of the start, 1 sigma: so wide that it tells nothing."""

_WIDER = 20.0
"""Sigma of the start over that of the optimal estimate: the record counts twice by 1/400."""

_START = 3.0
"""Sigma of a start that was chosen over its own: it comes from the same record."""

_TILTED = 3.0 * DEG
"""Tilt from which on ten states have an eleventh: the third accelerometer's bias."""

_LEVER, _BASE = 1.0, 0.1
"""Prior of a lever arm (m) and of the attitude of the base (rad)."""


@dataclass(frozen=True, eq=False)
class FilterHistory:
    """What the filter said after each step.

    Parameters
    ----------
    t : (k,) float64
        s since the start of the record.
    quaternion : (k, 4) float64
        quat_nb.
    sigma : (k, 3) float64
        Of phi, rad.
    gyro_bias, accel_bias : (k, 3) float64
        rad/s and m/s^2.
    innovation : (k,) float64
        Mean squared normalised innovation: 1 for a filter that knows its noise.
    """

    t: Array
    quaternion: Array
    sigma: Array
    gyro_bias: Array
    accel_bias: Array
    innovation: Array


@dataclass(frozen=True, eq=False)
class KalmanResult:
    """A fine alignment.

    Parameters
    ----------
    attitude : (3, 3) float64
        C_b^n at the wanted instant.
    budget : dict of str to (3, 3) float64
        Covariance of phi by source, rad^2.
    biases, bias_covariance : (6,), (6, 6) float64 or None
        None for a large azimuth: there the gyro biases are part of the rate that shows north.
    filter_history : FilterHistory
        The last pass.
    refused, weighed : int
        Measurements that a robust filter refused or weighed down.
    best : OptimalAlignment or None
        The optimal estimate, where it was made on the way and the result is linear about the same.
    """

    attitude: Array
    budget: dict[str, Array]
    biases: Array | None
    bias_covariance: Array | None
    filter_history: FilterHistory
    refused: int
    weighed: int
    best: OptimalAlignment | None = None


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
class _Setting:
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


def kalman_alignment(
    h: History, site: Site, method: KalmanAlignment, spec: ImuSpec | None, at_end: bool,
    about: Linearisation | None = None, start: tuple[Array, Array] | None = None,
) -> KalmanResult:  # fmt: skip
    """Return the Kalman alignment of a history.

    Parameters
    ----------
    h : History
    site : Site
    method : KalmanAlignment
    spec : ImuSpec or None
        Without one the noise is that of the record, and biases are taken for zero.
    at_end : bool
    about : Linearisation, optional
        Where to start, and what was taken off the history, as of `joint`; the centred estimate
        and no bias when not given.
    start : (3, 3) and (3, 3) float64, optional
        C_b^n at the start and the covariance of its phi (rad^2), where the filter begins from
        another estimate than the centred one.

    Raises
    ------
    InputError
        If the record is too short for ten steps of the filter.
    """
    if len(h) < MINIMUM_ROWS or h.duration < 10.0 * method.step * (1.0 - 1e-6):
        raise InputError(
            f"a fine alignment needs ten steps of {method.step:g} s at least, the record has "
            f"{h.duration:.4g} s: take a longer one or a shorter step"
        )
    about = about or Linearisation(solve(h, site.gravity, site.latitude, "centred"), np.zeros(3))
    r = about.rotation
    setting = _Setting(
        joint(h, site, spec, about=about), vehicle_motion(h, r, site, method.step), site, method,
        spec, Intervals.of(h, method.step),
        None if start is None else np.sqrt(np.diag(start[1])),
    )  # fmt: skip
    biases = np.zeros(6)
    if setting.wander:
        return _wandering(setting, _levelled(h), at_end)
    q = nearest_quat(inertial_to_local(0.0, site.latitude) @ r if start is None else start[0])
    # To and fro: each pass begins where the one before ended, with the prior of the first.
    for lap in range(method.passes - 1):
        backward = lap % 2 == 1
        f = setting.open(q, biases, first=lap == 0, backward=backward, feedback=True)
        q, biases = f.quat_nb, _biases(f)
        if backward:
            biases[:3] *= -1.0
    if not at_end:
        return _smoothed(setting, q, biases)
    f = setting.open(q, biases, first=method.passes == 1, feedback=method.feedback)
    phi = f.layout["phi"]
    budget = {name: part[phi, phi] for name, part in f.budget.items() if part[phi, phi][2, 2] > 0.0}
    own = _bias_states(f)
    return KalmanResult(
        quat_to_matrix(f.quat_nb), budget, _biases(f) + setting.removed,
        f.covariance[np.ix_(own, own)],
        _passed(f, h), f.refused, f.weighed, setting.known,
    )  # fmt: skip


def _bias_states(f: ErrorStateFilter) -> list[int]:
    """Return the states of gyro and accelerometer biases."""
    groups = (f.layout["gyro_bias"], f.layout["accelerometer_bias"])
    return [k for place in groups for k in range(place.start, place.stop)]


def _biases(f: ErrorStateFilter) -> Array:
    """Return the biases now, (6,)."""
    return np.concatenate([f.parameter("gyro_bias"), f.parameter("accelerometer_bias")])


def _passed(f: ErrorStateFilter, h: History) -> FilterHistory:
    history = f.history()
    none = np.full((len(history), 3), np.nan)
    return FilterHistory(
        history.time - h.start, history.quat_nb, history.sigma("phi"),
        history["gyro_bias"] if "gyro_bias" in f.layout else none, history["accelerometer_bias"],
        history.mean_square,
    )  # fmt: skip


def _smoothed(setting: _Setting, q: Array, biases: Array) -> KalmanResult:
    """Return the attitude at the start, by the smoother; twice, as errors are then linear."""
    h = setting.known.history
    for lap in range(2):
        first = lap == 0 and setting.method.passes == 1
        f = setting.open(q, biases, first=first, feedback=False, smooth=True)
        done = f.smoothed()
        own = _bias_states(f)
        q, biases = done.quat_nb[0], biases + done.error[0, own]
    p = done.covariance[0]
    phi = f.layout["phi"]
    return KalmanResult(
        quat_to_matrix(q), {"all_sources": p[phi, phi]}, biases + setting.removed,
        p[np.ix_(own, own)],
        _passed(f, h), f.refused, f.weighed, setting.known,
    )  # fmt: skip


def _levelled(h: History) -> Array:
    """Return an attitude that is level by the force of the first second; heading is nothing."""
    row = max(1, int(np.searchsorted(h.t, 1.0)))
    up = h.nodes.sum_dvel[min(row, len(h) - 1)]
    up = up / np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0] if up[2] > 0 else [0.0, 1.0, 0.0, 0.0])
    return np.asarray(rotvec_to_quat(axis / size * np.arctan2(size, up[2])))


def _wandering(setting: _Setting, q: Array, at_end: bool) -> KalmanResult:
    """Return the alignment in level axes of unknown azimuth: linear however large that is.

    The horizontal Earth rate in these axes is a state; north is where it points.
    """
    if not at_end:
        raise InputError(
            "the large-azimuth filter gives the attitude at the end: say --at end, or use the "
            "small-azimuth form"
        )
    f = setting.open(q, np.zeros(6), feedback=setting.method.feedback)
    north = EARTH_RATE * np.cos(setting.site.latitude)
    quat, rate = f.quat_nb, f.parameter("frame_rate")

    def turned(quat: Array, rate: Array) -> Array:
        a = np.arctan2(rate[0], rate[1])
        return quat_to_matrix(multiply(rotvec_to_quat([0.0, 0.0, a]), quat))

    attitude = turned(quat, rate)
    jacobian = np.zeros((3, 6))
    for k in range(5):
        x = np.zeros(6)
        x[k] = 1e-6 if k < 3 else 1e-6 * north
        moved = turned(multiply(rotvec_to_quat(-x[:3]), quat), rate[:2] - x[3:5])
        error = np.eye(3) - moved @ attitude.T
        jacobian[:, k] = np.array([error[2, 1], error[0, 2], error[1, 0]]) / x[k]
    phi, rates = f.layout["phi"], f.layout["frame_rate"]
    pick = np.r_[phi, rates]
    budget = {}
    for name, part in f.budget.items():
        covariance = jacobian @ part[np.ix_(pick, pick)] @ jacobian.T
        if covariance[2, 2] > 0.0:
            budget[name] = covariance
    sigma = 0.0 if setting.spec is None else setting.spec.gyro.bias
    budget["gyro_bias"] = np.diag([0.0, 0.0, (sigma / north) ** 2])
    history, h = f.history(), setting.known.history
    azimuth = np.arctan2(*history["frame_rate"][:, :2].T)
    turn = rotvec_to_quat(np.column_stack([np.zeros((len(history), 2)), azimuth]))
    passed = _passed(f, h)
    sides = np.column_stack([np.cos(azimuth), -np.sin(azimuth)])
    across = np.linalg.norm(sides * history.sigma("frame_rate")[:, :2], axis=1) / north
    passed = replace(
        passed, quaternion=np.asarray(multiply(turn, passed.quaternion)),
        sigma=np.column_stack([passed.sigma[:, :2], np.hypot(across, sigma / north)]),
    )  # fmt: skip
    return KalmanResult(attitude, budget, None, None, passed, f.refused, f.weighed, setting.known)
