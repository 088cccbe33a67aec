"""Allan, Hadamard and total deviation of a static record, many averaging times at once.

A record's increments are the steps of a phase (angle, velocity), so their running sum is all that
is needed. Of instantaneous rates each value, times the interval, is a step: what integrates them
would colour their noise. Overlapping estimators of NIST SP 1065 (Riley 2008), eq. 11, 20
and 25. `allan` works on a record in memory with every overlap, and on chunks of any length in
constant memory; what differs then is said in `AllanSums`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.allan_variance.ladder import Even, Ladder, channel_names, grid
from schuler.allan_variance.result import Allan
from schuler.allan_variance.theory import KINDS, Kind, bounds, degrees_of_freedom
from schuler.errors import InputError, expect
from schuler.record import ImuRecord

__all__ = ["Allan", "AllanSums", "allan", "allan_deviation"]

Array = NDArray[np.float64]
Lags = NDArray[np.int64]

_LEAST = 9
"""Fewer samples are no record to judge noise by."""

_PARTS = 8
"""Jobs that a channel's lags are shared out to; no sum is split, so threads change no bit."""


def _settled(kind: str) -> Kind:
    if kind not in KINDS:
        raise InputError(f"kind: expected {', '.join(KINDS)}, got {kind!r}")
    return kind


def _order(kind: Kind) -> int:
    return 3 if kind == "hadamard" else 2


def _threads() -> int:
    import os

    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def _sums(phase: Array, lags: Lags, kind: Kind) -> Array:
    """Return the sums of squared differences (k, c) of a phase (c, n), shared out to threads."""
    from concurrent.futures import ThreadPoolExecutor

    from schuler.kernels import allan as kernels

    work: Any = kernels.hadamard_whole if kind == "hadamard" else kernels.allan_whole
    c = len(phase)
    out = np.zeros((len(lags), c))
    jobs = [(j, k) for k in range(min(_PARTS, len(lags))) for j in range(c)]

    def one(job: tuple[int, int]) -> None:
        # Every eighth lag: short and long ones, so that the jobs take about as long.
        j, k = job
        sums = np.zeros(len(lags[k::_PARTS]))
        work(phase[j], np.ascontiguousarray(lags[k::_PARTS]), sums)
        out[k::_PARTS, j] = sums

    with ThreadPoolExecutor(min(_threads(), len(jobs))) as pool:
        list(pool.map(one, jobs))
    if kind == "total":
        edges = np.zeros((c, len(lags)))
        for j in range(c):
            kernels.total_edges(phase[j], lags, edges[j])
        out += edges.T
    return out


def _scaled(sums: Array, counts: Lags, lags: Lags, interval: float, kind: Kind) -> Array:
    """Return deviations from sums of squared differences, their number and the time."""
    weight = 6.0 if kind == "hadamard" else 2.0
    return np.asarray(np.sqrt(sums / (weight * counts)[:, None]) / (lags * interval)[:, None])


def _counts(points: int, lags: Lags, kind: Kind) -> Lags:
    if kind == "total":
        return np.full(len(lags), points - 2, np.int64)
    return np.asarray(points - _order(kind) * lags)


def _longest(samples: int, kind: Kind) -> int:
    """Return the longest lag that leaves two differences, or as the reflection allows."""
    return samples - 1 if kind == "total" else (samples - 1) // _order(kind)


