"""The closed error formulas of coarse alignment, for both methods.

Constant gyro drift eps and accelerometer bias nabla, in body axes, for a base at rest. Sources:
the formulas of the frozen-inertial-frame method's derivation (equations 36-38 in i0 and 41-43 in
n) and of the analytic method; verified here by perturbing the estimators themselves. The
first-order formulas of the inertial method hold where its tracked attitude is right on average:
at the middle of the span. At its ends the drift of the tracked attitude adds half of what it
gathers, which `inertial_error` includes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import quat_to_matrix
from schuler.constants import EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError

__all__ = ["analytic_error", "bias_formula", "inertial_error", "inertial_frame_error"]

Array = NDArray[np.float64]


def _in_n(quat_nb: ArrayLike, gyro_bias: ArrayLike, accel_bias: ArrayLike) -> tuple[Array, Array]:
    c = quat_to_matrix(quat_nb)
    eps, nabla = np.asarray(gyro_bias, np.float64), np.asarray(accel_bias, np.float64)
    if c.shape != (3, 3) or eps.shape != (3,) or nabla.shape != (3,):
        raise InputError(
            f"expected one quaternion and two vectors of 3, got shapes {np.shape(quat_nb)}, "
            f"{eps.shape} and {nabla.shape}"
        )
    return c @ eps, c @ nabla


def _checked(site: Site) -> tuple[float, float, float]:
    lat = site.latitude
    if np.cos(lat) < 1e-3:
        raise InputError(
            f"latitude {site.lat:.4f} deg is too near a pole: heading cannot be found from "
            "the Earth's rotation there"
        )
    return site.gravity, float(np.cos(lat)), float(np.sin(lat))


def bias_formula(
    site: Site, quat_nb: ArrayLike, gyro_bias: ArrayLike, accel_bias: ArrayLike
) -> Array:
    """Return phi (east, north, up), rad, by equations 41-43.

    phi_E = -nabla_N/g, phi_N = nabla_E/g, phi_U = nabla_E tanL/g - eps_E/(w cosL).

    Parameters
    ----------
    site : Site
    quat_nb : (4,) array_like
        Attitude, scalar first.
    gyro_bias, accel_bias : (3,) array_like
        eps (rad/s) and nabla (m/s^2), body axes.

    Raises
    ------
    InputError
        For wrong shapes, or at a pole.

    Examples
    --------
    >>> eps, nabla = [5e-8, 0.0, 0.0], [0.0, 0.0, 0.0]
    >>> phi = bias_formula(site, [1.0, 0.0, 0.0, 0.0], eps, nabla)
    >>> round(float(1e3 * phi[2]), 3)
    -1.027
    """
    g, cl, sl = _checked(site)
    e, a = _in_n(quat_nb, gyro_bias, accel_bias)
    return np.array([-a[1] / g, a[0] / g, a[0] * sl / (cl * g) - e[0] / (EARTH_RATE * cl)])


def analytic_error(
    site: Site,
    quat_nb: ArrayLike,
    gyro_bias: ArrayLike,
    accel_bias: ArrayLike,
    base: str = "gravity",
) -> Array:
    """Return phi (east, north, up), rad, of the analytic method.

    With gravity as the base it is `bias_formula`. With the Earth's rate as the base
    phi_E = (cosL eps_U - sinL eps_N)/w, the others as before.

    Raises
    ------
    InputError
        For an unknown base, wrong shapes, or at a pole.

    Examples
    --------
    >>> eps, nabla = [5e-8, 0.0, 0.0], [0.0, 0.0, 0.0]
    >>> phi = analytic_error(site, [1.0, 0.0, 0.0, 0.0], eps, nabla, "earth-rate")
    >>> round(float(1e3 * phi[2]), 3)
    -1.027
    """
    if base not in ("gravity", "earth-rate"):
        raise InputError(f"base must be gravity or earth-rate, got '{base}'")
    phi = bias_formula(site, quat_nb, gyro_bias, accel_bias)
    if base == "earth-rate":
        _, cl, sl = _checked(site)
        e, _ = _in_n(quat_nb, gyro_bias, accel_bias)
        phi[0] = (cl * e[2] - sl * e[1]) / EARTH_RATE
    return phi


def inertial_error(
    site: Site,
    quat_nb: ArrayLike,
    gyro_bias: ArrayLike,
    accel_bias: ArrayLike,
    duration: float = 0.0,
    at: str = "middle",
) -> Array:
    """Return phi (east, north, up), rad, of the inertial-frame method at rest.

    `bias_formula` at the middle of the span; at its start or end -+ (T/2) times the rate at
    which the tracked attitude leaves the truth, eps + Omega x phi.

    Parameters
    ----------
    site, quat_nb, gyro_bias, accel_bias
        As in `bias_formula`.
    duration : float
        T, s.
    at : {"start", "middle", "end"}
        Where phi is wanted.

    Raises
    ------
    InputError
        For an unknown instant, wrong shapes, or at a pole.

    Examples
    --------
    >>> eps, nabla = [0.0, 0.0, 5e-8], [0.0, 0.0, 0.0]
    >>> phi = inertial_error(site, [1.0, 0.0, 0.0, 0.0], eps, nabla, 300.0, at="end")
    >>> round(float(1e6 * phi[2]), 1)
    -7.5
    """
    sign = {"start": -1.0, "middle": 0.0, "end": 1.0}.get(at)
    if sign is None:
        raise InputError(f"at must be start, middle or end, got '{at}'")
    phi = bias_formula(site, quat_nb, gyro_bias, accel_bias)
    e, _ = _in_n(quat_nb, gyro_bias, accel_bias)
    # phi' = phi x Omega - eps: the error of C turns with n and against the drift.
    rate = np.cross(phi, site.earth_rate) - e
    return np.asarray(phi + sign * 0.5 * duration * rate)


def inertial_frame_error(
    site: Site,
    quat_nb: ArrayLike,
    gyro_bias: ArrayLike,
    accel_bias: ArrayLike,
    span_sum: float = 0.0,
) -> Array:
    """Return phi in i0, rad, by equations 36-38.

    With m = w (t1 + t2): phi_x = sin(m/2) nabla_N/g - eps_E/w, phi_y = -nabla_N/g,
    phi_z = nabla_E/(g cosL) - eps_E tanL/w.

    Parameters
    ----------
    site, quat_nb, gyro_bias, accel_bias
        As in `bias_formula`.
    span_sum : float
        t1 + t2, s.

    Raises
    ------
    InputError
        For wrong shapes, or at a pole.

    Examples
    --------
    >>> eps, nabla = [5e-8, 0.0, 0.0], [0.0, 0.0, 0.0]
    >>> phi = inertial_frame_error(site, [1.0, 0.0, 0.0, 0.0], eps, nabla, span_sum=300.0)
    >>> round(float(1e3 * phi[0]), 3)
    -0.686
    """
    g, cl, sl = _checked(site)
    e, a = _in_n(quat_nb, gyro_bias, accel_bias)
    half = 0.5 * EARTH_RATE * span_sum
    return np.array(
        [
            np.sin(half) * a[1] / g - e[0] / EARTH_RATE,
            -a[1] / g,
            a[0] / (g * cl) - e[0] * sl / (cl * EARTH_RATE),
        ]
    )
