"""What a pass over a record leaves behind: cumulative sums at up to 4097 instants.

Every estimator, its uncertainty, its convergence and the report are computed from this table, so
that a record of any length needs constant memory and is read once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_RATE

__all__ = ["History", "Rows", "gravity_direction", "inertial_to_local"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def inertial_to_local(t: Array | float, lat: float) -> Array:
    """Return C_i0^n (..., 3, 3) at times t (s since the start) for a latitude (rad)."""
    a = EARTH_RATE * np.asarray(t, np.float64)
    s, c, zero = np.sin(a), np.cos(a), np.zeros_like(a)
    sl, cl = np.sin(lat), np.cos(lat)
    rows = [[-s, c, zero], [-sl * c, -sl * s, zero + cl], [cl * c, cl * s, zero + sl]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def gravity_direction(lat: float) -> Array:
    """Return D = diag(cosL, cosL, sinL): the force that holds the body is g D db/dt in i0."""
    return np.array([np.cos(lat), np.cos(lat), np.sin(lat)])


@dataclass(frozen=True, eq=False)
class History:
    """Cumulative rows at instants, the first at the start (all zero), the last at the end.

    Parameters
    ----------
    rows : (k, 44) float64
        In the layout of `schuler.kernels.tracking`.
    start : float
        Time of the start, s.
    samples : int
        Samples in all.
    """

    rows: Array
    start: float
    samples: int

    @classmethod
    def from_state(cls, state: Array, nodes: Array) -> History:
        """Copy the nodes of a tracking kernel and add the last instant when it is not one."""
        from schuler.kernels.tracking import PLAIN

        rows = nodes[: int(state[73])]
        if state[1] > rows[-1, 1]:
            rows = np.vstack([rows, np.concatenate([state[:PLAIN], state[76:80]])])
        return cls(rows.copy(), float(state[40]), int(state[41]))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def t(self) -> Array:
        """Instants, s since the start, (k,)."""
        return self.rows[:, 0]

    @property
    def updates(self) -> Array:
        """Updates so far at each instant, (k,)."""
        return self.rows[:, 1]

    @property
    def duration(self) -> float:
        """Length, s."""
        return float(self.rows[-1, 0])

    @property
    def quat(self) -> Array:
        """q_b^ib0 at each instant, (k, 4)."""
        return self.rows[:, 2:6]

    @property
    def velocity(self) -> Array:
        """Integral of the force in ib0 at each instant, m/s, (k, 3)."""
        return self.rows[:, 6:9]

    def theory(self, gravity: float, lat: float) -> Array:
        """Return G, the theoretical integral in i0 at each instant, m/s, (k, 3)."""
        a = EARTH_RATE * self.t
        b = np.column_stack([np.sin(a), 2.0 * np.sin(0.5 * a) ** 2, a]) / EARTH_RATE
        return gravity * gravity_direction(lat) * b

    def sums(self) -> tuple[float, Array, Array, Array]:
        """Return updates, sum of v (3,), sum of b (3,) and sum of b v^T (3, 3) at the end."""
        r = self.rows[-1]
        return float(r[1]), r[9:12], r[12:15], r[15:24].reshape(3, 3)

    def second_moments(self, centred: bool) -> Array:
        """Return the sum of b b^T (3, 3) at the end, about the mean of b or about zero."""
        r = self.rows[-1]
        xx, xy, xz, yy, yz, zz = r[24:30]
        out = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return out - np.outer(r[12:15], r[12:15]) / r[1] if centred else out

    def increments(self) -> tuple[Array, Array]:
        """Return the sums of angle (3,) and velocity increments (3,) in body axes at the end."""
        return self.rows[-1, 30:33], self.rows[-1, 33:36]

    def block_means(self, columns: slice) -> Array:
        """Return the means over updates of a cumulative quantity between instants, (k-1, m)."""
        n = np.diff(self.updates)
        return np.asarray(np.diff(self.rows[:, columns], axis=0) / n[:, None])

    def thin(self, blocks: int, keep: Iterable[int] = ()) -> tuple[History, Rows]:
        """Return at most `blocks` stretches between instants, as even as can be.

        Parameters
        ----------
        blocks : int
            Stretches wanted.
        keep : iterable of int
            Instants that must stay (they come on top).

        Returns
        -------
        History, (j,) int64
            The thinned history, and where each kept instant is in it.
        """
        last = len(self) - 1
        kept = np.array(list(keep), np.int64)
        rows = np.round(np.linspace(0, last, min(blocks, last) + 1)).astype(np.int64)
        rows = np.unique(np.concatenate([rows, kept]))
        return replace(self, rows=self.rows[rows]), np.searchsorted(rows, kept).astype(np.int64)

    def until(self, row: int) -> History:
        """Return the history up to and with an instant, as if the record had ended there."""
        return replace(
            self,
            rows=self.rows[: row + 1],
            samples=round(self.samples * self.rows[row, 1] / self.rows[-1, 1]),
        )
