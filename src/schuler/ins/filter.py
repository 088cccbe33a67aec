"""`ErrorStateFilter`: samples and measurements in, navigation with its covariance out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import nearest_quat
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins.custom import CustomMeasurement, State
from schuler.ins.dynamics import ProcessNoise
from schuler.ins.late import Chunk, LatencyWindow, Span
from schuler.ins.layout import Layout
from schuler.ins.measurement import Measurement, handled
from schuler.ins.result import EpochHistory
from schuler.ins.smoother import Epochs, Smoothed, smoothed
from schuler.kernels import ins_layout as kernel
from schuler.kernels.states import StrapdownOptions
from schuler.record import ImuRecord

__all__ = ["ErrorStateFilter"]

Array = NDArray[np.float64]

_SOURCES = {"gyro_": "gyro_bias", "accelerometer_": "accelerometer_bias", "motion": "disturbance"}
"""Source of a group's prior, by how its name begins; "start" for all others."""

_LATE = 1e-9
"""A measurement may be so much before the last sample, s: a rounding."""


def frame_quaternion(lat: float, lon: float) -> Array:
    """Return q_n^e (4,) of East-North-Up at a latitude and longitude, rad."""
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    columns = [[-so, co, 0.0], [-sl * co, -sl * so, cl], [cl * co, cl * so, sl]]
    return nearest_quat(np.array(columns).T)


