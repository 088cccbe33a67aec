"""Parquet tables, read batch by batch; those that schuler wrote say themselves what they hold."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from schuler._arrow import numbers
from schuler.errors import InputError, shown
from schuler.io.columns import choose
from schuler.io.content import BLOCK_ROWS, Array, Block, Content
from schuler.io.limits import check_rows
from schuler.io.mapping import Mapping
from schuler.io.own import own_mapping, own_name, parse_own
from schuler.io.pages import check_pages
from schuler.io.sealed import about_of, opened_parquet, stated

__all__ = ["ParquetReader"]

_BUFFER = 1 << 20
#: rows by whose stamps their unit is found
_STAMPS = 4096


class ParquetReader:
    """Reader of Parquet files."""

    name = "parquet"
    suffixes: tuple[str, ...] = (".parquet", ".pq")

    def sniff(self, head: bytes) -> bool:
        """Say whether Parquet's mark is there."""
        return head[:4] == b"PAR1"

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Read the schema."""
        import pyarrow as pa

        check_pages(path, ())
        with opened_parquet(path) as file:
            schema, rows = file.schema_arrow, int(file.metadata.num_rows)
            sealed, text = stated(file, path) is not None, about_of(file).get(b"schuler")
        own = None if text is None else parse_own(text, "into its metadata")
        whole = Mapping(array=mapping.array)
        chosen = choose(schema.names, len(schema.names), whole if own else mapping)
        for i in chosen.all:
            kind = schema.types[i]
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or _decimal(kind)):
                raise InputError(
                    f"column '{shown(schema.names[i])}' is of type {kind}, not numbers; convert it "
                    "(time to seconds) or name another with --columns"
                )
        if rows == 0:
            raise InputError("has no data rows")
        check_rows(rows, path.stat().st_size)
        # A seal is that of all columns.
        names = schema.names if sealed else [schema.names[i] for i in chosen.all]
        check_pages(path, names)
        said = chosen.said()
        if own is not None:
            said = own_mapping(own).merged(said)
        done = [0]

        def blocks() -> Iterator[Block]:
            """Yield the rows, as they are read."""
            done[0] = 0
            # Through a small buffer: else whole row groups would be held, undecoded.
            with opened_parquet(path, pre_buffer=False, buffer_size=_BUFFER) as file:
                seal = stated(file, path)
                for batch in file.iter_batches(BLOCK_ROWS, columns=names):
                    done[0] += batch.num_rows
                    if seal is not None:
                        seal.add(batch)
                    columns = {i: _numbers(batch.column(schema.names[i])) for i in chosen.all}
                    yield (
                        None if chosen.t is None else columns[chosen.t],
                        [columns[i] for i in chosen.values],
                        None if chosen.dt is None else columns[chosen.dt],
                    )
                if seal is not None:
                    seal.verify()
            if done[0] != rows:
                raise InputError(
                    f"is damaged: {done[0]} of the {rows} rows that it announces are there"
                )

        return Content(
            blocks=blocks,
            said=said,
            time_label=chosen.t_label,
            mark=chosen.mark,
            stamps=None if own else _first_stamps(path, schema.names, chosen.t),
            name=own_name(own),
            rows=rows,
            progress=lambda: done[0] / rows,
            complete=own is not None,
        )


def _first_stamps(path: Path, names: list[str], t: int | None) -> Array | None:
    if t is None:
        return None
    with opened_parquet(path, pre_buffer=False, buffer_size=_BUFFER) as file:
        batch = next(file.iter_batches(_STAMPS, columns=[names[t]]), None)
        return None if batch is None else _numbers(batch.column(names[t]))


def _numbers(column: Any) -> Array:
    import pyarrow as pa

    if column.type != pa.float64():
        column = column.cast(pa.float64(), safe=False)
    return np.asarray(numbers(column), np.float64)


def _decimal(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_decimal(kind))
