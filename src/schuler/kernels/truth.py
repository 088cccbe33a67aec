"""True increments of a moving body: quintics in time, frames on frames, Gauss quadrature.

Between two samples every channel is the quintic through value, rate and acceleration at both
ends, so attitude, rate, velocity and force are derivatives of one another without any rest. Rate
and force are integrated over the interval by Gauss-Legendre quadrature, on the turning Earth.

The work is done for `BLOCK` intervals at a time in plain loops over one row of a work table each,
which the compiler turns into vector instructions.
"""

from __future__ import annotations

import math

from schuler.constants import EARTH_A, EARTH_RATE
from schuler.kernels._jit import helper, kernel
from schuler.kernels.earth import gravity_of_sine, radii_of_sine

BLOCK = 64
REACH = 0.5
"""Largest angle (rad) that the series for sine and cosine are used for."""

STATE_SIZE = 5
"""Latitude, longitude (rad), height of the path (m), up part of the arms at the start, flag."""

# Rows of the work table.
S, C = 0, 3
M, N = 6, 15
W, DW = 24, 27
V, A = 30, 33
ARM = 36
SUM = 37
POS = 43
FREE = 46
ROWS = 49


@helper
def small_sine(x: float) -> float:
    """Return sin x for |x| up to `REACH`."""
    q = x * x
    return x * (
        1.0
        - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (
            1.0 - q / 110.0 * (1.0 - q / 156.0)
        ))))
    )  # fmt: skip


@helper
def small_cosine_gap(x: float) -> float:
    """Return 1 - cos x for |x| up to `REACH`."""
    q = x * x
    return 0.5 * q * (
        1.0
        - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0 * (
            1.0 - q / 132.0 * (1.0 - q / 182.0)
        ))))
    )  # fmt: skip


@helper
def fill(p, first, m, h: float, c) -> None:
    """Fill c (channels, 6, BLOCK) with quintics of p (n, channels, 3) from interval `first` on."""
    for k in range(p.shape[1]):
        for i in range(m):
            row = first + i
            p0, v0, a0 = p[row, k, 0], p[row, k, 1] * h, p[row, k, 2] * h * h
            p1, v1, a1 = p[row + 1, k, 0], p[row + 1, k, 1] * h, p[row + 1, k, 2] * h * h
            d = p1 - p0
            c[k, 0, i], c[k, 1, i], c[k, 2, i] = p0, v0, 0.5 * a0
            c[k, 3, i] = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
            c[k, 4, i] = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
            c[k, 5, i] = 6.0 * d - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)


@helper
def rate_at(c0, c1, c2, c3, c4, u: float) -> float:
    """Return the derivative of a quintic, given its coefficients from the first power on."""
    return c0 + u * (2.0 * c1 + u * (3.0 * c2 + u * (4.0 * c3 + u * 5.0 * c4)))


@helper
def curve_at(c1, c2, c3, c4, u: float) -> float:
    """Return the second derivative of a quintic, given its coefficients from the second power."""
    return 2.0 * c1 + u * (6.0 * c2 + u * (12.0 * c3 + u * 20.0 * c4))


@helper
def turn_frame(c, b, m, u: float, w) -> None:
    """Fill rows S and C of the work table with sines and cosines of channels b to b + 2 at u."""
    for e in range(3):
        q = c[b + e]
        sine, cosine = w[S + e], w[C + e]
        zero = q[0, 0]
        wide = 0.0
        for i in range(m):
            gain = u * (q[1, i] + u * (q[2, i] + u * (q[3, i] + u * (q[4, i] + u * q[5, i]))))
            sine[i] = (q[0, i] - zero) + gain
        for i in range(m):
            wide = max(wide, abs(sine[i]))
        if wide < REACH:
            s0, c0 = math.sin(zero), math.cos(zero)
            for i in range(m):
                x = sine[i]
                s, gap = small_sine(x), small_cosine_gap(x)
                sine[i] = s0 + (c0 * s - s0 * gap)
                cosine[i] = c0 - (s0 * s + c0 * gap)
        else:
            for i in range(m):
                x = zero + sine[i]
                sine[i], cosine[i] = math.sin(x), math.cos(x)


