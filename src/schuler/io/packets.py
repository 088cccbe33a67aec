"""Samples that come one by one: binary frames and CSV lines.

A frame of version 1 is 68 bytes, little-endian:

====== ======== ==================================================================
offset type     what
====== ======== ==================================================================
0      2 bytes  ``SC``
2      uint8    version, 1
3      uint8    what the values are: 0 rates, 1 mean rates, 2 increments
4      uint32   number of the sample, from 0, one by one; 0 follows 4294967295
8      float64  time at the end of the sample's interval, s
16     float64  six: gyro x, y, z (rad/s or rad), accelerometer x, y, z (m/s^2 or m/s)
64     uint32   CRC-32 of the 64 bytes before
====== ======== ==================================================================

A frame of version 2 is authenticated by a key that sender and receiver share. It is 104 bytes; the
first 64 are those of version 1, but for the version, 2:

====== ======== ==================================================================
64     uint64   run of the sender: greater at each start of it, as its time in ns
72     32 bytes HMAC-SHA256 of the 72 bytes before
====== ======== ==================================================================

The tag proves that a holder of the key made the frame. A frame that is sent again by somebody else
keeps its tag, but also its run, number and time: within a run it is repeated or late, and a frame
of a run that is over is dropped. What is not covered: the content is not secret; whoever is
between sender and receiver can still drop or delay frames; and frames of an older run are taken
until the first ones of a newer run have come.

Axes are x right, y forward, z up. A CSV line holds the same numbers in the same order: number,
time, six values; lines that start with ``#`` are passed over.
"""

from __future__ import annotations

import hmac
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from schuler.errors import InputError

__all__ = [
    "FRAME_BYTES",
    "KEYED_FRAME_BYTES",
    "Packet",
    "PacketParser",
    "encode_csv",
    "encode_frame",
    "read_key",
]

Sample = tuple[int, float, tuple[float, ...]]

_FRAME = struct.Struct("<2sBBId6d")
_RUN = struct.Struct("<Q")
_TAG_BYTES = 32
FRAME_BYTES = _FRAME.size + 4
KEYED_FRAME_BYTES = _FRAME.size + _RUN.size + _TAG_BYTES
_BYTES = {1: FRAME_BYTES, 2: KEYED_FRAME_BYTES}
KINDS = ("rates", "mean-rates", "increments")

_BEGIN = re.compile(rb"SC[\x01\x02]")
"""No line of text holds such a byte, so lines and frames may come in one stream."""

_LONGEST_LINE = 4096

LARGEST_RATE, LARGEST_FORCE, LARGEST_TIME = 10.0, 1e3, 1e12
"""More than a stationary vehicle, with its engine and its crew, ever gives (rad/s, m/s^2; 570
deg/s and 100 g), and than any clock (s)."""

_LEAST_KEY, _LONGEST_KEY = 16, 4096

#: why a packet gave no sample -> what is said of it
REASONS = {
    "checksum": "with a wrong checksum",
    "malformed": "that are no sample",
    "not_finite": "with a value that is not finite",
    "out_of_range": "with a value that no stationary vehicle gives",
    "unauthenticated": "without the key's tag",
    "unverified": "with a tag, and no key to check it (--key-file)",
}


class Packet(NamedTuple):
    """A sample as it came.

    Attributes
    ----------
    number : int
    time : float
        End of the sample's interval, s.
    values : tuple of float
        Gyro x, y, z and accelerometer x, y, z.
    kind : str or None
        What a frame says that its values are; None for a CSV line.
    run : int
        Run of the sender, of an authenticated frame; 0 else.

    Examples
    --------
    >>> Packet(7, 0.05, (0.0, 0.0, 1e-6, 0.0, 0.0, 0.49)).number
    7
    """

    number: int
    time: float
    values: tuple[float, ...]
    kind: str | None = None
    run: int = 0


