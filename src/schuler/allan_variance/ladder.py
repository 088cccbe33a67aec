"""Streaming sums of squared differences: even sampling first, then a ladder of strides."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["Even", "Ladder", "channel_names", "grid"]

Array = NDArray[np.float64]
Lags = NDArray[np.int64]

CAP = 1024
"""Longest lag of a rung, in its own steps."""

_BLOCK = 2048
"""Points that are worked through together; fixed, so that chunking cannot matter."""

_WARM_UP = 256
"""Samples that are looked at to find the nominal interval."""

_JITTER = 0.1
"""Part of the nominal interval that a sample's may be off."""

_SAME = 1e-9
"""Values that differ by less repeat, but for rounding."""

_LEAST_RUNS = 10
"""Runs of equal values that show a slower sensor."""

_RUNG = np.unique(np.rint(2.0 ** (np.arange(0, 41) / 4.0)).astype(np.int64))
"""Lags of the first rung, four an octave; the last four of them are those of every other."""


def grid(longest: int) -> Lags:
    """Return lags from 1 to `longest`, four an octave: those that a ladder works at."""
    parts, step = [_RUNG], 1
    while step * CAP < longest:
        step *= 2
        parts.append(step * _RUNG[-4:])
    lags = np.concatenate(parts)
    return np.asarray(lags[lags <= max(longest, 1)])


def channel_names(gyros: int, accelerometers: int) -> tuple[str, ...]:
    """Return ``gyro_x``, ... for triads, ``gyro_1``, ... for other numbers of sensors."""
    return tuple(
        f"{part}_{axis}"
        for part, n in (("gyro", gyros), ("accel", accelerometers))
        for axis in ("xyz" if n == 3 else [str(k + 1) for k in range(n)])
    )


