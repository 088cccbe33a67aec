"""All methods and prefilters on one record: heading, sigma, settling, repeatability, cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler._processes import each
from schuler._result import Result, table_of_rows
from schuler.alignment.aligner import Aligner
from schuler.alignment.convergence import Parts, heading_history
from schuler.alignment.method import Method
from schuler.alignment.methods import (
    METHODS,
    parse_method,
)
from schuler.alignment.result import Alignment
from schuler.alignment.windows import spread_arcmin, track_windows
from schuler.earth import Site
from schuler.errors import InputError, SchulerError, expect
from schuler.prefilter import PREFILTERS, parse_prefilter
from schuler.record import ImuRecord, without_spikes
from schuler.sensors import ImuSpec, load_spec

__all__ = ["DEFAULT_PAIRS", "Comparison", "Row", "compare", "settle_time"]

Array = NDArray[np.float64]

#: methods without a prefilter, then the prefilters before the document's estimator and the default
DEFAULT_PAIRS: tuple[tuple[str, str], ...] = (
    *((name, "none") for name in METHODS),
    *(("integral-triad", name) for name in PREFILTERS),
    *(("centred", name) for name in PREFILTERS),
)

SETTLED = 3.0
"""A settled heading stays within so many of the least sigma, if no band is given."""


@dataclass(frozen=True)
class Row:
    """What one method made of the record; None where it could not be had.

    Parameters
    ----------
    method, prefilter : str
    heading_deg, sigma_arcmin : float or None
    settle_s : float or None
        As `settle_time`, with the comparison's band; None if it never settles.
    std_heading_arcmin : float or None
        Over non-overlapping windows.
    seconds : float
        Of the alignment.
    note : str
        Why there is no heading, or which method was chosen.
    consistent : bool or None
        Whether nothing contradicts the alignment.
    """

    method: str
    prefilter: str
    heading_deg: float | None
    sigma_arcmin: float | None
    settle_s: float | None
    std_heading_arcmin: float | None
    seconds: float
    note: str = ""
    consistent: bool | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values."""
        return {
            "method": self.method, "prefilter": self.prefilter, "heading_deg": self.heading_deg,
            "heading_sigma_arcmin": self.sigma_arcmin, "settle_s": self.settle_s,
            "std_heading_arcmin": self.std_heading_arcmin, "seconds": self.seconds,
            "note": self.note, "consistent": self.consistent,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Comparison(Result):
    """Rows of methods on one record.

    Parameters
    ----------
    name : str
        Of the record.
    duration, window : float
        s.
    limit_arcmin : float or None
        Of the heading.
    rows : tuple of Row
    contradictions : tuple of str
        What the record shows and cannot be, as the first alignment without a prefilter says it.
    read_as, assumed : str or None, tuple of str
        How the file was read, where it was one.
    within_arcmin : float or None
        The band of all settling times: as asked for, or three times the least sigma of the rows.
    heading_deg : float or None
        The true heading, where it was given: times are then until the heading stays about it.
    """

    name: str
    duration: float
    window: float | None
    limit_arcmin: float | None
    rows: tuple[Row, ...]
    contradictions: tuple[str, ...] = ()
    read_as: str | None = None
    assumed: tuple[str, ...] = ()
    within_arcmin: float | None = None
    heading_deg: float | None = None

    @property
    def consistent(self) -> bool:
        """Whether nothing contradicts the record."""
        return not self.contradictions

    @property
    def settled_note(self) -> str:
        """What settled means here, in a sentence; empty where no method found north."""
        if self.within_arcmin is None:
            return ""
        about = "its end" if self.heading_deg is None else f"{self.heading_deg:.4f} deg"
        return (
            f"settled: from then on the heading stays within {self.within_arcmin:.3g}' of {about}; "
            "-: it does not, or its own sigma is wider"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison with the keys of the JSON schema `schuler.comparison/3`."""
        return {
            "schema": "schuler.comparison/3", "record": self.name, "duration_s": self.duration,
            "window_s": self.window, "limit_arcmin": self.limit_arcmin,
            "read_as": self.read_as, "assumed": list(self.assumed),
            "consistent": self.consistent, "contradictions": list(self.contradictions),
            "settled_within_arcmin": self.within_arcmin, "true_heading_deg": self.heading_deg,
            "rows": [row.to_dict() for row in self.rows],
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each method and prefilter."""
        return table_of_rows([row.to_dict() for row in self.rows])

    def __str__(self) -> str:
        def cell(value: float | None, form: str, unit: str = "") -> str:
            return "-" if value is None else f"{value:{form}}{unit}"

        lines = [f"INCONSISTENT: {text}" for text in self.contradictions]
        lines += [
            f"{'method':<22} {'prefilter':<18} {'heading deg':>12} {'sigma':>9} {'settle s':>9} "
            f"{'std':>9} {'seconds':>8}"
        ]
        lines += [
            f"{row.method:<22} {row.prefilter:<18} {cell(row.heading_deg, '12.4f'):>12} "
            f"{cell(row.sigma_arcmin, '.3g', chr(39)):>9} {cell(row.settle_s, '.4g'):>9} "
            f"{cell(row.std_heading_arcmin, '.3g', chr(39)):>9} {row.seconds:>8.2f}"
            + (f"  {row.note}" if row.note else "")
            for row in self.rows
        ]
        if self.settled_note:
            lines.append(self.settled_note)
        return "\n".join(line.rstrip() for line in lines)


def settle_time(
    fix: Alignment, points: int = 100, *, within: float | None = None, heading: float | None = None
) -> float | None:
    """Return the time used from which on the heading stays within a band, s; None if it never does.

    A heading whose own sigma at the end is wider than the band has not settled, wherever it stays.

    Parameters
    ----------
    fix : Alignment
    points : int
        Ever longer parts of the record that are looked at, at most; 40 % of them for a filter.
    within : float, optional
        Half the width of the band, arcmin; three of the alignment's sigmas when not given.
    heading : float, optional
        Middle of the band, deg: the true heading; that at the end when not given.
    """
    sigma = float(fix.sigma_arcmin[2])
    band = SETTLED * sigma if within is None else within
    return _settled(*heading_history(fix, _points(fix, points)), sigma, band, heading)


def _points(fix: Alignment, points: int = 100) -> int:
    """Return how many parts are looked at: a filter runs over each, so that they are fewer."""
    return points if fix.filter_history is None else max(2, 2 * points // 5)


def _settled(
    t: Array, found: Array, sigma: float, band: float, heading: float | None
) -> float | None:
    """Return the first time from which on headings stay in a band, or None."""
    if sigma > band:
        return None
    away = found - (found[-1] if heading is None else heading)
    off = np.abs((away + 180.0) % 360.0 - 180.0) * 60.0 > band
    if not np.any(off):
        return float(t[0])
    last = int(np.flatnonzero(off)[-1])
    return None if last + 1 >= len(t) else float(t[last + 1])


@with_one_blas_thread
def compare(
    record: ImuRecord,
    site: Site,
    spec: ImuSpec | str | Path | None = None,
    pairs: Sequence[tuple[str, str]] = DEFAULT_PAIRS,
    *,
    window: float | None = None,
    within: float | None = None,
    heading: float | None = None,
    progress: Callable[[str], None] | None = None,
    workers: int = 1,
) -> Comparison:
    """Run methods and prefilters on one record.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    spec : ImuSpec, str or path, optional
    pairs : sequence of (method, prefilter)
        Names as on the command line.
    window : float, optional
        Length of the windows for repeatability, s; a tenth of the record, 60 s at least, when
        not given, and none where fewer than three fit.
    within : float, optional
        Band of the settling times, arcmin: the same for all rows, so that they can be compared;
        three times the least sigma of the rows when not given.
    heading : float, optional
        The true heading, deg, where it is known.
    progress : callable, optional
        Called with what was run.
    workers : int
        Processes that share the work.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> table = sc.compare(record, site, spec, [("optimal", "none"), ("wahba", "none")])
    >>> [row.method for row in table.rows]
    ['optimal', 'wahba']
    """
    expect(
        record,
        ImuRecord,
        "record",
        "read a file with schuler.read, a table with schuler.io.from_pandas",
    )
    expect(site, Site, "site", "say schuler.Site(lat, lon, height)")
    for name, value in (("within", within), ("heading", heading)):
        if value is not None and not np.isfinite(value):
            raise InputError(f"{name} must be a finite number, got {value}")
    if within is not None and not within > 0.0:
        raise InputError(f"within must be positive, got {within:g} arcmin")
    spec = load_spec(spec)
    if window is None:
        window = max(60.0, record.duration / 10.0)
    repeat = window if record.duration >= 3.0 * window else None
    if record.quality is None:
        record, _ = without_spikes(record)
    methods = [parse_method(m).with_prefilter(parse_prefilter(p)) for m, p in pairs]
    rows: dict[int, Row] = {}
    said: dict[int, tuple[str, ...]] = {}
    limits: list[float] = []
    histories: dict[int, tuple[Array, Array]] = {}
    left = list(range(len(methods)))
    groups: list[dict[int, Method]] = []
    while left:
        # All that filter and track the record alike share one pass over it.
        first = Aligner(site, methods[left[0]], spec)
        group = [k for k in left if first.shares_pass(methods[k])]
        left = [k for k in left if k not in group]
        # Without a prefilter a pass costs little beside what follows: processes share that.
        parts = workers if methods[group[0]].prefilter is None else 1
        size = -(-len(group) // parts)
        cuts = range(0, len(group), size)
        groups += [{k: methods[k] for k in group[i : i + size]} for i in cuts]
    jobs = [(record, site, spec, repeat, group, tuple(pairs)) for group in groups]
    for part, found in zip(groups, each(_compare_group, jobs, workers), strict=True):
        rows.update(found.rows)
        said.update(found.contradictions)
        limits += found.limits
        histories |= found.histories
        if progress is not None:
            for k in part:
                progress(", ".join(name for name in pairs[k] if name != "none"))
    sigmas = {k: row.sigma_arcmin for k, row in rows.items() if row.sigma_arcmin is not None}
    if within is None:
        # One band for all: each method's own sigma would let the vaguest settle first.
        within = min((SETTLED * sigma for sigma in sigmas.values()), default=None)
    for k, sigma in sigmas.items():
        assert within is not None
        settled = _settled(*histories[k], sigma, within, heading)
        rows[k] = replace(rows[k], settle_s=settled)
    # A prefilter may take from the record what its consistency is judged by, gravity for one.
    plain = [k for k in sorted(said) if methods[k].prefilter is None]
    contradictions = next((said[k] for k in plain or sorted(said) if said[k]), ())
    # A record quieter than its specification has the lower bound.
    return Comparison(
        record.name, record.duration, repeat, min(limits, default=None),
        tuple(rows[k] for k in range(len(methods))), contradictions, within_arcmin=within,
        heading_deg=heading,
    )  # fmt: skip


@dataclass(frozen=True)
class _Group:
    """What methods that share a pass over the record make of it, by their numbers.

    Parameters
    ----------
    rows : dict of int to Row
    contradictions : dict of int to tuple of str
    limits : list of float
        Of those without a prefilter, arcmin.
    histories : dict of int to (times, headings)
        Of ever longer parts of the record, s and deg.
    """

    rows: dict[int, Row]
    contradictions: dict[int, tuple[str, ...]]
    limits: list[float]
    histories: dict[int, tuple[Array, Array]]


def _compare_group(
    record: ImuRecord, site: Site, spec: ImuSpec | None, repeat: float | None,
    methods: dict[int, Method], pairs: Sequence[tuple[str, str]],
) -> _Group:  # fmt: skip
    """Compare methods that share a pass over the record."""
    out = _Group({}, {}, [], {})
    whole = Aligner(site, methods[min(methods)], spec)
    begin = time.perf_counter()
    error = ""
    windows: list[Aligner] = []
    parts: Parts = {}
    try:
        whole.update(record).prepared()
    except SchulerError as refused:
        error = str(refused)
    shared = time.perf_counter() - begin
    if repeat is not None and not error:
        windows = list(track_windows(record, repeat, None, whole))
    for k, method in methods.items():
        name, filter_name = pairs[k]
        begin = time.perf_counter()
        try:
            if error:
                raise InputError(error)
            fix = whole.solution_by(method, "end")
        except SchulerError as refused:
            seconds = shared + time.perf_counter() - begin
            out.rows[k] = Row(name, filter_name, None, None, None, None, seconds, str(refused))
            continue
        seconds = shared + time.perf_counter() - begin
        out.contradictions[k] = fix.contradictions
        if fix.limit_arcmin is not None and method.prefilter is None:
            out.limits.append(float(fix.limit_arcmin[2]))
        # Windows are judged by the heading at their start: the vehicle may have moved.
        at = "end" if name in ("gyrocompass", "kalman-large") else "start"
        out.histories[k] = heading_history(fix, _points(fix), parts)
        notes = [f"chose {fix.method}"] if name == "auto" else []
        if method.prefilter is not None and not fix.consistent:
            notes.append("inconsistent after the prefilter")
        out.rows[k] = Row(
            name, filter_name, fix.heading_deg, float(fix.sigma_arcmin[2]), None,
            _spread(windows, method, at), seconds, "; ".join(notes), fix.consistent,
        )  # fmt: skip
    return out


def _spread(windows: list[Aligner], method: Method, at: str) -> float | None:
    """Return the standard deviation of the windows' headings, arcmin, or None without one."""
    try:
        return spread_arcmin([window.solution_by(method, at).heading_deg for window in windows])
    except InputError:
        return None
