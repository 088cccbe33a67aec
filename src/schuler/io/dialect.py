"""The layout of a text file, worked out from its beginning: separator, comments, names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from schuler.errors import InputError, located
from schuler.io.columns import choose
from schuler.io.instants import is_instant
from schuler.io.mapping import Mapping
from schuler.io.own import parse_own
from schuler.units import known_unit

__all__ = [
    "MAGIC",
    "NUMBER",
    "Dialect",
    "NoRowsError",
    "detect",
    "guess_delimiter",
    "split",
    "valued",
]

#: what a cell may hold: a number (Fortran's D too), infinity, or a way to say "none"
NUMBER = re.compile(
    r"[+-]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?|nan|inf|infinity)|NA|N/A|null|",
    re.IGNORECASE,
)

#: begins the comment in which schuler's own CSV files say what they hold
MAGIC = "# schuler "

#: the longest line that can be a row of a table
_LONGEST = 1 << 20
_MOST_COLUMNS = 4096


class NoRowsError(InputError):
    """There are no data rows (yet)."""


@dataclass(frozen=True)
class Dialect:
    """A text file's layout.

    Parameters
    ----------
    delimiter : str
        A mark, or ``" "`` for any run of blanks.
    comment : tuple of bytes
        What begins a comment line.
    decimal : str
        Decimal mark.
    quoted : bool
        Whether cells are in quotation marks.
    names : tuple of str or None
        The columns' names.
    count : int
        Number of columns.
    offset : int
        Byte at which the data begin.
    line : int
        Line of the file at which they begin, from 1.
    own : dict or None
        What schuler wrote about the file.
    first : tuple of str
        The cells of the first row.
    """

    delimiter: str
    comment: tuple[bytes, ...]
    decimal: str
    quoted: bool
    names: tuple[str, ...] | None
    count: int
    offset: int
    line: int
    own: dict[str, Any] | None = None
    first: tuple[str, ...] = ()


def split(line: str, delimiter: str, *, quoted: bool = True) -> list[str]:
    """Cut a line into stripped cells, without quotation marks where there may be some."""
    cells = line.split() if delimiter == " " else line.split(delimiter)
    if not quoted:
        return [cell.strip() for cell in cells]
    return [cell.strip().strip('"').strip() for cell in cells]


def detect(head: bytes, whole: bool, mapping: Mapping) -> Dialect:
    """Work out a text file's layout.

    Parameters
    ----------
    head : bytes
        The file's beginning.
    whole : bool
        Whether that is the whole file; else its last line may be cut off.
    mapping : Mapping
        What the user says about the layout.

    Raises
    ------
    NoRowsError
        If there is no data row.
    InputError
        If this is no text, or the layout contradicts the mapping.
    """
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError("is UTF-16 text; save it as UTF-8")
    if b"\0" in head:
        raise InputError("is neither text nor a known binary format")
    begin = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    marks = (mapping.comment,) if mapping.comment else ("#", "%")
    offset, number = begin, 0
    own: dict[str, Any] | None = None
    hints: list[str] = []
    units: list[str] | None = None
    header: tuple[str, int] | None = None
    skip = mapping.skip_rows or 0
    while True:
        end = head.find(b"\n", offset)
        if end < 0 and not (whole and offset < len(head)):
            if len(head) - offset > _LONGEST:
                raise InputError(f"line {number + 1} is longer than 1 MB: this is no table of rows")
            what = "has a header but no data rows" if header else "has no data rows"
            raise NoRowsError(what if head.strip() else "is empty")
        stop = len(head) if end < 0 else end
        if stop - offset > _LONGEST:
            raise InputError(f"line {number + 1} is longer than 1 MB: this is no table of rows")
        line = head[offset:stop].decode("utf-8", errors="replace").rstrip("\r")
        number += 1
        text = line.strip()
        if "\r" in text.replace("\r\r", ""):
            raise InputError("has old Macintosh line ends (CR alone); convert them to LF")
        if number > skip and text and not text.startswith(marks):
            delimiter = mapping.delimiter or guess_delimiter(line, mapping.decimal)
            if mapping.header is not False and header is None:
                after = _next_row(head, stop + 1, marks)
                if mapping.header or _is_header(line, after, delimiter, mapping.decimal):
                    header = (line, number)
                else:
                    break
            elif header is not None and units is None and _units_row(line, delimiter):
                units = _units_row(line, delimiter)
            else:
                break
        elif number > skip and text:
            if line.startswith(MAGIC):
                with located(f"line {number}"):
                    own = parse_own(line[len(MAGIC) :], "there")
            hints = [*hints[-1:], text.lstrip("".join(marks)).strip()]
        offset = stop + 1
        if end < 0:
            what = "has a header but no data rows" if header else "has no data rows"
            raise NoRowsError(what)
    delimiter = mapping.delimiter or guess_delimiter(
        line if header is None else header[0], mapping.decimal
    )
    cells = split(line, delimiter)
    if len(cells) > _MOST_COLUMNS:
        raise InputError(
            f"line {number} has {len(cells)} columns, where {_MOST_COLUMNS} are the most: this is "
            "no table of samples, or another mark separates its cells (--delimiter)"
        )
    if header and not any(valued(cell, mapping.decimal) for cell in cells):
        raise InputError(
            f"line {number} ('{line.strip()[:60]}') is not a row of numbers; if the table begins "
            "below it, pass over the lines before the table with --skip-rows"
        )
    names = _names(header, hints, delimiter, len(cells), mapping)
    if header and names and len(names) != len(cells):
        if len(names) == len(cells) - 1 and not cells[-1]:
            names = (*names, "")
        elif len(cells) == len(names) - 1 and not names[-1]:
            names = names[:-1]
        else:
            raise InputError(
                f"line {number} has {len(cells)} cells, but the header in line {header[1]} names "
                f"{len(names)} columns"
            )
    if names and units is not None:
        names = _with_units(names, units)
    decimal = mapping.decimal or ("," if delimiter == ";" and "," in line else ".")
    return Dialect(
        delimiter,
        tuple(mark.encode() for mark in marks),
        decimal,
        '"' in line,
        names,
        len(cells),
        offset,
        number,
        own,
        tuple(cells),
    )


def _next_row(head: bytes, offset: int, marks: tuple[str, ...]) -> str | None:
    """Return the next line that is neither empty nor a comment; None where there is none yet."""
    while offset < len(head):
        end = head.find(b"\n", offset)
        stop = len(head) if end < 0 else end
        line = head[offset : min(stop, offset + _LONGEST)].decode("utf-8", errors="replace")
        if line.strip() and not line.strip().startswith(marks):
            return line.rstrip("\r")
        offset = stop + 1
    return None


def _is_header(line: str, after: str | None, delimiter: str, decimal: str | None) -> bool:
    """Say whether a line names columns: one cell that is no number does not make it a header.

    A row may hold texts (a frame's name, a date). A line is a header where most of its cells are
    words, or where a word stands above a number and the other cells are whole numbers.
    """
    cells = split(line, delimiter)
    words = [cell for cell in cells if not _numeric(cell, decimal) and not is_instant(cell)]
    numbers = [cell for cell in cells if cell and valued(cell, decimal)]
    if len(words) > len(numbers) or not words:
        return bool(words)
    if after is None or not all(cell.isdigit() for cell in numbers):
        return False
    below = split(after, delimiter)
    return any(
        cell in words and under and valued(under, decimal)
        for cell, under in zip(cells, below, strict=False)
    )


def _units_row(line: str, delimiter: str) -> list[str] | None:
    """Return the units of a row of units below the names, or None where it is none."""
    if delimiter == " ":
        cells = re.findall(r"\[[^\]]*\]|\([^)]*\)|\S+", line)
    else:
        cells = split(line, delimiter)
    plain = [cell.strip("[]() ").strip() for cell in cells]
    if any(valued(cell, None) for cell in plain):
        return None
    said = [cell for cell in plain if cell not in ("", "-", "none", "n/a", "counts")]
    known = sum(known_unit(cell) for cell in said)
    return plain if said and known >= max(1, len(said) / 2) else None


def _with_units(names: tuple[str, ...], units: list[str]) -> tuple[str, ...]:
    padded = [*units, *[""] * len(names)]
    return tuple(
        f"{name} [{unit}]" if name and unit and known_unit(unit) else name
        for name, unit in zip(names, padded, strict=False)
    )


def valued(cell: str, decimal: str | None) -> bool:
    """Say whether a cell holds a number, or a date or time."""
    return bool(cell) and (_numeric(cell, decimal) or is_instant(cell))


def guess_delimiter(line: str, decimal: str | None) -> str:
    """Return what separates the cells of a line: a mark, or a blank for any run of blanks."""
    for mark in ("\t", ";", ","):
        if mark not in line or mark == decimal:
            continue
        # Tabs between blanks, or blanks between numbers, are all just blanks.
        inside = any(len(cell.split()) > 1 for cell in line.split(mark))
        if mark == "\t" and inside and all(NUMBER.fullmatch(cell) for cell in line.split()):
            return " "
        return mark
    return " "


def _numeric(cell: str, decimal: str | None) -> bool:
    if NUMBER.fullmatch(cell):
        return True
    return decimal != "." and bool(NUMBER.fullmatch(cell.replace(",", ".")))


def _names(
    header: tuple[str, int] | None,
    hints: list[str],
    delimiter: str,
    count: int,
    mapping: Mapping,
) -> tuple[str, ...] | None:
    if header is not None:
        return tuple(_name_cells(header[0], delimiter))
    if not hints or mapping.header is False or mapping.columns is not None:
        return None
    # NumPy's savetxt and many loggers put the names into the last comment before the data, or
    # into the last but one, with the units below them.
    tries: list[tuple[str, list[str] | None]] = [(hints[-1], None)]
    units = _units_row(hints[-1], delimiter) or _units_row(hints[-1], " ")
    if len(hints) > 1 and units is not None:
        tries.insert(0, (hints[-2], units))
    for text, below in tries:
        for mark in (delimiter, ",", ";", "\t", " "):
            names = tuple(_name_cells(text, mark))
            if len(names) != count:
                continue
            names = names if below is None else _with_units(names, below)
            try:
                choose(names, count, mapping)
            except InputError:
                continue
            return names
    return None


def _name_cells(line: str, delimiter: str) -> list[str]:
    if delimiter != " ":
        return split(line, delimiter)
    # "gx [deg/s]" is one name although it holds a blank.
    plain = " ".join(line.replace('"', "").split())
    joined = re.sub(r" (?=[\[(])", "\0", plain)
    joined = re.sub(r"[\[(][^\[\]()]*[\])]", lambda m: m.group(0).replace(" ", "\0"), joined)
    return [" ".join(cell.split("\0")) for cell in joined.split()]
