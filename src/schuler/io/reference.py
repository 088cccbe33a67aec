"""Reading a reference path: position, and where the file has them velocity and attitude."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import euler_to_quat, heading_to_psi
from schuler.constants import DEG
from schuler.errors import InputError, shown
from schuler.io.sealed import read_sealed
from schuler.io.spool import Spooled, is_pipe

__all__ = ["Reference", "read_reference"]

Array = NDArray[np.float64]

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
    "pitch": "pitch",
    "roll": "roll",
}
_UNITS = re.compile(r"\s*[\[(].*|_(s|deg|m|mps|rad)$")
_LEAST = 2


@dataclass(frozen=True, eq=False)
class Reference:
    """A path to compare with.

    Parameters
    ----------
    time : (n,) float64
        s.
    position : (n, 3) float64
        Latitude, longitude (rad), height (m).
    velocity : (n, 3) float64 or None
        East, north, up, m/s.
    quaternion : (n, 4) float64 or None
        q_b^n.
    name : str
    """

    time: Array
    position: Array
    velocity: Array | None = None
    quaternion: Array | None = None
    name: str = "reference"

    def __len__(self) -> int:
        return len(self.time)


def read_reference(path: str | Path) -> Reference:
    """Read a reference from CSV with named columns, or Parquet (a simulation's truth, a path).

    Columns are known by name: time (s), lat, lon (deg), height or alt (m); VE, VN and VU or VD, or
    v_east ... (m/s); heading (deg, clockwise from north), pitch, roll (deg). Units behind names
    are passed over: they must be these. Rows with an empty cell are passed over.

    Raises
    ------
    InputError
        If the file cannot be read, lacks time or position, or has no two rows.
    """
    path = Path(path)
    try:
        # The copy of a pipe lasts as long as this object.
        spooled = Spooled(path) if is_pipe(path) else None
        if spooled is None and not path.is_file():
            raise InputError("there is no such file to compare with")
        there = path if spooled is None else spooled.path
        table = _parquet(there) if path.suffix.lower() in (".parquet", ".pq") else _text(there)
        return _reference(table, path.name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _reference(table: dict[str, Array], name: str) -> Reference:
    """Make a reference of named columns."""
    missing = [name for name in ("t", "lat", "lon", "height") if name not in table]
    if missing:
        raise InputError(
            f"a reference needs columns for time, lat, lon and height; {', '.join(missing)} not "
            "found"
        )
    rows = np.column_stack(list(table.values()))
    table = dict(zip(table, rows[np.all(np.isfinite(rows), axis=1)].T, strict=True))
    time = table["t"]
    if len(time) < _LEAST:
        raise InputError(f"a reference needs two whole rows at least, got {len(time)}")
    if np.any(np.diff(time) <= 0):
        k = int(np.argmax(np.diff(time) <= 0))
        raise InputError(f"time does not advance after t = {time[k]:.9g} s; sort the rows")
    if np.any(np.abs(table["lat"]) > 90.0) or np.any(np.abs(table["lon"]) > 360.0):
        raise InputError("latitudes or longitudes are out of range; they must be in deg")
    velocity = quaternion = None
    if "ve" in table and "vn" in table:
        up = table.get("vu", -table["vd"] if "vd" in table else np.zeros_like(time))
        velocity = np.column_stack([table["ve"], table["vn"], up])
    if {"heading", "pitch", "roll"} <= set(table):
        quaternion = euler_to_quat(np.column_stack([
            heading_to_psi(table["heading"] * DEG), table["pitch"] * DEG, table["roll"] * DEG,
        ]))  # fmt: skip
    position = np.column_stack([table["lat"] * DEG, table["lon"] * DEG, table["height"]])
    return Reference(time, position, velocity, quaternion, name)


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


def _parquet(path: Path) -> dict[str, Array]:
    import pyarrow as pa

    table = read_sealed(path)[0]
    try:
        return {
            role: np.asarray(table.column(k).cast(pa.float64()).to_numpy(), np.float64)
            for role, k in _roles(table.column_names).items()
        }
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"cannot be read ({shown(reason)})") from None


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
    return dict(zip(roles, (np.array(c, np.float64) for c in columns), strict=True))
