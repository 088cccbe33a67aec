"""The samples of an `Aligner` whose method has a prefilter, and the aligner of what comes out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schuler.prefilter.base import Prefilter
from schuler.record import ImuRecord

if TYPE_CHECKING:
    from schuler.alignment.aligner import Aligner

__all__ = ["Filtered"]


class Filtered:
    """Hold the samples for a prefilter, or pass them through one that streams.

    Parameters
    ----------
    prefilter : Prefilter
        For the gravity of the place.
    plain : Aligner
        Made alike without a prefilter; it has taken nothing.
    """

    def __init__(self, prefilter: Prefilter, plain: Aligner) -> None:
        self._prefilter = prefilter
        self._plain = plain
        self._stream = prefilter.stream() if prefilter.streams else None
        self._held: list[ImuRecord] = []
        self.samples = 0

    def push(self, chunk: ImuRecord) -> None:
        """Take a chunk.

        Raises
        ------
        InputError
            If a prefilter that streams refuses it.
        """
        if self._stream is None:
            self._held.append(chunk)
        else:
            self._plain.update(self._stream.push(chunk))
        self.samples += len(chunk)

    def prepared(self) -> Aligner:
        """Return an aligner that has taken all samples, filtered.

        Raises
        ------
        InputError
            If the prefilter refuses them.
        """
        if self._stream is not None:
            # What the stream still holds is filtered as if it ended here; it goes on by itself.
            rest = self._stream.copy().close()
            return self._plain.branch().update(rest).prepared()
        record = ImuRecord.concatenate(self._held, quality=self._held[-1].quality)
        return self._plain.fresh().update(self._prefilter(record)).prepared()
