"""The nominal navigation of the error-state filter: samples, intervals, and corrections.

At a fixed place a sample may be an interval of many samples, known by its integrals.
"""

from __future__ import annotations

from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import helper, kernel
from schuler.kernels.entries import four, put_four, put_three, three
from schuler.kernels.increments import normalised, previous_pair, rotated_velocity
from schuler.kernels.quat import qexp, qmul, qrotate, quat_to_matrix
from schuler.kernels.strapdown import SOMIGLIANA, advance, ellipsoid, spin_axis
from schuler.kernels.vec import add, axpy, cross, scale


@helper
def _sensor_error(est, at, bias, markov, diagonal, matrix, t, x):
    """Return what the estimated errors make of an increment x over t seconds."""
    out = (0.0, 0.0, 0.0)
    if at[bias] >= 0:
        out = axpy(t, three(est, at[bias]), out)
    if at[markov] >= 0:
        out = axpy(t, three(est, at[markov]), out)
    if at[diagonal] >= 0:
        k = at[diagonal]
        out = (out[0] + est[k] * x[0], out[1] + est[k + 1] * x[1], out[2] + est[k + 2] * x[2])
    if at[matrix] >= 0:
        k = at[matrix]
        out = (
            out[0] + est[k] * x[0] + est[k + 1] * x[1] + est[k + 2] * x[2],
            out[1] + est[k + 3] * x[0] + est[k + 4] * x[1] + est[k + 5] * x[2],
            out[2] + est[k + 6] * x[0] + est[k + 7] * x[1] + est[k + 8] * x[2],
        )
    return out


@helper
def _accumulate(state, at, t, rows, a, f, force):
    """Add to the sums of a step: the mean attitude of a sample, its increments, the force in n."""
    for i in range(3):
        for j in range(3):
            state[layout.MEAN_C + 3 * i + j] += t * rows[i][j]
        state[layout.MEAN_F + i] += force[i]
    state[layout.SPAN] += t
    if at[layout.GYRO_SCALE] >= 0 or at[layout.GYRO_MATRIX] >= 0:
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    state[layout.GYRO_PRODUCT + 9 * i + 3 * j + k] += rows[i][j] * a[k]
    if at[layout.ACCELEROMETER_SCALE] >= 0 or at[layout.ACCELEROMETER_MATRIX] >= 0:
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    state[layout.FORCE_PRODUCT + 9 * i + 3 * j + k] += rows[i][j] * f[k]


