"""How time and memory grow with the work: samples, windows, runs, positions; into docs/cost.md.

Each figure is a process of its own, whose processor time and peak resident size the system tells;
a process that does nothing but import stands first. Kernels are in the cache before. The last
column is the exponent of the processor time, without the import, from the row before: 1 is linear.

    python benchmarks/growth.py [--largest 10_000_000]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench_memory import write
from run import machine

PAGE = Path(__file__).resolve().parents[1] / "docs" / "cost.md"
START, END = "<!-- cost: start -->", "<!-- cost: end -->"

LEAST = 0.1
"""Processor time (s) beside the import from which an exponent is told."""

FRAME = """
import contextlib, io, re, resource, sys, time
count, folder = int(sys.argv[1]), sys.argv[2]
import numpy as np
import schuler as sc
{code}
used = resource.getrusage(resource.RUSAGE_SELF)
try:
    peak = re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1]
except OSError:
    peak = used.ru_maxrss
print(used.ru_utime + used.ru_stime, peak)
"""

COMMAND = """
from schuler.cli import main
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main([{words}])
"""
FILE = 'f"{folder}/{count}.parquet"'
PLACE = '"--lat", "40", "--height", "50", "--mean-rates", "--json", "-"'

WINDOWS = """
from schuler.record import ImuRecord
rng = np.random.default_rng(1)
def chunks(rate=10, length=60):
    for first in range(0, count * length * rate, 60_000):
        n = min(60_000, count * length * rate - first)
        yield ImuRecord(
            np.arange(first + 1, first + n + 1) / rate, np.full(n, 1 / rate),
            rng.normal(size=(n, 3)) * 1e-6, rng.normal(size=(n, 3)) * 1e-4 + [0, 0, 0.98])
assert len(sc.align_windows(chunks(), sc.Site(45.0), 60.0, spec="navigation-fog").each) == count
"""

CAMPAIGN = """
from schuler.campaigns import Campaign, campaign
from schuler.config import parse_scenario
scene = {"name": "rest", "duration": "60 s", "rate": "10 Hz", "seed": 1,
         "instrument": "navigation-fog", "site": {"lat": 40.0}, "motion": {"kind": "static"}}
campaign(Campaign(parse_scenario(scene), count), f"{folder}/campaign{count}", workers=0)
"""

POSITIONS = """
from schuler.alignment.bound import Position, position_limit
from schuler.sensors import load_spec
places = [Position(360.0 * k / count, 0.0, 0.0, 600.0, 10.0) for k in range(count)]
position_limit(load_spec("navigation-fog"), sc.Site(40.0), places)
"""


@dataclass(frozen=True)
class Work:
    """A kind of work, and how much of it is done."""

    what: str
    unit: str
    code: str
    counts: tuple[int, ...]


def works(largest: int) -> list[Work]:
    """Return all kinds of work, samples up to a number."""
    samples = tuple(n for n in (10_000, 100_000, 1_000_000, 10_000_000) if n <= largest)
    many = tuple(n for n in (10, 100, 1_000, 10_000) if 1_000 * n <= largest)

    def command(*words: str) -> str:
        return COMMAND.format(words=", ".join(words))

    return [
        Work("`schuler align`", "samples", command('"align"', FILE, PLACE), samples),
        Work("`schuler align --method kalman`", "samples",
             command('"align"', FILE, '"--method", "kalman"', PLACE), samples),
        Work("`schuler navigate --out path.parquet`, every row", "samples",
             command('"navigate"', FILE, '"--heading", "0"', PLACE, '"--out"',
                     'f"{folder}/path.parquet"'), samples),
        Work("`sc.align_windows`, 60 s at 10 Hz with a specification", "windows", WINDOWS, many),
        Work("a campaign, runs of 600 samples in one process", "runs", CAMPAIGN, many),
        Work("the bound of dwells (`position_limit`)", "positions", POSITIONS, (4, 6, 8, 12)),
    ]  # fmt: skip


def spent(code: str, count: int, folder: str) -> tuple[float, float]:
    """Return processor time (s) and peak resident size (MB) of a process that runs this code."""
    done = subprocess.run(
        [sys.executable, "-c", FRAME.replace("{code}", code), str(count), folder],
        capture_output=True, text=True, check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(done.stderr)
    cpu, peak = map(float, done.stdout.split()[-2:])
    return cpu, peak / 1024.0


def measure(largest: int) -> list[str]:
    """Return the table's lines."""
    lines = ["| work | how much | processor time, s | peak memory, MB | exponent |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        bare, least = spent("sc.align", 0, folder)
        lines.append(f"| import alone | - | {bare:.2f} | {least:.0f} | - |")
        for work in works(largest):
            before = None
            for count in work.counts:
                if (
                    work.unit == "samples"
                    and not (file := Path(folder, f"{count}.parquet")).exists()
                ):
                    write(None, file, count)
                if before is None:
                    spent(work.code, count, folder)
                cpu, peak = spent(work.code, count, folder)
                own = max(cpu - bare, 1e-3)
                grown = "-"
                # Beside the import nothing can be told of less.
                if before is not None and before[1] > LEAST:
                    grown = f"{np.log(own / before[1]) / np.log(count / before[0]):.2f}"
                lines.append(
                    f"| {work.what} | {count:,} {work.unit} | {cpu:.2f} | {peak:.0f} | {grown} |"
                )
                print(lines[-1], flush=True)
                before = count, own
    return lines


def main() -> None:
    """Measure, and write the page between its markers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=10_000_000, help="samples at most")
    options = parser.parse_args()
    where = machine()
    block = "\n".join(
        [START, "", f"Measured on {where}, by `python benchmarks/growth.py`.", "",
         *measure(options.largest), "", END]
    )  # fmt: skip
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(START, 1)
    PAGE.write_text(head + block + rest.split(END, 1)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
