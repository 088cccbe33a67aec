"""Candidates of a stream: samples that lie on no line so far, sorted to those that they fit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from schuler.io.number_line import STRETCH, WINDOW, Key, Stream, robust_line, unwrap
from schuler.io.packets import Packet

__all__ = ["Candidates"]

_MOST = 32
"""Candidates that are kept: forged packets make one each."""


class Candidates:
    """Streams that may take the place of the one that is aligned.

    Parameters
    ----------
    counts : Counter
        Samples that were left out, by reason; added to.
    """

    def __init__(self, counts: Counter[str]) -> None:
        self.counts = counts
        self._streams: list[Stream] = []

    def __iter__(self) -> Iterator[Stream]:
        return iter(self._streams)

    def __bool__(self) -> bool:
        return bool(self._streams)

    def clear(self) -> None:
        """Forget all."""
        self._streams = []

    def longest(self) -> Stream | None:
        """Return the candidate with the most samples."""
        return max(self._streams, key=lambda c: c.count, default=None)

    def drop_replay(self, key: Key, number: int) -> None:
        """Drop the candidate that led up to a sample that was seen: a sender sent it all again."""
        for candidate in [c for c in self._streams if c.key == key]:
            if candidate.unwrap(number) == candidate.line.number + 1:
                self.counts["late"] += candidate.count
                self._streams.remove(candidate)

    def restarted(self, key: Key, number: int) -> bool:
        """Say whether a packet is the next of a candidate that counts its way up again."""
        return any(
            c.key == key and c.count >= STRETCH and c.unwrap(number) == c.line.number + 1
            for c in self._streams
        )

    def offer(self, packet: Packet, key: Key, reason: str, near: int) -> None:
        """Give a packet to the candidate that it fits, or make one of it with a number near one."""
        for candidate in self._streams:
            if candidate.key != key:
                continue
            number = candidate.unwrap(packet.number)
            if candidate.seen.get(number) == hash(packet[1:3]):
                self.counts["repeated"] += 1
                return
            close = abs(number - candidate.line.number) <= WINDOW
            if close and number not in candidate.seen and candidate.line.fits(number, packet.time):
                break
        else:
            candidate = Stream(key)
            number = unwrap(packet.number, near)
            self._streams.append(candidate)
            if len(self._streams) > _MOST:
                # The one with the fewest samples; of several the oldest.
                weakest = min(self._streams[:-1], key=lambda c: c.count)
                self._streams.remove(weakest)
                self.counts += weakest.reasons
        packet = packet._replace(number=number)
        candidate.take(packet)
        candidate.held.append((packet, reason))
        candidate.reasons[reason] += 1

    def gather(self, best: Stream) -> tuple[Stream, list[Packet]] | None:
        """Return the stream that most samples of a candidate make, with those of the others on it.

        The first samples may have been sorted to a forged one: what counts is the line that is
        found with all of them at hand.
        """
        line = robust_line([packet for packet, _ in best.held])
        if line is None:
            return None
        stream = Stream(best.key, line)
        numbers = [packet.number for packet, _ in best.held]
        low, high = min(numbers) - WINDOW, max(numbers) + WINDOW
        on_line: dict[int, Packet] = {}
        for candidate in (best, *self._streams):
            if candidate.key == best.key:
                for packet, _ in candidate.held:
                    near = low <= packet.number <= high
                    if near and line.fits(packet.number, packet.time):
                        on_line.setdefault(packet.number, packet)
        if len(on_line) < STRETCH:
            return None
        for candidate in self._streams:
            for packet, reason in candidate.held:
                if on_line.get(packet.number) is packet:
                    candidate.reasons[reason] -= 1
        samples = [on_line[number] for number in sorted(on_line)]
        for packet in samples:
            stream.take(packet)
        return stream, samples
