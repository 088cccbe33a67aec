"""From a file's stamps to seconds: their unit, where it is not given, and stamps that start again.

The unit is found by the rate that it gives. Stamps that advance by more than 2 cannot be seconds of
an inertial sensor: of ms, us and ns exactly one gives 2 to 2000 Hz. A large number is a date: about
1.7e9 in s, 1.7e12 in ms, and so on. Stamps that go back by a week, a day, an hour or the range of a
counter are continued.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from schuler.errors import InputError
from schuler.io.content import Array, Block
from schuler.units import parse_factor, time_text

__all__ = ["Clock", "timed"]

#: stamps that are looked at
_LOOK = 4096
#: fewer say nothing
_LEAST = 8
#: beyond this, seconds are no stamps of a sensor
_SLOWEST = 2.0
_SLOW, _FAST = 2.0, 2000.0
#: a day count of spreadsheets (since 1900) and of MATLAB
_DAYS = ((3e4, 8e4), (7e5, 8e5))
_DATES = (("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
_PERIODS = ((604800.0, "week"), (86400.0, "day"), (3600.0, "hour"))
_COUNTERS = (16, 24, 32)


class Clock:
    """Turns stamps into seconds.

    Parameters
    ----------
    unit : str, optional
        The stamps' unit, where it is known.
    max_gap : float, optional
        Longest gap that may be bridged, s; six and a half intervals when not given.
    notes : list of str
        Takes what is found.

    Attributes
    ----------
    unit : str
        ``"s"`` until another is found.
    found : bool
        The unit was found by the stamps.
    decided : bool
        Stamps have been looked at, or need not be.
    """

    def __init__(self, unit: str | None, max_gap: float | None, notes: list[str]) -> None:
        self.unit = unit or "s"
        self.found = False
        self.decided = False
        self._given = unit is not None
        self._max_gap = max_gap
        self._notes = notes
        self._factor = parse_factor(self.unit, ("time",), "time")[0]
        self._step = 0.0
        self._bursts: str | None = None
        self._offset = 0.0
        self._last = np.nan

    def again(self) -> Clock:
        """Return a clock that knows what this one found, at its beginning."""
        other = Clock(self.unit, self._max_gap, self._notes)
        other.found, other.decided, other._given = self.found, self.decided, self._given
        other._step, other._bursts = self._step, self._bursts
        return other

    @property
    def label(self) -> str:
        """What messages call the unit."""
        return f"{self.unit} (found by the stamps)" if self.found else self.unit

    def look(self, stamps: Array) -> None:
        """Find the unit and the interval by the first stamps; nothing is found by a few."""
        t = np.asarray(stamps, np.float64)[:_LOOK]
        t = t[np.isfinite(t)]
        self.decided = True
        steps = np.diff(t)
        if len(t) < _LEAST or not np.any(steps > 0):
            return
        self._step = float(np.median(steps[steps > 0]))
        bursts = _bursts(t, steps, self._step)
        effective = self._step if bursts is None else bursts[1]
        if not self._given:
            unit = _unit(float(np.median(t)), effective)
            self.unit, self.found = unit, unit != "s"
            self._factor = parse_factor(unit, ("time",), "time")[0]
        else:
            self._doubt(effective)
        rate = f"{1.0 / (effective * self._factor):.3g}"
        if bursts is not None:
            size = bursts[0]
            self._bursts = (
                f"the rows arrive in bursts, about {size:.3g} rows each "
                f"{time_text(float(f'{size * effective * self._factor:.3g}'))} s: the stamps tell "
                "when they arrived, not when they were measured; replace them by the instrument's "
                f"rate, as --rate {rate}"
            )
        spacing = float(np.spacing(np.float32(np.max(np.abs(t)))))
        if np.array_equal(t, t.astype(np.float32)) and spacing > 0.05 * effective:
            # Stamps that are rounded up and down have no interval of their own.
            rate = f"{(len(t) - 1) / ((t[-1] - t[0]) * self._factor):.3g}"
            coarse = f"{1e3 * spacing * self._factor:.3g} ms"
            self._note(
                f"the stamps have the resolution of 32-bit numbers ({coarse}), coarse beside the "
                f"interval; replace them by the instrument's rate, as --rate {rate}"
            )

    def check(self) -> None:
        """Refuse stamps that are those of bursts, which no interval can be told from.

        Raises
        ------
        InputError
            If the rows arrive in bursts and nothing allows so long a gap.
        """
        if self._bursts is not None and self._max_gap is None:
            raise InputError(self._bursts)

    def seconds(self, stamps: Array) -> Array:
        """Return stamps as seconds, continued where they start again; call for each block once."""
        t = np.asarray(stamps, np.float64)
        if not len(t):
            return t
        steps = np.diff(t, prepend=self._last)
        self._last = float(t[-1])
        back = np.flatnonzero(steps < 0)
        offset: float | Array = self._offset
        if len(back):
            jumps = np.zeros(len(t))
            for i in back:
                period, what = self._period(float(steps[i]))
                if period == 0.0:
                    break
                jumps[i] = period
                before = (t[i] - steps[i] + self._offset) * self._factor
                self._note(f"the stamps start again after t = {time_text(before)} s ({what}): "
                           "they were continued")  # fmt: skip
            offset = self._offset + np.cumsum(jumps)
            self._offset = float(offset[-1])
        if len(back) or self._offset:
            t = t + offset
        return t if self._factor == 1.0 else t * self._factor

    def interval(self, dt: Array) -> Array:
        """Return lengths of intervals in seconds."""
        return np.asarray(dt, np.float64) * self._factor

    def _period(self, step: float) -> tuple[float, str]:
        """Return the period by which stamps that go back go on, 0 where none fits."""
        most = 6.5 * self._step if self._max_gap is None else self._max_gap / self._factor
        found = [(length / self._factor, f"the end of a {name}") for name, length in
                 ((name, length) for length, name in _PERIODS)]  # fmt: skip
        for bits in _COUNTERS:
            size = float(1 << bits)
            scales = {1.0} if bits < 32 else {1.0, *(u / self._factor for u in (1e-3, 1e-6, 1e-9))}
            found += [(size * scale, f"a counter of {bits} bits") for scale in scales]
        fits = [(p + step, p, what) for p, what in found if 0.0 < p + step <= most]
        return min(fits)[1:] if fits else (0.0, "")

    def _doubt(self, step: float) -> None:
        """Note a stated unit that gives no rate of an inertial sensor."""
        rate = 1.0 / (step * self._factor)
        other = _unit(0.0, step)
        if rate < 0.2 and other != self.unit and other != "s":
            fits = 1.0 / (step * parse_factor(other, ("time",), "time")[0])
            self._note(
                f"the time's unit {self.unit} gives {rate:.3g} Hz; in {other} it would be "
                f"{fits:.4g} Hz (--time {other})"
            )

    def _note(self, text: str) -> None:
        head = text.partition(" after t =")[0]
        if not any(note.startswith(head) for note in self._notes):
            self._notes.append(text)


def _unit(middle: float, step: float) -> str:
    """Return the unit that makes stamps those of an inertial sensor."""
    for name, low, high in _DATES:
        rate = 1.0 / (step * parse_factor(name, ("time",), "time")[0])
        if low <= abs(middle) < high and 0.5 <= rate <= 2e4:
            return name
    if any(low < middle < high for low, high in _DAYS) and 0.5 <= 1.0 / (step * 86400.0) <= 2e4:
        return "86400 s"
    if step <= _SLOWEST:
        return "s"
    for name in ("ms", "us", "ns"):
        if _SLOW < 1.0 / (step * parse_factor(name, ("time",), "time")[0]) <= _FAST:
            return name
    return "s"


def _bursts(t: Array, steps: Array, step: float) -> tuple[float, float] | None:
    """Return the rows of a burst and the true interval, where rows arrive together; else None."""
    begins = np.flatnonzero(steps > 5.0 * step)
    if np.count_nonzero(steps == 0.0) > 0.2 * len(steps):
        begins = np.flatnonzero(steps > 0.0)
    if len(begins) < 4:
        return None
    rows = np.diff(begins)
    size = float(np.median(rows))
    # Gaps come now and then; bursts come in step, and all time is between them.
    regular = np.mean(np.abs(rows - size) <= max(1.0, 0.25 * size))
    if size < 2.0 or regular < 0.8 or len(begins) * size < 0.5 * len(steps):
        return None
    count = int(begins[-1] - begins[0])
    return float(np.mean(rows)), float(t[begins[-1] + 1] - t[begins[0] + 1]) / count


def timed(blocks: Iterator[Block | None], clock: Clock) -> Iterator[Block | None]:
    """Pass blocks on, the first only once the clock has seen enough stamps to know their unit."""
    held: list[Block] = []
    for block in blocks:
        if clock.decided or block is None:
            yield block
            continue
        held.append(block)
        stamps = [b[0] for b in held if b[0] is not None]
        if sum(map(len, stamps)) < 2 * _LEAST and block[0] is not None:
            continue
        if stamps:
            clock.look(np.concatenate(stamps))
        clock.decided = True
        yield from held
        held = []
    if held:
        clock.look(np.concatenate([b[0] for b in held if b[0] is not None]))
        yield from held
