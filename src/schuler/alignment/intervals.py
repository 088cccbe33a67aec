"""A history as the samples of a filter: intervals that are known by their integrals.

Between two instants of a history the rotation, the velocity and the displacement that the force
makes are known to the last bit that the samples gave, however many samples there were. A filter
that runs over them needs no samples, and so no memory for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.record import ImuRecord

__all__ = ["Intervals"]

Array = NDArray[np.float64]

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])

_TURNED = 0.5
"""Length of a mean of unit quaternions below which it says nothing of the mean rotation."""


def _rotated(quat: Array, v: Array) -> Array:
    return np.asarray(np.einsum("iab,ib->ia", quat_to_matrix(quat), v))


@dataclass(frozen=True, eq=False)
class Intervals:
    """Intervals of a record, as `ErrorStateFilter.update` takes them.

    Parameters
    ----------
    record : ImuRecord
        A sample for each interval: rotation vector and velocity increment in the body axes of its
        start, with coning and sculling corrected.
    inside : (n, 7) float64
        Mean rotation from the body to the axes of the start (quaternion), and the displacement
        there that the force makes, m.
    """

    record: ImuRecord
    inside: Array

    def __len__(self) -> int:
        return len(self.record)

    @classmethod
    def of(cls, h: History, step: float) -> Intervals:
        """Divide a history into intervals of one length, as near to `step` as its instants allow.

        The last one ends with the history.
        """
        count = max(1, round(h.duration / step))
        wanted = np.linspace(0.0, h.duration, count + 1)
        rows = np.searchsorted(h.t, wanted - 0.5 * h.duration / (len(h) - 1))
        rows[-1] = len(h) - 1
        rows = np.unique(np.minimum(rows, len(h) - 1))
        nodes = h.nodes
        quat, v, span = h.quat[rows], h.velocity[rows], np.diff(h.t[rows])
        back = quat[:-1] * _CONJUGATE
        turn = np.asarray(multiply(back, quat[1:]))
        rotvec = quat_to_rotvec(turn)
        n = np.diff(h.updates[rows])[:, None]
        # Sums are over the ends of updates: half of the last one for half of the first.
        mean_v = (np.diff(nodes.sum_v[rows], axis=0) - 0.5 * (v[1:] - v[:-1])) / n
        mean_q = (np.diff(nodes.sum_quat[rows], axis=0) - 0.5 * (quat[1:] - quat[:-1])) / n
        size = np.linalg.norm(mean_q, axis=1, keepdims=True)
        mean = np.asarray(multiply(back, mean_q / np.maximum(size, 1e-9)))
        mean = np.where(size < _TURNED, rotvec_to_quat(0.5 * rotvec), mean)
        time = h.start + h.t[rows[1:]]
        record = ImuRecord(
            np.ascontiguousarray(time), span, np.ascontiguousarray(rotvec),
            np.ascontiguousarray(_rotated(back, v[1:] - v[:-1])), True, True,
        )  # fmt: skip
        place = _rotated(back, (mean_v - v[:-1]) * span[:, None])
        return cls(record, np.ascontiguousarray(np.hstack([mean, place])))

    def reversed(self) -> Intervals:
        """Return the intervals run backwards: rotations change their sign, forces do not."""
        r = self.record
        turn = rotvec_to_quat(-r.dtheta)
        mean = np.asarray(multiply(turn, self.inside[:, :4]))
        place = _rotated(turn, r.dvel * r.dt[:, None] - self.inside[:, 4:])
        time = r.start + r.end - (r.time - r.dt)[::-1]
        record = ImuRecord(
            np.ascontiguousarray(time), np.ascontiguousarray(r.dt[::-1]),
            np.ascontiguousarray(-r.dtheta[::-1]),
            np.ascontiguousarray(_rotated(turn, r.dvel)[::-1]), True, True,
        )  # fmt: skip
        return Intervals(record, np.ascontiguousarray(np.hstack([mean, place])[::-1]))
