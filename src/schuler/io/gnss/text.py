"""Texts and tables of fixes: RTKLIB's ``.pos``, the text of KF-GINS, columns with names."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError, shown
from schuler.io.gnss.table import DAY, WEEK, Array, FixTable, GnssOptions
from schuler.io.named_table import (
    column_names,
    csv_columns,
    first_names,
    named_columns,
    parquet_columns,
    read_bytes,
    text_lines,
)

__all__ = ["KfGinsFixReader", "NamedFixReader", "RtklibReader", "read_velocity"]

#: plain column name -> what it is
_GNSS = {
    **dict.fromkeys(("t", "time", "timestamp", "seconds", "gpst", "sow", "tow"), "t"),
    **dict.fromkeys(("lat", "latitude"), "lat"),
    **dict.fromkeys(("lon", "longitude", "long", "lng"), "lon"),
    **dict.fromkeys(("height", "alt", "altitude", "h"), "height"),
    **dict.fromkeys(("ellipsoidalheight", "heightellipsoid", "altellipsoid", "hae"), "height"),
    **dict.fromkeys(
        ("hmsl", "altmsl", "altitudemsl", "heightmsl", "msl", "orthometricheight"), "above_sea"
    ),
    **dict.fromkeys(("separation", "undulation", "geoidheight", "geoidseparation"), "separation"),
    **dict.fromkeys(("ve", "veast", "vele", "vx"), "ve"),
    **dict.fromkeys(("vn", "vnorth", "veln", "vy"), "vn"),
    **dict.fromkeys(("vu", "vup", "velu", "vz"), "vu"),
    **dict.fromkeys(("vd", "vdown", "veld"), "vd"),
    **dict.fromkeys(("speed", "groundspeed", "sog"), "speed"),
    **dict.fromkeys(("course", "bearing", "cog", "track"), "course"),
    **dict.fromkeys(("sde", "stde", "sigmae", "sdeast"), "sde"),
    **dict.fromkeys(("sdn", "stdn", "sigman", "sdnorth"), "sdn"),
    **dict.fromkeys(("sdu", "stdu", "sigmau", "sdup"), "sdu"),
    **dict.fromkeys(("sdve", "stdve", "sigmave"), "sdve"),
    **dict.fromkeys(("sdvn", "stdvn", "sigmavn"), "sdvn"),
    **dict.fromkeys(("sdvu", "stdvu", "sigmavu"), "sdvu"),
    **dict.fromkeys(("quality", "q", "fix", "fixtype"), "quality"),
}

_ELLIPSOID = ("ellipsoidalheight", "heightellipsoid", "altellipsoid", "hae")
_CLOCKS = {"sow": "gps-week", "tow": "gps-week", "gpst": "gps-week"}
_KFGINS = ("t", "lat", "lon", "height", "sdn", "sde", "sdu", "vn", "ve", "vd", "sdvn", "sdve",
           "sdvu")  # fmt: skip
_NEAR = 2.0
"""Latitudes and longitudes of one file are within so many degrees; increments are not a place."""


_RTKLIB_NAMES = re.compile(rb"%.*\blatitude\(.*\bQ\b")


class RtklibReader:
    """Reader of RTKLIB's solutions in latitude, longitude and height."""

    name = "rtklib"

    def sniff(self, head: bytes) -> bool:
        """Say whether a comment names the columns.

        PSINS' comments have a latitude, too: that at which a record begins.
        """
        lines = head.splitlines()[:80]
        return any(_RTKLIB_NAMES.match(line) for line in lines)

    def alone(self, path: Path) -> bool:
        """Say that a solution is no record of an IMU."""
        return True

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the solutions."""
        lines = text_lines(read_bytes(path))
        comments = " ".join(line for line in lines if line.startswith("%"))
        above = "unstated"
        for word, found in (("ellipsoidal", "ellipsoid"), ("geodetic", "geoid")):
            if word in comments:
                above = found
        columns, day = _rtklib(lines)
        # Without a word of UTC or JST, RTKLIB's times are GPS time.
        clock = "utc-week" if "UTC" in comments else "gps-week"
        return FixTable(columns, clock, day, above)


class KfGinsFixReader:
    """Reader of the text of KF-GINS: numbers without names, angles in deg."""

    name = "kf-gins"

    def sniff(self, head: bytes) -> bool:
        """Say whether rows of numbers are places with positive sigma."""
        rows = []
        for line in head.splitlines()[:-1] or head.splitlines():
            try:
                row = [float(cell) for cell in line.replace(b",", b" ").split()]
            except ValueError:
                return False
            if row:
                rows.append(row)
        if not rows or len({len(row) for row in rows}) > 1 or len(rows[0]) not in (7, 10, 13):
            return False
        table = np.array(rows)
        lat, lon = table[:, 1], table[:, 2]
        return bool(
            np.all(np.isfinite(table)) and np.all(np.abs(lat) <= 90.0)
            and np.all(np.abs(lon) <= 360.0) and np.ptp(lat) < _NEAR and np.ptp(lon) < _NEAR
            and max(np.abs(lat).max(), np.abs(lon).max()) > 2.0 * _NEAR
            and np.all(table[:, 4:7] > 0.0)
        )  # fmt: skip

    def alone(self, path: Path) -> bool:
        """Say that such a text is no record of an IMU."""
        return True

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the rows."""
        lines = text_lines(read_bytes(path))
        rows = [_numbers(line, number) for number, line in enumerate(lines, 1)]
        widths = {len(row) for row in rows}
        if len(widths) > 1:
            raise InputError(f"its rows have {min(widths)} to {max(widths)} numbers: it may be cut")
        table = np.array(rows)
        if table.shape[1] not in (7, 10, 13):
            raise InputError(
                f"{table.shape[1]} numbers a row without names: KF-GINS has 7, 10 or 13 "
                "(time, latitude, longitude, height, their sigma, velocity, its sigma)"
            )
        out = {name: table[:, k] for k, name in enumerate(_KFGINS[: table.shape[1]])}
        out["lat"], out["lon"] = out["lat"] * DEG, out["lon"] * DEG
        return FixTable(_upward(out), "gps-week", "", "ellipsoid")


