"""What the inertial sensors say of the motion, at the instants of other measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import quat_to_matrix
from schuler.constants import STAMP_ROUNDING
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.units import time_text

__all__ = ["BodyPass", "BodyRows", "body_rows"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyRows:
    """Rows of a pass: attitude and integrals of the force in ib0, body axes at the start.

    Parameters
    ----------
    start : float
        When the pass started, s.
    time : (n,) float64
        s.
    mat_ib0_b : (n, 3, 3) float64
    velocity, way : (n, 3) float64
        Single and double integral of the force, m/s and m.
    turn : (n, 3, 3) float64
        Integral of mat_ib0_b, s.
    rate : (n, 3) float64
        Angular rate, body axes, rad/s.
    """

    start: float
    time: Array
    mat_ib0_b: Array
    velocity: Array
    way: Array
    turn: Array
    rate: Array

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of(cls, start: float, table: Array) -> BodyRows:
        """Name the columns of a kernel's rows."""
        from schuler.kernels import moving as k

        return cls(
            start, table[:, k.R_TIME], quat_to_matrix(table[:, k.R_QUAT : k.R_QUAT + 4]),
            table[:, k.R_VELOCITY : k.R_VELOCITY + 3], table[:, k.R_WAY : k.R_WAY + 3],
            table[:, k.R_TURN : k.R_TURN + 9].reshape(-1, 3, 3),
            table[:, k.R_RATE : k.R_RATE + 3],
        )  # fmt: skip

    def pick(self, which: slice | NDArray[Any]) -> BodyRows:
        """Return some of the rows; sums go on from the same start."""
        return BodyRows(
            self.start, self.time[which], self.mat_ib0_b[which], self.velocity[which],
            self.way[which], self.turn[which], self.rate[which],
        )  # fmt: skip

    def turned(self, vectors: ArrayLike) -> Array:
        """Return vectors (n, 3) of the body in ib0."""
        rows = np.broadcast_to(np.asarray(vectors, np.float64), (len(self), 3))
        return np.asarray(np.einsum("iab,ib->ia", self.mat_ib0_b, rows))


class BodyPass:
    """Feed chunks of samples, take rows; any chunking gives the same bits.

    The last sample waits until the next chunk comes, or the rows are asked for.

    Parameters
    ----------
    due : (n,) array_like
        Instants, s; those outside the samples get no row.
    """

    def __init__(self, due: ArrayLike = ()) -> None:
        from schuler.kernels import moving

        self._follow: Callable[..., int] = moving.follow
        self._size = moving.R_SIZE
        self._due = np.sort(np.asarray(due, np.float64))
        self._state = np.zeros(moving.STATE_SIZE)
        self._state[moving.QUAT] = 1.0
        self._rows: list[Array] = []
        self._waiting: ImuRecord | None = None
        self._start: float | None = None

    def add_due(self, due: ArrayLike) -> None:
        """Add instants, s, none before the end of the last chunk."""
        self._due = np.sort(np.concatenate([self._due, np.asarray(due, np.float64)]))

    def update(self, chunk: ImuRecord) -> BodyPass:
        """Take a chunk that follows the last one; return self.

        Raises
        ------
        InputError
            If it does not follow, or has not three gyros and three accelerometers.
        """
        if not len(chunk):
            return self
        if chunk.dtheta.shape[1:] != (3,) or chunk.dvel.shape[1:] != (3,):
            raise InputError("an alignment needs three gyros and three accelerometers")
        if self._start is None:
            self._start = chunk.start
            self._due = self._due[self._due >= self._start - STAMP_ROUNDING]
        if self._waiting is not None:
            if chunk.time[0] <= self._waiting.end:
                raise InputError(
                    f"a chunk starts at t = {time_text(chunk.time[0])} s, not after the last "
                    "sample "
                    f"({time_text(self._waiting.end)} s)"
                )
            self._rows.append(self._taken(self._state, self._waiting, 0.0))
            self._due = self._due[len(self._rows[-1]) :]
        last = len(chunk) - 1
        whole, self._waiting = chunk.rows(0, last), chunk.rows(last, last + 1)
        if len(whole):
            self._rows.append(self._taken(self._state, whole, 0.0))
            self._due = self._due[len(self._rows[-1]) :]
        return self

    def _taken(self, state: Array, samples: ImuRecord, closing: float) -> Array:
        rows = np.zeros((int(np.searchsorted(self._due, samples.end + STAMP_ROUNDING)), self._size))
        count = self._follow(
            state, float(not samples.coning_corrected), float(not samples.sculling_corrected),
            samples.time, samples.dt, samples.dtheta, samples.dvel, self._due[: len(rows)],
            closing, rows,
        )  # fmt: skip
        return rows[:count]

    def rows(self) -> BodyRows:
        """Return the rows of all samples so far.

        Raises
        ------
        InputError
            If there were no samples.
        """
        if self._waiting is None or self._start is None:
            raise InputError("the record has no samples to align")
        last = self._taken(self._state.copy(), self._waiting, 1.0)
        return BodyRows.of(self._start, np.concatenate([*self._rows, last]))


def body_rows(record: ImuRecord, due: ArrayLike) -> BodyRows:
    """Return the rows of a whole record."""
    return BodyPass(due).update(record).rows()
