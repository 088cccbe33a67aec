"""What the saved state of a kernel may hold: checked before a kernel computes with it.

A kernel takes its indices and counters from its state, without a check of its own: a state from a
file that breaks the layout would make it write outside its tables. `schuler.kernels.states` says
for each array which numbers it has and their ranges; here is what must hold between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.kernels import gaps, spikes
from schuler.kernels.fields import COUNT, SUM, TIME, Field, View
from schuler.kernels.states import (
    LARGEST,
    STRETCH_CAPACITY,
    IntakeRow,
    IntakeState,
    SpikeRow,
    StretchSums,
    SummaryState,
)

__all__ = ["COUNT", "ArrayLayout", "LayoutError", "check_arrays", "check_intake", "check_summary",
           "view_layout"]  # fmt: skip

Array = NDArray[np.float64]

RATE, FORCE = 1e3, 1e5
"""Beyond any angular rate (rad/s) and specific force (m/s^2) of a stationary vehicle."""


class LayoutError(ValueError):
    """A saved state breaks the layout of its kernel; the text says where."""


@dataclass(frozen=True)
class ArrayLayout:
    """Shape and ranges of one array; all numbers must be finite.

    Parameters
    ----------
    shape : tuple of (int, int)
        Least and greatest size of each axis.
    fields : tuple of Field
        Ranges along the last axis.
    """

    shape: tuple[tuple[int, int], ...]
    fields: tuple[Field, ...] = ()

    def check(self, name: str, array: Array) -> None:
        """Raise LayoutError unless the array keeps the layout."""
        fits = array.ndim == len(self.shape) and all(
            low <= n <= high for n, (low, high) in zip(array.shape, self.shape, strict=True)
        )
        if array.dtype != np.float64 or not fits:
            raise LayoutError(f"array '{name}' has type {array.dtype} and shape {array.shape}")
        if not np.isfinite(array).all():
            raise LayoutError(f"array '{name}' has an entry that is not a finite number")
        if np.any(np.abs(array) > SUM):
            raise LayoutError(f"array '{name}' has an entry beyond any sum")
        for field in self.fields:
            part = array[..., field.slice]
            bad = (part < field.low) | (part > field.high)
            if field.whole:
                bad |= part != np.floor(part)
            if bad.any():
                kind = "a whole number" if field.whole else "a number"
                raise LayoutError(
                    f"array '{name}' holds {part[bad][0]:.6g} in entry '{field.name}', where "
                    f"{kind} from {field.low:g} to {field.high:g} belongs"
                )


def view_layout(view: type[View], *rows: tuple[int, int]) -> ArrayLayout:
    """Return the layout of an array that a view names.

    Parameters
    ----------
    view : type of View
    *rows : (int, int)
        Least and greatest size of each axis before the last.
    """
    return ArrayLayout((*rows, (view.size, view.size)), view.fields)


def series_layout(least: int, most: int, low: float, high: float) -> ArrayLayout:
    """Return the layout of a row of numbers with one range."""
    every = Field(most, low=low, high=high)
    every.name = "each"
    return ArrayLayout(((least, most),), (every,))


class Channels(View):
    """Values of six channels."""

    values = Field(6, low=-LARGEST, high=LARGEST)


class FilteredChannels(View):
    """Values of six channels, of which interpolation may be far off."""

    values = Field(6, low=-LARGEST * 100, high=LARGEST * 100)


class IntakeProgress(View):
    """How far the rows that wait have been taken."""

    opened = Field(low=0.0, high=1.0, whole=True)
    done = Field(low=0.0, high=4.0 * gaps.HISTORY, whole=True)
    screened = Field(low=0.0, high=4.0 * gaps.HISTORY, whole=True)
    keep_spikes = Field(low=0.0, high=1.0, whole=True)


class SpikeSetting(View):
    """Settings of a channel, as in `schuler.kernels.residuals`."""

    numbers = Field(spikes.SETTING, low=0.0)


SUMMARY = {
    "summary": view_layout(SummaryState),
    "summary_table": view_layout(StretchSums, (1, STRETCH_CAPACITY)),
}

_PENDING = 4 * gaps.HISTORY
"""More rows never wait: those behind a long gap, those to be judged and their neighbours."""

INTAKE = {
    "intake": view_layout(IntakeState),
    "intake_nominal": series_layout(1, 1, 0.0, 1e10),
    "intake_times": series_layout(0, 255, -TIME, TIME),
    "intake_rows": view_layout(Channels, (0, 255)),
    "intake_pending": view_layout(IntakeRow, (0, _PENDING)),
    "intake_progress": view_layout(IntakeProgress),
    "intake_settings": view_layout(SpikeSetting, (6, 6)),
    "intake_history": view_layout(FilteredChannels, (gaps.HISTORY,) * 2),
    "intake_spikes": view_layout(SpikeRow, (0, 1 << 20)),
}


def check_arrays(arrays: Mapping[str, Array], layouts: Mapping[str, ArrayLayout]) -> None:
    """Check presence, type, shape, finiteness and ranges.

    Raises
    ------
    LayoutError
        Saying which array breaks the layout, and where.
    """
    for name, layout in layouts.items():
        if name not in arrays:
            raise LayoutError(f"array '{name}' is missing")
        layout.check(name, arrays[name])


def require(holds: object, text: str) -> None:
    """Raise `LayoutError` unless something holds."""
    if not holds:
        raise LayoutError(text)


def check_summary(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `blocks.summarise`.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, SUMMARY)
    s, table = SummaryState(arrays["summary"]), arrays["summary_table"]
    rows = int(s.rows)
    require(np.log2(s.length) % 1.0 == 0.0, "array 'summary' has an impossible stretch length")
    require(len(table) > rows, "array 'summary_table' has fewer rows than is said")
    require(not table[rows + 1 :].any(), "array 'summary_table' has rows beyond its end")
    samples = StretchSums(table).samples
    require(samples.sum() == s.samples, "array 'summary_table' miscounts its samples")
    require(
        s.differences == max(0.0, s.samples - 2.0)
        and s.new_differences == max(0.0, s.new_values - 2.0) and s.new_values <= s.samples,
        "array 'summary' miscounts its differences",
    )  # fmt: skip
    used = StretchSums(table[: rows + int(samples[rows] > 0.0)])
    count = used.samples
    require(
        np.all(count >= 1.0) and np.all(used.duration > 0.0) and np.all(np.diff(used.end) > 0),
        "array 'summary_table' has a stretch without samples or out of order",
    )
    for total, bound in ((used.sum_dtheta, RATE), (used.sum_dvel, FORCE)):
        most = bound * (used.duration[:, None] + 1.0)
        require(np.all(np.abs(total) <= most), "a sum is beyond any instrument")
    require(
        np.all(used.largest_rate <= RATE) and np.all(used.smallest_force <= used.largest_force)
        and np.all(used.largest_force <= FORCE),
        "array 'summary_table' has extremes beyond any instrument",
    )  # fmt: skip
    slack = 1.0 + 1e-9
    require(
        np.all(used.sum_rate2 <= slack * count * used.largest_rate**2)
        and np.all(used.sum_force2 <= slack * count * used.largest_force**2)
        and np.all(used.sum_force <= slack * count * used.largest_force)
        and np.all(slack * used.sum_force >= count * used.smallest_force),
        "array 'summary_table' has sums that its extremes do not allow",
    )


def check_intake(arrays: Mapping[str, Array]) -> None:
    """Check the saved state of `intake.intake` and of the rows that wait for their rate.

    Raises
    ------
    LayoutError
        If an entry breaks the layout, or entries contradict one another.
    """
    check_arrays(arrays, INTAKE)
    s, nominal = IntakeState(arrays["intake"]), float(arrays["intake_nominal"][0])
    times, rows = arrays["intake_times"], arrays["intake_rows"]
    require(len(times) == len(rows), "'intake_times' and 'intake_rows' differ in length")
    pending, progress = arrays["intake_pending"], IntakeProgress(arrays["intake_progress"])
    waiting = IntakeRow(pending)
    if nominal == 0.0 or not progress.opened:
        require(not s.integrated and not s.started, "array 'intake' has rows and yet no interval")
        require(not progress.opened and not len(pending), "'intake_pending' has rows of no record")
        return
    require(
        progress.done <= progress.screened <= len(pending),
        "'intake_progress' is beyond the rows that wait",
    )
    require(
        np.all(np.diff(waiting.number) > 0) and np.all(np.diff(waiting.time) > 0)
        and (not len(pending) or waiting.time[-1] == s.last_time),
        "array 'intake_pending' is out of order",
    )  # fmt: skip
    require(
        s.opened <= s.started and s.done_time <= s.last_time,
        "array 'intake' is integrated beyond its rows",
    )
    require((s.opened == 1.0) == (s.history > 0.0), "array 'intake_history' has no last row")
    require(not len(times), "'intake_times' has rows that the intake took already")
    require(s.started == (s.integrated > 0.0), "array 'intake' has rows and yet no last row")
    valid = s.rows - s.not_finite - s.repeated
    require(valid >= s.integrated, "array 'intake' miscounts its rows")
    require(s.first_time <= s.last_time or not s.started, "array 'intake' ends before it begins")
    require(valid > s.regular + s.gaps or not s.started, "array 'intake' miscounts its intervals")
