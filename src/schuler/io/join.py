"""Gyros and accelerometers that were logged apart, on one clock.

They come from two files, two topics of a log, or rows of one table that hold one sensor or the
other. The gyros' stamps stay; the accelerometers are interpolated linearly to them. Between two
samples, at a fraction u of the interval, white noise keeps (1 - u)^2 + u^2 of its variance, two
thirds on average, and neighbours are correlated: that is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.clock import Clock, timed
from schuler.io.content import Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.units import parse_factor, time_text

__all__ = ["alternates", "join", "split_rows"]

#: part of the rows that must lack a sensor before rows are taken for alternating
_LACKING = 0.3


def join(
    gyros: Content, accels: Content, given: Mapping, max_gap: float | None, label: str
) -> Content:
    """Return one content of two: gyros of the first, accelerometers of the second at its stamps.

    Parameters
    ----------
    gyros, accels : Content
    given : Mapping
        What the user says.
    max_gap : float or None
        Longest gap of the accelerometers over which may be interpolated, s; six and a half of
        their intervals when not given.
    label : str
        What messages call the second.

    Raises
    ------
    InputError
        If a sensor's samples cannot be interpolated, or the two do not share axes.
    """
    unit = given.gyro or gyros.said.gyro
    if unit is not None and parse_factor(unit, ("angular rate", "angle"), "gyro")[1] == "angle":
        raise InputError(
            "increments of two tables cannot be joined: interpolation is for rates; join them "
            "row by row where they were logged"
        )
    if given.rate is not None:
        raise InputError(
            "gyros and accelerometers are joined by their stamps, which --rate replaces; leave it "
            "out, or join them row by row"
        )
    axes = {content.said.axes for content in (gyros, accels) if content.said.axes}
    if given.axes is None and len(axes) > 1:
        raise InputError(f"gyros and accelerometers have different axes ({', '.join(axes)})")
    notes = gyros.notes
    notes += [note for note in accels.notes if note not in notes]
    clocks = [_clock(content, given, max_gap, notes) for content in (gyros, accels)]
    notes.append(_effect(gyros, accels, clocks, label))

    def blocks() -> Iterator[Block]:
        own, other = (clock.again() for clock in clocks)
        yield from _blocks(gyros, _Samples(accels, other, max_gap, label), own, notes)

    stated = "" if clocks[0].unit == "s" else f" in {clocks[0].label}"
    said = replace(gyros.said, accel=accels.said.accel, time="s")
    return Content(
        blocks=blocks,
        said=said if said.axes else replace(said, axes=accels.said.axes),
        time_label=f"{gyros.time_label}{stated}, joined with {label},",
        name=gyros.name,
        notes=notes,
        progress=gyros.progress,
        mark=gyros.mark,
        fixed=gyros.fixed and accels.fixed,
    )


def _clock(content: Content, given: Mapping, max_gap: float | None, notes: list[str]) -> Clock:
    clock = Clock(given.time or content.said.time, max_gap, notes)
    stamps = content.stamps
    if stamps is None:
        stamps = next((block[0] for block in content.blocks()), None)
    if stamps is None:
        raise InputError("there is no time column: gyros and accelerometers are joined by time")
    clock.look(stamps)
    return clock


def _effect(gyros: Content, accels: Content, clocks: Sequence[Clock], label: str) -> str:
    """Say how the two are joined, and what that does to the noise."""
    times = []
    for content, clock in zip((gyros, accels), clocks, strict=True):
        stamps = content.stamps
        if stamps is None:
            stamps = next(block[0] for block in content.blocks())
        assert stamps is not None
        times.append(clock.again().seconds(np.asarray(stamps, np.float64)[:4096]))
    own, other = times
    how = f"the accelerometers of {label} were put on the gyros' clock"
    inside = own[(own >= other[0]) & (own <= other[-1])] if len(other) > 1 else own[:0]
    if not len(inside):
        return f"{how} by linear interpolation"
    k = np.clip(np.searchsorted(other, inside), 1, len(other) - 1)
    u = (inside - other[k - 1]) / (other[k] - other[k - 1])
    kept = float(np.sqrt(np.mean((1.0 - u) ** 2 + u**2)))
    if kept > 0.9999:
        return f"{how}: their stamps are the same, and nothing was interpolated"
    return (
        f"{how} by linear interpolation, which lowers the white noise of a sample by "
        f"{100.0 * (1.0 - kept):.0f} % and correlates neighbours: noise figures of these "
        "accelerometers are too good by that"
    )


class _Samples:
    """The accelerometers' samples up to a time, as they are needed."""

    def __init__(self, content: Content, clock: Clock, max_gap: float | None, label: str) -> None:
        self._blocks = timed(content.blocks(), clock)
        self._clock, self._label = clock, label
        self._max_gap = max_gap
        self.time = np.empty(0)
        self.values = np.empty((0, 3))

    def until(self, time: float) -> None:
        """Read on until a sample at or after a time, or the end."""
        while not (len(self.time) and self.time[-1] >= time):
            block = next(self._blocks, None)
            if block is None:
                return
            self._clock.check()
            assert block[0] is not None
            t = self._clock.seconds(block[0])
            rows = _columns(block, slice(3, 6))
            good = np.isfinite(rows).all(axis=1) & np.isfinite(t)
            before = self.time[-1] if len(self.time) else -np.inf
            t = t[good]
            steps = np.diff(t, prepend=before)
            if np.any(steps < 0):
                at = t[int(np.argmax(steps < 0))]
                raise InputError(
                    f"the time of the accelerometers ({self._label}) goes backward to "
                    f"t = {time_text(float(at))} s; sort the rows"
                )
            self.time = np.append(self.time, t)
            self.values = np.vstack([self.values, rows[good]])

    def at(self, time: Array) -> Array:
        """Return the values at times between the first sample and the last."""
        limit = self._max_gap
        if limit is None:
            limit = 6.5 * float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.inf
        k = np.clip(np.searchsorted(self.time, time), 1, max(1, len(self.time) - 1))
        wide = (self.time[k] - self.time[k - 1] > limit) & (time != self.time[k])
        if np.any(wide):
            i = int(np.argmax(wide))
            raise InputError(
                f"the accelerometers ({self._label}) have a gap of "
                f"{self.time[k[i]] - self.time[k[i] - 1]:.6g} s after "
                f"t = {time_text(float(self.time[k[i] - 1]))} s; cut the record there (--start, "
                "--stop), or allow it with --max-gap"
            )
        return np.column_stack([np.interp(time, self.time, v) for v in self.values.T])

    def forget(self, time: float) -> None:
        """Drop the samples that no time from this one on needs."""
        k = max(0, int(np.searchsorted(self.time, time)) - 2)
        self.time, self.values = self.time[k:], self.values[k:]


