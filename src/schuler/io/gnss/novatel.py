"""NovAtel: BESTPOS, BESTGNSSPOS, BESTVEL, BESTGNSSVEL, INSPVA, INSPVAS and INSPVAX, both forms.

Positions and velocities of the antenna are messages of their own, joined where they are of one
instant; INSPVA and INSPVAX are the solution of the receiver's own filter at its IMU or output
point. BESTPOS and INSPVAX have the height above the geoid with the geoid's own height, INSPVA that
above the ellipsoid (OEM7 documentation, logs 42, 99, 507, 508, 1429, 1430, 1465). Times are those
of the header (BEST...) or the body (INSPVA), in the GPS week.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io.gnss.table import (
    WEEK,
    FixTable,
    GnssOptions,
    as_columns,
    drop_rows,
    matched,
)
from schuler.io.named_table import read_bytes
from schuler.io.novatel_frames import SYNC, crc, frame_at, sound

__all__ = ["NovatelFixReader"]


@dataclass(frozen=True)
class _Message:
    """A message's body: its layout, and the numbers of the fields that are taken."""

    name: str
    body: struct.Struct
    #: name -> place among the fields, the same in both forms
    fields: dict[str, int]


_POSITION = {"status": 0, "kind": 1, "lat": 2, "lon": 3, "height": 4, "separation": 5, "sdn": 7,
             "sde": 8, "sdu": 9}  # fmt: skip
_VELOCITY = {"status": 0, "kind": 1, "latency": 2, "speed": 4, "course": 5, "vu": 6}
_BESTPOS = struct.Struct("<II3dfI3f4s2f8B")
_BESTVEL = struct.Struct("<II2f3df")
_INSPVA = struct.Struct("<Id9dI")
_PVA = {"week": 0, "t": 1, "lat": 2, "lon": 3, "height": 4, "vn": 5, "ve": 6, "vu": 7, "status": 11}
_INSPVAX = struct.Struct("<II3df6d9fIH")
_PVAX = {"status": 0, "kind": 1, "lat": 2, "lon": 3, "height": 4, "separation": 5, "vn": 6, "ve": 7,
         "vu": 8, "sdn": 12, "sde": 13, "sdu": 14, "sdvn": 15, "sdve": 16, "sdvu": 17}  # fmt: skip

_MESSAGES = {
    42: _Message("BESTPOS", _BESTPOS, _POSITION),
    1429: _Message("BESTGNSSPOS", _BESTPOS, _POSITION),
    99: _Message("BESTVEL", _BESTVEL, _VELOCITY),
    1430: _Message("BESTGNSSVEL", _BESTVEL, _VELOCITY),
    507: _Message("INSPVA", _INSPVA, _PVA),
    508: _Message("INSPVAS", _INSPVA, _PVA),
    1465: _Message("INSPVAX", _INSPVAX, _PVAX),
}
_BY_NAME = {message.name: message for message in _MESSAGES.values()}
#: positions in the order in which they are taken, each with the velocities that belong to it
_CHOICE = (
    ("BESTGNSSPOS", ("BESTGNSSVEL", "BESTVEL")), ("BESTPOS", ("BESTVEL", "BESTGNSSVEL")),
    ("INSPVAX", ()), ("INSPVA", ()), ("INSPVAS", ()),
)  # fmt: skip
_ASCII = re.compile(
    rb"[#%](" + "|".join(_BY_NAME).encode() + rb")A,([^*#%\r\n]{1,1000})\*([0-9a-fA-F]{8})"
)
_RAW_IDS = (268, 325, 1461, 1462)

#: words of an ASCII message -> numbers of a binary one, as far as they matter
_STATUS = {"SOL_COMPUTED": 0}
_INS_STATUS = {"INS_INACTIVE": 0, "INS_ALIGNING": 1, "INS_HIGH_VARIANCE": 2,
               "INS_SOLUTION_GOOD": 3, "INS_SOLUTION_FREE": 6, "INS_ALIGNMENT_COMPLETE": 7,
               "DETERMINING_ORIENTATION": 8, "WAITING_INITIALPOS": 9}  # fmt: skip
_KINDS = {
    "NONE": 0, "FIXEDPOS": 1, "FIXEDHEIGHT": 2, "DOPPLER_VELOCITY": 8, "SINGLE": 16,
    "PSRDIFF": 17, "WAAS": 18, "PROPAGATED": 19, "L1_FLOAT": 32, "NARROW_FLOAT": 34, "L1_INT": 48,
    "WIDE_INT": 49, "NARROW_INT": 50, "RTK_DIRECT_INS": 51, "INS_SBAS": 52, "INS_PSRSP": 53,
    "INS_PSRDIFF": 54, "INS_RTKFLOAT": 55, "INS_RTKFIXED": 56, "PPP_CONVERGING": 68, "PPP": 69,
    "INS_PPP_CONVERGING": 73, "INS_PPP": 74, "PPP_BASIC_CONVERGING": 77, "PPP_BASIC": 78,
    "INS_PPP_BASIC_CONVERGING": 79, "INS_PPP_BASIC": 80,
}  # fmt: skip
#: kinds that are no measurement of satellites
_NO_FIX = (0, 1, 2, 8, 19)
#: kind of a position -> quality as RTKLIB; kinds that are newer than this table count as single
_QUALITY = {
    **dict.fromkeys((48, 49, 50, 51, 56), 1),
    **dict.fromkeys((32, 33, 34, 55, 68, 73, 77, 79), 2),
    **dict.fromkeys((17, 18, 52, 54, 69, 74, 78, 80), 4),
}
_SINGLE, _UNKNOWN = 5, 999
_INS_GOOD = (3, 6, 7)


