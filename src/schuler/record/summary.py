"""`Summary`: what a record looks like, in numbers and in words; made in one streaming pass."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from schuler._notebook import Shown
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G, STANDARD_GRAVITY
from schuler.earth import Site
from schuler.errors import InputError
from schuler.kernels.states import StretchSums, SummaryState
from schuler.record.check import Reading, check_record
from schuler.record.imu import ImuRecord

__all__ = ["Stretch", "Summariser", "Summary"]

Array = NDArray[np.float64]

_STRETCH = 30.0
"""Quiet and disturbed are told apart over so long (s)."""

_LOUD = 4.0
"""A stretch is disturbed when it wanders more than so many times the quiet level."""

_TURNED = 3.0 * DEG
"""Rms angle of a second's mean force about the stretch's: a unit at rest stays well below."""

_UNSTEADY = 0.03 * STANDARD_GRAVITY
"""Rms of the length of a second's mean force about the stretch's, m/s^2."""


_HELD = 0.55
"""Part of the samples that are new where each value comes twice or more."""


@dataclass(frozen=True)
class Stretch:
    """A quiet or a disturbed stretch of a record, s in the record's time.

    It is disturbed beside the record's quietest tenth, or because the unit moved all the time: it
    turned, or its force was not that of rest, by bounds that do not depend on the record.

    Examples
    --------
    >>> Stretch(0.0, 10.0, disturbed=False).end
    10.0
    """

    start: float
    end: float
    disturbed: bool
    moved: bool = False


@dataclass(frozen=True, eq=False)
class Summary(Shown):
    """What a record looks like; SI, body axes.

    Parameters
    ----------
    start, end : float
        s.
    samples : int
        Samples.
    interval : float
        Mean sampling interval, s.
    mean_rate, mean_force : (3,) float64
        rad/s and m/s^2.
    mean_force_norm : float
        Mean of |f|, m/s^2.
    noise_gyro, noise_accel : float
        Noise of one axis from second differences, as white noise: rad/sqrt(s), m/s/sqrt(s); of
        instantaneous rates as they came, and of those that repeat, each once.
        Where rounding dominates it is larger than the random walk.
    wander_rate : float
        Scatter of the rate's means over about a second, one axis, rad/s.
    stretches : tuple of Stretch
        Quiet and disturbed, in order, without holes.
    blocks : (k, 15) float64
        Sums over about a second each, `StretchSums` by `StretchSums`.
    """

    start: float
    end: float
    samples: int
    interval: float
    mean_rate: Array
    mean_force: Array
    mean_force_norm: float
    noise_gyro: float
    noise_accel: float
    wander_rate: float
    stretches: tuple[Stretch, ...]
    blocks: Array = field(repr=False)

    @property
    def stretch_sums(self) -> StretchSums:
        """The blocks by the names of their numbers."""
        return StretchSums(self.blocks)

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.end - self.start

    def steady_force(self, gravity: float) -> float:
        """Return the mean force whose length is nearest to gravity, m/s^2.

        Shaking makes the mean of |f| too long, swinging the length of the mean of f too short.
        """
        of_mean = float(np.linalg.norm(self.mean_force))
        return min((self.mean_force_norm, of_mean), key=lambda v: abs(v - gravity))

    @property
    def quiet_seconds(self) -> float:
        """Time in quiet stretches, s."""
        return float(sum(s.end - s.start for s in self.stretches if not s.disturbed))

    @property
    def turned(self) -> bool:
        """Whether the unit was turned or moved in each stretch: it was at rest in none."""
        return all(stretch.moved for stretch in self.stretches)

    def hints(
        self, site: Site | None = None, gyro_bias: float = 0.0, reading: Reading | None = None
    ) -> list[str]:
        """Return what looks wrong with units and axes of a standing record, in sentences.

        Parameters
        ----------
        site : Site, optional
            For local gravity; standard gravity without it.
        gyro_bias : float
            Bias that the instrument may have (1-sigma, rad/s).
        reading : Reading, optional
            How the values were read.
        """
        return check_record(self, reading, site, gyro_bias=gyro_bias)

    def to_dict(self, site: Site | None = None) -> dict[str, object]:
        """Return the summary in the field's units, ready for JSON."""
        gravity = STANDARD_GRAVITY if site is None else site.gravity
        root_hour = DEG / 60.0
        return {
            "schema": "schuler.info/1",
            "time": {
                "start": self.start,
                "end": self.end,
                "duration_s": self.duration,
                "samples": self.samples,
                "rate_hz": 1.0 / self.interval,
            },
            "mean_rate_deg_h": [float(v) / DEG_PER_HOUR for v in self.mean_rate],
            "mean_rate_norm_deg_h": float(np.linalg.norm(self.mean_rate)) / DEG_PER_HOUR,
            "mean_force_m_s2": [float(v) for v in self.mean_force],
            "mean_force_norm_m_s2": self.mean_force_norm,
            "norm_of_mean_force_m_s2": float(np.linalg.norm(self.mean_force)),
            "gravity_m_s2": gravity,
            "noise": {
                "gyro_deg_sqrt_h": self.noise_gyro / root_hour,
                "accelerometer_ug_sqrt_hz": self.noise_accel / MICRO_G,
            },
            "quiet_s": self.quiet_seconds,
            "stretches": [
                {"start": s.start, "end": s.end, "disturbed": s.disturbed} for s in self.stretches
            ],
        }


