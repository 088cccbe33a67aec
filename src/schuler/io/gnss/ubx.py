"""u-blox UBX: NAV-PVT messages, decoded by pyubx2.

NAV-PVT (class 1, message 7) has position, both heights, velocity north, east, down, the 1-sigma of
each, and the time of the GPS week of the navigation epoch.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from schuler.constants import DEG
from schuler.errors import InputError, how_to_install
from schuler.io.gnss.nmea import NmeaReader
from schuler.io.gnss.table import (
    WEEK,
    FixTable,
    GnssOptions,
    as_columns,
    drop_rows,
    unwrapped,
)
from schuler.io.named_table import read_bytes

__all__ = ["UbxReader"]

_SYNC = b"\xb5\x62"
_PVT = _SYNC + b"\x01\x07"
_HEADER = 6
_LENGTHS = (84, 92)
_NAMES = ("t", "lat", "lon", "height", "above_sea", "vn", "ve", "vd", "sdh", "sdu", "sdv", "valid",
          "quality")  # fmt: skip


class UbxReader:
    """Reader of u-blox' binary messages."""

    name = "ubx"

    def sniff(self, head: bytes) -> bool:
        """Say whether a NAV-PVT message is there, or UBX and no NMEA beside it."""
        if next(_frames(head, _PVT), None) is not None:
            return True
        return next(_frames(head, _SYNC), None) is not None and not NmeaReader().sniff(head)

    def alone(self, path: Path) -> bool:
        """Say that NAV-PVT is no record of an IMU."""
        return True

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the NAV-PVT messages."""
        try:
            from pyubx2 import UBXReader
        except ImportError:
            raise InputError(
                f"is u-blox UBX, which needs pyubx2: {how_to_install('ubx')}"
            ) from None
        data = read_bytes(path)
        rows: list[list[Any]] = []
        dropped: dict[str, int] = {}
        date = ""
        good = 0
        for frame in _frames(data, _PVT):
            try:
                m = UBXReader.parse(frame)
                valid = m.gnssFixOk and m.fixType in (3, 4)
                quality = {2: 1, 1: 2}.get(int(m.carrSoln), 4 if m.diffSoln else 5)
                rows.append([
                    1e-3 * m.iTOW, DEG * m.lat, DEG * m.lon, 1e-3 * m.height, 1e-3 * m.hMSL,
                    1e-3 * m.velN, 1e-3 * m.velE, 1e-3 * m.velD, 1e-3 * m.hAcc, 1e-3 * m.vAcc,
                    1e-3 * m.sAcc, float(valid), float(quality),
                ])  # fmt: skip
            except Exception:  # pyubx2 lets many kinds escape from what cannot be decoded
                continue
            good += 1
            if not date and m.validDate:
                date = f"the GPS week of {m.year:04d}-{m.month:02d}-{m.day:02d}"
        if not rows:
            raise InputError("has no whole NAV-PVT message; log UBX-NAV-PVT on the receiver")
        damaged = data.count(_PVT) - good
        if damaged > 0:
            dropped["a wrong checksum or length"] = damaged
        c = as_columns(rows, _NAMES)
        c["t"] = unwrapped(c["t"], WEEK)
        c = drop_rows(c, c["valid"] > 0.0, "no fix in three dimensions", dropped)
        # What u-blox calls accuracy is not said to be of an axis or of the whole vector: the
        # larger reading, of each axis, is safe.
        columns = {
            "t": c["t"], "lat": c["lat"], "lon": c["lon"], "height": c["height"],
            "separation": c["height"] - c["above_sea"], "ve": c["ve"], "vn": c["vn"],
            "vu": -c["vd"], "sde": c["sdh"], "sdn": c["sdh"], "sdu": c["sdu"],
            "sdve": c["sdv"], "sdvn": c["sdv"], "sdvu": c["sdv"],
            "quality": c["quality"],
        }  # fmt: skip
        return FixTable(columns, "gps-week", date, "ellipsoid", dropped)


def _frames(data: bytes, mark: bytes) -> Any:
    """Yield whole frames that begin with a mark, their checksum right."""
    at = 0
    while (at := data.find(mark, at)) >= 0:
        length = int.from_bytes(data[at + 4 : at + 6], "little")
        end = at + _HEADER + length + 2
        wanted = length in _LENGTHS if mark == _PVT else length <= 1024
        if wanted and end <= len(data) and _sum(data[at + 2 : end - 2]) == data[end - 2 : end]:
            yield data[at:end]
            at = end
        else:
            at += 1


def _sum(data: bytes) -> bytes:
    """Return Fletcher's checksum of two bytes."""
    a = b = 0
    for byte in data:
        a = (a + byte) & 255
        b = (b + a) & 255
    return bytes((a, b))
