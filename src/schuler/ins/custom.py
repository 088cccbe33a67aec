"""A measurement that schuler does not know: a class with `time`, `name`, `handling` and `rows`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.ins.layout import Layout
from schuler.ins.measurement import Handling

__all__ = ["CustomMeasurement", "State"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """What a measurement may ask of a filter at its instant.

    Parameters
    ----------
    time : float
    quat_nb : (4,) float64
        From the body to n, East-North-Up, or the wander frame once the vehicle has moved.
    v_n : (3,) float64
    rate_b : (3,) float64
        Angular rate of the body, without the estimated bias, rad/s.
    lat, lon, height : float
        rad and m.
    east : float
        Angle from the x axis of n to east, counter-clockwise, rad: zero at the start.
    parameters : dict of str to array
        Estimates of all other groups.
    layout : Layout
        Where the columns of H are.
    index : int
        Which measurement of the aid is asked for.
    """

    time: float
    quat_nb: Array
    v_n: Array
    rate_b: Array
    lat: float
    lon: float
    height: float
    east: float
    parameters: Mapping[str, Array]
    layout: Layout
    index: int

    def row(self, columns: Mapping[str, ArrayLike]) -> Array:
        """Return a row of H from its parts by group; other columns are zero."""
        out = np.zeros(self.layout.size)
        for group, part in columns.items():
            out[self.layout[group]] = part
        return out


@runtime_checkable
class CustomMeasurement(Protocol):
    """What a user's own measurement must have.

    `rows` returns predicted minus measured (k,), the rows of H (k, n) and the variances (k,), for
    up to six numbers; errors are those that `schuler.ins` says, estimate minus truth but for the
    sensors' errors, which are truth minus estimate. Where it has an attribute `states`, a sequence
    of `StateGroup`, `schuler.navigation.navigate_aided` adds them to its filter.
    """

    @property
    def time(self) -> ArrayLike:
        """Instants, s, increasing."""

    @property
    def name(self) -> str:
        """Of the aid."""

    @property
    def handling(self) -> Handling:
        """How it is judged."""

    def rows(self, state: State) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
        """Return predicted minus measured, rows of H, variances."""
