"""How the time in a fix comes to the clock of the samples, on a stream: said, never guessed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.fix_rows import SIGMA, TIME, V_N, V_SIGMA
from schuler.errors import InputError

__all__ = ["STREAM_CLOCKS", "StreamClock"]

Array = NDArray[np.float64]

STREAM_CLOCKS = {
    "utc": "the samples' times are UTC: of the day, or since 1970",
    "gps": "the samples' times are GPS time: of the week, or since 1980",
    "arrival": "the samples' times are of another clock: a fix is stamped when it arrives",
}
"""What a user says of the samples' clock, and what it means."""

_DAY = 86400.0
_MOST_ERROR = 2.0


@dataclass(frozen=True)
class StreamClock:
    """The clock of the samples beside that of the fixes, which is UTC of the day.

    Parameters
    ----------
    kind : {"utc", "gps", "arrival"}
        A key of `STREAM_CLOCKS`.
    leap_seconds : float, optional
        GPS time less UTC, s: needed for "gps".
    error : float, optional
        1-sigma of how long a fix takes to arrive, beside the delay that is said, s: needed for
        "arrival".

    Raises
    ------
    InputError
        For another kind, or one whose number is missing or not its own.

    Examples
    --------
    >>> StreamClock("gps", leap_seconds=18.0).on_record(10.0, 86400.0 + 30.0)
    86428.0
    """

    kind: str
    leap_seconds: float | None = None
    error: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in STREAM_CLOCKS:
            raise InputError(f"the samples' clock is {', '.join(STREAM_CLOCKS)}, got '{self.kind}'")
        if (self.kind == "gps") != (self.leap_seconds is not None):
            raise InputError(
                "leap seconds (GPS time less UTC, 18 s since 2017) are said with the clock gps, "
                "and with no other"
            )
        if (self.kind == "arrival") != (self.error is not None):
            raise InputError(
                "the error of the arrival times is said with the clock arrival, and with no other"
            )
        if self.leap_seconds is not None and not 0.0 <= self.leap_seconds <= 60.0:
            raise InputError(f"leap seconds are 0 to 60, got {self.leap_seconds:g}")
        if self.error is not None and not 0.0 < self.error <= _MOST_ERROR:
            raise InputError(
                f"the error of arrival times is above 0 and at most {_MOST_ERROR:g} s, "
                f"got {self.error:g}"
            )

    def on_record(self, day_time: float, near: float) -> float:
        """Return the time of a fix on the samples' clock.

        Parameters
        ----------
        day_time : float
            Seconds of the UTC day.
        near : float
            The newest sample's time, s: which day it is; for "arrival" that at the arrival.
        """
        if self.kind == "arrival":
            return near
        time = day_time + (self.leap_seconds or 0.0)
        # Weeks and epochs of UTC and GPS time begin with a day.
        return time + _DAY * round((near - time) / _DAY)

    def widened(self, row: Array, before: Array | None) -> Array:
        """Return a fix whose sigma holds what the error of its arrival makes of the motion.

        Parameters
        ----------
        row : (14,) float64
            As `schuler.aiding.fix_rows`.
        before : (14,) float64 or None
            The fix before.
        """
        if self.error is None or not np.all(np.isfinite(row[V_N])):
            return row
        out = row.copy()
        out[SIGMA] = np.hypot(row[SIGMA], self.error * np.abs(row[V_N]))
        if before is not None and np.all(np.isfinite(before[V_N])) and row[TIME] > before[TIME]:
            rate = (row[V_N] - before[V_N]) / (row[TIME] - before[TIME])
            out[V_SIGMA] = np.hypot(row[V_SIGMA], self.error * np.abs(rate))
        return out
