"""Predicted values and rows of H of each kind of measurement.

A row's value is predicted minus measured, z = H x + noise. Positions and velocities are compared
east, north and up, whatever the azimuth of the wander frame. With l the lever arm, w the rate of
the body against the Earth, a the acceleration and tau the delay of the aid:

    position       r + C l - v_l tau                v_l = v + C (w x l)
    velocity       v_l - a tau
    body velocity  (1 + kappa) R (C^T v + w x l)    R from the body to the axes of the aid
    zero rate      b_g + C^T w_ie
    height         h + (C l)_up + offset
    heading        atan2(u_E, u_N), u = C baseline
    attitude       phi of C exp(-w tau) (C_m M)^T       M from the body to that of a master
    rate           w_ib - M^T w_m - w' tau

and at a fixed place the displacement since the start, the rotation of the base since then, and the
horizontal specific force.
"""

from __future__ import annotations

import math

from schuler.constants import EARTH_RATE
from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import helper, kernel
from schuler.kernels.entries import four, three
from schuler.kernels.quat import qconj, qexp, qlog, qmul, qrotate, quat_to_matrix
from schuler.kernels.strapdown import SOMIGLIANA, ellipsoid, spin_axis
from schuler.kernels.vec import add, axpy, cross, dot

# Kinds of measurements; `ins_layout.CUSTOM` is 9.
POSITION_FIX = 0
VELOCITY_FIX = 1
BODY_VELOCITY = 2
ZERO_RATE = 3
HEIGHT_FIX = 4
HEADING_FIX = 5
ZERO_DISPLACEMENT = 6
CONSTANT_BASE = 7
ZERO_FORCE = 8
ATTITUDE_FIX = 10
RATE_FIX = 11


@helper
def east_in_frame(q_ne):
    """Return cosine and sine of the angle from the wander frame's x axis to east."""
    r0, r1, _ = quat_to_matrix(q_ne)
    level = math.hypot(r0[2], r1[2])
    cl, sl = (r0[2] / level, r1[2] / level) if level > 0.0 else (1.0, 0.0)
    x, y = -sl * r0[0] + cl * r1[0], -sl * r0[1] + cl * r1[1]
    size = math.hypot(x, y)
    return x / size, y / size


@helper
def offset_from(q_ne, height, lat, lon, other):
    """Return how far the position lies from latitude, longitude and height, frame axes, m."""
    r0, r1, r2 = quat_to_matrix(q_ne)
    cl = math.cos(lat)
    ux, uy, uz = cl * math.cos(lon), cl * math.sin(lon), math.sin(lat)
    x = r0[0] * ux + r1[0] * uy + r2[0] * uz
    y = r0[1] * ux + r1[1] * uy + r2[1] * uz
    up = r0[2] * ux + r1[2] * uy + r2[2] * uz
    level = math.hypot(x, y)
    angle = math.atan2(level, up) / level if level > 1e-12 else 1.0
    x, y = angle * x, angle * y
    # The normal turns by K d over a way d: the inverse of the curvature tensor.
    z = spin_axis(q_ne)
    a, k, _, _, _ = ellipsoid(z[2] * z[2], height, SOMIGLIANA, 0.0)
    along = k * (z[0] * x + z[1] * y) / (a + k * (z[0] * z[0] + z[1] * z[1]))
    return -(x - along * z[0]) / a, -(y - along * z[1]) / a, height - other


@helper
def right_jacobian_row(row, turn):
    """Return row J, where exp(turn + d) = exp(turn) exp(J d) for small d."""
    angle2 = dot(turn, turn)
    if angle2 < 1e-6:
        first, second = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = math.sqrt(angle2)
        first = (1.0 - math.cos(angle)) / angle2
        second = (angle - math.sin(angle)) / (angle2 * angle)
    # row [turn x] = row x turn.
    once = cross(row, turn)
    return axpy(second, cross(once, turn), axpy(-first, once, row))


@helper
def rate_of_change(row, state, of_row):
    """Return the rate by which a delay is multiplied, and its rate of change, body axes."""
    if of_row:
        return three(row, layout.M_RATE), three(row, layout.M_RATE + 3)
    mean = three(state, layout.MEAN_RATE)
    # Of an average that follows with a time constant, the rate of change.
    change = axpy(-1.0, mean, three(state, layout.RATE_B))
    return mean, axpy(1.0 / layout.ACCELERATION_TIME, change, (0.0, 0.0, 0.0))


