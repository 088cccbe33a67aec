"""Fine alignment: a Kalman filter over the samples, from a coarse start.

The start comes from the centred estimate of the same record, with a prior so wide that the record
is not counted twice. How much the vehicle moves, and how far its attitude may be trusted, are read
from the record as in `optimal`; the filter is then the recursive form of the same weighing, and its
covariance is as consistent.

Sources: Fang and Wan (1996) for the ten states; Gelb (1974) and Joseph for the covariance; Rauch,
Tung and Striebel (1965); Huber (1964) and Yang's IGG-III (1994) for robust updates; Qin, Yan, Gu
and Zheng (2005) for passes to and fro over one record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.methods import Fine
from schuler.alignment.stationary.inertial import solve
from schuler.alignment.stationary.optimal import Joint, joint
from schuler.attitude import (
    multiply,
    nearest_quat,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
)
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec

__all__ = ["FinePass", "FineResult", "fine_alignment", "vehicle_motion"]

Array = NDArray[np.float64]

_RULES = {None: 0, "huber": 1, "igg3": 2}
_KINDS = {"velocity": 1, "displacement": 2, "force": 8}
_PARTS = (
    "gyro_bias", "accelerometer_bias", "gyro_angle_random_walk",
    "accelerometer_velocity_random_walk", "disturbance", "start",
)  # fmt: skip

_TILT, _VELOCITY = 1.0 * DEG, 1.0
"""Prior of the start, 1 sigma: so wide that it tells nothing."""

_WIDER = 20.0
"""Sigma of the start over that of the optimal estimate: the record counts twice by 1/400."""

_TILTED = 3.0 * DEG
"""Tilt from which on ten states have an eleventh: the third accelerometer's bias."""

_LEVER, _BASE = 1.0, 0.1
"""Prior of a lever arm (m) and of the attitude of the base (rad)."""


