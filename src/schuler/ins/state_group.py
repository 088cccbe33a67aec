"""`StateGroup`: error states of a user's own, with their prior and noise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.ins.dynamics import GroupNoise
from schuler.ins.layout import KERNEL_GROUPS

__all__ = ["StateGroup", "groups_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StateGroup:
    """A group of states that a measurement of a user's own adds to a filter.

    A state is the error of a parameter, estimate minus truth: the column of H is what the predicted
    measurement grows by when the parameter does. The estimate is in `State.parameters`.

    Parameters
    ----------
    name : str
        ``aid.part``, as ``compass.deviation``.
    sigma : float or (k,) array_like
        1-sigma before anything is measured; its length is that of the group.
    start : float or (k,) array_like
        The parameter's value before.
    noise : GroupNoise
        How it changes by itself; constant by default.

    Raises
    ------
    InputError
        For a name without a point or sigma that is not positive.

    Examples
    --------
    >>> StateGroup("compass.deviation", sigma=0.05).size
    1
    """

    name: str
    sigma: ArrayLike
    start: ArrayLike = 0.0
    noise: GroupNoise = field(default_factory=GroupNoise)

    def __post_init__(self) -> None:
        aid, point, part = self.name.partition(".")
        if not (aid and point and part) or aid in KERNEL_GROUPS:
            raise InputError(
                f"states of one's own are named as aid.part, compass.deviation, got '{self.name}'"
            )
        sigma = np.atleast_1d(np.asarray(self.sigma, np.float64))
        start = np.asarray(self.start, np.float64)
        if sigma.ndim != 1 or not len(sigma) or not np.all(np.isfinite(sigma) & (sigma > 0.0)):
            raise InputError(f"{self.name}: sigma must be positive, got {self.sigma!r}")
        if start.shape not in ((), sigma.shape) or not np.all(np.isfinite(start)):
            raise InputError(f"{self.name}: start must have {len(sigma)} finite numbers")

    @property
    def size(self) -> int:
        """How many states it has."""
        return len(np.atleast_1d(np.asarray(self.sigma)))


def groups_of(aids: Iterable[Any]) -> dict[str, StateGroup]:
    """Return the groups that measurements add, which they have as `states`, by name.

    Raises
    ------
    InputError
        If two different groups have one name.

    Examples
    --------
    >>> from schuler.ins import Velocity
    >>> groups_of([Velocity([1.0], [0.0, 0.0, 0.0], 0.1)])
    {}
    """
    out: dict[str, StateGroup] = {}
    for aid in aids:
        for group in getattr(aid, "states", ()):
            if not isinstance(group, StateGroup):
                raise InputError(f"{aid.name}: states must be StateGroup, got {group!r}")
            if out.setdefault(group.name, group) is not group:
                raise InputError(f"two measurements add different states '{group.name}'")
    return out
