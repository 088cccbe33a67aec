"""Arrays by name: the geometries that the literature compares."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["ARRAYS", "load_array", "named_array"]

Array = NDArray[np.float64]


def _cone(n: int, half: float | None = None, first: float = 0.0) -> Array:
    """Return n axes on a cone about up; the half-angle atan(sqrt 2) makes it optimal."""
    a = np.arctan(np.sqrt(2.0)) if half is None else half
    az = first + 2.0 * np.pi * np.arange(n) / n
    return np.column_stack([np.sin(a) * np.cos(az), np.sin(a) * np.sin(az), np.full(n, np.cos(a))])


def _dodecahedron() -> Array:
    """Return the six face normals of a dodecahedron, one of each pair."""
    p = 0.5 * (1.0 + np.sqrt(5.0))
    rows = [(1, p, 0), (-1, p, 0), (0, 1, p), (0, -1, p), (p, 0, 1), (p, 0, -1)]
    return np.asarray(np.array(rows, np.float64) / np.hypot(1.0, p))


_THIRD = 1.0 / np.sqrt(3.0)
_FIXED: dict[str, Any] = {
    "triad": lambda: np.eye(3),
    "triad-plus-one": lambda: np.vstack([np.eye(3), [0.0, 0.0, 1.0]]),
    "symmetric4": lambda: _THIRD * np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]),
    "tetrahedron": lambda: _THIRD * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    "skewed4": lambda: np.vstack([np.eye(3), [_THIRD] * 3]),
    "dodecahedron": _dodecahedron,
}

#: name -> what it is
ARRAYS = {
    "triad": "three orthogonal axes",
    "triad-plus-one": "three orthogonal axes, z twice",
    "symmetric4": "four axes along the diagonals above the level plane",
    "cone4": "four axes on a cone of 54.74 deg, at 0, 90, 180, 270 deg; cone5, cone6 ... likewise",
    "tetrahedron": "four axes to the corners of a tetrahedron",
    "skewed4": "three orthogonal axes and one along their diagonal",
    "dodecahedron": "six axes through the faces of a dodecahedron",
}


def named_array(name: str) -> SensorArray:
    """Return an array by its name in `ARRAYS`, or ``coneN``.

    Raises
    ------
    InputError
        For another name.

    Examples
    --------
    >>> named_array("symmetric4").h.shape
    (4, 3)
    """
    if name in _FIXED:
        return SensorArray(_FIXED[name](), name)
    cone = re.fullmatch(r"cone(\d+)", name)
    if cone and 3 <= int(cone[1]) <= 64:
        return SensorArray(_cone(int(cone[1])), name)
    raise InputError(f"'{name}' is no array; there are {', '.join(ARRAYS)} and coneN")


def load_array(array: str | Path | SensorArray) -> SensorArray:
    """Return an array by name, from a TOML file, or pass one through.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> load_array("cone5").name
    'cone5'
    """
    if isinstance(array, SensorArray):
        return array
    text = str(array)
    return SensorArray.from_toml(text) if text.endswith(".toml") else named_array(text)
