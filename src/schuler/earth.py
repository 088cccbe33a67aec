"""The Earth, vectorised: radii, normal gravity, Earth and transport rate; and `Site`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.constants import ARCSEC, DEG, EARTH_A, EARTH_E2, EARTH_F, EARTH_RATE, MGAL
from schuler.errors import InputError, expect

__all__ = [
    "Site", "earth_rate", "geocentric", "geodetic", "gravity", "moved", "radii", "transport_rate",
]  # fmt: skip

Array = NDArray[np.float64]


def _flat(*values: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    arrays = np.broadcast_arrays(*[np.asarray(v, np.float64) for v in values])
    return arrays[0].shape, [np.ascontiguousarray(a).reshape(-1) for a in arrays]


def radii(lat: ArrayLike) -> tuple[Array, Array]:
    """Return the meridian and transverse radii of curvature of WGS-84.

    Parameters
    ----------
    lat : (...) array_like
        Geodetic latitude, rad.

    Returns
    -------
    (...) ndarray, (...) ndarray
        Meridian (north-south) and prime-vertical (east-west) radius, m.

    Examples
    --------
    >>> from schuler.earth import radii
    >>> [round(float(r)) for r in radii(0.0)]  # meridian, transverse
    [6335439, 6378137]
    """
    from schuler.kernels.earth import radii_many

    shape, (flat,) = _flat(lat)
    out = np.empty((len(flat), 2))
    radii_many(flat, out)
    return out[:, 0].reshape(shape), out[:, 1].reshape(shape)


def geocentric(lat: ArrayLike, lon: ArrayLike, height: ArrayLike) -> Array:
    """Return positions in the Earth's axes (..., 3), m, from latitude, longitude (rad), height.

    Examples
    --------
    >>> geocentric(0.0, 0.0, 100.0).tolist()
    [6378237.0, 0.0, 0.0]
    """
    lat, lon, height = (np.asarray(x, np.float64) for x in (lat, lon, height))
    transverse = radii(lat)[1]
    out = (transverse + height) * np.cos(lat)
    along = (transverse * (1.0 - EARTH_E2) + height) * np.sin(lat)
    return np.stack([out * np.cos(lon), out * np.sin(lon), along], axis=-1)


def geodetic(position: ArrayLike) -> tuple[Array, Array, Array]:
    """Return latitude, longitude (rad) and height (m) of positions (..., 3) in the Earth's axes.

    Near the surface, to 1e-8 m, at the poles as well.

    Examples
    --------
    >>> lat, lon, height = geodetic(geocentric(0.7, 3.1, 250.0))
    >>> print(f"{lat:.9f} {lon:.9f} {height:.6f}")
    0.700000000 3.100000000 250.000000
    """
    x, y, z = np.moveaxis(np.asarray(position, np.float64), -1, 0)
    out = np.hypot(x, y)
    minor = 1.0 - EARTH_F
    # Bowring's angle, twice improved: the first guess is right on the ellipsoid.
    angle = np.arctan2(z, out * minor)
    for _ in range(3):
        lat = np.arctan2(
            z + EARTH_E2 / minor * EARTH_A * np.sin(angle) ** 3,
            out - EARTH_E2 * EARTH_A * np.cos(angle) ** 3,
        )
        angle = np.arctan2(minor * np.sin(lat), np.cos(lat))
    surface = EARTH_A * np.sqrt(1.0 - EARTH_E2 * np.sin(lat) ** 2)
    return lat, np.arctan2(y, x), out * np.cos(lat) + z * np.sin(lat) - surface


def moved(
    lat: ArrayLike, lon: ArrayLike, height: ArrayLike, off_n: ArrayLike
) -> tuple[Array, Array, Array]:
    """Return latitude, longitude (rad) and height of points east, north and up of others.

    By way of the Earth's axes, in which neither a pole nor the date line is special.

    Parameters
    ----------
    lat, lon, height : (...) array_like
        rad and m.
    off_n : (..., 3) array_like
        m.

    Examples
    --------
    >>> lat, lon, height = moved(0.8, 0.2, 0.0, [0.0, 1000.0, 0.0])
    >>> round(float(lat - 0.8) * 6.37e6)
    1000
    """
    lat, lon = np.asarray(lat, np.float64), np.asarray(lon, np.float64)
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    east, north, up = np.moveaxis(np.asarray(off_n, np.float64), -1, 0)
    out = cl * up - sl * north
    step = np.stack([co * out - so * east, so * out + co * east, sl * up + cl * north], axis=-1)
    return geodetic(geocentric(lat, lon, height) + step)


def gravity(lat: ArrayLike, height: ArrayLike = 0.0) -> Array:
    """Return normal gravity at latitude and height.

    Parameters
    ----------
    lat, height : (...) array_like
        Geodetic latitude (rad) and ellipsoidal height (m).

    Returns
    -------
    (...) ndarray
        m/s^2: Somigliana's closed form with the second-order series in height (NIMA
        TR8350.2, 2000, equations 4-1 and 4-3).

    Examples
    --------
    >>> from schuler.earth import gravity
    >>> round(float(gravity(np.deg2rad(45.0), 0.0)), 5)
    9.8062
    """
    from schuler.kernels.earth import gravity_many

    shape, (la, h) = _flat(lat, height)
    out = np.empty(len(la))
    gravity_many(la, h, out)
    return out.reshape(shape)


def earth_rate(lat: ArrayLike) -> Array:
    """Return the Earth's rotation rate in ENU, rad/s, shape (..., 3), for a latitude in rad.

    Examples
    --------
    >>> from schuler.earth import earth_rate
    >>> east, north, up = np.rad2deg(earth_rate(0.0)) * 3600.0
    >>> round(float(north), 3), float(up)  # deg/h
    (15.041, 0.0)
    """
    la = np.asarray(lat, np.float64)
    return np.stack([np.zeros_like(la), EARTH_RATE * np.cos(la), EARTH_RATE * np.sin(la)], axis=-1)


def transport_rate(lat: ArrayLike, height: ArrayLike, ve: ArrayLike, vn: ArrayLike) -> Array:
    """Return the rate of ENU against the Earth for a moving vehicle.

    Parameters
    ----------
    lat, height, ve, vn : (...) array_like
        Latitude (rad), height (m), east and north velocity (m/s).

    Returns
    -------
    (..., 3) ndarray
        rad/s in ENU. Grows without bound towards the poles.

    Examples
    --------
    >>> (1e6 * transport_rate(0.0, 0.0, 0.0, 10.0)).round(2).tolist()[0]
    -1.58
    """
    from schuler.kernels.earth import transport_rate_many

    shape, (la, h, e, n) = _flat(lat, height, ve, vn)
    out = np.empty((len(la), 3))
    transport_rate_many(la, h, e, n, out)
    return out.reshape((*shape, 3))


_EXAMPLES = {
    "latitude": "Site(34.2)", "longitude": "Site(34.2, 108.9)", "height": "Site(34.2, height=380)",
    "gravity_sigma": "gravity_sigma=20", "deflection_sigma": "deflection_sigma=5",
}  # fmt: skip
"""What a call looks like in which each argument is a number."""


@dataclass(frozen=True)
class Site:
    """A place on the Earth, given as people give it.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude in [-90, 90] and longitude in [-180, 360], degrees. An alignment does
        not need the longitude.
    height : float
        Height above the ellipsoid, m.
    gravity_sigma : float
        1-sigma of how far gravity is from normal gravity at this place, mGal (1e-5 m/s^2).
    deflection_sigma : float
        1-sigma of the deflection of the vertical, north and east, arcsec. Both are common values
        of gravity anomalies; zero where gravity is that of the formula, as in a simulation.

    Raises
    ------
    InputError
        For a value out of range or not finite.

    Examples
    --------
    >>> site = sc.Site(48.1, 11.6, 500.0)
    >>> round(site.gravity, 4)
    9.8075
    """

    lat: float
    lon: float = 0.0
    height: float = 0.0
    gravity_sigma: float = 20.0
    deflection_sigma: float = 5.0

    def __post_init__(self) -> None:
        for label, value, low, high, unit in (
            ("latitude", self.lat, -90.0, 90.0, "deg"),
            ("longitude", self.lon, -180.0, 360.0, "deg"),
            ("height", self.height, -12000.0, 100000.0, "m"),
            ("gravity_sigma", self.gravity_sigma, 0.0, 1000.0, "mGal"),
            ("deflection_sigma", self.deflection_sigma, 0.0, 120.0, "arcsec"),
        ):
            expect(value, Real, label, f"give it in {unit}, as {_EXAMPLES[label]}")
            if not (math.isfinite(value) and low <= value <= high):
                raise InputError(
                    f"{label} must be between {low:g} and {high:g} {unit}, got {value:g}"
                )

    @property
    def latitude(self) -> float:
        """Latitude, rad."""
        return self.lat * DEG

    @property
    def longitude(self) -> float:
        """Longitude, rad."""
        return self.lon * DEG

    @property
    def gravity(self) -> float:
        """Normal gravity, m/s^2."""
        return float(gravity(self.latitude, self.height))

    @property
    def gravity_uncertainty(self) -> float:
        """1-sigma of gravity, m/s^2."""
        return self.gravity_sigma * MGAL

    @property
    def deflection(self) -> float:
        """1-sigma of the deflection of the vertical, rad."""
        return self.deflection_sigma * ARCSEC

    @property
    def earth_rate(self) -> Array:
        """Earth rate in ENU, rad/s, (3,)."""
        return earth_rate(self.latitude)
