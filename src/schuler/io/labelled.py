"""Text tables whose rows name their sensor: ``0.01, gyro, 0.1, 0.2, 0.3``.

Loggers with one queue for all sensors write them. A row of the gyros or of the accelerometers
becomes a row of seven columns, in which the other sensor is missing; what else is there (a
magnetometer, a position) is left out, and said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from schuler.errors import InputError, shown
from schuler.io.cells import Cells, LineError
from schuler.io.columns import split_unit
from schuler.io.content import Array
from schuler.io.dialect import Dialect, guess_delimiter, split, valued
from schuler.io.instants import is_instant
from schuler.io.mapping import Mapping
from schuler.io.names import read_name, time_rank

__all__ = ["LabelledCells", "LabelledTable", "find_labelled"]

#: lines of a file's beginning that are looked at
_LOOKED = 2000
#: columns that may hold the sensor's name
_FIRST_COLUMNS = 8
_LEAST = 2
#: what may stand before a sensor's name: "TYPE_GYROSCOPE"
_KIND = re.compile(r"^(?:sensor|type)[_. ]+", re.IGNORECASE)
_ROLES = ("t", "gx", "gy", "gz", "ax", "ay", "az")


@dataclass(frozen=True)
class _Sensor:
    """Rows of one sensor.

    Parameters
    ----------
    label : str
        What they are named by, as it stands in the file.
    count : int
        Cells of a row.
    columns : (int, int, int, int)
        Time and three values.
    """

    label: str
    count: int
    columns: tuple[int, int, int, int]


@dataclass(frozen=True)
class LabelledTable:
    """The layout of a table whose rows name their sensor.

    Parameters
    ----------
    dialect : Dialect
        Of the seven columns that are made of it.
    column : int
        That holds the sensor's name.
    gyro, accel : _Sensor
    others : tuple of str
        Other names in the file's beginning.
    instants : bool
        Whether times are dates or times of day.
    """

    dialect: Dialect
    column: int
    gyro: _Sensor
    accel: _Sensor
    others: tuple[str, ...]
    instants: bool

    @property
    def note(self) -> str:
        """What is to be said of it."""
        text = (
            f"its rows name their sensor in column {self.column + 1}: "
            f"'{shown(self.gyro.label)}' and '{shown(self.accel.label)}' were taken"
        )
        if self.others:
            text += f"; rows of {', '.join(shown(name) for name in self.others)} were left out"
        return text


def find_labelled(head: bytes, mapping: Mapping) -> LabelledTable | None:
    """Return the layout of a file whose rows name their sensor; None where they do not.

    Parameters
    ----------
    head : bytes
        The file's beginning.
    mapping : Mapping
        What the user says about the layout; where it names columns, nothing is looked for.

    Raises
    ------
    InputError
        If the rows name their sensor, and time and values cannot be told apart.
    """
    if mapping.columns is not None or mapping.array is not None or b"\0" in head:
        return None
    begin = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    raw = head[begin : head.rfind(b"\n") + 1].decode("utf-8", errors="replace").split("\n")
    marks = (mapping.comment,) if mapping.comment else ("#", "%")
    numbered = [
        (number, line.strip())
        for number, line in enumerate(raw[:_LOOKED], 1)
        if number > (mapping.skip_rows or 0) and line.strip() and not line.strip().startswith(marks)
    ]
    if len(numbered) < 2 * _LEAST:
        return None
    delimiter = mapping.delimiter or guess_delimiter(numbered[1][1], mapping.decimal)
    rows = [split(line, delimiter) for _, line in numbered]
    for column in range(min(_FIRST_COLUMNS, max(len(row) for row in rows))):
        labels = [row[column] if column < len(row) else "" for row in rows]
        named = {label: _sensor_of(label) for label in set(labels)}
        gyro, accel = (_best(labels, named, which) for which in ("g", "a"))
        if gyro is not None and accel is not None:
            break
    else:
        return None
    first = next(k for k, label in enumerate(labels) if label in (gyro, accel))
    header = _header(rows[:first], labels)
    gyros, accels = (
        _Sensor(label, *_places(rows[labels.index(label)], column, header, mapping))
        for label in (gyro, accel)
    )
    time = gyros.columns[0]
    cell = rows[labels.index(gyro)][time]
    skipped = len(b"\n".join(head[begin:].split(b"\n")[: numbered[first][0] - 1]))
    known = header is not None and read_name(header[time], _ROLES).role == "t"
    names = (header[time] if header is not None and known else "time", *_ROLES[1:])
    dialect = Dialect(
        delimiter=delimiter,
        comment=tuple(mark.encode() for mark in marks),
        decimal=mapping.decimal or ("," if delimiter == ";" and "," in numbered[first][1] else "."),
        quoted='"' in numbered[first][1],
        names=names,
        count=min(gyros.count, accels.count),
        offset=begin + (skipped + 1 if numbered[first][0] > 1 else 0),
        line=numbered[first][0],
        first=(cell, *[""] * 6),
    )
    words = {label for row, label in zip(rows, labels, strict=True) if row is not header}
    others = tuple(sorted(words - {gyro, accel, ""}))
    return LabelledTable(dialect, column, gyros, accels, others, is_instant(cell))


def _sensor_of(label: str) -> str | None:
    """Return "g" or "a" for a sensor's name."""
    if not label or valued(label, None):
        return None
    words = label.lower().replace("-", "_")
    if "lin" in words.split("_") or "linear" in words:
        # Of these gravity was taken off.
        return None
    role = read_name(f"{_KIND.sub('', label)}_x", _ROLES).role
    return role[0] if role in ("gx", "ax") else None


