"""NovAtel's messages in bytes: where one begins, how long it is, and its checksum.

A binary message begins with three sync bytes, of which the third says whether the header is long or
short; the CRC-32 at the end begins at zero (OEM7 documentation, "Binary" and "32-bit CRC").
"""

from __future__ import annotations

import struct
import zlib

__all__ = ["SYNC", "crc", "frame_at", "sound"]

SYNC = b"\xaa\x44"
_LONG, _SHORT = 0x12, 0x13
_LONG_HEADER, _SHORT_HEADER = 28, 12
#: after the sync bytes: length of the header, number, type and port, length; or length, number
_LONG_FIELDS = struct.Struct("<BHxxH").unpack_from
_SHORT_FIELDS = struct.Struct("<BH").unpack_from


def frame_at(data: bytes, at: int) -> tuple[int, int, int]:
    """Return a message's size (0: none begins here; -1: unfinished), number, and body's place."""
    if len(data) - at < _SHORT_HEADER:
        return -1, 0, 0
    mark = data[at + 2]
    if mark == _SHORT:
        length, number = _SHORT_FIELDS(data, at + 3)
        return _SHORT_HEADER + length + 4, number, _SHORT_HEADER
    if mark == _LONG:
        header, number, length = _LONG_FIELDS(data, at + 3)
        return (header + length + 4 if header >= _LONG_HEADER else 0), number, header
    return 0, 0, 0


def crc(data: bytes) -> int:
    """Return NovAtel's CRC-32: zlib's polynomial, neither begun nor ended with ones."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def sound(frame: bytes) -> bool:
    """Say whether a whole message has the right checksum at its end."""
    return crc(frame[:-4]) == int.from_bytes(frame[-4:], "little")
