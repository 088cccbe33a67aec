"""The motion in i0, the Earth's axes frozen at the start, as aids and gravitation make it.

In i0 a point at r_e that moves over ground with v_e has the velocity R (v_e + w x r_e), with
R = R_z(w t), and what makes it change beside the force is gravitation, which is gravity less the
centrifugal part: R (g_e + w x (w x r_e)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_A, EARTH_E2, EARTH_RATE
from schuler.earth import gravity

__all__ = [
    "earth_fixed", "from_earth", "gravitation", "gravitation_integrals", "inertial_velocity",
    "local_axes", "spun",
]  # fmt: skip

Array = NDArray[np.float64]

_RATE = np.array([0.0, 0.0, EARTH_RATE])
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = 0.5 + 0.5 * _NODES, 0.5 * _WEIGHTS

_STEP = 1.0
"""Longest step of the quadrature of gravitation, s ..."""

_MOST_STEPS = 16
"""... unless an interval has more steps than this."""


def earth_fixed(lat: Array, lon: Array, height: Array) -> Array:
    """Return Earth-fixed coordinates (n, 3), m, of latitude and longitude (rad) and height (m)."""
    sl, cl = np.sin(lat), np.cos(lat)
    normal = EARTH_A / np.sqrt(1.0 - EARTH_E2 * sl**2)
    level = (normal + height) * cl
    return np.stack(
        [level * np.cos(lon), level * np.sin(lon), (normal * (1.0 - EARTH_E2) + height) * sl],
        axis=-1,
    )


def from_earth(r_e: Array) -> tuple[Array, Array, Array]:
    """Return latitude and longitude (rad) and height (m) of Earth-fixed coordinates (n, 3).

    Bowring (1976), repeated: exact to rounding where vehicles are.
    """
    x, y, z = np.moveaxis(np.asarray(r_e, np.float64), -1, 0)
    level = np.hypot(x, y)
    b = EARTH_A * np.sqrt(1.0 - EARTH_E2)
    second = EARTH_E2 / (1.0 - EARTH_E2)
    beta = np.arctan2(EARTH_A * z, b * level)
    lat = beta
    for _ in range(3):
        lat = np.arctan2(
            z + second * b * np.sin(beta) ** 3, level - EARTH_E2 * EARTH_A * np.cos(beta) ** 3
        )
        beta = np.arctan2(b * np.sin(lat), EARTH_A * np.cos(lat))
    sl = np.sin(lat)
    normal = EARTH_A / np.sqrt(1.0 - EARTH_E2 * sl**2)
    height = level * np.cos(lat) + z * sl - normal * (1.0 - EARTH_E2 * sl**2)
    return lat, np.arctan2(y, x), height


def local_axes(lat: Array, lon: Array) -> Array:
    """Return mat_en (n, 3, 3), from East-North-Up to the Earth's axes."""
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(sl)
    return np.stack(
        [
            np.stack([-so, -sl * co, cl * co], axis=-1),
            np.stack([co, -sl * so, cl * so], axis=-1),
            np.stack([zero, cl, sl], axis=-1),
        ],
        axis=-2,
    )


def spun(t: Array, vectors: Array) -> Array:
    """Return vectors (n, 3) of the Earth's axes in i0, t seconds after the start."""
    c, s = np.cos(EARTH_RATE * t), np.sin(EARTH_RATE * t)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def gravitation(r_e: Array) -> Array:
    """Return gravitation (n, 3) at Earth-fixed places, Earth's axes, m/s^2.

    Normal gravity straight down, and the centrifugal part taken off again.
    """
    lat, lon, height = from_earth(r_e)
    up = local_axes(lat, lon)[..., :, 2]
    g = np.asarray(gravity(lat, height))
    centripetal = np.cross(_RATE, np.cross(_RATE, r_e))
    return np.asarray(-g[..., None] * up + centripetal)


def inertial_velocity(t: Array, r_e: Array, v_e: Array) -> Array:
    """Return the velocity (n, 3) in i0, m/s."""
    return spun(t, v_e + np.cross(_RATE, r_e))


def gravitation_integrals(t: Array, r_e: Array, v_e: Array) -> tuple[Array, Array]:
    """Return the single and the double integral of gravitation in i0 since the first instant.

    Parameters
    ----------
    t : (n,) float64
        Instants, s since the start.
    r_e, v_e : (n, 3) float64
        Earth-fixed places (m) and velocities over ground (m/s); between instants the cubic through
        both.

    Returns
    -------
    (n, 3), (n, 3) float64
        m/s and m.
    """
    dt = np.diff(t)
    steps = int(np.clip(np.ceil(dt.max() / _STEP), 1, _MOST_STEPS))
    part = (np.arange(steps)[:, None] + _NODES) / steps  # of an interval
    weight = np.broadcast_to(_WEIGHTS / steps, part.shape)
    u, w = part.ravel(), weight.ravel()
    h00, h10 = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u * (1.0 - u) ** 2
    h01, h11 = u**2 * (3.0 - 2.0 * u), u**2 * (u - 1.0)
    d = dt[:, None]
    place = (
        h00[:, None] * r_e[:-1, None] + h01[:, None] * r_e[1:, None]
        + (h10 * d)[..., None] * v_e[:-1, None] + (h11 * d)[..., None] * v_e[1:, None]
    )  # fmt: skip
    force = spun(t[:-1, None] + u * d, gravitation(place))
    single = np.einsum("k,ika->ia", w, force) * d
    double = np.einsum("k,ika->ia", w * (1.0 - u), force) * d**2
    velocity = np.concatenate([np.zeros((1, 3)), np.cumsum(single, axis=0)])
    way = np.cumsum(double + velocity[:-1] * d, axis=0)
    return velocity, np.concatenate([np.zeros((1, 3)), way])
