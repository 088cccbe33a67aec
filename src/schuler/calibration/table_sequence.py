"""Sequences of a table: where it puts the instrument, how it turns it, and their TOML files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._files import check_keys, number, read_toml
from schuler.attitude import euler_to_quat, quat_to_matrix
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.units import parse

__all__ = ["Position", "RateTurn", "positions_from_toml", "turns_from_toml"]

Array = NDArray[np.float64]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Position:
    """Where the table puts the instrument.

    Parameters
    ----------
    attitude : (3,) tuple of float
        psi, theta, gamma, deg: its C_b^n.
    start, stop : float, optional
        The dwell in the record's time, s; found in order where left out.
    """

    attitude: tuple[float, float, float]
    start: float | None = None
    stop: float | None = None

    @property
    def mat_nb(self) -> Array:
        """C_b^n (3, 3)."""
        return np.asarray(quat_to_matrix(euler_to_quat(np.array(self.attitude) * DEG)))


@dataclass(frozen=True)
class RateTurn:
    """A turn of the table at a constant rate.

    Parameters
    ----------
    axis : (3,) tuple of float
        The table's axis in body axes.
    rate : float
        rad/s, counter-clockwise about the axis.
    direction : (3,) tuple of float
        Where the axis points: east, north, up. The Earth's rate along it is taken off.
    start, stop : float, optional
        In the record's time, s; found in order where left out.
    """

    axis: tuple[float, float, float]
    rate: float
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    start: float | None = None
    stop: float | None = None


def positions_from_toml(path: str | Path) -> list[Position]:
    r"""Read where the table was: tables ``[[position]]`` with attitude and, if wanted, times.

    Raises
    ------
    InputError
        If the file cannot be read or holds a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = "[[position]]\nattitude = [30, 0, 0]\n"
    >>> length = Path("table.toml").write_text(text)
    >>> positions_from_toml("table.toml")[0].attitude
    (30.0, 0.0, 0.0)
    """
    out = []
    for k, table in _tables(path, "position", ("attitude", "start", "stop")):
        what = f"{path}: position {k}"
        angles = table.get("attitude")
        if not isinstance(angles, list) or len(angles) != 3:
            raise InputError(f"{what}: attitude must be psi, theta, gamma in deg, got {angles!r}")
        psi, theta, gamma = (number(v, f"{what}: attitude") for v in angles)
        out.append(Position((psi, theta, gamma), *_times(table, what)))
    return out


def turns_from_toml(path: str | Path) -> list[RateTurn]:
    r"""Read a rate test: tables ``[[turn]]`` with axis, rate and, if wanted, direction and times.

    Raises
    ------
    InputError
        If the file cannot be read or holds a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("turns.toml").write_text('[[turn]]\naxis = "z"\nrate = "10 deg/s"\n')
    >>> turns_from_toml("turns.toml")[0].axis
    (0.0, 0.0, 1.0)
    """
    out = []
    for k, table in _tables(path, "turn", ("axis", "rate", "direction", "start", "stop")):
        what = f"{path}: turn {k}"
        axis = table.get("axis")
        vector = _AXES.get(axis) if isinstance(axis, str) else _vector(axis, f"{what}: axis")
        if vector is None:
            raise InputError(f"{what}: axis must be x, y, z or three numbers, got {axis!r}")
        rate = parse(table.get("rate", ""), "angular rate", f"{what}: rate")
        if rate == 0.0:
            raise InputError(f"{what}: a rate of zero shows no scale factor")
        direction = _vector(table.get("direction", [0.0, 0.0, 1.0]), f"{what}: direction")
        out.append(RateTurn(vector, rate, direction, *_times(table, what)))
    return out


def _tables(path: str | Path, name: str, keys: Sequence[str]) -> list[tuple[int, dict[str, Any]]]:
    data = read_toml(path)
    check_keys(data, (name,), str(path))
    rows = data.get(name)
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{path}: expected tables [[{name}]], one for each")
    for k, row in enumerate(rows, 1):
        check_keys(row, keys, f"{path}: {name} {k}")
    return list(enumerate(rows, 1))


def _times(table: dict[str, Any], what: str) -> tuple[float | None, float | None]:
    start, stop = (
        number(table[key], f"{what}: {key}", " of s") if key in table else None
        for key in ("start", "stop")
    )
    if (start is None) != (stop is None) or (start is not None and stop is not None and
                                             stop <= start):  # fmt: skip
        raise InputError(f"{what}: expected start and stop, the second later, or neither")
    return start, stop


def _vector(value: ArrayLike | None, what: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{what}: expected three numbers, got {value!r}")
    x, y, z = (number(v, what) for v in value)
    if x == y == z == 0.0:
        raise InputError(f"{what}: must not be zero")
    return x, y, z