@helper
def add_frame(c, b, first, m, u: float, r: float, w) -> None:
    """Hang frame b / 3 on the chain: update M (attitude) and W (rate), leaving C_k in N."""
    sp, st, sg = w[S], w[S + 1], w[S + 2]
    cp, ct, cg = w[C], w[C + 1], w[C + 2]
    cx, cy, cz = c[b], c[b + 1], c[b + 2]
    wx, wy, wz = w[W], w[W + 1], w[W + 2]
    ox, oy, oz = w[FREE], w[FREE + 1], w[FREE + 2]
    n0, n1, n2 = w[N], w[N + 1], w[N + 2]
    n3, n4, n5 = w[N + 3], w[N + 4], w[N + 5]
    n6, n7, n8 = w[N + 6], w[N + 7], w[N + 8]
    for i in range(m):
        n0[i] = cp[i] * cg[i] - sp[i] * st[i] * sg[i]
        n1[i] = -sp[i] * ct[i]
        n2[i] = cp[i] * sg[i] + sp[i] * st[i] * cg[i]
        n3[i] = sp[i] * cg[i] + cp[i] * st[i] * sg[i]
        n4[i] = cp[i] * ct[i]
        n5[i] = sp[i] * sg[i] - cp[i] * st[i] * cg[i]
        n6[i] = -ct[i] * sg[i]
        n7[i] = st[i]
        n8[i] = ct[i] * cg[i]
    for i in range(m):
        p1 = r * rate_at(cx[1, i], cx[2, i], cx[3, i], cx[4, i], cx[5, i], u)
        t1 = r * rate_at(cy[1, i], cy[2, i], cy[3, i], cy[4, i], cy[5, i], u)
        g1 = r * rate_at(cz[1, i], cz[2, i], cz[3, i], cz[4, i], cz[5, i], u)
        ox[i] = cg[i] * t1 - sg[i] * ct[i] * p1
        oy[i] = g1 + st[i] * p1
        oz[i] = sg[i] * t1 + cg[i] * ct[i] * p1
    if first:
        for e in range(9):
            old, new = w[M + e], w[N + e]
            for i in range(m):
                old[i] = new[i]
        for i in range(m):
            wx[i], wy[i], wz[i] = ox[i], oy[i], oz[i]
        return
    for row in range(3):
        x, y, z = w[M + 3 * row], w[M + 3 * row + 1], w[M + 3 * row + 2]
        for i in range(m):
            a, d, e = x[i], y[i], z[i]
            x[i] = a * n0[i] + d * n3[i] + e * n6[i]
            y[i] = a * n1[i] + d * n4[i] + e * n7[i]
            z[i] = a * n2[i] + d * n5[i] + e * n8[i]
    for i in range(m):
        a, d, e = wx[i], wy[i], wz[i]
        wx[i] = n0[i] * a + n3[i] * d + n6[i] * e
        wy[i] = n1[i] * a + n4[i] * d + n7[i] * e
        wz[i] = n2[i] * a + n5[i] * d + n8[i] * e