@dataclass(frozen=True, eq=False)
class FinePass:
    """What the filter said after each step.

    Parameters
    ----------
    t : (k,) float64
        s since the start of the record.
    quaternion : (k, 4) float64
        q_b^n.
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
class FineResult:
    """A fine alignment.

    Parameters
    ----------
    attitude : (3, 3) float64
        C_b^n at the wanted instant.
    budget : dict of str to (3, 3) float64
        Covariance of phi by source, rad^2.
    biases, bias_covariance : (6,), (6, 6) float64 or None
        None for a large azimuth: there the gyro biases are part of the rate that shows north.
    passed : FinePass
        The last pass.
    refused, weighed : int
        Measurements that a robust filter refused or weighed down.
    """

    attitude: Array
    budget: dict[str, Array]
    biases: Array | None
    bias_covariance: Array | None
    passed: FinePass
    refused: int
    weighed: int


@dataclass(eq=False)
class _Filter:
    """Arrays of a pass, as the kernel takes them."""

    state: Array
    x: Array
    p: Array
    parts: Array
    cfg: Array
    layout: NDArray[np.int64]

    def run(self, record: ImuRecord, keep: bool = False) -> tuple[Array, Array]:
        """Feed a record; return the rows of the steps, and what the smoother needs."""
        from schuler.kernels.fine import OUT, fine

        n = len(self.x)
        steps = int(len(record) // self.cfg[4]) + 1
        out = np.zeros((steps, OUT))
        kept = np.zeros((steps if keep else 0, 2 * n + 3 * n * n))
        rows = fine(
            self.state, self.x, self.p, self.parts, self.cfg, self.layout,
            np.zeros((2 * n + 8, n)), record.time, record.dt, record.dtheta, record.dvel, out, kept,
        )  # fmt: skip
        return out[:rows], kept[:rows]

    @property
    def quaternion(self) -> Array:
        """q_b^n now, without the error that is known."""
        return np.asarray(multiply(rotvec_to_quat(self.x[:3]), self.state[1:5]))

    @property
    def biases(self) -> Array:
        """Biases now, (6,)."""
        return self.state[48:54] + self.x[6:12]


@dataclass(frozen=True, eq=False)
class _Setting:
    """What all passes over a record share."""

    known: Joint
    motion: tuple[float, float, float]
    site: Site
    method: Fine
    spec: ImuSpec | None
    every: int
    to_correct: tuple[bool, bool]

    @property
    def tilted(self) -> bool:
        """Whether the third accelerometer has a part in the horizontal force."""
        local = inertial_to_local(self.known.history.t[1:], self.site.latitude)
        up = np.einsum("ia,iab->ib", local[:, 2], self.known.attitude)
        return bool(np.any(up[:, 2] < np.cos(_TILTED)))

    def open(self, q: Array, biases: Array, *, backward: bool = False, feedback: bool) -> _Filter:
        """Return a filter at its start."""
        from schuler.kernels.fine import STATE_SIZE

        method, spec, site = self.method, self.spec, self.site
        at, n = [-1, -1, -1, -1], 12
        wanted = (
            method.states == 15 or method.measurement == "displacement", method.coloured,
            method.base and self.known.steady, method.lever,
        )  # fmt: skip
        for k, there in enumerate(wanted):
            if there:
                at[k], n = n, n + 3
        kinds = _KINDS[method.measurement] | (4 if at[2] >= 0 else 0)
        axes = 3 if method.states > 10 else 2
        layout = np.array([n, *at, axes, kinds], np.int64)

        _, c, b, a = self.known.levels.mean
        wander = method.azimuth == "large"
        gyro, accel = (0.0, 0.0), (0.0, 0.0)
        if spec is not None:
            gyro = (spec.gyro.white, spec.gyro.drift)
            accel = (spec.accelerometer.white, spec.accelerometer.drift)
        sway = self.known.sway_levels.max(axis=0)
        velocity, displacement, turn = self.motion
        step = method.step
        cfg = np.zeros(25)
        cfg[:3] = site.earth_rate * (-1.0 if backward else 1.0)
        if wander:
            cfg[:2] = 0.0
        cfg[3:9] = (
            site.gravity, self.every, np.sqrt(gyro[0] ** 2 + a),
            np.sqrt(accel[0] ** 2 + b), 0.0 if wander else gyro[1], accel[1],
        )  # fmt: skip
        tiny = 1e-9
        cfg[9:13] = (
            max(velocity, tiny), max(1e-3 * displacement if method.coloured else displacement,
                                     tiny**2),
            max(sway[0] / step, turn, tiny**2), max(velocity * 2.0 / step**2, tiny),
        )  # fmt: skip
        if method.noise is not None:
            cfg[{"velocity": 9, "displacement": 10, "force": 12}[method.measurement]] = (
                method.noise**2
            )
        cfg[13:17] = (c, sway[1], method.motion_time, np.sqrt(displacement))
        cfg[17:20] = (_RULES[method.robust], *((1.345, 1e9) if method.robust == "huber"
                                               else (1.5, 4.0)))  # fmt: skip
        cfg[20] = 0.02 if method.adaptive else 0.0
        cfg[21] = feedback
        cfg[22] = wander
        cfg[23:] = self.to_correct

        free = (1e-6 * DEG_PER_HOUR, 1e-3 * MICRO_G)
        bias = free if spec is None else (
            max(spec.gyro.bias, free[0]), max(spec.accelerometer.bias, free[1])
        )  # fmt: skip
        p0 = np.zeros(n)
        local = inertial_to_local(0.0, site.latitude)
        start = np.diag(local @ self.known.covariance[:3, :3] @ local.T)
        # Corrections by feedback are linear only as long as they are small.
        p0[:3] = np.clip(_WIDER**2 * start, (0.1 * _TILT) ** 2, (10.0 * _TILT) ** 2)
        if wander:
            p0[:3] = (_TILT**2, _TILT**2, 1e-16)
        p0[3:6] = _VELOCITY**2
        p0[6:9], p0[9:12] = bias[0] ** 2, bias[1] ** 2
        if wander:
            p0[6:9] = (*[(EARTH_RATE * np.cos(site.latitude)) ** 2] * 2, 0.0)
        if method.states == 10:
            p0[5] = 0.0
            if not self.tilted:
                p0[11] = 0.0
        for k, value in zip(at, (max(displacement, 1e-8), displacement, _BASE**2, _LEVER**2),
                            strict=True):  # fmt: skip
            if k >= 0:
                p0[k : k + 3] = value
        parts = np.zeros((len(_PARTS), n, n))
        for i in range(n):
            mine = 5 if i < 6 or i >= 12 or (wander and i < 9) else (0 if i < 9 else 1)
            if at[1] >= 0 and at[1] <= i < at[1] + 3:
                mine = 4
            parts[mine, i, i] = p0[i]
        state = np.zeros(STATE_SIZE)
        state[1:5] = state[32:36] = q
        if not wander:
            state[48:54] = biases * [*[-1.0 if backward else 1.0] * 3, 1.0, 1.0, 1.0]
        return _Filter(state, np.zeros(n), np.diag(p0), parts, cfg, layout)


def _reversed(record: ImuRecord) -> ImuRecord:
    """Return the record run backwards: turns change their sign, forces do not."""
    from dataclasses import replace

    dvel = record.dvel
    if record.sculling_corrected:
        # Resolved where the interval began; backwards that is where it ends.
        back = rotvec_to_quat(-record.dtheta)
        dvel = np.einsum("iab,ib->ia", quat_to_matrix(back), dvel)
    time = record.start + record.end - (record.time - record.dt)[::-1]
    return replace(
        record, time=np.ascontiguousarray(time), dt=np.ascontiguousarray(record.dt[::-1]),
        dtheta=np.ascontiguousarray(-record.dtheta[::-1]),
        dvel=np.ascontiguousarray(dvel[::-1]),
    )  # fmt: skip


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


def fine_alignment(
    record: ImuRecord, h: History, site: Site, method: Fine, spec: ImuSpec | None, at_end: bool
) -> FineResult:
    """Return the fine alignment of a record.

    Parameters
    ----------
    record : ImuRecord
        All samples.
    h : History
        The pass over them, for the start and for what moves.
    site : Site
    method : Fine
    spec : ImuSpec or None
        Without one the noise is that of the record, and biases are taken for nothing.
    at_end : bool

    Raises
    ------
    InputError
        If the record is too short for ten steps of the filter.
    """
    every = max(1, round(method.step * record.rate))
    if len(record) < 10 * every:
        raise InputError(
            f"a fine alignment needs ten steps of {method.step:g} s at least, the record has "
            f"{record.duration:.4g} s: take a longer one or a shorter step"
        )
    r = solve(h, site.gravity, site.latitude, "centred")
    setting = _Setting(
        joint(h, site, spec), vehicle_motion(h, r, site, method.step), site, method, spec, every,
        (not record.coning_corrected, not record.sculling_corrected),
    )  # fmt: skip
    wander = method.azimuth == "large"
    q = _levelled(record) if wander else nearest_quat(inertial_to_local(0.0, site.latitude) @ r)
    biases = np.zeros(6)
    if wander:
        return _wandering(setting, record, q, at_end)
    # To and fro: each pass begins where the one before ended, with the prior of the first.
    for lap in range(method.passes - 1):
        backward = lap % 2 == 1
        f = setting.open(q, biases, backward=backward, feedback=True)
        f.run(_reversed(record) if backward else record)
        q, biases = f.quaternion, f.biases
        if backward:
            biases[:3] *= -1.0
    if not at_end:
        return _smoothed(setting, record, q, biases)
    f = setting.open(q, biases, feedback=method.feedback)
    out, _ = f.run(record)
    budget = {
        name: part[:3, :3] for name, part in zip(_PARTS, f.parts, strict=True) if part[2, 2] > 0
    }
    return FineResult(
        quat_to_matrix(f.quaternion), budget, f.biases, f.p[6:12, 6:12], _passed(out, record),
        int(f.state[37]), int(f.state[38]),
    )  # fmt: skip


def _passed(out: Array, record: ImuRecord) -> FinePass:
    return FinePass(
        out[:, 0] - record.start, out[:, 1:5], np.sqrt(out[:, 8:11]), out[:, 11:14], out[:, 14:17],
        out[:, 17],
    )  # fmt: skip


def _smoothed(setting: _Setting, record: ImuRecord, q: Array, biases: Array) -> FineResult:
    """Return the attitude at the start, by the smoother; twice, as errors are then linear."""
    from schuler.kernels.kalman import smooth

    for _ in range(2):
        f = setting.open(q, biases, feedback=False)
        out, kept = f.run(record, keep=True)
        n = len(f.x)
        xs, ps = np.zeros((len(kept), n)), np.zeros((len(kept), n, n))
        smooth(kept, n, xs, ps, np.zeros((n, n)), np.zeros((n, n)))
        # One step back, from the first smoothed state to the start, along phi and the biases.
        forward = kept[0, 2 * n + 2 * n * n :].reshape(n, n)
        back = np.linalg.inv(forward)
        x0, p0 = back @ xs[0], back @ ps[0] @ back.T
        q = np.asarray(multiply(rotvec_to_quat(x0[:3]), q))
        biases = biases + x0[6:12]
    covariance = 0.5 * (p0[:3, :3] + p0[:3, :3].T)
    return FineResult(
        quat_to_matrix(q), {"all_sources": covariance}, biases, p0[6:12, 6:12],
        _passed(out, record), int(f.state[37]), int(f.state[38]),
    )  # fmt: skip


def _levelled(record: ImuRecord) -> Array:
    """Return an attitude that is level by the force of the first second; heading is nothing."""
    count = max(2, round(record.rate))
    up = record.dvel[:count].sum(axis=0)
    up = up / np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0] if up[2] > 0 else [0.0, 1.0, 0.0, 0.0])
    return np.asarray(rotvec_to_quat(axis / size * np.arctan2(size, up[2])))


def _wandering(setting: _Setting, record: ImuRecord, q: Array, at_end: bool) -> FineResult:
    """Return the alignment in level axes of unknown azimuth: linear however large that is.

    The horizontal Earth rate in these axes is a state; north is where it points.
    """
    if not at_end:
        raise InputError(
            "the large-azimuth filter gives the attitude at the end: say --at end, or use the "
            "small-azimuth form"
        )
    f = setting.open(q, np.zeros(6), feedback=setting.method.feedback)
    out, _ = f.run(record)
    north = EARTH_RATE * np.cos(setting.site.latitude)

    def turned(quat: Array, rate: Array) -> Array:
        a = np.arctan2(rate[0], rate[1])
        return quat_to_matrix(multiply(rotvec_to_quat([0.0, 0.0, a]), quat))

    attitude = turned(f.quaternion, f.biases[:2])
    jacobian = np.zeros((3, 6))
    for k in range(5):
        x = np.zeros(6)
        x[k] = 1e-6 if k < 3 else 1e-6 * north
        moved = turned(multiply(rotvec_to_quat(-x[:3]), f.quaternion), f.biases[:2] - x[3:5])
        error = np.eye(3) - moved @ attitude.T
        jacobian[:, k] = np.array([error[2, 1], error[0, 2], error[1, 0]]) / x[k]
    pick = np.array([0, 1, 2, 6, 7, 8])
    budget = {}
    for name, part in zip(_PARTS, f.parts, strict=True):
        covariance = jacobian @ part[np.ix_(pick, pick)] @ jacobian.T
        if covariance[2, 2] > 0:
            budget[name] = covariance
    sigma = 0.0 if setting.spec is None else setting.spec.gyro.bias
    budget["gyro_bias"] = np.diag([0.0, 0.0, (sigma / north) ** 2])
    azimuth = np.arctan2(out[:, 11], out[:, 12])
    turn = rotvec_to_quat(np.column_stack([np.zeros((len(out), 2)), azimuth]))
    passed = _passed(out, record)
    sides = np.column_stack([np.cos(azimuth), -np.sin(azimuth)])
    across = np.sqrt(np.sum(sides**2 * out[:, 18:20], axis=1)) / north
    passed = FinePass(
        passed.t, np.asarray(multiply(turn, passed.quaternion)),
        np.column_stack([passed.sigma[:, :2], np.hypot(across, sigma / north)]),
        np.full_like(passed.gyro_bias, np.nan), passed.accel_bias, passed.innovation,
    )  # fmt: skip
    return FineResult(attitude, budget, None, None, passed, int(f.state[37]), int(f.state[38]))
