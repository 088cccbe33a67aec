"""Reading and writing trajectories: CSV, Parquet, npz, and the layouts of pyins and PSINS."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from schuler._arrow import numbers
from schuler._files import parse_json
from schuler.attitude import euler_to_quat, heading_to_psi
from schuler.constants import DEG
from schuler.errors import InputError, located, shown
from schuler.io.aid_files import local_file
from schuler.io.mat import numeric_array
from schuler.io.names import split_unit
from schuler.io.sealed import read_sealed
from schuler.trajectory import Trajectory

__all__ = ["read_trajectory", "truth_path"]

Array = NDArray[np.float64]

LAYOUTS = ("schuler", "pyins", "psins")

#: plain column name (small letters alone) -> what it is; heading clockwise from north
_NAMES = {
    **dict.fromkeys((
        "t", "time", "times", "timestamp", "timestamps", "gpstime", "gpst", "gpssow", "sow", "tow",
        "sec", "secs", "seconds", "secondsofweek", "timeofweek",
    ), "t"),
    **dict.fromkeys(("lat", "latitude"), "lat"),
    **dict.fromkeys(("lon", "longitude", "long", "lng"), "lon"),
    **dict.fromkeys((
        "height", "alt", "altitude", "h", "hell", "ellipsoidalheight", "ellheight", "hgt",
    ), "height"),
    **{
        plain: f"v{way[0]}"
        for way in ("east", "north", "up", "down")
        for plain in (
            f"v{way[0]}", f"v{way}", f"vel{way[0]}", f"vel{way}", f"velocity{way}", f"{way}vel",
            f"{way}velocity", f"speed{way}",
        )
    },
    **dict.fromkeys(("heading", "yaw", "azimuth", "hdg"), "heading"),
    **{name: name for name in ("pitch", "roll", "qw", "qx", "qy", "qz")},
}  # fmt: skip
_ANGLES = ("lat", "lon", "heading", "pitch", "roll")
_SPEEDS = ("ve", "vn", "vu", "vd")

_ANGLE_UNITS = {"deg": 1.0, "degree": 1.0, "degrees": 1.0, "rad": 1.0 / DEG}
_SPEED_UNITS = {
    "m/s": 1.0, "mps": 1.0, "km/h": 1.0 / 3.6, "kph": 1.0 / 3.6, "kn": 1852.0 / 3600.0,
    "ft/s": 0.3048,
}  # fmt: skip
#: to degrees, seconds, m and m/s
_UNIT_FACTORS: dict[str, dict[str, float]] = {
    **dict.fromkeys(_ANGLES, _ANGLE_UNITS), **dict.fromkeys(_SPEEDS, _SPEED_UNITS),
    "t": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "height": {"m": 1.0, "km": 1000.0, "ft": 0.3048},
}  # fmt: skip

#: KF-GINS's navigation file, which has no names: week, seconds, deg, m, m/s north, east, down, deg
_KF_GINS = ("", "t", "lat", "lon", "height", "vn", "ve", "vd", "roll", "pitch", "heading")
_MOST_WEEKS = 6000.0
_LEAST = 2
_QUAT = ("qw", "qx", "qy", "qz")


def truth_path(record: str | Path) -> Path:
    """Return where the truth of a record goes: ``truck.truth.parquet`` beside ``truck.csv``.

    Examples
    --------
    >>> truth_path("truck.csv").name
    'truck.truth.parquet'
    """
    record = Path(record)
    return record.with_name(f"{record.stem}.truth.parquet")


def read_trajectory(path: str | Path, layout: str | None = None) -> Trajectory:
    """Read a trajectory from CSV with named columns, Parquet, npz or JSON lines.

    Columns are known by name: time (s), lat, lon (deg), height or alt (m); VE, VN and VU or VD, or
    v_east ... (m/s); heading, yaw or azimuth (deg, clockwise from north), pitch, roll (deg); qw,
    qx, qy, qz (body to East-North-Up), which count more than angles. So pyins tables and exports of
    other programs are understood as they are; columns are parted by commas, semicolons, tabs or
    blanks. Units may stand behind names, as ``lat [rad]``, or in a row of their own below. A text
    of eleven columns without names is KF-GINS's navigation file. Rows with an empty cell are passed
    over. Gzip is unpacked.

    Parameters
    ----------
    path : str or Path
    layout : {"schuler", "pyins", "psins"}, optional
        "psins": the ten columns of `avp` (pitch, roll, yaw, velocity east, north, up, latitude,
        longitude, height, time; rad, yaw counter-clockwise), as text without names, or the array
        ``avp`` of a .mat file.

    Raises
    ------
    InputError
        If the file cannot be read, lacks time or position, or has no two rows.

    Examples
    --------
    >>> len(sc.read_trajectory("path.csv").time)
    61
    """
    path = Path(path)
    with located(path):
        _check_layout(layout)
    with local_file(path) as there:
        suffix = there.suffix.lower()
        if layout == "psins":
            table = _psins(_avp(there, suffix))
        elif suffix in (".parquet", ".pq"):
            table = _parquet(there)
        elif suffix == ".jsonl":
            table = _json_lines(there)
        else:
            table = _npz(there) if suffix == ".npz" else _text(there)
        return _trajectory(table, path.name)


def _check_layout(layout: str | None) -> None:
    if layout is not None and layout not in LAYOUTS:
        raise InputError(f"layout must be one of {', '.join(LAYOUTS)}, got '{layout}'")


def _trajectory(table: dict[str, Array], name: str) -> Trajectory:
    """Make a trajectory of named columns."""
    missing = [name for name in ("t", "lat", "lon", "height") if name not in table]
    if missing:
        raise InputError(
            f"a trajectory needs columns for time, lat, lon and height; {', '.join(missing)} not "
            "found"
        )
    if len({len(column) for column in table.values()}) > 1:
        raise InputError("its columns have different lengths")
    rows = np.column_stack(list(table.values()))
    table = dict(zip(table, rows[np.all(np.isfinite(rows), axis=1)].T, strict=True))
    time = table["t"]
    if len(time) < _LEAST:
        raise InputError(f"a trajectory needs two whole rows at least, got {len(time)}")
    if np.any(np.diff(time) <= 0):
        k = int(np.argmax(np.diff(time) <= 0))
        raise InputError(f"time does not advance after t = {time[k]:.9g} s; sort the rows")
    if np.any(np.abs(table["lat"]) > 90.0) or np.any(np.abs(table["lon"]) > 360.0):
        raise InputError("latitudes or longitudes are out of range; they must be in deg")
    v_n = quat_nb = None
    if "ve" in table and "vn" in table:
        up = table.get("vu", -table["vd"] if "vd" in table else np.zeros_like(time))
        v_n = np.column_stack([table["ve"], table["vn"], up])
    if set(_QUAT) <= set(table):
        quat_nb = np.column_stack([table[name] for name in _QUAT])
        if np.any(np.abs(np.linalg.norm(quat_nb, axis=1) - 1.0) > 1e-6):
            raise InputError("qw, qx, qy and qz are no unit quaternions")
    elif {"heading", "pitch", "roll"} <= set(table):
        quat_nb = euler_to_quat(np.column_stack([
            heading_to_psi(table["heading"] * DEG), table["pitch"] * DEG, table["roll"] * DEG,
        ]))  # fmt: skip
    return Trajectory(
        time, table["lat"] * DEG, table["lon"] * DEG, table["height"], v_n, quat_nb, name=name
    )


def _named(name: str) -> tuple[str | None, float]:
    """Return what a column is by its name, and the factor of its unit.

    Raises
    ------
    InputError
        If the unit is none of what it is.
    """
    base, unit = split_unit(name.strip())
    role = _NAMES.get(_plain(base))
    if role is None and "_" in base:
        stem, _, last = base.rpartition("_")
        role = _NAMES.get(_plain(stem))
        if role is not None and last.lower() in _UNIT_FACTORS.get(role, {}):
            unit = last
        else:
            role = None
    return role, 1.0 if role is None or not unit else _factor(role, unit, name)


def _factor(role: str, unit: str, name: str) -> float:
    known = _UNIT_FACTORS.get(role, {})
    plain = unit.strip().lower().replace("°", "deg")
    if known and plain not in known:
        raise InputError(
            f"column '{shown(name)}': the unit of {role} must be one of {', '.join(known)}"
        )
    return known.get(plain, 1.0)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _roles(names: list[str]) -> dict[str, tuple[int, float]]:
    """Return for each role the column that has it, and its factor."""
    found: dict[str, tuple[int, float]] = {}
    for k, name in enumerate(names):
        role, factor = _named(name)
        if role is None:
            continue
        if role in found:
            raise InputError(f"two columns could both be {role}; keep one of them")
        found[role] = (k, factor)
    return found


def _parquet(path: Path) -> dict[str, Array]:
    import pyarrow as pa

    table = read_sealed(path)[0]
    try:
        names = table.column_names
        return {
            role: factor * np.asarray(numbers(table.column(k).cast(pa.float64())), np.float64)
            for role, (k, factor) in _roles(names).items()
        }
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"cannot be read ({shown(reason)})") from None


def _npz(path: Path) -> dict[str, Array]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            names = arrays.files
            return {
                role: factor * np.asarray(arrays[names[k]], np.float64)
                for role, (k, factor) in _roles(names).items()
            }
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"cannot be read ({shown(str(error)[:120])})") from None


def _avp(path: Path, suffix: str) -> Array:
    """Return avp: text without names, the array of a .mat file, or the columns of an .npz."""
    if suffix == ".mat":
        return numeric_array(path, "avp")
    try:
        if suffix == ".npz":
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                columns = [np.asarray(arrays[name], np.float64) for name in arrays.files]
            return np.column_stack(columns)
        lines = path.read_text(encoding="utf-8").replace(",", " ").splitlines()
        return np.loadtxt(lines, comments=("%", "#"), ndmin=2)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"cannot be read ({shown(str(error)[:120])})") from None


def _psins(rows: Array) -> dict[str, Array]:
    if rows.ndim != 2 or rows.shape[1] != 10:
        raise InputError(f"an avp has 10 columns, got an array of shape {rows.shape}")
    pitch, roll, yaw, ve, vn, vu, lat, lon, height, t = rows.T
    quat = dict(zip(_QUAT, euler_to_quat(np.column_stack([yaw, pitch, roll])).T, strict=True))
    return {"t": t, "lat": lat / DEG, "lon": lon / DEG, "height": height, "ve": ve, "vn": vn,
            "vu": vu, **quat}  # fmt: skip


def _json_lines(path: Path) -> dict[str, Array]:
    """Return the columns of a file with a JSON object to a row."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            lines = [line for line in file if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read ({reason})") from None
    roles: dict[str, tuple[int, float]] = {}
    names: list[str] = []
    columns: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        try:
            row = parse_json(line)
        except ValueError as error:
            raise InputError(f"line {number} is not JSON ({error})") from None
        if not isinstance(row, dict):
            raise InputError(f"line {number} is no JSON object")
        if not roles:
            names = list(row)
            roles = _roles(names)
            columns = [[] for _ in roles]
        cells: list[Any] = [row.get(names[k]) for k, _ in roles.values()]
        if any(isinstance(v, bool) or not isinstance(v, int | float) for v in cells):
            raise InputError(f"line {number} lacks a number that the first line has")
        for column, value in zip(columns, cells, strict=True):
            column.append(float(value))
    return {
        role: factor * np.array(column, np.float64)
        for (role, (_, factor)), column in zip(roles.items(), columns, strict=True)
    }


