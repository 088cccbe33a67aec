"""WGS-84 and a few numbers of nature, in SI units.

Sources: NIMA TR8350.2 (2000), third edition, tables 3.1-3.4.
"""

from __future__ import annotations

import math

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth, rad/s."""

EARTH_A = 6378137.0
"""Semi-major axis of the WGS-84 ellipsoid, m."""

EARTH_F = 1.0 / 298.257223563
"""Flattening of the WGS-84 ellipsoid."""

EARTH_E2 = EARTH_F * (2.0 - EARTH_F)
"""First eccentricity squared."""

GRAVITY_EQUATOR = 9.7803253359
"""Normal gravity at the equator, m/s^2."""

GRAVITY_K = 0.00193185265241
"""Somigliana's constant k."""

GRAVITY_M = 0.00344978650684
"""Somigliana's m = omega^2 a^2 b / GM."""

STANDARD_GRAVITY = 9.80665
"""The unit g, m/s^2."""

DEG = math.pi / 180.0
"""One degree, rad."""

ARCMIN = DEG / 60.0
"""One minute of arc, rad."""

ARCSEC = DEG / 3600.0
"""One second of arc, rad."""

DEG_PER_HOUR = DEG / 3600.0
"""One degree an hour, rad/s."""

MICRO_G = 1e-6 * STANDARD_GRAVITY
"""One micro-g, m/s^2."""

MGAL = 1e-5
"""One milligal, m/s^2."""

STAMP_ROUNDING = 1e-6
"""Two stamps that are so near are one instant, s: those since 1970 are doubles 2.4e-7 s apart."""
