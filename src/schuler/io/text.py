"""Text tables: CSV, TSV, semicolons, blanks; cut into blocks that are parsed in parallel.

A file is cut at line ends into blocks of about 16 MB; PyArrow parses each with all cores, and the
next one is read while the caller works. Memory does not grow with the file.
"""

from __future__ import annotations

import os
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

_BLOCK_BYTES = 16 << 20
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
        chosen = choose(dialect.names, dialect.count, mapping)
        table = TextTable(path, dialect, chosen.all, head=head)
        own = dialect.own
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
    _fortran: bool = False
    _used: bool = False

    def progress(self) -> float:
        """Fraction of the file that has been read; 0 for a stream."""
        if self.path == Path("-"):
            return 0.0
        return min(1.0, self._read / max(1, self.path.stat().st_size))

    def blocks(self) -> Iterator[dict[int, Array]]:
        """Yield the columns of each block, by number."""
        line = self.dialect.line
        with self._open() as file:
            rest = self._begin(file)
            while True:
                piece = file.read(self.block_bytes or _BLOCK_BYTES)
                self._read += len(piece)
                whole = not piece
                block, rest = self._cut(rest, piece, line, whole)
                if block:
                    yield self._parse(block, line, last=whole)
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
            pending = True
            while True:
                piece = (
                    file.read1(_BLOCK_BYTES) if stream else file.read(_BLOCK_BYTES)  # type: ignore[attr-defined]
                )
                self._read += len(piece)
                if not piece and not pending:
                    if stream:
                        return
                    if os.fstat(file.fileno()).st_size < self._read or not self.path.exists():
                        raise InputError("has become shorter while it was followed; start again")
                    yield None
                    continue
                pending = False
                block, rest = self._cut(rest, piece, line, False)
                if block:
                    yield self._parse(block, line, last=False)
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

    def _cut(self, rest: bytes, piece: bytes, line: int, whole: bool) -> tuple[bytes, bytes]:
        if whole:
            return self._end(rest, line), b""
        end = piece.rfind(b"\n") + 1
        if end:
            return rest + piece[:end], piece[end:]
        end = rest.rfind(b"\n") + 1
        if end:
            return rest[:end], rest[end:] + piece
        if len(rest) + len(piece) > _LONGEST:
            raise InputError(f"line {line} is longer than 1 MB: this is no table of rows")
        return b"", rest + piece

    def _end(self, rest: bytes, line: int) -> bytes:
        """Drop a last line that was cut off while it was written."""
        begin = rest.rfind(b"\n") + 1
        tail = rest[begin:].decode("utf-8", errors="replace").strip()
        if not tail or tail.encode().startswith(self.dialect.comment):
            return rest[:begin]
        if len(split(tail, self.dialect.delimiter)) < self.dialect.count:
            number = line + rest[:begin].count(b"\n")
            self.notes.append(f"the last line ({number}) is cut off and was dropped: '{tail[:60]}'")
            return rest[:begin]
        return rest + b"\n"

    def _parse(self, block: bytes, line: int, last: bool) -> dict[int, Array]:
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
        for _ in range(2):
            try:
                table = csv.read_csv(pa.BufferReader(clean), read, parse, convert, pool)
            except pa.ArrowInvalid as error:
                fixed = _FORTRAN.sub(rb"\1e\2", clean)
                if fixed != clean:
                    self._fortran, clean = True, fixed
                    continue
                raise self._diagnose(block, line, str(error)) from None
            return {i: _numbers(table.column(str(i))) for i in self.columns}
        raise self._diagnose(block, line, "unknown reason")

    def _clean(self, block: bytes) -> bytes:
        """Leave only rows, with one mark between cells."""
        d = self.dialect
        if any(mark in block for mark in d.comment):
            marks = b"|".join(re.escape(mark) for mark in d.comment)
            block = re.sub(rb"(?m)^[ \t]*(?:" + marks + rb")[^\n]*$", b"", block)
        if self._fortran:
            block = _FORTRAN.sub(rb"\1e\2", block)
        if d.delimiter != " ":
            if b"\n " in block or b"\n\t" in block or block[:1] in b" \t":
                block = re.sub(rb"(?m)^[ \t\r]+$", b"", block)
            return block
        # Blanks: whole-block replacements, which are several times faster than a pattern.
        if b"\t" in block:
            block = block.replace(b"\t", b" ")
        if b"\r" in block:
            block = block.replace(b"\r", b"")
        for run in (b" " * 8, b" " * 4, b" " * 3):
            if run in block:
                block = block.replace(run, b" ")
        while b"  " in block:
            block = block.replace(b"  ", b" ")
        if b" \n" in block:
            block = block.replace(b" \n", b"\n")
        if b"\n " in block:
            block = block.replace(b"\n ", b"\n")
        return block[1:] if block[:1] == b" " else block

    def _diagnose(self, block: bytes, line: int, reason: str) -> InputError:
        """Find the first bad line in a block that could not be parsed."""
        d = self.dialect
        for i, raw in enumerate(block.split(b"\n")):
            text = raw.decode("utf-8", errors="replace").strip(" \r")
            if not text.strip() or text.strip().encode().startswith(d.comment):
                continue
            cells = split(text, d.delimiter)
            where = f"line {line + i}"
            if len(cells) != d.count:
                return InputError(
                    f"{where} has {len(cells)} cells, expected {d.count}: '{text[:60]}'; "
                    "repair or remove the line"
                )
            for j in self.columns:
                cell = cells[j]
                if d.decimal == ",":
                    cell = cell.replace(",", ".") if "." not in cell else "."
                if not NUMBER.fullmatch(cell):
                    label = f"'{d.names[j]}'" if d.names else str(j + 1)
                    return InputError(
                        f"{where}, column {label}: '{cells[j][:40]}' is not a number; "
                        "repair the cell or leave it empty"
                    )
        return InputError(f"the lines from {line} on cannot be parsed ({reason[:120]})")


def _numbers(column: Any) -> Array:
    values = column.to_numpy()
    return np.asarray(values, np.float64)
