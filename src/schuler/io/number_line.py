"""One stream: the time of its samples is a straight line in their number.

A sender that counts its samples and reads one clock puts them on such a line, to the jitter of its
time stamps; a forged or foreign sample is off it.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from statistics import median

from schuler.io.packets import LARGEST_FORCE, LARGEST_RATE, Packet

__all__ = ["Key", "Line", "Stream", "robust_line", "unwrap"]

WINDOW = 256
"""Numbers around the last one that a sample of the stream may have."""

STRETCH = 16
"""Samples on one line that make a stream."""

PERIOD = 1 << 32
"""Numbers of a frame begin anew after so many."""

SHORTEST, LONGEST = 1e-6, 100.0
"""Sampling intervals that are looked for, s."""

_HELD = 8192
"""Samples that a candidate keeps."""

_SEEN = 4 * WINDOW
"""Numbers that are known when they come again."""

Key = tuple[str | None, str, str, int]
"""Source, form (frames or lines), kind and run of a stream."""


def unwrap(number: int, near: int) -> int:
    """Return a number of 32 bits as the one nearest to another; larger numbers as they are."""
    if number >= PERIOD:
        return number
    return number + PERIOD * max(0, round((near - number) / PERIOD))


@dataclass
class Line:
    """Time as a line in the number, followed sample by sample."""

    number: int = 0
    time: float = 0.0
    interval: float = 0.0
    points: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=WINDOW))

    def fits(self, number: int, time: float) -> bool:
        """Say whether a sample lies on the line."""
        numbers, seconds = number - self.number, time - self.time
        if not self.interval:
            return numbers != 0 and SHORTEST <= seconds / numbers <= LONGEST
        # Time stamps jitter by some intervals; the slope of a short line is not known well.
        slack = 4.0 + (0.25 if len(self.points) < STRETCH else 1e-3) * abs(numbers)
        return abs(seconds - self.interval * numbers) <= slack * self.interval

    def settle(self) -> None:
        """Fill in points on the line, whose interval is that of a stretch of samples."""
        for k in range(1 - STRETCH, 1):
            self.points.append((self.number + k, self.time + k * self.interval))

    def take(self, number: int, time: float) -> None:
        """Take a sample that fits."""
        if not self.points and not self.interval:
            self.number, self.time = number, time
        elif not self.interval:
            self.interval = (time - self.time) / (number - self.number)
        self.points.append((number, time))
        (n0, t0), (n1, t1) = self.points[0], self.points[-1]
        if n1 - n0 >= len(self.points) // 2 > 0 and t1 > t0:
            self.interval = (t1 - t0) / (n1 - n0)
        if number > self.number:
            predicted = self.time + self.interval * (number - self.number)
            self.number, self.time = number, predicted + 0.25 * (time - predicted)


def robust_line(packets: list[Packet]) -> Line | None:
    """Return the line that most samples lie on, whatever the others are; None if there is none."""
    recent = sorted(packets[-WINDOW:], key=lambda p: p.number)
    half = len(recent) // 2
    pairs = list(zip(recent, recent[half:], strict=False))
    slopes = [(b.time - a.time) / (b.number - a.number) for a, b in pairs if b.number > a.number]
    if not slopes:
        return None
    interval = median(slopes)
    middle = recent[half].number
    time = median(p.time - interval * (p.number - middle) for p in recent)
    if not SHORTEST <= interval <= LONGEST:
        return None
    line = Line(middle, time, interval)
    line.settle()
    return line


@dataclass
class Stream:
    """Samples on one line, of one source, form, kind and run."""

    key: Key
    line: Line = field(default_factory=Line)
    last: float = float("-inf")
    count: int = 0
    held: deque[tuple[Packet, str]] = field(default_factory=lambda: deque(maxlen=_HELD))
    reasons: Counter[str] = field(default_factory=Counter)
    seen: dict[int, int] = field(default_factory=dict)

    def unwrap(self, number: int) -> int:
        """Return a number of 32 bits as the one nearest to the stream's last."""
        return unwrap(number, self.line.number)

    def take(self, packet: Packet) -> None:
        """Take a sample that fits, its number unwrapped."""
        self.line.take(packet.number, packet.time)
        self.last = max(self.last, packet.time)
        self.count += 1
        self.seen[packet.number] = hash(packet[1:3])
        if len(self.seen) > _SEEN:
            del self.seen[next(iter(self.seen))]

    def possible(self, packet: Packet) -> bool:
        """Say whether increments are possible over the stream's interval."""
        if self.key[2] != "increments":
            return True
        most = 2.0 * self.line.interval
        return (
            max(map(abs, packet.values[:3])) <= LARGEST_RATE * most
            and max(map(abs, packet.values[3:])) <= LARGEST_FORCE * most
        )
