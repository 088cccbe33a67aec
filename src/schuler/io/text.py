"""Text tables: CSV, TSV, semicolons, blanks; cut into blocks that are parsed in parallel.

A file is cut at line ends into blocks of about 4 MB; PyArrow parses each with all cores, and the
next one is read while the caller works. Memory does not grow with the file.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import Chosen, choose
from schuler.io.content import Array, Block, Content
from schuler.io.dialect import NUMBER, Dialect, NoRowsError, detect, split
from schuler.io.mapping import Mapping

__all__ = ["TextReader", "TextTable", "arrange"]

_BLOCK_BYTES = 4 << 20
_HEAD = 1 << 16
_LONGEST = 1 << 20
_NULLS = ["", "NA", "N/A", "na", "n/a", "null", "NULL", "None"]
_FORTRAN = re.compile(rb"([0-9.])[dD]([+-]?[0-9])")


class TextReader:
    """Reader of any table of numbers in text."""

    name = "text"
    suffixes: tuple[str, ...] = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".tab")

    def sniff(self, head: bytes) -> bool:
        """Never: text is what a file is when it is nothing else."""
        return False

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Work out the layout and the columns; ``"-"`` is standard input."""
        if path == Path("-"):
            head, dialect = _look(sys.stdin.buffer, mapping, True)
        else:
            with path.open("rb") as file:
                head, dialect = b"", _look(file, mapping, False)[1]
        own = dialect.own
        chosen = choose(dialect.names, dialect.count, Mapping() if own else mapping)
        table = TextTable(path, dialect, chosen.all, head=head)
        said = chosen.said()
        if own is not None:
            said = _own_mapping(own).merged(said)
        return Content(
            blocks=lambda: arrange(table.blocks(), chosen),
            said=said,
            time_label=chosen.t_label,
            name=str(own["name"]) if own and "name" in own else None,
            notes=table.notes,
            progress=table.progress,
            complete=own is not None,
            follow=lambda: _arrange_growing(table.growing(), chosen),
        )


def _look(file: IO[bytes], mapping: Mapping, stream: bool) -> tuple[bytes, Dialect]:
    head = b""
    while True:
        # A pipe is not read ahead: what it holds now must be passed on now.
        more = file.read1(_HEAD) if stream else file.read(_HEAD)  # type: ignore[attr-defined]
        head += more
        try:
            return head, detect(head, not more, mapping)
        except NoRowsError:
            # A long preamble, or a pipe that has only just begun.
            if not more:
                raise


def _own_mapping(own: dict[str, Any]) -> Mapping:
    return Mapping(
        axes="RFU",
        coning_corrected=bool(own.get("coning_corrected", False)),
        sculling_corrected=bool(own.get("sculling_corrected", False)),
    )


def arrange(blocks: Iterator[dict[int, Array]], chosen: Chosen) -> Iterator[Block]:
    """Put a table's columns into their places in a row."""
    for columns in blocks:
        yield (
            None if chosen.t is None else columns[chosen.t],
            [columns[i] for i in chosen.values],
            None if chosen.dt is None else columns[chosen.dt],
        )


def _arrange_growing(
    blocks: Iterator[dict[int, Array] | None], chosen: Chosen
) -> Iterator[Block | None]:
    for columns in blocks:
        if columns is None:
            yield None
        else:
            yield from arrange(iter([columns]), chosen)


