"""NMEA 0183: GGA, RMC, VTG, GST and HDT sentences, decoded by pynmeagps.

GGA has the position, its quality, the height above the geoid and the geoid's height above the
ellipsoid; RMC has speed, course and the date; VTG speed and course, GST the 1-sigma of a position,
HDT the heading of a dual antenna. Times are seconds of the UTC day. VTG and HDT have no time: they
belong to the sentence with a time before them.
"""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError, how_to_install
from schuler.io.gnss.table import (
    DAY,
    FixTable,
    GnssOptions,
    as_columns,
    drop_rows,
    unwrapped,
)
from schuler.io.named_table import read_bytes

__all__ = [
    "SENTENCE",
    "SLOW",
    "NmeaReader",
    "need_pynmeagps",
    "parsed",
    "read_nmea_headings",
    "sound",
]

SENTENCE = re.compile(rb"\$[A-Z]{2}(GGA|RMC|VTG|GST|HDT),[ -#%-)+-~]{0,120}\*[0-9A-Fa-f]{2}")
_BEGIN = re.compile(rb"\$[A-Z]{2}(?:GGA|RMC|VTG|GST|HDT),")
_KNOT = 1852.0 / 3600.0
SLOW = 0.5
"""Speed (m/s) below which a receiver need not say a course."""

#: quality of GGA -> that of RTKLIB; what is missing is no fix
_QUALITY = {1: 5, 2: 4, 3: 5, 4: 1, 5: 2, 8: 5, 9: 4}


