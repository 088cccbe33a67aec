"""What a reader of GNSS files returns: columns in SI, their clock, and what heights are above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "DAY", "WEEK", "FixTable", "GnssOptions", "GnssReader", "drop_rows", "matched",
    "unwrapped",
]  # fmt: skip

Array = NDArray[np.float64]

DAY, WEEK = 86400.0, 604800.0


@dataclass(frozen=True)
class GnssOptions:
    """What a user may say of a file.

    Parameters
    ----------
    topic, velocity_topic : str, optional
        Topics of a ROS bag, or a message of a log, that hold positions and velocities.
    variable : str, optional
        Name of an array of a .mat file.
    """

    topic: str | None = None
    velocity_topic: str | None = None
    variable: str | None = None


@dataclass
class FixTable:
    """Columns of fixes in SI units.

    Parameters
    ----------
    columns : dict of str to (n,) float64
        t (s), lat, lon (rad), height (m); where there are: separation (geoid above the ellipsoid,
        m), ve, vn, vu, speed (m/s), course, heading (rad), quality (as RTKLIB), sde, sdn, sdu (m),
        sdve, sdvn, sdvu (m/s).
    clock : str
        One of `schuler.aiding.clock.CLOCKS`.
    epoch : str
        The week or the day that the times count from, in words; empty where it is not known.
    above : {"ellipsoid", "geoid", "unstated"}
        What the heights are above.
    dropped : dict of str to int
        Rows that were left out, by reason.
    notes : list of str
    """

    columns: dict[str, Array]
    clock: str = "unstated"
    epoch: str = ""
    above: str = "unstated"
    dropped: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@runtime_checkable
class GnssReader(Protocol):
    """A format of GNSS fixes."""

    @property
    def name(self) -> str:
        """How it is called."""

    def sniff(self, head: bytes) -> bool:
        """Say whether a file that begins so is of this format."""

    def alone(self, path: Path) -> bool:
        """Say whether such a file has fixes, and no record of an IMU as well."""

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the file."""


def unwrapped(time: Array, period: float) -> Array:
    """Return times that begin anew each day or week as times that increase."""
    turns = np.cumsum(np.round(np.diff(time, prepend=time[:1]) / period))
    return np.asarray(time - period * turns)


def drop_rows(
    columns: dict[str, Array], keep: NDArray[np.bool_], reason: str, dropped: dict[str, int]
) -> dict[str, Array]:
    """Return the rows to be kept; count the others."""
    count = int(np.sum(~keep))
    if not count:
        return columns
    dropped[reason] = dropped.get(reason, 0) + count
    return {name: column[keep] for name, column in columns.items()}


def matched(
    columns: dict[str, Array], time: Array, more: dict[str, Array], names: Sequence[str],
    dropped: dict[str, int], tolerance: float = 1e-3,
) -> dict[str, Array]:  # fmt: skip
    """Join velocities to the positions of the same instant; drop positions without one.

    Parameters
    ----------
    columns : dict of str to (n,) float64
        With "t".
    time : (m,) float64
        Of the velocities, s.
    more : dict of str to (m,) float64
        The velocities.
    names : sequence of str
        Which of `more` are joined.
    dropped : dict of str to int
    tolerance : float
        Within which two times are the same, s.
    """
    if not len(time) or not len(columns["t"]):
        return columns
    order = np.argsort(time, kind="stable")
    stamps = time[order]
    at = np.clip(np.searchsorted(stamps, columns["t"] - tolerance), 0, len(stamps) - 1)
    found = np.abs(stamps[at] - columns["t"]) <= tolerance
    joined = {**columns, **{name: more[name][order][at] for name in names}}
    # Where few have one, the file has none worth the name: the positions count more.
    if 2 * np.sum(found) < len(found):
        return columns
    return drop_rows(joined, found, "a position without the velocity of its time", dropped)


def as_columns(rows: Sequence[Sequence[Any]], names: Sequence[str]) -> dict[str, Array]:
    """Return rows of numbers as columns; "" and None are no numbers."""
    table = np.array(
        [[np.nan if x in ("", None) else float(x) for x in row] for row in rows], np.float64
    ).reshape(-1, len(names))
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
