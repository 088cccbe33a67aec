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

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.intervals import Intervals
from schuler.alignment.methods import KalmanAlignment
from schuler.alignment.stationary.inertial import MINIMUM_ROWS, solve
from schuler.alignment.stationary.kalman_setting import KalmanSetting, vehicle_motion
from schuler.alignment.stationary.optimal import Linearisation, OptimalAlignment, joint
from schuler.attitude import (
    multiply,
    nearest_quat,
    quat_to_matrix,
    rotvec_to_quat,
)
from schuler.constants import EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import (
    ErrorStateFilter,
)
from schuler.sensors import ImuSpec

__all__ = ["FilterHistory", "KalmanResult", "kalman_alignment"]

Array = NDArray[np.float64]


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

    Examples
    --------
    >>> kept = sc.align(record, site, "kalman", spec).filter_history
    >>> bool(kept.sigma[-1, 2] < kept.sigma[0, 2])
    True
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
    setting = KalmanSetting(
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


def _smoothed(setting: KalmanSetting, q: Array, biases: Array) -> KalmanResult:
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


def _wandering(setting: KalmanSetting, q: Array, at_end: bool) -> KalmanResult:
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
