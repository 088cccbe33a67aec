"""A measurement that schuler does not know: a class with `time`, `name`, `handling` and `rows`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.ins.layout import Layout
from schuler.ins.measurement import Handling
from schuler.kernels import ins_layout as kernel

__all__ = ["CustomMeasurement", "State", "custom_rows", "custom_table"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """What a measurement may use of a filter at its instant.

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

    Examples
    --------
    >>> layout = Layout(["phi", "velocity", "position"])
    >>> level, zero = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    >>> now = State(0.0, level, zero, zero, 0.8, 0.2, 500.0, 0.0, {}, layout, 0)
    >>> now.row({"position": [0.0, 0.0, 1.0]}).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
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

    Examples
    --------
    >>> class Barometer:
    ...     name, handling, time = "barometer", Handling(), [1.0, 2.0]
    ...     def rows(self, state):
    ...         row = state.row({"position": [0.0, 0.0, 1.0]})
    ...         return [state.height - 500.0], [row], [1.0]
    >>> isinstance(Barometer(), CustomMeasurement)
    True
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


def custom_table(aid: CustomMeasurement, number: int) -> Array:
    """Return the rows of the kernel's queue for the measurements of an aid of a user's own."""
    time = np.asarray(aid.time, np.float64)
    out = np.zeros((len(time), kernel.M_SIZE))
    out[:, kernel.M_TIME], out[:, kernel.M_AID] = time, number
    out[:, kernel.M_KIND] = kernel.CUSTOM
    out[:, kernel.M_VALUE] = np.arange(len(time))
    return out


def custom_rows(aid: CustomMeasurement, state: State) -> tuple[Array, Array, Array]:
    """Return residuals (k,), rows of H (k, n) and variances (k,) of an aid, checked.

    Raises
    ------
    InputError
        For other shapes, or numbers that are not finite.
    """
    z, h, r = (np.atleast_1d(np.asarray(a, np.float64)) for a in aid.rows(state))
    h = np.atleast_2d(h)
    count, n = len(z), state.layout.size
    if h.shape != (count, n) or r.shape != (count,) or not 0 < count <= kernel.MOST_ROWS:
        raise InputError(
            f"{aid.name}: rows must give up to {kernel.MOST_ROWS} numbers, as many rows of "
            f"{n} columns and as many variances, got shapes {z.shape}, {h.shape} and {r.shape}"
        )
    if not (np.all(np.isfinite(z)) and np.all(np.isfinite(h)) and np.all(r > 0.0)):
        raise InputError(f"{aid.name}: rows must be finite, and variances positive")
    return z, h, r
