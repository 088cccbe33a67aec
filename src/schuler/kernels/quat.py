"""Quaternions as tuples (w, x, y, z), Hamilton product, scalar first.

Series are used below a squared angle of `SMALL`: the first dropped term is then under 1e-16 of
the leading one (tested on both sides of the threshold against high precision).
"""

from __future__ import annotations

import math

from schuler.kernels._jit import helper, kernel
from schuler.kernels.vec import Vec, cross

Quat = tuple[float, float, float, float]

SMALL = 0.06
"""Squared angle (rad^2) below which the series are used."""


@helper
def qmul(p: Quat, q: Quat) -> Quat:
    """Return the Hamilton product p q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@helper
def qconj(q: Quat) -> Quat:
    """Return the conjugate: the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@helper
def qrotate(q: Quat, v: Vec) -> Vec:
    """Rotate v by the unit quaternion q: v + 2 w (u x v) + 2 u x (u x v)."""
    u = (q[1], q[2], q[3])
    t = cross(u, v)
    s = cross(u, t)
    w = q[0]
    return (
        v[0] + 2.0 * (w * t[0] + s[0]),
        v[1] + 2.0 * (w * t[1] + s[1]),
        v[2] + 2.0 * (w * t[2] + s[2]),
    )


@helper
def half_cos_sinc(angle2: float) -> tuple[float, float]:
    """Return cos(a/2) and sin(a/2)/a for a squared angle a^2."""
    if angle2 < SMALL:
        # In h = (a/2)^2, both alternating series; the first dropped term is h^6/(12)! relative.
        h = 0.25 * angle2
        c = 1.0 - h / 2.0 * (
            1.0 - h / 12.0 * (1.0 - h / 30.0 * (1.0 - h / 56.0 * (1.0 - h / 90.0)))
        )
        s = 0.5 * (
            1.0
            - h / 6.0 * (1.0 - h / 20.0 * (1.0 - h / 42.0 * (1.0 - h / 72.0 * (1.0 - h / 110.0))))
        )
        return c, s
    a = math.sqrt(angle2)
    return math.cos(0.5 * a), math.sin(0.5 * a) / a


