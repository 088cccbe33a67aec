"""WGS-84: radii, normal gravity, Earth and transport rate, in ENU, as scalar helpers."""

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
from schuler.kernels.vec import Vec


@helper
def radii_of_sine(s: float) -> tuple[float, float]:
    """Return the meridian and the transverse radius of curvature, m, for the sine of latitude."""
    w2 = 1.0 - EARTH_E2 * s * s
    rn = EARTH_A / math.sqrt(w2)
    return rn * (1.0 - EARTH_E2) / w2, rn


@helper
def radii(lat: float) -> tuple[float, float]:
    """Return the meridian and the transverse (prime vertical) radius of curvature, m."""
    return radii_of_sine(math.sin(lat))


@helper
def gravity_of_sine(s: float) -> tuple[float, float]:
    """Return normal gravity at height 0 (m/s^2) and its slope over it, per m, relative."""
    s2 = s * s
    g0 = GRAVITY_EQUATOR * (1.0 + GRAVITY_K * s2) / math.sqrt(1.0 - EARTH_E2 * s2)
    return g0, -2.0 / EARTH_A * (1.0 + EARTH_F + GRAVITY_M - 2.0 * EARTH_F * s2)


@helper
def gravity(lat: float, height: float) -> float:
    """Return normal gravity (m/s^2) by Somigliana, with the second-order term in height."""
    g0, slope = gravity_of_sine(math.sin(lat))
    return g0 * (1.0 + slope * height + 3.0 * height * height / (EARTH_A * EARTH_A))


@helper
def earth_rate(lat: float) -> Vec:
    """Return the Earth's rotation rate in ENU, rad/s."""
    return 0.0, EARTH_RATE * math.cos(lat), EARTH_RATE * math.sin(lat)


@helper
def transport_rate(lat: float, height: float, ve: float, vn: float) -> Vec:
    """Return the rate of the ENU frame against the Earth, rad/s (not defined at the poles)."""
    rm, rn = radii(lat)
    e = ve / (rn + height)
    return -vn / (rm + height), e, e * math.tan(lat)


@kernel
def radii_many(lat, out):
    """Fill out (n, 2) with meridian and transverse radius."""
    for i in range(lat.shape[0]):
        out[i, 0], out[i, 1] = radii(lat[i])


@kernel
def gravity_many(lat, height, out):
    """Fill out (n,) with normal gravity."""
    for i in range(lat.shape[0]):
        out[i] = gravity(lat[i], height[i])


@kernel
def transport_rate_many(lat, height, ve, vn, out):
    """Fill out (n, 3) with the transport rate in ENU."""
    for i in range(lat.shape[0]):
        r = transport_rate(lat[i], height[i], ve[i], vn[i])
        out[i, 0], out[i, 1], out[i, 2] = r