class Summariser:
    """Gather a `Summary` chunk by chunk; any chunking gives the same.

    Examples
    --------
    >>> summariser = Summariser()
    >>> summariser.push(record)
    >>> summariser.summary().samples
    1200
    """

    def __init__(self) -> None:
        from schuler.kernels import blocks

        self._kernel: Callable[..., None] = blocks.summarise
        self._state = SummaryState.zeros()
        self._state.length = 1.0
        self._table = np.zeros((blocks.CAPACITY, blocks.ROW))

    def copy(self) -> Summariser:
        """Return a summariser that continues by itself from here."""
        other = copy(self)
        other._state = SummaryState(self._state.data.copy())
        other._table = self._table.copy()
        return other

    def push(self, record: ImuRecord) -> None:
        """Take a chunk of three gyros and three accelerometers."""
        values = None if record.values is None else record.values[1:]
        self._kernel(
            self._state.data,
            self._table,
            record.time,
            record.dt,
            record.dtheta,
            record.dvel,
            values,
        )

    def arrays(self) -> dict[str, Array]:
        """Return all that a later summariser needs to resume in this one's place."""
        # Rows after the one under way are zero.
        rows = int(self._state.rows) + 1
        return {"summary": self._state.data.copy(), "summary_table": self._table[:rows].copy()}

    def restore(self, arrays: dict[str, Array]) -> None:
        """Go on in the place of the summariser that gave the arrays.

        Raises
        ------
        InputError
            If the arrays are not those of a summariser, or contradict one another.
        """
        from schuler.kernels.layout import LayoutError, check_summary

        try:
            check_summary(arrays)
        except LayoutError as error:
            raise InputError(f"the saved state of a summary is damaged: {error}") from None
        table = arrays["summary_table"]
        self._state = SummaryState(arrays["summary"].copy())
        self._table[:] = 0.0
        self._table[: len(table)] = table

    def summary(self) -> Summary:
        """Return the summary of what has been taken.

        Raises
        ------
        InputError
            If there was nothing.
        """
        state = self._state
        rows = int(state.rows)
        table = self._table[: rows + int(StretchSums(self._table).samples[rows] > 0)]
        if not len(table):
            raise InputError("the record has no samples to summarise")
        # A last stretch of a few samples is no estimate of anything: join it to the one before.
        durations = StretchSums(table).duration
        if len(table) > 1 and durations[-1] < 0.5 * durations[-2]:
            table = np.vstack([table[:-2], joined_stretches(table[-2:], np.array([0]))])
        each = StretchSums(table.copy())
        total = StretchSums(each.data.sum(axis=0))
        count = max(float(state.differences), 1.0)
        interval = float(total.duration / total.samples)
        # Second differences of white noise have six times its variance, on three axes.
        noise = np.sqrt(state.differences2 / count / 18.0 * interval)
        new = float(state.new_values)
        if 2.0 < new <= _HELD * float(state.samples):
            # Held values: differences between those that are new, over the interval between them.
            apart = float(total.duration) / new
            noise = np.sqrt(state.new_differences2 / float(state.new_differences) / 18.0 * apart)
        rate = each.sum_dtheta / each.duration[:, None]
        begin = float(each.end[0] - each.duration[0])
        begin = 0.0 if abs(begin) < 1e-6 * interval else begin
        mean_rate = total.sum_dtheta / total.duration
        return Summary(
            start=begin,
            end=float(each.end[-1]),
            samples=int(total.samples),
            interval=interval,
            mean_rate=mean_rate,
            mean_force=total.sum_dvel / total.duration,
            mean_force_norm=float(total.sum_force / total.samples),
            noise_gyro=float(noise[0]),
            noise_accel=float(noise[1]),
            wander_rate=float(np.sqrt(np.mean((rate - mean_rate) ** 2))),
            stretches=_stretches(each),
            blocks=each.data,
        )


