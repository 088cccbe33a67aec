"""Whether two clocks have a common span, and what it may be that sets them apart."""

from __future__ import annotations

__all__ = ["likely_offset"]

_KNOWN = (
    (86400.0, "seconds of the day beside those of the week"), (604800.0, "weeks of GPS time"),
    (3600.0, "a time zone"), (18.0, "leap seconds"),
)  # fmt: skip


def likely_offset(first: float, start: float, duration: float) -> str:
    """Return what the difference of two clocks is near to, for an error text, or nothing.

    Parameters
    ----------
    first : float
        First measurement, s.
    start, duration : float
        Of the record, s.
    """
    off = first - start
    for seconds, what in _KNOWN:
        turns = round(off / seconds)
        if turns and abs(off - turns * seconds) < 0.2 * duration + 30.0:
            return f"; the difference is near {turns} x {seconds:g} s: {what}?"
    return ""
