"""A trajectory that is written while it is made, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from schuler._arrow import column_of
from schuler._files import replacing
from schuler.errors import InputError
from schuler.io.sealed import SealedWriter
from schuler.io.trajectory_write import table_columns
from schuler.trajectory import Trajectory

__all__ = ["TrajectoryStream", "can_stream", "streamed_trajectory"]

_GROUP = 1 << 17
"""Rows to a row group: half of what `write_trajectory` has, which is held twice on the way."""


def can_stream(path: str | Path) -> bool:
    """Say whether a trajectory is written to a path in pieces: Parquet is, with pyarrow 18."""
    if Path(path).suffix.lower() not in (".parquet", ".pq"):
        return False
    from pyarrow import parquet

    # The seal is known when all rows are.
    return hasattr(parquet.ParquetWriter, "add_key_value_metadata")


class TrajectoryStream:
    """Takes the pieces of a trajectory; rows wait until they fill a row group."""

    def __init__(self, out: Any, layout: str) -> None:
        self._out, self._layout = out, layout
        self._writer: SealedWriter | None = None
        self._waiting: list[Any] = []
        self._rows = 0

    def write(self, piece: Trajectory) -> None:
        """Take the next rows."""
        import pyarrow as pa

        if not len(piece):
            return
        columns = table_columns(piece, self._layout)
        self._waiting.append(pa.table({name: column_of(v) for name, v in columns.items()}))
        self._rows += len(piece)
        while self._rows >= _GROUP:
            self._flush(_GROUP)

    def _flush(self, rows: int) -> None:
        import pyarrow as pa

        table = pa.concat_tables(self._waiting).combine_chunks()
        if self._writer is None:
            self._writer = SealedWriter(
                table.schema, self._out, {"schuler": "{}"}, compression="zstd",
                use_dictionary=False,
            )  # fmt: skip
        self._writer.write(table.slice(0, rows))
        self._waiting = [table.slice(rows)]
        self._rows -= rows

    def close(self) -> None:
        """Write what waits, and the end of the file."""
        if self._rows:
            self._flush(self._rows)
        if self._writer is None:
            raise InputError("the trajectory has no rows, so there is nothing to write")
        self._writer.close()

    def abandon(self) -> None:
        """Let go of the file, which is not kept; pyarrow would close it later, and complain."""
        if self._writer is not None:
            self._writer.abandon()


@contextmanager
def streamed_trajectory(path: str | Path, layout: str = "schuler") -> Iterator[TrajectoryStream]:
    """Give what takes a trajectory in pieces; the file is there, whole, when all went well.

    Parameters
    ----------
    path : str or Path
        One that `can_stream` says yes to.
    layout : {"schuler", "pyins"}
        As for `write_trajectory`.

    Raises
    ------
    InputError
        If there were no rows, or the file cannot be written.
    """
    with replacing(path) as part, part.open("wb") as out:
        stream = TrajectoryStream(out, layout)
        try:
            yield stream
            stream.close()
        except BaseException:
            stream.abandon()
            raise