def encode_frame(
    number: int,
    time: float,
    values: Iterable[float],
    kind: str,
    *,
    key: bytes | None = None,
    run: int = 0,
) -> bytes:
    """Return a frame of a sample: of version 1, or of version 2 where a key is given.

    Parameters
    ----------
    number : int
        Number of the sample; its lowest 32 bits are sent.
    time : float
        End of the sample's interval, s.
    values : iterable of float
        Gyro x, y, z and accelerometer x, y, z, SI, body axes (RFU).
    kind : {"rates", "mean-rates", "increments"}
        What the values are.
    key : bytes, optional
        The shared key.
    run : int
        With a key: a number that is greater at each start of the sender, as `time.time_ns()`.

    Examples
    --------
    >>> len(encode_frame(0, 0.01, [0.0] * 6, "rates"))
    68
    >>> len(encode_frame(0, 0.01, [0.0] * 6, "rates", key=b"sixteen bytes ..", run=1))
    104
    """
    version = 1 if key is None else 2
    body = _FRAME.pack(b"SC", version, KINDS.index(kind), number & 0xFFFFFFFF, time, *values)
    if key is None:
        return body + struct.pack("<I", zlib.crc32(body))
    body += _RUN.pack(run)
    return body + hmac.digest(key, body, "sha256")


def encode_csv(number: int, time: float, values: Iterable[float]) -> bytes:
    r"""Return a CSV line of a sample.

    Examples
    --------
    >>> encode_csv(7, 0.05, [0.0, 0.0, 1e-6, 0.0, 0.0, 0.49])
    b'7,0.05,0.0,0.0,1e-06,0.0,0.0,0.49\n'
    """
    cells = [repr(float(value)) for value in (time, *values)]
    return (",".join([str(int(number)), *cells]) + "\n").encode()


def read_key(path: str | Path) -> bytes:
    r"""Return the key in a file: its bytes, without white space at the end.

    Raises
    ------
    InputError
        If the file cannot be read, or the key has fewer than 16 bytes or more than 4096.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("stream.key").write_text("0123456789abcdef\n")
    >>> len(read_key("stream.key"))
    16
    """
    try:
        with Path(path).open("rb") as file:
            key = file.read(_LONGEST_KEY + 64).rstrip()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: the key cannot be read ({reason})") from None
    if not _LEAST_KEY <= len(key) <= _LONGEST_KEY:
        raise InputError(
            f"{path}: a key has {_LEAST_KEY} to {_LONGEST_KEY} bytes, and this one has "
            f"{len(key)}{' or more' if len(key) > _LONGEST_KEY else ''}"
        )
    return key


