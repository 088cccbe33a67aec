"""A short live stream, and a session that it is fed to with a clock of its own."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from schuler.alignment import LiveSession
from schuler.earth import Site
from schuler.io.packets import encode_frame
from schuler.motion import Static
from schuler.sensors import GRADES
from schuler.simulation import simulate

SITE = Site(50.0)
RATE = 50.0
HEADING = 75.0
SENDER = "192.0.2.7:5005"


def make_samples(seconds: float = 60.0) -> list[tuple[int, float, tuple[float, ...]]]:
    """Return number, time and increments of a base at rest, heading 75 deg."""
    rng = np.random.default_rng(3)
    record = simulate(Static(HEADING), SITE, seconds, RATE, GRADES["navigation-rlg"], rng).record
    values = np.hstack([record.dtheta, record.dvel])
    return [
        (k, float(t), tuple(map(float, v)))
        for k, (t, v) in enumerate(zip(record.time, values, strict=True))
    ]


def frame(item, **options) -> bytes:
    """Return the frame of a sample."""
    return encode_frame(*item, "increments", **options)


@dataclass
class Feed:
    """A session with a clock that advances at each sample, as of a sender in real time."""

    session: LiveSession
    now: float = 100.0
    notes: list[str] = field(default_factory=list)

    def real(self, items, address=SENDER, **options) -> None:
        """Send samples at their rate."""
        for item in items:
            self.now += 1.0 / RATE
            self.burst([frame(item, **options)], address)

    def burst(self, packets, address=SENDER) -> None:
        """Send datagrams at once."""
        for packet in packets:
            self.session.feed(packet, address, self.now)

    def end(self):
        """End the session, some time after the last sample."""
        outcome = self.session.finish(self.now + 5.0)
        self.notes = self.session.take_notes()
        return outcome

    def said(self, text: str) -> bool:
        return any(text in note for note in self.notes)


def make_session(**options) -> LiveSession:
    """Return a session of the stream's site and instrument."""
    return LiveSession(SITE, "increments", "centred", "navigation-rlg", **options)


def right(fix) -> bool:
    """Say whether a heading is the stream's, within its own uncertainty."""
    return abs(fix.heading_deg - HEADING) * 60.0 < 4.0 * fix.sigma_arcmin[2]