@helper
def add_arm(c, b, first, m, u: float, r: float, arm_x, arm_y, arm_z, w) -> None:
    """Add what the lever arm of frame b / 3 does: DW, then V, A and the up part of the arms.

    Rows W hold the rate that was carried over (zero for the first frame), rows FREE the frame's
    own; they are summed here.
    """
    st, sg = w[S + 1], w[S + 2]
    ct, cg = w[C + 1], w[C + 2]
    for i in range(m):
        p1 = r * rate_at(c[b, 1, i], c[b, 2, i], c[b, 3, i], c[b, 4, i], c[b, 5, i], u)
        t1 = r * rate_at(
            c[b + 1, 1, i], c[b + 1, 2, i], c[b + 1, 3, i], c[b + 1, 4, i], c[b + 1, 5, i], u
        )
        g1 = r * rate_at(
            c[b + 2, 1, i], c[b + 2, 2, i], c[b + 2, 3, i], c[b + 2, 4, i], c[b + 2, 5, i], u
        )
        p2 = r * r * curve_at(c[b, 2, i], c[b, 3, i], c[b, 4, i], c[b, 5, i], u)
        t2 = r * r * curve_at(c[b + 1, 2, i], c[b + 1, 3, i], c[b + 1, 4, i], c[b + 1, 5, i], u)
        g2 = r * r * curve_at(c[b + 2, 2, i], c[b + 2, 3, i], c[b + 2, 4, i], c[b + 2, 5, i], u)
        dx = cg[i] * t2 - sg[i] * ct[i] * p2 - sg[i] * g1 * t1 - cg[i] * g1 * ct[i] * p1
        dx += sg[i] * st[i] * t1 * p1
        dy = g2 + st[i] * p2 + ct[i] * t1 * p1
        dz = sg[i] * t2 + cg[i] * ct[i] * p2 + cg[i] * g1 * t1 - sg[i] * g1 * ct[i] * p1
        dz -= cg[i] * st[i] * t1 * p1
        ox, oy, oz = w[FREE, i], w[FREE + 1, i], w[FREE + 2, i]
        if first:
            wx, wy, wz = ox, oy, oz
        else:
            kx, ky, kz = w[W, i], w[W + 1, i], w[W + 2, i]
            a, d, e = w[DW, i], w[DW + 1, i], w[DW + 2, i]
            dx += w[N, i] * a + w[N + 3, i] * d + w[N + 6, i] * e + ky * oz - kz * oy
            dy += w[N + 1, i] * a + w[N + 4, i] * d + w[N + 7, i] * e + kz * ox - kx * oz
            dz += w[N + 2, i] * a + w[N + 5, i] * d + w[N + 8, i] * e + kx * oy - ky * ox
            wx, wy, wz = kx + ox, ky + oy, kz + oz
        w[W, i], w[W + 1, i], w[W + 2, i] = wx, wy, wz
        w[DW, i], w[DW + 1, i], w[DW + 2, i] = dx, dy, dz
        # Swing w x arm, and its derivative dw x arm + w x swing.
        sx = wy * arm_z - wz * arm_y
        sy = wz * arm_x - wx * arm_z
        sz = wx * arm_y - wy * arm_x
        ax = dy * arm_z - dz * arm_y + wy * sz - wz * sy
        ay = dz * arm_x - dx * arm_z + wz * sx - wx * sz
        az = dx * arm_y - dy * arm_x + wx * sy - wy * sx
        for row in range(3):
            x, y, z = w[M + 3 * row, i], w[M + 3 * row + 1, i], w[M + 3 * row + 2, i]
            w[V + row, i] += x * sx + y * sy + z * sz
            w[A + row, i] += x * ax + y * ay + z * az
        w[ARM, i] += w[M + 6, i] * arm_x + w[M + 7, i] * arm_y + w[M + 8, i] * arm_z


@helper
def place(way, arc, levers, arms, m, u: float, r: float, w) -> None:
    """Fill the work table with attitude, rate, velocity and acceleration at u of each interval."""
    for e in range(3):
        q = way[e]
        v, a = w[V + e], w[A + e]
        for i in range(m):
            v[i] = r * rate_at(q[1, i], q[2, i], q[3, i], q[4, i], q[5, i], u)
            a[i] = r * r * curve_at(q[2, i], q[3, i], q[4, i], q[5, i], u)
    w[ARM, :m] = 0.0
    for k in range(levers.shape[0]):
        turn_frame(arc, 3 * k, m, u, w)
        add_frame(arc, 3 * k, k == 0, m, u, r, w)
        if arms > 0.0:
            add_arm(arc, 3 * k, k == 0, m, u, r, levers[k, 0], levers[k, 1], levers[k, 2], w)
        elif k > 0:
            for e in range(3):
                x, own = w[W + e], w[FREE + e]
                for i in range(m):
                    x[i] += own[i]


