"""Rows of fixes as they come on a stream, and `GnssFixes` of some of them.

A row has the `COLUMNS`; a number that a fix has not is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.gnss import GnssFixes

__all__ = [
    "COLUMNS", "PLACE", "QUALITY", "SIGMA", "TIME", "V_N", "V_SIGMA", "FixSetting", "fix_row",
    "is_possible", "rows_of",
]  # fmt: skip

Array = NDArray[np.float64]

TIME, PLACE, SIGMA, V_N, V_SIGMA, QUALITY = (
    0, slice(1, 4), slice(4, 7), slice(7, 10), slice(10, 13), 13
)  # fmt: skip
"""Columns: s; latitude and longitude (rad), height (m); m; m/s (east, north, up); m/s; as read."""

COLUMNS = 14
"""How many these are."""

_HIGHEST, _FASTEST = 1e5, 1e4
"""No vehicle is higher (m) or faster (m/s)."""


@dataclass(frozen=True)
class FixSetting:
    """What is known of the antenna and the receiver beside the fixes.

    Parameters
    ----------
    lever : (3,) array_like
        From the IMU to the antenna, body axes, m.
    delay : float
        A fix stamped t is valid at t - delay, s.
    estimate : tuple of str
        Which of "lever" and "delay" are estimated.
    delay_sigma : float
        1-sigma of a delay that is estimated, s.
    name : str

    Examples
    --------
    >>> antenna = FixSetting(lever=(0.0, 1.0, 0.5))
    >>> len(antenna.fixes(rows_of(gnss)))
    59
    """

    lever: ArrayLike = (0.0, 0.0, 0.0)
    delay: float = 0.0
    estimate: tuple[str, ...] = ()
    delay_sigma: float = 0.3
    name: str = "gnss"

    def fixes(self, rows: Array) -> GnssFixes:
        """Return the fixes of rows (n, `COLUMNS`).

        Where fewer than half of them have a velocity, none has; otherwise those without one are
        left out.

        Raises
        ------
        InputError
            If fewer than two are left.
        """
        has = np.all(np.isfinite(rows[:, V_N]), axis=1)
        v_n = v_sigma = None
        if 2 * np.sum(has) >= max(len(rows), 1):
            rows = rows[has]
            v_n, v_sigma = rows[:, V_N], rows[:, V_SIGMA]
        quality = rows[:, QUALITY]
        lat, lon, height = rows[:, PLACE].T
        return GnssFixes(
            rows[:, TIME], lat, lon, height, rows[:, SIGMA], v_n,
            0.1 if v_sigma is None else v_sigma,
            quality if np.all(np.isfinite(quality)) else None, lever=self.lever, delay=self.delay,
            estimate=self.estimate, name=self.name, delay_sigma=self.delay_sigma,
        )  # fmt: skip


def fix_row(
    time: float, place: ArrayLike, sigma: ArrayLike, v_n: ArrayLike | None, v_sigma: ArrayLike,
    quality: float = np.nan,
) -> Array:  # fmt: skip
    """Return one fix as a row (`COLUMNS`,)."""
    row = np.full(COLUMNS, np.nan)
    row[TIME], row[PLACE], row[SIGMA], row[QUALITY] = time, place, sigma, quality
    if v_n is not None:
        row[V_N], row[V_SIGMA] = v_n, v_sigma
    return row


def is_possible(row: Array) -> bool:
    """Say whether a row is a fix that a vehicle can have; its velocity may be missing.

    Examples
    --------
    >>> row = fix_row(0.0, (0.8, 0.2, 500.0), 3.0, None, 0.1)
    >>> is_possible(row)
    True
    """
    lat, lon, height = (abs(float(x)) for x in row[PLACE])
    speed = row[V_N]
    known = np.r_[row[TIME], row[PLACE], row[SIGMA]]
    return bool(
        np.all(np.isfinite(known)) and lat <= 0.5 * np.pi and lon <= 2.0 * np.pi
        and height <= _HIGHEST and np.all(row[SIGMA] > 0.0)
        and (np.all(np.isnan(speed)) or float(np.abs(speed).max()) < _FASTEST)
    )  # fmt: skip


def rows_of(fixes: GnssFixes) -> Array:
    """Return fixes as rows (n, `COLUMNS`).

    Examples
    --------
    >>> rows_of(gnss).shape[1]
    14
    """
    out = np.full((len(fixes), COLUMNS), np.nan)
    out[:, TIME] = fixes.time
    out[:, PLACE] = np.column_stack([fixes.lat, fixes.lon, fixes.height])
    out[:, SIGMA] = fixes.sigma
    if fixes.v_n is not None:
        out[:, V_N], out[:, V_SIGMA] = fixes.v_n, fixes.v_sigma
    if fixes.quality is not None:
        out[:, QUALITY] = fixes.quality
    return out