def _text(path: Path) -> dict[str, Array]:
    """Return the columns of a table of text with names, or of KF-GINS's navigation file."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read ({reason})") from None
    lines = [line for line in lines if line.strip() and not line.startswith(("#", "%"))]
    if not lines:
        raise InputError("it has no rows")
    comma = max(",;\t", key=lines[0].count)
    if comma in lines[0]:
        try:
            rows = [[c.strip() for c in cells] for cells in csv.reader(lines, delimiter=comma)]
        except csv.Error as error:
            raise InputError(f"cannot be read ({error})") from None
    else:
        rows = [line.split() for line in lines]
    if all(_number(cell) is not None for cell in rows[0]):
        return _without_names(rows)
    names, body, first = rows[0], rows[1:], 1
    if body and len(body[0]) == len(names) and all(_number(c) is None for c in body[0] if c):
        # A row of units below the names.
        names = [
            f"{name} [{cell.strip('()[] ')}]" if cell.strip("()[] ") else name
            for name, cell in zip(names, body[0], strict=True)
        ]
        body, first = body[1:], 2
    roles = _roles(names)
    columns: list[list[float]] = [[] for _ in roles]
    for number, cells in enumerate(body, first):
        if len(cells) < len(names):
            raise InputError(
                f"data row {number} has {len(cells)} cells of {len(names)}; the file may be cut "
                "short"
            )
        wanted = [cells[k] for k, _ in roles.values()]
        if not all(wanted):
            continue
        for column, cell in zip(columns, wanted, strict=True):
            column.append(_value(cell, number))
    return {
        role: factor * np.array(column, np.float64)
        for (role, (_, factor)), column in zip(roles.items(), columns, strict=True)
    }


def _without_names(rows: list[list[str]]) -> dict[str, Array]:
    """Return the columns of KF-GINS's navigation file, the only text without names."""
    if len(rows[0]) != len(_KF_GINS):
        raise InputError(
            f"its {len(rows[0])} columns have no names: name them in a first row, as "
            "t,lat,lon,height,ve,vn,vu,heading,pitch,roll"
        )
    if any(len(row) != len(_KF_GINS) for row in rows):
        raise InputError("its rows have different numbers of columns; the file may be cut short")
    table = np.array([[_value(cell, k) for cell in row] for k, row in enumerate(rows, 1)])
    week = table[:, 0]
    if not np.all((week == np.round(week)) & (week >= 0.0) & (week < _MOST_WEEKS)):
        raise InputError(
            "eleven columns without names are read as KF-GINS's week, seconds, position, velocity "
            "and attitude, and the first of these are no weeks: name them in a first row"
        )
    return {role: column for role, column in zip(_KF_GINS, table.T, strict=True) if role}


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _value(cell: str, number: int) -> float:
    value = _number(cell)
    if value is None:
        raise InputError(f"data row {number} has a cell that is not a number ('{shown(cell)}')")
    return value
