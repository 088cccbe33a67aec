"""Strapdown navigation in ENU: attitude, velocity and position from increments, resumable.

Coning and sculling as in `schuler.kernels.tracking`; gravity, Coriolis and the turn of the frame
are taken at the middle of each update, with velocity carried there by the last acceleration
(Savage, 1998, parts 1 and 2).

State: 0-3 q_b^n, 4-6 velocity east, north, up, 7 latitude, 8 longitude (rad), 9 height (m), 10-12
acceleration of the last update, 13 updates, 14 time of the last update; 42 on as in tracking
(samples before and samples waiting).
"""

from __future__ import annotations

import math

from schuler.constants import EARTH_A, EARTH_RATE
from schuler.kernels._jit import kernel
from schuler.kernels.earth import gravity_of_sine, radii_of_sine
from schuler.kernels.quat import qexp, qmul, qrotate, rotation_averages
from schuler.kernels.tracking import combine
from schuler.kernels.vec import add, axpy, cross, scale

STATE_SIZE = 80


@kernel
def navigate(state, n_sub, coning, sculling, time, dt, dtheta, dvel, out):
    """Feed a chunk of samples.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        The start: attitude, velocity, position; the rest zero.
    n_sub : int
        Samples to an update, 1 to 4 (1 uses the sample before as well).
    coning, sculling : float
        1 to correct, 0 where the instrument has done it.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    out : (n, 11) float64
        One row an update: time, q, velocity, latitude, longitude, height.

    Returns
    -------
    int
        Rows written.
    """
    s = state
    rows = 0
    for i in range(time.shape[0]):
        k = int(s[48])
        j = 49 + 6 * k
        for c in range(3):
            s[j + c] = dtheta[i, c]
            s[j + 3 + c] = dvel[i, c]
        s[15] += dt[i]
        if k + 1 < n_sub:
            s[48] = k + 1.0
            continue
        s[48] = 0.0
        span = s[15]
        s[15] = 0.0
        ta, tv, con, scu = combine(s, n_sub)
        u = tv
        if sculling != 0.0:
            c1, c2 = rotation_averages(ta[0] * ta[0] + ta[1] * ta[1] + ta[2] * ta[2])
            x1 = cross(ta, tv)
            u = add(axpy(c1, x1, axpy(c2, cross(ta, x1), tv)), scu)

        # Where the middle of the update is, and how fast: by the last acceleration.
        v = (s[4], s[5], s[6])
        middle = axpy(0.5 * span, (s[10], s[11], s[12]), v)
        lat = s[7]
        sl, cl = math.sin(lat), math.cos(lat)
        rm, rn = radii_of_sine(sl)
        height = s[9] + 0.5 * span * middle[2]
        rm, rn = 1.0 / (rm + height), 1.0 / (rn + height)
        shift = 0.5 * span * middle[1] * rm
        sm, cm = sl + cl * shift, cl - sl * shift
        earth = (0.0, EARTH_RATE * cm, EARTH_RATE * sm)
        turn = (-middle[1] * rm, middle[0] * rn, middle[0] * rn * sm / cm)
        g0, slope = gravity_of_sine(sm)
        g = g0 * (1.0 + slope * height + 3.0 * height * height / (EARTH_A * EARTH_A))

        q = (s[0], s[1], s[2], s[3])
        frame = scale(span, add(earth, turn))
        dv = qrotate(q, u)
        # The frame turns while the force acts: half of its turn, to second order.
        f1 = cross(frame, dv)
        dv = axpy(-0.5, f1, axpy(1.0 / 6.0, cross(frame, f1), dv))
        bend = cross(add(scale(2.0, earth), turn), middle)
        dv = (
            dv[0] - span * bend[0],
            dv[1] - span * bend[1],
            dv[2] - span * (bend[2] + g),
        )
        after = add(v, dv)
        q = qmul(qmul(qexp(scale(-1.0, frame)), q), qexp(axpy(coning, con, ta)))
        m = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        s[0], s[1], s[2], s[3] = m * q[0], m * q[1], m * q[2], m * q[3]
        s[4], s[5], s[6] = after
        s[7] += 0.5 * span * (v[1] + after[1]) * rm
        s[8] += 0.5 * span * (v[0] + after[0]) * rn / cm
        s[9] += 0.5 * span * (v[2] + after[2])
        r = 1.0 / span
        s[10], s[11], s[12] = r * dv[0], r * dv[1], r * dv[2]
        s[13] += 1.0
        s[14] = time[i]
        for c in range(3):
            s[42 + c] = dtheta[i, c]
            s[45 + c] = dvel[i, c]
        out[rows, 0] = time[i]
        for c in range(10):
            out[rows, 1 + c] = s[c]
        rows += 1
    return rows