class NovatelFixReader:
    """Reader of NovAtel's positions and velocities."""

    name = "novatel"

    def sniff(self, head: bytes) -> bool:
        """Say whether one of the messages is there, its checksum right."""
        return next(_messages(head), None) is not None

    def alone(self, path: Path) -> bool:
        """Say whether no raw IMU message is near the beginning."""
        with path.open("rb") as file:
            head = file.read(1 << 20)
        if b"RAWIMU" in head:
            return False
        at = -1
        while (at := head.find(SYNC, at + 1)) >= 0:
            size, number, _ = frame_at(head, at)
            if number in _RAW_IDS and 0 < size <= len(head) - at and sound(head[at : at + size]):
                return False
        return True

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the positions, with the velocities of the same instants."""
        found: dict[str, list[tuple[Any, ...]]] = {}
        for name, week, seconds, values in _messages(read_bytes(path)):
            found.setdefault(name, []).append((week, seconds, *values))
        kinds = [name for name, _ in _CHOICE if name in found]
        if options.topic is not None:
            if options.topic.upper() not in kinds:
                raise InputError(
                    f"there are no messages '{options.topic}'; of positions it has "
                    f"{', '.join(kinds) or 'none'}"
                )
            kinds = [options.topic.upper()]
        if not kinds:
            raise InputError(f"has no whole message of {', '.join(name for name, _ in _CHOICE)}")
        kind = kinds[0]
        week = int(found[kind][0][0])
        dropped: dict[str, int] = {}
        table = FixTable({}, "gps-week", f"GPS week {week}", "geoid", dropped)
        c = _columns(found[kind], kind, week)
        if kind.startswith("INSPVA"):
            good = np.isin(c["status"], _INS_GOOD)
            if kind != "INSPVAX":
                table.above = "ellipsoid"
        else:
            good = c["status"] == 0.0
        c = drop_rows(c, good, "a solution that the receiver does not call computed", dropped)
        if "kind" in c:
            there = ~np.isin(c["kind"], _NO_FIX)
            c = drop_rows(c, there, "a solution that is no fix of satellites", dropped)
            c["quality"] = np.array([float(_QUALITY.get(int(k), _SINGLE)) for k in c["kind"]])
        for name in next(names for which, names in _CHOICE if which == kind):
            if name in found:
                v = _columns(found[name], name, week)
                v = drop_rows(v, v["status"] == 0.0, "a velocity that is not computed", {})
                v["ve"] = v["speed"] * np.sin(v["course"])
                v["vn"] = v["speed"] * np.cos(v["course"])
                c = matched(c, v["t"], v, ("ve", "vn", "vu"), dropped)
                if len(v["t"]) and np.max(v["latency"]) > 0.0:
                    table.notes.append(
                        f"{name} says that its velocities are {np.median(v['latency']):.3g} s "
                        "older than their stamps: estimate the delay"
                    )
                break
        keep = ("t", "lat", "lon", "height", "separation", "ve", "vn", "vu", "sde", "sdn", "sdu",
                "sdve", "sdvn", "sdvu", "quality")  # fmt: skip
        table.columns = {name: c[name] for name in keep if name in c}
        return table


def _columns(rows: list[tuple[Any, ...]], kind: str, week: int) -> dict[str, np.ndarray]:
    fields = _BY_NAME[kind].fields
    names = ("week_", "seconds_", *fields)
    c = as_columns([(r[0], r[1], *r[2:]) for r in rows], names)
    if "week" in c:
        c["week_"], c["seconds_"] = c["week"], c["t"]
    c["t"] = c["seconds_"] + WEEK * (c["week_"] - week)
    for name in ("lat", "lon", "course"):
        if name in c:
            c[name] = c[name] * DEG
    return c


def _messages(data: bytes) -> Iterator[tuple[str, int, float, list[Any]]]:
    """Yield kind, week, seconds and the fields that are taken of each sound message."""
    at = -1
    while (at := data.find(SYNC, at + 1)) >= 0:
        size, number, begin = frame_at(data, at)
        message = _MESSAGES.get(number)
        # Newer firmware may append fields.
        if message is None or not 0 < size <= len(data) - at or size > 512:
            continue
        if size - begin - 4 < message.body.size or not sound(data[at : at + size]):
            continue
        fields = message.body.unpack_from(data, at + begin)
        place = at + (6 if data[at + 2] == 0x13 else 14)
        week, milliseconds = struct.unpack_from("<HI", data, place)
        values = [fields[k] for k in message.fields.values()]
        yield message.name, week, 1e-3 * milliseconds, values
    for match in _ASCII.finditer(data):
        if crc(data[match.start() + 1 : match.end() - 9]) == int(match[3], 16):
            found = _ascii(match[1].decode(), match[2])
            if found is not None:
                yield found


def _ascii(kind: str, text: bytes) -> tuple[str, int, float, list[Any]] | None:
    """Return the same of an ASCII message; None if its fields are none."""
    head, _, body = text.decode("latin-1").partition(";")
    cells, fields = head.split(","), body.split(",")
    message = _BY_NAME[kind]
    try:
        # A short header is the week and the second, a long one has them fifth and sixth.
        week, seconds = (cells[0], cells[1]) if len(cells) == 2 else (cells[4], cells[5])
        values = [_value(name, fields[k], kind) for name, k in message.fields.items()]
        return kind, int(week), float(seconds), values
    except (ValueError, IndexError):
        return None


def _value(name: str, cell: str, kind: str) -> float:
    if name == "status":
        if kind.startswith("INSPVA"):
            return float(_INS_STATUS.get(cell, 0))
        return float(_STATUS.get(cell, 1))
    if name == "kind":
        return float(_KINDS.get(cell, _UNKNOWN))
    return float(cell)
