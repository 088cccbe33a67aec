"""`Reorder`: samples in the order of their numbers, though some come late."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from schuler.io.packets import Sample

__all__ = ["Reorder"]


@dataclass
class Reorder:
    """Give samples back in the order of their numbers; wait for late ones, not for ever.

    Parameters
    ----------
    depth : int
        Samples that are held while one is missing.
    lost, repeated, late : int
        Numbers that never came; samples that came twice; samples that came after they had been
        given up.

    Examples
    --------
    >>> line = Reorder(depth=4)
    >>> zeros = (0.0,) * 6
    >>> [k for n in (1, 3, 2) for k, *_ in line.push([(n, 0.05 * n, zeros)])]
    [1, 2, 3]
    """

    depth: int = 64
    lost: int = 0
    repeated: int = 0
    late: int = 0
    expected: int | None = None
    held: dict[int, Sample] = field(default_factory=dict)

    def push(self, samples: Iterable[Sample]) -> list[Sample]:
        """Take samples as they came; return those whose turn it is."""
        out: list[Sample] = []
        for sample in samples:
            number = sample[0]
            if number in self.held:
                self.repeated += 1
            elif self.expected is not None and number < self.expected:
                # Given already, or given up.
                self.late += 1
            else:
                self.held[number] = sample
            if self.expected is None and len(self.held) >= self.depth // 4:
                self.expected = min(self.held)
            out += self._ready()
        return out

    def flush(self) -> list[Sample]:
        """Return all that is held: the stream has ended."""
        out: list[Sample] = []
        while self.held:
            self._skip()
            out += self._ready()
        return out

    def _ready(self) -> list[Sample]:
        out: list[Sample] = []
        if self.expected is None:
            return out
        while True:
            while self.expected in self.held:
                out.append(self.held.pop(self.expected))
                self.expected += 1
            if len(self.held) <= self.depth:
                return out
            self._skip()

    def _skip(self) -> None:
        first = min(self.held)
        if self.expected is not None:
            self.lost += first - self.expected
        self.expected = first
