"""Repeatability: the same alignment over and over, on windows that share no sample."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from schuler._blas import with_one_blas_thread
from schuler._processes import worker_pool
from schuler._result import Result, table_of_rows
from schuler.alignment.aligner import Aligner
from schuler.alignment.method import Method
from schuler.alignment.result import Alignment
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, load_spec

__all__ = ["Windows", "align_windows", "spread_arcmin", "track_windows"]

_KEPT = 256
"""Stretches of a window's history that are kept with its alignment."""

_ALONE = 50
"""Windows that one process solves sooner than others are started."""


@dataclass(frozen=True, eq=False)
class Windows(Result):
    """The alignment of the whole span, and of each window in it.

    Parameters
    ----------
    whole : Alignment
        Of all samples.
    length : float
        Length of a window, s.
    each : tuple of Alignment
        Of each whole window, from the start of the span on.
    """

    whole: Alignment
    length: float
    each: tuple[Alignment, ...]

    @property
    def mean_heading_deg(self) -> float:
        """Circular mean of the headings, deg in [0, 360)."""
        return _mean_deg([w.heading_deg for w in self.each])

    @property
    def std_heading_arcmin(self) -> float | None:
        """Sample standard deviation of the headings, arcmin; None for a single window."""
        return spread_arcmin([w.heading_deg for w in self.each])

    def to_dict(self) -> dict[str, Any]:
        """Return the whole span's result with the windows' keys added."""
        return {
            **self.whole.to_dict(),
            "windows": [
                {
                    "start_s": w.start,
                    "end_s": w.end,
                    "heading_deg": w.heading_deg,
                    "pitch_deg": w.pitch_deg,
                    "roll_deg": w.roll_deg,
                    "heading_sigma_arcmin": float(w.sigma_arcmin[2]),
                }
                for w in self.each
            ],
            "mean_heading_deg": self.mean_heading_deg,
            "std_heading_arcmin": self.std_heading_arcmin,
        }

    def columns(self) -> dict[str, Any]:
        """Return a row to each window."""
        return table_of_rows(self.to_dict()["windows"])

    def __str__(self) -> str:
        std = self.std_heading_arcmin
        spread = "one window: no spread" if std is None else f"std {std:.3f}'"
        return (
            f"{len(self.each)} windows of {self.length:g} s: mean heading "
            f"{self.mean_heading_deg:.4f} deg, {spread}"
        )


def _mean_deg(headings: list[float]) -> float:
    """Return the circular mean, deg in [0, 360)."""
    a = np.array(headings) * DEG
    return float(np.degrees(np.arctan2(np.sin(a).sum(), np.cos(a).sum())) % 360.0)


def spread_arcmin(headings: list[float]) -> float | None:
    """Return the sample standard deviation of headings (deg), arcmin; None for fewer than two."""
    if len(headings) < 2:
        return None
    off = np.array(headings) - _mean_deg(headings)
    off = (off + 180.0) % 360.0 - 180.0
    return float(np.sqrt(np.sum(off**2) / (len(off) - 1))) * 60.0


@with_one_blas_thread
def align_windows(
    source: ImuRecord | Iterable[ImuRecord],
    site: Site,
    length: float,
    method: Method | str | None = None,
    spec: ImuSpec | str | Path | None = None,
    *,
    at: str = "end",
    workers: int = 1,
) -> Windows:
    """Align each non-overlapping window of a record, and the whole.

    Parameters
    ----------
    source : ImuRecord or iterable of ImuRecord
        A record, or its chunks in order (constant memory).
    site, method, spec, at
        As in `align`.
    length : float
        Length of a window, s. A last window that is not full is left out.
    workers : int
        Processes that solve the windows where there are more than 50.

    Raises
    ------
    InputError
        If no window is full, or as `align`.

    Examples
    --------
    >>> windows = sc.align_windows(record, site, 20.0, spec=spec)
    >>> len(windows.each)
    3
    """
    spec = load_spec(spec)
    whole = Aligner(site, method, spec, at=at)
    passes = track_windows(source, length, whole, Aligner(site, method, spec, at=at))
    if workers > 1 and whole.method.needs == "sums" and whole.method.prefilter is None:
        each = tuple(_solved_by(workers, passes))
    else:
        each = tuple(_slim(window.solution()) for window in passes)
    return Windows(whole.solution(), float(length), each)


def _solved_by(workers: int, passes: Iterator[Aligner]) -> Iterator[Alignment]:
    """Give the windows' alignments in order; other processes help where there are many.

    This process solves what they have no time for, also while they start.
    """
    pool: ProcessPoolExecutor | None = None
    waiting: deque[Alignment | Future[Alignment]] = deque()
    try:
        for found, window in enumerate(passes, 1):
            if found == _ALONE:
                pool = worker_pool(workers - 1)
            under_way = sum(isinstance(each, Future) and not each.done() for each in waiting)
            if pool is None or under_way > 2 * (workers - 1):
                waiting.append(_slim(window.solution()))
            else:
                waiting.append(
                    pool.submit(
                        _solve, window.site, window.method, window.spec, window.at,
                        window.arrays(), window.name, window.said,
                    )
                )  # fmt: skip
            while waiting and _is_done(waiting[0]):
                yield _result(waiting.popleft())
        while waiting:
            yield _result(waiting.popleft())
    finally:
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)


def _is_done(each: Alignment | Future[Alignment]) -> bool:
    return not isinstance(each, Future) or each.done()


def _result(each: Alignment | Future[Alignment]) -> Alignment:
    return each.result() if isinstance(each, Future) else each


@with_one_blas_thread
def _solve(
    site: Site, method: Method, spec: ImuSpec | None, at: str, arrays: dict[str, Any], name: str,
    said: list[str],
) -> Alignment:  # fmt: skip
    """Return the alignment of a window that another process has tracked."""
    window = Aligner(site, method, spec, at=at)
    window.restore(arrays, name, said)
    return _slim(window.solution())


def _slim(fix: Alignment) -> Alignment:
    """Return an alignment with fewer instants of its history: there may be thousands of windows."""
    return fix if fix.history is None else replace(fix, history=fix.history.thin(_KEPT)[0])


def track_windows(
    source: ImuRecord | Iterable[ImuRecord], length: float, whole: Aligner | None, window: Aligner
) -> Iterator[Aligner]:
    """Give an aligner that has taken its samples for each full window, in order.

    Parameters
    ----------
    source : ImuRecord or iterable of ImuRecord
    length : float
        s.
    whole : Aligner or None
        Takes all samples on the way.
    window : Aligner
        Of which each window has a fresh copy; it has taken nothing.

    Raises
    ------
    InputError
        If no window is full.
    """
    expect(length, Real, "window", "give its length in seconds")
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"the window must be a positive time, got {length} s")
    found = 0
    current = window.fresh()
    origin: float | None = None
    interval = 0.0
    end = 0.0
    for chunk in [source] if isinstance(source, ImuRecord) else source:
        if not len(chunk):
            continue
        if origin is None:
            origin, interval = chunk.start, float(chunk.dt[0])
        if whole is not None:
            whole.update(chunk)
        end = chunk.end
        low: float | None = None
        while True:
            edge = origin + (found + 1) * length
            piece = chunk.between(low, edge)
            current.update(piece)
            # A window is full when the next sample would lie beyond its edge.
            if chunk.end < edge - 0.5 * interval:
                break
            yield current
            found += 1
            current = window.fresh()
            low = edge
    if origin is None:
        raise InputError("the record has no samples to align")
    if not found:
        raise InputError(
            f"no window is full: the record has {end - origin:.6g} s, a window {length:g} s"
        )
