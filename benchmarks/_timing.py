"""Times of jobs side by side: processor and wall time, in turn, after the same warm-up."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Timing", "row", "side_by_side"]

_TICK = 1e-6
"""Below it a processor time is none, s."""


@dataclass(frozen=True)
class Timing:
    """Processor and wall times of a job, s, a value to each round."""

    cpu: tuple[float, ...]
    wall: tuple[float, ...]

    @property
    def best(self) -> float:
        """The least processor time: what the job needs when nothing disturbs it."""
        return min(self.cpu)

    @property
    def spread(self) -> float | None:
        """How far the median is above the least, as a part of it; None of less than a tick."""
        # The times of other processes come in hundredths of a second.
        if self.best < _TICK:
            return None
        return float(np.median(self.cpu) / self.best - 1.0)


def side_by_side(
    jobs: dict[str, Callable[[], object]], rounds: int = 7, warm_up: int = 1
) -> dict[str, Timing]:
    """Run all jobs in turn, round by round, so that a slow minute hits all alike.

    Parameters
    ----------
    jobs : dict of str to callable
    rounds, warm_up : int
        Of each job: those that count, and those before that do not.
    """
    cpu: dict[str, list[float]] = {name: [] for name in jobs}
    wall: dict[str, list[float]] = {name: [] for name in jobs}
    for round_ in range(warm_up + rounds):
        for name, job in jobs.items():
            began, ran = time.perf_counter(), time.process_time()
            job()
            if round_ >= warm_up:
                cpu[name].append(time.process_time() - ran)
                wall[name].append(time.perf_counter() - began)
    return {name: Timing(tuple(cpu[name]), tuple(wall[name])) for name in jobs}


def row(
    what: str, ours: Timing, peer: Timing | None = None, scale: float = 1.0, unit: str = "s"
) -> dict[str, Any]:
    """Return a row of processor times for `run.py`, times a scale."""
    other = None if peer is None else scale * peer.best
    each = [timing.spread for timing in (ours, peer) if timing is not None]
    spreads = [spread for spread in each if spread is not None]
    return {
        "what": what, "ours": scale * max(ours.best, 0.0), "peer": other,
        "ratio": None if peer is None else peer.best / ours.best, "unit": unit,
        "wall": scale * min(ours.wall),
        "peer_wall": None if peer is None else scale * min(peer.wall),
        "spread": max(spreads) if spreads else None,
    }  # fmt: skip
