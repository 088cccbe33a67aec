"""`LiveSession`: whatever comes from a network, a port or a pipe, to the best alignment of it.

A session parses what comes, follows one stream of samples, and aligns its spans: a span ends where
samples cannot be joined, as when the sender restarted or its clock stepped. The longest span that
could be aligned is the result. Nothing that a packet contains, and no fault of the checkpoint's
disk, ends a session.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler.alignment.checkpoint import read_checkpoint
from schuler.alignment.live import LiveAligner
from schuler.alignment.method import Method
from schuler.alignment.result import Alignment
from schuler.constants import EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError, located
from schuler.io.packets import KINDS, Packet, PacketParser
from schuler.io.packets import REASONS as PACKET_REASONS
from schuler.io.streams import REASONS as STREAM_REASONS
from schuler.io.streams import Part, Streams
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["LiveSession", "Outcome", "SpanFix"]

_CONTRADICTS = 4.0
"""Sigmas of the difference between two spans' headings."""

_TELLS = 10.0
"""Sigma of the heading beyond which a span has no heading, deg."""


@dataclass(frozen=True)
class SpanFix:
    """The alignment of one span.

    Parameters
    ----------
    alignment : Alignment
    span : int
        Which span, from 1.
    """

    alignment: Alignment
    span: int


@dataclass(frozen=True)
class Outcome:
    """What a session ends with.

    Parameters
    ----------
    best : SpanFix
        The longest span that could be aligned.
    spans : int
        Spans in all.
    contradictions : tuple of str
        Why the result is not to be trusted as it is; empty where nothing contradicts it.
    """

    best: SpanFix
    spans: int
    contradictions: tuple[str, ...]


