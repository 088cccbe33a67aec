"""What a pass over a record leaves behind: cumulative sums at up to 4097 instants.

Every estimator, its uncertainty, its convergence and the report are computed from this table, so
that a record of any length needs constant memory and is read once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_RATE
from schuler.kernels.fields import Field
from schuler.kernels.states import TrackerNode, TrackerState
from schuler.record import ImuRecord

__all__ = ["History", "Rows", "gravity_direction", "inertial_to_local"]

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


def inertial_to_local(t: Array | float, lat: float) -> Array:
    """Return C_i0^n (..., 3, 3) at times t (s since the start) for a latitude (rad)."""
    a = EARTH_RATE * np.asarray(t, np.float64)
    s, c = np.sin(a), np.cos(a)
    sl, cl = np.sin(lat), np.cos(lat)
    out = np.zeros((*a.shape, 3, 3))
    out[..., 0, 0], out[..., 0, 1] = -s, c
    out[..., 1, 0], out[..., 1, 1], out[..., 1, 2] = -sl * c, -sl * s, cl
    out[..., 2, 0], out[..., 2, 1], out[..., 2, 2] = cl * c, cl * s, sl
    return out


def gravity_direction(lat: float) -> Array:
    """Return D = diag(cosL, cosL, sinL): the force that holds the body is g D db/dt in i0."""
    return np.array([np.cos(lat), np.cos(lat), np.sin(lat)])


@dataclass(frozen=True, eq=False)
class History:
    """Cumulative rows at instants, the first at the start (all zero), the last at the end.

    Parameters
    ----------
    rows : (k, 44) float64
        `TrackerNode` by `TrackerNode`.
    start : float
        Time of the start, s.
    samples : int
        Samples in all.
    sampling_faults : bool
        Whether samples were lost, held, replaced or cut off, or their times are unsure: what is
        made of them has errors that no specification of the sensors holds.
    """

    rows: Array
    start: float
    samples: int
    sampling_faults: bool = False

    @classmethod
    def from_state(cls, state: Array, nodes: Array, *, sampling_faults: bool = False) -> History:
        """Copy the nodes of a tracking kernel and add the last instant when it is not one."""
        last = TrackerState(state)
        rows = nodes[: int(last.nodes)]
        if last.updates > TrackerNode(rows).updates[-1]:
            rows = np.vstack([rows, last.node().data])
        return cls(rows.copy(), float(last.start), int(last.samples), sampling_faults)

    @classmethod
    def with_waiting(
        cls, state: TrackerState, nodes: Array, flags: tuple[float, float],
        tail: tuple[Array, Array], *, sampling_faults: bool = False,
    ) -> History:  # fmt: skip
        """Copy the sums of a tracking kernel, with the samples that wait for a full update.

        Parameters
        ----------
        state, nodes
            Of the kernel; they stay as they are.
        flags : (float, float)
            Whether coning and sculling are to be corrected.
        tail : (k,), (k,) float64
            Times and intervals of the last samples, s.
        sampling_faults : bool
            As of a history.
        """
        from schuler.kernels import tracking

        waiting = int(state.waiting)
        if not waiting:
            return cls.from_state(state.data, nodes, sampling_faults=sampling_faults)
        state, nodes = TrackerState(state.data.copy()), nodes.copy()
        rows = state.waiting_samples[:waiting].copy()
        time, dt = (each[-waiting:] for each in tail)
        # The plain sums had these samples already, and will have them again.
        rate = np.linalg.norm(rows.reshape(-1, 2, 3), axis=2) / dt[:, None]
        state.sum_dtheta -= rows[:, :3].sum(axis=0)
        state.sum_dvel -= rows[:, 3:].sum(axis=0)
        state.sum_rate -= rate[:, 0].sum()
        state.sum_rate2 -= (rate[:, 0] ** 2).sum()
        state.sum_force -= rate[:, 1].sum()
        state.sum_force2 -= (rate[:, 1] ** 2).sum()
        state.samples -= waiting
        state.waiting = 0.0
        tracking.track(
            state.data, nodes, 1, *flags, time, dt,
            np.ascontiguousarray(rows[:, :3]), np.ascontiguousarray(rows[:, 3:]),
        )  # fmt: skip
        return cls.from_state(state.data, nodes, sampling_faults=sampling_faults)

    @classmethod
    def of_record(cls, record: ImuRecord) -> History:
        """Track a record whose samples are one update each."""
        from schuler.kernels import tracking

        state = TrackerState.begin()
        nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
        tracking.track(
            state.data, nodes, 1, float(not record.coning_corrected),
            float(not record.sculling_corrected), record.time, record.dt, record.dtheta,
            record.dvel,
        )  # fmt: skip
        return cls.from_state(state.data, nodes)

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def nodes(self) -> TrackerNode:
        """The rows by the names of their numbers."""
        return TrackerNode(self.rows)

    @cached_property
    def t(self) -> Array:
        """Instants, s since the start, (k,)."""
        return self.nodes.time

    @cached_property
    def updates(self) -> Array:
        """Updates so far at each instant, (k,)."""
        return self.nodes.updates

    @cached_property
    def duration(self) -> float:
        """Length, s."""
        return float(self.nodes.time[-1])

    @property
    def quat(self) -> Array:
        """quat_ib0_b at each instant, (k, 4)."""
        return self.nodes.quat_ib0_b

    @property
    def velocity(self) -> Array:
        """Integral of the force in ib0 at each instant, m/s, (k, 3)."""
        return self.nodes.v_ib0

    def theory(self, gravity: float, lat: float) -> Array:
        """Return G, the theoretical integral in i0 at each instant, m/s, (k, 3)."""
        a = EARTH_RATE * self.t
        b = np.column_stack([np.sin(a), 2.0 * np.sin(0.5 * a) ** 2, a]) / EARTH_RATE
        return gravity * gravity_direction(lat) * b

    def sums(self) -> tuple[float, Array, Array, Array]:
        """Return updates, sum of v (3,), sum of b (3,) and sum of b v^T (3, 3) at the end."""
        r = TrackerNode(self.rows[-1])
        return float(r.updates), r.sum_v, r.sum_gravity, r.sum_gravity_v

    def second_moments(self, centred: bool) -> Array:
        """Return the sum of b b^T (3, 3) at the end, about the mean of b or about zero."""
        r = TrackerNode(self.rows[-1])
        xy, xz, yz = r.sum_xy, r.sum_xz, r.sum_yz
        out = np.array([[r.sum_xx, xy, xz], [xy, r.sum_yy, yz], [xz, yz, r.sum_zz]])
        return out - np.outer(r.sum_gravity, r.sum_gravity) / r.updates if centred else out

    def increments(self) -> tuple[Array, Array]:
        """Return the sums of angle (3,) and velocity increments (3,) in body axes at the end."""
        last = TrackerNode(self.rows[-1])
        return last.sum_dtheta, last.sum_dvel

    def block_means(self, field: Field) -> Array:
        """Return the means over updates of a sum of `TrackerNode` between instants, (k-1, m)."""
        n = np.diff(self.updates)
        return np.asarray(np.diff(self.rows[:, field.slice], axis=0) / n[:, None])

    def mean_shares(self) -> Array:
        """Return how far through each stretch its updates are in the mean, 0 to 1, (k-1,).

        It is (n + 1) / 2n for n even updates, and another where rows were lost.
        """
        mean = self.block_means(TrackerNode.sum_gravity)[:, 2]
        return np.asarray((mean - self.t[:-1]) / np.diff(self.t))

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
            samples=round(self.samples * self.updates[row] / self.updates[-1]),
        )
