"""Parquet tables, read batch by batch; those that schuler wrote say themselves what they hold."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import choose
from schuler.io.content import BLOCK_ROWS, Array, Block, Content
from schuler.io.mapping import Mapping

__all__ = ["ParquetReader", "own_mapping"]

_BUFFER = 1 << 20


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
        from pyarrow import parquet

        try:
            with parquet.ParquetFile(path) as file:
                schema, rows = file.schema_arrow, int(file.metadata.num_rows)
        except (pa.ArrowException, OSError) as error:
            raise _damaged(error) from None
        own = _own(schema.metadata)
        chosen = choose(schema.names, len(schema.names), Mapping() if own else mapping)
        for i in chosen.all:
            kind = schema.types[i]
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or _decimal(kind)):
                raise InputError(
                    f"column '{schema.names[i]}' is of type {kind}, not numbers; convert it "
                    "(time to seconds) or name another with --columns"
                )
        if rows == 0:
            raise InputError("has no data rows")
        said = chosen.said()
        if own is not None:
            said = own_mapping(own).merged(said)
        done = [0]

        def blocks() -> Iterator[Block]:
            done[0] = 0
            names = [schema.names[i] for i in chosen.all]
            try:
                # Through a small buffer: else whole row groups would be held, undecoded.
                with parquet.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER) as file:
                    for batch in file.iter_batches(BLOCK_ROWS, columns=names):
                        done[0] += batch.num_rows
                        columns = {i: _numbers(batch.column(schema.names[i])) for i in chosen.all}
                        yield (
                            None if chosen.t is None else columns[chosen.t],
                            [columns[i] for i in chosen.values],
                            None if chosen.dt is None else columns[chosen.dt],
                        )
            except (pa.ArrowException, OSError) as error:
                raise _damaged(error) from None

        return Content(
            blocks=blocks,
            said=said,
            time_label=chosen.t_label,
            name=str(own["name"]) if own and "name" in own else None,
            rows=rows,
            progress=lambda: done[0] / rows,
            complete=own is not None,
        )


def own_mapping(own: dict[str, Any]) -> Mapping:
    """Return what schuler wrote about a record as a mapping."""
    return Mapping(
        gyro="rad",
        accel="m/s",
        time="s",
        axes="RFU",
        coning_corrected=bool(own.get("coning_corrected", False)),
        sculling_corrected=bool(own.get("sculling_corrected", False)),
    )


def _own(metadata: dict[bytes, bytes] | None) -> dict[str, Any] | None:
    text = (metadata or {}).get(b"schuler")
    if text is None:
        return None
    try:
        own = json.loads(text)
    except ValueError:
        own = None
    if not isinstance(own, dict):
        raise InputError("the description that schuler wrote into its metadata is damaged")
    return own


def _numbers(column: Any) -> Array:
    import pyarrow as pa

    if column.type != pa.float64():
        column = column.cast(pa.float64(), safe=False)
    return np.asarray(column.to_numpy(zero_copy_only=False), np.float64)


def _decimal(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_decimal(kind))


def _damaged(error: Exception) -> InputError:
    return InputError(
        f"is a damaged or truncated Parquet file ({str(error).splitlines()[0][:120]})"
    )