class LiveSession:
    r"""Align what comes; end with the best result.

    Parameters
    ----------
    site : Site
    kind : {"rates", "mean-rates", "increments"}
        What the values of CSV lines are; frames say it themselves.
    method, spec, depth, max_gap
        As of `LiveAligner`.
    key : bytes, optional
        The shared key: only frames that it authenticates are taken.
    only : str, optional
        Address, or address and port, that datagrams are taken from.
    checkpoint : path, optional
        The state is saved here, and taken up where there is one.
    cold_start : bool
        Begin anew where the checkpoint is refused; the file is kept under another name.

    Raises
    ------
    InputError
        As `LiveAligner`, and for a checkpoint that is refused.

    Examples
    --------
    >>> session = LiveSession(Site(50.0), "rates")
    >>> session.feed(b"0,0.00,0,0,0,0,0,9.8\n")
    >>> session.counts()["aligned"]
    0
    """

    def __init__(
        self,
        site: Site,
        kind: str = "increments",
        method: Method | str | None = None,
        spec: ImuSpec | str | Path | None = None,
        *,
        depth: int = 64,
        max_gap: float = 5.0,
        key: bytes | None = None,
        only: str | None = None,
        checkpoint: str | Path | None = None,
        cold_start: bool = False,
    ) -> None:
        self._site, self._method, self._spec = site, method, spec
        self._options = {"depth": depth, "max_gap": max_gap}
        self._only = only
        self._checkpoint = None if checkpoint is None else Path(checkpoint)
        self._parser = PacketParser(key)
        self._streams = Streams(kind, max_gap)
        self._live: LiveAligner = self._aligner(kind)
        self._counts: Counter[str] = Counter()
        self._notes: list[str] = []
        self._best: SpanFix | None = None
        self._refused: InputError | None = None
        self._save_failed = False
        self._counted = True
        self.spans = 0
        self.packets = 0
        if self._checkpoint is not None:
            self._live.check_saved()
        if self._checkpoint is not None and os.path.lexists(self._checkpoint):
            self._resume(self._checkpoint, cold_start)

    def _aligner(self, kind: str) -> LiveAligner:
        return LiveAligner(self._site, kind, self._method, self._spec, **self._options)  # type: ignore[arg-type]

    def _resume(self, path: Path, cold_start: bool) -> None:
        try:
            kind = read_checkpoint(path, self._live.largest_state)[0].get("kind")
            live = self._aligner(kind if kind in KINDS else self._live.intake.kind)
            more = live.load(path)
            with located(path):
                self._streams.resume(more.get("stream"), live.recent())
                self._take_more(more)
        except InputError as error:
            # A device or a pipe is not put aside: it is not the file of a state.
            path = path.resolve()
            if cold_start and path.exists() and not path.is_file():
                raise
            if not cold_start:
                raise InputError(
                    f"{error}; --cold-start begins anew and keeps the file under another name"
                ) from None
            aside = _free_name(path)
            try:
                path.rename(aside)
            except OSError as failed:
                raise InputError(
                    f"{path}: was refused, and cannot be renamed ({failed.strerror or failed})"
                ) from None
            self._notes.append(f"{error}; the file is kept as {aside.name}, and a cold start made")
            return
        self._live, self._counted = live, False
        self.spans = 1
        self._notes.append(f"resumed from {path}, after {live.samples} samples")

    def _more(self) -> dict[str, Any]:
        """Return what else belongs to a saved state, for JSON."""
        return {}

    def _take_more(self, more: dict[str, Any]) -> None:
        """Take up what else was saved; an `InputError` where it is damaged."""

    def warm_up(self) -> None:
        """Compile or load all that an alignment needs, before samples come that would be lost."""
        aligner = self._aligner("increments")
        step, gravity = 0.01, self._site.gravity
        level, up = (
            EARTH_RATE * np.cos(self._site.latitude),
            EARTH_RATE * np.sin(self._site.latitude),
        )
        values = (0.0, step * level, step * up, 0.0, 0.0, step * gravity)
        aligner.push((k, step * k, values) for k in range(600))
        try:
            aligner.finish()
            aligner.solution()
        except InputError:
            # So short a stretch may tell the method nothing.
            return

    # -- samples -----------------------------------------------------------------------

    def feed(self, data: bytes, address: str | None = None, now: float | None = None) -> None:
        """Take bytes of a stream, or a datagram.

        Parameters
        ----------
        data : bytes
        address : str, optional
            ``ADDRESS:PORT`` of a datagram's sender; None for bytes of a stream.
        now : float, optional
            A clock at their arrival, s; None where arrival says nothing about time, as in a file.
        """
        if self._only is not None and address is not None:
            host = address.rpartition(":")[0]
            if self._only not in (address, host):
                self._counts["foreign"] += 1
                return
        parser = self._parser
        packets = parser.feed(data) if address is None else parser.datagram(data)
        self.packets += len(packets)
        for part in self._streams.push(packets, address, now):
            self._take(part)

    def _take(self, part: Part) -> None:
        change = part.change
        if change is not None:
            if not change.continues:
                self._begin_span(change.kind)
            then = "the gap is bridged" if change.continues else f"span {self.spans} begins"
            self._notes.append(f"{change.text}; {then}" if self.spans > 1 or change.continues
                               else change.text)  # fmt: skip
        for samples in _without_gaps(part.samples, self._options["max_gap"]):
            if samples[0] is not part.samples[0]:
                self._begin_span(self._live.intake.kind)
                self._notes.append(
                    f"no sample came before t = {time_text(samples[0].time)} s for longer than "
                    "can be "
                    f"bridged; span {self.spans} begins"
                )
            try:
                self._live.push(samples)
            except InputError as error:
                self._begin_span(self._live.intake.kind)
                self._notes.append(f"{error}; span {self.spans} begins")

    def _begin_span(self, kind: str) -> None:
        if self.spans:
            self._end_span()
        self.spans += 1
        self._live, self._counted = self._aligner(kind), False

    def _end_span(self) -> None:
        """Take what the span under way still holds, and keep its result where it is the best."""
        live = self._live
        try:
            live.finish()
        except InputError as error:
            self._refused = error
        counts = live.counts()
        del counts["held"]
        self._counts.update(counts)
        self._counted = True
        found = self._solve()
        if found is not None:
            self._best = self._better(found)

    def _solve(self) -> SpanFix | None:
        try:
            return SpanFix(self._live.solution(), self.spans)
        except (InputError, ArithmeticError, np.linalg.LinAlgError) as error:
            self._refused = error if isinstance(error, InputError) else InputError(str(error))
            return None

    def _better(self, found: SpanFix) -> SpanFix:
        if self._best is None or found.alignment.duration >= self._best.alignment.duration:
            return found
        return self._best

    # -- results -----------------------------------------------------------------------

    @property
    def samples(self) -> int:
        """Samples of the span under way that were aligned."""
        return self._live.samples

    @property
    def trouble(self) -> str | None:
        """Why the span under way could not be aligned at the last try, or None."""
        return None if self._refused is None else str(self._refused)

    def solution(self) -> SpanFix | None:
        """Return the alignment of the span under way, of the best span before it, or None."""
        self._refused = None
        return (self._solve() if self._live.samples else None) or self._best

    def counts(self) -> dict[str, int]:
        """Return what became of the packets and samples of all spans.

        ``damaged`` is the sum of ``checksum`` and ``malformed``; all other counts are apart.
        """
        # An ended span is in the sums already.
        now = Counter() if self._counted else Counter(self._live.counts())
        total = self._counts + now + self._streams.counts + self._parser.counts
        names = ("aligned", "lost", "repeated", "late", "held")
        out = {name: total[name] for name in names}
        out["damaged"] = self._parser.damaged
        return {**out, **{n: total[n] for n in (*PACKET_REASONS, *STREAM_REASONS)}}

    def summary(self) -> str:
        """Return the counts that are not zero as ``5990 aligned, 3 checksum``."""
        counts = self.counts()
        del counts["damaged"]
        said = [f"{n} {name.replace('_', ' ')}" for name, n in counts.items() if n or name in
                ("aligned", "lost")]  # fmt: skip
        return ", ".join(said)

    def take_notes(self) -> list[str]:
        """Return what happened since the last call, in sentences."""
        notes = [*self._notes, *self._streams.notes]
        self._notes, self._streams.notes = [], []
        return notes

    def save(self) -> None:
        """Save the state where a checkpoint was asked for; a failure is a note, once."""
        if self._checkpoint is None or not self.spans:
            return
        try:
            self._live.save(self._checkpoint, stream=self._streams.describe(), **self._more())
        except InputError as error:
            if not self._save_failed:
                self._notes.append(f"the state is not saved: {error}; the alignment continues")
            self._save_failed = True
            return
        if self._save_failed:
            self._notes.append(f"the state is saved again: {self._checkpoint}")
        self._save_failed = False

    def finish(self, now: float | None = None) -> Outcome:
        """End the session: save the state, take what is held, return the best result.

        Raises
        ------
        InputError
            If nothing could be aligned, saying what came.
        """
        for part in self._streams.finish(now):
            self._take(part)
        # What is held is not aligned yet: a later session takes it from here.
        self.save()
        if not self.spans:
            came = [f"{n} {STREAM_REASONS.get(k) or PACKET_REASONS.get(k, k)}"
                    for k, n in self.counts().items() if n and k != "damaged"]  # fmt: skip
            if not came:
                raise InputError("no sample came")
            raise InputError(f"no sample could be used of those that came: {', '.join(came)}")
        newest, self._refused = self._live, None
        before = self._best
        self._end_span()
        if self._best is None:
            raise InputError(f"{self.trouble} (of what came: {self.summary()})")
        return Outcome(self._best, self.spans, tuple(self._contradictions(newest, before)))

    def _contradictions(self, newest: LiveAligner, before: SpanFix | None) -> list[str]:
        assert self._best is not None
        out: list[str] = []
        # An alignment may tell by itself that it is not consistent.
        if getattr(self._best.alignment, "consistent", True) is False:
            out.append("the alignment is not consistent with its own uncertainty")
        if before is None:
            return out
        last = None if self._refused is not None else newest.solution()
        why = str(self._refused)
        if last is not None and last.sigma_arcmin[2] > 60.0 * _TELLS:
            why = f"too few: sigma of the heading is {last.sigma_arcmin[2] / 60:.0f} deg"
            last = None
        if last is None:
            out.append(
                f"the result is that of span {self._best.span}; the {newest.samples} samples that "
                f"came last, span {self.spans}, could not be aligned ({why})"
            )
            return out
        return [*out, *self._apart(last, before)]

    def _apart(self, last: Alignment, before: SpanFix) -> list[str]:
        """Say whether the headings of two spans contradict each other."""
        other = before.alignment
        off = (last.heading_deg - other.heading_deg + 180.0) % 360.0 - 180.0
        sigma = float(np.hypot(last.sigma_arcmin[2], other.sigma_arcmin[2])) / 60.0
        if abs(off) <= _CONTRADICTS * sigma:
            return []
        return [
            f"span {self.spans} has the heading {last.heading_deg:.3f} deg, and span "
            f"{before.span} {other.heading_deg:.3f} deg: {abs(off) / sigma:.1f} sigma apart"
        ]


def _without_gaps(samples: list[Packet], max_gap: float) -> Iterator[list[Packet]]:
    """Yield the samples in pieces between gaps that are too long to be bridged."""
    first = 0
    for k in range(1, len(samples)):
        if samples[k].time - samples[k - 1].time > max_gap:
            yield samples[first:k]
            first = k
    yield samples[first:] if first else samples


def _free_name(path: Path) -> Path:
    """Return a name beside a file that no file has."""
    for k in range(1, 10_000):
        aside = path.with_name(f"{path.name}.refused{'' if k == 1 else f'-{k}'}")
        if not aside.exists():
            return aside
    raise InputError(f"{path}: there are 10,000 refused files beside it; remove them")