@dataclass
class TextTable:
    """Some columns of a text file as blocks of numbers.

    Parameters
    ----------
    path : Path
        The file.
    dialect : Dialect
        Its layout.
    columns : tuple of int
        Which columns to convert, from 0.
    head : bytes
        What has been read already of standard input, which cannot be read twice.
    block_bytes : int
        Size of the blocks.
    """

    path: Path
    dialect: Dialect
    columns: tuple[int, ...]
    head: bytes = b""
    block_bytes: int = 0
    notes: list[str] = field(default_factory=list)
    _read: int = 0
    _repairs: bool = False
    _used: bool = False

    def progress(self) -> float:
        """Fraction of the file that has been read; 0 for a stream."""
        if self.path == Path("-"):
            return 0.0
        return min(1.0, self._read / max(1, self.path.stat().st_size))

    def blocks(self) -> Iterator[dict[int, Array]]:
        """Yield the columns of each block, by number."""
        stream = self.path == Path("-")
        line, offset = self.dialect.line, self.dialect.offset
        with self._open() as file:
            rest = self._begin(file)
            while True:
                piece = file.read(self.block_bytes or _BLOCK_BYTES)
                self._read += len(piece)
                whole = not piece
                try:
                    block, rest = self._cut(rest, piece, whole)
                    if block:
                        yield self._parse(block)
                except _LineError as error:
                    # Lines are counted only when one is wrong: counting costs as much as parsing
                    # a tenth of the file.
                    if not stream:
                        line += self._lines(self.dialect.offset, offset)
                    raise error.at(line) from None
                offset += len(block)
                if stream:
                    line += block.count(b"\n")
                if whole:
                    return

    def growing(self) -> Iterator[dict[int, Array] | None]:
        """Yield what whole lines there are, and None whenever there is nothing new.

        Raises
        ------
        InputError
            If the file shrinks, besides what a row can be wrong about.
        """
        line = self.dialect.line
        stream = self.path == Path("-")
        with self._open() as file:
            rest = self._begin(file)
            pending = bool(rest)
            while True:
                # What a pipe holds now is passed on now.
                take = file.read1 if stream else file.read  # type: ignore[attr-defined]
                piece = b"" if pending else take(_BLOCK_BYTES)
                self._read += len(piece)
                if not piece and not pending:
                    if stream:
                        return
                    if not self.path.exists() or self.path.stat().st_size < self._read:
                        raise InputError("has become shorter while it was followed; start again")
                    yield None
                    continue
                pending = False
                try:
                    block, rest = self._cut(rest, piece, False)
                    if block:
                        yield self._parse(block)
                except _LineError as error:
                    raise error.at(line) from None
                line += block.count(b"\n")

    # ------------------------------------------------------------------------------

    def _open(self) -> AbstractContextManager[IO[bytes]]:
        if self.path == Path("-"):
            if self._used:
                raise InputError("standard input can be read only once")
            self._used = True
            return nullcontext(sys.stdin.buffer)
        return self.path.open("rb")

    def _begin(self, file: IO[bytes]) -> bytes:
        if self.path == Path("-"):
            self._read = len(self.head)
            return self.head[self.dialect.offset :]
        file.seek(self.dialect.offset)
        self._read = self.dialect.offset
        return b""

    def _lines(self, begin: int, end: int) -> int:
        count = 0
        with self.path.open("rb") as file:
            file.seek(begin)
            while begin < end:
                piece = file.read(min(_BLOCK_BYTES, end - begin))
                if not piece:
                    break
                count += piece.count(b"\n")
                begin += len(piece)
        return count

    def _cut(self, rest: bytes, piece: bytes, whole: bool) -> tuple[bytes, bytes]:
        """Return the whole lines of what is there, and what is left of the last one."""
        if whole:
            return self._end(rest), b""
        end = piece.rfind(b"\n") + 1
        if end:
            return rest + piece[:end], piece[end:]
        end = rest.rfind(b"\n") + 1
        if end:
            return rest[:end], rest[end:] + piece
        if len(rest) + len(piece) > _LONGEST:
            raise _LineError(0, "is longer than 1 MB: this is no table of rows")
        return b"", rest + piece

    def _end(self, rest: bytes) -> bytes:
        """Drop a last line that was cut off while it was written."""
        begin = rest.rfind(b"\n") + 1
        tail = rest[begin:].decode("utf-8", errors="replace").strip()
        if not tail or tail.encode().startswith(self.dialect.comment):
            return rest[:begin]
        if len(split(tail, self.dialect.delimiter)) < self.dialect.count:
            self.notes.append(f"the last line is cut off and was dropped: '{tail[:60]}'")
            return rest[:begin]
        return rest + b"\n"

    def _parse(self, block: bytes) -> dict[int, Array]:
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
            column_types={name: pa.float64() for name in wanted},
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
            return {i: _numbers(table.column(str(i))) for i in self.columns}

    def _clean(self, block: bytes) -> bytes:
        """Leave only rows, with one mark between cells."""
        d = self.dialect
        if any(mark in block for mark in d.comment):
            marks = b"|".join(re.escape(mark) for mark in d.comment)
            block = re.sub(rb"(?m)^[ \t]*(?:" + marks + rb")[^\n]*$", b"", block)
        if d.delimiter == " ":
            block = _single_blanks(block)
        return _repaired(block) if self._repairs else block

    def _diagnose(self, block: bytes, reason: str) -> _LineError:
        """Find the first bad line in a block that could not be parsed."""
        d = self.dialect
        for i, raw in enumerate(block.split(b"\n")):
            text = raw.decode("utf-8", errors="replace").strip(" \r")
            if not text.strip() or text.strip().encode().startswith(d.comment):
                continue
            if "\r" in text or (d.quoted and text.count('"') % 2):
                what = "carriage return" if "\r" in text else "quotation mark without its pair"
                return _LineError(i, f"has a {what} inside: {text[:60]!r}; remove it")
            cells = split(text, d.delimiter, quoted=d.quoted)
            if len(cells) != d.count:
                return _LineError(
                    i,
                    f"has {len(cells)} cells, expected {d.count}: '{text[:60]}'; "
                    "repair or remove the line",
                )
            for j in self.columns:
                cell = cells[j]
                if d.decimal == ",":
                    cell = cell.replace(",", ".") if "." not in cell else "."
                if not NUMBER.fullmatch(cell):
                    label = f"'{d.names[j]}'" if d.names else str(j + 1)
                    return _LineError(
                        i,
                        f"column {label}: '{cells[j][:40]}' is not a number; "
                        "repair the cell or leave it empty",
                    )
        return _LineError(0, f"and those after it cannot be parsed ({reason[:120]})")


class _LineError(Exception):
    """Something is wrong with line `i` (from 0) of a block."""

    def __init__(self, i: int, text: str) -> None:
        super().__init__(text)
        self.i = i

    def at(self, line: int) -> InputError:
        mark = "" if str(self).startswith(("has", "is", "and")) else ","
        return InputError(f"line {line + self.i}{mark} {self}")


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


def _numbers(column: Any) -> Array:
    values = column.to_numpy()
    return np.asarray(values, np.float64)
