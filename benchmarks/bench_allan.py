"""Allan, Hadamard and total deviation of a million samples at 60 averaging times.

The peer is allantools; each side starts from the samples (increments here, rates there: the two
differ by a factor) and gives 60 deviations. Both must agree to 1e-9 before any is timed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.allan_variance.deviation import allan, allan_deviation
from schuler.record import ImuRecord

SAMPLES, TAUS, RATE, REPEATS = 1_000_000, 60, 100.0, 15


def best(function: Callable[[], object], repeats: int) -> float:
    """Return the shortest of several runs, ms, after one that is not counted."""
    function()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times) * 1e3


def lags_of(longest: int) -> np.ndarray:
    """Return 60 different lags, evenly spread over the logarithm."""
    n = TAUS
    while len(lags := np.unique(np.rint(np.geomspace(1, longest, n)).astype(np.int64))) < TAUS:
        n += 1
    return lags[-TAUS:]


def run() -> list[dict[str, Any]]:
    """Measure."""
    try:
        import allantools
    except ImportError:
        allantools = None
    rng = np.random.default_rng(1)
    rate = rng.normal(size=SAMPLES) + 3.0
    increments = rate / RATE
    rows: list[dict[str, Any]] = []
    for kind, name, longest in (
        ("allan", "oadev", SAMPLES // 3),
        ("hadamard", "ohdev", SAMPLES // 4),
        ("total", "totdev", SAMPLES // 3),
    ):
        lags = lags_of(longest)
        job = lambda kind=kind, lags=lags: allan_deviation(  # noqa: E731
            increments, 1.0 / RATE, lags, kind
        )
        mine, peer = best(job, REPEATS), None
        if allantools is not None:
            theirs = lambda name=name, lags=lags: getattr(allantools, name)(  # noqa: E731
                rate, rate=RATE, data_type="freq", taus=lags / RATE
            )
            tau, deviation, _, _ = theirs()
            np.testing.assert_allclose(tau, lags / RATE)
            np.testing.assert_allclose(job(), deviation, rtol=1e-9)
            peer = best(theirs, 3)
        rows.append(
            {
                "what": f"{kind} deviation, 1e6 samples, {TAUS} times (peer: allantools.{name})",
                "ours": mine, "peer": peer, "ratio": peer / mine if peer else None, "unit": "ms",
            }
        )  # fmt: skip
    six = rng.normal(size=(SAMPLES, 6)) / RATE
    time_s = np.arange(1, SAMPLES + 1) / RATE
    record = ImuRecord(time_s, np.full(SAMPLES, 1.0 / RATE), six[:, :3].copy(), six[:, 3:].copy())
    for what, whole in (
        ("in memory, every overlap", lambda: allan(record)),
        ("in chunks, constant memory", lambda: allan(record.chunks())),
    ):
        rows.append(
            {
                "what": f"allan, six channels, 1e6 samples, 69 times with confidence, {what}",
                "ours": best(whole, 3), "peer": None, "ratio": None, "unit": "ms",
            }
        )  # fmt: skip
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
