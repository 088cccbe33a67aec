"""Fine alignment of a stationary vehicle by a Kalman filter, in one pass over the samples.

The filter works in ENU at a fixed place. The error states come in blocks of three:

===== ====================================================================================
phi   attitude error east, north, up: C_est = (I - [phi x]) C_true
v     velocity error
eps   gyro bias, body axes (in the wandering form: horizontal Earth rate, level axes)
nabla accelerometer bias, body axes
p     displacement error since the start
d     displacement of the vehicle, a bounded (first-order Gauss-Markov) motion
base  attitude of the base since the start
lever from the point that does not move to the IMU, body axes
===== ====================================================================================

Beside the whole covariance the parts that each error source makes of it are carried through the
same gains: they add up to it.

    phi' = -w x phi - C eps,  v' = f x phi + C nabla - 2 w x v,  p' = v,  d' = -d / tau

State of a pass: 0 time, 1-4 q_b^n, 5-7 v, 8-10 p, 11-13 dtheta before, 14-16 dvel before, 17 steps,
18 samples in this step, 19 span of this step, 20-28 integral of C (rows), 29-31 velocity from the
force, 32-35 q at the start, 36 samples in all, 37 updates refused, 38 updates weighed down, 45-47
body turn in this step, 48-50 gyro bias, 51-53 accelerometer bias, 54-57 measured noise by kind.
"""

from __future__ import annotations

import math

from schuler.kernels._jit import helper, kernel
from schuler.kernels.increments import coned, normalised
from schuler.kernels.kalman import gain_of, joseph, propagate
from schuler.kernels.quat import (
    qconj,
    qexp,
    qlog,
    qmul,
    qrotate,
    quat_to_matrix,
    rotation_averages,
)
from schuler.kernels.vec import add, axpy, cross, scale

STATE_SIZE = 64

OUT = 21
"""Numbers that a step leaves."""

PLAIN, HUBER, IGG3 = 0, 1, 2
"""What is done with an innovation that is too large: nothing, weighed down, or refused."""


@helper
def _weight(rule, ratio, low, high) -> float:
    """Return the weight of a measurement whose innovation is `ratio` of its sigma."""
    if rule == HUBER and ratio > low:
        return low / ratio
    if rule == IGG3 and ratio > low:
        if ratio >= high:
            return 0.0
        part = (high - ratio) / (high - low)
        return low / ratio * part * part
    return 1.0


@helper
def _put(phi, row, column, a, b, c, d, e, f, g, h, i):
    phi[row, column], phi[row, column + 1], phi[row, column + 2] = a, b, c
    phi[row + 1, column], phi[row + 1, column + 1], phi[row + 1, column + 2] = d, e, f
    phi[row + 2, column], phi[row + 2, column + 1], phi[row + 2, column + 2] = g, h, i


@helper
def _fill_transition(phi, s, n, earth, gravity, wander, at_p, at_d, tau, axes):
    """Write the transition matrix of a step: exact for constant rates to second order."""
    for i in range(n):
        for j in range(n):
            phi[i, j] = 0.0
        phi[i, i] = 1.0
    t = s[19]
    e, u, w = earth[0] * t, earth[1] * t, earth[2] * t
    c00, c01, c02, c10, c11, c12, c20, c21, c22 = (
        s[20], s[21], s[22], s[23], s[24], s[25], s[26], s[27], s[28],
    )  # fmt: skip
    # The force that takes a tilt along is that of a base at rest. The vehicle's own accelerations
    # are noise here: taken for a regressor they would show a heading that nobody measured, as the
    # displacement that is "known to be nothing" is theirs.
    z = gravity * t
    # phi: turns with the Earth; v: the force takes the tilt with it; twice the Earth rate bends v.
    _put(phi, 0, 0, 1.0, w, -u, -w, 1.0, e, u, -e, 1.0)
    _put(phi, 3, 0, 0.0, -z, 0.0, z, 0.0, 0.0, 0.0, 0.0, 0.0)
    _put(phi, 3, 3, 1.0, 2 * w, -2 * u, -2 * w, 1.0, 2 * e, 2 * u, -2 * e, 1.0)
    if wander != 0.0:
        c00, c01, c02, c10, c11, c12, c20, c21, c22 = t, 0.0, 0.0, 0.0, t, 0.0, 0.0, 0.0, t
    _put(phi, 0, 6, -c00, -c01, -c02, -c10, -c11, -c12, -c20, -c21, -c22)
    # Half of the step, on average, has the tilt that a bias makes in it.
    _put(
        phi, 3, 6,
        0.5 * z * c10, 0.5 * z * c11, 0.5 * z * c12,
        -0.5 * z * c00, -0.5 * z * c01, -0.5 * z * c02,
        0.0, 0.0, 0.0,
    )  # fmt: skip
    _put(phi, 3, 9, s[20], s[21], s[22], s[23], s[24], s[25], s[26], s[27], s[28])
    if axes == 2:
        # Without a vertical channel nothing may come from it.
        phi[3, 5] = phi[4, 5] = 0.0
    if at_p >= 0:
        a = at_p
        h = 0.5 * t
        _put(phi, a, 0, 0.0, -h * z, 0.0, h * z, 0.0, 0.0, 0.0, 0.0, 0.0)
        phi[a, 3] = phi[a + 1, 4] = phi[a + 2, 5] = t
        for i in range(3):
            for j in range(3):
                phi[a + i, 9 + j] = h * s[20 + 3 * i + j]
                # A constant bias: a third of the half.
                phi[a + i, 6 + j] = phi[3 + i, 6 + j] * t / 3.0
    if at_d >= 0:
        f = math.exp(-t / tau)
        phi[at_d, at_d] = phi[at_d + 1, at_d + 1] = phi[at_d + 2, at_d + 2] = f


