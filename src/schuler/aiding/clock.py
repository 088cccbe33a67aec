"""The clocks of aids: what their times count, and why two spans of time do not overlap."""

from __future__ import annotations

from schuler.errors import InputError

__all__ = ["CLOCKS", "no_overlap"]

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
#: differences of two clocks, the least first, s
_CAUSES = (
    (_LEAP, "the leap seconds between UTC and GPS time"),
    (3600.0, "a time zone"),
    (_DAY, "seconds of the day beside those of the week, or a day boundary"),
    (_WEEK, "weeks of GPS time"),
)
_EPOCHS = ((315964800.0, "seconds since 1970 beside those since 1980"),)


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
        f"{name}: its times, {CLOCKS[clock]}, are from t = {span[0]:.9g} to {span[1]:.9g} s, and "
        f"those of the record from {record[0]:.9g} to {record[1]:.9g} s: they share too "
        f"little{likely}; an offset of the aid's times brings them together"
    )
