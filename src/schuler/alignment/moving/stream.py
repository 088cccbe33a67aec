"""`MovingStream`: samples and fixes as they come, to the alignment of all of them at any time.

Samples wait for the fixes that may still come (`latency`), so that the order of arrival does not
matter. Until the heading is known, the coarse stage looks at running sums. Then the passes of the
whole-record alignment run back and forth over the samples that are kept, and again each time these
have become a tenth more; between these instants, and when `keep` seconds are full, the filter of
the last pass runs on. All decisions fall on whole seconds of the stream's own time: any chunking
gives the same bits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import GnssFixes
from schuler.aiding.fix_rows import COLUMNS, TIME
from schuler.alignment.moving.align import instrument_of, prepare
from schuler.alignment.moving.fine import KNOWN
from schuler.alignment.moving.fix_queue import COUNTS, FixQueue
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.running import RunningAlignment
from schuler.alignment.moving.sample_tables import check_table, copied, records_of, table_of
from schuler.alignment.moving.stream_setting import StreamSetting
from schuler.constants import DEG, STAMP_ROUNDING
from schuler.errors import InputError
from schuler.in_motion.body import BodyPass
from schuler.in_motion.coarse import ENOUGH, coarse, missing
from schuler.in_motion.rotation import LEAST_ROWS
from schuler.in_motion.series import position_series, velocity_series
from schuler.record import ImuRecord
from schuler.units import time_text

__all__ = ["MovingStream"]

Array = NDArray[np.float64]

_GROWTH = 1.1
"""Passes run again over the kept samples when these are so many times as long as at the last."""

_WAIT = 0.05
"""After a look at the running sums that showed no heading, the next comes so much later, of the
time since the start."""

_FORGET = 0.25
"""What is forgotten of the kept samples when they show no heading and are full."""

_LONGER = 4.0
"""So many times as long samples are kept while the heading is not known to two degrees."""

_MOST_SAMPLES = 400_000
"""That are kept, whatever `keep` says: 26 MB, and passes of two seconds."""

_FAILURES = (InputError, ArithmeticError, np.linalg.LinAlgError)
"""What samples and fixes that mean nothing may end in: no heading, and not the stream."""

_STEP = 0.1
"""Samples that fixes are given up for are taken in steps, s: each step costs some work."""


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
    >>> from schuler.aiding.fix_rows import TIME, rows_of
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
        self._queue = FixQueue()
        self._kept_rows = np.zeros((0, COLUMNS))
        self._pass: BodyPass | None = BodyPass()
        self._run: RunningAlignment | None = None
        self._next = -np.inf
        self._passed = 0, 0
        self._full = False
        self._second: float | None = None
        self._lost = -np.inf
        self.trouble: str | None = None
        self.samples = 0

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
        after = self.time + self._lag if self.samples else -np.inf
        late = self._queue.add(rows, after)
        self._advance(final=False)
        return late

    @property
    def counts(self) -> Counter[str]:
        """What became of the fixes, by `COUNTS`."""
        return self._queue.counts

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
        return self._kept[-1].end if self._kept else self._lost

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
            limit = float(np.floor((newest - self.setting.latency) / _STEP)) * _STEP
            rows = self._queue.rows
            if len(rows):
                # Fixes come in order: before the last one none is missing.
                limit = max(limit, min(newest, float(rows[-1, 0]) - self._lag))
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
            reach = self._run.reach
            rows = self._queue.around(begin - reach, chunk.end + reach)
            self._run.feed(chunk, self._fixes(rows) if len(rows) else None)
        if self._full:
            return
        self._kept.append(chunk)
        if self._pass is not None:
            self._follow(self._pass, chunk, begin)

    def _follow(self, sums: BodyPass, chunk: ImuRecord, begin: float) -> None:
        due = self._queue.rows[:, TIME] - self.setting.antenna.delay
        sums.add_due(due[(due > begin) & (due <= chunk.end + STAMP_ROUNDING)])
        sums.update(chunk)

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
            assert self._run is not None
            self._queue.forget(self.time - self._run.reach)
            if self._run.heading_sigma > ENOUGH:
                self._begin_anew()
            return
        if self.time >= self._next:
            self._look()
        span, count = self.time - self._kept[0].start, sum(map(len, self._kept))
        keep = self.setting.keep
        if self._run is not None and self._run.heading_sigma > KNOWN:
            # Passes about a heading that is far off leave their error in what a filter makes of it.
            keep *= _LONGER
        if span < keep and count < _MOST_SAMPLES:
            return
        if self._run is None:
            self._forget(span)
            return
        self._full = True
        self._kept = [copied(self._whole().rows(0, self._passed[0]))]
        self._kept_rows = self._queue.rows[: self._passed[1]].copy()

    def _begin_anew(self) -> None:
        """Forget an alignment whose heading has been lost, and look for one in what comes."""
        lost = self.time
        self._queue.rows = self._queue.rows[self._queue.due(lost + self._lag) :]
        self._kept, self._kept_rows = [], self._kept_rows[:0]
        self._pass, self._run, self._full = BodyPass(), None, False
        self._passed, self._next, self._lost = (0, 0), lost + 1.0, lost

    def _look(self) -> None:
        span = self.time - self._kept[0].start
        if self._run is None:
            self.trouble = self._no_heading()
            if self.trouble is not None:
                self._next = self.time + max(1.0, _WAIT * span)
                return
        self._passes(len(self._whole()), self._queue.due(self.time + self._lag))
        self._next = self.time + max(1.0, (_GROWTH - 1.0) * span)

    def _whole(self) -> ImuRecord:
        self._kept = [ImuRecord.concatenate(self._kept)]
        return self._kept[0]

    @with_one_blas_thread
    def _no_heading(self) -> str | None:
        """Return why the running sums show no heading, or None where they do."""
        rows = self._queue.rows[: self._queue.due(self.time + self._lag)]
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
        except _FAILURES as error:
            return str(error)
        if not found.heading_sigma <= ENOUGH:
            return f"{antenna.name}: {missing(found, series)}"
        return None

    def _passes(self, count: int, fixes: int) -> None:
        """Run back and forth over the first samples and fixes that are kept."""
        record, antenna = self._whole().rows(0, count), self.setting.antenna
        try:
            prepared = prepare(record, [antenna.fixes(self._queue.rows[:fixes])], self.spec, None)
            first, rough = prepared.coarse()
            found, taken = prepared.fine(rough, first, self.setting.vibration)
            run = RunningAlignment(prepared, rough, found, taken, self.spec, self._warnings)
        except _FAILURES as error:
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
        valid = self._queue.rows[:, TIME] - self.setting.antenna.delay
        self._queue.rows = self._queue.rows[valid >= start - STAMP_ROUNDING]
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
            said = self.trouble or "too few samples and fixes came to align"
            if np.isfinite(self._lost):
                said += (
                    f"; at t = {time_text(self._lost)} s the heading had been lost: its sigma was "
                    f"beyond {ENOUGH / DEG:.0f} deg"
                )
            raise InputError(said)
        return self._run.solution()

    # -- saving ------------------------------------------------------------------------

    def arrays(self) -> dict[str, Array]:
        """Return all that a later stream, made alike, needs to resume."""
        out = {
            **table_of("kept", self._kept), **table_of("waiting", self._waiting),
            "fixes": self._queue.rows, "kept_fixes": self._kept_rows,
            "stream": np.array([
                self._next, *self._passed, self._full, self.samples, self._run is not None,
                -np.inf if self._second is None else self._second, self._lost,
                *(self.counts[name] for name in COUNTS),
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
        if s is None or s.shape != (8 + len(COUNTS),) or np.any(np.isnan(s)):
            raise damaged
        for key in ("fixes", "kept_fixes"):
            check_table(key, arrays.get(key), COLUMNS)
        passed = int(s[1]), int(s[2])
        full, running = bool(s[3]), bool(s[5])
        rows = arrays["kept_fixes"] if full else arrays["fixes"]
        if not 0 <= passed[0] <= len(arrays.get("kept", ())) or not 0 <= passed[1] <= len(rows):
            raise damaged
        self._kept = records_of("kept", arrays, name)
        self._queue.rows = rows.copy()
        self._pass, self._run = BodyPass(), None
        if running:
            self._passes(*passed)
            if self._run is None:
                raise damaged
            self._run.restore(arrays)
        elif self._kept:
            self._follow(self._pass, self._kept[0], self._kept[0].start - STAMP_ROUNDING)
        self._queue.rows, self._kept_rows = arrays["fixes"].copy(), arrays["kept_fixes"].copy()
        self._waiting = records_of("waiting", arrays, name)
        self._next, self._passed, self._full = float(s[0]), passed, full
        self.samples = int(s[4])
        self._second = None if np.isinf(s[6]) else float(s[6])
        self._lost = float(s[7])
        self._queue.counts = Counter(
            {key: int(n) for key, n in zip(COUNTS, s[8:], strict=True) if n > 0.0}
        )
