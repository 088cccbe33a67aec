"""Reading what else was measured: GNSS fixes and speeds, from tables with names and known texts."""

from __future__ import annotations

import csv
import datetime as dt
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._arrow import numbers
from schuler.aiding import BodySpeed, GnssFixes
from schuler.constants import DEG
from schuler.errors import InputError, shown
from schuler.io.names import split_unit
from schuler.io.sealed import read_sealed
from schuler.io.spool import Spooled, is_pipe, ordinary
from schuler.units import parse_factor

__all__ = ["read_gnss", "read_speed"]

Array = NDArray[np.float64]
Table = dict[str, Array]

_MOST_BYTES = 400_000_000

#: plain column name -> what it is
_GNSS = {
    **dict.fromkeys(("t", "time", "timestamp", "seconds", "gpst", "sow", "tow"), "t"),
    **dict.fromkeys(("lat", "latitude"), "lat"),
    **dict.fromkeys(("lon", "longitude", "long", "lng"), "lon"),
    **dict.fromkeys(("height", "alt", "altitude", "h", "ellipsoidalheight", "hae"), "height"),
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
_SPEED = {
    **dict.fromkeys(("t", "time", "timestamp", "seconds"), "t"),
    **dict.fromkeys(
        ("speed", "v", "velocity", "odometer", "wheelspeed", "canspeed", "forwardspeed"), "speed"
    ),
    **dict.fromkeys(("vx", "vright"), "right"),
    **dict.fromkeys(("vy", "vforward"), "forward"),
    **dict.fromkeys(("vz", "vup"), "up"),
    **dict.fromkeys(("sd", "sigma"), "sd"),
}
_DIMENSIONS = {
    "t": "time",
    "lat": "angle",
    "lon": "angle",
    "course": "angle",
    "height": "length",
    **dict.fromkeys(("ve", "vn", "vu", "vd", "speed", "right", "forward", "up"), "speed"),
    **dict.fromkeys(("sde", "sdn", "sdu"), "length"),
    **dict.fromkeys(("sdve", "sdvn", "sdvu", "sd"), "speed"),
}
_FACTORS = {
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kph": 1.0 / 3.6, "kn": 1852.0 / 3600.0,
              "knots": 1852.0 / 3600.0, "mph": 0.44704},
    "length": {"m": 1.0, "km": 1000.0, "mm": 1e-3, "cm": 1e-2, "ft": 0.3048},
}  # fmt: skip
_RTK, _ON_A_VEHICLE = 0.02, 2.0
"""What a receiver says of a position below so many metres is too small for a moving antenna."""

_SCALE_BY_QUALITY = {1: 1.0, 2: 10.0, 4: 20.0, 5: 50.0}
"""Sigma of a fix by RTKLIB's quality, relative to a fixed one, where the file has none."""