@dataclass
class PacketParser:
    """Cut a stream of bytes, or datagrams, into samples; what is none is counted and left out.

    Frames and lines may come in one stream. Each packet is judged alone.

    Parameters
    ----------
    key : bytes, optional
        The shared key: only frames that it authenticates are taken.
    kind : str or None
        What the last frame said that its values are; None until one came, and for CSV.
    counts : Counter
        Packets that were left out, by a name of `REASONS`.

    Examples
    --------
    >>> parser = PacketParser()
    >>> [each.number for each in parser.feed(encode_csv(7, 0.05, [0.0] * 6))]
    [7]
    """

    key: bytes | None = None
    kind: str | None = None
    counts: Counter[str] = field(default_factory=Counter)
    _rest: bytes = b""

    @property
    def damaged(self) -> int:
        """Frames with a wrong checksum, and lines and datagrams that are no sample."""
        return self.counts["checksum"] + self.counts["malformed"]

    def feed(self, data: bytes) -> list[Packet]:
        """Return the samples that are whole with these bytes of a stream."""
        samples, self._rest = self._cut(self._rest + data)
        if len(self._rest) > _LONGEST_LINE:
            self.counts["malformed"] += 1
            # A frame may have begun at the end.
            self._rest = self._rest[-2:]
        return samples

    def datagram(self, data: bytes) -> list[Packet]:
        """Return the samples of a datagram: whole frames and lines, the last with no line end."""
        samples, rest = self._cut(data + b"\n")
        if rest:
            # A frame has begun that does not end.
            self.counts["malformed"] += 1
        return samples

    def _cut(self, data: bytes) -> tuple[list[Packet], bytes]:
        """Return samples, and what may become one with the bytes that follow."""
        out: list[Packet] = []
        at = 0
        # What follows a damaged frame is most likely its own remains: counted once.
        remains = 0
        while True:
            begin = _BEGIN.search(data, at)
            if begin is None:
                found, rest = self._lines(data[at:], remains - at)
                return out + found, rest
            mark = begin.start()
            if mark > at:
                out += self._lines(data[at:mark] + b"\n", remains - at)[0]
            size = _BYTES[data[mark + 2]]
            if len(data) - mark < size:
                return out, data[mark:]
            judged = self._frame(data[mark : mark + size])
            if isinstance(judged, Packet):
                out.append(judged)
                at = mark + size
                continue
            if mark >= remains:
                self.counts[judged] += 1
            if judged == "checksum" or size == KEYED_FRAME_BYTES:
                # The beginning may have been a value's: the next frame can be inside.
                at, remains = mark + 3, max(remains, mark + size)
            else:
                at = mark + size

    def _lines(self, data: bytes, remains: int = 0) -> tuple[list[Packet], bytes]:
        """Return samples of whole lines, and the last line where it has no end."""
        *lines, rest = data.split(b"\n")
        out: list[Packet] = []
        at = 0
        for line in lines:
            own, at = at >= remains, at + len(line) + 1
            line = line.strip()
            if not line or line.startswith(b"#"):
                continue
            found = self._line(line)
            if isinstance(found, Packet):
                out.append(found)
            elif own:
                self.counts[found] += 1
        return out, rest

    def _line(self, line: bytes) -> Packet | str:
        cells = line.split(b",")
        if len(cells) != 8 or len(line) > _LONGEST_LINE:
            return "malformed"
        try:
            number = int(cells[0][:20])
            time, *values = (float(cell) for cell in cells[1:])
        except ValueError:
            return "malformed"
        if not 0 <= number < 2**53 or len(cells[0]) > 20:
            return "malformed"
        if self.key is not None:
            return "unauthenticated"
        return _judge(Packet(number, time, tuple(values)))

    def _frame(self, frame: bytes) -> Packet | str:
        """Return the sample of a frame of full length, or the reason why there is none."""
        _, version, kind, number, time, *values = _FRAME.unpack(frame[: _FRAME.size])
        run = 0
        if version == 1:
            crc = struct.unpack("<I", frame[_FRAME.size :])[0]
            if zlib.crc32(frame[: _FRAME.size]) != crc:
                return "checksum"
            if self.key is not None:
                return "unauthenticated"
        else:
            # Without the key a damaged frame cannot be told from a whole one.
            if self.key is None:
                return "unverified"
            body, tag = frame[:-_TAG_BYTES], frame[-_TAG_BYTES:]
            if not hmac.compare_digest(hmac.digest(self.key, body, "sha256"), tag):
                return "unauthenticated"
            (run,) = _RUN.unpack(body[_FRAME.size :])
        if kind >= len(KINDS):
            return "malformed"
        found = _judge(Packet(number, time, tuple(values), KINDS[kind], run))
        if isinstance(found, Packet):
            self.kind = found.kind
        return found


def _judge(packet: Packet) -> Packet | str:
    if not math.isfinite(packet.time) or not all(map(math.isfinite, packet.values)):
        return "not_finite"
    # Increments over up to a second are no larger than rates.
    gyro, force = packet.values[:3], packet.values[3:]
    if (
        abs(packet.time) > LARGEST_TIME
        or max(map(abs, gyro)) > LARGEST_RATE
        or max(map(abs, force)) > LARGEST_FORCE
    ):
        return "out_of_range"
    return packet