@kernel
def take_sample(state, survey, est, at, cfg, options, t, part, a, f, inside):
    """Navigate over a part of a sample.

    Parameters
    ----------
    state, survey, est, at, cfg, options
        As in `run`.
    t : float
        Length of the whole sample, s.
    part : float
        How much of it is taken, up to 1.
    a, f : tuple of float
        Increments of angle and velocity of the whole sample.
    inside : (7,) or (0,) float64
        As a row in `run`.
    """
    if state[layout.SPENT] != 0.0:
        for k in range(layout.SPAN, layout.SUMS_END):
            state[k] = 0.0
        state[layout.SPENT] = 0.0
    h = part * t
    raw_a, raw_f = scale(part, a), scale(part, f)
    error_a = _sensor_error(
        est, at, layout.GYRO_BIAS, layout.GYRO_MARKOV, layout.GYRO_SCALE, layout.GYRO_MATRIX,
        h, raw_a,
    )  # fmt: skip
    error_f = _sensor_error(
        est, at, layout.ACCELEROMETER_BIAS, layout.ACCELEROMETER_MARKOV, layout.ACCELEROMETER_SCALE,
        layout.ACCELEROMETER_MATRIX, h, raw_f,
    )  # fmt: skip
    q, v = four(state, layout.QUAT_NB), three(state, layout.V_N)
    if inside.shape[0] > 0:
        interval(state, at, cfg, est, h, a, f, error_a, error_f, inside, q, v)
        return
    ta, tv = axpy(-1.0, error_a, raw_a), axpy(-1.0, error_f, raw_f)
    # The whole sample beside the one before, of which a part takes its share.
    whole_a, whole_f = scale(1.0 / part, ta), scale(1.0 / part, tv)
    con, scu = previous_pair(
        three(state, layout.ANGLE_BEFORE), three(state, layout.VELOCITY_BEFORE), whole_a, whole_f
    )
    con, scu = scale(part, con), scale(part, scu)
    if state[layout.SAMPLES] > 0.0:
        # Means of this sample and the one before, half a sample behind their ends.
        turn = scale(1.0 / (t * t), axpy(-1.0, three(state, layout.ANGLE_BEFORE), whole_a))
    else:
        turn = (0.0, 0.0, 0.0)
    ahead = (state[layout.CONSUMED] + part - 0.5) * t
    put_three(state, layout.RATE_NOW, axpy(ahead, turn, scale(1.0 / h, ta)))
    weight = h / (layout.ACCELERATION_TIME + h) if state[layout.SAMPLES] > 0.0 else 1.0
    for c in range(3):
        state[layout.MEAN_RATE + c] += weight * (ta[c] / h - state[layout.MEAN_RATE + c])
    rows = quat_to_matrix(qmul(q, qexp(scale(0.5, ta))))
    if cfg[layout.FIXED_PLACE] == 0.0:
        q, v, p, height, accel_n, force = advance(
            survey, options, cfg[layout.HELD_HEIGHT], h, ta, tv, con, scu,
            cfg[layout.CONING], cfg[layout.SCULLING], q, v, four(state, layout.QUAT_NE),
            state[layout.HEIGHT], three(state, layout.ACCELERATION),
        )  # fmt: skip
        put_four(state, layout.QUAT_NE, p)
        state[layout.HEIGHT] = height
        put_three(state, layout.ACCELERATION, accel_n)
    else:
        q, v, force = _fixed(state, at, cfg, est, h, ta, tv, con, scu, q, v)
    put_four(state, layout.QUAT_NB, q)
    _average(state, h, v)
    put_three(state, layout.V_N, v)
    put_three(state, layout.RATE_B, scale(1.0 / h, ta))
    _accumulate(state, at, h, rows, raw_a, raw_f, force)
    if state[layout.CONSUMED] + part > 1.0 - 1e-12:
        put_three(state, layout.ANGLE_BEFORE, whole_a)
        put_three(state, layout.VELOCITY_BEFORE, whole_f)


@helper
def _earth(at, cfg, est):
    earth = three(cfg, layout.EARTH)
    if at[layout.FRAME_RATE] >= 0:
        earth = add(earth, three(est, at[layout.FRAME_RATE]))
    return earth


@helper
def _average(state, h, v):
    """Turn the mean acceleration with the frame to a new velocity."""
    weight = h / (layout.ACCELERATION_TIME + h) if state[layout.SAMPLES] > 0.0 else 1.0
    for c in range(3):
        now = (v[c] - state[layout.V_N + c]) / h
        state[layout.MEAN_ACCELERATION + c] += weight * (now - state[layout.MEAN_ACCELERATION + c])


@helper
def _fixed(state, at, cfg, est, h, ta, tv, con, scu, q, v):
    """Return attitude, velocity and the force in n after an update at a fixed place."""
    u = rotated_velocity(cfg[layout.SCULLING], ta, tv, scu)
    frame = scale(h, _earth(at, cfg, est))
    dv = qrotate(q, u)
    dv = axpy(-0.5, cross(frame, dv), dv)
    turned = qexp(axpy(cfg[layout.CONING], con, ta))
    q = normalised(qmul(qmul(qexp(scale(-1.0, frame)), q), turned))
    change = axpy(-2.0, cross(frame, v), dv)
    climb = 0.0 if cfg[layout.VERTICAL] != 0.0 else v[2] + change[2] - h * cfg[layout.GRAVITY]
    w = (v[0] + change[0], v[1] + change[1], climb)
    for c in range(3):
        state[layout.DISPLACEMENT + c] += 0.5 * h * (v[c] + w[c])
        state[layout.ACCELERATION + c] = (w[c] - v[c]) / h
    return q, w, dv


