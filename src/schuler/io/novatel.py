"""NovAtel SPAN: the raw counts of RAWIMU, RAWIMUS, RAWIMUX and RAWIMUSX, ASCII or binary.

After the GNSS week, seconds and a status word come velocity increments, then angle increments,
each as z, minus y, x (OEM7 documentation, logs 268, 325, 1461 and 1462). They are counts, whose
size depends on the instrument (there, table "Raw IMU Scale Factors"): RAWIMUX and RAWIMUSX name
it by its number (there, CONNECTIMU, table "IMU Type"), the others do not. The sizes here are those
of NovAtel's own driver (novatel_oem7_driver, oem7_imu.cpp), which refers to that table; a foot is
0.3048 m, where the driver has 1/3.2808, 1.2e-5 longer. Axes are those that are
marked on the instrument; mounted as the vehicle frame of SPAN they are right, forward, up. Each
message ends with a CRC-32 that begins at zero; what fails it is left out.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import ARCSEC, DEG, STANDARD_GRAVITY
from schuler.errors import InputError
from schuler.io.content import Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.io.novatel_frames import SYNC, crc, frame_at, sound

__all__ = ["IMU_TYPES", "ImuType", "NovatelReader"]

_FOOT = 0.3048
_MILLI_G = 1e-3 * STANDARD_GRAVITY


@dataclass(frozen=True)
class ImuType:
    """An instrument's counts: its number in CONNECTIMU, rad and m/s of a count."""

    number: int
    gyro: float
    accel: float


def _types() -> dict[str, ImuType]:
    honeywell = (2.0**-33, 2.0**-27 * _FOOT)
    coarse = (2.0**-33, 2.0**-26 * _FOOT)
    newer = (2.0**-33, 2.0**-29)
    imar = (0.1 * 2.0**-8 * ARCSEC, 0.05 * 2.0**-15)
    kvh = (0.1 / (3600.0 * 256.0), 0.05 * 2.0**-15)
    litef = (1e-9, 2e-8)
    stim = (2.0**-21 * DEG, 2.0**-22)
    epson = (0.008 / 65536 * DEG, 0.2 / 65536 * _MILLI_G)
    epson_370 = (0.0151515 / 65536 * DEG, 0.4 / 65536 * _MILLI_G)
    table: dict[tuple[str, int], tuple[float, float]] = {
        ("HG1700_AG11", 1): honeywell,
        ("HG1700_AG17", 4): coarse,
        ("HG1900_CA29", 5): honeywell,
        ("LN200", 8): (2.0**-19, 2.0**-14),
        ("HG1700_AG58", 11): honeywell,
        ("HG1700_AG62", 12): coarse,
        ("IMAR_FSAS", 13): imar,
        ("KVH_COTS", 16): kvh,
        ("HG1930_AA99", 20): honeywell,
        ("ISA100C", 26): litef,
        ("HG1900_CA50", 27): honeywell,
        ("HG1930_CA50", 28): honeywell,
        ("ADIS16488", 31): (720.0 * 2.0**-31 * DEG, 200.0 * 2.0**-31),
        ("STIM300", 32): stim,
        ("KVH_1750", 33): kvh,
        # The table states Epson's as rates, over the rate of the output.
        ("EPSON_G320", 41): (epson[0] / 125.0, epson[1] / 125.0),
        ("LITEF_MICROIMU", 52): litef,
        ("STIM300D", 56): stim,
        ("HG4930_AN01", 58): newer,
        ("EPSON_G370", 61): (epson_370[0] / 200.0, epson_370[1] / 200.0),
        ("EPSON_G320_200HZ", 62): (epson[0] / 200.0, epson[1] / 200.0),
        ("HG4930_AN04", 68): newer,
        ("HG4930_AN04_400HZ", 69): newer,
    }
    return {name: ImuType(number, *sizes) for (name, number), sizes in table.items()}


#: instruments by name
IMU_TYPES = _types()

_IDS = {268: "RAWIMU", 325: "RAWIMUS", 1461: "RAWIMUX", 1462: "RAWIMUSX"}
_TAIL = [(name, "<i4") for name in ("az", "minus_ay", "ax", "gz", "minus_gy", "gx")]
_PLAIN = np.dtype([("week", "<u4"), ("seconds", "<f8"), ("status", "<u4"), *_TAIL])
_EXTENDED = np.dtype(
    [("info", "u1"), ("type", "u1"), ("week", "<u2"), ("seconds", "<f8"), ("status", "<u4"), *_TAIL]
)
_PLAIN_PACK = struct.Struct("<IdI6i").pack
_EXTENDED_PACK = struct.Struct("<BBHdI6i").pack
_ASCII = re.compile(rb"[#%](RAWIMUS?X?)A,([^*#%\r\n]*)\*([0-9a-fA-F]{8})")
_ANY_ASCII = re.compile(rb"(?:\A|[\r\n])[#%]([A-Z0-9_]{3,}A,[^*\r\n]*)\*([0-9a-fA-F]{8})")
_WEEK = 604800.0
_CHUNK = 1 << 22
_LINE = 1 << 12
_SYNC_TRIES = 64
_MOST_SUMS = 16


