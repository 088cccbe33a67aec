"""Attitude of a platform in its gimbals: matrix from angles, and rates of the angles."""

from __future__ import annotations

import math

from schuler.kernels._jit import helper

ZYX, YZX = range(2)
"""Orders of the gimbals: Mz(gamma) My(beta) Mx(alpha), or My(gamma) Mz(beta) Mx(alpha)."""


@helper
def platform_matrix(alpha, beta, gamma, order):
    """Return C_r^p of an order of the gimbals, nine numbers by rows."""
    sa, ca = math.sin(alpha), math.cos(alpha)
    sb, cb = math.sin(beta), math.cos(beta)
    sg, cg = math.sin(gamma), math.cos(gamma)
    if order == YZX:
        return (
            cg * cb, cg * sb * ca + sg * sa, cg * sb * sa - sg * ca,
            -sb, cb * ca, cb * sa,
            sg * cb, sg * sb * ca - cg * sa, sg * sb * sa + cg * ca,
        )  # fmt: skip
    return (
        cg * cb, cg * sb * sa + sg * ca, -cg * sb * ca + sg * sa,
        -sg * cb, -sg * sb * sa + cg * ca, sg * sb * ca + cg * sa,
        sb, -cb * sa, cb * ca,
    )  # fmt: skip


@helper
def angle_rates(angles, order, p, q, r):
    """Return T (p, q, r): how the angles change when p turns at so much (eq. 15 for `YZX`)."""
    sb, cb = math.sin(angles[1]), math.cos(angles[1])
    sg, cg = math.sin(angles[2]), math.cos(angles[2])
    if order == YZX:
        a = (cg * p + sg * r) / cb
        return a, cg * r - sg * p, q + sb * a
    a = (cg * p - sg * q) / cb
    return a, sg * p + cg * q, r - sb * a
