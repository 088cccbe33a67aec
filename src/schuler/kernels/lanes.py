"""Four numbers at a time: rows of matrices in the vector registers of the processor.

LLVM finds by itself which loops may run several numbers at a time, but not those over the short
rows of a filter's matrices: what it has to check first (whether arrays overlap, how long the rows
are) takes longer than the rows. So the kernels say it. A value of four numbers is added,
subtracted, multiplied and divided with another or with a single number, lane by lane; uncompiled it
is an array of NumPy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from schuler.kernels._jit import _UNCOMPILED, _Compiled

__all__ = [
    "LANES", "abs4", "any_at_least4", "any_greater4", "first_lanes", "larger4", "load4",
    "load_row4", "smaller4", "splat4", "store4", "store_row4", "where_equal4", "where_greater4",
]  # fmt: skip

F = TypeVar("F", bound=Callable[..., Any])

LANES = 4
"""Numbers in a value."""

_NOTHING = np.zeros(LANES)
_NUMBERS = np.arange(LANES)


class _Instruction(_Compiled):
    """A function that is an instruction of the processor where it is compiled."""

    @property
    def dispatcher(self) -> Any:
        """What Numba compiles a call into."""
        from schuler.kernels import _lanes_numba

        return getattr(_lanes_numba, self.__name__)

    def __call__(self, *args: Any, **named: Any) -> Any:
        return self.py_func(*args, **named)


def _instruction(function: F) -> F:
    if _UNCOMPILED:
        return function
    return cast(F, _Instruction(function, {}))


@_instruction
def load4(a: Any, i: int) -> Any:
    """Return four numbers of an array from i on."""
    return a[i : i + LANES] + 0.0


@_instruction
def load_row4(a: Any, i: int, j: int) -> Any:
    """Return four numbers of row i of a matrix from column j on."""
    return a[i, j : j + LANES] + 0.0


@_instruction
def store4(a: Any, i: int, value: Any) -> None:
    """Write four numbers into an array from i on."""
    a[i : i + LANES] = value


@_instruction
def store_row4(a: Any, i: int, j: int, value: Any) -> None:
    """Write four numbers into row i of a matrix from column j on."""
    a[i, j : j + LANES] = value


@_instruction
def splat4(x: float) -> Any:
    """Return a number four times."""
    return _NOTHING + x


@_instruction
def first_lanes(count: int, a: Any, b: Any) -> Any:
    """Return the first `count` of the numbers of a, and the others of b."""
    return np.where(count > _NUMBERS, a, b)


@_instruction
def abs4(a: Any) -> Any:
    """Return the numbers without their signs."""
    return np.abs(a)


@_instruction
def larger4(a: Any, b: Any) -> Any:
    """Return the larger number of each lane."""
    return np.where(a > b, a, b)


@_instruction
def smaller4(a: Any, b: Any) -> Any:
    """Return the smaller number of each lane."""
    return np.where(a < b, a, b)


@_instruction
def where_greater4(a: Any, b: Any, x: Any, y: Any) -> Any:
    """Return the numbers of x where those of a are greater than those of b, else those of y."""
    return np.where(a > b, x, y)


@_instruction
def any_greater4(a: Any, b: Any) -> bool:
    """Say whether a number of a is greater than that of b in its lane."""
    return bool(np.any(a > b))


@_instruction
def where_equal4(a: Any, b: Any, x: Any, y: Any) -> Any:
    """Return the numbers of x where those of a and b are equal, else those of y."""
    return np.where(a == b, x, y)


@_instruction
def any_at_least4(a: Any, b: Any) -> bool:
    """Say whether a number of a is at least that of b in its lane."""
    return bool(np.any(a >= b))
