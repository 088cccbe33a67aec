"""Strapdown navigation that does not know poles: attitude, velocity and position, resumable.

Coning and sculling as in `schuler.kernels.increments`; gravity, Coriolis and the turn of the frame
are taken at the middle of each update, with velocity propagated there by the last acceleration
(Savage, 1998, parts 1 and 2).

The navigation frame n is local level but turns about its own up axis only with the Earth: a
wander frame. It starts as East-North-Up. Position is the quaternion q_n^e; its matrix has the
Earth's axis in n as its last row and up as its last column, so a step needs no trigonometry and
no latitude. The frame follows the ellipsoid by the curvature tensor

    K = I/(RN + h) + k z z^T,  k = RN e2 / (W2 (RM + h)(RN + h)),

with z the level part of the Earth's axis in n, of length cosL: it has no singular point.
"""

from __future__ import annotations

import math

from schuler.constants import (
    EARTH_A,
    EARTH_E2,
    EARTH_F,
    EARTH_RATE,
    GRAVITY_EQUATOR,
    GRAVITY_K,
    GRAVITY_M,
)
from schuler.kernels._jit import helper, kernel
from schuler.kernels.covariance import propagate
from schuler.kernels.increments import (
    normalised,
    previous_pair,
    rotated_velocity,
    waiting_pair,
)
from schuler.kernels.quat import qexp, qmul, qrotate, quat_to_matrix
from schuler.kernels.states import PathRow, StrapdownOptions, StrapdownState
from schuler.kernels.vec import Vec, add, axpy, cross, scale

STATE_SIZE = StrapdownState.size
ROW = PathRow.size

SOMIGLIANA, SOMIGLIANA1, PSINS, CONSTANT = 0, 1, 2, 3
FREE, DAMPED, OFF = 0, 1, 2

SURVEY, RENORM = 8, 64
"""Updates between two looks at the ellipsoid, and between two corrections of lengths."""

OPTIONS = StrapdownOptions.size


@helper
def ellipsoid(s2: float, height: float, code: int, constant: float):
    """Return 1/(RN + h), k of the curvature tensor, gravity, and its slopes over height and s2.

    The squared sine of latitude is s2. The slopes serve steps of metres.
    """
    w2 = 1.0 - EARTH_E2 * s2
    inverse = 1.0 / w2
    root = math.sqrt(w2) * inverse
    rn = EARTH_A * root
    a = 1.0 / (rn + height)
    k = rn * EARTH_E2 * inverse * a / (rn * (1.0 - EARTH_E2) * inverse + height)
    if code == CONSTANT:
        return a, k, constant, 0.0, 0.0
    across = GRAVITY_EQUATOR * (GRAVITY_K + 0.5 * EARTH_E2)
    if code == PSINS:
        # PSINS, glvf.m and ethupdate.m: beta, beta1 and beta2 of its version of 2026.
        series = s2 * (5.302438351341767e-3 - 4.0 * 5.861524699395552e-6 * (1.0 - s2))
        return a, k, 9.7803267715 * (1.0 + series) - 3.086e-6 * height, -3.086e-6, across
    g0 = GRAVITY_EQUATOR * (1.0 + GRAVITY_K * s2) * root
    if code == SOMIGLIANA1:
        return a, k, g0 * (1.0 - 2.0 / EARTH_A * height), -2.0 / EARTH_A * g0, across
    slope = -2.0 / EARTH_A * (1.0 + EARTH_F + GRAVITY_M - 2.0 * EARTH_F * s2)
    curvature = 3.0 / (EARTH_A * EARTH_A) * height
    return a, k, g0 * (1.0 + height * (slope + curvature)), g0 * (slope + 2.0 * curvature), across


@helper
def transport(a: float, k: float, z0: float, z1: float, v: Vec) -> Vec:
    """Return the rate of n against the Earth: up cross K v (nothing about up itself)."""
    along = k * (z0 * v[0] + z1 * v[1])
    return -(a * v[1] + along * z1), a * v[0] + along * z0, 0.0


