"""The footer and the pages of a Parquet file, looked at before Arrow takes memory for them.

A page's header says how many bytes follow and how many they expand to, and Arrow allocates by it;
some damaged footers end the whole process. So both are read here first (parquet.thrift), and
compared with the file's size, the columns' numbers of values, and what a file of that size may
expand to.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from schuler.errors import InputError, shown
from schuler.io.limits import check_size
from schuler.io.thrift import structure

__all__ = ["check_pages", "damaged_parquet", "footer_bytes"]

_MAGIC = b"PAR1"
#: bytes that a page's header may have
_WINDOW = 1 << 16
#: what a structure of another shape than expected raises
_OTHER_SHAPE = (AttributeError, IndexError, KeyError, TypeError, ValueError)
#: fields of the footer, of a row group, of a column's part in it and of what that says
_ROWS, _GROUPS = 3, 4
_COLUMNS, _GROUP_ROWS = 1, 3
_ELSEWHERE, _ABOUT = 1, 3
_PATH, _COUNT, _BYTES, _BEGIN, _DICTIONARY_BEGIN = 3, 5, 7, 9, 11
#: fields of a page's header, and of the three kinds of pages in it
_EXPANDED, _LENGTH, _DATA, _DICTIONARY, _DATA_2 = 2, 3, 5, 7, 8
_VALUES = 1


@dataclass(frozen=True)
class _Part:
    """A column in one row group: its name, where its pages are, and how many values it has."""

    name: str
    begin: int
    end: int
    values: int

    @property
    def label(self) -> str:
        return f"column '{shown(self.name)}'"


def footer_bytes(path: Path) -> bytes:
    """Return a file's footer as it is.

    Raises
    ------
    InputError
        If there is none.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - 8))
        tail = file.read(8)
        length = int.from_bytes(tail[:4], "little")
        if tail[4:] != _MAGIC or length + 12 > size:
            raise damaged_parquet("it has no footer")
        file.seek(size - 8 - length)
        return file.read(length)


def check_pages(path: Path, names: Sequence[str] | None = None) -> None:
    """Check the footer, and the pages of some columns.

    Parameters
    ----------
    path : Path
    names : sequence of str, optional
        Columns; all when not given.

    Raises
    ------
    InputError
        If a page does not fit its column, or announces too much.
    """
    data = footer_bytes(path)
    try:
        footer, _ = structure(data)
        parts = list(_parts(footer))
    except _OTHER_SHAPE:
        raise damaged_parquet("its footer cannot be read") from None
    size = path.stat().st_size
    with path.open("rb") as file:
        for part in parts:
            if names is None or part.name in names or part.name.partition(".")[0] in names:
                _check_part(file, size, part)


def _parts(footer: dict[int, Any]) -> Iterator[_Part]:
    rows = 0
    for group in footer[_GROUPS]:
        rows += group[_GROUP_ROWS]
        for column in group[_COLUMNS]:
            if column.get(_ELSEWHERE):
                raise damaged_parquet("its columns are in other files, which are not read")
            about = column[_ABOUT]
            begin = about[_BEGIN]
            first = about.get(_DICTIONARY_BEGIN, 0)
            begin = min(begin, first) if first > 0 else begin
            name = b".".join(about[_PATH]).decode("utf-8", "surrogateescape")
            yield _Part(name, begin, begin + about[_BYTES], about[_COUNT])
    if rows != footer[_ROWS]:
        raise damaged_parquet(f"it announces {footer[_ROWS]} rows and {rows} in its parts")


def _check_part(file: IO[bytes], size: int, part: _Part) -> None:
    if not 4 <= part.begin <= part.end <= size or part.values < 0:
        raise damaged_parquet(f"{part.label} is beyond the file's end")
    place, values = part.begin, 0
    while values < part.values:
        file.seek(place)
        window = file.read(min(_WINDOW, part.end - place))
        try:
            header, begin = structure(window)
            length, expanded = int(header[_LENGTH]), int(header[_EXPANDED])
            pages = [header[kind] for kind in (_DATA, _DATA_2) if kind in header]
            counts = [int(page[_VALUES]) for page in pages]
            words = int(header[_DICTIONARY][_VALUES]) if _DICTIONARY in header else 0
        except _OTHER_SHAPE:
            raise damaged_parquet(f"{part.label} has a page without a header") from None
        place += begin + length
        if min(length, expanded, words, *counts, 0) < 0 or place > part.end:
            raise damaged_parquet(f"{part.label} has a page that does not fit the column")
        check_size(max(expanded, 8 * words), size, part.label)
        values += sum(counts)
    if values != part.values:
        raise damaged_parquet(f"{part.label} has {values} of its {part.values} values")


def damaged_parquet(reason: str) -> InputError:
    """Return the sentence for a Parquet file that cannot be read."""
    return InputError(f"is a damaged or truncated Parquet file ({shown(reason)[:120]})")
