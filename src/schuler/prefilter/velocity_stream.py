"""`VelocityEmd` in blocks: a stream in, the filtered samples out, in constant memory.

Blocks of one length overlap. Each is decomposed by itself, with a trend and a split of its own, and
gives what is to be added to the velocity; over the overlap one block's correction passes smoothly
into the next one's, so that it is continuous and no offset of velocity stays behind at a seam. The
weights leave the ends of both blocks, where the envelopes are extrapolated, next to nothing. The
last block ends with the stream and is as long as the others.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import rotate
from schuler.errors import InputError
from schuler.prefilter.base import uneven_sample
from schuler.record import ImuRecord

if TYPE_CHECKING:
    from schuler.prefilter.velocity import VelocityEmd

__all__ = ["VelocityEmdStream"]

Array = NDArray[np.float64]
Piece = tuple[ImuRecord, Array, Array]
"""A record, the held frame at the middle of its samples, its velocity steps in that frame."""

_BACK = np.array([1.0, -1.0, -1.0, -1.0])


class VelocityEmdStream:
    """Take chunks, give back the samples that are filtered; their bits do not depend on the chunks.

    Parameters
    ----------
    design : VelocityEmd
        With a block.
    """

    def __init__(self, design: VelocityEmd) -> None:
        self._design = design
        self._interval = 0.0
        self._length = 0
        self._overlap = 0
        self._pieces: list[Piece] = []
        self._base = 0  # number of the first sample in the pieces
        self._total = 0  # samples taken
        self._start = 0  # number of the next block's first sample, up to which all are given back
        self._correction: Array | None = None  # the last block's, at the nodes of the overlap
        self._tracked = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])

    def copy(self) -> VelocityEmdStream:
        """Return a stream that continues by itself from here."""
        other = copy(self)
        other._pieces = list(self._pieces)
        other._tracked = self._tracked.copy()
        return other

    def push(self, chunk: ImuRecord) -> ImuRecord:
        """Take a chunk and return the filtered samples that are ready, possibly none.

        Raises
        ------
        InputError
            If the sampling is uneven, or a block has too few samples.
        """
        if not len(chunk):
            return chunk
        if not self._length:
            self._open(chunk)
        uneven = uneven_sample(chunk, self._interval)
        if uneven is not None:
            raise InputError(uneven)
        out = [
            self._take(chunk.rows(k, min(k + self._length, len(chunk))))
            for k in range(0, len(chunk), self._length)
        ]
        return out[0] if len(out) == 1 else ImuRecord.concatenate(out)

    def _open(self, chunk: ImuRecord) -> None:
        # By the first interval alone, so that chunking cannot matter.
        self._interval = float(chunk.dt[0])
        self._length = round(self._design.block / self._interval)
        self._overlap = round(self._design.overlap / self._interval)
        if self._overlap < 16:
            raise InputError(
                f"an overlap of {self._design.overlap:g} s has {self._overlap} samples of "
                f"{self._interval:.4g} s, and blocks need 16 to pass into one another: lengthen "
                "overlap (and block)"
            )

    def _take(self, chunk: ImuRecord) -> ImuRecord:
        from schuler.kernels.tracking import attitudes

        turn = np.empty((len(chunk), 4))
        attitudes(self._tracked, float(not chunk.coning_corrected), chunk.dtheta, turn)
        self._pieces.append((chunk, turn, rotate(turn, chunk.dvel)))
        self._total += len(chunk)
        out = []
        # A block is taken when more comes: a record of one block is filtered as a whole.
        while self._total > self._start + self._length:
            out.append(self._block())
        if not out:
            return chunk.rows(0, 0)
        return out[0] if len(out) == 1 else ImuRecord.concatenate(out)

    def _joined(self) -> Piece:
        """Return all pieces as one."""
        if len(self._pieces) > 1:
            records, turns, steps = zip(*self._pieces, strict=True)
            record = ImuRecord.concatenate(list(records), quality=records[-1].quality)
            self._pieces = [(record, np.concatenate(turns), np.concatenate(steps))]
        return self._pieces[0]

    def _block(self) -> ImuRecord:
        """Filter a block, return the samples before the next one begins, and forget old ones."""
        step = self._length - self._overlap
        first = self._start
        found = self._passed_into(self._found(first, first + self._length))
        out = self._given(found[: step + 1])
        self._correction = found[step:]
        self._start += step
        # The last block may reach back by a whole length from one sample after this block's end.
        record, turn, steps = self._joined()
        keep = first - self._base
        if keep > 0:
            self._pieces = [
                (record.rows(keep, len(record)), turn[keep:].copy(), steps[keep:].copy())
            ]
            self._base = first
        return out

    def _found(self, first: int, last: int) -> Array:
        """Return the correction (n + 1, 3) of the velocity at the nodes of samples."""
        _, _, steps = self._joined()
        a, b = first - self._base, last - self._base
        return self._design.correction(steps[a:b], self._interval)

    def _passed_into(self, found: Array) -> Array:
        """Return a correction that begins with the one of the block before."""
        if self._correction is None:
            return found
        nodes = len(self._correction)
        weight = (np.sin(0.5 * np.pi * np.arange(nodes) / (nodes - 1)) ** 2)[:, None]
        return np.concatenate(
            [(1.0 - weight) * self._correction + weight * found[:nodes], found[nodes:]]
        )

    def _given(self, correction: Array) -> ImuRecord:
        """Return the samples from the block's start on, with a correction at their nodes."""
        record, turn, steps = self._joined()
        a = self._start - self._base
        b = a + len(correction) - 1
        filtered = rotate(turn[a:b] * _BACK, steps[a:b] + np.diff(correction, axis=0))
        return replace(record.rows(a, b), dvel=filtered)

    def close(self) -> ImuRecord:
        """Return the samples that are still held: the stream has ended.

        Raises
        ------
        InputError
            If nothing came, or too little to be filtered.
        """
        if not self._pieces:
            raise InputError("a prefilter needs 16 samples at least, the record has 0")
        if self._correction is None:
            # No longer than a block: the whole record, as without blocks.
            return self._design.whole(self._joined()[0])
        first = self._total - self._length
        found = self._found(first, self._total)[self._start - first :]
        return self._given(self._passed_into(found))
