"""`EpochHistory`: what a filter estimated after each epoch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.ins.frames import east_angle
from schuler.ins.layout import Layout
from schuler.kernels import ins_layout as kernel

__all__ = ["EpochHistory"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EpochHistory:
    """Rows of a filter's output, one for each epoch.

    Parameters
    ----------
    layout : Layout
    rows : (k, O_SIZE + 2 padded) float64
        As the kernel leaves them.
    """

    layout: Layout
    rows: Array

    def __len__(self) -> int:
        return len(self.rows)

    def _columns(self, first: int, count: int) -> Array:
        return self.rows[:, first : first + count]

    @property
    def time(self) -> Array:
        """Times of the epochs, s, (k,)."""
        return np.asarray(self.rows[:, kernel.O_TIME])

    @property
    def quat_nb(self) -> Array:
        """Attitude, (k, 4); n is East-North-Up at a fixed place and else the wander frame."""
        return self._columns(kernel.O_QUAT, 4)

    @property
    def v_n(self) -> Array:
        """Velocity, m/s, (k, 3)."""
        return self._columns(kernel.O_V, 3)

    @property
    def quat_ne(self) -> Array:
        """Position as the rotation from n to the Earth's axes, (k, 4)."""
        return self._columns(kernel.O_FRAME, 4)

    @property
    def place(self) -> tuple[Array, Array, Array]:
        """Latitude, longitude (rad) and height (m), (k,) each."""
        lat, lon, _ = east_angle(self.quat_ne)
        return lat, lon, self.height

    @property
    def height(self) -> Array:
        """Height, m, (k,)."""
        return np.asarray(self.rows[:, kernel.O_HEIGHT])

    @property
    def displacement(self) -> Array:
        """Displacement since the start, at a fixed place, m, (k, 3)."""
        return self._columns(kernel.O_DISPLACEMENT, 3)

    @property
    def mean_square(self) -> Array:
        """Mean squared normalised innovation, 1 for a filter that knows its noise, (k,)."""
        count = np.maximum(self.rows[:, kernel.O_COUNT], 1.0)
        return np.asarray(self.rows[:, kernel.O_SQUARES] / count)

    @property
    def scalars(self) -> Array:
        """Scalar measurements that were taken, (k,)."""
        return np.asarray(self.rows[:, kernel.O_COUNT])

    def __getitem__(self, group: str) -> Array:
        """Return the estimates of a group of parameters, (k, m)."""
        place = self.layout[group]
        return self._columns(kernel.O_SIZE + place.start, place.stop - place.start)

    def sigma(self, group: str) -> Array:
        """Return 1 sigma of a group, (k, m)."""
        place = self.layout[group]
        first = kernel.O_SIZE + self.layout.padded + place.start
        return np.asarray(np.sqrt(np.maximum(self._columns(first, place.stop - place.start), 0.0)))
