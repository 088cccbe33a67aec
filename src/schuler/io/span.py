"""The stretch of a record that is read: from a start to a stop, by the file's time or the record's.

A number is a time of the file, s. A text that begins with a plus counts from the first row. A date
and time is a Unix time, a time of day counts from midnight, as in files that have such stamps.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from schuler.errors import InputError
from schuler.io.content import Array
from schuler.io.instants import is_instant, to_seconds
from schuler.units import parse, time_text

__all__ = ["RecordTime", "Span", "parse_record_time"]

#: a start or a stop
RecordTime: TypeAlias = float | str | None


def parse_record_time(value: float | str, label: str) -> tuple[float, bool]:
    """Return a start or stop in seconds, and whether it counts from the record's first row.

    Raises
    ------
    InputError
        If it is no time.
    """
    if isinstance(value, str):
        text = value.strip()
        relative = text.startswith("+")
        plain = text[1:].strip() if relative else text
        try:
            number = float(plain)
        except ValueError:
            if not relative and is_instant(plain):
                return to_seconds(plain), False
            number = parse(plain, "time", label)
    else:
        number, relative = float(value), False
    if not math.isfinite(number):
        raise InputError(f"{label}: '{value}' is not a finite time")
    return number, relative


class Span:
    """A start and a stop, which are known once the first row's time is.

    Attributes
    ----------
    said : pair of (float, bool) or None
        Start and stop as given: s, and whether they count from the first row.
    start, stop : float or None
        s, in the file's time; None where not said, or before the first row is seen.
    """

    def __init__(self, start: tuple[float, bool] | None, stop: tuple[float, bool] | None) -> None:
        self.said = (start, stop)
        self.begins = start is not None
        self.limited = start is not None or stop is not None
        self.start = start[0] if start is not None and not start[1] else None
        self.stop = stop[0] if stop is not None and not stop[1] else None
        self._seen: list[float] = []
        if start is not None and stop is not None and start[1] == stop[1]:
            self._order(start[0], stop[0])

    @classmethod
    def of(cls, start: RecordTime, stop: RecordTime) -> Span:
        """Make a span of what is given.

        Raises
        ------
        InputError
            If one is no time, or the start is not before the stop.
        """
        given = [
            None if value is None else parse_record_time(value, label)
            for value, label in ((start, "start"), (stop, "stop"))
        ]
        return cls(given[0], given[1])

    def see(self, time: Array) -> None:
        """Take the times of the next rows, s; the first fixes what counts from it."""
        finite = time[np.isfinite(time)] if not self._seen else time[-1:]
        if not len(finite):
            return
        if not self._seen:
            first = float(finite[0])
            start, stop = (
                None if said is None else said[0] + (first if said[1] else 0.0)
                for said in self.said
            )
            if start is not None and stop is not None:
                self._order(start, stop)
            self.start, self.stop = start, stop
            self._seen = [first, first]
        self._seen[1] = float(finite[-1])

    @property
    def first(self) -> float:
        """The start, s; minus infinity where none is said."""
        return -math.inf if self.start is None else self.start

    def nothing(self) -> str:
        """Return the sentence for a span without samples."""
        begin, end = (
            name if value is None else f"{time_text(value)}"
            for name, value in (("its start", self.start), ("its end", self.stop))
        )
        text = f"there are no samples between {begin} and {end} s"
        relative = all(said is None or said[1] for said in self.said)
        if not self._seen or relative:
            return text
        return (
            f"{text}: its first row is at {time_text(self._seen[0])} s; with a plus, as "
            "--start +60s, times count from there"
        )

    @staticmethod
    def _order(start: float, stop: float) -> None:
        if not start < stop:
            raise InputError(
                f"start ({time_text(start)} s) must be before stop ({time_text(stop)} s)"
            )