@helper
def spin_axis(q) -> Vec:
    """Return the Earth's axis in n: the last row of the matrix of q_n^e."""
    w, x, y, z = q
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z


@helper
def small_turn(phi: Vec):
    """Return the quaternion of a rotation vector below 1e-3 rad, to rounding."""
    h = 0.25 * (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    s = 0.5 - (0.5 / 6.0) * h
    return 1.0 - 0.5 * h, s * phi[0], s * phi[1], s * phi[2]


@helper
def level_turn(p, phi: Vec):
    """Return p times the quaternion of a small rotation vector that has nothing about up."""
    h = 0.25 * (phi[0] * phi[0] + phi[1] * phi[1])
    s = 0.5 - (0.5 / 6.0) * h
    c, x, y = 1.0 - 0.5 * h, s * phi[0], s * phi[1]
    return (
        c * p[0] - x * p[1] - y * p[2],
        c * p[1] + x * p[0] - y * p[3],
        c * p[2] + y * p[0] + x * p[3],
        c * p[3] + y * p[1] - x * p[2],
    )


@helper
def stored(s, q, v, p, level: float, accel_n) -> None:
    """Put the scalars of `advance` back into the state."""
    s[0], s[1], s[2], s[3] = q
    s[4], s[5], s[6] = v
    s[7], s[8], s[9], s[10] = p
    s[11] = level
    s[12], s[13], s[14] = accel_n


@helper
def advance(
    s, options, aid: float, span: float, ta, tv, con, scu, coning: float, sculling: float,
    q, v, p, level: float, accel_n,
):  # fmt: skip
    """Take one update of total angle and velocity, coning and sculling.

    The state comes and goes as scalars (attitude, velocity, q_n^e, height, acceleration), which
    stay in registers from one update to the next; `s` holds the slow rest. The force in n goes
    with them.
    """
    u = rotated_velocity(sculling, ta, tv, scu)
    # Where the middle of the update is, and how fast: by the last acceleration.
    half = 0.5 * span
    middle = axpy(half, accel_n, v)
    z = spin_axis(p)
    height = level + half * middle[2]
    # The ellipsoid as it was some updates ago, propagated here by its slopes: metres make no second
    # order, and its roots and quotients are off the way from one update to the next.
    count = int(s[17])
    if count % SURVEY == 0:
        s2 = z[2] * z[2]
        s[33], s[34], s[35], s[36], s[37] = ellipsoid(s2, level, int(options[0]), options[1])
        s[38], s[39] = s2, level
        if count % RENORM == 0:
            # Lengths stray by a rounding an update.
            q, p = normalised(q), normalised(p)
    s[17] += 1.0
    up = height - s[39]
    a = s[33] * (1.0 - s[33] * up - 0.5 * EARTH_E2 * (z[2] * z[2] - s[38]))
    k = s[34] * (1.0 - 2.0 * s[33] * up)
    turn = transport(a, k, z[0], z[1], middle)
    z = axpy(-half, cross(turn, z), z)
    g = s[35] + s[36] * up + s[37] * (z[2] * z[2] - s[38])
    earth = scale(EARTH_RATE, z)
    rate = add(earth, turn)

    force = qrotate(q, u)
    # Coriolis, and the half of the frame's turn that the force feels, in one product.
    coriolis = add(cross(rate, axpy(0.5, force, middle)), cross(earth, middle))
    dv = (
        force[0] - span * coriolis[0],
        force[1] - span * coriolis[1],
        force[2] - span * (coriolis[2] + g),
    )
    climb = 0.0
    vertical = int(options[2])
    if vertical == DAMPED:
        off = level - aid
        s[18] += span * options[5] * off
        dv = (dv[0], dv[1], dv[2] - span * (options[4] * off + s[18]))
        climb = -options[3] * off
    elif vertical == OFF:
        dv = (dv[0], dv[1], 0.0)
    mean = axpy(0.5, dv, v)
    q = qmul(small_turn(scale(-span, rate)), qmul(q, qexp(axpy(coning, con, ta))))
    p = level_turn(p, scale(span, transport(a, k, z[0], z[1], mean)))
    return q, add(v, dv), p, level + span * (mean[2] + climb), scale(1.0 / span, dv), force


@helper
def gather(s, q, weight: float) -> None:
    """Add to the integral of C_b^n."""
    r0, r1, r2 = quat_to_matrix(q)
    for c in range(3):
        s[20 + c] += weight * r0[c]
        s[23 + c] += weight * r1[c]
        s[26 + c] += weight * r2[c]


@kernel
def navigate(
    state, n_sub, coning, sculling, options, time, dt, dtheta, dvel, aid, every, out,
    cov, noise, variances,
):  # fmt: skip
    """Feed a chunk of samples.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        `StrapdownState`: attitude, velocity, position; the rest zero.
    n_sub : int
        Samples to an update, 1 to 4 (1 uses the sample before as well).
    coning, sculling : float
        1 to correct, 0 where the instrument has done it.
    options : (OPTIONS,) float64
        `StrapdownOptions`.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    aid : (n,) or (0,) float64
        Height to damp to; without it the one of the options.
    every : int
        Updates to a row of the path; the first row comes with the first update.
    out : (rows, ROW) float64
        The path, `PathRow` by `PathRow`.
    cov, noise : (3 * 15, 15) and (5,) float64, or empty
        As in `schuler.kernels.covariance`; the step is noise[4], s.
    variances : (rows, 15) float64, or empty
        Diagonal of the covariance at each row.

    Returns
    -------
    int
        Rows written.
    """
    s = state
    rows = 0
    tracked = cov.shape[0] > 0
    aided = aid.shape[0] > 0
    q, v, p = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), (s[7], s[8], s[9], s[10])
    level, accel_n = s[11], (s[12], s[13], s[14])
    ba, bv = (s[42], s[43], s[44]), (s[45], s[46], s[47])
    left = s[19]
    for i in range(time.shape[0]):
        if n_sub == 1:
            span = dt[i]
            ta = (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2])
            tv = (dvel[i, 0], dvel[i, 1], dvel[i, 2])
            con, scu = previous_pair(ba, bv, ta, tv)
            ba, bv = ta, tv
        else:
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
            ta, tv, con, scu = waiting_pair(s, n_sub)
        held = aid[i] if aided else options[6]
        if tracked:
            gather(s, q, 0.5 * span)
        q, v, p, level, accel_n, force = advance(
            s, options, held, span, ta, tv, con, scu, coning, sculling, q, v, p, level, accel_n
        )
        if tracked:
            gather(s, q, 0.5 * span)
            for c in range(3):
                s[29 + c] += force[c]
            s[32] += span
            if s[32] >= noise[4] - 0.5 * span:
                stored(s, q, v, p, level, accel_n)
                z = spin_axis(p)
                turn = transport(s[33], s[34], z[0], z[1], v)
                propagate(cov, noise, s, options, z, s[33], s[34], turn)
                for c in range(20, 33):
                    s[c] = 0.0
        left -= 1.0
        if left <= 0.0:
            left = every
            out[rows, 0] = time[i]
            out[rows, 1], out[rows, 2], out[rows, 3], out[rows, 4] = q
            out[rows, 5], out[rows, 6], out[rows, 7] = v
            out[rows, 8], out[rows, 9], out[rows, 10], out[rows, 11] = p
            out[rows, 12] = level
            if tracked:
                for c in range(15):
                    variances[rows, c] = cov[c, c]
            rows += 1
        s[16] = time[i]
    stored(s, q, v, p, level, accel_n)
    s[42], s[43], s[44] = ba
    s[45], s[46], s[47] = bv
    s[19] = left
    return rows


