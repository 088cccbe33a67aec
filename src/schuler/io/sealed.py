"""Parquet with a seal: a checksum for each page, and a SHA-256 of all that the table says.

Page checksums cover the values but neither the pages' headers nor the file's footer. So a digest
of the columns' names, types and values and of the other metadata is written into the metadata,
under two names: a file whose one name is damaged is still known to have had a seal.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np

from schuler._arrow import numbers
from schuler.errors import InputError
from schuler.io.limits import check_size
from schuler.io.pages import check_pages, damaged_parquet, footer_bytes

__all__ = [
    "Seal",
    "SealedWriter",
    "about_of",
    "opened_parquet",
    "read_sealed",
    "stated",
    "write_sealed",
]

_KEYS = (b"schuler.sha256", b"sha256.of.schuler")
_ARROW = b"ARROW:schema"


class Seal:
    """The digest of a table, taken while it passes.

    Parameters
    ----------
    schema : pyarrow.Schema
        Names and types of the columns.
    about : mapping of bytes to bytes
        The other metadata.
    expected : bytes, optional
        What the digest has to be.
    """

    def __init__(
        self, schema: Any, about: Mapping[bytes, bytes], expected: bytes | None = None
    ) -> None:
        self.expected = expected
        self._head = hashlib.sha256()
        for key in sorted(about):
            _feed(self._head, key, about[key])
        for name, kind in zip(schema.names, schema.types, strict=True):
            _feed(self._head, name.encode("utf-8", "surrogatepass"), str(kind).encode())
        self._columns = [hashlib.sha256() for _ in schema.names]
        self._rows = 0

    def add(self, batch: Any) -> None:
        """Take the next rows, a record batch with all columns in their order."""
        for hasher, column in zip(self._columns, batch.columns, strict=True):
            _take(hasher, column)
        self._rows += batch.num_rows

    def digest(self) -> bytes:
        """Return the digest of all rows so far, as hexadecimal digits."""
        whole = self._head.copy()
        for hasher in self._columns:
            whole.update(hasher.digest())
        whole.update(self._rows.to_bytes(8, "little"))
        return whole.hexdigest().encode()

    def verify(self) -> None:
        """Compare with what the file states.

        Raises
        ------
        InputError
            If they differ.
        """
        if self.expected is not None and self.digest() != self.expected:
            raise InputError(
                "is damaged: its content is not what its checksum says; copy it again from where "
                "it came, or make it anew"
            )


class SealedWriter:
    """Writes a table without nulls as Parquet with a seal, piece by piece.

    Parameters
    ----------
    schema : pyarrow.Schema
    out : file object
        Open for bytes.
    about : mapping of str to str
        Metadata; nothing else is kept.
    **options
        As for `pyarrow.parquet.ParquetWriter`.
    """

    def __init__(self, schema: Any, out: Any, about: Mapping[str, str], **options: Any) -> None:
        from pyarrow import parquet

        metadata = {key.encode(): value.encode() for key, value in about.items()}
        self._seal = Seal(schema, metadata)
        self._writer = parquet.ParquetWriter(
            out, schema.with_metadata(metadata), write_page_checksum=True, **options
        )

    def write(self, table: Any) -> None:
        """Write rows as a row group of their own."""
        for batch in table.to_batches():
            self._seal.add(batch)
        self._writer.write_table(table, row_group_size=max(len(table), 1))

    def close(self) -> None:
        """Write the seal and the end of the file."""
        self._writer.add_key_value_metadata(dict.fromkeys(_KEYS, self._seal.digest()))
        self._writer.close()

    def abandon(self) -> None:
        """Close a file that is not kept, whatever comes of it."""
        with suppress(Exception):
            self._writer.close()


def write_sealed(table: Any, path: Path, about: Mapping[str, str], **options: Any) -> None:
    """Write a table without nulls as Parquet with a seal.

    Parameters
    ----------
    table : pyarrow.Table
    path : Path
    about : mapping of str to str
        Metadata; nothing else is kept.
    **options
        As for `pyarrow.parquet.write_table`.
    """
    from pyarrow import parquet

    metadata = {key.encode(): value.encode() for key, value in about.items()}
    seal = Seal(table.schema, metadata)
    for batch in table.to_batches():
        seal.add(batch)
    metadata.update(dict.fromkeys(_KEYS, seal.digest()))
    # Arrow takes names in UTF-8 only; a name on a disk may be any bytes.
    with path.open("wb") as out:
        parquet.write_table(
            table.replace_schema_metadata(metadata), out, write_page_checksum=True, **options
        )


def _for_arrow(path: Path) -> AbstractContextManager[Any]:
    """Return a path as Arrow takes it: itself, or an open file where its name is not UTF-8."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return path.open("rb")
    return nullcontext(path)


