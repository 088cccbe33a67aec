"""Peak memory of `schuler align` on ten million samples, as text and as Parquet.

Each alignment is a process of its own whose peak resident size the system counts; the files are
written here block by block. Beside it, the same for reading the whole table into memory with
PyArrow (text) and Polars (text), which is what an alignment of a table in memory begins with.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import EARTH_RATE
from schuler.earth import Site

ROWS = 10_000_000
RATE = 200.0
BLOCK = 500_000
NAMES = ("t", "gx", "gy", "gz", "ax", "ay", "az")
SITE = Site(40.0, 116.0, 50.0)

#: runs code, then prints the peak resident size in kB. The kernel's own mark is read where there
#: is one: getrusage's starts at what the parent had when it forked.
PEAK = """
{code}
import pathlib, re, resource
status = pathlib.Path("/proc/self/status")
if status.exists():
    print(re.search(r"VmHWM:\\s*(\\d+) kB", status.read_text())[1])
else:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
ALIGN = """
import contextlib, io, sys
from schuler.cli import main
with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
    main(["align", sys.argv[1], "--lat", "40", "--height", "50", "--mean-rates", "--json", "-"])
import json
assert json.loads(out.getvalue())["time"]["samples"] == int(sys.argv[2])
"""
NAVIGATE = """
import contextlib, io, sys
from schuler.cli import main
words = "--lat 40 --height 50 --heading 0 --mean-rates --json -".split()
with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
    main(["navigate", sys.argv[1], *words, "--out", sys.argv[2]])
assert out.getvalue()
"""
PYARROW = "import sys; from pyarrow import csv; assert csv.read_csv(sys.argv[1]).num_rows"
POLARS = "import sys, polars; assert polars.read_csv(sys.argv[1]).height"


def block(begin: int, end: int, rng: np.random.Generator) -> np.ndarray:
    """Return rows of a base at rest with white noise, heading 0."""
    k = np.arange(begin, end)
    w = EARTH_RATE * np.array([0.0, np.cos(SITE.latitude), np.sin(SITE.latitude)])
    x = rng.standard_normal((len(k), 6)) * np.repeat([1e-5, 2e-3], 3)
    x += np.array([*w, 0.0, 0.0, SITE.gravity])
    return np.column_stack([(k + 1) / RATE, x])


def write(text: Path | None, parquet: Path | None, rows: int) -> None:
    """Write both files block by block."""
    import pyarrow as pa
    from pyarrow import csv
    from pyarrow.parquet import ParquetWriter

    schema = pa.schema([(name, pa.float64()) for name in NAMES])
    rng = np.random.default_rng(8)
    sinks: list[Any] = []
    if text is not None:
        sinks.append(csv.CSVWriter(text, schema))
    if parquet is not None:
        sinks.append(ParquetWriter(parquet, schema))
    for begin in range(0, rows, BLOCK):
        columns = block(begin, min(begin + BLOCK, rows), rng).T
        batch = pa.table([pa.array(np.ascontiguousarray(c)) for c in columns], schema=schema)
        for sink in sinks:
            sink.write_table(batch)
    for sink in sinks:
        sink.close()


def peak_mb(code: str, *arguments: object) -> float:
    """Return the peak resident size of a process that runs this code, MB."""
    done = subprocess.run(
        [sys.executable, "-c", PEAK.format(code=code), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ,
    )
    return float(done.stdout.split()[-1]) / 1024.0


def run() -> list[dict[str, Any]]:
    """Measure, on files in a folder for the while."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        text, parquet = Path(folder, "long.csv"), Path(folder, "long.parquet")
        write(text, parquet, ROWS)
        words = f"{ROWS // 1_000_000} million samples"
        ours = peak_mb(ALIGN, text, ROWS)
        for label, code in (("pyarrow.csv reads", PYARROW), ("polars reads", POLARS)):
            theirs = peak_mb(code, text)
            rows.append(
                {
                    "what": f"peak memory, align {words} of text, beside what {label}",
                    "ours": ours,
                    "peer": theirs,
                    "ratio": theirs / ours,
                    "unit": "MB",
                }
            )
        kalman = ALIGN.replace('"--json"', '"--method", "kalman", "--json"')
        for what, code, arguments in (
            ("align", ALIGN, (parquet, ROWS)),
            ("align by the Kalman filter,", kalman, (parquet, ROWS)),
            ("navigate, every row to Parquet,", NAVIGATE, (parquet, Path(folder, "path.parquet"))),
        ):
            rows.append(
                {
                    "what": f"peak memory, {what} {words} of Parquet",
                    "ours": peak_mb(code, *arguments),
                    "peer": None,
                    "ratio": None,
                    "unit": "MB",
                }
            )
    return rows
