"""Turns of an instrument between poses, and navigation on the spot."""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel
from schuler.kernels.increments import coned, normalised
from schuler.kernels.quat import qexp, qmul, qrotate
from schuler.kernels.vec import add, axpy, cross, scale


@kernel
def turned_directions(starts, stops, time, rate, bias, matrix, before, out):
    """Fill `out` with where directions seen before each turn are seen after it, by the gyros.

    Parameters
    ----------
    starts, stops : (m,) int64
        First and last sample of each turn.
    time, rate : (n,), (n, 3) float64
        s and instantaneous gyro output.
    bias : (m, 3) float64
        The output without rate, for each turn.
    matrix : (3, 3) float64
        rad/s = matrix (output - bias).
    before : (m, 3) float64
        Directions in body axes before the turn.
    out : (m, 3) float64
        The same directions in body axes after it.
    """
    for k in range(starts.shape[0]):
        q = (1.0, 0.0, 0.0, 0.0)
        for i in range(starts[k], stops[k]):
            h = time[i + 1] - time[i]
            a = 0.5 * (rate[i, 0] + rate[i + 1, 0]) - bias[k, 0]
            b = 0.5 * (rate[i, 1] + rate[i + 1, 1]) - bias[k, 1]
            c = 0.5 * (rate[i, 2] + rate[i + 1, 2]) - bias[k, 2]
            q = qmul(q, qexp((
                h * (matrix[0, 0] * a + matrix[0, 1] * b + matrix[0, 2] * c),
                h * (matrix[1, 0] * a + matrix[1, 1] * b + matrix[1, 2] * c),
                h * (matrix[2, 0] * a + matrix[2, 1] * b + matrix[2, 2] * c),
            )))  # fmt: skip
        # The inverse turn: body axes turn, the direction stays.
        w, x, y, z = q
        n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * n, -x * n, -y * n, -z * n
        u, v, t = before[k, 0], before[k, 1], before[k, 2]
        tx, ty, tz = 2.0 * (y * t - z * v), 2.0 * (z * u - x * t), 2.0 * (x * v - y * u)
        out[k, 0] = u + w * tx + y * tz - z * ty
        out[k, 1] = v + w * ty + z * tx - x * tz
        out[k, 2] = t + w * tz + x * ty - y * tx


@kernel
def navigate_on_the_spot(state, coning, sculling, earth, gravity, dt, dtheta, dvel, out):
    """Carry attitude and velocity on at a place that is known and does not move.

    Parameters
    ----------
    state : (13,) float64
        q_b^n, velocity (east, north, up), last dtheta and dvel; left ready for more.
    coning, sculling : float
        1 to correct increments by the sample before (Savage, 1998), 0 where the instrument has
        done it.
    earth, gravity : (3,) float64, float
        rad/s and m/s^2.
    dt, dtheta, dvel : (n,), (n, 3), (n, 3) float64
        Samples.
    out : (n, 7) float64
        q_b^n at the middle of each sample and, in the last three, velocity at its end.
    """
    q = (state[0], state[1], state[2], state[3])
    v = (state[4], state[5], state[6])
    a = (state[7], state[8], state[9])
    b = (state[10], state[11], state[12])
    w = (earth[0], earth[1], earth[2])
    for i in range(dt.shape[0]):
        h = dt[i]
        t = (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2])
        u = (dvel[i, 0], dvel[i, 1], dvel[i, 2])
        push = u
        turned = coned(coning, a, t)
        if sculling != 0.0:
            push = add(push, scale(1.0 / 12.0, add(cross(a, u), cross(b, t))))
            push = axpy(0.5, cross(t, u), push)
            push = axpy(1.0 / 6.0, cross(t, cross(t, u)), push)
        frame = scale(-h, w)
        middle = qmul(qmul(qexp(scale(0.5, frame)), q), qexp(scale(0.5, turned)))
        force = qrotate(qmul(qexp(scale(0.5, frame)), q), push)
        bend = cross(scale(2.0 * h, w), v)
        v = (
            v[0] + force[0] - bend[0],
            v[1] + force[1] - bend[1],
            v[2] + force[2] - bend[2] - gravity * h,
        )
        q = normalised(qmul(qmul(qexp(frame), q), qexp(turned)))
        a, b = t, u
        for c in range(4):
            out[i, c] = middle[c]
        for c in range(3):
            out[i, 4 + c] = v[c]
    state[0], state[1], state[2], state[3] = q
    state[4], state[5], state[6] = v
    state[7], state[8], state[9] = a
    state[10], state[11], state[12] = b