class NmeaReader:
    """Reader of NMEA 0183."""

    name = "nmea"

    def sniff(self, head: bytes) -> bool:
        """Say whether a whole sentence is there, its checksum right."""
        return any(sound(match[0]) for match in SENTENCE.finditer(head))

    def alone(self, path: Path) -> bool:
        """Say that NMEA holds no record of an IMU."""
        return True

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read positions with what belongs to them."""
        epochs, damaged, date = _epochs(read_bytes(path))
        rows = [each for each in epochs if "lat" in each]
        if not rows:
            raise InputError(
                "its NMEA sentences have no GGA: without one there is no height; log GGA as well"
            )
        names = ("t", "lat", "lon", "height", "separation", "quality", "speed", "course", "sde",
                 "sdn", "sdu")  # fmt: skip
        columns = as_columns([[each.get(name) for name in names] for each in rows], names)
        columns["t"] = unwrapped(columns["t"], DAY)
        dropped: dict[str, int] = {}
        if damaged:
            dropped["a wrong checksum or a sentence that cannot be decoded"] = damaged
        columns = drop_rows(columns, columns["quality"] > 0.0, "no fix (quality of GGA)", dropped)
        speed, course = columns["speed"], columns["course"]
        columns["course"] = np.where(np.isnan(course) & (speed < SLOW), 0.0, course)
        moving = np.isfinite(speed) & np.isfinite(columns["course"])
        if 2 * np.sum(moving) < len(moving):
            del columns["speed"], columns["course"]
        else:
            columns = drop_rows(columns, moving, "a position without speed and course", dropped)
        if not np.all(np.isfinite(columns["sdu"])):
            for name in ("sde", "sdn", "sdu"):
                del columns[name]
        missing = np.isnan(columns["separation"])
        if len(missing) and np.all(missing):
            del columns["separation"]
        return FixTable(
            columns, "utc-day", "" if date is None else f"{date:%Y-%m-%d}", "geoid", dropped
        )


def read_nmea_headings(data: bytes) -> tuple[dict[str, Any], str, dict[str, int]]:
    """Return time (s of the UTC day) and heading (rad) of HDT sentences, the date, what was lost.

    Raises
    ------
    InputError
        If pynmeagps is missing, or there are none.
    """
    epochs, damaged, date = _epochs(data)
    rows = [(each["t"], each["heading"]) for each in epochs if "heading" in each]
    if not rows:
        raise InputError("its NMEA sentences have no heading (HDT) after one with a time")
    columns = as_columns(rows, ("t", "heading"))
    columns["t"] = unwrapped(columns["t"], DAY)
    lost = {"a wrong checksum or a sentence that cannot be decoded": damaged} if damaged else {}
    return columns, "" if date is None else f"{date:%Y-%m-%d}", lost


def need_pynmeagps() -> None:
    """Refuse to read NMEA without the package that decodes it.

    Raises
    ------
    InputError
        Saying how it is installed.
    """
    try:
        import pynmeagps  # noqa: F401
    except ImportError:
        raise InputError(f"is NMEA, which needs pynmeagps: {how_to_install('nmea')}") from None


def parsed(sentence: bytes, kind: bytes) -> tuple[dict[str, Any] | None, dt.date | None] | None:
    """Return what a sentence says, and its date; None where it cannot be decoded.

    Parameters
    ----------
    sentence : bytes
        Whole, its checksum right, without a line end.
    kind : bytes
        As ``GGA``.
    """
    from pynmeagps import NMEAReader

    try:
        message = NMEAReader.parse(sentence + b"\r\n")
        said = _said(kind, message)
    except Exception:  # a sentence with a right checksum may hold anything
        return None
    day = message.date if kind == b"RMC" and isinstance(message.date, dt.date) else None
    return said, day


def _epochs(data: bytes) -> tuple[list[dict[str, Any]], int, dt.date | None]:
    """Return what the sentences of each instant say, how many are damaged, and the first date."""
    need_pynmeagps()
    epochs: list[dict[str, Any]] = []
    now: dict[str, Any] = {}
    date: dt.date | None = None
    good = 0
    for match in SENTENCE.finditer(data):
        found = parsed(match[0], match[1]) if sound(match[0]) else None
        if found is None:
            continue
        said, day = found
        good += 1
        date = date or day
        if said is None:
            continue
        time = said.pop("t", None)
        if time is not None and time != now.get("t"):
            now = {"t": time}
            epochs.append(now)
        if now:
            for name, value in said.items():
                # RMC goes before VTG, which a receiver may send late.
                now.setdefault(name, value)
    return epochs, sum(1 for _ in _BEGIN.finditer(data)) - good, date


def _said(kind: bytes, message: Any) -> dict[str, Any] | None:
    """Return what a sentence says, in SI; None where it has no time that it should have."""
    if kind == b"VTG":
        said = {"speed": _scaled(message.sogn, _KNOT), "course": _scaled(message.cogt, DEG)}
        if said["speed"] is None:
            said["speed"] = _scaled(message.sogk, 1.0 / 3.6)
        return said
    if kind == b"HDT":
        heading = _scaled(message.headingT, DEG)
        return None if heading is None else {"heading": heading}
    if not isinstance(message.time, dt.time):
        return None
    t = message.time
    said = {"t": 3600.0 * t.hour + 60.0 * t.minute + t.second + 1e-6 * t.microsecond}
    if kind == b"RMC":
        if message.status == "A":
            said |= {"speed": _scaled(message.spd, _KNOT), "course": _scaled(message.cog, DEG)}
    elif kind == b"GST":
        said |= {"sde": message.stdLong, "sdn": message.stdLat, "sdu": message.stdAlt}
    else:
        said |= {
            "lat": _scaled(message.lat, DEG), "lon": _scaled(message.lon, DEG),
            "height": message.alt, "separation": message.sep,
            "quality": _QUALITY.get(int(message.quality or 0), 0),
        }  # fmt: skip
    return said


def _scaled(value: Any, factor: float) -> float | None:
    return None if value in ("", None) else factor * float(value)


def sound(sentence: bytes) -> bool:
    """Say whether the checksum of a sentence is right."""
    total = 0
    for byte in sentence[1:-3]:
        total ^= byte
    return total == int(sentence[-2:], 16)
