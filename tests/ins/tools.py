"""Kernel arrays of a filter, and errors put into a nominal navigation and read from two of them."""

from __future__ import annotations

import numpy as np

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.earth import Site
from schuler.ins import Layout
from schuler.ins.frames import frame_quaternion
from schuler.kernels import ins_layout as kernel
from schuler.kernels import strapdown
from schuler.kernels.nominal_steps import move_position, take_sample

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
SITE = Site(55.0, 10.0, 2000.0)
INSTRUMENT = tuple(
    f"{sensor}_{part}"
    for part in ("bias", "markov", "scale", "matrix")
    for sensor in ("gyro", "accelerometer")
)
#: sizes of perturbations by group
SIZES = {
    "phi": 1e-5, "velocity": 1e-2, "position": 10.0, "gyro_bias": 1e-5, "gyro_markov": 1e-5,
    "accelerometer_bias": 1e-3, "accelerometer_markov": 1e-3, "gyro_scale": 1e-5,
    "accelerometer_scale": 1e-5, "gyro_matrix": 1e-5, "accelerometer_matrix": 1e-5,
    "frame_rate": 1e-6,
}  # fmt: skip


def nominal(quat, v, place: Site = SITE):
    """Return a kernel's state."""
    s = np.zeros(kernel.STATE_SIZE)
    s[kernel.QUAT_NB : kernel.QUAT_NB + 4] = quat
    s[kernel.QUAT_START : kernel.QUAT_START + 4] = quat
    s[kernel.V_N : kernel.V_N + 3] = v
    s[kernel.QUAT_NE : kernel.QUAT_NE + 4] = frame_quaternion(place.latitude, place.longitude)
    s[kernel.HEIGHT] = place.height
    return s


def settings(fixed: bool, vertical: bool = True):
    """Return cfg and options."""
    cfg = np.zeros(kernel.CFG_SIZE)
    cfg[kernel.FIXED_PLACE] = fixed
    cfg[kernel.EARTH : kernel.EARTH + 3] = SITE.earth_rate
    cfg[kernel.GRAVITY] = SITE.gravity
    cfg[kernel.VERTICAL] = not vertical
    cfg[kernel.CONING] = cfg[kernel.SCULLING] = 1.0
    cfg[kernel.STEP] = 1e9
    options = np.zeros(strapdown.OPTIONS)
    options[2] = strapdown.FREE if vertical else strapdown.OFF
    return cfg, options


def with_error(layout: Layout, state, est, x, fixed: bool):
    """Return a state and parameters that are off by an error state x (n,)."""
    s, est = state.copy(), est.copy()
    q = slice(kernel.QUAT_NB, kernel.QUAT_NB + 4)
    s[q] = multiply(rotvec_to_quat(-x[:3]), s[q])
    s[kernel.V_N : kernel.V_N + 3] += x[3:6]
    if "position" in layout:
        d = x[layout["position"]]
        if fixed:
            s[kernel.DISPLACEMENT : kernel.DISPLACEMENT + 3] += d
        else:
            move_position(s, tuple(d))
    rest = np.arange(layout.size) >= (9 if "position" in layout else 6)
    sign = layout.sign[: layout.size]
    est[: layout.size] -= np.where(rest, np.where(sign > 0, 1.0, -1.0) * x, 0.0)
    return s, est


def error_between(layout: Layout, one, other, fixed: bool):
    """Return the error (6 or 9,) of one state against another that is near."""
    q = slice(kernel.QUAT_NB, kernel.QUAT_NB + 4)
    v = slice(kernel.V_N, kernel.V_N + 3)
    out = [-quat_to_rotvec(multiply(one[q], other[q] * CONJUGATE)), one[v] - other[v]]
    if "position" in layout:
        if fixed:
            d = slice(kernel.DISPLACEMENT, kernel.DISPLACEMENT + 3)
            out.append(one[d] - other[d])
        else:
            out.append(moved(other, one))
    return np.concatenate(out)


def moved(begin, end):
    """Return the way (3,) from one position to another, in the frame of the first."""
    p = slice(kernel.QUAT_NE, kernel.QUAT_NE + 4)
    turn = quat_to_rotvec(multiply(begin[p] * CONJUGATE, end[p]))
    z = quat_to_matrix(begin[p])[2]
    a, k, *_ = strapdown.ellipsoid(z[2] ** 2, begin[kernel.HEIGHT], strapdown.SOMIGLIANA, 0.0)
    curvature = a * np.eye(2) + k * np.outer(z[:2], z[:2])
    level = np.linalg.solve(curvature, [turn[1], -turn[0]])
    return np.array([*level, end[kernel.HEIGHT] - begin[kernel.HEIGHT]])


def propagate(layout: Layout, state, est, rates, forces, dt, fixed: bool, vertical: bool = True):
    """Navigate over samples of mean rate and force; return the state."""
    cfg, options = settings(fixed, vertical)
    s, survey, none = state.copy(), np.zeros(strapdown.STATE_SIZE), np.zeros(0)
    for w, f in zip(rates, forces, strict=True):
        take_sample(
            s, survey, est, layout.at, cfg, options, dt, 1.0, tuple(dt * w), tuple(dt * f), none
        )
        s[kernel.CONSUMED] = 0.0
    return s


def sizes_of(layout: Layout):
    """Return the size of the perturbation of each state."""
    return np.concatenate([np.full(layout[g].stop - layout[g].start, SIZES[g]) for g in layout])
