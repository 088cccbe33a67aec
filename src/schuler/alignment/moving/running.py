"""`RunningAlignment`: the filter of an alignment in motion, run on as samples and fixes come.

It begins where the passes over the kept samples ended, from their smoothed start, and corrects
itself by the same rule as they do: what it has at an instant is what one more pass would have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.alignment.moving.fine import (
    CHUNK,
    FineAlignment,
    correct_if_known,
    filtered_end,
    known_heading,
)
from schuler.alignment.moving.outcome import Later, Tally, bound_filter, compose
from schuler.alignment.moving.prepared import Prepared, Taken, restamped
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.setup import measurements
from schuler.constants import STAMP_ROUNDING
from schuler.errors import InputError
from schuler.in_motion.coarse import CoarseAlignment
from schuler.ins import Measurement
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["RunningAlignment"]

Array = NDArray[np.float64]

_WIDE = 12.0
"""More than the stamp of a fix may be off, s."""

_MARGIN = 0.1
"""More than a stamp is moved after the passes, s."""

_LOST = 10.0
"""Without a fix for so long that is said, s."""


class RunningAlignment:
    """The alignment of a span, and what came after it.

    Parameters
    ----------
    prepared : Prepared
    rough : CoarseAlignment
    found : FineAlignment
        Its filters run on.
    taken : Taken
    spec : ImuSpec
    warnings : sequence of str
    """

    def __init__(
        self, prepared: Prepared, rough: CoarseAlignment, found: FineAlignment, taken: Taken,
        spec: ImuSpec, warnings: Sequence[str],
    ) -> None:  # fmt: skip
        self._parts = prepared, rough, found, taken
        self._spec, self._warnings = spec, tuple(warnings)
        self._main = found.running
        self._base: MovingAlignment | None = None
        bound = bound_filter(prepared, found, taken)
        self._filters = {"main": self._main, **({} if bound is None else {"bound": bound})}
        self._tally = Tally()
        self._tally.add(found.filter, taken.measured)
        self._begin = prepared.record.start
        self._late = known_heading(prepared.spec)
        self._samples = len(prepared.record)
        self.time = prepared.record.end
        self.last_fix = float(max(np.asarray(aid.time)[-1] for aid in taken.measured))
        for flt in self._filters.values():
            flt.forget_outputs()

    @property
    def lag(self) -> float:
        """By how much the stamps of fixes are late, as the filter takes them, s, at least 0."""
        return max(0.0, *self._parts[3].restamped.values(), 0.0)

    @property
    def reach(self) -> float:
        """By how much stamps and the instants of their fixes may differ, s."""
        return _MARGIN + max(abs(late) for late in (0.0, *self._parts[3].restamped.values()))

    @property
    def heading_sigma(self) -> float:
        """1-sigma of phi about up, rad."""
        return float(np.sqrt(self._main.covariance[2, 2]))

    def feed(self, chunk: ImuRecord, fixes: GnssFixes | None) -> None:
        """Take samples that follow, and the fixes among them.

        Parameters
        ----------
        chunk : ImuRecord
        fixes : GnssFixes or None
            May hold others, too: those before the chunk and after it are left.
        """
        for aid in self._due(chunk, fixes):
            for flt in self._filters.values():
                flt.add(aid)
            self.last_fix = max(self.last_fix, float(np.asarray(aid.time)[-1]))
        # As the passes do: whether the heading is known is looked at on marks of one grid.
        mark = self._begin + CHUNK * (np.floor((self.time - self._begin) / CHUNK + 1e-9) + 1.0)
        begin = None
        while begin is None or begin < chunk.end:
            piece = chunk.between(begin, mark)
            if len(piece):
                for flt in self._filters.values():
                    flt.update(piece)
            if mark <= chunk.end:
                for flt in self._filters.values():
                    correct_if_known(flt, mark - self._begin, self._late)
            begin, mark = mark, mark + CHUNK
        self.time = chunk.end
        self._samples += len(chunk)
        self._tally.add(self._main, self._parts[3].measured)
        for flt in self._filters.values():
            flt.forget_outputs()

    def _due(self, chunk: ImuRecord, fixes: GnssFixes | None) -> list[Measurement]:
        """Return what the filters take of fixes within a chunk."""
        if fixes is None:
            return []
        taken = self._parts[3]
        time = np.asarray(fixes.time)
        # All of them, so that no stamp is cut off before it is moved.
        begin, end = min(float(time[0]), chunk.start), max(float(time[-1]), chunk.end)
        wide = _span(begin - _WIDE, end + _WIDE)
        known = {aid.label for aid in taken.measured}
        out = []
        for aid in measurements([fixes], wide):
            if aid.label not in known:
                continue
            moved = restamped(aid, taken.restamped.get(aid.label, 0.0), wide)
            cut = _between(moved, self.time, chunk.end)
            if cut is not None:
                out.append(cut)
        return out

    def solution(self) -> MovingAlignment:
        """Return the alignment at the last sample."""
        prepared, rough, found, taken = self._parts
        if self._base is None:
            self._base = compose(prepared, rough, found, taken, self._spec, self._warnings, "end")
        if self.time == prepared.record.end:
            return self._base
        state, budget = filtered_end(self._main)
        warnings = []
        if self.time - self.last_fix > _LOST:
            warnings.append(
                f"no fix for {self.time - self.last_fix:.3g} s: since t = "
                f"{time_text(self.last_fix)} s "
                "the inertial sensors alone have kept the attitude"
            )
        later = Later(
            self.time, self._samples, replace(self._tally, used=dict(self._tally.used),
                                              refused=dict(self._tally.refused)),
            np.asarray(filtered_end(self._filters.get("bound", self._main))[0].covariance[:3, :3]),
            tuple(warnings),
            self._base.history, self._base.summary,
        )  # fmt: skip
        now = replace(found, end=state, budget=budget)
        return compose(prepared, rough, now, taken, self._spec, self._warnings, "end", later)

    # -- saving ------------------------------------------------------------------------

    def arrays(self) -> dict[str, Array]:
        """Return what the filters have beyond the passes over the kept samples."""
        labels = [aid.label for aid in self._parts[3].measured]
        out = {
            "running": np.array([
                self.time, self.last_fix, self._samples, self._tally.square, self._tally.count,
                *(float(flt.feedback) for flt in self._filters.values()),
            ]),
            "tally": np.array([[self._tally.used[n], self._tally.refused[n]] for n in labels],
                              np.float64),
        }  # fmt: skip
        for part, flt in self._filters.items():
            for name, array in flt.arrays().items():
                out[f"{part}_{name}"] = _flat(array)
        return out

    def restore(self, arrays: Mapping[str, Array]) -> None:
        """Resume where the one was that gave the arrays, made by the same passes.

        Raises
        ------
        InputError
            If the arrays are not those of such a one.
        """
        measured = self._parts[3].measured
        numbers, tally = arrays.get("running"), arrays.get("tally")
        if (
            numbers is None or numbers.shape != (5 + len(self._filters),)
            or not np.all(np.isfinite(numbers))
            or tally is None or tally.shape != (len(measured), 2) or np.any(tally < 0.0)
            or not np.all(np.isfinite(tally)) or not self.time <= numbers[0]
        ):  # fmt: skip
            raise InputError("the saved state of an alignment in motion is damaged: 'running'")
        for part, flt in self._filters.items():
            mine: dict[str, Any] = {}
            for name, array in flt.arrays().items():
                other = arrays.get(f"{part}_{name}")
                if other is None or (array.ndim > 2 and other.shape != _flat(array).shape):
                    raise InputError(
                        f"the saved state of an alignment in motion is damaged: '{part}_{name}'"
                    )
                mine[name] = other.reshape(array.shape) if array.ndim > 2 else other
            flt.restore(mine)
        self.time, self.last_fix = float(numbers[0]), float(numbers[1])
        self._samples = int(numbers[2])
        for flt, on in zip(self._filters.values(), numbers[5:], strict=True):
            flt.feedback = bool(on)
        labels = [aid.label for aid in measured]
        self._tally = Tally(
            {n: int(row[0]) for n, row in zip(labels, tally, strict=True)},
            {n: int(row[1]) for n, row in zip(labels, tally, strict=True)},
            float(numbers[3]), int(numbers[4]),
        )  # fmt: skip


def _flat(array: Array) -> Array:
    """Return an array as the file of a saved state holds it: of two dimensions at most."""
    return array.reshape(-1, array.shape[-1]) if array.ndim > 2 else array


def _span(begin: float, end: float) -> ImuRecord:
    """Return a record of one sample: a span, for what asks for no more."""
    none = np.zeros((1, 3))
    return ImuRecord(np.array([end]), np.array([end - begin]), none, none)


def _between(aid: Measurement, begin: float, end: float) -> Measurement | None:
    """Return the measurements after a time and up to another, or None if there are none."""
    time = np.asarray(aid.time)
    inside = (time > begin + STAMP_ROUNDING) & (time <= end + STAMP_ROUNDING)
    if not np.any(inside):
        return None
    cut: dict[str, Any] = {
        name: np.asarray(getattr(aid, name))[inside] for name in ("value", "sigma")
    }
    return replace(aid, time=time[inside], **cut)
