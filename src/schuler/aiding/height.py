"""`Height`: heights of a barometer or a depth gauge, with an offset that wanders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.rows import checked_lever, checked_rows
from schuler.errors import InputError

__all__ = ["Height", "pressure_height"]

Array = NDArray[np.float64]

_SEA_LEVEL = 101_325.0
_LEAST_PRESSURE, _MOST_PRESSURE = 22_632.0, 120_000.0
"""Of the lowest layer of the standard atmosphere, Pa: up to 11 km, and below sea level."""


@dataclass(frozen=True, eq=False)
class Height:
    """Heights, positive up, with an offset that is estimated.

    Rows that cannot be used are left out and counted in `dropped`.

    Parameters
    ----------
    time : (n,) array_like
        On the record's clock, s.
    height : (n,) array_like
        m; of a depth gauge the depth with its sign turned.
    sigma : float or (n,) array_like
        1-sigma without the offset, m.
    offset_sigma, offset_time : float
        1-sigma (m) and correlation time (s) of the offset, measured minus true height: a
        first-order Gauss-Markov process. An infinite time is a constant, a sigma of 0 none at all.
        With the defaults the offset moves by 2.4 m in a second (1 sigma); weather changes it by
        far less, and a user who knows his sensor says a longer time.
    lever : (3,) array_like
        From the IMU to the sensor, body axes, m.
    name : str
    dropped : mapping of str to int
        Rows that were left out, by reason.
    clock : str
        What the times count, of `schuler.aiding.CLOCKS`.

    Raises
    ------
    InputError
        For arrays of other shapes, no usable row, or an offset that is no process.

    Examples
    --------
    >>> import numpy as np
    >>> found = Height([0.0, 1.0, 2.0], [100.0, np.nan, 101.0])
    >>> len(found), found.dropped
    (2, {'a value that is no number': 1})
    """

    time: ArrayLike
    height: ArrayLike
    sigma: ArrayLike = 1.0
    offset_sigma: float = 100.0
    offset_time: float = 3600.0
    lever: ArrayLike = (0.0, 0.0, 0.0)
    name: str = "height"
    dropped: Mapping[str, int] = field(default_factory=dict)
    clock: str = "unstated"

    def __post_init__(self) -> None:
        if not (0.0 <= self.offset_sigma < np.inf and self.offset_time > 0.0):
            raise InputError(
                f"{self.name}: an offset has a finite sigma and a positive time, got "
                f"{self.offset_sigma} m and {self.offset_time} s"
            )
        time, columns, sigma, dropped = checked_rows(
            self.name, self.time, {"height": self.height}, self.sigma, 1, self.dropped
        )
        for key, value in (
            ("time", time), ("height", columns["height"]), ("sigma", sigma),
            ("lever", checked_lever(self.lever, self.name)), ("dropped", dropped),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(np.asarray(self.time))


def pressure_height(pressure: ArrayLike) -> Array:
    """Return the height of a pressure in the standard atmosphere, m.

    Parameters
    ----------
    pressure : array_like
        Pa.

    Raises
    ------
    InputError
        Beyond the lowest layer (up to 11 km), where the formula is another.

    Notes
    -----
    ICAO Doc 7488: 288.15 K at sea level, 6.5 K less each kilometre. Geopotential and geometric
    height differ by 1.6 m at 3 km.

    Examples
    --------
    >>> print(f"{float(pressure_height(89874.57)):.1f} m")
    1000.0 m
    """
    p = np.asarray(pressure, np.float64)
    known = p[np.isfinite(p)]
    if np.any(known < _LEAST_PRESSURE) or np.any(known > _MOST_PRESSURE):
        raise InputError(
            f"pressures of {np.min(known):.6g} to {np.max(known):.6g} Pa are beyond the lowest "
            "layer of the standard atmosphere (226 to 1200 hPa): is the unit right? Say it in the "
            "column, as pressure [hPa]"
        )
    return np.asarray(288.15 / 0.0065 * (1.0 - (p / _SEA_LEVEL) ** (0.0065 * 287.05287 / 9.80665)))