class Even:
    """Pass on what evenly sampled records were made from; share out what bridges a gap.

    That is the increments of each sample, or for records made from instantaneous rates the rates
    as they came (`ImuRecord.values`), each times the nominal interval `unit`: integrated rates
    have noise of another colour. The nominal interval is the median of the first 256 samples. A
    sample over k intervals (to a tenth of one) becomes k equal parts, counted in `bridged`. Where
    values repeat because the sensor runs slower than the record, each is passed on once.
    """

    def __init__(self) -> None:
        self.nominal = 0.0
        self.samples = self.bridged = 0
        self.gyros = self.accelerometers = 3
        self.hold = 1.0
        self._start = self._end = 0.0
        self._spans = 0
        self._held: list[ImuRecord] = []
        self._as_came = False
        self._last = np.zeros(0)
        self._run = 0

    def copy(self) -> Even:
        """Return a copy that can go on by itself."""
        other = copy.copy(self)
        other._held = list(self._held)
        return other

    @property
    def interval(self) -> float:
        """Mean interval, s, without the clock's rounding errors."""
        return float(f"{self.hold * (self._end - self._start) / max(self._spans, 1):.12g}")

    @property
    def unit(self) -> float:
        """Interval that the increments are passed on for, s."""
        return self.nominal if self._as_came or self.hold > 1.0 else self.interval

    def push(self, record: ImuRecord) -> Array:
        """Return increments (n, c), gyros first; none until the interval is known.

        Raises
        ------
        InputError
            For a value that is not finite, or an interval that does not fit.
        """
        if not len(record):
            return np.zeros((0, 6))
        if self.nominal:
            return self._convert(record)
        self._held.append(record)
        return np.zeros((0, 6)) if sum(map(len, self._held)) < _WARM_UP else self.flush()

    def flush(self) -> Array:
        """Return what was held back."""
        if not self._held:
            return np.zeros((0, 6))
        held = ImuRecord.concatenate(self._held)
        self._held = []
        self.nominal = float(np.median(held.dt[:_WARM_UP]))
        self.gyros, self.accelerometers = held.dtheta.shape[1], held.dvel.shape[1]
        self._as_came = held.values is not None
        self._start = held.start
        out = self._even(held)
        if self._as_came:
            assert held.values is not None
            # The value at the start opens the series, and no interval ends with it.
            out = np.concatenate([held.values[:1] * self.nominal, out])
        self.hold = _hold(out[:_WARM_UP])
        self.nominal *= self.hold
        return self._each_once(out)

    def _convert(self, record: ImuRecord) -> Array:
        return self._each_once(self._even(record))

    def _even(self, record: ImuRecord) -> Array:
        out = np.hstack([record.dtheta, record.dvel])
        came = record.values[1:] if self._as_came and record.values is not None else None
        interval = self.nominal / self.hold
        good = np.isfinite(out if came is None else came).all(axis=1)
        if not good.all():
            row = int(np.flatnonzero(~good)[0])
            raise InputError(
                f"{record.name}: the sample at {record.time[row]:.9g} s has a value that is not a "
                "finite number; drop such samples, or cut the record with --start and --stop"
            )
        parts = record.dt / interval
        with np.errstate(invalid="ignore"):
            times = np.rint(parts)
            odd = ~((np.abs(parts - times) <= _JITTER) & (times >= 1.0))
        if odd.any():
            row = int(np.flatnonzero(odd)[0])
            raise InputError(
                f"{record.name}: the sample at {record.time[row]:.9g} s spans "
                f"{record.dt[row]:.6g} s, where the record's interval is {interval:.6g} s; "
                "Allan deviation needs even sampling: resample the record, or cut it with --start "
                "and --stop"
            )
        self._end = record.end
        whole = int(times.sum())
        self._spans += whole
        if whole == len(record):
            return np.asarray(out if came is None else came * interval)
        k = times.astype(np.int64)
        self.bridged += int(k[k > 1].sum())
        out = np.repeat(out / times[:, None], k, axis=0)
        if came is not None:
            out[np.cumsum(k) - 1] = came * interval
        return np.asarray(out)

    def _each_once(self, out: Array) -> Array:
        """Return the values that a slower sensor gave, each once."""
        if self.hold == 1.0:
            self.samples += len(out)
            return out
        out = out * self.hold
        before = np.vstack([self._last if len(self._last) else out[:1] + 1.0, out[:-1]])
        begins = ~(np.abs(out - before) <= _SAME * np.abs(out)).all(axis=1)
        at = np.arange(len(out))
        latest = np.maximum.accumulate(np.where(begins, at, -1 - self._run))
        run = at - latest
        # A value that comes on twice by chance has a run of twice the length.
        keep = run % round(self.hold) == 0 if self.hold == round(self.hold) else run == 0
        self._last, self._run = out[-1:].copy(), int(run[-1])
        self.samples += int(keep.sum())
        return np.asarray(out[keep])


def _hold(values: Array) -> float:
    """Return how often each row of values comes, 1 where rows do not repeat."""
    same = (np.abs(np.diff(values, axis=0)) <= _SAME * np.abs(values[1:])).all(axis=1)
    changes = np.flatnonzero(~same)
    runs = np.diff(changes)
    if len(runs) < _LEAST_RUNS or runs.min() < 2 or runs.max() > 2 * runs.min():
        return 1.0
    return float(runs[0]) if runs.min() == runs.max() else float(runs.mean())


class _Rung:
    """Points at one stride: those that lags still reach back to, and a block under way."""

    def __init__(self, channels: int, reach: int, lags: Lags) -> None:
        self.lags = lags
        self.points = np.zeros((channels, reach + _BLOCK))
        self.reach, self.fill, self.done = reach, 0, 0
        self.sums = np.zeros((channels, len(lags)))


