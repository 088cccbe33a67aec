"""The classical two-stage gyrocompass loop, and its covariance.

The level loop (a double pole) and the azimuth loop (a triple pole) have fixed gains, so the errors
are those of a linear system that does not change: covariance and the answer to biases follow from
its recursion.

Source: Britting (1971), chapter 9; gains by placing all poles of a stage at one place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.intervals import Intervals
from schuler.alignment.methods import Gyrocompass
from schuler.alignment.stationary.disturbance import disturbance_levels
from schuler.alignment.stationary.inertial import residual, solve
from schuler.alignment.stationary.kalman import FilterHistory, KalmanResult
from schuler.alignment.stationary.kalman_setting import vehicle_motion
from schuler.attitude import nearest_quat, quat_to_matrix
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import Layout
from schuler.kernels import ins_layout as kernel
from schuler.sensors import ImuSpec

__all__ = ["compass_alignment"]

Array = NDArray[np.float64]

SHORTEST = 40.0
"""A record (s) without which the loops cannot settle."""

_POLES = 9.0
"""Pole of the azimuth stage times its length: what is left of the start is e^-9 (1 + 9 + 40)."""

_START = np.array([0.1 * DEG, 0.1 * DEG, 5.0 * DEG, 0.05, 0.05])
"""Errors of the coarse start (phi, level velocity), 1 sigma, at least."""


def _gains(pole: float, g: float, north: float, azimuth: bool) -> Array:
    if azimuth:
        return np.array([3 * pole, 3 * pole**2 / g, pole**3 / (g * north), 2 * pole, pole**2 / g])
    return np.array([2 * pole, pole**2 / g, 0.0, 2 * pole, pole**2 / g])


def _system(gains: Array, g: float, rate: Array) -> Array:
    """Return the matrix (5, 5) of phi east, north, up and velocity east, north."""
    _, wn, wu = rate
    a = np.zeros((5, 5))
    a[0, 1], a[0, 2], a[0, 4] = wu, -wn, -gains[1]
    a[1, 0], a[1, 3] = -wu, gains[4]
    a[2, 0], a[2, 4] = wn, gains[2]
    a[3, 1], a[3, 3] = -g, -gains[3]
    a[4, 0], a[4, 4] = g, -gains[0]
    return a


def compass_alignment(
    h: History, site: Site, method: Gyrocompass, spec: ImuSpec | None
) -> KalmanResult:
    """Return the attitude at the end by the gyrocompass loop.

    Parameters
    ----------
    h : History
        Its first part gives the coarse start, all of it what moves.
    site : Site
    method : Gyrocompass
    spec : ImuSpec or None

    Raises
    ------
    InputError
        For a record too short to settle.
    """
    from scipy.linalg import expm

    from schuler.kernels.compass import gyrocompass

    if h.duration < SHORTEST:
        raise InputError(
            f"a gyrocompass loop needs {SHORTEST:g} s to settle, the record has {h.duration:.4g} s"
        )
    g, lat, rate = site.gravity, site.latitude, site.earth_rate
    row = int(np.searchsorted(h.t, max(0.15 * h.duration, 20.0)))
    r = solve(h.until(row), g, lat, "centred")
    layout = Layout(["phi", "velocity"])
    state, cfg = np.zeros(kernel.STATE_SIZE), np.zeros(kernel.CFG_SIZE)
    state[kernel.QUAT_NB : kernel.QUAT_NB + 4] = nearest_quat(inertial_to_local(0.0, lat) @ r)
    cfg[kernel.FIXED_PLACE], cfg[kernel.GRAVITY] = 1.0, g
    cfg[kernel.EARTH : kernel.EARTH + 3] = rate
    # The vertical channel is no part of it.
    cfg[kernel.VERTICAL] = 1.0
    first = method.level_share * h.duration
    pole = method.pole or _POLES / (h.duration - first)
    gains = np.stack([_gains(8.0 / first, g, rate[1], False), _gains(pole, g, rate[1], True)])
    intervals = Intervals.of(h, h.duration / (len(h) - 1))
    steps = intervals.record
    out = np.zeros((len(steps), 5))
    gyrocompass(
        state, np.zeros(layout.padded), layout.at, cfg, gains, h.start + first, steps.time,
        steps.dt, steps.dtheta, steps.dvel, intervals.inside, out,
    )  # fmt: skip

    levels = disturbance_levels(residual(h, site), g, spec, h.sampling_faults).mean
    _, place, _ = vehicle_motion(h, r, site, 1.0)
    _, c, b, a = levels
    names = ("start", "gyro_angle_random_walk", "accelerometer_velocity_random_walk", "disturbance")
    parts = {name: np.zeros((5, 5)) for name in names}
    parts["start"] = np.diag(_START**2)
    gyro = spec.gyro.white if spec else 0.0
    accel = spec.accelerometer.white if spec else 0.0
    answer = np.zeros((5, 6))
    # What a bias in level axes puts in: phi' = -eps, v' = nabla.
    put = np.zeros((5, 6))
    put[:3, :3] = -np.eye(3)
    put[3:, 3:5] = np.eye(2)
    step = 1.0
    none, both = np.zeros(3), np.zeros(2)
    stages = []
    for now in gains:
        system = _system(now, g, rate)
        phi, middle = expm(system * step), expm(0.5 * system * step)
        # The vehicle's velocity goes in where the velocity's error does.
        seen = np.zeros((5, 2))
        seen[1, 0], seen[3, 0] = now[4], -now[3]
        seen[0, 1], seen[2, 1], seen[4, 1] = -now[1], now[2], -now[0]
        put_in = {
            "gyro_angle_random_walk": np.diag([*(none + gyro**2), *both]),
            "accelerometer_velocity_random_walk": np.diag([*none, *(both + accel**2)]),
            "disturbance": np.diag([*(none + a), *(both + b)]) + c * seen @ seen.T,
        }
        noise = {name: middle @ each @ middle.T * step for name, each in put_in.items()}
        stages.append((phi, middle @ put * step, noise, seen))
    sigma = []
    for k in range(round(h.duration / step)):
        phi, bias_in, noise, seen = stages[0] if k * step < first else stages[1]
        for name in names:
            parts[name] = phi @ parts[name] @ phi.T
            if name in noise:
                parts[name] += noise[name]
        answer = phi @ answer + bias_in
        sigma.append(np.sqrt(np.diag(sum(parts.values(), np.zeros((5, 5))))[:3]))
    # What the last displacement has put in has not averaged out yet.
    parts["disturbance"] += place * seen @ seen.T
    attitude = quat_to_matrix(out[-1, 1:])
    budget = {name: part[:3, :3] for name, part in parts.items()}
    if spec is not None:
        budget["gyro_bias"] = spec.gyro.bias**2 * answer[:3, :3] @ answer[:3, :3].T
        budget["accelerometer_bias"] = (
            spec.accelerometer.bias**2 * answer[:3, 3:] @ answer[:3, 3:].T
        )
    rows = np.searchsorted(steps.time, h.start + step * np.arange(1, len(sigma) + 1) - 1e-9)
    rows = np.minimum(rows, len(steps) - 1)
    nothing = np.zeros((len(rows), 3))
    passed = FilterHistory(
        out[rows, 0] - h.start,
        out[rows, 1:],
        np.array(sigma),
        nothing,
        nothing,
        np.zeros(len(rows)),
    )  # fmt: skip
    return KalmanResult(attitude, budget, np.zeros(6), np.zeros((6, 6)), passed, 0, 0)
