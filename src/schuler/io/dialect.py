"""The layout of a text file, worked out from its beginning: separator, comments, names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from schuler.errors import InputError
from schuler.io.columns import choose
from schuler.io.mapping import Mapping
from schuler.io.own import parse_own

__all__ = ["MAGIC", "NUMBER", "Dialect", "NoRowsError", "detect", "split"]

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
    hint: str | None = None
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
            delimiter = mapping.delimiter or _guess_delimiter(line, mapping.decimal)
            # A line of words cannot be data: it is the header, unless that is denied or behind us.
            words = any(not _numeric(cell, mapping.decimal) for cell in split(line, delimiter))
            if mapping.header is not False and header is None and (mapping.header or words):
                header = (line, number)
            else:
                break
        elif number > skip and text:
            if line.startswith(MAGIC):
                try:
                    own = parse_own(line[len(MAGIC) :], "there")
                except InputError as error:
                    raise InputError(f"line {number}: {error}") from None
            hint = text.lstrip("".join(marks)).strip()
        offset = stop + 1
        if end < 0:
            what = "has a header but no data rows" if header else "has no data rows"
            raise NoRowsError(what)
    delimiter = mapping.delimiter or _guess_delimiter(
        line if header is None else header[0], mapping.decimal
    )
    cells = split(line, delimiter)
    if len(cells) > _MOST_COLUMNS:
        raise InputError(
            f"line {number} has {len(cells)} columns, where {_MOST_COLUMNS} are the most: this is "
            "no table of samples, or another mark separates its cells (--delimiter)"
        )
    if header and not any(_numeric(cell, mapping.decimal) for cell in cells):
        raise InputError(
            f"line {number} ('{line.strip()[:60]}') is not a row of numbers; if the table begins "
            "below it, pass over the lines before the table with --skip-rows"
        )
    names = _names(header, hint, delimiter, len(cells), mapping)
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
    )


def _guess_delimiter(line: str, decimal: str | None) -> str:
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
    hint: str | None,
    delimiter: str,
    count: int,
    mapping: Mapping,
) -> tuple[str, ...] | None:
    if header is not None:
        return tuple(_name_cells(header[0], delimiter))
    if hint is None or mapping.header is False or mapping.columns is not None:
        return None
    # NumPy's savetxt and many loggers put the names into the last comment before the data.
    names = _name_cells(hint, delimiter)
    if len(names) != count and delimiter != " ":
        names = _name_cells(hint, " ")
    if len(names) != count:
        return None
    try:
        choose(names, count, mapping)
    except InputError:
        return None
    return tuple(names)


def _name_cells(line: str, delimiter: str) -> list[str]:
    if delimiter != " ":
        return split(line, delimiter)
    # "gx [deg/s]" is one name although it holds a blank.
    plain = " ".join(line.replace('"', "").split())
    joined = re.sub(r" (?=[\[(])", "\0", plain)
    joined = re.sub(r"[\[(][^\[\]()]*[\])]", lambda m: m.group(0).replace(" ", "\0"), joined)
    return [" ".join(cell.split("\0")) for cell in joined.split()]
