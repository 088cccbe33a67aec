"""Tables of aids with named columns: CSV and Parquet, in SI units."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._arrow import numbers
from schuler.constants import DEG
from schuler.errors import InputError, shown
from schuler.io.names import split_unit
from schuler.io.sealed import read_sealed
from schuler.units import parse_factor

__all__ = [
    "column_names",
    "csv_columns",
    "first_names",
    "named_columns",
    "parquet_columns",
    "text_lines",
]

MOST_BYTES = 400_000_000
"""Of a file that is read whole."""

Array = NDArray[np.float64]
Table = dict[str, Array]

#: what a role is measured in
_DIMENSIONS = {
    "t": "time",
    **dict.fromkeys(("lat", "lon", "course", "heading", "sdheading"), "angle"),
    **dict.fromkeys(("height", "above_sea", "separation", "depth", "sdheight"), "length"),
    "distance": "length",
    **dict.fromkeys(("fl", "fr", "rl", "rr"), "speed"),
    **dict.fromkeys(("sde", "sdn", "sdu"), "length"),
    **dict.fromkeys(("ve", "vn", "vu", "vd", "speed", "x", "y", "z"), "speed"),
    **dict.fromkeys(("sdve", "sdvn", "sdvu", "sd"), "speed"),
    "pressure": "pressure",
}
_FACTORS = {
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kph": 1.0 / 3.6, "kn": 1852.0 / 3600.0,
              "knots": 1852.0 / 3600.0, "mph": 0.44704},
    "length": {"m": 1.0, "km": 1000.0, "mm": 1e-3, "cm": 1e-2, "ft": 0.3048},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1000.0, "bar": 1e5},
}  # fmt: skip


def parquet_columns(path: Path) -> Table:
    """Return the columns of a Parquet file by name.

    Raises
    ------
    InputError
        If it cannot be read, or a column is not of numbers.
    """
    import pyarrow as pa

    table = read_sealed(path)[0]
    try:
        return {
            name: np.asarray(numbers(table.column(k).cast(pa.float64())), np.float64)
            for k, name in enumerate(table.column_names)
        }
    except pa.ArrowException as error:
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"cannot be read ({shown(reason)})") from None


def column_names(path: Path) -> list[str]:
    """Return the plain names of the columns of a Parquet file, without units."""
    from schuler.io.sealed import opened_parquet

    with opened_parquet(path) as file:
        return first_names(",".join(file.schema_arrow.names).encode())


def text_lines(data: bytes) -> list[str]:
    """Return the lines of a text that are not blank.

    Raises
    ------
    InputError
        If it is no text.
    """
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError("it is no text and of no known binary format") from None
    return [line for line in lines if line.strip()]


def read_named(path: Path, names: Mapping[str, str]) -> Table:
    """Return the columns of a CSV or Parquet file that are known by name, in SI units.

    Parameters
    ----------
    path : Path
    names : mapping of str to str
        Plain name (small letters alone) -> role.

    Raises
    ------
    InputError
        If the file cannot be read, or two columns have one role.
    """
    with path.open("rb") as file:
        parquet = file.read(4) == b"PAR1"
    raw = parquet_columns(path) if parquet else csv_columns(text_lines(read_bytes(path)))
    return named_columns(raw, names)


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes, at most `MOST_BYTES` of them.

    Raises
    ------
    InputError
        If it is larger.
    """
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise InputError(f"it has more than {MOST_BYTES // 1_000_000} MB: too large for aids")
    return data


def first_names(head: bytes) -> list[str]:
    """Return the plain names of the columns of a text, without units; empty where it has none."""
    text = head.decode("utf-8-sig", "replace")
    line = next((x for x in text.splitlines() if x.strip() and not x.startswith("#")), "")
    comma = max(",;\t", key=line.count)
    cells = line.split(comma if comma in line else None)
    return [re.sub(r"[^a-z]", "", split_unit(cell.strip())[0].lower()) for cell in cells]


def csv_columns(lines: list[str]) -> Table:
    """Return the columns of a table with names; an empty cell is not a number."""
    lines = [line for line in lines if not line.startswith("#")]
    if not lines:
        raise InputError("it has no rows")
    comma = max(",;\t", key=lines[0].count)
    try:
        rows = list(csv.reader(lines, delimiter=comma if comma in lines[0] else " "))
    except csv.Error as error:
        raise InputError(f"it is no table ({error})") from None
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


def named_columns(columns: Table, names: Mapping[str, str]) -> Table:
    """Return columns under the names that are known here, in SI units."""
    out: Table = {}
    for label, values in columns.items():
        base, unit = split_unit(label)
        plain = re.sub(r"[^a-z]", "", base.lower())
        # pandas writes an index without a name first, and it is the time.
        role = "t" if not label and not out else names.get(plain)
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
