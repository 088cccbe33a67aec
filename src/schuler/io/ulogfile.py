"""A PX4 log's messages, checked one by one before a library sees them.

A log is a chain of messages, each with its size and type (PX4, ULog file format). A size that is
damaged sends a reader anywhere, and pyulog then may never come back; formats that contain each
other, or arrays of arrays, take all memory. So the chain is walked here, what is sound and wanted
is put together as a log of its own, and what is lost is counted.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO

from schuler.errors import InputError, shown

__all__ = ["CleanLog", "clean"]

_HEADER = 16
_HEAD = struct.Struct("<HB")
#: flags, formats, information, parameters; subscriptions, data, texts, synchronisation, dropouts
_KNOWN = frozenset(b"BFIMPQARDLCSO")
_DATA, _FORMAT, _SUBSCRIBE, _DROPOUT, _FLAGS = b"DFAOB"
#: so many messages after each other with known types are a chain
_CHAIN = 4
_WINDOW = 1 << 16
_WIDTHS = {
    "int8_t": 1, "uint8_t": 1, "int16_t": 2, "uint16_t": 2, "int32_t": 4, "uint32_t": 4,
    "int64_t": 8, "uint64_t": 8, "float": 4, "double": 8, "bool": 1, "char": 1,
}  # fmt: skip
#: a message's size is a 16-bit number
_LARGEST = 0xFFFF


@dataclass
class CleanLog:
    """What was found.

    Parameters
    ----------
    data : bytes
        A log that holds the wanted messages only.
    lost : int
        Bytes that belong to no whole message.
    cut : bool
        The log ends inside a message.
    names : list of str
        Of all formats.
    rows : dict of str to int
        Data messages by name and instance, ``"vehicle_imu:0"``.
    """

    data: bytes = b""
    lost: int = 0
    cut: bool = False
    names: list[str] = field(default_factory=list)
    rows: dict[str, int] = field(default_factory=dict)


def clean(file: IO[bytes], size: int, wanted: tuple[str, ...]) -> CleanLog:
    """Walk a log and keep the messages of some names.

    Parameters
    ----------
    file : file
        At its beginning.
    size : int
        Bytes of the file.
    wanted : tuple of str
        Names of messages.

    Raises
    ------
    InputError
        If the log says that it must not be read, or a wanted format cannot be.
    """
    log = CleanLog()
    out = [file.read(_HEADER)]
    formats: dict[str, str] = {}
    streams: dict[int, str | None] = {}
    for kind, body in _messages(file, size, log):
        if kind == _DATA:
            key = int.from_bytes(body[:2], "little")
            stream = streams.get(key)
            if stream is not None:
                out.append(_HEAD.pack(len(body), kind) + body)
                log.rows[stream] += 1
            elif key not in streams:
                log.lost += 3 + len(body)
        elif kind == _FORMAT:
            name, _, fields = body.decode("utf-8", "replace").partition(":")
            if name not in formats:
                formats[name] = fields
                out.append(_HEAD.pack(len(body), kind) + body)
        elif kind == _SUBSCRIBE and len(body) > 3:
            name = body[3:].decode("utf-8", "replace")
            streams[int.from_bytes(body[1:3], "little")] = None
            if name in wanted:
                if not 0 < _width(name, formats, ()) <= _LARGEST:
                    raise InputError(f"is a damaged ULog: the format of {shown(name)} has no size")
                streams[int.from_bytes(body[1:3], "little")] = f"{name}:{body[0]}"
                log.rows.setdefault(f"{name}:{body[0]}", 0)
                out.append(_HEAD.pack(len(body), kind) + body)
        elif kind == _DROPOUT and len(body) == 2:
            out.append(_HEAD.pack(len(body), kind) + body)
        elif kind == _FLAGS and len(body) >= 16 and (body[8] & ~1 or any(body[9:16])):
            raise InputError("is a ULog with features that are not known (its incompatible flags)")
    log.data = b"".join(out)
    log.names = list(formats)
    return log


def _messages(file: IO[bytes], size: int, log: CleanLog) -> Iterator[tuple[int, bytes]]:
    """Yield the messages; pass over what is none."""
    place = _HEADER
    while place < size:
        head = file.read(3)
        if len(head) < 3:
            log.cut = True
            log.lost += len(head)
            return
        count, kind = _HEAD.unpack(head)
        known = kind in _KNOWN and count > 0
        if known and place + 3 + count <= size:
            yield kind, file.read(count)
            place += 3 + count
            continue
        after = place + 3 + count
        if not known and count and _chained(file, after, size):
            # A type that is damaged, or newer than this list: its size still leads on.
            log.lost += 3 + count
            place = after
        else:
            found = _search(file, place + 1, size)
            log.cut |= found == size
            log.lost += found - place
            place = found
        file.seek(place)


def _chained(file: IO[bytes], place: int, size: int) -> bool:
    """Say whether messages of known types begin at a place."""
    for _ in range(_CHAIN):
        if place == size:
            return True
        file.seek(place)
        head = file.read(3)
        if len(head) < 3:
            return False
        count, kind = _HEAD.unpack(head)
        place += 3 + count
        if kind not in _KNOWN or not count or place > size:
            return False
    return True


def _search(file: IO[bytes], place: int, size: int) -> int:
    """Return where the next chain begins; the file's end where there is none."""
    while place < size:
        file.seek(place)
        window = file.read(_WINDOW)
        for k in range(len(window) - 2):
            if window[k + 2] in _KNOWN and _chained(file, place + k, size):
                return place + k
        place += max(1, len(window) - 2)
    return size


def _width(name: str, formats: dict[str, str], inside: tuple[str, ...]) -> int:
    """Return the bytes of a format's message; 0 where it has no end or is unknown."""
    if name in inside or name not in formats:
        return 0
    total = 0
    for entry in filter(None, formats[name].split(";")):
        kind, _, _ = entry.partition(" ")
        kind, bracket, count = kind.partition("[")
        number = count.rstrip("]") if bracket else "1"
        if not (number.isascii() and number.isdigit() and len(number) < 6):
            return 0
        one = _WIDTHS.get(kind) or _width(kind, formats, (*inside, name))
        if not one:
            return 0
        total += int(number) * one
        if total > _LARGEST:
            return 0
    return total