class NamedFixReader:
    """Reader of CSV and Parquet with named columns, tables of pyins among them."""

    name = "table"

    def sniff(self, head: bytes) -> bool:
        """Say whether it is Parquet, or the first row names a latitude and a longitude."""
        if head.startswith(b"PAR1"):
            return True
        return b"\0" not in head and {"lat", "lon"} <= {_GNSS.get(x) for x in first_names(head)}

    def alone(self, path: Path) -> bool:
        """Say whether its columns are fixes, and none is a gyro's."""
        if _is_parquet(path):
            plain = column_names(path)
        else:
            with path.open("rb") as file:
                plain = first_names(file.read(1 << 16))
        attitude = {"roll", "pitch", "yaw", "heading", "qw"}
        return {"lat", "lon"} <= {_GNSS.get(name) for name in plain} and not any(
            name in attitude or name.startswith(("gyr", "gx", "wx", "acc", "ax")) for name in plain
        )

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the columns that are known by name."""
        raw = parquet_columns(path) if _is_parquet(path) else csv_columns(
            text_lines(read_bytes(path))
        )  # fmt: skip
        plain = first_names(",".join(raw).encode())
        columns = named_columns(raw, _GNSS)
        clock = next((_CLOCKS[name] for name in plain if name in _CLOCKS), "unstated")
        above = "ellipsoid" if any(name in _ELLIPSOID for name in plain) else "unstated"
        sea = columns.pop("above_sea", None)
        if sea is not None and "height" not in columns:
            columns["height"], above = sea, "geoid"
        elif sea is not None:
            columns["separation"], above = columns["height"] - sea, "ellipsoid"
        return FixTable(_upward(columns), clock, "", above)


def read_velocity(path: Path) -> dict[str, Array]:
    """Return time and velocity of a table that has them by name, as pyins keeps them apart.

    Raises
    ------
    InputError
        If it lacks one of them.
    """
    raw = parquet_columns(path) if _is_parquet(path) else csv_columns(text_lines(read_bytes(path)))
    columns = _upward(named_columns(raw, _GNSS))
    missing = [name for name in ("t", "ve", "vn") if name not in columns]
    if missing:
        raise InputError(f"velocities need time, east and north; {', '.join(missing)} not found")
    columns.setdefault("vu", np.zeros_like(columns["t"]))
    return columns


def _upward(columns: dict[str, Array]) -> dict[str, Array]:
    if "vd" in columns:
        down = columns.pop("vd")
        columns.setdefault("vu", -down)
    return columns


def _is_parquet(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) == b"PAR1"


def _numbers(line: str, number: int) -> list[float]:
    try:
        return [float(cell) for cell in line.replace(",", " ").split()]
    except ValueError:
        raise InputError(f"line {number}: '{shown(line[:60])}' holds what is no number") from None


def _rtklib(lines: Sequence[str]) -> tuple[dict[str, Array], str]:
    """Return the columns of RTKLIB's solution text, angles in rad, and the week they count in."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if line.startswith("%"):
            continue
        cells = line.replace(",", " ").split()
        if "/" in cells[0] and len(cells) > 1:
            week, time = _seconds(cells[0], cells[1], number)
        else:
            numbers = _numbers(" ".join(cells[:2]), number)
            week, time = numbers[0], numbers[-1]
        rows.append([week, time, *_numbers(" ".join(cells[2:]), number)])
    widths = {len(row) for row in rows}
    if not rows or len(widths) > 1 or min(widths) < 10:
        raise InputError("its rows are no solutions of RTKLIB in latitude, longitude and height")
    table = np.array(rows)
    week = table[0, 0]
    with np.errstate(invalid="ignore", over="ignore"):
        table[:, 1] += WEEK * (table[:, 0] - week)
    table = table[:, 1:]
    names = ["t", "lat", "lon", "height", "quality", "", "sdn", "sde", "sdu"]
    if table.shape[1] >= 17:
        names += ["", "", "", "", "", "vn", "ve", "vu"]
    if table.shape[1] >= 20:
        names += ["sdvn", "sdve", "sdvu"]
    out = {name: table[:, k] for k, name in enumerate(names) if name}
    out["lat"], out["lon"] = out["lat"] * DEG, out["lon"] * DEG
    return out, f"week {week:.0f}"


def _seconds(day: str, clock: str, number: int) -> tuple[float, float]:
    """Return the week since 6 January 1980 of a calendar date, and the second in it."""
    try:
        year, month, date = (int(part) for part in day.split("/"))
        hour, minute, second = clock.split(":")
        days = (dt.date(year, month, date) - dt.date(1980, 1, 6)).days
        within = 3600.0 * int(hour) + 60.0 * int(minute) + float(second)
        return float(days // 7), DAY * (days % 7) + within
    except ValueError:
        raise InputError(f"line {number}: '{shown(day)} {shown(clock)}' is no date") from None
