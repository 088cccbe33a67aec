"""Empirical mode decomposition beside EMD-signal and emd: time, and a tone kept whole.

The series is a tone of 0.5 Hz in white noise on a ramp, sampled at 100 Hz. The last column of a
stop rule's row says how well the mode nearest to the tone is correlated with it. Rivals are timed
at ten siftings, which both can be told, and at their own defaults; processor time, in turn, with
the same repeats.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from _timing import row as timed_row
from _timing import side_by_side
from schuler.prefilter import decompose


def series(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the tone, and the series it is in."""
    t = np.arange(n) / 100.0
    tone = np.sin(np.pi * t)
    return tone, tone + 0.5 * np.random.default_rng(1).standard_normal(n) + 1e-3 * t


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
    for n in (60_000, 360_000):
        tone, x = series(n)
        rounds = 5 if n == 60_000 else 2
        fixed: dict[str, Callable[[], Any]] = {
            "ours": lambda x=x: decompose(x, ends="mirror", stop="fixed", siftings=10)
        }
        default: dict[str, Callable[[], Any]] = {"ours": lambda x=x: decompose(x, ends="mirror")}
        if EMD is not None:
            fixed["EMD-signal"] = lambda x=x: EMD(FIXE=10).emd(x)
            if n == 60_000:
                default["EMD-signal"] = lambda x=x: EMD().emd(x)
        if emd_sift is not None:
            options = {"stop_method": "fixed", "max_iters": 10}
            fixed["emd"] = lambda x=x, o=options: emd_sift(x, imf_opts=o)
            default["emd"] = lambda x=x: emd_sift(x)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for words, jobs in (("ten siftings", fixed), ("each at its default", default)):
                found = side_by_side(jobs, rounds)
                rows += [
                    timed_row(f"{n} samples, {words}, beside {peer}", found["ours"], found[peer])
                    for peer in jobs
                    if peer != "ours"
                ]
                if len(jobs) == 1:
                    rows.append(timed_row(f"{n} samples, {words}", found["ours"]))
            own = kept(default["ours"](), tone)
            for peer in ("EMD-signal", "emd"):
                if peer in default:
                    modes = np.asarray(default[peer]())
                    theirs = kept(modes if peer == "EMD-signal" else modes.T, tone)
                    row(f"{n} samples, the tone's correlation, beside {peer}", own, theirs, "-")
        for threshold in (0.3, 0.05, 0.01):
            loose: dict[str, Callable[[], Any]] = {
                "ours": lambda x=x, h=threshold: decompose(x, ends="mirror", threshold=h)
            }
            spent = side_by_side(loose, 2)["ours"]
            rows.append(timed_row(f"{n} samples, stop at {threshold}", spent))
            row(f"{n} samples, stop at {threshold}, the tone's correlation",
                kept(loose["ours"](), tone), None, "-")  # fmt: skip
    return rows


if __name__ == "__main__":
    for found in run():
        print(found)
