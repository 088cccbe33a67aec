"""Samples that come one by one: a binary frame and CSV lines, put back into order.

A frame is 68 bytes, little-endian:

====== ======== ==================================================================
offset type     what
====== ======== ==================================================================
0      2 bytes  ``SC``
2      uint8    version, 1
3      uint8    what the values are: 0 rates, 1 mean rates, 2 increments
4      uint32   number of the sample, from 0, one by one
8      float64  time at the end of the sample's interval, s
16     float64  six: gyro x, y, z (rad/s or rad), accelerometer x, y, z (m/s^2 or m/s)
64     uint32   CRC-32 of the 64 bytes before
====== ======== ==================================================================

Axes are x right, y forward, z up. A CSV line holds the same numbers in the same order: number,
time, six values; lines that start with ``#`` are passed over.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["FRAME_BYTES", "PacketParser", "Reorder", "encode_csv", "encode_frame"]

Array = NDArray[np.float64]
Sample = tuple[int, float, tuple[float, ...]]

_FRAME = struct.Struct("<2sBBId6d")
_MAGIC = b"SC"
FRAME_BYTES = _FRAME.size + 4
KINDS = ("rates", "mean-rates", "increments")

_LONGEST_LINE = 4096


def encode_frame(number: int, time: float, values: Iterable[float], kind: str) -> bytes:
    """Return a frame of a sample."""
    body = _FRAME.pack(_MAGIC, 1, KINDS.index(kind), number & 0xFFFFFFFF, time, *values)
    return body + struct.pack("<I", zlib.crc32(body))


def encode_csv(number: int, time: float, values: Iterable[float]) -> bytes:
    """Return a CSV line of a sample."""
    return (",".join([str(number), repr(time), *map(repr, values)]) + "\n").encode()


@dataclass
class PacketParser:
    """Cut a stream of bytes, or datagrams, into samples; what is damaged is counted and left out.

    Parameters
    ----------
    damaged : int
        Frames with a wrong checksum and lines that are no sample, so far.
    kind : str or None
        What the frames say that their values are; None until one came, and for CSV.
    """

    damaged: int = 0
    kind: str | None = None
    _rest: bytes = b""
    _binary: bool | None = None

    def feed(self, data: bytes) -> list[Sample]:
        """Return the samples that are whole with these bytes."""
        data = self._rest + data
        if self._binary is None and data:
            # What comes first says what the stream is: digits are found in frames as well.
            self._binary = data[:1] == _MAGIC[:1]
        return self._frames(data) if self._binary else self._lines(data)

    def _frames(self, data: bytes) -> list[Sample]:
        out: list[Sample] = []
        at = 0
        while True:
            at = data.find(_MAGIC, at)
            if at < 0:
                # The last byte may be half of the next beginning.
                self._rest = data[-1:] if data[-1:] == _MAGIC[:1] else b""
                return out
            if len(data) - at < FRAME_BYTES:
                self._rest = data[at:]
                return out
            sample = self._frame(data[at : at + FRAME_BYTES])
            if sample is None:
                self.damaged += 1
                at += 1
            else:
                out.append(sample)
                at += FRAME_BYTES

    def _lines(self, data: bytes) -> list[Sample]:
        *lines, rest = data.split(b"\n")
        if len(rest) > _LONGEST_LINE:
            self.damaged += 1
            rest = b""
        self._rest = rest
        out: list[Sample] = []
        for line in map(bytes.strip, lines):
            if not line or line.startswith(b"#"):
                continue
            sample = _csv(line)
            if sample is None:
                self.damaged += 1
            else:
                out.append(sample)
        return out

    def _frame(self, frame: bytes) -> Sample | None:
        body = frame[: _FRAME.size]
        if zlib.crc32(body) != struct.unpack("<I", frame[_FRAME.size :])[0]:
            return None
        _, version, kind, number, time, *values = _FRAME.unpack(body)
        if version != 1 or kind >= len(KINDS):
            return None
        self.kind = KINDS[kind]
        return number, time, tuple(values)


def _csv(line: bytes) -> Sample | None:
    cells = line.split(b",")
    if len(cells) != 8:
        return None
    try:
        number = int(cells[0])
        numbers = [float(cell) for cell in cells[1:]]
    except ValueError:
        return None
    return (number, numbers[0], tuple(numbers[1:])) if number >= 0 else None


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
