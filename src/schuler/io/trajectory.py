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
from schuler.errors import InputError, shown
from schuler.io.aid_files import local_file
from schuler.io.mat import numeric_array
from schuler.io.sealed import read_sealed
from schuler.trajectory import Trajectory

__all__ = ["read_trajectory", "truth_path"]

Array = NDArray[np.float64]

LAYOUTS = ("schuler", "pyins", "psins")

#: plain column name -> what it is; angles in deg, heading clockwise from north
_NAMES = {
    **dict.fromkeys(("t", "time", "times", "timestamp"), "t"),
    **dict.fromkeys(("lat", "latitude"), "lat"),
    **dict.fromkeys(("lon", "longitude", "long"), "lon"),
    **dict.fromkeys(("height", "alt", "altitude", "h"), "height"),
    **dict.fromkeys(("ve", "veast"), "ve"),
    **dict.fromkeys(("vn", "vnorth"), "vn"),
    **dict.fromkeys(("vu", "vup"), "vu"),
    **dict.fromkeys(("vd", "vdown"), "vd"),
    **dict.fromkeys(("heading", "yaw"), "heading"),
    **{name: name for name in ("pitch", "roll", "qw", "qx", "qy", "qz")},
}
_UNITS = re.compile(r"\s*[\[(].*|_(s|deg|m|mps|rad)$")
_RADIANS = re.compile(r"[\[(]\s*rad\s*[\])]$|_rad$")
_ANGLES = ("lat", "lon", "heading", "pitch", "roll")
_LEAST = 2
_QUAT = ("qw", "qx", "qy", "qz")


def truth_path(record: str | Path) -> Path:
    """Return where the truth of a record goes: ``truck.truth.parquet`` beside ``truck.csv``."""
    record = Path(record)
    return record.with_name(f"{record.stem}.truth.parquet")


def read_trajectory(path: str | Path, layout: str | None = None) -> Trajectory:
    """Read a trajectory from CSV with named columns, Parquet, npz or JSON lines.

    Columns are known by name: time (s), lat, lon (deg), height or alt (m); VE, VN and VU or VD, or
    v_east ... (m/s); heading (deg, clockwise from north), pitch, roll (deg); qw, qx, qy, qz (body
    to East-North-Up), which count more than angles. So pyins tables are understood as they are.
    Angles may be in rad where their names say so, as ``lat [rad]``; other units behind names are
    passed over: they must be these. Rows with an empty cell are passed over. Gzip is unpacked.

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
    """
    path = Path(path)
    try:
        _check_layout(layout)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
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


def _role(name: str) -> str | None:
    plain = _UNITS.sub("", name.strip().lower())
    return _NAMES.get(plain.replace("_", "").replace(" ", ""))


def _roles(names: list[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for k, name in enumerate(names):
        role = _role(name)
        if role is None:
            continue
        if role in found:
            raise InputError(f"two columns could both be {role}; keep one of them")
        found[role] = k
    return found


def _degrees(table: dict[str, Array], names: list[str], roles: dict[str, int]) -> dict[str, Array]:
    """Turn into degrees the angles whose names say that they are in rad."""
    return {
        role: column / DEG
        if role in _ANGLES and _RADIANS.search(names[roles[role]].strip().lower())
        else column
        for role, column in table.items()
    }


def _parquet(path: Path) -> dict[str, Array]:
    import pyarrow as pa

    table = read_sealed(path)[0]
    try:
        names = table.column_names
        roles = _roles(names)
        columns = {
            role: np.asarray(numbers(table.column(k).cast(pa.float64())), np.float64)
            for role, k in roles.items()
        }
        return _degrees(columns, names, roles)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"cannot be read ({shown(reason)})") from None


def _npz(path: Path) -> dict[str, Array]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            names = arrays.files
            roles = _roles(names)
            columns = {role: np.asarray(arrays[names[k]], np.float64) for role, k in roles.items()}
            return _degrees(columns, names, roles)
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
    roles: dict[str, int] = {}
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
        cells: list[Any] = [row.get(names[k]) for k in roles.values()]
        if any(isinstance(v, bool) or not isinstance(v, int | float) for v in cells):
            raise InputError(f"line {number} lacks a number that the first line has")
        for column, value in zip(columns, cells, strict=True):
            column.append(float(value))
    return dict(zip(roles, (np.array(c, np.float64) for c in columns), strict=True))


def _text(path: Path) -> dict[str, Array]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(line for line in file if line.strip() and not line.startswith("#"))
            names = next(lines, [])
            roles = _roles(names)
            columns: list[list[float]] = [[] for _ in roles]
            for number, cells in enumerate(lines, 1):
                if len(cells) < len(names):
                    raise InputError(
                        f"data row {number} has {len(cells)} cells of {len(names)}; the file may "
                        "be cut short"
                    )
                values = [cells[k].strip() for k in roles.values()]
                if not all(values):
                    continue
                for column, value in zip(columns, values, strict=True):
                    column.append(float(value))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read ({reason})") from None
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"has a cell that is not a number ({error})") from None
    found = dict(zip(roles, (np.array(c, np.float64) for c in columns), strict=True))
    return _degrees(found, names, roles)