@kernel
def true_increments(
    state, h, path, angles, levers, nodes, weights, way, arc, w, dtheta, dvel, pose
):
    """Integrate rate and force over each interval between knots.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        Latitude, longitude and height of the IMU at the start, the rest zero; left ready for the
        next chunk.
    h : float
        Interval, s.
    path : (n + 1, 3, 3) float64
        Knots of the way east, north, up.
    angles : (n + 1, 3 k, 3) float64
        Knots of psi, theta, gamma of each of k frames.
    levers : (k, 3) float64
        m.
    nodes, weights : (j,) float64
        Gauss-Legendre on (0, 1).
    way, arc, w : (3, 6, BLOCK), (3 k, 6, BLOCK), (ROWS, BLOCK) float64
        Scratch; zero.
    dtheta, dvel : (n, 3) float64
        Filled with the angle and velocity increments in body axes.
    pose : (n + 1, 6) float64
        Filled with velocity east, north, up and latitude, longitude, height at the knots.
    """
    # A number, and no truth value: of False alone Numba would compile everything once more.
    arms = 0.0
    for k in range(levers.shape[0]):
        arms = max(arms, abs(levers[k, 0]), abs(levers[k, 1]), abs(levers[k, 2]))
    n = path.shape[0] - 1
    count = nodes.shape[0]
    r = 1.0 / h
    for first in range(0, n, BLOCK):
        m = min(BLOCK, n - first)
        fill(path, first, m, h, way)
        fill(angles, first, m, h, arc)
        lat = state[0]
        sl, cl = math.sin(lat), math.cos(lat)
        rm, rn = radii_of_sine(sl)
        # How the radii change with latitude, for the way inside the block.
        rm2, rn2 = radii_of_sine(sl + 1e-4 * cl)
        drm, drn = 1e4 * (rm2 - rm), 1e4 * (rn2 - rn)
        g0, slope = gravity_of_sine(sl)
        g2, slope2 = gravity_of_sine(sl + 1e-4 * cl)
        dg, dslope = 1e4 * (g2 - g0), 1e4 * (slope2 - slope)
        scale_n = 1.0 / (rm + state[2])
        # The knots at the begin of each interval, the nodes, and the record's last knot: one call
        # of `place` for all of them, which is half of what is compiled here.
        for j in range(-1, count + 1 if first + m == n else count):
            u = 0.0 if j < 0 else (nodes[j] if j < count else 1.0)
            place(way, arc, levers, arms, m, u, r, w)
            if j < 0:
                if state[4] == 0.0:
                    # The site is the IMU's, not the centre's that carries it.
                    state[3] = w[ARM, 0]
                    state[2] -= path[0, 2, 0]
                    state[4] = 1.0
                # Velocity and height now; latitude and longitude as they are summed up.
                for i in range(m):
                    pose[first + i, 0], pose[first + i, 1] = w[V, i], w[V + 1, i]
                    pose[first + i, 2] = w[V + 2, i]
                    pose[first + i, 5] = state[2] + way[2, 0, i] + w[ARM, i] - state[3]
                w[SUM:FREE, :m] = 0.0
                continue
            if j == count:
                i = m - 1
                pose[n, 0], pose[n, 1], pose[n, 2] = w[V, i], w[V + 1, i], w[V + 2, i]
                pose[n, 3], pose[n, 4] = state[0], state[1]
                pose[n, 5] = state[2] + path[n, 2, 0] + w[ARM, i] - state[3]
                continue
            q = weights[j]
            for i in range(m):
                north = (
                    way[1, 0, i]
                    - way[1, 0, 0]
                    + u * (way[1, 1, i] + u * (way[1, 2, i] + u * way[1, 3, i]))
                )
                rise = way[2, 0, i] + u * (way[2, 1, i] + u * (way[2, 2, i] + u * way[2, 3, i]))
                shift = north * scale_n
                height = state[2] + rise + w[ARM, i] - state[3]
                sn = sl + shift * (cl - 0.5 * shift * sl)
                cn = cl - shift * (sl + 0.5 * shift * cl)
                im = 1.0 / (rm + drm * shift + height)
                ie = 1.0 / (rn + drn * shift + height)
                ve, vn, vu = w[V, i], w[V + 1, i], w[V + 2, i]
                tx, ty = -vn * im, ve * ie
                east = ty / cn
                tz = east * sn
                hn, hu = EARTH_RATE * cn, EARTH_RATE * sn
                kx, ky, kz = tx, 2.0 * hn + ty, 2.0 * hu + tz
                g = (g0 + dg * shift) * (
                    1.0
                    + (slope + dslope * shift) * height
                    + 3.0 / (EARTH_A * EARTH_A) * height * height
                )
                fx = w[A, i] + ky * vu - kz * vn
                fy = w[A + 1, i] + kz * ve - kx * vu
                fz = w[A + 2, i] + kx * vn - ky * ve + g
                hn += ty
                hu += tz
                for e in range(3):
                    x, y, z = w[M + e, i], w[M + 3 + e, i], w[M + 6 + e, i]
                    w[SUM + e, i] += q * (w[W + e, i] + x * tx + y * hn + z * hu)
                    w[SUM + 3 + e, i] += q * (x * fx + y * fy + z * fz)
                w[POS, i] += q * vn * im
                w[POS + 1, i] += q * east
            if j + 1 < count:
                continue
            for i in range(m):
                for e in range(3):
                    dtheta[first + i, e] = h * w[SUM + e, i]
                    dvel[first + i, e] = h * w[SUM + 3 + e, i]
                pose[first + i, 3], pose[first + i, 4] = state[0], state[1]
                state[0] += h * w[POS, i]
                state[1] += h * w[POS + 1, i]
