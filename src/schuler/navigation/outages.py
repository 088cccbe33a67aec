"""`Outages`: spans whose fixes are withheld, the field's usual test of a navigation."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.errors import InputError

__all__ = ["OutageScore", "Outages"]

Array = NDArray[np.float64]

_TEXT = re.compile(r"([\d.]+)\s*s?/([\d.]+)\s*s?(?:\+([\d.]+)\s*s?)?")


@dataclass(frozen=True)
class Outages:
    """Spans of one length at regular intervals.

    Parameters
    ----------
    length, period : float
        s.
    shift : float
        The first one begins so long after `settle`, s.
    settle : float
        Time from the record's start that a filter needs to settle, s.

    Raises
    ------
    InputError
        If an outage is not shorter than the period.

    Examples
    --------
    >>> Outages.parse("15s/45s+30s")
    Outages(length=15.0, period=45.0, shift=30.0, settle=100.0)
    """

    length: float
    period: float
    shift: float = 0.0
    settle: float = 100.0

    def __post_init__(self) -> None:
        if not (0.0 < self.length < self.period and self.shift >= 0.0 and self.settle >= 0.0):
            raise InputError(
                f"an outage must be shorter than its period, got {self.length:g} s of "
                f"{self.period:g} s"
            )

    @classmethod
    def parse(cls, text: str) -> Outages:
        """Make it of ``"15s/45s"`` or ``"15s/45s+30s"``.

        Raises
        ------
        InputError
            For another text.
        """
        match = _TEXT.fullmatch(text.strip())
        if match is None:
            raise InputError(f"outages are LENGTH/PERIOD[+SHIFT], as 15s/45s+30s, got '{text}'")
        length, period, shift = (float(part) if part else 0.0 for part in match.groups())
        return cls(length, period, shift)

    def spans(self, begin: float, end: float) -> Array:
        """Return begin and end of each outage that lies within a record, (k, 2)."""
        first = begin + self.settle + self.shift
        starts = np.arange(first, end - self.length, self.period)
        return np.column_stack([starts, starts + self.length])

    def divide(self, gnss: GnssFixes, begin: float) -> tuple[GnssFixes, GnssFixes]:
        """Return the fixes that are used and those that are withheld.

        Raises
        ------
        InputError
            If the record is too short for one outage.
        """
        time = np.asarray(gnss.time)
        out = np.zeros(len(time), bool)
        for first, last in self.spans(begin, float(time[-1])):
            out |= (time > first) & (time <= last)
        if out.sum() < 2:
            raise InputError(
                f"no outage of {self.length:g} s lies within the fixes, which end at t = "
                f"{time[-1]:.9g} s; the first would begin at t = "
                f"{begin + self.settle + self.shift:.9g} s"
            )
        return gnss.rows(~out), gnss.rows(out)


@dataclass(frozen=True, eq=False)
class OutageScore:
    """Worst errors of outages, m.

    Parameters
    ----------
    horizontal, height : (k,) float64
        The largest in each.
    normalised_rms : float
        Of all errors over their sigma, that of the fix with it: 1 where sigma is right.

    Examples
    --------
    >>> score = OutageScore(np.array([3.0, 4.0]), np.array([0.3, 0.2]), 1.0)
    >>> score.to_dict()["median_horizontal_m"]
    3.5
    """

    horizontal: Array
    height: Array
    normalised_rms: float

    @classmethod
    def of(cls, time: Array, error: Array, variance: Array, spans: Array) -> OutageScore:
        """Make it of errors (n, 3) and their variances at times."""
        level, up = [], []
        for first, last in spans:
            inside = (time > first) & (time <= last)
            if np.any(inside):
                level.append(float(np.linalg.norm(error[inside, :2], axis=1).max()))
                up.append(float(np.abs(error[inside, 2]).max()))
        ratio = float(np.sqrt(np.mean(error**2 / variance)))
        return cls(np.array(level), np.array(up), ratio)

    def to_dict(self) -> dict[str, float]:
        """Return root mean squares and the median."""
        return {
            "rms_horizontal_m": float(np.sqrt(np.mean(self.horizontal**2))),
            "median_horizontal_m": float(np.median(self.horizontal)),
            "rms_height_m": float(np.sqrt(np.mean(self.height**2))),
            "normalised_rms": self.normalised_rms,
        }
