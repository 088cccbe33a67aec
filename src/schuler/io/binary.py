"""Plain records of little-endian float64, seven columns unless `columns` says otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import choose
from schuler.io.content import BLOCK_ROWS, Array, Block, Content
from schuler.io.mapping import Mapping

__all__ = ["BinaryReader"]


#: rows by whose stamps their unit is found
_STAMPS = 4096


class BinaryReader:
    """Reader of float64 records: t, gx ... az, or the order that `columns` names."""

    name = "bin"
    suffixes: tuple[str, ...] = (".bin",)

    def sniff(self, head: bytes) -> bool:
        """Never: plain numbers carry no mark."""
        return False

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Check the size against the width of a row."""
        width = 7
        if mapping.columns is not None:
            numbers = [entry for entry in mapping.columns if isinstance(entry, int)]
            # Numbers pick from the usual seven; roles name every column of a row.
            width = max(7, *numbers) if numbers else len(mapping.columns)
        elif (
            mapping.rate is not None and path.stat().st_size % 56 and not (path.stat().st_size % 48)
        ):
            width = 6
        chosen = choose(None, width, mapping)
        size = path.stat().st_size
        rows, extra = divmod(size, 8 * width)
        if extra:
            raise InputError(
                f"is truncated, or not {width} float64 columns: {size} bytes are {rows} rows of "
                f"{8 * width} bytes and {extra} bytes more; cut them off, or name every column "
                "with --columns"
            )
        done = [0]

        def blocks() -> Iterator[Block]:
            """Yield the rows, as they are read."""
            done[0] = 0
            with path.open("rb") as file:
                while True:
                    data = np.fromfile(file, "<f8", BLOCK_ROWS * width)
                    if not len(data):
                        break
                    table = data[: len(data) // width * width].reshape(-1, width)
                    done[0] += len(table)
                    t = None if chosen.t is None else table[:, chosen.t]
                    yield t, [table[:, i] for i in chosen.values], None
            if done[0] < rows:
                raise InputError(f"has become shorter: {done[0]} of its {rows} rows could be read")

        return Content(
            blocks=blocks,
            time_label=chosen.t_label,
            stamps=_first_stamps(path, width, chosen.t),
            rows=rows,
            progress=lambda: done[0] / max(1, rows),
        )


def _first_stamps(path: Path, width: int, t: int | None) -> Array | None:
    if t is None:
        return None
    table = np.fromfile(path, "<f8", _STAMPS * width)
    return np.asarray(table[: len(table) // width * width].reshape(-1, width)[:, t])
