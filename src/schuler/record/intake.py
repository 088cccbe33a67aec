"""`Intake`: rows in SI and body axes become checked increments, chunk by chunk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.record.imu import ImuRecord
from schuler.record.quality import CHANNELS, Quality
from schuler.units import time_text

__all__ = ["KINDS", "Intake"]

Array = NDArray[np.float64]

#: what a row's values are
KINDS = ("rates", "mean-rates", "increments")

#: rows that are looked at to find the nominal interval; fixed, so that chunking cannot matter
_WARM_UP = 256


class Intake:
    """Turn rows of time and six values into `ImuRecord` chunks, checking each row.

    Rows with a value that is not finite are dropped and counted, exact repetitions likewise;
    short gaps are bridged by holding the rate; backward time, a time given twice with
    different values, and long gaps are errors. Any chunking gives bit-identical results.

    Parameters
    ----------
    kind : {"rates", "mean-rates", "increments"}
        Instantaneous rates at the row's time; rates averaged over the interval that ends at
        the row's time; or increments over that interval.
    rate : float, optional
        Nominal rate, Hz; found from the first rows when not given.
    max_gap : float, optional
        Longest interval that is bridged, s; six and a half nominal intervals when not given.
    coning_corrected, sculling_corrected : bool
        See `ImuRecord`.
    name : str
        Name of the record.

    Raises
    ------
    InputError
        From the constructor for a bad option; from `push` and `close` for bad rows, naming
        the data row (counted from 1) and its time.
    """

    def __init__(
        self,
        kind: str,
        *,
        rate: float | None = None,
        max_gap: float | None = None,
        coning_corrected: bool = False,
        sculling_corrected: bool = False,
        name: str = "record",
    ) -> None:
        from schuler.kernels import intake as k

        if kind not in KINDS:
            raise InputError(f"kind must be one of {', '.join(KINDS)}, got '{kind}'")
        if rate is not None and not (np.isfinite(rate) and rate > 0):
            raise InputError(f"the rate must be a positive number of Hz, got {rate}")
        if max_gap is not None and not (np.isfinite(max_gap) and max_gap > 0):
            raise InputError(f"the longest gap must be a positive time, got {max_gap}")
        self._k = k
        self._code = KINDS.index(kind)
        self.kind = kind
        self._nominal = None if rate is None else 1.0 / rate
        self._max_gap = max_gap
        self._flags = {
            "coning_corrected": coning_corrected,
            "sculling_corrected": sculling_corrected,
            "name": name,
        }
        self._state = np.zeros(k.STATE_SIZE)
        self._waiting: list[tuple[Array, Array, Array | None]] = []
        self._waiting_rows = 0

    def skip(self, rows: int) -> None:
        """Count rows that are left out, so that later ones keep their number; before any `push`."""
        self._state[0] += rows

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
        if self._nominal is None:
            self._waiting.append((time, values, dt))
            self._waiting_rows += len(time)
            if self._waiting_rows < _WARM_UP:
                return self._empty()
            time, values, dt = self._open()
        return self._run(time, values, dt)

    def close(self) -> ImuRecord:
        """Return what is still waiting; call once, at the end of the input."""
        if self._nominal is not None:
            return self._empty()
        return self._run(*self._open())

    def quality(self) -> Quality:
        """Return what has been found so far."""
        return Quality.from_state(self._state, self._nominal or 0.0, self.kind)

    def arrays(self) -> dict[str, Array]:
        """Return all that a later intake needs to go on in this one's place."""
        times = [t for t, _, _ in self._waiting]
        rows = [v for _, v, _ in self._waiting]
        return {
            "intake": self._state.copy(),
            "intake_nominal": np.array([self._nominal or 0.0]),
            "intake_times": np.concatenate([np.empty(0), *times]),
            "intake_rows": np.concatenate([np.empty((0, 6)), *rows]),
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
        self._state = arrays["intake"].copy()
        self._nominal = float(arrays["intake_nominal"][0]) or None
        times = arrays["intake_times"]
        self._waiting = [(times, arrays["intake_rows"], None)] if len(times) else []
        self._waiting_rows = len(times)

    # ------------------------------------------------------------------------------

    def _check_steps(self, time: Array, dt: Array) -> None:
        if self.kind != "increments" or dt.shape != time.shape:
            raise InputError(
                f"interval lengths need increments and one for each of the {len(time)} rows, "
                f"got an array of shape {dt.shape} for {self.kind}"
            )
        bad = np.flatnonzero(~(np.isfinite(dt) & (dt > 0)))
        if len(bad):
            row = int(self._state[0]) + self._waiting_rows * (self._nominal is None) + bad[0] + 1
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
        if dt is not None and len(dt):
            self._nominal = float(np.median(dt[:_WARM_UP]))
            return time, values, dt
        steps = np.diff(time[:_WARM_UP])
        steps = steps[np.isfinite(steps) & (steps > 0)]
        if len(time) < 2:
            raise InputError(
                "the record has only one data row: at least two are needed to know its rate"
            )
        if not len(steps):
            raise InputError(
                f"time does not advance in the first {min(len(time), _WARM_UP)} data rows "
                f"(t = {time_text(float(time[0]))} s): is this the time column?"
            )
        self._nominal = float(np.median(steps))
        return time, values, None

    def _run(self, time: Array, values: Array, dt: Array | None) -> ImuRecord:
        n = len(time)
        nominal = self._nominal
        assert nominal is not None
        max_gap = self._max_gap if self._max_gap is not None else 6.5 * nominal
        out_t, out_dt, out = np.empty(n), np.empty(n), np.empty((n, 6))
        base = int(self._state[0])
        m, code, row = self._k.intake(
            self._state, self._code, nominal, max_gap, time, values, out_t, out_dt, out, dt
        )
        if code == self._k.TOO_LARGE:
            j = int(np.argmax(np.abs(values[row])))
            at = time_text(float(time[row]))
            raise InputError(
                f"data row {base + row + 1} (t = {at} s): {CHANNELS[j]} is "
                f"{values[row, j]:.3g} in SI, more than any instrument gives; repair or remove "
                "the row, or check columns and units"
            )
        if code != self._k.OK:
            self._fail(code, base + row + 1, float(time[row]), max_gap)
        return ImuRecord(
            out_t[:m],
            out_dt[:m],
            out[:m, :3],
            out[:m, 3:],
            **self._flags,  # type: ignore[arg-type]
        )

    def _fail(self, code: int, row: int, t: float, max_gap: float) -> None:
        k = self._k
        if code == k.BAD_TIME:
            raise InputError(
                f"data row {row}: the time is not a finite number; remove the row or name the "
                "right time column"
            )
        where = f"data row {row} (t = {time_text(t)} s)"
        last = float(self._state[3])
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