def _blocks(gyros: Content, accels: _Samples, clock: Clock, notes: list[str]) -> Iterator[Block]:
    lost = total = 0
    for block in timed(gyros.blocks(), clock):
        assert block is not None
        clock.check()
        if block[0] is None:
            raise InputError("there is no time column: gyros and accelerometers are joined by time")
        time = clock.seconds(block[0])
        if not len(time):
            continue
        accels.until(float(np.nanmax(time)))
        if not len(accels.time):
            raise InputError("no accelerometer sample has a time and three finite values")
        inside = (time >= accels.time[0]) & (time <= accels.time[-1])
        total += len(time)
        lost += int(np.count_nonzero(~inside))
        time = time[inside]
        rows = _columns(block, slice(0, 3))[inside]
        if len(time):
            yield time, np.hstack([rows, accels.at(time)]), None
            accels.forget(float(time[-1]))
    if lost == total:
        raise InputError("gyros and accelerometers share no time; check the units of both (--time)")
    if lost:
        note = f"{lost} rows of the gyros are at times without accelerometers, and were left out"
        if note not in notes:
            notes.append(note)


def _columns(block: Block, part: slice) -> Array:
    values: Any = block[1]
    columns = values.T if isinstance(values, np.ndarray) else values
    return np.column_stack([np.asarray(c, np.float64) for c in columns[part]])


def alternates(values: Sequence[Array]) -> bool:
    """Say whether rows hold one sensor or the other, as loggers with two queues write them."""
    empty = np.isnan(np.column_stack(list(values)))
    gyros, accels = empty[:, :3].all(axis=1), empty[:, 3:].all(axis=1)
    alone = np.asarray(gyros ^ accels, np.bool_)
    n = alone.size
    return n >= 8 and min(gyros.sum(), accels.sum()) > 0.02 * n and alone.sum() > _LACKING * n


def split_rows(content: Content) -> tuple[Content, Content]:
    """Return the rows of each sensor of a table whose rows hold one or the other."""

    def rows(part: slice) -> Iterator[Block]:
        for time, values, _ in content.blocks():
            table = _columns((time, values, None), slice(0, 6))
            there = ~np.isnan(table[:, part]).all(axis=1)
            yield None if time is None else time[there], table[there], None

    gyros = replace(content, blocks=lambda: rows(slice(0, 3)), follow=None, stamps=None)
    accels = replace(content, blocks=lambda: rows(slice(3, 6)), follow=None, stamps=None)
    return gyros, replace(accels, notes=[])
