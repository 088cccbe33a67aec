"""From a block of text lines to columns of numbers, and the words for a line that is none."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler._arrow import numbers
from schuler.errors import InputError, shown
from schuler.io.content import Array
from schuler.io.dialect import NUMBER, Dialect, split
from schuler.io.instants import InstantError, is_instant, seconds_of

__all__ = ["Cells", "LineError"]

_NULLS = ["", "NA", "N/A", "na", "n/a", "null", "NULL", "None"]
_FORTRAN = re.compile(rb"([0-9.])[dD]([+-]?[0-9])")


class LineError(Exception):
    """Something is wrong with line `i` (from 0) of a block."""

    def __init__(self, i: int, text: str) -> None:
        super().__init__(text)
        self.i = i

    def at(self, line: int) -> InputError:
        """Return the error to show for a block that begins at this line of the file."""
        mark = "" if str(self).startswith(("has", "is", "and")) else ","
        return InputError(f"line {line + self.i}{mark} {self}")


@dataclass
class Cells:
    """Parses blocks of one text table.

    Parameters
    ----------
    dialect : Dialect
        The table's layout.
    columns : tuple of int
        Which columns to convert, from 0.
    instants : tuple of int
        Those of them that hold dates or times of day, which become seconds.
    """

    dialect: Dialect
    columns: tuple[int, ...]
    instants: tuple[int, ...] = ()
    _repairs: bool = False

    def parse(self, block: bytes) -> dict[int, Array]:
        """Turn a block of whole lines into its columns, by number.

        Raises
        ------
        LineError
            For the first line that is no row of numbers.
        """
        import pyarrow as pa
        from pyarrow import csv

        d = self.dialect
        clean = self._clean(block)
        names = [str(i) for i in range(d.count)]
        wanted = [str(i) for i in self.columns]
        if not clean.strip():
            return {i: np.empty(0) for i in self.columns}
        read = csv.ReadOptions(column_names=names, block_size=1 << 20)
        parse = csv.ParseOptions(delimiter=d.delimiter, quote_char='"' if d.quoted else False)
        convert = csv.ConvertOptions(
            column_types={
                name: pa.string() if int(name) in self.instants else pa.float64() for name in wanted
            },
            strings_can_be_null=True,
            include_columns=wanted,
            null_values=_NULLS,
            decimal_point=d.decimal,
        )
        # The system's pool gives memory back; Arrow's own keeps what a file once needed.
        pool = pa.system_memory_pool()
        while True:
            try:
                table = csv.read_csv(pa.BufferReader(clean), read, parse, convert, pool)
            except pa.ArrowInvalid as error:
                if self._repairs:
                    raise self._diagnose(block, str(error)) from None
                # Rare spellings are looked for only once something could not be read.
                self._repairs = True
                clean = _repaired(clean)
                if not clean.strip():
                    return {i: np.empty(0) for i in self.columns}
                continue
            try:
                return {i: self._values(i, table.column(str(i))) for i in self.columns}
            except InstantError:
                raise self._diagnose(block, "a time cannot be read") from None

    def _values(self, i: int, column: Any) -> Array:
        if i in self.instants:
            return seconds_of(column.to_pylist())
        return np.asarray(numbers(column), np.float64)

    def _clean(self, block: bytes) -> bytes:
        """Leave only rows, with one mark between cells."""
        d = self.dialect
        if any(mark in block for mark in d.comment):
            marks = b"|".join(re.escape(mark) for mark in d.comment)
            block = re.sub(rb"(?m)^[ \t]*(?:" + marks + rb")[^\n]*$", b"", block)
        if d.delimiter == " ":
            block = _single_blanks(block)
        return _repaired(block) if self._repairs else block

    def _diagnose(self, block: bytes, reason: str) -> LineError:
        """Find the first bad line in a block that could not be parsed."""
        d = self.dialect
        for i, raw in enumerate(block.split(b"\n")):
            text = raw.decode("utf-8", errors="replace").strip(" \r")
            if not text.strip() or text.strip().encode().startswith(d.comment):
                continue
            if "\r" in text or (d.quoted and text.count('"') % 2):
                what = "carriage return" if "\r" in text else "quotation mark without its pair"
                return LineError(i, f"has a {what} inside: {text[:60]!r}; remove it")
            cells = split(text, d.delimiter, quoted=d.quoted)
            if len(cells) != d.count:
                return LineError(
                    i,
                    f"has {len(cells)} cells, expected {d.count}: '{shown(text[:60])}'; "
                    "repair or remove the line",
                )
            for j in self.columns:
                cell = cells[j]
                if j in self.instants:
                    if cell and not is_instant(cell):
                        return LineError(
                            i,
                            f"column {self._label(j)}: '{shown(cell[:40])}' is no date and time "
                            "like those above it; repair the cell, or give --rate",
                        )
                    continue
                if d.decimal == ",":
                    cell = cell.replace(",", ".") if "." not in cell else "."
                if not NUMBER.fullmatch(cell):
                    return LineError(
                        i,
                        f"column {self._label(j)}: '{shown(cells[j][:40])}' is not a number; "
                        "repair the cell or leave it empty",
                    )
        return LineError(0, f"and those after it cannot be parsed ({reason[:120]})")

    def _label(self, j: int) -> str:
        names = self.dialect.names
        return f"'{shown(names[j])}'" if names else str(j + 1)


def _repaired(block: bytes) -> bytes:
    """Turn Fortran's exponents into usual ones and empty lines of blanks."""
    block = _FORTRAN.sub(rb"\1e\2", block)
    return re.sub(rb"(?m)^[ \t\r]+$", b"", block)


def _single_blanks(block: bytes) -> bytes:
    """Leave one blank between cells and none at a line's ends."""
    for mark in (b"\t", b"\r"):
        if mark in block:
            block = block.replace(mark, b" ")
    # Whole-array comparisons: eight times faster than a pattern.
    a = np.frombuffer(block, np.uint8)
    blank = a == 32
    drop = blank[:-1] & (blank | (a == 10))[1:]
    if drop.any():
        a = a[:-1][~drop] if blank[-1] else np.append(a[:-1][~drop], a[-1])
        blank = a == 32
    drop = blank[1:] & (a[:-1] == 10)
    if drop.any():
        a = np.append(a[:1], a[1:][~drop])
    return a.tobytes().lstrip(b" ")
