"""Which of the samples that come belong together: one source, one kind, numbers and times in step.

A stream is a source's samples of one kind whose numbers and times lie on one line, as they do when
a sender counts its samples and reads one clock. The stream that is aligned is chosen by a stretch
of such samples, never by the first bytes. A sample that does not lie on its line is a candidate
of another stream; it is dropped, and counted by reason, when the stream goes on. Only when the
stream is silent and a candidate has a stretch of its own, as after a restart of the sender or a
step of its clock, does the candidate take its place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from schuler.errors import InputError
from schuler.io.candidates import Candidates
from schuler.io.number_line import (
    LONGEST,
    PERIOD,
    SHORTEST,
    STRETCH,
    WINDOW,
    Line,
    Stream,
)
from schuler.io.packets import KINDS, LARGEST_TIME, Packet

__all__ = ["Change", "Part", "Streams"]

ENOUGH = 256
"""Samples of another stream that replace a silent one where no clock measures the silence."""

SILENCE = 2.0
"""Time without a sample after which a stream may be replaced, s."""

_MISSED = 8.0
"""A slow stream is silent after so many intervals."""

#: why a sample was left out -> what is said of it
REASONS = {
    "foreign": "of another source",
    "other_kind": "of another kind",
    "wrong_number": "with a number far off",
    "wrong_time": "whose time contradicts their number",
    "replayed": "of a run that is over",
    "out_of_range": "with a value that no stationary vehicle gives",
    "unconfirmed": "in no stream of numbers and times in step",
}


@dataclass(frozen=True)
class Change:
    """A stream has taken the place of the one before.

    Parameters
    ----------
    text : str
        What happened.
    kind : str
        What the values of the new stream are.
    continues : bool
        Whether its samples follow those of the stream before, with a gap between them.

    Examples
    --------
    >>> Change("the sender restarted, at number 0", "increments", continues=False).kind
    'increments'
    """

    text: str
    kind: str
    continues: bool


@dataclass(frozen=True)
class Part:
    """Samples to align, with what happened before them."""

    samples: list[Packet]
    change: Change | None = None


class Streams:
    """Choose the stream that is aligned, and follow it.

    Parameters
    ----------
    kind : {"rates", "mean-rates", "increments"}
        What the values of CSV lines are.
    max_gap : float
        Longest gap after which a stream goes on, s.

    Examples
    --------
    >>> streams = Streams("increments", max_gap=5.0)
    >>> values = (0.0, 0.0, 1e-6, 0.0, 0.0, 0.49)
    >>> parts = streams.push(Packet(k, 0.05 * k, values) for k in range(40))
    >>> sum(len(part.samples) for part in parts)
    40
    """

    def __init__(self, kind: str, max_gap: float) -> None:
        self.kind = kind
        self.max_gap = max_gap
        self.counts: Counter[str] = Counter()
        self.notes: list[str] = []
        self.stream: Stream | None = None
        self._candidates = Candidates(self.counts)
        self._heard = float("-inf")
        self._ignored: set[str] = set()
        self._resumed = False

    def push(
        self, packets: Iterable[Packet], source: str | None = None, now: float | None = None
    ) -> list[Part]:
        """Take packets of a source as they came; return what is to be aligned.

        Parameters
        ----------
        packets : iterable of Packet
        source : str, optional
            Where they came from.
        now : float, optional
            A clock at their arrival, s; None where arrival says nothing about time, as in a file.
        """
        out: list[Part] = []
        samples: list[Packet] = []
        for packet in packets:
            taken = self._sort(packet, source, now)
            if isinstance(taken, Packet):
                samples.append(taken)
            elif taken is not None:
                out += [Part(samples), taken] if samples else [taken]
                samples = []
        return [*out, Part(samples)] if samples else out

    def finish(self, now: float | None = None) -> list[Part]:
        """Return what is to be aligned at the end: a candidate's stretch, after a silence."""
        part = self._promote(now, ending=True)
        for candidate in self._candidates:
            self.counts += candidate.reasons
        self._candidates.clear()
        return [] if part is None else [part]

    def _sort(self, packet: Packet, source: str | None, now: float | None) -> Packet | Part | None:
        stream = self.stream
        form = "lines" if packet.kind is None else "frames"
        key = (source, form, packet.kind or self.kind, packet.run)
        if stream is None:
            reason = "unconfirmed"
        elif packet.run < stream.key[3]:
            self.counts["replayed"] += 1
            return None
        elif key == stream.key:
            found = self._follow(stream, packet, now)
            if not isinstance(found, str):
                return found
            reason = found
        elif source != stream.key[0]:
            reason = "foreign"
        else:
            # A new run of the sender is on its way to replace the old one.
            reason = "other_kind" if packet.run == stream.key[3] else "unconfirmed"
        near = stream.line.number if stream is not None else 0
        self._candidates.offer(packet, key, reason, near)
        return self._promote(now)

    def _follow(self, stream: Stream, packet: Packet, now: float | None) -> Packet | str | None:
        """Return the packet where it continues the stream, or the reason why it does not."""
        number = stream.unwrap(packet.number)
        top = stream.line.number
        if number in stream.seen:
            if stream.seen[number] == hash(packet[1:3]):
                self.counts["repeated"] += 1
                self._candidates.drop_replay(stream.key, packet.number)
                return None
            return "wrong_number"
        fits = stream.line.fits(number, packet.time)
        if abs(number - top) > WINDOW:
            if number < top and fits:
                # Nobody but the sender can continue a run that has a key.
                if packet.run:
                    self.counts["late"] += 1
                    return None
                return "late"
            return "wrong_number"
        if not fits or packet.time - stream.last > self.max_gap:
            return "wrong_time"
        if self._candidates.restarted(stream.key, packet.number):
            return "wrong_number"
        if not stream.possible(packet):
            self.counts["out_of_range"] += 1
            return None
        if number // PERIOD > top // PERIOD:
            self.notes.append("the sender's numbers wrapped at 2^32 and go on from 0")
        packet = packet._replace(number=number)
        stream.take(packet)
        if number > top:
            self._resumed = False
            self._heard = float("-inf") if now is None else now
            self._drop()
        return packet

    def _drop(self) -> None:
        """Drop the candidates: the stream goes on."""
        if not self._candidates or self.stream is None:
            return
        key = self.stream.key
        for candidate in self._candidates:
            source = candidate.key[0]
            early = candidate.reasons["unconfirmed"]
            if early and candidate.key[3] <= key[3]:
                # It came before there was a stream to tell it from.
                del candidate.reasons["unconfirmed"]
                same = "wrong_number" if candidate.key == key else "other_kind"
                candidate.reasons["foreign" if source != key[0] else same] += early
            self.counts += candidate.reasons
            if not candidate.reasons["foreign"] or source in self._ignored:
                continue
            # A flood of senders is not a flood of notes.
            if len(self._ignored) < 10:
                self._ignored.add(str(source))
                self.notes.append(
                    f"samples of {source} are left out: they are not of the source that is aligned"
                )
        self._candidates.clear()

    def _promote(self, now: float | None, ending: bool = False) -> Part | None:
        """Let the candidate with the longest stretch take the place of a silent stream."""
        best = self._candidates.longest()
        if best is None or best.count < STRETCH:
            return None
        if self.stream is not None:
            if self._heard == float("-inf") and now is not None:
                self._heard = now
            # After a resumption a file may be read from its start again.
            again = self._resumed and 2 * best.reasons["late"] > best.count
            by_count = ending or (best.count >= ENOUGH and not again)
            silence = max(SILENCE, _MISSED * self.stream.line.interval)
            silent = by_count if now is None else now - self._heard >= silence
            if not silent:
                return None
        # A candidate that found no line is not tried with each sample again.
        if best.count > WINDOW and best.count % WINDOW and not ending:
            return None
        found = self._candidates.gather(best)
        if found is None:
            return None
        stream, samples = found
        change = self._change(stream, samples[0])
        before, self.stream = self.stream, stream
        kept = [p for p in samples if stream.possible(p)]
        self.counts["out_of_range"] += len(samples) - len(kept)
        self._resumed = False
        if before is not None and change.continues:
            stream.seen = {**before.seen, **stream.seen}
        self._heard = float("-inf") if now is None else now
        self._drop()
        return Part(kept, change)

    def _change(self, new: Stream, first: Packet) -> Change:
        source, form, kind, run = new.key
        where = "" if source is None else f" of {source}"
        old = self.stream
        if old is None:
            rate = f"{1.0 / new.line.interval:.4g} Hz"
            return Change(f"{form}{where} are aligned: {kind}, {rate}", kind, False)
        number = old.unwrap(first.number)
        gap = first.time - old.last
        on_line = number > old.line.number and old.line.fits(number, first.time)
        same = (kind, run) == old.key[2:]
        continues = same and on_line and 0.0 < gap <= self.max_gap
        raw = number % PERIOD
        if source != old.key[0]:
            before = "that was followed" if old.key[0] is None else old.key[0]
            text = f"the source {before} is silent, and samples{where} are taken in its place"
        elif kind != old.key[2]:
            text = f"the sender sends {kind} now, in place of {old.key[2]}"
        elif run != old.key[3] or number <= old.line.number - WINDOW or number in old.seen:
            text = f"the sender restarted, at number {raw}"
        elif on_line:
            text = f"no sample came for {gap:.4g} s"
        elif abs(number - old.line.number) <= WINDOW:
            step = first.time - old.line.time - old.line.interval * (number - old.line.number)
            text = f"the sender's clock stepped by {step:+.4g} s at number {raw}"
        else:
            text = f"the sender's numbers jumped to {raw}"
        return Change(text, kind, continues)

    # -- saving ------------------------------------------------------------------------

    def describe(self) -> dict[str, Any] | None:
        """Return what a later object needs to follow the stream, for JSON."""
        s = self.stream
        if s is None:
            return None
        return {
            "key": list(s.key), "number": s.line.number, "time": s.line.time,
            "interval": s.line.interval, "last": s.last,
        }  # fmt: skip

    def resume(self, said: Any, recent: Iterable[tuple[int, float, tuple[float, ...]]]) -> None:
        """Follow the stream that `describe` told of.

        Parameters
        ----------
        said : dict
        recent : iterable of sample
            The last samples, that are known when they come again.

        Raises
        ------
        InputError
            If it is no such description.
        """
        try:
            source, form, kind, run = said["key"]
            numbers = [float(said[name]) for name in ("time", "interval", "last")]
            holds = (
                (source is None or isinstance(source, str))
                and form in ("lines", "frames")
                and kind in KINDS
                and type(run) is int
                and 0 <= run < 1 << 64
                and type(said["number"]) is int
                and 0 <= said["number"] < 2**53
                and all(abs(v) <= 2.0 * LARGEST_TIME for v in numbers)
                and SHORTEST <= numbers[1] <= LONGEST
            )
        except (TypeError, KeyError, ValueError, OverflowError):
            holds = False
        if not holds:
            raise InputError("does not say which stream it follows; start anew with another file")
        stream = Stream((source, form, kind, run), last=numbers[2], count=STRETCH)
        stream.line = Line(said["number"], numbers[0], numbers[1])
        stream.line.settle()
        stream.seen = {number: hash((time, values)) for number, time, values in recent}
        self.stream, self._resumed = stream, True
