"""Text tables: CSV, TSV, semicolons, blanks; cut into blocks that are parsed in parallel.

A file is cut at line ends into blocks of about 4 MB; PyArrow parses each with all cores, and the
next one is read while the caller works. Memory does not grow with the file.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

from schuler.errors import InputError, shown
from schuler.io.cells import Cells, LineError
from schuler.io.columns import Chosen, choose
from schuler.io.content import Array, Block, Content
from schuler.io.dialect import Dialect, NoRowsError, detect, split
from schuler.io.flow import readable
from schuler.io.instants import has_zone, is_instant
from schuler.io.labelled import LabelledCells, LabelledTable, find_labelled
from schuler.io.mapping import Mapping
from schuler.io.own import own_mapping, own_name

__all__ = ["TextReader", "TextTable", "arrange"]

_BLOCK_BYTES = 4 << 20
_HEAD = 1 << 16
_LONGEST = 1 << 20
#: how far before the data a file's layout is looked for
_LONGEST_HEAD = 16 << 20
_RECENT = 1 << 13
_LOOK_BACK = 50
#: what can stand after a whole number
_ENDS = (b" ", b"\t", b"\r", b'"')


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
                labelled = find_labelled(file.read(_HEAD), mapping)
                if labelled is not None:
                    return _open_labelled(path, labelled, mapping)
                file.seek(0)
                head, dialect = b"", _look(file, mapping, False)[1]
        own = dialect.own
        whole = Mapping(array=mapping.array)
        chosen = choose(dialect.names, dialect.count, whole if own else mapping)
        instants, label, notes = _instants(dialect, chosen, mapping)
        table = TextTable(path, dialect, chosen.all, head=head, instants=instants, notes=notes)
        stamps, sample = table.first_rows(chosen)
        said = chosen.said()
        if instants:
            said = replace(said, time="s")
        if own is not None:
            said = own_mapping(own).merged(said)
        return Content(
            blocks=lambda: arrange(table.blocks(), chosen),
            said=said,
            time_label=label,
            mark=chosen.mark,
            stamps=stamps,
            sample=sample,
            name=own_name(own),
            notes=table.notes,
            progress=table.progress,
            complete=own is not None,
            follow=lambda: _arrange_growing(table.growing(), chosen),
        )


def _open_labelled(path: Path, labelled: LabelledTable, mapping: Mapping) -> Content:
    """Open a file whose rows name their sensor."""
    dialect = labelled.dialect
    chosen = choose(dialect.names, len(dialect.names or ()), mapping)
    instants, label, notes = _instants(dialect, chosen, mapping)
    table = TextTable(
        path, dialect, chosen.all, instants=instants, notes=[labelled.note, *notes],
        parser=LabelledCells(labelled),
    )  # fmt: skip
    stamps, sample = table.first_rows(chosen)
    said = chosen.said()
    return Content(
        blocks=lambda: arrange(table.blocks(), chosen),
        said=replace(said, time="s") if instants else said,
        time_label=label,
        mark=chosen.mark,
        stamps=stamps,
        sample=sample,
        notes=table.notes,
        progress=table.progress,
    )


def _instants(
    dialect: Dialect, chosen: Chosen, mapping: Mapping
) -> tuple[tuple[int, ...], str, list[str]]:
    """Return the time column where it holds dates, what messages call it, and what to note."""
    if chosen.t is None or not is_instant(dialect.first[chosen.t]):
        return (), chosen.t_label, []
    if mapping.time is not None:
        raise InputError(
            f"{chosen.t_label} holds dates or times of day ('{shown(dialect.first[chosen.t])}'), "
            f"which have no unit; leave out the time's unit '{mapping.time}'"
        )
    zone = has_zone(dialect.first[chosen.t])
    what = "times of day" if zone is None else "dates and times, UTC"
    notes = ["its dates have no zone and were taken for UTC"] if zone is False else []
    return (chosen.t,), f"{chosen.t_label} ({what})", notes


def _look(file: IO[bytes], mapping: Mapping, stream: bool) -> tuple[bytes, Dialect]:
    head = b""
    while True:
        # A pipe is not read ahead: what it holds now must be passed on now.
        # More each time: else a long preamble would be gone through over and over.
        size = max(_HEAD, 3 * len(head))
        more = file.read1(size) if stream else file.read(size)  # type: ignore[attr-defined]
        head += more
        if len(head) > _LONGEST_HEAD:
            raise InputError(
                f"has no row of numbers in its first {_LONGEST_HEAD >> 20} MB: cut off what is "
                "before the table"
            )
        try:
            return head, detect(head, not more, mapping)
        except NoRowsError:
            # A long preamble, or a pipe that has only just begun.
            if not more:
                raise


def _form(cell: str, decimal: str) -> tuple[int, int, int]:
    """Return how a number is written: decimals, digits of the exponent, else its length."""
    mantissa, _, exponent = cell.lower().replace("d", "e").partition("e")
    whole, _, decimals = mantissa.lstrip("+-").partition(decimal)
    if decimals or exponent:
        return len(decimals), len(exponent), 0
    return 0, 0, len(whole)


def arrange(blocks: Iterator[dict[int, Array]], chosen: Chosen) -> Iterator[Block]:
    """Put a table's columns into their places in a row."""
    for columns in blocks:
        yield (
            _time(columns, chosen),
            [columns[i] for i in chosen.values],
            None if chosen.dt is None else columns[chosen.dt],
        )


