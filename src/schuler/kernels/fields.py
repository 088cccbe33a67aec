"""Names for the numbers of a kernel's arrays: `Field` and `View`.

A kernel keeps its state in a flat array. Beside each kernel a `View` says what stands where, with
the range that a saved state may have::

    class PlanarState(View):
        updates = Field(low=0.0, high=COUNT, whole=True)
        v_n = Field(3)

    state = PlanarState.zeros()
    state.v_n[:] = 1.0

Fields follow one another in the order of their definition, those of a base class first. A view
reads and writes the last axis of any array: of one state, or of a table with one row each.
"""

from __future__ import annotations

from typing import ClassVar, Self, overload

import numpy as np
from numpy.typing import NDArray

__all__ = ["COUNT", "SUM", "TIME", "Field", "View"]

Array = NDArray[np.float64]

COUNT = 2.0**53
"""Largest whole number that a float64 holds exactly."""

SUM = 1e40
"""No sum of a record, nor of its squares, comes near."""

TIME = 1e12
"""No time stamp (s) is farther from zero."""


class Field:
    """Consecutive numbers of the last axis, with one name and one range.

    Parameters
    ----------
    *shape : int
        None for a single number.
    low, high : float
        Range of a saved value, both ends included.
    whole : bool
        Whole numbers only.
    """

    def __init__(
        self, *shape: int, low: float = -SUM, high: float = SUM, whole: bool = False
    ) -> None:
        self.shape = shape
        self.size = int(np.prod(shape, dtype=np.int64))
        self.low, self.high, self.whole = low, high, whole
        self.name = ""
        self.start = 0

    def __set_name__(self, owner: type[View], name: str) -> None:
        self.name = name

    @property
    def slice(self) -> slice:
        """Where the field stands."""
        return slice(self.start, self.start + self.size)

    @overload
    def __get__(self, view: None, owner: type[View]) -> Self: ...
    @overload
    def __get__(self, view: View, owner: type[View]) -> Array: ...
    def __get__(self, view: View | None, owner: type[View]) -> Self | Array:
        if view is None:
            return self
        data = view.data
        if not self.shape:
            return np.asarray(data[..., self.start])
        part = data[..., self.slice]
        return part if len(self.shape) == 1 else part.reshape(data.shape[:-1] + self.shape)

    def __set__(self, view: View, value: Array | float) -> None:
        if not self.shape:
            view.data[..., self.start] = value
            return
        shape = view.data.shape[:-1]
        part = np.broadcast_to(np.asarray(value, np.float64), shape + self.shape)
        view.data[..., self.slice] = part.reshape((*shape, self.size))


class View:
    """A flat array by the names of its numbers.

    Parameters
    ----------
    data : (..., size) float64
        Shared, not copied.
    """

    fields: ClassVar[tuple[Field, ...]] = ()
    size: ClassVar[int] = 0

    def __init_subclass__(cls) -> None:
        at = cls.size
        added = [each for each in vars(cls).values() if isinstance(each, Field)]
        for each in added:
            each.start = at
            at += each.size
        cls.fields = (*cls.fields, *added)
        cls.size = at

    def __init__(self, data: Array) -> None:
        if data.ndim < 1 or data.shape[-1] != self.size:
            raise ValueError(f"{type(self).__name__} has {self.size} numbers, got {data.shape}")
        self.data = data

    @classmethod
    def zeros(cls, *shape: int) -> Self:
        """Return a view of a new array (..., size) of zeros."""
        return cls(np.zeros((*shape, cls.size)))
