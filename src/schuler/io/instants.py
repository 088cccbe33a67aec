"""Dates and times of day in a table's cells, as seconds.

A date with a time is a Unix time (UTC); a time of day counts from midnight. ISO 8601 is read, with
a blank for its T, slashes for its hyphens, and a zone or none, which is UTC.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from schuler.io.content import Array

__all__ = ["InstantError", "has_zone", "is_instant", "seconds_of", "to_seconds"]

_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?"
_ZONE = r"(?:Z|z| ?UTC|[+-]\d{2}(?::?\d{2})?)"
_INSTANT = re.compile(
    rf"(?:(?P<date>\d{{4}}[-/]\d{{1,2}}[-/]\d{{1,2}})(?:[T ]+(?P<clock>{_CLOCK})|$)"
    rf"|(?P<day>{_CLOCK}))(?P<zone>{_ZONE})?"
)
_LONGEST = 64


class InstantError(ValueError):
    """Cell `i` (from 0) is no instant."""

    def __init__(self, i: int, cell: str) -> None:
        super().__init__(cell)
        self.i = i


def is_instant(cell: str) -> bool:
    """Say whether a cell holds a date, a date and time, or a time of day."""
    return len(cell) <= _LONGEST and _INSTANT.fullmatch(cell.strip()) is not None


def has_zone(cell: str) -> bool | None:
    """Say whether an instant names its zone; None for a time of day, which needs none."""
    match = _INSTANT.fullmatch(cell.strip())
    if match is None or match["date"] is None:
        return None
    return match["zone"] is not None


def to_seconds(cell: str) -> float:
    """Return one instant in seconds.

    Raises
    ------
    InstantError
        If it is none.
    """
    match = _INSTANT.fullmatch(cell.strip()) if len(cell) <= _LONGEST else None
    if match is None:
        raise InstantError(0, cell)
    clock = (match["clock"] or match["day"] or "0:0").replace(",", ".")
    hours, minutes, *seconds = clock.split(":")
    day = 3600 * int(hours) + 60 * int(minutes) + float(seconds[0] if seconds else 0)
    if int(hours) > 24 or int(minutes) > 59 or float(seconds[0] if seconds else 0) > 61:
        raise InstantError(0, cell)
    days = 0
    if match["date"] is not None:
        year, month, date = (int(v) for v in re.split("[-/]", match["date"]))
        try:
            days = (datetime(year, month, date) - datetime(1970, 1, 1)).days
        except ValueError:
            raise InstantError(0, cell) from None
    # Whole seconds first: they are exact, and the fraction keeps its digits.
    return float(86400 * days - _offset(match["zone"])) + day


def seconds_of(cells: Sequence[str | None]) -> Array:
    """Return a column of instants in seconds; NaN for an empty cell.

    Raises
    ------
    InstantError
        For the first cell that is none.
    """
    out = _alike(cells)
    if out is not None:
        return out
    out = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        if cell is None or not cell.strip():
            continue
        try:
            out[i] = to_seconds(cell)
        except InstantError:
            raise InstantError(i, cell) from None
    return out


def _alike(cells: Sequence[str | None]) -> Array | None:
    """Return the seconds of cells that are all written like the first, by NumPy; else None."""
    first = next((cell for cell in cells if cell), None)
    match = None if first is None or None in cells else _INSTANT.fullmatch(first.strip())
    if match is None:
        return None
    zone = match["zone"] or ""
    prefix = "1970-01-01T" if match["date"] is None else ""
    bodies = []
    for cell in cells:
        text = (cell or "").strip()
        if not text.endswith(zone):
            return None
        bodies.append(prefix + (text[: len(text) - len(zone)] if zone else text))
    if any(body[-1:] in "Zz" or "+" in body for body in bodies):
        return None
    try:
        nanoseconds = np.array(bodies, "datetime64[ns]").astype(np.int64)
    except ValueError:
        return None
    whole, part = np.divmod(nanoseconds, 1_000_000_000)
    return np.asarray(whole - _offset(zone) + 1e-9 * part, np.float64)


def _offset(zone: str | None) -> int:
    """Return how many seconds a zone is before UTC."""
    text = (zone or "").strip().upper()
    if text in ("", "Z", "UTC"):
        return 0
    digits = text[1:].replace(":", "")
    hours, minutes = int(digits[:2]), int(digits[2:] or 0)
    size = timedelta(hours=hours, minutes=minutes).total_seconds()
    return int(size if text[0] == "+" else -size)