def read_gnss(
    path: str | Path,
    *,
    lever: ArrayLike = (0.0, 0.0, 0.0),
    delay: float = 0.0,
    estimate: Sequence[str] = (),
    sigma: float | None = None,
    v_sigma: float | None = None,
    height: str | None = None,
    name: str = "gnss",
) -> GnssFixes:
    """Read GNSS fixes.

    Known are CSV and Parquet with named columns (time, lat, lon, height; ve, vn, vu or vd; speed
    and course; sd_e ...; quality; units in brackets or behind the name), RTKLIB's ``.pos``, and the
    text of KF-GINS (seconds, latitude, longitude, height, sigma north, east, down; then velocity
    north, east, down and its sigma).

    Parameters
    ----------
    path : str or Path
    lever, delay, estimate, name
        As of `GnssFixes`.
    sigma, v_sigma : float, optional
        1-sigma of position (m) and velocity (m/s) where the file has none; 3 and 0.1.
    height : {"ellipsoid", "geoid"}, optional
        What the heights are above. "geoid" is refused: its height above the ellipsoid is not known
        here.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or position.
    """
    path = Path(path)
    try:
        if height not in (None, "ellipsoid", "geoid"):
            raise InputError(f"height must be ellipsoid or geoid, got '{height}'")
        if height == "geoid":
            raise InputError(
                "heights above the geoid need its height above the ellipsoid, which is not known "
                "here: add it to the column, and say ellipsoid"
            )
        table = _table(path, _GNSS)
        missing = [key for key in ("t", "lat", "lon", "height") if key not in table]
        if missing:
            raise InputError(
                f"GNSS fixes need time, latitude, longitude and height; {', '.join(missing)} "
                "not found among its columns"
            )
        return _fixes(table, sigma, v_sigma, lever, delay, tuple(estimate), name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _fixes(
    table: Table, sigma: float | None, v_sigma: float | None, lever: ArrayLike, delay: float,
    estimate: tuple[str, ...], name: str,
) -> GnssFixes:  # fmt: skip
    quality = table.get("quality")
    if {"sde", "sdn", "sdu"} <= set(table) and sigma is None:
        spread = np.column_stack([table["sde"], table["sdn"], table["sdu"]])
        spread = np.where((spread > 0.0) & (spread < _RTK), _ON_A_VEHICLE * spread, spread)
    else:
        factor = np.ones(len(table["t"]))
        if quality is not None:
            factor = np.array([_SCALE_BY_QUALITY.get(int(q), 50.0) for q in np.nan_to_num(quality)])
        spread = np.repeat((3.0 if sigma is None else sigma) * factor[:, None], 3, axis=1)
    v_n = None
    if {"ve", "vn"} <= set(table):
        up = table["vu"] if "vu" in table else -table.get("vd", np.zeros(len(table["t"])))
        v_n = np.column_stack([table["ve"], table["vn"], up])
    elif {"speed", "course"} <= set(table):
        speed, course = table["speed"], table["course"]
        v_n = np.column_stack([speed * np.sin(course), speed * np.cos(course), 0.0 * speed])
    v_spread: Any = 0.1 if v_sigma is None else v_sigma
    if {"sdve", "sdvn", "sdvu"} <= set(table) and v_sigma is None:
        v_spread = np.column_stack([table["sdve"], table["sdvn"], table["sdvu"]])
    return GnssFixes(
        table["t"], table["lat"], table["lon"], table["height"], spread, v_n, v_spread, quality,
        lever=lever, delay=delay, estimate=estimate, name=name,
    )  # fmt: skip


def read_speed(
    path: str | Path,
    *,
    sigma: float | None = None,
    lever: ArrayLike = (0.0, 0.0, 0.0),
    estimate: Sequence[str] = (),
    name: str = "odometer",
) -> BodySpeed:
    """Read speeds along the axes of a sensor: one column of forward speed, or right, forward, up.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet with named columns: time and speed, or vx, vy, vz (right, forward, up).
    sigma : float, optional
        1-sigma, m/s, where the file has none; 0.1.
    lever, estimate, name
        As of `BodySpeed`.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or speed.
    """
    path = Path(path)
    try:
        table = _table(path, _SPEED)
        if "t" not in table:
            raise InputError("speeds need a column of times")
        if {"right", "forward", "up"} <= set(table):
            value = np.column_stack([table["right"], table["forward"], table["up"]])
        elif "speed" in table:
            value = table["speed"]
        else:
            raise InputError("no column of speeds was found; name it speed, or vx, vy, vz")
        whole = np.isfinite(table["t"]) & np.isfinite(value.reshape(len(value), -1)).all(axis=1)
        if sigma is None:
            sigma = float(np.nanmedian(table["sd"])) if "sd" in table else 0.1
        return BodySpeed(
            table["t"][whole], value[whole], sigma, lever=lever, estimate=tuple(estimate), name=name
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _table(path: Path, names: dict[str, str]) -> Table:
    """Return the known columns of a file, in SI units."""
    if path.suffix.lower() in (".parquet", ".pq"):
        import pyarrow as pa

        table = read_sealed(path)[0]
        try:
            columns = {
                name: np.asarray(numbers(table.column(k).cast(pa.float64())), np.float64)
                for k, name in enumerate(table.column_names)
            }
        except pa.ArrowException as error:
            reason = str(error).splitlines()[0][:120]
            raise InputError(f"cannot be read ({shown(reason)})") from None
        return _named(columns, names)
    if not is_pipe(path) and not path.is_file():
        raise InputError("there is no such file")
    spooled = Spooled(path) if is_pipe(path) else None
    there = path if spooled is None else spooled.path
    try:
        ordinary(there)
        with there.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})") from None
    if len(data) > _MOST_BYTES:
        raise InputError(f"it has more than {_MOST_BYTES // 1_000_000} MB: too large for aids")
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError("it is no text: known are CSV, Parquet, RTKLIB .pos and KF-GINS") from None
    lines = [line for line in lines if line.strip()]
    if any(line.startswith("%") and "latitude" in line for line in lines[:80]):
        return _rtklib(lines)
    if lines and not lines[0].startswith("#") and _all_numbers(lines[0].split()):
        return _kfgins(lines)
    return _named(_csv(lines), names)


