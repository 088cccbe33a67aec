"""The pages of a Parquet file, walked before Arrow takes memory for them.

A page's header (Thrift's compact protocol, parquet.thrift) says how many bytes follow and how many
they expand to. Arrow believes it. Where a file is damaged or forged these can be gigabytes, so the
headers of the wanted columns are compared with the column's length, its number of values, and what
a file of that size may expand to.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from schuler.errors import InputError, shown
from schuler.io.limits import check_size

__all__ = ["check_pages"]

#: bytes that a header may have
_WINDOW = 1 << 16
_DEEPEST = 8
_STRUCT, _BINARY, _DOUBLE = 12, 8, 7
_LISTS, _WHOLE = (9, 10), (4, 5, 6)
#: fields of a page's header, and of the three kinds of pages in it
_EXPANDED, _LENGTH, _DATA, _DICTIONARY, _DATA_2 = 2, 3, 5, 7, 8
_VALUES = 1


def check_pages(file: Any, path: Path, names: Sequence[str]) -> None:
    """Check the pages of some columns.

    Parameters
    ----------
    file : pyarrow.parquet.ParquetFile
    path : Path
    names : sequence of str
        Columns.

    Raises
    ------
    InputError
        If a page does not fit its column, or announces too much.
    """
    metadata = file.metadata
    size = path.stat().st_size
    wanted = set(names)
    with path.open("rb") as raw:
        for group in range(metadata.num_row_groups):
            rows = metadata.row_group(group)
            for number in range(rows.num_columns):
                column = rows.column(number)
                name = column.path_in_schema
                if name in wanted or name.partition(".")[0] in wanted:
                    _check_column(raw, size, column, f"column '{shown(name)}'")


def _check_column(raw: Any, size: int, column: Any, label: str) -> None:
    place = column.data_page_offset
    if column.has_dictionary_page and column.dictionary_page_offset:
        place = min(place, column.dictionary_page_offset)
    end = place + column.total_compressed_size
    if not 4 <= place <= end <= size:
        raise _damaged(f"{label} is beyond the file's end")
    values = 0
    while values < column.num_values:
        raw.seek(place)
        window = raw.read(min(_WINDOW, end - place))
        try:
            header, begin = _struct(window, 0, 0)
        except (IndexError, ValueError):
            raise _damaged(f"{label} has a page without a header") from None
        length, expanded = header.get(_LENGTH), header.get(_EXPANDED)
        if not (isinstance(length, int) and isinstance(expanded, int)):
            raise _damaged(f"{label} has a page without a size")
        place += begin + length
        if length < 0 or expanded < 0 or place > end:
            raise _damaged(f"{label} has a page that is longer than the column")
        check_size(expanded, size, label)
        for kind in (_DATA, _DATA_2, _DICTIONARY):
            about = header.get(kind)
            if isinstance(about, dict):
                count = about.get(_VALUES)
                if not isinstance(count, int) or not 0 <= count <= column.num_values:
                    raise _damaged(f"{label} has a page with more values than the column")
                values += 0 if kind == _DICTIONARY else count
        if begin + length == 0:
            raise _damaged(f"{label} has an empty page")
    if values != column.num_values:
        raise _damaged(f"{label} has {values} of its {column.num_values} values")


def _struct(data: bytes, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """Return a structure's numbers and structures by field, and where it ends."""
    if depth > _DEEPEST:
        raise ValueError("structures inside each other")
    found: dict[int, Any] = {}
    field = 0
    while True:
        mark = data[at]
        at += 1
        if not mark:
            return found, at
        kind = mark & 15
        if mark >> 4:
            field += mark >> 4
        else:
            field, at = _signed(data, at)
        if kind in (1, 2):
            # Truth values are in the type.
            continue
        found[field], at = _value(data, at, kind, depth)


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if kind in _WHOLE:
        return _signed(data, at)
    if kind == _STRUCT:
        return _struct(data, at, depth + 1)
    if kind == _BINARY:
        length, at = _unsigned(data, at)
        at += length
    elif kind == _DOUBLE:
        at += 8
    elif kind in _LISTS:
        mark = data[at]
        at += 1
        count = mark >> 4
        if count == 15:
            count, at = _unsigned(data, at)
        for _ in range(count):
            one = 3 if mark & 15 in (1, 2) else mark & 15
            _, at = _value(data, at, one, depth + 1)
    elif kind == 3:
        at += 1
    else:
        raise ValueError(f"type {kind}")
    if at > len(data):
        raise ValueError("beyond the end")
    return None, at


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if not byte >> 7:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number of more than 64 bits")


def _signed(data: bytes, at: int) -> tuple[int, int]:
    value, at = _unsigned(data, at)
    return (value >> 1) ^ -(value & 1), at


def _damaged(reason: str) -> InputError:
    return InputError(f"is a damaged or truncated Parquet file ({reason})")