def joined_stretches(table: Array, starts: NDArray[np.int64]) -> Array:
    """Return the rows of a table of stretches joined, each from one start to the next."""
    old, out = StretchSums(table), StretchSums(np.add.reduceat(table, starts, axis=0))
    out.end = old.end[np.append(starts[1:], len(table)) - 1]
    out.largest_rate = np.maximum.reduceat(old.largest_rate, starts)
    out.largest_force = np.maximum.reduceat(old.largest_force, starts)
    out.smallest_force = np.minimum.reduceat(old.smallest_force, starts)
    return out.data


def _wander(total: Array, duration: Array, group: int) -> Array:
    """Return how far second means move from one to the next, rms over groups of rows."""
    mean = total / duration[:, None]
    step = np.sum(np.diff(mean, axis=0) ** 2, axis=1)
    step = np.append(step, step[-1] if len(step) else 0.0)
    starts = np.arange(0, len(step), group)
    size = np.diff(np.append(starts, len(step)))
    return np.asarray(np.sqrt(np.add.reduceat(step, starts) / size))


def _moved(table: StretchSums, group: int) -> NDArray[np.bool_]:
    """Say of each stretch whether the unit moved in it, by bounds in deg and m/s^2.

    The force tells: a wrong unit of the gyros looks like a turn, but it does not move the force.
    """
    force = table.sum_dvel / table.duration[:, None]
    starts = np.arange(0, len(force), group)
    moved = np.zeros(len(starts), bool)
    for k, a in enumerate(starts):
        f = force[a : a + group]
        size = np.linalg.norm(f, axis=1)
        mean = f.mean(axis=0)
        length = float(np.linalg.norm(mean))
        if length == 0.0 or np.any(size == 0.0):
            continue
        cosine = np.clip(f @ mean / (size * length), -1.0, 1.0)
        turned = np.sqrt(np.mean(np.arccos(cosine) ** 2)) > _TURNED
        # In units of the mean force: a wrong unit of the accelerometers moves nothing.
        unsteady = np.std(size) / np.mean(size) > _UNSTEADY / STANDARD_GRAVITY
        moved[k] = turned or unsteady
    return moved


def _stretches(table: StretchSums) -> tuple[Stretch, ...]:
    """Tell quiet from disturbed stretches: by the quietest tenth of the record itself."""
    group = max(1, round(_STRETCH / float(np.median(table.duration))))
    moved = _moved(table, group)
    disturbed = moved.copy()
    for total in (table.sum_dtheta, table.sum_dvel):
        wander = _wander(total, table.duration, group)
        # A unit that moves, however steadily, is no measure of quiet.
        still = wander[~moved] if not moved.all() else wander
        disturbed |= wander > _LOUD * np.quantile(still, 0.1) + 1e-300
    out: list[Stretch] = []
    begin = table.end - table.duration
    for k, flag in enumerate(disturbed):
        end = float(table.end[min((k + 1) * group, len(begin)) - 1])
        if out and out[-1].disturbed == bool(flag):
            last = out[-1]
            out[-1] = Stretch(last.start, end, bool(flag), last.moved and bool(moved[k]))
        else:
            out.append(Stretch(float(begin[k * group]), end, bool(flag), bool(moved[k])))
    return tuple(out)