class NovatelReader:
    """Reader of NovAtel logs with raw IMU messages."""

    name = "novatel"
    suffixes: tuple[str, ...] = (".gps", ".nov")

    def sniff(self, head: bytes) -> bool:
        """Say whether a whole NovAtel message is there, its checksum right."""
        if any(crc(m[1]) == int(m[2], 16) for m in _ANY_ASCII.finditer(head)):
            return True
        at = -1
        for _ in range(_SYNC_TRIES):
            at = head.find(SYNC, at + 1)
            if at < 0:
                return False
            size = frame_at(head, at)[0]
            if 0 < size <= len(head) - at and sound(head[at : at + size]):
                return True
        return False

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Find which messages there are, and the size of their counts."""
        log = _Log(path)
        log.kind = _choose(log.survey(), mapping.topic)
        first = next(log.tables())[:1]
        factors, label, said = _sizes(log.kind, first, mapping)
        content = Content(
            blocks=lambda: log.blocks(content.notes),
            said=said,
            time_label=f"the seconds of {log.kind}, from the start of week {int(first['week'][0])}",
            fixed=True,
            factors=factors,
            units_label=label,
            progress=lambda: log.done / log.size,
        )
        return content


def _choose(found: dict[str, int], wanted: str | None) -> str:
    listing = ", ".join(found) or "none"
    if wanted is not None:
        if wanted.upper() not in found:
            raise InputError(f"there are no messages '{wanted}'; of raw IMU it has {listing}")
        return wanted.upper()
    if not found:
        raise InputError(
            f"has no whole message of {', '.join(_IDS.values())}; log RAWIMUSX on the receiver"
        )
    if len(found) > 1:
        raise InputError(f"has raw IMU messages of several kinds ({listing}): say --topic")
    return next(iter(found))


def _sizes(kind: str, first: Any, mapping: Mapping) -> tuple[Array | None, str | None, Mapping]:
    """Return the factors to SI, what messages call them, and what the log says."""
    said = Mapping(gyro="rad", accel="m/s", time="s", axes="RFU")
    if mapping.gyro is not None and mapping.accel is not None:
        return None, None, said
    name, number = mapping.imu_type, None
    if name is None and "type" in first.dtype.names:
        number = int(first["type"][0])
    elif name is not None and name.isascii() and name.isdigit() and len(name) < 9:
        number = int(name)
    if number is not None:
        name = next((n for n, t in IMU_TYPES.items() if t.number == number), None)
    if name is None and number is None:
        raise InputError(
            f"{kind} does not say which instrument it is of, and so not the size of a count: name "
            f"it with --imu-type (the number or name in CONNECTIMU: {_names()}), or give the "
            'counts, as --gyro "1e-9 rad" --accel "2e-8 m/s"'
        )
    found = IMU_TYPES.get((name or "").upper().replace("-", "_"))
    if found is None:
        raise InputError(
            f"the IMU type '{name or number}' is not in the table of scale factors ({_names()}); "
            'give the size of its counts, as --gyro "1e-9 rad" --accel "2e-8 m/s"'
        )
    name = next(n for n, t in IMU_TYPES.items() if t is found)
    exact = Mapping(gyro=f"{found.gyro:.17g} rad", accel=f"{found.accel:.17g} m/s")
    label = f"counts of {name} ({found.gyro:.6g} rad and {found.accel:.6g} m/s)"
    return np.repeat([found.gyro, found.accel], 3), label, said.merged(exact)


def _names() -> str:
    return ", ".join(f"{t.number} {name}" for name, t in IMU_TYPES.items())


class _Log:
    """A log read in chunks of bytes; its raw IMU messages, ASCII and binary, in their order."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = max(1, path.stat().st_size)
        self.kind = ""
        self.done = 0
        self.damaged = 0
        self.cut = 0
        self.foreign = 0
        self._spent = 0

    def survey(self) -> dict[str, int]:
        """Count the kinds of messages, up to the first chunk that has any."""
        found: dict[str, int] = {}
        for messages in self._messages(set(_IDS.values())):
            for _, kind, _ in messages:
                found[kind] = found.get(kind, 0) + 1
            if found:
                break
        return found

    def tables(self) -> Iterator[Any]:
        """Yield the messages of the chosen kind as structured arrays."""
        layout = _layout(self.kind)
        for messages in self._messages({self.kind}):
            if messages:
                yield np.frombuffer(b"".join(body for _, _, body in messages), layout)

    def blocks(self, notes: list[str]) -> Iterator[Block]:
        """Yield time and counts; say at the end what was left out."""
        week = instrument = None
        marked = 0
        for table in self.tables():
            week = int(table["week"][0]) if week is None else week
            time = table["seconds"] + _WEEK * (table["week"].astype(np.float64) - week)
            columns = [table[name].astype(np.float64) for name in _COLUMNS]
            for k in (1, 4):
                np.negative(columns[k], out=columns[k])
            if "info" in (table.dtype.names or ()):
                instrument = int(table["type"][0]) if instrument is None else instrument
                other = np.flatnonzero(table["type"] != instrument)
                if len(other):
                    raise InputError(
                        f"the instrument changes from type {instrument} to "
                        f"{table['type'][other[0]]} at t = {time[other[0]]:.9g} s; read the parts "
                        "one by one, with --start and --stop"
                    )
                bad = (table["info"] & 1) == 1
                marked += int(bad.sum())
                for column in columns:
                    column[bad] = np.nan
            yield time, columns, None
        for count, what in (
            (marked, "samples carry the mark of an IMU error and were dropped"),
            (self.damaged, f"messages {self.kind} have a wrong checksum and were left out"),
            (self.cut, f"message {self.kind} at the end is cut off and was left out"),
            (self.foreign, "messages of other kinds, or without a kind, have a wrong checksum"),
        ):
            if count and f"{count} {what}" not in notes:
                notes.append(f"{count} {what}")

    def _messages(self, wanted: set[str]) -> Iterator[list[tuple[int, str, bytes]]]:
        """Yield for each chunk the place, the kind and the body of the messages in it."""
        self.done = self.damaged = self.cut = self.foreign = self._spent = 0
        data = b""
        with self.path.open("rb") as file:
            while True:
                more = file.read(_CHUNK)
                data += more
                self.done += len(more)
                last = len(more) < _CHUNK
                found, end, keep = self._binary(data, wanted, last)
                text, text_end, text_keep = self._ascii(data, wanted, last)
                found = sorted(found + text) if text else found
                end, keep = max(end, text_end), min(keep, text_keep)
                yield found
                if last:
                    return
                data = data[max(end, keep) :]

    def _binary(
        self, data: bytes, wanted: set[str], last: bool
    ) -> tuple[list[tuple[int, str, bytes]], int, int]:
        """Return messages, the end of the last whole one, and where an unfinished one begins."""
        found: list[tuple[int, str, bytes]] = []
        at = end = 0
        while (at := data.find(SYNC, at)) >= 0:
            size, number, begin = frame_at(data, at)
            kind = _IDS.get(number)
            if size > len(data) - at or size < 0:
                if not last:
                    return found, end, at
                self.cut += kind in wanted
                at += 1
            elif size and sound(data[at : at + size]):
                if kind in wanted:
                    body = data[at + begin : at + size - 4]
                    if len(body) != _layout(str(kind)).itemsize:
                        raise InputError(
                            f"byte {self.done - len(data) + at}: {kind} has {len(body)} bytes, "
                            f"expected {_layout(str(kind)).itemsize}"
                        )
                    found.append((at, str(kind), body))
                at = end = at + size
            else:
                self.damaged += kind in wanted
                self.foreign += size > 0 and kind not in wanted
                # Each may announce 64 KB: what is no log must not be summed over and over.
                self._spent += size
                if self._spent > _MOST_SUMS * (self.done + _CHUNK):
                    raise InputError(
                        f"is too damaged: up to byte {self.done - len(data) + at} hardly a "
                        "message has a right checksum"
                    )
                at += 1
        return found, end, len(data) - 1

    def _ascii(
        self, data: bytes, wanted: set[str], last: bool
    ) -> tuple[list[tuple[int, str, bytes]], int, int]:
        """Return the same of ASCII messages."""
        found: list[tuple[int, str, bytes]] = []
        end = 0
        for match in _ASCII.finditer(data) if b"RAWIMU" in data else ():
            kind = match[1].decode()
            end = match.end()
            if kind not in wanted:
                continue
            body = None
            if crc(data[match.start() + 1 : match.end() - 9]) == int(match[3], 16):
                body = _packed(kind, match[2])
            if body is None:
                self.damaged += 1
            else:
                found.append((match.start(), kind, body))
        begin = max(data.rfind(mark, max(end, len(data) - _LINE)) for mark in (b"#", b"%"))
        if last and begin >= 0 and data[begin + 1 : begin + 7] == b"RAWIMU":
            self.cut += 1
        return found, end, begin if begin >= 0 else len(data)


_COLUMNS = ("gx", "minus_gy", "gz", "ax", "minus_ay", "az")


def _layout(kind: str) -> np.dtype[Any]:
    return _EXTENDED if kind.endswith("X") else _PLAIN


def _packed(kind: str, text: bytes) -> bytes | None:
    """Return an ASCII message's fields as the binary message has them; None if they are none."""
    _, _, fields = text.partition(b";")
    cells = fields.split(b",")
    extended = kind.endswith("X")
    if len(cells) != 9 + 2 * extended:
        return None
    try:
        head = [int(cells[0], 16), _number(cells[1])] if extended else []
        week, seconds, status = cells[len(head) : len(head) + 3]
        counts = [int(cell) for cell in cells[-6:]]
        row = (*head, int(week), float(seconds), int(status, 16), *counts)
        return (_EXTENDED_PACK if extended else _PLAIN_PACK)(*row)
    except (ValueError, struct.error, UnicodeDecodeError):
        return None


def _number(cell: bytes) -> int:
    name = cell.decode("ascii")
    return IMU_TYPES[name].number if name in IMU_TYPES else int(name)