class ErrorStateFilter:
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
        from schuler.kernels import strapdown
        from schuler.kernels.error_state import run

        if not 0.0 <= max_latency < np.inf:
            raise InputError(f"a latency must be a time of 0 s or more, got {max_latency} s")
        self._window = LatencyWindow(max_latency) if max_latency else None
        self._run: Callable[..., tuple[int, int, int, int]] = run
        self.layout, self.noise, self.aids = layout, noise, tuple(aids)
        n, size = layout.size, layout.padded
        p = np.asarray(covariance, np.float64)
        q, v = np.asarray(quat_nb, np.float64), np.asarray(v_n, np.float64)
        if p.shape != (n, n) or not np.all(np.isfinite(p)):
            raise InputError(f"the filter has {n} states: expected a finite ({n}, {n}) covariance")
        if q.shape != (4,) or not abs(np.linalg.norm(q) - 1.0) < 1e-6:
            raise InputError("a filter starts from a unit quaternion of four numbers")
        if v.shape != (3,) or not np.all(np.isfinite(v)):
            raise InputError("a filter starts from three finite velocities: east, north, up")
        if not step > 0.0:
            raise InputError(f"the step of the covariance must be a positive time, got {step} s")
        self._state = np.zeros(kernel.STATE_SIZE)
        self._state[kernel.QUAT_NB : kernel.QUAT_NB + 4] = q / np.linalg.norm(q)
        self._state[kernel.QUAT_START : kernel.QUAT_START + 4] = q / np.linalg.norm(q)
        self._state[kernel.V_N : kernel.V_N + 3] = v
        self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4] = frame_quaternion(
            site.latitude, site.longitude
        )
        self._state[kernel.HEIGHT] = site.height
        self._survey = np.zeros(strapdown.STATE_SIZE)
        self._est, self._x = np.zeros(size), np.zeros(size)
        self._x[:n] = error_state
        for name, value in (parameters or {}).items():
            self._est[layout[name]] = value
        self._p = np.zeros((size, size))
        self._p[:n, :n] = 0.5 * (p + p.T)
        self._parts = self._split(p) if budget else np.zeros((0, size, size))
        self._cfg = np.zeros(kernel.CFG_SIZE)
        self._cfg[kernel.FIXED_PLACE] = fixed_place
        self._cfg[kernel.EARTH : kernel.EARTH + 3] = (
            site.earth_rate if earth_rate is None else earth_rate
        )
        self._cfg[kernel.GRAVITY] = site.gravity
        self._cfg[kernel.FORCE_AT_REST] = force_at_rest
        self._cfg[kernel.VERTICAL] = not vertical
        self._cfg[kernel.STEP], self._cfg[kernel.FEEDBACK] = step, feedback
        options = StrapdownOptions.zeros()
        options.gravity_model = strapdown.SOMIGLIANA
        options.vertical_mode = strapdown.FREE if vertical else strapdown.OFF
        self._options = options.data
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
            queue.append(self._rows_of(k))
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
        place = self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4].copy()
        self._start = (self.quat_nb, self.v_n, place, site.height)

    def _split(self, p: Array) -> Array:
        """Return the covariance at the start by source."""
        layout, sources = self.layout, self.noise.sources
        owner = np.zeros(layout.padded, np.int64)
        for name in layout:
            source = next((s for begin, s in _SOURCES.items() if name.startswith(begin)), "start")
            owner[layout[name]] = sources.index(source)
        parts = np.zeros((len(sources), layout.padded, layout.padded))
        n = layout.size
        for k in range(len(sources)):
            own = owner[:n] == k
            parts[k, :n, :n] = np.where(np.outer(own, own), p, 0.0)
        if not np.allclose(parts.sum(axis=0)[:n, :n], p, rtol=1e-9, atol=0.0):
            raise InputError("a covariance between states of different sources has no budget")
        return parts

    def _rows_of(self, k: int) -> Array:
        aid = self.aids[k]
        if isinstance(aid, Measurement):
            return aid.table(k)
        time = np.asarray(aid.time, np.float64)
        out = np.zeros((len(time), kernel.M_SIZE))
        out[:, kernel.M_TIME], out[:, kernel.M_AID] = time, k
        out[:, kernel.M_KIND] = kernel.CUSTOM
        out[:, kernel.M_VALUE] = np.arange(len(time))
        return out

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
                f"{measurement.label}: a measurement at t = {first:.9g} s comes after the sample "
                f"at t = {self.time:.9g} s was taken"
            )
        self._enqueue([table])

    def _take_late(self, label: str, table: Array, first: float, window: LatencyWindow) -> None:
        """Run again from before a measurement that is late."""
        late = self.time - first
        span = window.before(first - _LATE)
        if late > window.latency + _LATE or span is None:
            raise InputError(
                f"{label}: a measurement at t = {first:.9g} s comes {late:.6g} s late, after the "
                f"sample at t = {self.time:.9g} s; the filter takes {window.latency:g} s"
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
                f"a measurement at t = {first:.9g} s is before the record, which starts at "
                f"t = {begin:.9g} s"
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
                f"a chunk starts at t = {record.time[0]:.9g} s, not after the last sample "
                f"({self.time:.9g} s)"
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
        z, h, r = (
            np.atleast_1d(np.asarray(a, np.float64))
            for a in aid.rows(self._view(int(self._queue[j, kernel.M_VALUE])))
        )
        h = np.atleast_2d(h)
        count, n = len(z), self.layout.size
        if h.shape != (count, n) or r.shape != (count,) or not 0 < count <= kernel.MOST_ROWS:
            raise InputError(
                f"{aid.name}: rows must give up to {kernel.MOST_ROWS} numbers, as many rows of "
                f"{n} columns and as many variances, got shapes {z.shape}, {h.shape} and {r.shape}"
            )
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(h)) and np.all(r > 0.0)):
            raise InputError(f"{aid.name}: rows must be finite, and variances positive")
        self._scratch[H_ROWS : H_ROWS + count] = 0.0
        self._scratch[H_ROWS : H_ROWS + count, :n] = h
        self._scratch[Z_ROW, :count], self._scratch[R_ROW, :count] = z, r
        outcomes[j, kernel.D_WEIGHT] = take_rows(
            self._state, self._x, self._p, self._parts, self.layout.at, self._aids[k],
            self._aid_state[k], self._scratch, count, outcomes[j : j + 1],
        )  # fmt: skip

    def _view(self, index: int) -> State:
        from schuler.attitude import quat_to_matrix

        s = self._state
        frame = quat_to_matrix(s[kernel.QUAT_NE : kernel.QUAT_NE + 4])
        up = frame[:, 2]
        lat, lon = np.arctan2(up[2], np.hypot(up[0], up[1])), np.arctan2(up[1], up[0])
        x, y, _ = frame.T @ [-np.sin(lon), np.cos(lon), 0.0]
        return State(
            self.time, self.quat_nb, self.v_n, s[kernel.RATE_B : kernel.RATE_B + 3].copy(),
            float(lat), float(lon), float(s[kernel.HEIGHT]), float(np.arctan2(y, x)),
            {name: self.parameter(name) for name in self._parameters()}, self.layout, index,
        )  # fmt: skip

    def _parameters(self) -> list[str]:
        return [name for name in self.layout if name not in ("phi", "velocity", "position")]

    # -- results -----------------------------------------------------------------------

    @property
    def feedback(self) -> bool:
        """Whether the navigation is corrected after each epoch; may be changed between chunks."""
        return bool(self._cfg[kernel.FEEDBACK])

    @feedback.setter
    def feedback(self, on: bool) -> None:
        self._cfg[kernel.FEEDBACK] = on

    @property
    def frame(self) -> Array:
        """Position as the quaternion from n to the Earth's axes, (4,), without the known error."""
        return self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4].copy()

    @property
    def height(self) -> float:
        """Height, m, without the known error."""
        return float(self._state[kernel.HEIGHT])

    @property
    def smooths(self) -> bool:
        """Whether it keeps what `smoothed` needs."""
        return bool(len(self._chain))

    @property
    def samples(self) -> int:
        """Samples taken so far."""
        return int(self._state[kernel.SAMPLES])

    @property
    def time(self) -> float:
        """Time of the last sample, s."""
        return float(self._state[kernel.TIME])

    @property
    def quat_nb(self) -> Array:
        """Attitude now, without the error that is known, (4,)."""
        from schuler.attitude import multiply, rotvec_to_quat

        q = self._state[kernel.QUAT_NB : kernel.QUAT_NB + 4]
        return np.asarray(multiply(rotvec_to_quat(self._x[:3]), q))

    @property
    def v_n(self) -> Array:
        """Velocity now, m/s, (3,)."""
        return self._state[kernel.V_N : kernel.V_N + 3] - self._x[self.layout["velocity"]]

    @property
    def error_state(self) -> Array:
        """Error estimates that were not fed back, (n,)."""
        return self._x[: self.layout.size].copy()

    @property
    def covariance(self) -> Array:
        """Of the error states, (n, n)."""
        return self._p[: self.layout.size, : self.layout.size].copy()

    def parameter(self, group: str) -> Array:
        """Return the estimate of a group of parameters now."""
        place = self.layout[group]
        sign = np.where(self.layout.sign[place] < 0.0, -1.0, 1.0)
        return np.asarray(self._est[place] + sign * self._x[place])

    @property
    def budget(self) -> dict[str, Array]:
        """Covariance of the error states by source, (n, n) each; empty without a budget."""
        n = self.layout.size
        return {
            name: part[:n, :n].copy()
            for name, part in zip(self.noise.sources, self._parts, strict=False)
        }

    @property
    def refused(self) -> int:
        """Scalar measurements that a gate or a robust rule refused."""
        return int(self._state[kernel.REFUSED])

    @property
    def weighed(self) -> int:
        """Scalar measurements that a robust rule weighed down."""
        return int(self._state[kernel.WEIGHED])

    @property
    def resets(self) -> int:
        """Times that the covariance was widened because measurements were refused for long."""
        return int(self._state[kernel.RESETS])

    def history(self) -> EpochHistory:
        """Return what was estimated after each epoch."""
        columns = kernel.O_SIZE + 2 * self.layout.padded
        return EpochHistory(self.layout, np.concatenate([np.zeros((0, columns)), *self._history]))

    def innovations(self, aid: str) -> tuple[Array, Array, Array, Array]:
        """Return times (k,), innovations and their sigma (k, 3), and least weights (k,) of an aid.

        A weight of 0 is a measurement that was refused.
        """
        names = [a.label if isinstance(a, Measurement) else a.name for a in self.aids]
        width = kernel.M_SIZE + kernel.D_SIZE
        rows = np.concatenate([np.zeros((0, width)), *self._innovations])
        rows = rows[rows[:, kernel.M_AID] == names.index(aid)]
        first = kernel.M_SIZE
        return (
            rows[:, kernel.M_TIME], rows[:, first + kernel.D_INNOVATION :][:, :3],
            rows[:, first + kernel.D_SIGMA :][:, :3], rows[:, first + kernel.D_WEIGHT],
        )  # fmt: skip

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

    @property
    def settings(self) -> tuple[Array, Array]:
        """Settings of the navigation as its kernels take them: cfg and those of the strapdown."""
        return self._cfg.copy(), self._options.copy()

    @property
    def start(self) -> tuple[Array, Array, Array, float]:
        """Attitude, velocity, q_n^e and height at the start."""
        return self._start

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