def _all_numbers(cells: Sequence[str]) -> bool:
    try:
        return len([float(cell) for cell in cells]) >= 7
    except ValueError:
        return False


def _csv(lines: list[str]) -> Table:
    """Return the columns of a table with names; an empty cell is not a number."""
    lines = [line for line in lines if not line.startswith("#")]
    if not lines:
        raise InputError("it has no rows")
    comma = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=comma if comma in lines[0] else " "))
    names = [cell.strip() for cell in rows[0]]
    columns: list[list[float]] = [[] for _ in names]
    for number, cells in enumerate(rows[1:], 1):
        if len(cells) < len(names):
            raise InputError(
                f"data row {number} has {len(cells)} cells of {len(names)}; the file may be cut "
                "short"
            )
        for column, cell, name in zip(columns, cells, names, strict=False):
            try:
                column.append(float(cell) if cell.strip() else np.nan)
            except ValueError:
                raise InputError(
                    f"data row {number}, column {shown(name)}: '{shown(cell)}' is not a number"
                ) from None
    return {name: np.array(column) for name, column in zip(names, columns, strict=True)}


def _named(columns: Table, names: dict[str, str]) -> Table:
    """Return columns under the names that are known here, in SI units."""
    out: Table = {}
    for label, values in columns.items():
        base, unit = split_unit(label)
        plain = re.sub(r"[^a-z]", "", base.lower())
        role = names.get(plain)
        if role is None and "_" in label:
            stem, _, unit = label.rpartition("_")
            role = names.get(re.sub(r"[^a-z]", "", stem.lower()))
        if role is None:
            continue
        if role in out:
            raise InputError(f"two columns could both be {role}; keep one of them")
        out[role] = values * _factor(role, unit, label)
    return out


def _factor(role: str, unit: str | None, label: str) -> float:
    dimension = _DIMENSIONS.get(role)
    if dimension is None:
        return 1.0
    if unit is None:
        return DEG if dimension == "angle" else 1.0
    table = _FACTORS.get(dimension)
    if table is None:
        return parse_factor(unit, (dimension,), label)[0]
    if unit not in table:
        raise InputError(f"column {shown(label)}: unit must be one of {', '.join(table)}")
    return table[unit]


def _numbers(line: str, number: int) -> list[float]:
    try:
        return [float(cell) for cell in line.replace(",", " ").split()]
    except ValueError:
        raise InputError(f"line {number}: '{shown(line[:60])}' holds what is no number") from None


def _rtklib(lines: list[str]) -> Table:
    """Return the columns of RTKLIB's solution text, angles in rad."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if line.startswith("%"):
            continue
        cells = line.replace(",", " ").split()
        if "/" in cells[0] and len(cells) > 1:
            time = _seconds(cells[0], cells[1], number)
        else:
            time = _numbers(" ".join(cells[:2]), number)[-1]
        rows.append([time, *_numbers(" ".join(cells[2:]), number)])
    widths = {len(row) for row in rows}
    if not rows or len(widths) > 1 or min(widths) < 9:
        raise InputError("its rows are no solutions of RTKLIB in latitude, longitude and height")
    table = np.array(rows)
    names = ["t", "lat", "lon", "height", "quality", "", "sdn", "sde", "sdu"]
    if table.shape[1] >= 17:
        names += ["", "", "", "", "", "vn", "ve", "vu"]
    if table.shape[1] >= 20:
        names += ["sdvn", "sdve", "sdvu"]
    out = {name: table[:, k] for k, name in enumerate(names) if name}
    out["lat"], out["lon"] = out["lat"] * DEG, out["lon"] * DEG
    return out


def _seconds(day: str, clock: str, number: int) -> float:
    """Return the second of the GPS week of a calendar date."""
    try:
        year, month, date = (int(part) for part in day.split("/"))
        hour, minute, second = clock.split(":")
        weekday = dt.date(year, month, date).isoweekday() % 7
        return 86400.0 * weekday + 3600.0 * int(hour) + 60.0 * int(minute) + float(second)
    except ValueError:
        raise InputError(f"line {number}: '{shown(day)} {shown(clock)}' is no date") from None


def _kfgins(lines: list[str]) -> Table:
    """Return the columns of KF-GINS' text, angles in rad."""
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
    names = ["t", "lat", "lon", "height", "sdn", "sde", "sdu", "vn", "ve", "vd", "sdvn", "sdve",
             "sdvu"]  # fmt: skip
    out = {name: table[:, k] for k, name in enumerate(names[: table.shape[1]])}
    out["lat"], out["lon"] = out["lat"] * DEG, out["lon"] * DEG
    return out
