"""The clocks of aids: what their times count, and why two spans of time do not overlap."""

from __future__ import annotations

import calendar
import re

from schuler.errors import InputError
from schuler.units import time_text

__all__ = ["CLOCKS", "no_overlap", "utc_of_zero"]

CLOCKS = {
    "unstated": "seconds of a clock that the file does not name",
    "gps-week": "seconds of the GPS week",
    "utc-week": "seconds of the week in UTC",
    "utc-day": "seconds of the day in UTC",
    "utc": "seconds since 1970 in UTC",
    "logger": "seconds of the logger's own clock",
}
"""What times may count, and how it is said."""

_DAY, _WEEK, _LEAP = 86400.0, 604800.0, 18.0
_GPS_START = 315964800.0
"""Unix time of 1980-01-06, at which GPS weeks begin, s."""
#: differences of two clocks, the least first, s
_CAUSES = (
    (_LEAP, "the leap seconds between UTC and GPS time"),
    (3600.0, "a time zone"),
    (_DAY, "seconds of the day beside those of the week, or a day boundary"),
    (_WEEK, "weeks of GPS time"),
)
_EPOCHS = ((315964800.0, "seconds since 1970 beside those since 1980"),)


def utc_of_zero(clock: str, epoch: str) -> float | None:
    """Return the Unix time, s, at which a clock shows zero; None where that is not known.

    Parameters
    ----------
    clock : str
        One of `CLOCKS`.
    epoch : str
        The week or the day that it counts from, as ``week 2390`` or ``2025-11-02``. GPS time is
        ahead of UTC by the leap seconds since 2017.

    Examples
    --------
    >>> utc_of_zero("gps-week", "GPS week 2390")
    1761436782.0
    >>> utc_of_zero("utc-day", "2025-10-26")
    1761436800.0
    """
    if clock == "utc":
        return 0.0
    week = re.search(r"week (\d+)$", epoch)
    day = re.search(r"(\d{4})-(\d\d)-(\d\d)$", epoch)
    leap = _LEAP if clock == "gps-week" else 0.0
    if clock in ("gps-week", "utc-week") and week is not None:
        return _GPS_START + _WEEK * int(week[1]) - leap
    if day is None or clock not in ("gps-week", "utc-week", "utc-day"):
        return None
    year, month, number = map(int, day.groups())
    since = calendar.timegm((year, month, number, 0, 0, 0))
    if clock != "utc-day":
        # A day of the week: GPS weeks begin on Sundays.
        since -= int((since - _GPS_START) % _WEEK)
    return float(since) - leap


def no_overlap(
    name: str, clock: str, span: tuple[float, float], record: tuple[float, float]
) -> InputError:
    """Return the error of an aid whose times are not those of a record.

    Parameters
    ----------
    name : str
        Of the aid.
    clock : str
        One of `CLOCKS`.
    span, record : (float, float)
        First and last time of the aid and of the record, s.

    Examples
    --------
    >>> print(no_overlap("gnss", "gps-week", (86500.0, 86600.0), (100.0, 1000.0)))
    ... # doctest: +ELLIPSIS
    gnss: its times, ... from t = 86500 to 86600 s, ... day boundary?; ...
    """
    off = span[0] - record[0]
    reach = 0.2 * (record[1] - record[0]) + 30.0
    likely = ""
    for seconds, what in (*_CAUSES, *_EPOCHS):
        turns = round(off / seconds)
        # A short unit fits any difference, so it may be counted a few times only.
        few = 1 if seconds == _LEAP else 14 if seconds < _DAY else 6 if seconds < _WEEK else 10**4
        reach_of = min(reach, 0.25 * seconds) if seconds > _LEAP else 2.0
        if turns and abs(turns) <= few and abs(off - turns * seconds) < reach_of:
            likely = f"; the difference is near {turns} x {seconds:g} s: {what}?"
            break
    if not likely and abs(off) >= _DAY:
        likely = "; are both clocks of the same kind (GPS week, day, UTC, the logger's own)?"
    return InputError(
        f"{name}: its times, {CLOCKS[clock]}, are from t = {time_text(span[0])} to "
        f"{time_text(span[1])} s, and "
        f"those of the record from {time_text(record[0])} to {time_text(record[1])} s: they "
        "share too "
        f"little{likely}; an offset of the aid's times brings them together"
    )