@helper
def carry(s, cfg, t, a, f):
    """Take one sample (angle and velocity, biases removed) into attitude, velocity and place."""
    before_a, before_f = (s[11], s[12], s[13]), (s[14], s[15], s[16])
    earth = (cfg[0], cfg[1], cfg[2])
    if cfg[22] != 0.0:
        # In the wandering form the estimated horizontal Earth rate stands where biases do.
        earth = (earth[0] + s[48], earth[1] + s[49], earth[2] + s[50])
    u = f
    if cfg[24] != 0.0:
        c1, c2 = rotation_averages(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        x1 = cross(a, f)
        u = axpy(c1, x1, axpy(c2, cross(a, x1), f))
        u = axpy(1.0 / 12.0, add(cross(before_a, f), cross(before_f, a)), u)
    q = (s[1], s[2], s[3], s[4])
    frame = scale(t, earth)
    dv = qrotate(q, u)
    dv = axpy(-0.5, cross(frame, dv), dv)
    m0, m1, m2 = quat_to_matrix(qmul(q, qexp(scale(0.5, a))))
    for c in range(3):
        s[20 + c] += t * m0[c]
        s[23 + c] += t * m1[c]
        s[26 + c] += t * m2[c]
        s[29 + c] += dv[c]
        s[45 + c] += a[c]
    turned = qexp(coned(cfg[23], before_a, a))
    s[1], s[2], s[3], s[4] = normalised(qmul(qmul(qexp(scale(-1.0, frame)), q), turned))
    v = (s[5], s[6], s[7])
    bend = cross(frame, v)
    w = (
        v[0] + dv[0] - 2.0 * bend[0],
        v[1] + dv[1] - 2.0 * bend[1],
        v[2] + dv[2] - 2.0 * bend[2] - t * cfg[3],
    )
    for c in range(3):
        s[8 + c] += 0.5 * t * (v[c] + w[c])
        s[5 + c] = w[c]
        s[11 + c] = a[c]
        s[14 + c] = f[c]


@helper
def _measure(kind, axis, s, phi, layout, h, n):
    """Fill the row h of a measurement and return what was measured.

    kind 0 is a velocity, 1 a displacement, 2 a turn of the base, 3 a force.
    """
    at_p, at_d, at_base, at_lever = layout[1], layout[2], layout[3], layout[4]
    for j in range(n):
        h[j] = 0.0
    q = (s[1], s[2], s[3], s[4])
    if kind == 0:
        h[3 + axis] = 1.0
        if at_lever >= 0:
            r = 1.0 / s[19]
            rows = quat_to_matrix(q)
            w = (r * s[45], r * s[46], r * s[47])
            # C (w x l) as a row for l.
            turned = cross(rows[axis], w)
            for c in range(3):
                h[at_lever + c] = turned[c]
        return s[5 + axis]
    if kind == 1:
        h[at_p + axis] = 1.0
        if at_d >= 0:
            h[at_d + axis] = 1.0
        if at_lever >= 0:
            rows = quat_to_matrix(q)
            first = quat_to_matrix((s[32], s[33], s[34], s[35]))
            for c in range(3):
                h[at_lever + c] = rows[axis][c] - first[axis][c]
        return s[8 + axis]
    if kind == 2:
        h[axis] = -1.0
        h[at_base + axis] = 1.0
        return qlog(qmul(q, qconj((s[32], s[33], s[34], s[35]))))[axis]
    r = 1.0 / s[19]
    for c in range(12):
        h[c] = r * phi[3 + axis, c]
    for c in range(3, 6):
        h[c] = 0.0
    return r * s[29 + axis]


@kernel
def fine(state, x, p, parts, cfg, layout, room, time, dt, dtheta, dvel, out, keep):
    """Feed a chunk of samples to a fine alignment; resumable.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        See the module; at the start attitude, and the same at 32-35.
    x, p : (n,), (n, n) float64
        Error state and covariance.
    parts : (s, n, n) float64
        Covariance by source: gyro bias, accelerometer bias, gyro noise, accelerometer noise,
        disturbance, start. s is 6, or 0 where they are not wanted.
    cfg : (25,) float64
        0-2 Earth rate (in the wandering form its vertical part alone), 3 gravity, 4 samples to a
        step, 5 gyro white noise, 6 accelerometer white noise, 7 gyro drift, 8 accelerometer drift,
        9 variance of a velocity, 10 of a displacement, 11 of a base turn, 12 of a force, 13
        displacement walk, 14 base walk, 15 tau and 16 sigma of the vehicle's motion, 17 robust
        rule, 18-19 its bounds, 20 memory of the adaptive noise (0: fixed), 21 feedback, 22
        wandering, 23 coning and 24 sculling to be corrected.
    layout : (7,) int64
        States n; where p, d, base and lever begin (-1: absent); axes that are measured (2: level,
        3: all); kinds that are measured, as bits (velocity 1, displacement 2, base 4, force 8).
    room : (2n + 8, n) float64
        Room to work.
    time, dt, dtheta, dvel : (m,), (m,), (m, 3), (m, 3) float64
        The samples, as in `ImuRecord`.
    out : (k, OUT) float64
        A row for each step: time, q, v, variances of phi, biases, mean squared innovation,
        variances of the gyro bias.
    keep : (k, 2n + 3n^2) float64
        For the smoother: x and P before and after the measurements, and the transition; no rows
        where it is not wanted.

    Returns
    -------
    int
        Rows written.
    """
    s = state
    n = layout[0]
    at_p, at_d, at_base = layout[1], layout[2], layout[3]
    phi, work = room[:n], room[n : 2 * n]
    q_noise, ph, k, h, spare, none, last = (
        room[2 * n], room[2 * n + 1], room[2 * n + 2], room[2 * n + 3], room[2 * n + 4],
        room[2 * n + 5], room[2 * n + 6],
    )  # fmt: skip
    wander = cfg[22]
    written = 0
    for i in range(time.shape[0]):
        t = dt[i]
        a = (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2])
        if wander == 0.0:
            a = (a[0] - t * s[48], a[1] - t * s[49], a[2] - t * s[50])
        f = (dvel[i, 0] - t * s[51], dvel[i, 1] - t * s[52], dvel[i, 2] - t * s[53])
        carry(s, cfg, t, a, f)
        s[0] = time[i]
        s[18] += 1.0
        s[19] += t
        s[36] += 1.0
        if s[18] < cfg[4]:
            continue

        # Predict.
        span = s[19]
        earth = (cfg[0], cfg[1], cfg[2])
        if wander != 0.0:
            earth = (earth[0] + s[48], earth[1] + s[49], earth[2] + s[50])
        _fill_transition(phi, s, n, earth, cfg[3], wander, at_p, at_d, cfg[15], layout[5])
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += phi[j, m] * x[m]
            ph[j] = total
            none[j] = 0.0
            q_noise[j] = 0.0
        for j in range(n):
            x[j] = ph[j]
        for c in range(3):
            q_noise[c] = cfg[5] * cfg[5] * span
            q_noise[3 + c] = cfg[6] * cfg[6] * span
            q_noise[6 + c] = cfg[7] * cfg[7] * span
            q_noise[9 + c] = cfg[8] * cfg[8] * span
            if at_p >= 0:
                q_noise[at_p + c] = cfg[13] * span
            if at_d >= 0:
                fade = phi[at_d, at_d]
                q_noise[at_d + c] = cfg[16] * cfg[16] * (1.0 - fade * fade)
            if at_base >= 0:
                q_noise[at_base + c] = cfg[14] * span
        propagate(p, phi, q_noise, work, n)
        for m in range(parts.shape[0]):
            for j in range(n):
                mine = 4
                if j < 3:
                    mine = 2
                elif j < 6:
                    mine = 3
                elif j < 9:
                    mine = 0
                elif j < 12:
                    mine = 1
                none[j] = q_noise[j] if m == mine else 0.0
            propagate(parts[m], phi, none, work, n)
        row = int(s[17])
        kept = keep.shape[0] > written
        if kept:
            for j in range(n):
                keep[written, j] = x[j]
                for m in range(n):
                    keep[written, 2 * n + n * j + m] = p[j, m]
                    keep[written, 2 * n + 2 * n * n + n * j + m] = phi[j, m]

        # Measure.
        chi, count = 0.0, 0
        for kind in range(4):
            if (layout[6] >> kind) & 1 == 0:
                continue
            r_known = cfg[9 + kind]
            axes = 3 if kind == 2 else (2 if kind == 3 else layout[5])
            for axis in range(axes):
                z = _measure(kind, axis, s, phi, layout, h, n)
                r = r_known
                if cfg[20] > 0.0:
                    r = max(r, s[54 + kind])
                v = gain_of(p, h, r, ph, k, n)
                e = z
                for j in range(n):
                    e -= h[j] * x[j]
                ratio = abs(e) / math.sqrt(v)
                if cfg[20] > 0.0:
                    # The innovation's own share of noise, forgotten slowly; not from one outlier.
                    own = min(e * e, 9.0 * v) - (v - r)
                    s[54 + kind] += cfg[20] * (max(own, 0.0) - s[54 + kind])
                weight = _weight(cfg[17], ratio, cfg[18], cfg[19])
                if weight == 0.0:
                    s[37] += 1.0
                    continue
                if weight < 1.0:
                    s[38] += 1.0
                    r /= weight
                    v = gain_of(p, h, r, ph, k, n)
                chi += e * e / v
                count += 1
                for j in range(n):
                    x[j] += k[j] * e
                joseph(p, h, ph, k, r, last, n)
                for m in range(parts.shape[0]):
                    gain_of(parts[m], h, 1.0, ph, spare, n)
                    joseph(parts[m], h, ph, k, r if m == 4 else 0.0, last, n)
        if kept:
            for j in range(n):
                keep[written, n + j] = x[j]
                for m in range(n):
                    keep[written, 2 * n + n * n + n * j + m] = p[j, m]

        # Correct, and start the next step.
        q = (s[1], s[2], s[3], s[4])
        q = qmul(qexp((x[0], x[1], x[2])), q)
        out[written, 0] = s[0]
        for c in range(4):
            out[written, 1 + c] = q[c]
        for c in range(3):
            out[written, 5 + c] = s[5 + c] - x[3 + c]
            out[written, 8 + c] = p[c, c]
            out[written, 11 + c] = s[48 + c] + x[6 + c]
            out[written, 14 + c] = s[51 + c] + x[9 + c]
            out[written, 18 + c] = p[6 + c, 6 + c]
        out[written, 17] = chi / max(count, 1)
        if cfg[21] != 0.0:
            s[1], s[2], s[3], s[4] = q
            if at_base >= 0:
                # The base is corrected along: its turn is then that of true axes.
                q = qmul(qexp((x[0], x[1], x[2])), (s[32], s[33], s[34], s[35]))
                s[32], s[33], s[34], s[35] = q
                for c in range(3):
                    x[at_base + c] -= x[c]
            for c in range(3):
                s[5 + c] -= x[3 + c]
                s[48 + c] += x[6 + c]
                s[51 + c] += x[9 + c]
                if at_p >= 0:
                    s[8 + c] -= x[at_p + c]
                    x[at_p + c] = 0.0
            for j in range(12):
                x[j] = 0.0
        for c in range(18, 32):
            s[c] = 0.0
        for c in range(3):
            s[45 + c] = 0.0
        s[17] = row + 1.0
        written += 1
    return written