@helper
def qexp(phi: Vec) -> Quat:
    """Return the quaternion of a rotation vector (rad), exact for any angle."""
    c, s = half_cos_sinc(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    return c, s * phi[0], s * phi[1], s * phi[2]


@helper
def qlog(q: Quat) -> Vec:
    """Return the rotation vector (rad) of a unit quaternion, of length in [0, pi]."""
    w, x, y, z = q
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    s2 = x * x + y * y + z * z
    s = math.sqrt(s2)
    # atan2 keeps full precision at both ends; the ratio has the limit 2/w for s -> 0.
    k = 2.0 * math.atan2(s, w) / s if s > 1e-9 else 2.0 / w * (1.0 - s2 / (3.0 * w * w))
    return k * x, k * y, k * z


@helper
def qnormalise(q: Quat) -> Quat:
    """Return q scaled to unit length."""
    k = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return k * q[0], k * q[1], k * q[2], k * q[3]


@helper
def rotation_averages(angle2: float) -> tuple[float, float]:
    """Return (1 - cos a)/a^2 and (a - sin a)/a^3 for a squared angle a^2.

    A vector that is constant in a body turning by phi over an interval averages, in the axes
    of the interval's start, to v + c1 phi x v + c2 phi x (phi x v).
    """
    if angle2 < SMALL:
        h = angle2
        c1 = 0.5 * (
            1.0
            - h / 12.0 * (1.0 - h / 30.0 * (1.0 - h / 56.0 * (1.0 - h / 90.0 * (1.0 - h / 132.0))))
        )
        c2 = (
            1.0
            - h / 20.0 * (1.0 - h / 42.0 * (1.0 - h / 72.0 * (1.0 - h / 110.0 * (1.0 - h / 156.0))))
        ) / 6.0
        return c1, c2
    a = math.sqrt(angle2)
    s = math.sin(0.5 * a)
    return 2.0 * s * s / angle2, (a - math.sin(a)) / (angle2 * a)


@helper
def quat_to_matrix(q: Quat) -> tuple[Vec, Vec, Vec]:
    """Return the rows of the direction cosine matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        (w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )


@helper
def quat_from_matrix(r0: Vec, r1: Vec, r2: Vec) -> Quat:
    """Return the quaternion (w >= 0) of a rotation matrix given by rows (Shepperd, 1978)."""
    t = r0[0] + r1[1] + r2[2]
    if t >= r0[0] and t >= r1[1] and t >= r2[2]:
        w = 1.0 + t
        x, y, z = r2[1] - r1[2], r0[2] - r2[0], r1[0] - r0[1]
    elif r0[0] >= r1[1] and r0[0] >= r2[2]:
        x = 1.0 + 2.0 * r0[0] - t
        w, y, z = r2[1] - r1[2], r0[1] + r1[0], r0[2] + r2[0]
    elif r1[1] >= r2[2]:
        y = 1.0 + 2.0 * r1[1] - t
        w, x, z = r0[2] - r2[0], r0[1] + r1[0], r1[2] + r2[1]
    else:
        z = 1.0 + 2.0 * r2[2] - t
        w, x, y = r1[0] - r0[1], r0[2] + r2[0], r1[2] + r2[1]
    k = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        k = -k
    return k * w, k * x, k * y, k * z


@helper
def quat_from_euler(psi: float, theta: float, gamma: float) -> Quat:
    """Return the quaternion of Rz(psi) Rx(theta) Ry(gamma)."""
    cp, sp = math.cos(0.5 * psi), math.sin(0.5 * psi)
    ct, st = math.cos(0.5 * theta), math.sin(0.5 * theta)
    cg, sg = math.cos(0.5 * gamma), math.sin(0.5 * gamma)
    return (
        cp * ct * cg - sp * st * sg,
        cp * st * cg - sp * ct * sg,
        cp * ct * sg + sp * st * cg,
        sp * ct * cg + cp * st * sg,
    )


@helper
def _turn(y: float, x: float) -> float:
    """Return atan2 in (-pi, pi]: half a turn is +180 deg, whatever the sign of a zero."""
    a = math.atan2(y, x)
    return math.pi if a == -math.pi else a


@helper
def euler_from_quat(q: Quat) -> Vec:
    """Return (psi, theta, gamma); at gimbal lock gamma is 0 and psi takes the whole turn.

    theta is found by atan2, so it keeps its precision near +-90 deg, where asin loses half
    the digits. Gimbal lock is where cos(theta) < 1e-8, below which the two outer angles
    cannot be told apart in float64.
    """
    r0, r1, r2 = quat_to_matrix(q)
    c = math.hypot(r2[0], r2[2])
    theta = math.atan2(r2[1], c)
    if c < 1e-8:
        return _turn(r1[0], r0[0]), theta, 0.0
    return _turn(-r0[1], r1[1]), theta, _turn(-r2[0], r2[2])


@kernel
def rotvec_to_quat_many(phi, out):
    """Fill out (n, 4) with the quaternions of rotation vectors phi (n, 3)."""
    for i in range(phi.shape[0]):
        q = qexp((phi[i, 0], phi[i, 1], phi[i, 2]))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = q


@kernel
def quat_to_rotvec_many(q, out):
    """Fill out (n, 3) with the rotation vectors of quaternions q (n, 4)."""
    for i in range(q.shape[0]):
        v = qlog(qnormalise((q[i, 0], q[i, 1], q[i, 2], q[i, 3])))
        out[i, 0], out[i, 1], out[i, 2] = v


@kernel
def quat_multiply_many(p, q, out):
    """Fill out (n, 4) with p (n, 4) times q (n, 4)."""
    for i in range(p.shape[0]):
        r = qmul((p[i, 0], p[i, 1], p[i, 2], p[i, 3]), (q[i, 0], q[i, 1], q[i, 2], q[i, 3]))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = r


@kernel
def quat_rotate_many(q, v, out):
    """Fill out (n, 3) with v (n, 3) turned by q (n, 4)."""
    for i in range(q.shape[0]):
        r = qrotate((q[i, 0], q[i, 1], q[i, 2], q[i, 3]), (v[i, 0], v[i, 1], v[i, 2]))
        out[i, 0], out[i, 1], out[i, 2] = r


@kernel
def quat_to_matrix_many(q, out):
    """Fill out (n, 3, 3) with the matrices of q (n, 4)."""
    for i in range(q.shape[0]):
        r0, r1, r2 = quat_to_matrix((q[i, 0], q[i, 1], q[i, 2], q[i, 3]))
        for j in range(3):
            out[i, 0, j] = r0[j]
            out[i, 1, j] = r1[j]
            out[i, 2, j] = r2[j]


@kernel
def quat_from_matrix_many(m, out):
    """Fill out (n, 4) with the quaternions of m (n, 3, 3)."""
    for i in range(m.shape[0]):
        q = quat_from_matrix(
            (m[i, 0, 0], m[i, 0, 1], m[i, 0, 2]),
            (m[i, 1, 0], m[i, 1, 1], m[i, 1, 2]),
            (m[i, 2, 0], m[i, 2, 1], m[i, 2, 2]),
        )
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = q


@kernel
def quat_from_euler_many(euler, out):
    """Fill out (n, 4) from (psi, theta, gamma) rows (n, 3)."""
    for i in range(euler.shape[0]):
        q = quat_from_euler(euler[i, 0], euler[i, 1], euler[i, 2])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = q


@kernel
def euler_from_quat_many(q, out):
    """Fill out (n, 3) with (psi, theta, gamma) of q (n, 4)."""
    for i in range(q.shape[0]):
        e = euler_from_quat(qnormalise((q[i, 0], q[i, 1], q[i, 2], q[i, 3])))
        out[i, 0], out[i, 1], out[i, 2] = e


@kernel
def quat_chain_many(steps, out):
    """Fill out (n + 1, 4): the first is given, each later one is the one before times its step."""
    q = (out[0, 0], out[0, 1], out[0, 2], out[0, 3])
    for i in range(steps.shape[0]):
        q = qnormalise(qmul(q, (steps[i, 0], steps[i, 1], steps[i, 2], steps[i, 3])))
        out[i + 1, 0], out[i + 1, 1], out[i + 1, 2], out[i + 1, 3] = q
