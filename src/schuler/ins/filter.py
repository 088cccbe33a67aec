"""`ErrorStateFilter`: samples and measurements in, navigation with its covariance out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.constants import STAMP_ROUNDING
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins.custom import CustomMeasurement, custom_rows, custom_table
from schuler.ins.dynamics import ProcessNoise
from schuler.ins.filter_state import FilterState
from schuler.ins.late import Chunk, LatencyWindow, Span
from schuler.ins.layout import Layout
from schuler.ins.measurement import Measurement, handled
from schuler.ins.result import EpochHistory
from schuler.ins.smoother import Epochs, Smoothed, smoothed
from schuler.kernels import ins_layout as kernel
from schuler.record import ImuRecord
from schuler.units import time_text

__all__ = ["ErrorStateFilter"]

Array = NDArray[np.float64]

_LATE = STAMP_ROUNDING
"""A measurement may be so much before the last sample, s: a rounding."""


class ErrorStateFilter(FilterState):
    """An inertial navigation whose errors a Kalman filter estimates; resumable.

    Any chunking of the samples gives the same bits. With a fixed place the vehicle is stationary:
    latitude and height stay, and a position state is the displacement since the start.

    Parameters
    ----------
    layout : Layout
        The error states; groups of aids must be in it.
    site : Site
        Where it starts.
    quat_nb : (4,) array_like
        Attitude at the start.
    covariance : (n, n) array_like
        Of the error states at the start.
    noise : ProcessNoise
    aids : sequence of Measurement or CustomMeasurement
        What is measured; those of one instant are taken in this order.
    v_n : (3,) array_like
        Velocity at the start, east, north, up, m/s.
    error_state : (n,) array_like
        Error estimates at the start, where the navigation does not start from the prior's mean.
    parameters : dict of str to array_like, optional
        Estimates of other groups at the start; zero by default.
    fixed_place : bool
    earth_rate : (3,) array_like, optional
        Earth rate at a fixed place, rad/s; that of the site by default.
    feedback : bool
        Correct the navigation after each epoch.
    budget : bool
        Carry the covariance by source as well.
    smooth : bool
        Keep what `smoothed` needs: memory grows by the epochs.
    keep_history : bool
        Keep the output of each epoch.
    step : float
        Longest time between two predictions of the covariance, s.
    force_at_rest : bool
        Let gravity alone couple tilt and velocity, for a vehicle that shakes and is stationary.
    vertical : bool
        False for a filter without a vertical channel.
    max_latency : float
        Seconds by which a measurement that is added may be late: states, samples and measurements
        of that time are kept (`latency_bytes`), and the filter runs again from before it. The
        result is that of the measurement in time, to the bit.

    Raises
    ------
    InputError
        For arrays of another shape, or numbers that are not finite.

    Examples
    --------
    >>> from schuler.ins import Layout, ProcessNoise, Velocity
    >>> layout = Layout(["phi", "velocity"])
    >>> rest, start = Velocity([1.0, 2.0], [0.0, 0.0, 0.0], 0.01), made.truth.quat_nb[0]
    >>> noise = ProcessNoise.of(layout, {})
    >>> flt = ErrorStateFilter(layout, site, start, 1e-4 * np.eye(6), noise, [rest])
    >>> bool(np.abs(flt.update(record.between(None, 2.5)).v_n).max() < 0.02)
    True
    """

    def __init__(
        self,
        layout: Layout,
        site: Site,
        quat_nb: ArrayLike,
        covariance: ArrayLike,
        noise: ProcessNoise,
        aids: Sequence[Measurement | CustomMeasurement] = (),
        *,
        v_n: ArrayLike = (0.0, 0.0, 0.0),
        error_state: ArrayLike = 0.0,
        parameters: Mapping[str, ArrayLike] | None = None,
        fixed_place: bool = False,
        earth_rate: ArrayLike | None = None,
        feedback: bool = True,
        budget: bool = False,
        smooth: bool = False,
        keep_history: bool = True,
        step: float = 0.1,
        force_at_rest: bool = False,
        vertical: bool = True,
        max_latency: float = 0.0,
    ) -> None:
        from schuler.kernels.error_state import run

        super().__init__(
            layout, site, quat_nb, covariance, noise, v_n=v_n, error_state=error_state,
            parameters=parameters or {}, fixed_place=fixed_place, earth_rate=earth_rate,
            feedback=feedback, budget=budget, step=step, force_at_rest=force_at_rest,
            vertical=vertical,
        )  # fmt: skip
        if not 0.0 <= max_latency < np.inf:
            raise InputError(f"a latency must be a time of 0 s or more, got {max_latency} s")
        self._window = LatencyWindow(max_latency) if max_latency else None
        self._run: Callable[..., tuple[int, int, int, int]] = run
        self.aids, size = tuple(aids), layout.padded
        self._aids = np.zeros((max(len(self.aids), 1), kernel.A_SIZE))
        self._aid_state = np.zeros((len(self._aids), kernel.S_SIZE))
        # Nothing was taken yet, so nothing is late.
        self._aid_state[:, kernel.S_LAST] = np.nan
        queue = []
        for k, aid in enumerate(self.aids):
            if isinstance(aid, Measurement):
                self._aids[k] = aid.parameters(layout, noise.sources)
                missing = [name for name, _ in aid.groups if name not in layout]
                if missing:
                    raise InputError(f"{aid.label}: the layout has no group '{missing[0]}'")
            else:
                self._aids[k] = handled(aid.handling, noise.sources)
            queue.append(aid.table(k) if isinstance(aid, Measurement) else custom_table(aid, k))
        self._queue = np.zeros((0, kernel.M_SIZE))
        self._enqueue(queue)
        self._transition, self._decay = np.zeros((9, size)), np.ones(size)
        self._columns = np.zeros((3, size + 1), np.int64)
        self._chain = np.eye(size) if smooth else np.zeros((0, 0))
        self._scratch, self._flipped = np.zeros((40, size)), np.zeros((size + 9, 12))
        self._keep_history = keep_history
        self._history: list[Array] = []
        self._innovations: list[Array] = []
        self._kept_x: list[Array] = []
        self._kept_p: list[Array] = []
        if smooth:
            # The start is an epoch without measurements.
            self._kept_x.append(np.stack([self._x, self._x, np.zeros(size)])[None])
            self._kept_p.append(np.stack([self._p, self._p, np.eye(size)])[None])

    def _enqueue(self, tables: Sequence[Array]) -> None:
        rows = np.concatenate([self._queue, *tables])
        # Those of one instant by their aid, in whichever order they have come.
        self._queue = rows[np.lexsort((rows[:, kernel.M_AID], rows[:, kernel.M_TIME]))]

    # -- feeding -----------------------------------------------------------------------

    def add(self, measurement: Measurement) -> None:
        """Add measurements of an aid that the filter was made with, by its name.

        Raises
        ------
        InputError
            For an aid that is not known, or measurements before the last sample by more than the
            latency.
        """
        names = [aid.label for aid in self.aids if isinstance(aid, Measurement)]
        if measurement.label not in names:
            raise InputError(f"the filter has no aid '{measurement.label}'")
        table = measurement.table(names.index(measurement.label))
        first = float(table[0, kernel.M_TIME]) if len(table) else np.inf
        if self._window is not None and self.samples and first <= self.time + _LATE:
            self._take_late(measurement.label, table, first, self._window)
            return
        if self.samples and first < self.time - _LATE:
            raise InputError(
                f"{measurement.label}: a measurement at t = {time_text(first)} s comes after the "
                "sample "
                f"at t = {time_text(self.time)} s was taken"
            )
        self._enqueue([table])

    def _take_late(self, label: str, table: Array, first: float, window: LatencyWindow) -> None:
        """Run again from before a measurement that is late."""
        late = self.time - first
        span = window.before(first - _LATE)
        if late > window.latency + _LATE or span is None:
            raise InputError(
                f"{label}: a measurement at t = {time_text(first)} s comes {late:.6g} s late, "
                "after the "
                f"sample at t = {time_text(self.time)} s; the filter takes {window.latency:g} s"
            )
        if span.chunks and not np.isfinite(span.time):
            record = span.chunks[0].record
            self._check_begin(first, float(record.time[0] - record.dt[0]))
        chunks, taken = window.cut(span)
        for name, array in span.arrays.items():
            setattr(self, f"_{name}", array.copy())
        for kept, count in zip(self._outputs, span.counts, strict=True):
            del kept[count:]
        self._enqueue([*taken, table])
        for chunk in chunks:
            self._keep_and_advance(chunk, window)

    def _check_begin(self, first: float, begin: float) -> None:
        if first < begin - _LATE:
            raise InputError(
                f"a measurement at t = {time_text(first)} s is before the record, which starts at "
                f"t = {time_text(begin)} s"
            )

    def _keep_and_advance(self, chunk: Chunk, window: LatencyWindow) -> None:
        """Take a chunk, and keep what it takes to do it again."""
        now = self.time if self.samples else -np.inf
        if window.wants_span(now):
            arrays = {name: each for name, each in self.arrays().items() if name != "queue"}
            window.begin(Span(now, arrays, tuple(map(len, self._outputs))))
        before = self._queue
        self._advance(chunk.record, chunk.inside)
        window.keep(chunk, before[: len(before) - len(self._queue)].copy())

    @property
    def _outputs(self) -> tuple[list[Array], ...]:
        return self._history, self._innovations, self._kept_x, self._kept_p

    @property
    def latency_bytes(self) -> int:
        """Memory that is kept for measurements that are late: it does not grow with the record."""
        return 0 if self._window is None else self._window.bytes

    def update(self, record: ImuRecord, inside: Array | None = None) -> ErrorStateFilter:
        """Take a chunk of samples and the measurements up to its end; return self.

        Parameters
        ----------
        record : ImuRecord
            Follows the last chunk.
        inside : (n, 7) float64, optional
            At a fixed place: samples are intervals, and each row holds the mean rotation from the
            body to the axes of the interval's start (quaternion) and the displacement there that
            the force makes. Measurements fall on their ends.

        Raises
        ------
        InputError
            If the chunk does not follow, or has not three gyros and three accelerometers.
        """
        if record.dtheta.shape[1:] != (3,) or record.dvel.shape[1:] != (3,):
            raise InputError("a filter needs three gyros and three accelerometers")
        if not len(record):
            return self
        if self.samples and record.time[0] <= self.time:
            raise InputError(
                f"a chunk starts at t = {time_text(record.time[0])} s, not after the last sample "
                f"({time_text(self.time)} s)"
            )
        if inside is not None and not self._cfg[kernel.FIXED_PLACE]:
            raise InputError("intervals are for a fixed place")
        begin = float(record.time[0] - record.dt[0])
        if not self.samples and len(self._queue):
            self._check_begin(float(self._queue[0, kernel.M_TIME]), begin)
        if self._window is None:
            self._advance(record, inside)
        else:
            for piece in self._window.pieces(Chunk(record, inside)):
                self._keep_and_advance(piece, self._window)
        return self

    def _advance(self, record: ImuRecord, inside: Array | None) -> None:
        """Take samples and the measurements up to their end."""
        self._cfg[kernel.CONING] = not record.coning_corrected
        self._cfg[kernel.SCULLING] = not record.sculling_corrected
        due = self._queue[:, kernel.M_TIME]
        count = len(np.unique(due[due <= record.time[-1] + _LATE]))
        size = self.layout.padded
        kept = count if len(self._chain) else 0
        out = np.zeros((count if self._keep_history else 0, kernel.O_SIZE + 2 * size))
        keep_x, keep_p = np.zeros((kept, 3, size)), np.zeros((kept, 3, size, size))
        outcomes = np.zeros((len(self._queue), kernel.D_SIZE))
        i = j = done = 0
        while True:
            i, j, rows, why = self._run(
                self._state, self._survey, self._est, self._x, self._p, self._parts,
                self.layout.at, self._cfg, self._options, self.noise.walk, self.noise.bound,
                self.noise.fade, self.noise.source, self.layout.sign, self._aids, self._aid_state,
                self._transition, self._decay, self._columns, self._chain, self._scratch,
                self._flipped, record.time, record.dt, record.dtheta, record.dvel,
                np.zeros((0, 7)) if inside is None else inside, self._queue, i, j, out[done:],
                keep_x[done:], keep_p[done:], outcomes,
            )  # fmt: skip
            done += rows
            if why != kernel.AT_CUSTOM:
                break
            self._take_custom(j, outcomes)
            j += 1
        if self._keep_history:
            self._history.append(out[:done])
            self._innovations.append(np.column_stack([self._queue[:j], outcomes[:j]]))
        if kept:
            self._kept_x.append(keep_x[:done])
            self._kept_p.append(keep_p[:done])
        self._queue = self._queue[j:]

    def _take_custom(self, j: int, outcomes: Array) -> None:
        from schuler.kernels.measurement_updates import H_ROWS, R_ROW, Z_ROW, take_rows

        k = int(self._queue[j, kernel.M_AID])
        aid = self.aids[k]
        assert not isinstance(aid, Measurement)
        z, h, r = custom_rows(aid, self._view(int(self._queue[j, kernel.M_VALUE])))
        count, n = h.shape
        self._scratch[H_ROWS : H_ROWS + count] = 0.0
        self._scratch[H_ROWS : H_ROWS + count, :n] = h
        self._scratch[Z_ROW, :count], self._scratch[R_ROW, :count] = z, r
        outcomes[j, kernel.D_WEIGHT] = take_rows(
            self._state, self._x, self._p, self._parts, self.layout.at, self._aids[k],
            self._aid_state[k], self._scratch, count, outcomes[j : j + 1],
        )  # fmt: skip

    # -- results -----------------------------------------------------------------------

    @property
    def smooths(self) -> bool:
        """Whether it keeps what `smoothed` needs."""
        return bool(len(self._chain))

    def history(self) -> EpochHistory:
        """Return what was estimated after each epoch."""
        columns = kernel.O_SIZE + 2 * self.layout.padded
        return EpochHistory(self.layout, np.concatenate([np.zeros((0, columns)), *self._history]))

    def innovations(self, aid: str) -> tuple[Array, Array, Array, Array]:
        """Return times (k,), innovations and their sigma (k, 3), and least weights (k,) of an aid.

        A weight of 0 is a measurement that was refused.
        """
        names = [a.label if isinstance(a, Measurement) else a.name for a in self.aids]
        rows = np.concatenate([np.zeros((0, kernel.M_SIZE + kernel.D_SIZE)), *self._innovations])
        rows = rows[rows[:, kernel.M_AID] == names.index(aid)]
        first = kernel.M_SIZE
        return (
            rows[:, kernel.M_TIME], rows[:, first + kernel.D_INNOVATION :][:, :3],
            rows[:, first + kernel.D_SIGMA :][:, :3], rows[:, first + kernel.D_WEIGHT],
        )  # fmt: skip

    def forget_outputs(self) -> None:
        """Forget what was estimated and measured at all epochs so far: memory stays constant."""
        for kept in self._outputs[:2]:
            kept.clear()

    def smoothed(self) -> Smoothed:
        """Return the fixed-interval smoother's estimates at the start and at all epochs.

        Raises
        ------
        InputError
            If the filter was not made with ``smooth=True``.
        """
        if not len(self._chain):
            raise InputError("make the filter with smooth=True for a smoother")
        x, p = np.concatenate(self._kept_x), np.concatenate(self._kept_p)
        return smoothed(self.layout, Epochs(x, p), self.history(), self._start[:2])

    # -- saving ------------------------------------------------------------------------

    _SAVED = (
        "state", "survey", "est", "x", "p", "parts", "aid_state", "queue", "chain", "transition",
    )  # fmt: skip

    def arrays(self) -> dict[str, Array]:
        """Return all that a later filter, made alike, needs to resume; history is not in it."""
        return {name: getattr(self, f"_{name}").copy() for name in self._SAVED}

    def restore(self, arrays: Mapping[str, Array]) -> None:
        """Resume from the arrays of a filter that was made alike.

        Raises
        ------
        InputError
            If an array is missing, of another shape, or not finite where it must be.
        """
        for name in self._SAVED:
            mine, other = getattr(self, f"_{name}"), arrays.get(name)
            free = name == "queue"
            if (
                other is None
                or other.dtype != np.float64
                or other.shape[free:] != mine.shape[free:]
                or not (name == "aid_state" or np.all(np.isfinite(other)))
            ):
                raise InputError(f"the saved state of a filter is damaged: array '{name}'")
        aids = arrays["queue"][:, kernel.M_AID]
        if np.any((aids < 0) | (aids >= len(self._aids)) | (aids != np.floor(aids))):
            raise InputError("the saved state of a filter is damaged: array 'queue'")
        for name in self._SAVED:
            setattr(self, f"_{name}", arrays[name].copy())
        if self._window is not None:
            self._window.clear()