@kernel
def fill_rows(row, aid, state, est, at, cfg, transition, h, z, r):
    """Fill the rows of one measurement; return how many there are.

    Parameters
    ----------
    row : (M_SIZE,) float64
        Of the table of measurements.
    aid : (A_SIZE,) float64
    state, est, at, cfg
        See `schuler.kernels.ins_layout`; est (size,) holds the estimates of the parameters.
    transition : (9, size) float64
        Of the last step.
    h, z, r : (3, size), (3,), (3,) float64
        Rows of H, predicted minus measured, variances; filled.
    """
    kind = int(row[layout.M_KIND])
    size = h.shape[1]
    for i in range(3):
        for j in range(size):
            h[i, j] = 0.0
        z[i] = 0.0
    fixed = cfg[layout.FIXED_PLACE] != 0.0
    q, v = four(state, layout.QUAT_NB), three(state, layout.V_N)
    c = quat_to_matrix(q)
    at_lever, at_delay = int(aid[layout.A_AT_LEVER]), int(aid[layout.A_AT_DELAY])
    lever, tau = three(aid, layout.A_LEVER), aid[layout.A_DELAY]
    if at_lever >= 0:
        lever = add(lever, three(est, at_lever))
    if at_delay >= 0:
        tau += est[at_delay]
    if fixed:
        earth = three(cfg, layout.EARTH)
    else:
        s = spin_axis(four(state, layout.QUAT_NE))
        earth = (EARTH_RATE * s[0], EARTH_RATE * s[1], EARTH_RATE * s[2])
    rate_b = three(state, layout.RATE_B)
    if aid[layout.A_RATE_NOW] != 0.0:
        rate_b = three(state, layout.RATE_NOW)
    w = axpy(-1.0, qrotate(qconj(q), earth), rate_b)
    if fixed:
        # At a fixed place the Earth's share is nothing beside a lever of metres.
        w = three(state, layout.RATE_B)
    of_row = aid[layout.A_RATE_NOW] == 2.0
    if of_row:
        w = three(row, layout.M_RATE)
    arm = cross(w, lever)
    rotated = qrotate(q, arm)
    v_l = add(v, rotated)
    if kind in (POSITION_FIX, VELOCITY_FIX):
        if kind == POSITION_FIX:
            d = offset_from(
                four(state, layout.QUAT_NE), state[layout.HEIGHT],
                row[layout.M_VALUE], row[layout.M_VALUE + 1],
                row[layout.M_VALUE + 2],
            )  # fmt: skip
            place = qrotate(q, lever)
            # Over a tenth of a second a car that brakes moves by centimetres to second order.
            acceleration = three(state, layout.MEAN_ACCELERATION)
            change = axpy(-tau, acceleration, v_l)
            value = axpy(-tau, axpy(-0.5 * tau, acceleration, v_l), add(d, place))
            turned = place
        else:
            acceleration = three(state, layout.MEAN_ACCELERATION)
            if aid[layout.A_RATE_NOW] != 0.0:
                mean, faster = rate_of_change(row, state, of_row)
                swing = add(cross(faster, lever), cross(mean, cross(mean, lever)))
                acceleration = add(acceleration, qrotate(q, swing))
            value = axpy(-tau, acceleration, v_l)
            change = acceleration
            turned = rotated
        ce, se = 1.0, 0.0
        if not fixed:
            ce, se = east_in_frame(four(state, layout.QUAT_NE))
        for i in range(3):
            if i == 0:
                axis = (ce, se, 0.0)
            elif i == 1:
                axis = (-se, ce, 0.0)
            else:
                axis = (0.0, 0.0, 1.0)
            z[i] = dot(axis, value)
            if kind == VELOCITY_FIX:
                z[i] -= row[layout.M_VALUE + i]
            # [turned x] phi = turned x phi; as a row: axis x turned.
            of_phi = cross(axis, turned)
            body = (
                axis[0] * c[0][0] + axis[1] * c[1][0] + axis[2] * c[2][0],
                axis[0] * c[0][1] + axis[1] * c[1][1] + axis[2] * c[2][1],
                axis[0] * c[0][2] + axis[1] * c[1][2] + axis[2] * c[2][2],
            )
            first = 6 if kind == POSITION_FIX else 3
            # -[l x] eps in body axes, as a row: l x body.
            of_gyro = cross(lever, body)
            of_lever = body if kind == POSITION_FIX else cross(body, w)
            for n in range(3):
                h[i, n] = of_phi[n]
                h[i, first + n] = axis[n]
                if kind == VELOCITY_FIX:
                    if at[layout.GYRO_BIAS] >= 0 and not of_row:
                        h[i, at[layout.GYRO_BIAS] + n] = of_gyro[n]
                    if at[layout.GYRO_MARKOV] >= 0 and not of_row:
                        h[i, at[layout.GYRO_MARKOV] + n] = of_gyro[n]
                elif tau != 0.0:
                    h[i, 3 + n] = -tau * axis[n]
                if at_lever >= 0:
                    h[i, at_lever + n] = of_lever[n]
            if at_delay >= 0:
                h[i, at_delay] = -dot(axis, change)
    elif kind == BODY_VELOCITY:
        mount = four(aid, layout.A_MOUNT)
        scale = 1.0 + aid[layout.A_SCALE]
        at_scale = int(aid[layout.A_AT_SCALE])
        if at_scale >= 0:
            scale += est[at_scale]
        turn = (
            est[int(aid[layout.A_AT_MOUNT])] if aid[layout.A_AT_MOUNT] >= 0.0 else 0.0,
            est[int(aid[layout.A_AT_MOUNT + 1])] if aid[layout.A_AT_MOUNT + 1] >= 0.0 else 0.0,
            est[int(aid[layout.A_AT_MOUNT + 2])] if aid[layout.A_AT_MOUNT + 2] >= 0.0 else 0.0,
        )
        mount = qmul(qexp(turn), mount)
        rows = quat_to_matrix(mount)
        body = add(qrotate(qconj(q), v), arm)
        seen = qrotate(mount, body)
        for i in range(3):
            z[i] = scale * seen[i] - row[layout.M_VALUE + i]
            # R C^T as a row in n, and R as a row in b.
            in_n = qrotate(q, rows[i])
            in_b = rows[i]
            of_phi = cross(v, in_n)
            of_gyro = cross(lever, in_b)
            of_lever = cross(in_b, w)
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            of_mount = cross(seen, unit)
            for n in range(3):
                h[i, n] = scale * of_phi[n]
                h[i, 3 + n] = scale * in_n[n]
                if at[layout.GYRO_BIAS] >= 0:
                    h[i, at[layout.GYRO_BIAS] + n] = scale * of_gyro[n]
                if at[layout.GYRO_MARKOV] >= 0:
                    h[i, at[layout.GYRO_MARKOV] + n] = scale * of_gyro[n]
                if at_lever >= 0:
                    h[i, at_lever + n] = scale * of_lever[n]
                if aid[layout.A_AT_MOUNT + n] >= 0.0:
                    h[i, int(aid[layout.A_AT_MOUNT + n])] = scale * of_mount[n]
            if at_scale >= 0:
                h[i, at_scale] = seen[i]
    elif kind == ZERO_RATE:
        bias = (0.0, 0.0, 0.0)
        if at[layout.GYRO_BIAS] >= 0:
            bias = add(bias, three(est, at[layout.GYRO_BIAS]))
        if at[layout.GYRO_MARKOV] >= 0:
            bias = add(bias, three(est, at[layout.GYRO_MARKOV]))
        still = add(bias, qrotate(qconj(q), earth))
        for i in range(3):
            z[i] = still[i] - row[layout.M_VALUE + i]
            column = (c[0][i], c[1][i], c[2][i])
            of_phi = cross(earth, column)
            for n in range(3):
                h[i, n] = of_phi[n]
            # What is left of a bias is truth minus estimate.
            if at[layout.GYRO_BIAS] >= 0:
                h[i, at[layout.GYRO_BIAS] + i] = -1.0
            if at[layout.GYRO_MARKOV] >= 0:
                h[i, at[layout.GYRO_MARKOV] + i] = -1.0
    elif kind == HEIGHT_FIX:
        at_offset = int(aid[layout.A_AT_OFFSET])
        place = qrotate(q, lever)
        z[0] = state[layout.HEIGHT] + place[2] + aid[layout.A_OFFSET] - row[layout.M_VALUE]
        h[0, 0], h[0, 1] = -place[1], place[0]
        h[0, 8] = 1.0
        if at_offset >= 0:
            z[0] += est[at_offset]
            h[0, at_offset] = 1.0
        if at_lever >= 0:
            for n in range(3):
                h[0, at_lever + n] = c[2][n]
    elif kind == HEADING_FIX:
        ce, se = 1.0, 0.0
        if not fixed:
            ce, se = east_in_frame(four(state, layout.QUAT_NE))
        u = qrotate(q, three(aid, layout.A_BASELINE))
        east, north = ce * u[0] + se * u[1], ce * u[1] - se * u[0]
        z[0] = math.atan2(east, north) - row[layout.M_VALUE]
        z[0] -= 2.0 * math.pi * math.floor(z[0] / (2.0 * math.pi) + 0.5)
        level = u[0] * u[0] + u[1] * u[1]
        h[0, 0], h[0, 1], h[0, 2] = -u[0] * u[2] / level, -u[1] * u[2] / level, 1.0
    elif kind in (ATTITUDE_FIX, RATE_FIX):
        turn = (0.0, 0.0, 0.0)
        at_mount = int(aid[layout.A_AT_MOUNT])
        if at_mount >= 0:
            turn = three(est, at_mount)
        mount = qmul(four(aid, layout.A_MOUNT), qexp(turn))
        measured = three(row, layout.M_VALUE)
        mean, faster = rate_of_change(row, state, of_row)
        if kind == ATTITUDE_FIX:
            # The master's attitude is East-North-Up; here it is turned into the wander frame.
            ce, se = 1.0, 0.0
            if not fixed:
                ce, se = east_in_frame(four(state, layout.QUAT_NE))
            to_frame = qexp((0.0, 0.0, math.atan2(se, ce)))
            other = qmul(qmul(to_frame, qexp(measured)), mount)
            none = (0.0, 0.0, 0.0)
            slow = w if of_row else axpy(-1.0, qrotate(qconj(q), earth), mean)
            valid = qmul(q, qexp(axpy(-tau, slow, none)))
            c = quat_to_matrix(valid)
            # The logarithm of the inverse: phi is that of an estimate I - [phi x].
            value = qlog(qmul(other, qconj(valid)))
            change = axpy(-1.0, qrotate(q, slow), none)
        else:
            change = faster
            rotated_rate = qrotate(qconj(mount), measured)
            value = axpy(-1.0, rotated_rate, axpy(-tau, faster, rate_b))
            # The noise of one sample has no place in a row of H.
            if of_row:
                rate_b = rotated_rate
        for i in range(3):
            z[i] = value[i]
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            # A row of C, or of -[w x].
            of_mount = c[i] if kind == ATTITUDE_FIX else cross(rate_b, unit)
            first = at[layout.FLEXURE]
            for n in range(3):
                if first >= 0:
                    h[i, first + n] = -of_mount[n]
            if kind == ATTITUDE_FIX:
                h[i, i] = 1.0
                for n in range(3):
                    if at[layout.GYRO_BIAS] >= 0 and not of_row:
                        h[i, at[layout.GYRO_BIAS] + n] = tau * c[i][n]
                    if at[layout.GYRO_MARKOV] >= 0 and not of_row:
                        h[i, at[layout.GYRO_MARKOV] + n] = tau * c[i][n]
            else:
                if first >= 0:
                    h[i, first + 3 + i] = 1.0
                if at[layout.GYRO_BIAS] >= 0:
                    h[i, at[layout.GYRO_BIAS] + i] = 1.0
                if at[layout.GYRO_MARKOV] >= 0:
                    h[i, at[layout.GYRO_MARKOV] + i] = 1.0
            if at_mount >= 0:
                of_vector = right_jacobian_row(of_mount, turn)
                for n in range(3):
                    h[i, at_mount + n] = of_vector[n]
            if at_delay >= 0:
                h[i, at_delay] = -change[i]
    elif kind == ZERO_DISPLACEMENT:
        place = three(state, layout.DISPLACEMENT)
        start = quat_to_matrix(four(state, layout.QUAT_START))
        moved = axpy(-1.0, qrotate(four(state, layout.QUAT_START), lever), qrotate(q, lever))
        for i in range(3):
            z[i] = place[i] + moved[i] - row[layout.M_VALUE + i]
            h[i, 6 + i] = 1.0
            if at[layout.MOTION] >= 0:
                h[i, at[layout.MOTION] + i] = 1.0
            if at_lever >= 0:
                for n in range(3):
                    h[i, at_lever + n] = c[i][n] - start[i][n]
    elif kind == CONSTANT_BASE:
        turn = qlog(qmul(q, qconj(four(state, layout.QUAT_START))))
        for i in range(3):
            z[i] = turn[i] - row[layout.M_VALUE + i]
            h[i, i] = -1.0
            h[i, at[layout.BASE] + i] = 1.0
    elif state[layout.SPAN] > 0.0:
        rate = 1.0 / state[layout.SPAN]
        for i in range(2):
            z[i] = rate * state[layout.MEAN_F + i] - row[layout.M_VALUE + i]
            for j in range(size):
                h[i, j] = rate * transition[3 + i, j]
            for j in range(3, 6):
                h[i, j] = 0.0
    else:
        return 0
    count = 0
    for i in range(3):
        sigma = row[layout.M_SIGMA + i]
        if sigma > 0.0:
            if count != i:
                for j in range(size):
                    h[count, j] = h[i, j]
                z[count] = z[i]
            r[count] = sigma * sigma
            count += 1
    return count