def _best(labels: list[str], named: dict[str, str | None], which: str) -> str | None:
    """Return the name of a sensor's rows: the shortest where there are several."""
    found = [label for label, sensor in named.items() if sensor == which]
    found = [label for label in found if labels.count(label) >= _LEAST]
    return min(found, key=lambda label: (len(label), label), default=None)


def _header(before: list[list[str]], labels: list[str]) -> list[str] | None:
    """Return the names of the columns where a line before the rows holds them."""
    for row in reversed(before):
        if not any(valued(cell, None) for cell in row if cell):
            return row
    return None


def _places(
    row: list[str], column: int, header: list[str] | None, mapping: Mapping
) -> tuple[int, tuple[int, int, int, int]]:
    """Return how many cells a sensor's row has, and which are time and the three values."""
    numbers = [
        k for k, cell in enumerate(row) if k != column and cell and valued(cell, mapping.decimal)
    ]
    names: Sequence[str] = header if header is not None and len(header) >= len(row) else ()
    times = sorted(
        (k for k in numbers if names and time_rank(names[k]) < time_rank("")),
        key=lambda k: time_rank(names[k]),
    )
    time = times[0] if times else (numbers[0] if numbers else 0)
    values = [k for k in numbers if k != time]
    if names and len(values) > 3:
        ends = [split_unit(names[k])[0].lower()[-1:] for k in values]
        values = [values[ends.index(axis)] for axis in "xyz" if axis in ends]
    if len(values) != 3 or (times and len(times) > 1 and not names):
        raise InputError(
            f"its rows name their sensor ('{shown(row[column])}'), and have {len(numbers)} numbers "
            "where a time and three values are expected; write a header that names them (time, x, "
            "y, z)"
        )
    return len(row), (time, values[0], values[1], values[2])


@dataclass
class LabelledCells:
    """Parses blocks of a table whose rows name their sensor, as `Cells` those of a plain one.

    Parameters
    ----------
    table : LabelledTable
    """

    table: LabelledTable
    _cells: list[Cells] = field(init=False)

    def __post_init__(self) -> None:
        t = self.table
        self._cells = [
            Cells(
                replace(t.dialect, count=each.count, names=None), each.columns,
                (each.columns[0],) if t.instants else (),
            )
            for each in (t.gyro, t.accel)
        ]  # fmt: skip

    def parse(self, block: bytes) -> dict[int, Array]:
        """Return the seven columns of a block of whole lines; the other sensor's are not numbers.

        Raises
        ------
        LineError
            For the first line that is no row.
        """
        t = self.table
        wanted = {t.gyro.label: 0, t.accel.label: 1}
        rows: tuple[list[bytes], list[bytes]] = ([], [])
        places: tuple[list[int], list[int]] = ([], [])
        for i, raw in enumerate(block.split(b"\n")):
            line = raw.strip()
            if not line or line.startswith(t.dialect.comment):
                continue
            cells = split(line.decode("utf-8", errors="replace"), t.dialect.delimiter)
            if len(cells) <= t.column:
                raise LineError(i, f"has no column {t.column + 1}, which names the sensor")
            which = wanted.get(cells[t.column])
            if which is not None:
                rows[which].append(raw)
                places[which].append(i)
        order = np.argsort(np.array(places[0] + places[1]), kind="stable")
        out = np.full((7, len(order)), np.nan)
        end = 0
        for which, cells_of in enumerate(self._cells):
            if not rows[which]:
                continue
            try:
                found = cells_of.parse(b"\n".join(rows[which]) + b"\n")
            except LineError as error:
                raise LineError(places[which][error.i], str(error)) from None
            begin, end = end, end + len(places[which])
            columns = cells_of.columns
            out[0, begin:end] = found[columns[0]]
            for k in range(3):
                out[1 + 3 * which + k, begin:end] = found[columns[1 + k]]
        out = out[:, order]
        return {k: np.ascontiguousarray(out[k]) for k in range(7)}
