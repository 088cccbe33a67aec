"""A campaign of a disturbed vehicle: 300 s at 100 Hz, simulated and aligned, many times.

The times of whole campaigns are those of a user: they hold the start of the workers, some seconds.
How two workers compare with one is said of the work itself, from the first finished chunk to the
last. Results of all ways of working must be the same bytes before the times count. There is no
peer that does the same.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from schuler import campaigns
from schuler.campaigns import Campaign
from schuler.config import parse_scenario

RUNS = 1000
TARGET_S, TARGET_RATIO = 90.0, 1.7

SCENE = {
    "name": "disturbed vehicle",
    "duration": "300 s",
    "rate": "100 Hz",
    "seed": 1,
    "instrument": "navigation-fog",
    "site": {"lat": 40.0, "lon": 116.0, "height": 50.0},
    "motion": {"kind": "vehicle", "heading": 57.3, "pitch": 1.2, "roll": -0.8},
}


def timed(runs: int, workers: int | None) -> tuple[float, float, str]:
    """Return the time of a campaign (s), its runs a second at work, and the results' digest."""
    marks: list[tuple[float, int]] = []

    def mark(done: int, total: int) -> None:
        marks.append((time.perf_counter(), done))

    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        campaign = Campaign(parse_scenario(SCENE), runs)
        found = campaigns.campaign(campaign, folder, workers=workers, progress=mark)
        span = time.perf_counter() - begin
        digest = hashlib.sha256(Path(found.path).read_bytes()).hexdigest()
    # The first mark is the start; the workers have started when as many chunks as they are have
    # come back.
    first, last = marks[min(3, len(marks) - 1)], marks[-1]
    return span, (last[1] - first[1]) / max(last[0] - first[0], 1e-9), digest


def run() -> list[dict[str, Any]]:
    """Measure."""
    timed(4, None)  # kernels are compiled and in the cache of compiled code
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    pool, _, *digests = timed(RUNS, None)
    alone, _, digest = timed(RUNS, 0)
    one, pace_one, digest_one = timed(RUNS, 1)
    two, pace_two, digest_two = timed(RUNS, 2)
    if len({*digests, digest, digest_one, digest_two}) != 1:
        raise SystemExit("bench_campaign: results differ between ways of working")
    what = f"{RUNS} runs of 300 s at 100 Hz, disturbed vehicle, simulated and aligned"

    def row(text: str, value: float, unit: str = "s") -> dict[str, Any]:
        return {"what": text, "ours": value, "peer": None, "ratio": None, "unit": unit}

    return [
        row(f"{what}: {cores} processes (asked: {TARGET_S:g} s on 2 cores)", pool),
        row(f"{what}: this process alone", alone),
        row(f"{what}: 1 Dask worker", one),
        row(f"{what}: 2 Dask workers", two),
        row(f"runs a second of 2 Dask workers over 1 (asked: {TARGET_RATIO:g})",
            pace_two / pace_one, "times"),
        row("the same, from the start of the command to its end", one / two, "times"),
    ]  # fmt: skip


if __name__ == "__main__":
    for line in run():
        print(line)
