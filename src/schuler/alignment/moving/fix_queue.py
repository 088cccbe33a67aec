"""`FixQueue`: the fixes of a stream in the order of their times, taken and to come."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.fix_rows import COLUMNS, TIME, is_possible
from schuler.constants import STAMP_ROUNDING
from schuler.errors import InputError

__all__ = ["COUNTS", "FixQueue"]

Array = NDArray[np.float64]

COUNTS = ("fixes", "late_fixes", "repeated_fixes", "surplus_fixes")
"""What became of fixes."""

_MOST_FIXES = 20_000
"""That are held, taken and to come: more are no receiver's."""

_BEFORE = 4
"""Fixes before those of a stretch that go with them: a stale position shows beside others."""


class FixQueue:
    """Fixes by their stamps, with what became of those that came.

    Examples
    --------
    >>> from schuler.aiding import rows_of
    >>> queue = FixQueue()
    >>> queue.add(rows_of(gnss), after=-np.inf)
    0
    >>> queue.due(10.0)
    10
    """

    def __init__(self) -> None:
        self.rows = np.zeros((0, COLUMNS))
        self.counts: Counter[str] = Counter()

    def add(self, rows: Array, after: float) -> int:
        """Take fixes in any order; return how many came too late.

        Parameters
        ----------
        rows : (n, `COLUMNS`) float64
        after : float
            Stamps up to this one are late, s.

        Raises
        ------
        InputError
            For an array of another shape, or rows that no vehicle can have.
        """
        rows = np.asarray(rows, np.float64)
        if rows.ndim != 2 or rows.shape[1] != COLUMNS:
            raise InputError(f"fixes come as rows of {COLUMNS} numbers, got {rows.shape}")
        if not all(is_possible(row) for row in rows):
            raise InputError("a fix is no place on Earth, or faster than a vehicle")
        came: Counter[str] = Counter()
        for row in rows:
            came[self._taken(row, after)] += 1
        self.counts += came
        return came["late_fixes"]

    def _taken(self, row: Array, after: float) -> str:
        """Take a fix; return what became of it."""
        if row[TIME] <= after + STAMP_ROUNDING:
            return "late_fixes"
        k = int(np.searchsorted(self.rows[:, TIME], row[TIME]))
        near = self.rows[max(k - 1, 0) : k + 1, TIME]
        if np.any(np.abs(near - row[TIME]) < STAMP_ROUNDING):
            return "repeated_fixes"
        if len(self.rows) >= _MOST_FIXES:
            return "surplus_fixes"
        self.rows = np.insert(self.rows, k, row, axis=0)
        return "fixes"

    def due(self, stamp: float) -> int:
        """Return how many have stamps up to one."""
        return int(np.searchsorted(self.rows[:, TIME], stamp + STAMP_ROUNDING, side="right"))

    def around(self, begin: float, end: float) -> Array:
        """Return those with stamps after one and up to another, and some before them; or none."""
        first, last = self.due(begin), self.due(end)
        if first == last:
            return self.rows[:0]
        return self.rows[max(first - _BEFORE, 0) : last]

    def forget(self, stamp: float) -> None:
        """Forget those with stamps before one, but the last of them."""
        self.rows = self.rows[max(self.due(stamp) - _BEFORE, 0) :]
