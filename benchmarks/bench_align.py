"""Whole processes: what a person waits for at the command line.

`schuler align` on half an hour of a real laser-gyro record (184 718 samples at 100 Hz), the
second run (kernels come from their cache); `schuler --help`; `import schuler`. Beside the last
two, what the interpreter itself and NumPy's import take.
"""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

from _laser import RECORD, skipped

REPEATS = 7


def wall(*arguments: str) -> float:
    """Return the shortest wall time of a Python process, s, after one that is not counted."""
    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
        times.append(time.perf_counter() - start)
    return min(times[1:])


def run() -> list[dict[str, Any]]:
    """Time the processes."""
    numpy = wall("-c", "import numpy")
    bare = wall("-c", "pass")
    rows = [
        ("import schuler, beside import numpy", wall("-c", "import schuler"), numpy),
        ("schuler --help, beside an empty Python", wall("-m", "schuler", "--help"), bare),
    ]
    if not skipped("schuler align"):
        seconds = wall("-m", "schuler", "align", str(RECORD), "--spec", "navigation-rlg")
        rows.append(("schuler align, 184 718 samples at 100 Hz, second run", seconds, None))
    return [
        {
            "what": what,
            "ours": ours,
            "peer": peer,
            "ratio": None if peer is None else peer / ours,
            "unit": "s",
        }
        for what, ours, peer in rows
    ]
