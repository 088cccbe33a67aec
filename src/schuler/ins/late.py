"""`LatencyWindow`: states and samples of the last seconds, so that a late aid is taken in its time.

A filter gives the same bits for any chunking, so a run that starts again from a kept state, with
the late measurement in its place, gives those of measurements in time.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.record import ImuRecord

__all__ = ["Chunk", "LatencyWindow", "Span"]

Array = NDArray[np.float64]

_SPANS = 8
"""States that are kept in a latency."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """Samples that a filter has taken.

    Parameters
    ----------
    record : ImuRecord
    inside : (n, 7) float64 or None
        As in `ErrorStateFilter.update`.
    """

    record: ImuRecord
    inside: Array | None

    def rows(self, begin: int, end: int) -> Chunk:
        """Return some of the samples."""
        inside = None if self.inside is None else self.inside[begin:end]
        return Chunk(self.record.rows(begin, end), inside)


@dataclass(eq=False)
class Span:
    """What a filter was before some chunks, the chunks, and the measurements taken in them.

    Parameters
    ----------
    time : float
        Of the last sample before; -inf at the start.
    arrays : dict of str to array
    counts : tuple of int
        Lengths of the lists of outputs.
    chunks : list of Chunk
    taken : list of array
        Rows of the kernel's table.
    """

    time: float
    arrays: dict[str, Array]
    counts: tuple[int, ...]
    chunks: list[Chunk] = field(default_factory=list)
    taken: list[Array] = field(default_factory=list)


class LatencyWindow:
    """The spans of a filter that a late measurement may fall into.

    They reach back by the latency, and by an eighth of it and a sample at most beyond.

    Parameters
    ----------
    latency : float
        s.
    """

    def __init__(self, latency: float) -> None:
        self.latency = latency
        self._spans: deque[Span] = deque()

    def clear(self) -> None:
        """Forget all spans."""
        self._spans.clear()

    def pieces(self, chunk: Chunk) -> list[Chunk]:
        """Return a chunk in pieces that are short beside the latency."""
        time = chunk.record.time
        count = int((time[-1] - time[0]) / (self.latency / _SPANS)) + 1
        edges = np.searchsorted(time, np.linspace(time[0], time[-1], count + 1)[1:-1])
        bounds = np.unique([0, *edges.tolist(), len(time)])
        return [chunk.rows(int(a), int(b)) for a, b in pairwise(bounds)]

    def wants_span(self, time: float) -> bool:
        """Say whether a new span begins at a time: the last one is long enough."""
        return not self._spans or time - self._spans[-1].time >= self.latency / _SPANS

    def begin(self, span: Span) -> None:
        """Begin a span, and forget those that no measurement may fall into any more."""
        self._spans.append(span)
        while len(self._spans) > 1 and self._spans[1].time < span.time - self.latency:
            self._spans.popleft()

    def keep(self, chunk: Chunk, taken: Array) -> None:
        """Keep what was taken after the last span's beginning."""
        r = chunk.record
        # A view would keep the whole record that it is cut from.
        record = replace(
            r, time=r.time.copy(), dt=r.dt.copy(), dtheta=r.dtheta.copy(), dvel=r.dvel.copy()
        )
        inside = None if chunk.inside is None else chunk.inside.copy()
        self._spans[-1].chunks.append(Chunk(record, inside))
        self._spans[-1].taken.append(taken)

    def before(self, time: float) -> Span | None:
        """Return the last span that begins before a time."""
        return next((span for span in reversed(self._spans) if span.time < time), None)

    def cut(self, span: Span) -> tuple[list[Chunk], list[Array]]:
        """Forget a span and all after it; return their chunks and measurements."""
        chunks: list[Chunk] = []
        taken: list[Array] = []
        at = next(k for k, each in enumerate(self._spans) if each is span)
        for each in list(self._spans)[at:]:
            chunks += each.chunks
            taken += each.taken
        while len(self._spans) > at:
            self._spans.pop()
        return chunks, taken

    @property
    def bytes(self) -> int:
        """Memory of the states, samples and measurements that are kept."""
        total = 0
        for span in self._spans:
            total += sum(array.nbytes for array in (*span.arrays.values(), *span.taken))
            for chunk in span.chunks:
                r = chunk.record
                total += r.time.nbytes + r.dt.nbytes + r.dtheta.nbytes + r.dvel.nbytes
        return total