@kernel
def local(rows, out):
    """Turn rows of the path into East-North-Up.

    Parameters
    ----------
    rows : (n, ROW) float64
    out : (n, 12) float64
        `LocalRow` by `LocalRow`.
    """
    for i in range(rows.shape[0]):
        r0, r1, r2 = quat_to_matrix((rows[i, 8], rows[i, 9], rows[i, 10], rows[i, 11]))
        up = (r0[2], r1[2], r2[2])
        level = math.hypot(up[0], up[1])
        lon = math.atan2(up[1], up[0]) if level > 0.0 else 0.0
        # East at that longitude, seen in the wander frame.
        sl, cl = math.sin(lon), math.cos(lon)
        ex, ey = -sl * r0[0] + cl * r1[0], -sl * r0[1] + cl * r1[1]
        angle = math.atan2(ey, ex)
        c, sn = math.cos(angle), math.sin(angle)
        q = qmul((math.cos(0.5 * angle), 0.0, 0.0, -math.sin(0.5 * angle)),
                 (rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4]))  # fmt: skip
        out[i, 0] = rows[i, 0]
        out[i, 1], out[i, 2], out[i, 3], out[i, 4] = q
        out[i, 5] = c * rows[i, 5] + sn * rows[i, 6]
        out[i, 6] = c * rows[i, 6] - sn * rows[i, 5]
        out[i, 7] = rows[i, 7]
        out[i, 8] = math.atan2(up[2], level)
        out[i, 9] = lon
        out[i, 10] = rows[i, 12]
        out[i, 11] = -angle