@contextmanager
def opened_parquet(path: Path, **options: Any) -> Iterator[Any]:
    """Open a `pyarrow.parquet.ParquetFile` that compares the pages with their checksums.

    The pages must have been looked at (`schuler.io.pages.check_pages`).

    Raises
    ------
    InputError
        In the place of all that pyarrow raises for damaged files, here and while it is open.
    """
    from pyarrow import parquet

    try:
        with (
            _for_arrow(path) as source,
            parquet.ParquetFile(source, page_checksum_verification=True, **options) as file,
        ):
            yield file
    except (InputError, GeneratorExit):
        raise
    except Exception as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise damaged_parquet(reason) from None


def about_of(file: Any) -> dict[bytes, bytes]:
    """Return the metadata of an opened file, without what Arrow and the seal put there."""
    raw: dict[bytes, bytes] = file.metadata.metadata or {}
    return {key: value for key, value in raw.items() if key not in (*_KEYS, _ARROW)}


def stated(file: Any, path: Path) -> Seal | None:
    """Return the seal to be verified of an opened file; None where it has none.

    Raises
    ------
    InputError
        If the seal itself is damaged.
    """
    raw = file.metadata.metadata or {}
    first, second = (raw.get(key) for key in _KEYS)
    if first is None and second is None and not any(key in footer_bytes(path) for key in _KEYS):
        return None
    if first is None or first != second:
        raise InputError("is damaged: its checksum is; copy it again from where it came")
    return Seal(file.schema_arrow, about_of(file), first)


def read_sealed(path: Path, rows: int | None = None) -> tuple[Any, dict[bytes, bytes], bool]:
    """Read a whole table and verify its seal.

    Parameters
    ----------
    path : Path
    rows : int, optional
        How many rows it must have.

    Returns
    -------
    (pyarrow.Table, dict, bool)
        The table, the metadata, and whether there was a seal.

    Raises
    ------
    InputError
        If the file is damaged, or has another number of rows.
    """
    check_pages(path)
    with opened_parquet(path) as file:
        count = int(file.metadata.num_rows)
        if rows is not None and count != rows:
            raise InputError(f"has {count} rows, expected {rows}")
        wide = 8 * count * max(1, len(file.schema_arrow.names))
        check_size(wide, path.stat().st_size, "its footer")
        seal, about = stated(file, path), about_of(file)
        table = file.read()
    if len(table) != count:
        raise InputError(f"is damaged: it has {len(table)} of the {count} rows that it announces")
    if seal is not None:
        for batch in table.to_batches():
            seal.add(batch)
        seal.verify()
    return table, about, seal is not None


def _take(hasher: Any, column: Any) -> None:
    """Feed a column: numbers as little-endian bytes, texts with their lengths."""
    import pyarrow as pa

    if column.null_count:
        raise InputError(
            "is damaged: it has empty cells, which schuler does not write; copy it again from "
            "where it came"
        )
    if pa.types.is_string(column.type):
        for text in column.to_pylist():
            _feed(hasher, text.encode("utf-8", "surrogatepass"))
        return
    try:
        values = numbers(column)
    except TypeError:
        raise InputError(
            f"is damaged: it has a column of {column.type}, which schuler does not write; copy it "
            "again from where it came"
        ) from None
    hasher.update(np.ascontiguousarray(values, values.dtype.newbyteorder("<")).data)


def _feed(hasher: Any, *parts: bytes) -> None:
    for part in parts:
        hasher.update(len(part).to_bytes(8, "little") + part)
