"""True increments of a moving body: quintics in time, frames on frames, Gauss quadrature.

Between two samples every channel is the quintic through value, rate and acceleration at both
ends, so attitude, rate, velocity and force are derivatives of one another without any rest. Rate
and force are integrated over the interval by Gauss-Legendre quadrature, on the turning Earth.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.constants import EARTH_RATE
from schuler.kernels._jit import helper, kernel
from schuler.kernels.earth import gravity, radii
from schuler.kernels.vec import Vec, add, cross, scale

Mat = tuple[Vec, Vec, Vec]

STATE_SIZE = 3
"""Latitude, longitude (rad) and height (m) at the end of the last chunk."""


@helper
def fill(p, row, h: float, c) -> None:
    """Fill c (channels, 6) with the quintics' coefficients between knots row and row + 1."""
    for k in range(p.shape[1]):
        p0, v0, a0 = p[row, k, 0], p[row, k, 1] * h, p[row, k, 2] * h * h
        p1, v1, a1 = p[row + 1, k, 0], p[row + 1, k, 1] * h, p[row + 1, k, 2] * h * h
        d = p1 - p0
        c[k, 0], c[k, 1], c[k, 2] = p0, v0, 0.5 * a0
        c[k, 3] = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
        c[k, 4] = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
        c[k, 5] = 6.0 * d - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)


@helper
def value_at(c, k, u: float) -> float:
    """Return what channel k has gained at u (0 to 1)."""
    return u * (c[k, 1] + u * (c[k, 2] + u * (c[k, 3] + u * (c[k, 4] + u * c[k, 5]))))


@helper
def rate_at(c, k, u: float) -> float:
    """Return the derivative of channel k with respect to u."""
    return c[k, 1] + u * (
        2.0 * c[k, 2] + u * (3.0 * c[k, 3] + u * (4.0 * c[k, 4] + u * 5.0 * c[k, 5]))
    )


@helper
def curve_at(c, k, u: float) -> float:
    """Return the second derivative of channel k with respect to u."""
    return 2.0 * c[k, 2] + u * (6.0 * c[k, 3] + u * (12.0 * c[k, 4] + u * 20.0 * c[k, 5]))


@helper
def turned(s0: float, c0: float, d: float) -> tuple[float, float]:
    """Return sine and cosine of an angle that is d away from one with sine s0, cosine c0."""
    if abs(d) > 0.1:
        s, c = math.sin(d), math.cos(d)
    else:
        q = d * d
        s = d * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0))))
        c = 1.0 - 0.5 * q * (
            1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0)))
        )
    return s0 * c + c0 * s, c0 * c - s0 * s


@helper
def down(m: Mat, v: Vec) -> Vec:
    """Return m^T v, for m given by rows."""
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@helper
def up(m: Mat, v: Vec) -> Vec:
    """Return m v."""
    return (
        m[0][0] * v[0] + m[0][1] * v[1] + m[0][2] * v[2],
        m[1][0] * v[0] + m[1][1] * v[1] + m[1][2] * v[2],
        m[2][0] * v[0] + m[2][1] * v[1] + m[2][2] * v[2],
    )


@helper
def compose(a: Mat, b: Mat) -> Mat:
    """Return a b."""
    x = (b[0][0], b[1][0], b[2][0])
    y = (b[0][1], b[1][1], b[2][1])
    z = (b[0][2], b[1][2], b[2][2])
    cx, cy, cz = up(a, x), up(a, y), up(a, z)
    return (cx[0], cy[0], cz[0]), (cx[1], cy[1], cz[1]), (cx[2], cy[2], cz[2])