def allan_deviation(
    increments: ArrayLike, interval: float, lags: ArrayLike, kind: str = "allan"
) -> Array:
    """Return the deviations of evenly sampled increments, with every overlap.

    Parameters
    ----------
    increments : (n, c) or (n,) array_like
        rad or m/s (any unit u gives u/s).
    interval : float
        Sampling interval, s.
    lags : (k,) array_like of int
        Averaging times in samples.
    kind : {"allan", "hadamard", "total"}
        Overlapping Allan, overlapping Hadamard, or total deviation (NIST SP 1065, eq. 11, 20, 25).

    Returns
    -------
    (k, c) or (k,) float64
        rad/s or m/s^2.

    Raises
    ------
    InputError
        For values that are not finite, an interval that is not positive, or a lag that the
        record is too short for.

    Examples
    --------
    >>> white = np.random.default_rng(1).standard_normal(4096)
    >>> one, sixteen = allan_deviation(white, 1.0, [1, 16])
    >>> round(float(one / sixteen))
    4
    """
    from schuler.kernels.allan import integrate

    wanted = _settled(kind)
    values = np.asarray(increments, np.float64)
    m = np.atleast_1d(np.asarray(lags, np.int64))
    x = values.reshape(len(values), -1)
    if not interval > 0 or not np.isfinite(interval):
        raise InputError(f"the sampling interval must be a positive time, got {interval} s")
    longest = _longest(len(x), wanted)
    if len(m) == 0 or m.min() < 1 or m.max() > longest:
        raise InputError(
            f"averaging times of 1 to {longest} samples can be had from {len(x)} samples "
            f"({kind}), got {m.tolist()}"
        )
    phase = np.zeros((x.shape[1], len(x) + 1))
    # A constant rate does not show in differences; without most of it the sum stays small.
    sample = x[:: len(x) // 1024 + 1]
    last = np.zeros(x.shape[1])
    integrate(np.ascontiguousarray(x), sample.mean(axis=0), last, phase[:, 1:])
    if not np.isfinite(last).all():
        row = int(np.flatnonzero(~np.isfinite(x).all(axis=1))[0])
        raise InputError(f"increment {row + 1} is not a finite number; drop such samples first")
    out = _scaled(_sums(phase, m, wanted), _counts(len(x) + 1, m, wanted), m, interval, wanted)
    return out[:, 0] if values.ndim == 1 else out


class AllanSums:
    """Allan or Hadamard deviation of a stream of records, in constant memory.

    Up to 1024 samples every overlap is used, as in memory. For longer times the phase is taken at
    every second, fourth, ... sample (no averaging: the phase itself is exact), so that a time
    is always 512 to 1024 of these steps: differences then begin a 512th of tau apart or less.
    What is left out is redundant: the degrees of freedom fall by less than a thousandth. Given
    times are rounded to whole steps. Any chunking gives bit-identical results.

    Parameters
    ----------
    kind : {"allan", "hadamard"}
        Total deviation reflects the record at its ends and needs it whole: use `allan`.
    taus : sequence of float, optional
        Averaging times, s; four an octave (13 a decade), up to a third of the record, when not
        given.

    Raises
    ------
    InputError
        For another kind or a bad time; from `push` and `result` for uneven sampling, values
        that are not finite, or a record too short.

    Examples
    --------
    >>> sums = AllanSums(taus=[0.1, 1.0])
    >>> for chunk in (record.between(None, 30.0), record.between(30.0, None)):
    ...     sums.push(chunk)
    >>> sums.result().tau.tolist()
    [0.1, 1.0]
    """

    def __init__(self, kind: str = "allan", taus: Sequence[float] | None = None) -> None:
        self._kind = _settled(kind)
        if kind == "total":
            raise InputError(
                "total deviation needs the whole record: read it and use allan(record, 'total')"
            )
        self._taus = None if taus is None else _checked(taus)
        self._even = Even()
        self._ladder: Ladder | None = None
        self.name = "record"

    def push(self, record: ImuRecord) -> None:
        """Take the next chunk."""
        self._take(self._even.push(record))
        if self._even.samples:
            self.name = record.name

    def _take(self, increments: Array) -> None:
        if not len(increments):
            return
        if self._ladder is None:
            lags = None if self._taus is None else _lags(self._taus, self._even.nominal)
            self._ladder = Ladder(increments.shape[1], _order(self._kind), lags)
        self._ladder.push(increments)

    def result(self) -> Allan:
        """Return the deviations of what has been taken; more may be pushed afterwards.

        Raises
        ------
        InputError
            If that is too short.
        """
        ladder = None if self._ladder is None else self._ladder.copy()
        even = self._even.copy()
        rest = even.flush()
        if len(rest):
            if ladder is None:
                lags = None if self._taus is None else _lags(self._taus, even.nominal)
                ladder = Ladder(rest.shape[1], _order(self._kind), lags)
            ladder.push(rest)
        if ladder is None or even.samples < _LEAST:
            raise InputError(_too_short(even.samples))
        lags, stride, counts, sums = ladder.finish()
        interval = even.interval
        if self._taus is None:
            keep = (3 * lags <= even.samples) & (counts >= 2)
            lags, stride, counts, sums = lags[keep], stride[keep], counts[keep], sums[keep]
        else:
            _check_longest(lags, even.samples, interval, self._kind)
        deviation = _scaled(sums, counts, lags, even.unit, self._kind)
        return _made(self._kind, lags, deviation, even, interval, stride, self.name)


def _too_short(samples: int) -> str:
    return f"the record has {samples} sample(s); Allan deviation needs {_LEAST} at the least"


def _checked(taus: Sequence[float]) -> Array:
    out = np.unique(np.asarray(taus, np.float64).ravel())
    if not len(out) or not np.isfinite(out).all() or out[0] <= 0:
        raise InputError(f"averaging times must be positive numbers of seconds, got {list(taus)}")
    return out


def _lags(taus: Array, interval: float) -> Lags:
    lags = np.rint(taus / interval).astype(np.int64)
    if lags[0] < 1:
        raise InputError(
            f"averaging time {taus[0]:g} s is shorter than the sampling interval "
            f"({interval:g} s); give {interval:g} s or more"
        )
    return np.unique(lags)


def _check_longest(lags: Lags, samples: int, interval: float, kind: Kind) -> None:
    longest = _longest(samples, kind)
    if lags[-1] > longest:
        raise InputError(
            f"averaging time {lags[-1] * interval:g} s is too long for a record of "
            f"{samples * interval:g} s; give {longest * interval:g} s or less ({kind})"
        )


def _made(
    kind: Kind, lags: Lags, deviation: Array, even: Even, interval: float, stride: Lags, name: str
) -> Allan:
    edf = degrees_of_freedom(kind, deviation, lags, even.samples)
    lower, upper = bounds(deviation, edf)
    return Allan(
        kind, np.round(lags * interval, 12), channel_names(even.gyros, even.accelerometers),
        deviation, lower, upper, edf, interval, even.samples, stride, even.bridged, name,
    )  # fmt: skip


def allan(
    record: ImuRecord | Iterable[ImuRecord],
    taus: Sequence[float] | None = None,
    kind: str = "allan",
) -> Allan:
    """Return the Allan, Hadamard or total deviation of each channel of a static record.

    Parameters
    ----------
    record : ImuRecord or iterable of ImuRecord
        A record in memory, or consecutive chunks (as of `Source.chunks`), which are taken in
        constant memory (`AllanSums`); for ``kind="total"`` the chunks' increments are kept.
    taus : sequence of float, optional
        Averaging times, s, rounded to whole samples; four an octave (13 a decade), from one
        sample to a third of the record, when not given.
    kind : {"allan", "hadamard", "total"}

    Raises
    ------
    InputError
        For an unknown kind, a record too short or unevenly sampled, a value that is not finite,
        or an averaging time that the record cannot give.

    Examples
    --------
    >>> found = sc.allan(record, taus=[1.0, 10.0])
    >>> len(found.to_pandas()) > 0
    True
    """
    wanted = _settled(kind)
    # A text or a table can be gone through too, and has no samples.
    how = "read a file with schuler.read, a table with schuler.io.from_pandas"
    if not isinstance(record, Iterable) or isinstance(record, str) or hasattr(record, "columns"):
        expect(record, ImuRecord, "record", how)
    if not isinstance(record, ImuRecord) and wanted != "total":
        sums = AllanSums(wanted, taus)
        for chunk in record:
            sums.push(chunk)
        return sums.result()
    chunks = [record] if isinstance(record, ImuRecord) else record
    even, name = Even(), "record"
    kept = []
    for chunk in chunks:
        kept.append(even.push(chunk))
        name = chunk.name
    kept.append(even.flush())
    increments = np.concatenate([part for part in kept if len(part)] or [np.zeros((0, 6))])
    samples = even.samples
    if samples < _LEAST:
        raise InputError(_too_short(samples))
    if taus is None:
        lags = grid(samples // 3)
    else:
        lags = _lags(_checked(taus), even.nominal)
        _check_longest(lags, samples, even.interval, wanted)
    deviation = allan_deviation(increments, even.unit, lags, wanted)
    return _made(wanted, lags, deviation, even, even.interval, np.ones_like(lags), name)
