"""`MovingStream`: samples and fixes as they come, to the alignment of all of them at any time.

Samples wait for the fixes that may still come (`latency`), so that the order of arrival does not
matter. Until the heading is known, the coarse stage looks at running sums. Then the passes of the
whole-record alignment run back and forth over the samples that are kept, and again each time these
have become a tenth more; between these instants, and when `keep` seconds are full, the filter of
the last pass runs on. All decisions fall on whole seconds of the stream's own time: any chunking
gives the same bits.

Source: the backtracking of stored increments is that of in-motion alignment by repeated passes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import GnssFixes
from schuler.aiding.fix_rows import COLUMNS, FixSetting, is_possible
from schuler.alignment.moving.align import instrument_of, prepare
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.running import RunningAlignment
from schuler.alignment.moving.sample_tables import check_table, copied, records_of, table_of
from schuler.constants import STAMP_ROUNDING
from schuler.errors import InputError
from schuler.in_motion.body import BodyPass
from schuler.in_motion.coarse import ENOUGH, coarse, missing
from schuler.in_motion.rotation import LEAST_ROWS
from schuler.in_motion.series import position_series, velocity_series
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["MovingStream", "StreamSetting"]

Array = NDArray[np.float64]

_GROWTH = 1.1
"""Passes run again over the kept samples when these are so many times as long as at the last."""

_WAIT = 0.05
"""After a look at the running sums that showed no heading, the next comes so much later, of the
time since the start."""

_FORGET = 0.25
"""What is forgotten of the kept samples when they show no heading and are full."""

_MOST_SAMPLES = 400_000
"""That are kept, whatever `keep` says: 26 MB, and passes of two seconds."""

_WINDOW = 64
"""Fixes that are kept for the running filter."""

_MOST_FIXES = 20_000
"""That are held, taken and to come: more are no receiver's."""

_WINDOW_TIME = 12.0
"""A fix may be stamped so much later than it is valid, s."""

_COUNTS = ("fixes", "late_fixes", "repeated_fixes", "surplus_fixes")
"""What became of fixes."""


@dataclass(frozen=True)
class StreamSetting:
    """What a stream is aligned with.

    Parameters
    ----------
    spec : ImuSpec, str or path, optional
    antenna : FixSetting
    latency : float
        s by which a fix may be later than the samples of its instant: so long these wait for it.
    keep : float
        s of samples and fixes over which passes run back and forth.
    vibration : float, optional
        As of `align_moving`.

    Raises
    ------
    InputError
        For times that are too short or too long.

    Examples
    --------
    >>> StreamSetting("tactical-fog", keep=120.0).latency
    1.0
    """

    spec: ImuSpec | str | Path | None = None
    antenna: FixSetting = field(default_factory=FixSetting)
    latency: float = 1.0
    keep: float = 300.0
    vibration: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.latency <= 60.0:
            raise InputError(f"the latency of fixes is 0 to 60 s, got {self.latency:g}")
        if not 20.0 <= self.keep <= 3600.0:
            raise InputError(f"20 to 3600 s of samples are kept, got {self.keep:g}")


