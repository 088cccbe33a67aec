"""Coefficients of a platform that a centrifuge test finds: names, units, published values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.constants import ARCSEC, DEG_PER_HOUR

__all__ = [
    "PUBLISHED_ESTIMATES",
    "PUBLISHED_TRUTH",
    "coefficient_names",
    "coefficient_units",
    "published_truth",
]

Array = NDArray[np.float64]


GYRO_TERMS = ("D_F", "D_I", "D_O", "D_S", "D_II", "D_SS", "D_IO", "D_IS", "D_OS", "D_OO")
ACCEL_TERMS = ("k0", "k1", "k2", "k3", "k_IP")
MOUNTING = ("th_py", "th_pz", "th_oz")

#: the published truth in its units: deg/h, deg/h/g, deg/h/g^2; ug, ug/g, ...; arcsec (x, y, z)
PUBLISHED_TRUTH: dict[str, tuple[float, float, float]] = {
    "D_F": (7.370, 7.821, 1.654),
    "D_I": (1.083, 1.023, 0.933), "D_O": (1.083, 1.023, 0.933), "D_S": (1.083, 1.023, 0.933),
    "D_II": (0.060, 0.060, 0.060), "D_SS": (0.060, 0.060, 0.060),
    "D_IO": (0.045, 0.045, 0.045), "D_IS": (0.045, 0.045, 0.045), "D_OS": (0.045, 0.045, 0.045),
    "k0": (3500, 4250, 6310), "k1": (160, 100, 1100), "k2": (12, 12, 12), "k3": (3, 3, 3),
    "k_IP": (5, 5, 5),
    "th": (305, 305, 260),
}  # fmt: skip

_GYRO_UNITS = ("deg/h", *["deg/h/g"] * 3, *["deg/h/g^2"] * 6)
_ACCEL_UNITS = ("ug", "ug/g", "ug/g^2", "ug/g^3", "ug/g^2")


def coefficient_names(d_oo: bool = False) -> tuple[str, ...]:
    """Name the unknowns in their order: ``D_Fx`` to ``th_oz``; 45, or 48 with D_OO.

    Examples
    --------
    >>> coefficient_names()[:3]
    ('D_Fx', 'D_Fy', 'D_Fz')
    """
    terms = GYRO_TERMS if d_oo else GYRO_TERMS[:-1]
    return (*(f"{term}{axis}" for term in (*terms, *ACCEL_TERMS) for axis in "xyz"), *MOUNTING)


def coefficient_units(d_oo: bool = False) -> tuple[tuple[str, ...], Array]:
    """Return the unknowns' customary units and what one of each is inside (rad/s, g, rad).

    Examples
    --------
    >>> units, factors = coefficient_units()
    >>> units[0], len(factors)
    ('deg/h', 45)
    """
    gyro = _GYRO_UNITS if d_oo else _GYRO_UNITS[:-1]
    names = [u for u in (*gyro, *_ACCEL_UNITS) for _ in "xyz"] + ["arcsec"] * 3
    factor = {"d": DEG_PER_HOUR, "u": 1e-6, "a": ARCSEC}
    return tuple(names), np.array([factor[name[0]] for name in names])


PUBLISHED_ESTIMATES = (
    7.3807, 7.7628, 1.6111, 1.0800, 1.0305, 0.9357, 1.0896, 1.0171, 0.9500, 1.0739, 1.0325, 0.9269,
    0.0603, 0.0603, 0.0606, 0.0606, 0.0609, 0.0603, 0.0448, 0.0462, 0.0451, 0.0446, 0.0451, 0.0447,
    0.0445, 0.0455, 0.0458, 3499.83, 4249.09, 6310.41, 159.75, 100.22, 1101.31, 12.02, 12.02, 11.99,
    2.99, 3.00, 3.01, 5.00, 4.98, 4.95, 304.98, 305.10, 259.95,
)  # fmt: skip
"""The document's estimates (its table 2), in the order of `coefficient_names`."""


def published_truth() -> Array:
    """Return the published true coefficients (45,), rad/s a power of g, g a power of g, rad.

    Examples
    --------
    >>> len(published_truth())
    45
    """
    values = np.array([v for three in PUBLISHED_TRUTH.values() for v in three], dtype=np.float64)
    return values * coefficient_units()[1]