@kernel
def true_increments(state, lat0, height0, h, path, angles, levers, nodes, weights, out, pose):
    """Integrate rate and force over each interval between knots.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        Latitude, longitude and height of the IMU; left ready for the next chunk.
    lat0, height0 : float
        The site, rad and m.
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
    out : (n, 6) float64
        Filled with the angle and velocity increments in body axes.
    pose : (n + 1, 6) float64
        Filled with velocity east, north, up and latitude, longitude, height at the knots but
        the last velocity, which the next chunk fills.
    """
    frames = levers.shape[0]
    arms = False
    for k in range(frames):
        if levers[k, 0] != 0.0 or levers[k, 1] != 0.0 or levers[k, 2] != 0.0:
            arms = True
    count = nodes.shape[0]
    base = np.empty((3 * frames, 2))
    way, arc = np.empty((3, 6)), np.empty((3 * frames, 6))
    r, r2 = 1.0 / h, 1.0 / (h * h)
    for i in range(path.shape[0]):
        # Knot i itself (node -1), then the nodes between it and knot i + 1.
        last = i + 1 == path.shape[0]
        if not last:
            fill(path, i, h, way)
            fill(angles, i, h, arc)
        lat, lon, height = state[0], state[1], state[2]
        pose[i, 3], pose[i, 4], pose[i, 5] = lat, lon, height
        rm, rn = radii(lat)
        rm += height
        rn += height
        sl, cl = math.sin(lat), math.cos(lat)
        tl = sl / cl
        g0 = gravity(lat, height)
        dg = gravity(lat, height + 1.0) - g0
        s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        dlat, dlon, dup = 0.0, 0.0, 0.0
        n_north, n_up = 0.0, 0.0
        for j in range(-1, count):
            if j < 0:
                u = 1.0 if last else 0.0
            else:
                if last:
                    break
                u = nodes[j]
            v = (r * rate_at(way, 0, u), r * rate_at(way, 1, u), r * rate_at(way, 2, u))
            a = (r2 * curve_at(way, 0, u), r2 * curve_at(way, 1, u), r2 * curve_at(way, 2, u))
            m = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
            w = (0.0, 0.0, 0.0)
            dw = (0.0, 0.0, 0.0)
            for k in range(frames):
                b = 3 * k
                if j < 0:
                    # Sine and cosine once an interval; the nodes are a small turn away.
                    for e in range(3):
                        base[b + e, 0] = math.sin(arc[b + e, 0])
                        base[b + e, 1] = math.cos(arc[b + e, 0])
                sp, cp = turned(base[b, 0], base[b, 1], value_at(arc, b, u))
                st, ct = turned(base[b + 1, 0], base[b + 1, 1], value_at(arc, b + 1, u))
                sg, cg = turned(base[b + 2, 0], base[b + 2, 1], value_at(arc, b + 2, u))
                c = (
                    (cp * cg - sp * st * sg, -sp * ct, cp * sg + sp * st * cg),
                    (sp * cg + cp * st * sg, cp * ct, sp * sg - cp * st * cg),
                    (-ct * sg, st, ct * cg),
                )
                p1, t1 = r * rate_at(arc, b, u), r * rate_at(arc, b + 1, u)
                g1 = r * rate_at(arc, b + 2, u)
                own = (cg * t1 - sg * ct * p1, g1 + st * p1, sg * t1 + cg * ct * p1)
                if k == 0:
                    carried = (0.0, 0.0, 0.0)
                    m = c
                else:
                    carried = down(c, w)
                    m = compose(m, c)
                w = add(carried, own)
                if arms:
                    p2, t2 = r2 * curve_at(arc, b, u), r2 * curve_at(arc, b + 1, u)
                    g2 = r2 * curve_at(arc, b + 2, u)
                    turn = (
                        -sg * g1 * t1
                        + cg * t2
                        - cg * g1 * ct * p1
                        + sg * st * t1 * p1
                        - sg * ct * p2,
                        g2 + ct * t1 * p1 + st * p2,
                        cg * g1 * t1
                        + sg * t2
                        - sg * g1 * ct * p1
                        - cg * st * t1 * p1
                        + cg * ct * p2,
                    )
                    if k > 0:
                        dw = add(down(c, dw), cross(carried, own))
                    dw = add(dw, turn) if k > 0 else turn
                    arm = (levers[k, 0], levers[k, 1], levers[k, 2])
                    swing = cross(w, arm)
                    v = add(v, up(m, swing))
                    a = add(a, up(m, add(cross(dw, arm), cross(w, swing))))
            if j < 0:
                n_north, n_up = v[1], v[2]
                pose[i, 0], pose[i, 1], pose[i, 2] = v
                continue
            # Where on the Earth the node is: along the knot's velocity.
            reach = u * h
            climb = n_up * reach
            turn_n = (-v[1] / rm, v[0] / rn, v[0] * tl / rn)
            shift = n_north / rm * reach
            sn, cn = turned(sl, cl, shift)
            earth = (0.0, EARTH_RATE * cn, EARTH_RATE * sn)
            f = add(a, cross(add(scale(2.0, earth), turn_n), v))
            f = (f[0], f[1], f[2] + g0 + dg * climb)
            rate = add(down(m, add(earth, turn_n)), w)
            force = down(m, f)
            q = weights[j]
            s0 += q * rate[0]
            s1 += q * rate[1]
            s2 += q * rate[2]
            s3 += q * force[0]
            s4 += q * force[1]
            s5 += q * force[2]
            dlat += q * v[1] / rm
            dlon += q * v[0] / (rn * cn)
            dup += q * v[2]
        if last:
            break
        out[i, 0], out[i, 1], out[i, 2] = h * s0, h * s1, h * s2
        out[i, 3], out[i, 4], out[i, 5] = h * s3, h * s4, h * s5
        state[0] = lat + h * dlat
        state[1] = lon + h * dlon
        state[2] = height + h * dup