class MovingStream:
    """Take samples and fixes; give the alignment in motion at any time.

    Parameters
    ----------
    setting : StreamSetting, optional

    Raises
    ------
    InputError
        For a specification that cannot be read.

    Examples
    --------
    >>> from schuler.aiding.fix_rows import rows_of
    >>> stream = MovingStream(StreamSetting(spec))
    >>> stream.add(rows_of(gnss))
    0
    >>> stream.update(drive)
    >>> stream.finish()
    >>> stream.solution().headline()[:7]
    'heading'
    """

    def __init__(self, setting: StreamSetting | None = None) -> None:
        self.setting = setting or StreamSetting()
        self.spec, self._warnings = instrument_of(self.setting.spec)
        self._waiting: list[ImuRecord] = []
        self._kept: list[ImuRecord] = []
        self._rows = np.zeros((0, COLUMNS))
        self._kept_rows = np.zeros((0, COLUMNS))
        self._pass: BodyPass | None = BodyPass()
        self._run: RunningAlignment | None = None
        self._next = -np.inf
        self._passed = 0, 0
        self._full = False
        self._second: float | None = None
        self.trouble: str | None = None
        self.samples = 0
        self.counts: Counter[str] = Counter()

    # -- feeding -----------------------------------------------------------------------

    def update(self, chunk: ImuRecord) -> None:
        """Take samples that follow the last ones.

        Raises
        ------
        InputError
            If they do not follow, or are not of three gyros and three accelerometers.
        """
        if not len(chunk):
            return
        if chunk.dtheta.shape[1:] != (3,) or chunk.dvel.shape[1:] != (3,):
            raise InputError("an alignment needs three gyros and three accelerometers")
        if chunk.time[0] <= self.newest:
            raise InputError(
                f"a chunk starts at t = {time_text(chunk.time[0])} s, not after the last sample "
                f"({time_text(self.newest)} s)"
            )
        self._waiting.append(chunk)
        self._advance(final=False)

    def add(self, rows: Array) -> int:
        """Take fixes as rows of `COLUMNS`, in any order; return how many came too late.

        Raises
        ------
        InputError
            For an array of another shape, or rows that no vehicle can have.
        """
        rows = np.asarray(rows, np.float64)
        if rows.ndim != 2 or rows.shape[1] != COLUMNS:
            raise InputError(f"fixes come as rows of {COLUMNS} numbers, got {rows.shape}")
        if not all(is_possible(row) for row in rows):
            raise InputError("a fix is no place on Earth, or faster than a vehicle")
        late = repeated = surplus = 0
        for row in rows:
            if self.samples and row[0] - self._lag <= self.time + STAMP_ROUNDING:
                late += 1
                continue
            k = int(np.searchsorted(self._rows[:, 0], row[0]))
            near = self._rows[max(k - 1, 0) : k + 1, 0]
            if np.any(np.abs(near - row[0]) < STAMP_ROUNDING):
                repeated += 1
                continue
            if len(self._rows) >= _MOST_FIXES:
                surplus += 1
                continue
            self._rows = np.insert(self._rows, k, row, axis=0)
        self.counts.update(
            fixes=len(rows) - late - repeated - surplus, late_fixes=late, repeated_fixes=repeated,
            surplus_fixes=surplus,
        )  # fmt: skip
        self._advance(final=False)
        return late

    def finish(self) -> None:
        """Take what still waits: the stream has ended."""
        self._advance(final=True)
        if self.samples and not self._full:
            self._look()

    @property
    def newest(self) -> float:
        """Time of the last sample that came, s; -inf without one."""
        return self._waiting[-1].end if self._waiting else self.time

    @property
    def time(self) -> float:
        """Time of the last sample that was taken, s; -inf without one."""
        if self._run is not None:
            return self._run.time
        return self._kept[-1].end if self._kept else -np.inf

    @property
    def _lag(self) -> float:
        run = 0.0 if self._run is None else self._run.lag
        return max(self.setting.antenna.delay, run, 0.0)

    def _advance(self, final: bool) -> None:
        """Take the samples whose fixes have come or are given up."""
        if not self._waiting:
            return
        newest, limit = self.newest, np.inf
        if not final:
            limit = newest - self.setting.latency
            if len(self._rows):
                # Fixes come in order: before the last one none is missing.
                limit = max(limit, min(newest, float(self._rows[-1, 0]) - self._lag))
        if self._waiting[0].time[0] > limit + STAMP_ROUNDING:
            return
        waiting = ImuRecord.concatenate(self._waiting)
        count = int(np.searchsorted(waiting.time, limit + STAMP_ROUNDING, side="right"))
        seconds = np.floor(waiting.time[:count] - STAMP_ROUNDING)
        edges = [0, *(np.flatnonzero(np.diff(seconds)) + 1).tolist(), count]
        for begin, end in pairwise(edges):
            # A second that is over, and not one that the chunk happens to end in.
            if self._second is not None and seconds[begin] > self._second:
                self._decide()
            self._second = float(seconds[begin])
            self._take(copied(waiting.rows(begin, end)))
        rest = waiting.rows(count, len(waiting))
        self._waiting = [copied(rest)] if len(rest) else []

    def _take(self, chunk: ImuRecord) -> None:
        begin = self.time if self.samples else chunk.start - STAMP_ROUNDING
        self.samples += len(chunk)
        if self._run is not None:
            known = self._rows[: self._due_rows(chunk.end + _WINDOW_TIME)]
            self._run.feed(chunk, self._fixes(known[-_WINDOW:]))
        if self._full:
            # Those before are needed no more.
            self._rows = self._rows[max(self._due_rows(chunk.end) - _WINDOW, 0) :]
            return
        self._kept.append(chunk)
        if self._pass is not None:
            self._follow(self._pass, chunk, begin)

    def _follow(self, sums: BodyPass, chunk: ImuRecord, begin: float) -> None:
        due = self._rows[:, 0] - self.setting.antenna.delay
        sums.add_due(due[(due > begin) & (due <= chunk.end + STAMP_ROUNDING)])
        sums.update(chunk)

    def _due_rows(self, time: float) -> int:
        """Return how many fixes are valid up to a time."""
        return int(
            np.searchsorted(self._rows[:, 0] - self._lag, time + STAMP_ROUNDING, side="right")
        )

    def _fixes(self, rows: Array) -> GnssFixes | None:
        """Return the fixes of rows, or None where they are too few."""
        try:
            return self.setting.antenna.fixes(rows)
        except InputError:
            return None

    # -- deciding ----------------------------------------------------------------------

    def _decide(self) -> None:
        """Look for a heading where it is time to, and forget what is too much."""
        if self._full:
            return
        if self.time >= self._next:
            self._look()
        span, count = self.time - self._kept[0].start, sum(map(len, self._kept))
        if span < self.setting.keep and count < _MOST_SAMPLES:
            return
        if self._run is None:
            self._forget(span)
            return
        self._full = True
        self._kept = [copied(self._whole().rows(0, self._passed[0]))]
        self._kept_rows = self._rows[: self._passed[1]].copy()

    def _look(self) -> None:
        span = self.time - self._kept[0].start
        if self._run is None:
            self.trouble = self._no_heading()
            if self.trouble is not None:
                self._next = self.time + max(1.0, _WAIT * span)
                return
        self._passes(len(self._whole()), self._due_rows(self.time))
        self._next = self.time + max(1.0, (_GROWTH - 1.0) * span)

    def _whole(self) -> ImuRecord:
        self._kept = [ImuRecord.concatenate(self._kept)]
        return self._kept[0]

    @with_one_blas_thread
    def _no_heading(self) -> str | None:
        """Return why the running sums show no heading, or None where they do."""
        rows = self._rows[: self._due_rows(self.time)]
        count = len(rows)
        if count < LEAST_ROWS or self._pass is None:
            return (
                f"{count} fixes came up to t = {time_text(self.time)} s: an alignment needs "
                f"{LEAST_ROWS}"
            )
        antenna = self.setting.antenna
        try:
            fixes = antenna.fixes(rows)
            body = self._pass.rows()
            due = np.asarray(fixes.time) - antenna.delay
            body = body.pick(np.isin(body.time, due))
            fixes = fixes.rows(np.isin(due, body.time))
            series = (position_series if fixes.v_n is None else velocity_series)(body, fixes)
            place = float(np.asarray(fixes.lat)[0]), float(np.asarray(fixes.lon)[0])
            found = coarse(
                series, self.spec, place, body.start, np.eye(3), np.zeros((3, 3)),
                estimate_delay="delay" in antenna.estimate,
            )  # fmt: skip
        except InputError as error:
            return str(error)
        if not found.heading_sigma <= ENOUGH:
            return f"{antenna.name}: {missing(found, series)}"
        return None

    def _passes(self, count: int, fixes: int) -> None:
        """Run back and forth over the first samples and fixes that are kept."""
        record, antenna = self._whole().rows(0, count), self.setting.antenna
        try:
            prepared = prepare(record, [antenna.fixes(self._rows[:fixes])], self.spec, None)
            first, rough = prepared.coarse()
            found, taken = prepared.fine(rough, first, self.setting.vibration)
            run = RunningAlignment(prepared, rough, found, taken, self.spec, self._warnings)
        except InputError as error:
            # What runs already has the heading; what does not waits for more.
            self.trouble = str(error)
            return
        self._run, self._pass, self._passed, self.trouble = run, None, (count, fixes), None

    def _forget(self, span: float) -> None:
        """Forget the first part of samples that show no heading, and begin the sums anew."""
        whole = self._whole()
        begin = self._kept[0].start + _FORGET * span
        self._kept = [copied(whole.between(begin, None))]
        start = self._kept[0].start
        self._rows = self._rows[
            self._rows[:, 0] - self.setting.antenna.delay >= start - STAMP_ROUNDING
        ]
        self._pass = BodyPass()
        self._follow(self._pass, self._kept[0], start - STAMP_ROUNDING)

    # -- results -----------------------------------------------------------------------

    @property
    def starting(self) -> bool:
        """Whether no heading is known yet."""
        return self._run is None

    def solution(self) -> MovingAlignment:
        """Return the alignment at the last sample that was taken.

        Raises
        ------
        InputError
            If no heading is known yet; it says what is missing.
        """
        if self._run is None:
            raise InputError(self.trouble or "too few samples and fixes came to align")
        return self._run.solution()

    # -- saving ------------------------------------------------------------------------

    def arrays(self) -> dict[str, Array]:
        """Return all that a later stream, made alike, needs to resume."""
        out = {
            **table_of("kept", self._kept), **table_of("waiting", self._waiting),
            "fixes": self._rows, "kept_fixes": self._kept_rows,
            "stream": np.array([
                self._next, *self._passed, self._full, self.samples, self._run is not None,
                -np.inf if self._second is None else self._second,
                *(self.counts[name] for name in _COUNTS),
            ], np.float64),
        }  # fmt: skip
        return out if self._run is None else {**out, **self._run.arrays()}

    def restore(self, arrays: Mapping[str, Array], name: str = "record") -> None:
        """Resume in the place of the stream that gave the arrays, made alike.

        Raises
        ------
        InputError
            If the arrays are not those of such a stream.
        """
        damaged = InputError("the saved state of an alignment in motion is damaged")
        s = arrays.get("stream")
        if s is None or s.shape != (7 + len(_COUNTS),) or np.any(np.isnan(s)):
            raise damaged
        for key in ("fixes", "kept_fixes"):
            check_table(key, arrays.get(key), COLUMNS)
        passed = int(s[1]), int(s[2])
        full, running = bool(s[3]), bool(s[5])
        rows = arrays["kept_fixes"] if full else arrays["fixes"]
        if not 0 <= passed[0] <= len(arrays.get("kept", ())) or not 0 <= passed[1] <= len(rows):
            raise damaged
        self._kept = records_of("kept", arrays, name)
        self._rows = rows.copy()
        self._pass, self._run = BodyPass(), None
        if running:
            self._passes(*passed)
            if self._run is None:
                raise damaged
            self._run.restore(arrays)
        elif self._kept:
            self._follow(self._pass, self._kept[0], self._kept[0].start - STAMP_ROUNDING)
        self._rows, self._kept_rows = arrays["fixes"].copy(), arrays["kept_fixes"].copy()
        self._waiting = records_of("waiting", arrays, name)
        self._next, self._passed, self._full = float(s[0]), passed, full
        self.samples = int(s[4])
        self._second = None if np.isinf(s[6]) else float(s[6])
        self.counts = Counter(
            {key: int(n) for key, n in zip(_COUNTS, s[7:], strict=True) if n > 0.0}
        )