def _time(columns: dict[int, Array], chosen: Chosen) -> Array | None:
    if chosen.t is None:
        return None
    time = columns[chosen.t]
    return time if chosen.t_part is None else time + chosen.t_part_unit * columns[chosen.t_part]


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
    parser : LabelledCells, optional
        What makes columns of a block; `Cells` of the layout when not given.
    """

    path: Path
    dialect: Dialect
    columns: tuple[int, ...]
    head: bytes = b""
    block_bytes: int = 0
    notes: list[str] = field(default_factory=list)
    instants: tuple[int, ...] = ()
    parser: LabelledCells | None = None
    _recent: bytes = b""
    _read: int = 0
    _used: bool = False

    def __post_init__(self) -> None:
        self._cells = self.parser or Cells(self.dialect, self.columns, self.instants)

    def first_rows(self, chosen: Chosen) -> tuple[Array | None, list[Array] | None]:
        """Return the first stamps and values of a file, as far as they can be read.

        None for a stream, and where something is wrong, which is said when the rows are read.
        """
        if self.path == Path("-"):
            return None, None
        with self.path.open("rb") as file:
            file.seek(self.dialect.offset)
            head = file.read(_HEAD)
        # Whole lines only: the last may be half of one.
        block = head[: head.rfind(b"\n") + 1]
        try:
            columns = self._cells.parse(block)
        except LineError:
            return None, None
        return _time(columns, chosen), [columns[i] for i in chosen.values]

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
                        self._recent = block[-_RECENT:]
                        yield self._cells.parse(block)
                except LineError as error:
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
                if stream and not pending and not readable(file, 0.0):
                    yield None
                    continue
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
                        yield self._cells.parse(block)
                except LineError as error:
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
            raise LineError(0, "is longer than 1 MB: this is no table of rows")
        return b"", rest + piece

    def _end(self, rest: bytes) -> bytes:
        """Drop a last line that was cut off while it was written, or may have been."""
        begin = rest.rfind(b"\n") + 1
        tail = rest[begin:].decode("utf-8", errors="replace").strip()
        if not tail or tail.encode().startswith(self.dialect.comment):
            return rest[:begin]
        cells = split(tail, self.dialect.delimiter)
        reason = None
        if len(cells) < self.dialect.count:
            reason = "the last line is cut off and was dropped"
        elif len(cells) == self.dialect.count and len(cells) - 1 in self.columns:
            before = (self._recent + rest[:begin]).split(b"\n")[-_LOOK_BACK:]
            if not rest.endswith(_ENDS) and self._cut_cell(cells[-1], before):
                reason = (
                    "the last line has no line end, so its last number may be cut off; it was "
                    "dropped (add a line end if it is whole)"
                )
        if reason is None:
            return rest + b"\n"
        note = f"{reason}: '{shown(tail[-60:])}'"
        if note not in self.notes:
            self.notes.append(note)
        return rest[:begin]

    def _cut_cell(self, cell: str, before: list[bytes]) -> bool:
        """Say whether a last cell was cut: shorter than all above it, or of another form.

        Numbers of a fixed format have the same digits in every row; of others, a cell that is
        cut is shorter than most, or lacks the exponent that its neighbours have.
        """
        d = self.dialect
        cells = []
        for line in before:
            row = split(line.decode("utf-8", errors="replace"), d.delimiter)
            if len(row) == d.count and not line.startswith(d.comment):
                cells.append(row[-1])
        digits = [other for other in cells if other[-1:].isdigit()]
        if not digits or (cell[-1:].isalpha() and cell[-1:].lower() not in "ed"):
            return False
        forms = {_form(other, d.decimal) for other in digits}
        if len(forms) == 1 and len(digits) > 1:
            return forms != {_form(cell, d.decimal)}
        if all(_form(other, d.decimal)[1] for other in digits) and not _form(cell, d.decimal)[1]:
            return True
        return len(cell.lstrip("+-")) < min(len(other.lstrip("+-")) for other in digits)