class Ladder:
    """Sums at many lags in constant memory: rung r holds every 2^r-th point of the phase.

    Parameters
    ----------
    channels : int
    order : {2, 3}
        Second differences (Allan) or third (Hadamard).
    lags : (k,) int64, optional
        Wanted lags in samples; a grid of four an octave without end when not given.
    """

    def __init__(self, channels: int, order: int, lags: Lags | None) -> None:
        self._channels, self._order = channels, order
        self._wanted: dict[int, list[int]] | None = None
        if lags is not None:
            self._wanted = {}
            for m in lags.tolist():
                r = max(0, (m - 1) // CAP).bit_length()
                self._wanted.setdefault(r, []).append(round(m / 2**r))
        self._rungs: list[_Rung] = []
        self._offset = np.zeros(0)
        self._phase = np.zeros(channels)

    def copy(self) -> Ladder:
        """Return a copy that can go on by itself."""
        return copy.deepcopy(self)

    def _lags_of(self, r: int) -> Lags:
        if self._wanted is None:
            return _RUNG if r == 0 else _RUNG[-4:]
        return np.unique(np.array(self._wanted.get(r, []), np.int64))

    def push(self, increments: Array) -> None:
        """Take increments (n, c)."""
        from schuler.kernels.allan import integrate

        if not len(increments):
            return
        if not len(self._offset):
            # Differences are blind to a constant rate; without it the sum stays small and exact.
            self._offset = increments[0].copy()
            self._feed(0, np.zeros((self._channels, 1)))
        phase = np.empty((self._channels, len(increments)))
        integrate(np.ascontiguousarray(increments), self._offset, self._phase, phase)
        self._feed(0, phase)

    def _feed(self, r: int, points: Array) -> None:
        if r == len(self._rungs):
            if self._wanted is not None and r > max(self._wanted):
                return
            self._rungs.append(_Rung(self._channels, self._order * CAP, self._lags_of(r)))
        rung = self._rungs[r]
        taken = 0
        while taken < points.shape[1]:
            n = min(_BLOCK - rung.fill, points.shape[1] - taken)
            at = rung.reach + rung.fill
            rung.points[:, at : at + n] = points[:, taken : taken + n]
            rung.fill += n
            taken += n
            if rung.fill == _BLOCK:
                self._work(r)

    def _work(self, r: int) -> None:
        """Sum over the block under way, pass every second point up, and empty the block."""
        from schuler.kernels import allan as kernels

        add: Any = kernels.hadamard_sums if self._order == 3 else kernels.allan_sums
        rung = self._rungs[r]
        end = rung.reach + rung.fill
        if len(rung.lags):
            for x, sums in zip(rung.points, rung.sums, strict=True):
                add(x[:end], max(0, rung.reach - rung.done), rung.reach, rung.lags, sums)
        up = rung.points[:, rung.reach : end : 2].copy()
        rung.points[:, : rung.reach] = rung.points[:, rung.fill : end].copy()
        rung.done += rung.fill
        rung.fill = 0
        self._feed(r + 1, up)

    def finish(self) -> tuple[Lags, Lags, Lags, Array]:
        """End the stream; return lags and strides in samples, numbers of differences, sums (k, c).

        A lag too long for the record has a number below 1.
        """
        lags: list[Lags] = []
        strides: list[Lags] = []
        counts: list[Lags] = []
        sums: list[Array] = []
        r = 0
        while r < len(self._rungs):
            rung = self._rungs[r]
            if rung.fill:
                self._work(r)
            step = 2**r
            lags.append(step * rung.lags)
            strides.append(np.full(len(rung.lags), step))
            counts.append(rung.done - self._order * rung.lags)
            sums.append(rung.sums.T)
            # A rung of less than a block has nothing that the one below it lacks.
            if self._wanted is None and rung.done < 3 * CAP:
                break
            r += 1
        for q in sorted(q for q in self._wanted or () if q >= len(self._rungs)):
            missing = self._lags_of(q)
            lags.append(2**q * missing)
            strides.append(np.full(len(missing), 2**q))
            counts.append(np.zeros(len(missing), np.int64))
            sums.append(np.zeros((len(missing), self._channels)))
        return (
            np.concatenate(lags),
            np.concatenate(strides),
            np.concatenate(counts),
            np.vstack(sums),
        )