@kernel
def many(starts, options, dt, dtheta, dvel, errors, rng, ends):
    """Navigate one true record with many instruments, and keep where each ends.

    Parameters
    ----------
    starts : (runs, STATE_SIZE) float64
        One start a run; left as the end.
    options : (OPTIONS,) float64
    dt : float
        The interval of every sample, s.
    dtheta, dvel : (n, 3) float64
        True increments.
    errors : (runs, 26) float64
        `InstrumentErrors` of each run.
    rng : numpy.random.Generator
    ends : (runs, ROW) float64
        The last row of each path.
    """
    root = math.sqrt(dt)
    for r in range(starts.shape[0]):
        s = starts[r]
        e = errors[r]
        na, nv = e[24] * root, e[25] * root
        noisy = na > 0.0 or nv > 0.0
        before_a, before_v = (s[42], s[43], s[44]), (s[45], s[46], s[47])
        q, speed, p = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), (s[7], s[8], s[9], s[10])
        level, accel_n = s[11], (s[12], s[13], s[14])
        for i in range(dtheta.shape[0]):
            x, y, z = dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]
            a = (
                x + e[3] * x + e[4] * y + e[5] * z + e[0] * dt,
                y + e[6] * x + e[7] * y + e[8] * z + e[1] * dt,
                z + e[9] * x + e[10] * y + e[11] * z + e[2] * dt,
            )
            x, y, z = dvel[i, 0], dvel[i, 1], dvel[i, 2]
            v = (
                x + e[15] * x + e[16] * y + e[17] * z + e[12] * dt,
                y + e[18] * x + e[19] * y + e[20] * z + e[13] * dt,
                z + e[21] * x + e[22] * y + e[23] * z + e[14] * dt,
            )
            if noisy:
                a = (
                    a[0] + na * rng.standard_normal(),
                    a[1] + na * rng.standard_normal(),
                    a[2] + na * rng.standard_normal(),
                )
                v = (
                    v[0] + nv * rng.standard_normal(),
                    v[1] + nv * rng.standard_normal(),
                    v[2] + nv * rng.standard_normal(),
                )
            con, scu = previous_pair(before_a, before_v, a, v)
            q, speed, p, level, accel_n, _ = advance(
                s, options, options[6], dt, a, v, con, scu, 1.0, 1.0, q, speed, p, level, accel_n
            )
            before_a, before_v = a, v
        stored(s, q, speed, p, level, accel_n)
        s[42], s[43], s[44] = before_a
        s[45], s[46], s[47] = before_v
        ends[r, 0] = dt * dtheta.shape[0]
        for c in range(7):
            ends[r, 1 + c] = s[c]
        for c in range(5):
            ends[r, 8 + c] = s[7 + c]
