"""Empirical mode decomposition beside EMD-signal and emd: time, and a tone kept whole.

The series is a tone of 0.5 Hz in white noise on a ramp, sampled at 100 Hz. The last column of a
stop rule's row says how well the mode nearest to the tone is correlated with it.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.prefilter import decompose


def series(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the tone, and the series it is in."""
    t = np.arange(n) / 100.0
    tone = np.sin(np.pi * t)
    return tone, tone + 0.5 * np.random.default_rng(1).standard_normal(n) + 1e-3 * t


def timed(function: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Return the shortest time of a call, s, and its result."""
    spans, out = [], None
    for _ in range(repeats):
        begin = time.perf_counter()
        out = function()
        spans.append(time.perf_counter() - begin)
    return min(spans), out


def kept(modes: np.ndarray, tone: np.ndarray) -> float:
    """Return the correlation of the mode nearest to the tone."""
    return max(abs(float(np.corrcoef(m, tone)[0, 1])) for m in modes)


def run() -> list[dict[str, Any]]:
    """Measure."""
    rows: list[dict[str, Any]] = []

    def row(what: str, ours: float, peer: float | None, unit: str = "s") -> None:
        ratio = peer / ours if peer and unit == "s" else None
        rows.append({"what": what, "ours": ours, "peer": peer, "ratio": ratio, "unit": unit})

    try:
        from PyEMD import EMD
    except ImportError:
        EMD = None
    try:
        from emd.sift import sift as emd_sift

        logging.getLogger("emd").setLevel(logging.ERROR)
    except ImportError:
        emd_sift = None
    decompose(series(2000)[1], ends="mirror", stop="fixed", siftings=10)
    for n in (60_000, 360_000):
        tone, x = series(n)
        fixed, _ = timed(lambda x=x: decompose(x, ends="mirror", stop="fixed", siftings=10), 5)
        if EMD is not None:
            peer, _ = timed(lambda x=x: EMD(FIXE=10).emd(x), 2)
            row(f"{n} samples, ten siftings, beside EMD-signal", fixed, peer)
        if emd_sift is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                options = {"stop_method": "fixed", "max_iters": 10}
                peer, _ = timed(lambda x=x, o=options: emd_sift(x, imf_opts=o), 1)
            row(f"{n} samples, ten siftings, beside emd", fixed, peer)
        default, modes = timed(lambda x=x: decompose(x, ends="mirror"), 3)
        own = kept(modes, tone)
        if EMD is not None and n == 60_000:
            peer, theirs = timed(lambda x=x: EMD().emd(x), 1)
            row(f"{n} samples, default stop, beside EMD-signal", default, peer)
            row(f"{n} samples, the tone's correlation", own, kept(theirs, tone), "-")
        else:
            row(f"{n} samples, default stop", default, None)
            row(f"{n} samples, the tone's correlation", own, None, "-")
        for threshold in (0.3, 0.05, 0.01):
            spent, loose = timed(
                lambda x=x, h=threshold: decompose(x, ends="mirror", threshold=h), 1
            )
            row(f"{n} samples, stop at {threshold}", spent, None)
            row(f"{n} samples, stop at {threshold}, the tone's correlation",
                kept(loose, tone), None, "-")  # fmt: skip
    return rows


if __name__ == "__main__":
    for found in run():
        print(found)
