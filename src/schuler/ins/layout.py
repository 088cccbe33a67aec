"""`Layout`: the error states of a filter by name, in place of bare indices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.kernels import ins_layout

__all__ = ["KERNEL_GROUPS", "Layout"]

#: groups that the kernel knows, with their code and size; the first three lead, in this order
KERNEL_GROUPS: dict[str, tuple[int, int]] = {
    "phi": (ins_layout.PHI, 3),
    "velocity": (ins_layout.VELOCITY, 3),
    "position": (ins_layout.POSITION, 3),
    "gyro_bias": (ins_layout.GYRO_BIAS, 3),
    "accelerometer_bias": (ins_layout.ACCELEROMETER_BIAS, 3),
    "gyro_markov": (ins_layout.GYRO_MARKOV, 3),
    "accelerometer_markov": (ins_layout.ACCELEROMETER_MARKOV, 3),
    "gyro_scale": (ins_layout.GYRO_SCALE, 3),
    "accelerometer_scale": (ins_layout.ACCELEROMETER_SCALE, 3),
    "gyro_matrix": (ins_layout.GYRO_MATRIX, 9),
    "accelerometer_matrix": (ins_layout.ACCELEROMETER_MATRIX, 9),
    "frame_rate": (ins_layout.FRAME_RATE, 3),
    "base": (ins_layout.BASE, 3),
    "motion": (ins_layout.MOTION, 3),
    "flexure": (ins_layout.FLEXURE, 6),
}

_SENSORS = ("gyro_", "accelerometer_", "frame_rate")
_KEPT = ("base", "motion", "flexure")


class Layout:
    """Groups of error states, each with a name and a place.

    phi and velocity lead, then position where there is one. Groups of aids are named
    ``aid.part``: ``gnss.lever``, ``odometer.scale``.

    Parameters
    ----------
    groups : iterable of str or of (str, int)
        Names of `KERNEL_GROUPS`, or any other name with its size.

    Raises
    ------
    ValueError
        For a name twice, a size below 1, or leading groups out of order.

    Examples
    --------
    >>> layout = Layout(["phi", "velocity", "gyro_bias", ("gnss.lever", 3)])
    >>> layout["gnss.lever"]
    slice(9, 12, None)
    >>> layout.size
    12
    """

    def __init__(self, groups: Iterable[str | tuple[str, int]]) -> None:
        self._slices: dict[str, slice] = {}
        begin = 0
        for entry in groups:
            name, size = (entry, 0) if isinstance(entry, str) else entry
            if name in KERNEL_GROUPS:
                size = size or KERNEL_GROUPS[name][1]
                if size != KERNEL_GROUPS[name][1]:
                    raise ValueError(f"group '{name}' has {KERNEL_GROUPS[name][1]} states")
            if size < 1:
                raise ValueError(f"group '{name}' needs a size")
            if name in self._slices:
                raise ValueError(f"group '{name}' is there twice")
            self._slices[name] = slice(begin, begin + size)
            begin += size
        names = list(self._slices)
        if names[:2] != ["phi", "velocity"] or (
            "position" in names and names.index("position") != 2
        ):
            raise ValueError("phi and velocity lead, and position follows where there is one")
        self.size = begin

    def __getitem__(self, group: str) -> slice:
        """Return where a group is."""
        return self._slices[group]

    def __contains__(self, group: object) -> bool:
        """Whether there is such a group."""
        return group in self._slices

    def __iter__(self) -> Iterator[str]:
        """Yield the groups' names in order."""
        return iter(self._slices)

    def index(self, group: str) -> int:
        """Return the first state of a group, or -1 where it is absent."""
        place = self._slices.get(group)
        return -1 if place is None else int(place.start)

    @property
    def padded(self) -> int:
        """Length of a padded row, as the kernel needs it."""
        return ins_layout.padded(self.size)

    @cached_property
    def at(self) -> NDArray[np.int64]:
        """First state of each group that the kernel knows, -1 where absent."""
        at = np.full(ins_layout.GROUPS, -1, np.int64)
        for name, (code, _) in KERNEL_GROUPS.items():
            at[code] = self.index(name)
        return at

    @cached_property
    def sign(self) -> NDArray[np.float64]:
        """How a state is fed back: +1 truth minus estimate, -1 the contrary, 0 not at all."""
        sign = np.zeros(self.padded)
        for name, place in self._slices.items():
            if name.startswith(_SENSORS):
                sign[place] = 1.0
            elif name not in _KEPT:
                sign[place] = -1.0
        return sign

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for each state: ``phi[0]`` ..."""
        return tuple(
            f"{name}[{k}]"
            for name, place in self._slices.items()
            for k in range(place.stop - place.start)
        )
