"""`Intake`: rows in SI and body axes become checked increments, chunk by chunk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.kernels.states import IntakeRow, IntakeState, SpikeRow
from schuler.record.imu import ImuRecord
from schuler.record.quality import CHANNELS, Quality
from schuler.record.spikes import WARM_UP, Spike, allowed, check_count
from schuler.units import time_text

__all__ = ["KINDS", "Intake"]

Array = NDArray[np.float64]

#: what a row's values are
KINDS = ("rates", "mean-rates", "increments")

_FILLED = 8
"""Rows of one gap that are filled one by one, as `schuler.kernels.gaps.SHORT`."""


class Intake:
    """Turn rows of time and six values into `ImuRecord` chunks, checking each row.

    Rows with a value that is not finite are dropped and counted, exact repetitions likewise; a
    single bad sample is replaced and named; gaps are filled by interpolation (up to eight rows) or
    by the mean of as many rows on each side; backward time, a time given twice with different
    values, long gaps and more than a few bad samples are errors. Any chunking gives bit-identical
    results. Samples come some rows later than they were pushed, the first after 256 rows.

    Parameters
    ----------
    kind : {"rates", "mean-rates", "increments"}
        Instantaneous rates at the row's time; rates averaged over the interval that ends at
        the row's time; or increments over that interval.
    rate : float, optional
        Nominal rate, Hz; found from the first rows when not given.
    max_gap : float, optional
        Longest interval that is bridged, s; six and a half nominal intervals when not given.
    keep_spikes : bool
        Take single bad samples as they are.
    coning_corrected, sculling_corrected : bool
        See `ImuRecord`.
    name : str
        Name of the record.

    Raises
    ------
    InputError
        From the constructor for a bad option; from `push` and `close` for bad rows, naming
        the data row (counted from 1) and its time.

    Examples
    --------
    >>> intake = Intake("increments", rate=20.0)
    >>> chunk = intake.push(record.time, np.hstack([record.dtheta, record.dvel]))
    >>> rest = intake.close()
    >>> len(chunk) + len(rest)
    1200
    """

    def __init__(
        self,
        kind: str,
        *,
        rate: float | None = None,
        max_gap: float | None = None,
        keep_spikes: bool = False,
        coning_corrected: bool = False,
        sculling_corrected: bool = False,
        name: str = "record",
    ) -> None:
        from schuler.kernels import gaps, spikes
        from schuler.kernels import intake as k

        if kind not in KINDS:
            raise InputError(f"kind must be one of {', '.join(KINDS)}, got '{kind}'")
        if rate is not None and not (np.isfinite(rate) and rate > 0):
            raise InputError(f"the rate must be a positive number of Hz, got {rate}")
        if max_gap is not None and not (np.isfinite(max_gap) and max_gap > 0):
            raise InputError(f"the longest gap must be a positive time, got {max_gap}")
        self._k, self._spikes_k = k, spikes
        self._code = KINDS.index(kind)
        self.kind = kind
        self._nominal = None if rate is None else 1.0 / rate
        self._max_gap = max_gap
        self._flags = {
            "coning_corrected": coning_corrected,
            "sculling_corrected": sculling_corrected,
            "name": name,
        }
        self._keep_spikes = keep_spikes
        self._state = IntakeState.zeros()
        self._waiting: list[tuple[Array, Array, Array | None]] = []
        self._waiting_rows = 0
        self._opened = self._closed = False
        # Rows that are checked: those before `_screened` have been looked at for spikes, those
        # before `_done` are integrated and kept as neighbours of others.
        self._rows = np.empty((0, k.ROW))
        self._screened = self._done = 0
        self._settings = np.zeros((6, spikes.SETTING))
        self._history = np.zeros((gaps.HISTORY, 6))
        self._gap_work = gaps.WORK
        self._found = np.empty((0, SpikeRow.size))

    def skip(self, rows: int) -> None:
        """Count rows that are left out, so that later ones keep their number; before any `push`."""
        self._state.rows += rows

    def push(self, time: Array, values: Array, dt: Array | None = None) -> ImuRecord:
        """Take rows and return the samples that they complete (possibly none).

        Parameters
        ----------
        time : (n,) float64
            s.
        values : (n, 6) float64
            Gyro then accelerometer, SI, body axes (RFU).
        dt : (n,) float64, optional
            Interval lengths, s, where they are known exactly, as in a record that was saved; only
            for increments, and then with every push. They are kept as they are, and so are the
            increments: a gap that was bridged before the record was saved stays bridged.
        """
        time = np.ascontiguousarray(time, np.float64)
        values = np.ascontiguousarray(values, np.float64)
        if values.shape != (len(time), 6):
            raise InputError(
                f"expected {len(time)} rows of 6 values, got an array of shape {values.shape}"
            )
        if dt is not None:
            dt = np.ascontiguousarray(dt, np.float64)
            self._check_steps(time, dt)
        if not self._opened:
            self._waiting.append((time, values, dt))
            self._waiting_rows += len(time)
            if self._waiting_rows < WARM_UP:
                return self._empty()
            time, values, dt = self._open()
        return self._run(time, values, dt)

    def close(self) -> ImuRecord:
        """Return what is still waiting; call once, at the end of the input."""
        self._closed = True
        if self._opened:
            return self._run(np.empty(0), np.empty((0, 6)), None)
        return self._run(*self._open())

    def quality(self) -> Quality:
        """Return what has been found so far."""
        spikes = tuple(Spike.from_row(row, self.kind) for row in self._found)
        return Quality.from_state(self._state, self._nominal or 0.0, self.kind, spikes)

    def arrays(self) -> dict[str, Array]:
        """Return all that a later intake needs to resume in this one's place."""
        times = [t for t, _, _ in self._waiting]
        rows = [v for _, v, _ in self._waiting]
        return {
            "intake": self._state.data.copy(),
            "intake_nominal": np.array([self._nominal or 0.0]),
            "intake_times": np.concatenate([np.empty(0), *times]),
            "intake_rows": np.concatenate([np.empty((0, 6)), *rows]),
            "intake_pending": self._rows.copy(),
            "intake_progress": np.array(
                [self._opened, self._done, self._screened, self._keep_spikes], np.float64
            ),
            "intake_settings": self._settings.copy(),
            "intake_history": self._history.copy(),
            "intake_spikes": self._found.copy(),
        }

    def restore(self, arrays: dict[str, Array]) -> None:
        """Go on in the place of the intake that gave the arrays, opened alike.

        Raises
        ------
        InputError
            If the arrays are not those of an intake, or contradict one another.
        """
        from schuler.kernels.layout import LayoutError, check_intake

        try:
            check_intake(arrays)
        except LayoutError as error:
            raise InputError(f"the saved state of an intake is damaged: {error}") from None
        self._state = IntakeState(arrays["intake"].copy())
        self._nominal = float(arrays["intake_nominal"][0]) or None
        times = arrays["intake_times"]
        self._waiting = [(times, arrays["intake_rows"], None)] if len(times) else []
        self._waiting_rows = len(times)
        opened, self._done, self._screened, keep = (int(v) for v in arrays["intake_progress"])
        self._opened, self._keep_spikes = bool(opened), bool(keep)
        self._rows = arrays["intake_pending"].copy()
        self._settings = arrays["intake_settings"].copy()
        self._history = arrays["intake_history"].copy()
        self._found = arrays["intake_spikes"].copy()

    # ------------------------------------------------------------------------------

    def _check_steps(self, time: Array, dt: Array) -> None:
        if self.kind != "increments" or dt.shape != time.shape:
            raise InputError(
                f"interval lengths need increments and one for each of the {len(time)} rows, "
                f"got an array of shape {dt.shape} for {self.kind}"
            )
        bad = np.flatnonzero(~(np.isfinite(dt) & (dt > 0)))
        if len(bad):
            row = int(self._state.rows) + self._waiting_rows * (not self._opened) + bad[0] + 1
            raise InputError(
                f"data row {row} (t = {time_text(float(time[bad[0]]))} s): the interval "
                f"dt = {dt[bad[0]]:g} s must be a positive number; repair the row "
                "or leave the dt column out"
            )

    def _open(self) -> tuple[Array, Array, Array | None]:
        if not self._waiting_rows:
            raise InputError("the record is empty: no data rows were found")
        time = np.concatenate([t for t, _, _ in self._waiting])
        values = np.concatenate([v for _, v, _ in self._waiting])
        exact = [s for _, _, s in self._waiting if s is not None]
        dt = np.concatenate(exact) if exact else None
        self._waiting = []
        self._opened = True
        if self._nominal is not None:
            return time, values, dt
        if dt is not None and len(dt):
            self._nominal = float(np.median(dt[:WARM_UP]))
            return time, values, dt
        steps = np.diff(time[:WARM_UP])
        steps = steps[np.isfinite(steps) & (steps > 0)]
        if len(time) < 2:
            raise InputError(
                "the record has only one data row: at least two are needed to know its rate"
            )
        if not len(steps):
            raise InputError(
                f"time does not advance in the first {min(len(time), WARM_UP)} data rows "
                f"(t = {time_text(float(time[0]))} s): is this the time column?"
            )
        self._nominal = float(np.median(steps))
        return time, values, None

    def _run(self, time: Array, values: Array, dt: Array | None) -> ImuRecord:
        nominal = self._nominal
        assert nominal is not None
        max_gap = self._max_gap if self._max_gap is not None else 6.5 * nominal
        k = self._k
        base = int(self._state.rows)
        begin = len(self._rows)
        rows = np.empty((begin + len(time), k.ROW))
        rows[:begin] = self._rows
        m, code, row = k.check(self._state.data, nominal, max_gap, time, values, rows[begin:], dt)
        self._rows = rows[: begin + m]
        if code == k.OK or m:
            # What comes before a bad row is judged first, so that chunking cannot matter.
            self._screen(base, begin == 0)
        if code == k.TOO_LARGE:
            j = int(np.argmax(np.abs(values[row])))
            at = time_text(float(time[row]))
            raise InputError(
                f"data row {base + row + 1} (t = {at} s): {CHANNELS[j]} is "
                f"{values[row, j]:.3g} in SI, more than any instrument gives; repair or remove "
                "the row, or check columns and units"
            )
        if code != k.OK:
            self._fail(code, base + row + 1, float(time[row]), max_gap)
        return self._integrate(nominal)

    def _screen(self, base: int, start: bool) -> None:
        """Look for spikes in the rows that enough follow."""
        k, n = self._spikes_k, len(self._rows)
        first = n
        if start:
            # By the rows of the warm-up alone, so that chunking cannot matter.
            first = int(np.searchsorted(IntakeRow(self._rows).number, base + WARM_UP, side="right"))
        if self._keep_spikes or (start and first < k.LEAST):
            self._keep_spikes = True
            self._screened = n
            return
        if start:
            assert self._nominal is not None
            k.set_smallest(self._settings, self._nominal, self.kind == "increments")
            k.learn(self._rows, first, self._settings, np.empty(first))
        found = np.empty((allowed(int(self._state.rows)) - len(self._found) + 1, SpikeRow.size))
        self._screened, count = k.screen(
            self._rows, n, self._screened, first, self._closed, self._settings, found,
            np.empty(k.WORK), np.zeros(6, np.int64),
        )  # fmt: skip
        if count:
            self._found = np.concatenate([self._found, found[:count]])
            check_count(self._found, self.kind)

    def _integrate(self, nominal: float) -> ImuRecord:
        """Return the samples of the rows that have been looked at."""
        rows, begin, end = self._rows, self._done, self._screened
        # Each row is a sample, and so is each that is filled in.
        size = end - begin + int(np.minimum(IntakeRow(rows).lost[begin:end], _FILLED).sum()) + 1
        out_t, out_dt = np.empty(size), np.empty(size)
        turn, push = np.empty((size, 3)), np.empty((size, 3))
        rates = self.kind == "rates"
        values = np.empty((size + 1 if rates else 1, 6))
        m, self._done = self._k.integrate(
            self._state.data, self._history, self._code, nominal, rows, begin, end, self._closed,
            np.empty(self._gap_work), out_t, out_dt, turn, push, values,
        )  # fmt: skip
        # Rows behind the next to be looked at are its neighbours.
        cut = max(min(self._done, self._screened - self._spikes_k.KEPT), 0)
        self._rows = rows[cut:].copy()
        self._done -= cut
        self._screened -= cut
        record = ImuRecord(
            out_t[:m],
            out_dt[:m],
            turn[:m],
            push[:m],
            **self._flags,  # type: ignore[arg-type]
        )
        return record.with_values(values[: m + 1]) if rates and m else record

    def _fail(self, code: int, row: int, t: float, max_gap: float) -> None:
        k = self._k
        if code == k.BAD_TIME:
            raise InputError(
                f"data row {row}: the time is not a finite number; remove the row or name the "
                "right time column"
            )
        where = f"data row {row} (t = {time_text(t)} s)"
        last = float(self._state.last_time)
        if code == k.BACKWARD:
            raise InputError(
                f"{where}: time goes backward, from {time_text(last)} s; sort the rows, or cut the "
                "record there with --stop"
            )
        if code == k.REPEATED:
            raise InputError(
                f"{where}: the time of the row before is repeated with other values; "
                "remove one of the rows, or check the time column's resolution"
            )
        if code == k.OVERLAP:
            raise InputError(
                f"{where}: its interval dt is longer than the {t - last:.6g} s since the row "
                "before; check the dt column and its unit, or leave it out"
            )
        raise InputError(
            f"{where}: a gap of {t - last:.6g} s since t = {time_text(last)} s is longer than the "
            f"{max_gap:.4g} s that can be bridged; align before or after it (--start, --stop), "
            "or allow it with --max-gap"
        )

    def _empty(self) -> ImuRecord:
        none = np.empty(0)
        return ImuRecord(
            none,
            none,
            np.empty((0, 3)),
            np.empty((0, 3)),
            **self._flags,  # type: ignore[arg-type]
        )
