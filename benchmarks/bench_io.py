"""Reading text: five million rows of seven columns, to a checked record, beside two readers.

PyArrow and Polars only make a table of numbers; `schuler.read` also finds the layout, checks
every row (time, gaps, repeats, values) and turns rates into increments. All read the same warm
file with all cores, in turn; the least processor time of several runs counts, and the wall time
stands beside it. Polars reads whole and by its streaming engine, which is its best.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

import schuler as sc
from _timing import row, side_by_side

ROWS = 5_000_000
REPEATS = 4
NAMES = ("t", "gx", "gy", "gz", "ax", "ay", "az")


def write(path: Path) -> None:
    """Write a table of 100 Hz, nine digits a cell as loggers write them."""
    schema = pa.schema([(name, pa.float64()) for name in NAMES])
    rng = np.random.default_rng(7)
    with csv.CSVWriter(path, schema) as sink:
        for begin in range(0, ROWS, 500_000):
            x = rng.standard_normal((500_000, 6)) * 0.01 + [0, 0, 0, 0, 0, 9.8]
            columns = [np.arange(begin, begin + 500_000) / 100.0, *np.round(x, 9).T]
            arrays = [pa.array(np.ascontiguousarray(c)) for c in columns]
            sink.write_table(pa.table(arrays, schema=schema))


def run() -> list[dict[str, Any]]:
    """Time the three on the same file."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.csv"
        write(path)

        def follow() -> None:
            for _ in sc.io.open_source(path).chunks():
                pass

        jobs: dict[str, Callable[[], object]] = {
            "whole": lambda: sc.read(path),
            "chunks": follow,
            "pyarrow.csv": lambda: csv.read_csv(path),
        }
        if importlib.util.find_spec("polars"):
            import polars as pl

            jobs["polars"] = lambda: pl.read_csv(path)
            jobs["polars, streaming"] = lambda: pl.scan_csv(path).collect(engine="streaming")
        found = side_by_side(jobs, REPEATS)
        for ours, words in (("whole", ""), ("chunks", " in chunks")):
            for peer in list(jobs)[2:]:
                what = f"read {ROWS // 1_000_000} million rows{words}, beside {peer}"
                rows.append(row(what, found[ours], found[peer]))
    return rows


if __name__ == "__main__":
    for line in run():
        print(line)
