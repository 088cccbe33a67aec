"""Whole processes: what a person waits for at the command line, as processor time.

`schuler align` on half an hour of a real laser-gyro record (184 718 samples at 100 Hz), the second
run (kernels come from their cache), plain and with a specification and a report; `schuler compare`
of the same; `schuler --help`. Nobody else does the same, so no ratio is made; the interpreter
itself and NumPy's import stand beside them as marks.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from _laser import PLACE, RECORD, skipped

REPEATS = 7


def once(arguments: tuple[str, ...]) -> tuple[float, float]:
    """Return processor and wall time of a Python process, s."""
    began, before = time.perf_counter(), os.times()
    done = subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
    if done.returncode not in (0, 3):
        raise SystemExit(done.stderr.decode())
    after = os.times()
    spent = after.children_user + after.children_system
    return spent - before.children_user - before.children_system, time.perf_counter() - began


def run() -> list[dict[str, Any]]:
    """Time the processes in turn; the first round does not count."""
    with tempfile.TemporaryDirectory() as folder:
        lat, lon, height = PLACE
        place = ("--lat", str(lat), "--lon", str(lon), "--height", str(height))
        schuler = ("-m", "schuler")
        jobs = {
            "an empty Python": ("-c", "pass"),
            "import numpy": ("-c", "import numpy"),
            "schuler --help": (*schuler, "--help"),
        }
        if not skipped("schuler align"):
            align = (*schuler, "align", str(RECORD), *place)
            report = ("--spec", "navigation-rlg", "--report", str(Path(folder) / "report.html"))
            jobs |= {
                "schuler align, 184 718 samples at 100 Hz, second run": align,
                "the same with a specification and a report": (*align, *report),
            }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in jobs}
        for round_ in range(REPEATS + 1):
            for name, arguments in jobs.items():
                found = once(arguments)
                if round_:
                    times[name].append(found)
        if not skipped("schuler compare"):
            compare = (*schuler, "compare", str(RECORD), *place)
            once(compare)
            times["schuler compare, all methods and prefilters"] = [once(compare) for _ in range(2)]
    return [
        {
            "what": f"{name} (processor time)", "ours": min(cpu for cpu, _ in found), "peer": None,
            "ratio": None, "unit": "s", "wall": min(wall for _, wall in found), "peer_wall": None,
            "spread": sorted(cpu for cpu, _ in found)[len(found) // 2]
            / min(cpu for cpu, _ in found) - 1.0,
        }
        for name, found in times.items()
    ]  # fmt: skip