@helper
def interval(state, at, cfg, est, t, a, f, error_a, error_f, inside, q, v):
    """Navigate over an interval that is known by its integrals, at a fixed place.

    `a` is the rotation vector over it, `f` the velocity increment and inside[4:7] the displacement
    that it makes, both in the body axes of the interval's start; inside[:4] is the mean rotation
    from the body to those axes. Errors act along the mean attitude.
    """
    mean = (inside[0], inside[1], inside[2], inside[3])
    off_a, off_f = qrotate(mean, error_a), qrotate(mean, error_f)
    place = (inside[4], inside[5], inside[6])
    # The rotation that a gyro error makes has grown to half, of a displacement to a third.
    u = axpy(-1.0, off_f, axpy(-0.5, cross(off_a, f), f))
    place = axpy(-0.5 * t, off_f, axpy(-1.0 / 3.0, cross(off_a, place), place))
    frame = scale(t, _earth(at, cfg, est))
    dv, dr = qrotate(q, u), qrotate(q, place)
    dv = axpy(-0.5, cross(frame, dv), dv)
    dr = axpy(-1.0 / 3.0, cross(frame, dr), dr)
    rows = quat_to_matrix(qmul(q, mean))
    turned = qmul(qexp(scale(-1.0, off_a)), qexp(a))
    q = normalised(qmul(qmul(qexp(scale(-1.0, frame)), q), turned))
    put_four(state, layout.QUAT_NB, q)
    coriolis = cross(frame, v)
    free = 0.0 if cfg[layout.VERTICAL] != 0.0 else 1.0
    drop = (0.0, 0.0, t * cfg[layout.GRAVITY])
    for c in range(3):
        on = free if c == 2 else 1.0
        change = on * (dv[c] - 2.0 * coriolis[c] - drop[c])
        state[layout.DISPLACEMENT + c] += on * (
            t * v[c] + dr[c] - t * coriolis[c] - 0.5 * t * drop[c]
        )
        state[layout.V_N + c] = v[c] + change
        state[layout.ACCELERATION + c] = change / t
    put_three(state, layout.RATE_B, scale(1.0 / t, axpy(-1.0, error_a, a)))
    _accumulate(state, at, t, rows, a, f, dv)


@kernel
def feed_back(state, est, x, at, cfg, sign):
    """Take the error estimates off the nominal; what stays in x is not fed back.

    Parameters
    ----------
    state, est, x, at, cfg
        As in `run`.
    sign : (size,) float64
        +1 where the state is truth minus estimate, -1 for the contrary, 0 where it is kept.
    """
    phi = (x[0], x[1], x[2])
    put_four(state, layout.QUAT_NB, qmul(qexp(phi), four(state, layout.QUAT_NB)))
    for c in range(3):
        state[layout.V_N + c] -= x[3 + c]
        x[3 + c] = 0.0
    if at[layout.POSITION] >= 0:
        d = (x[6], x[7], x[8])
        if cfg[layout.FIXED_PLACE] != 0.0:
            for c in range(3):
                state[layout.DISPLACEMENT + c] -= d[c]
        else:
            move_position(state, (-d[0], -d[1], -d[2]))
        x[6] = x[7] = x[8] = 0.0
    if at[layout.BASE] >= 0:
        # The start is corrected along: the rotation since then is that of true axes.
        put_four(state, layout.QUAT_START, qmul(qexp(phi), four(state, layout.QUAT_START)))
        for c in range(3):
            x[at[layout.BASE] + c] -= x[c]
    x[0] = x[1] = x[2] = 0.0
    for i in range(6, x.shape[0]):
        if sign[i] != 0.0:
            est[i] += sign[i] * x[i]
            x[i] = 0.0


@kernel
def move_position(state, d):
    """Move the position by d (frame axes, m), a way that is small beside the Earth.

    The wander frame goes along without a rotation about its up axis, and attitude and velocity
    keep their components, as the error equations take them.
    """
    q = four(state, layout.QUAT_NE)
    z = spin_axis(q)
    a, k, _, _, _ = ellipsoid(z[2] * z[2], state[layout.HEIGHT], SOMIGLIANA, 0.0)
    along = k * (z[0] * d[0] + z[1] * d[1])
    turn = (-(a * d[1] + along * z[1]), a * d[0] + along * z[0], 0.0)
    put_four(state, layout.QUAT_NE, qmul(q, qexp(turn)))
    state[layout.HEIGHT] += d[2]
