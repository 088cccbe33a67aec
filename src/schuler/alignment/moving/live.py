"""Alignment in motion of samples and NMEA fixes as they come: a `LiveSession` with aids."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._version import __version__
from schuler.aiding.fix_rows import COLUMNS, PLACE, SIGMA, TIME, V_N, V_SIGMA
from schuler.aiding.stream_clock import StreamClock
from schuler.alignment.live import LiveAligner
from schuler.alignment.live_layout import check_packets
from schuler.alignment.moving.stream import MovingStream
from schuler.alignment.moving.stream_setting import StreamSetting
from schuler.alignment.result import Alignment
from schuler.alignment.session import LiveSession, Outcome, SpanFix
from schuler.earth import Site
from schuler.errors import InputError
from schuler.io.gnss.nmea_stream import REASONS, NmeaStream, apart
from schuler.record import Intake

__all__ = ["LiveAids", "MovingLiveAligner", "MovingLiveSession"]

Array = NDArray[np.float64]

_OFF, _AHEAD = 10.0, 2.0
"""A fix that is so long before the samples, or (where both come as they are measured) so long
after them, has another clock, s."""

_FAR_AHEAD = 3600.0
"""The same in a pipe, where one may come long before the other, s."""

_OF_SPANS = ("fixes", "repeated_fixes", "surplus_fixes")
"""Counts of each span's own stream."""

_EARLY = 1000
"""Fixes that wait for the first sample."""

_LARGEST_STATE = 256 << 20
"""Bytes of a saved state: the samples that are kept are in it."""


@dataclass(frozen=True)
class LiveAids:
    """What a live alignment in motion takes beside the samples.

    Parameters
    ----------
    clock : StreamClock
        How the samples' times and UTC are brought together.
    setting : StreamSetting
    sigma, v_sigma, height
        As of `NmeaStream`.
    mixed : bool
        Whether the sentences are in the stream of the samples.
    only : str, optional
        Address, or address and port, that sentences are taken from.

    Examples
    --------
    >>> aids = LiveAids(StreamClock("arrival", error=0.05), StreamSetting(spec))
    >>> aids.stream_setting.antenna.estimate
    ('delay',)
    """

    clock: StreamClock
    setting: StreamSetting
    sigma: float | None = None
    v_sigma: float | None = None
    height: str | None = None
    mixed: bool = False
    only: str | None = None

    @property
    def stream_setting(self) -> StreamSetting:
        """The setting, with a delay that is estimated where fixes are stamped at their arrival."""
        error = self.clock.error
        if error is None:
            return self.setting
        antenna = self.setting.antenna
        estimate = tuple(sorted({*antenna.estimate, "delay"}))
        return replace(self.setting, antenna=replace(antenna, estimate=estimate, delay_sigma=error))


class MovingLiveAligner(LiveAligner):
    """Take the samples of one stream in any order, and fixes; give the alignment at any time.

    Parameters
    ----------
    aids : LiveAids
    kind, depth, max_gap
        As of `LiveAligner`.

    Raises
    ------
    InputError
        As `MovingStream`.
    """

    largest_state = _LARGEST_STATE

    def __init__(
        self, aids: LiveAids, kind: str = "increments", *, depth: int = 64, max_gap: float = 0.5
    ) -> None:
        self.moving = MovingStream(aids.stream_setting)
        self._aids = aids
        self._begin(self.moving, kind, depth, max_gap)

    @property
    def newest(self) -> float | None:
        """Time of the last sample that came in order, s; None without one."""
        recent = self.recent()
        return max(sample[1] for sample in recent) if recent else None

    def finish(self) -> None:
        """Take what is still held: the stream has ended."""
        super().finish()
        self.moving.finish()

    def _meta(self) -> dict[str, Any]:
        setting = self._aids.stream_setting
        antenna = {**asdict(setting.antenna), "lever": list(np.asarray(setting.antenna.lever))}
        return {
            "schuler": __version__, "kind": self.intake.kind, "spec": self.moving.spec.describe(),
            "antenna": antenna, "clock": asdict(self._aids.clock), "keep": setting.keep,
            "latency": setting.latency, "vibration": setting.vibration,
            "sigma": [self._aids.sigma, self._aids.v_sigma],
        }  # fmt: skip

    def check_saved(self) -> None:
        """Do nothing: the state of an alignment in motion can always be saved."""

    def _check(self, arrays: Mapping[str, Array]) -> None:
        check_packets(arrays, self.order.depth, self.intake.kind)


class MovingLiveSession(LiveSession):
    r"""Align what moves by what comes; end with the newest result.

    Parameters
    ----------
    aids : LiveAids
    kind, key, only, checkpoint, cold_start, depth, max_gap
        As of `LiveSession`.

    Raises
    ------
    InputError
        As `MovingLiveAligner`, and for a checkpoint that is refused.

    Examples
    --------
    >>> from schuler.alignment.moving.live import LiveAids
    >>> session = MovingLiveSession(LiveAids(StreamClock("utc"), StreamSetting(spec)), "rates")
    >>> session.feed_aid(b"$GPGGA,120000.00,,,,,0,,,,,,,*01\r\n")
    >>> session.aid_counts()["aid_checksum"]
    1
    """

    def __init__(
        self, aids: LiveAids, kind: str = "increments", *, depth: int = 64, max_gap: float = 0.5,
        key: bytes | None = None, only: str | None = None, checkpoint: str | Path | None = None,
        cold_start: bool = False,
    ) -> None:  # fmt: skip
        self._aids = aids
        self._nmea = NmeaStream(aids.sigma, aids.v_sigma, aids.height)
        self._aid_counts: Counter[str] = Counter()
        self._early: list[tuple[Array, float | None]] = []
        self._seen: tuple[float, float] | None = None
        self._last_row: Array | None = None
        self._rest = b""
        self._said: set[str] = set()
        self._real_time = False
        # The place is that of the fixes.
        super().__init__(
            Site(0.0), kind, depth=depth, max_gap=max_gap, key=key, only=only,
            checkpoint=checkpoint, cold_start=cold_start,
        )  # fmt: skip

    def _aligner(self, kind: str) -> MovingLiveAligner:
        depth, max_gap = self._options["depth"], self._options["max_gap"]
        return MovingLiveAligner(self._aids, kind, depth=int(depth), max_gap=max_gap)

    @property
    def _moving(self) -> MovingLiveAligner:
        assert isinstance(self._live, MovingLiveAligner)
        return self._live

    def _more(self) -> dict[str, Any]:
        last = None if self._last_row is None else self._last_row.tolist()
        return {
            "nmea": self._nmea.describe(), "last_fix": last, "fixes": dict(self._aid_counts),
            "rest": self._rest.decode("latin-1"),
        }  # fmt: skip

    def _take_more(self, more: dict[str, Any]) -> None:
        self._nmea.resume(more.get("nmea"))
        try:
            last = more["last_fix"]
            self._last_row = None if last is None else np.array(last, np.float64).reshape(COLUMNS)
            self._aid_counts = Counter({str(n): int(c) for n, c in more["fixes"].items()})
            self._rest = str(more["rest"]).encode("latin-1")
        except (KeyError, TypeError, ValueError, AttributeError):
            raise InputError("the saved state of a stream of fixes is damaged") from None

    def warm_up(self) -> None:
        """Compile or load all that an alignment needs, before samples come that would be lost."""
        step, turn, speed, radius = 0.02, 0.2, 10.0, 6.378e6
        aligner = MovingStream(StreamSetting("tactical-fog", keep=60.0))
        time = step * np.arange(1.0, 1001.0)
        rows = np.full((21, COLUMNS), np.nan)
        rows[:, TIME] = np.arange(21.0)
        angle = turn * rows[:, TIME]
        north, east = np.sin(angle), 1.0 - np.cos(angle)
        rows[:, PLACE] = np.column_stack([north, east, 0.0 * angle]) * speed / turn / radius
        rows[:, SIGMA], rows[:, V_SIGMA] = 3.0, 0.1
        rows[:, V_N] = speed * np.column_stack([np.sin(angle), np.cos(angle), 0.0 * angle])
        rates = np.tile([0.0, 0.0, -turn], (len(time), 1))
        force = np.tile([turn * speed, 0.0, 9.78], (len(time), 1))
        intake = Intake("mean-rates", name="warm-up")
        record = intake.push(np.asarray(time, np.float64), np.hstack([rates, force]))
        aligner.add(rows)
        try:
            aligner.update(record)
            aligner.finish()
            aligner.solution()
        except InputError:
            # So short a circle may be refused: what was needed is loaded all the same.
            return

    # -- samples and fixes -------------------------------------------------------------

    def feed(self, data: bytes, address: str | None = None, now: float | None = None) -> None:
        """Take bytes of a stream, or a datagram, of samples, or of both where they are mixed."""
        if not self._aids.mixed:
            self._samples(data, address, now)
            return
        parts, rest = apart(self._rest + data if address is None else data)
        if address is None:
            self._rest = rest
        elif rest:
            parts.append((False, rest))
        for sentence, part in parts:
            if sentence:
                self.feed_aid(part, None, now)
            else:
                self._samples(part, address, now)

    def _samples(self, data: bytes, address: str | None, now: float | None) -> None:
        super().feed(data, address, now)
        newest = self._moving.newest
        if newest is None:
            return
        if now is not None:
            self._real_time = True
            if self._seen is None or newest != self._seen[0]:
                self._seen = newest, now
        if self._early:
            early, self._early = self._early, []
            for row, arrived in early:
                self._take_row(row, arrived)

    def feed_aid(self, data: bytes, address: str | None = None, now: float | None = None) -> None:
        """Take bytes of NMEA sentences, or a datagram of them.

        Parameters
        ----------
        data : bytes
        address : str, optional
            Of a datagram's sender; None for bytes of a stream.
        now : float, optional
            The clock of `feed` at their arrival, s.
        """
        only = self._aids.only
        if only is not None and address is not None and only not in (
            address, address.rpartition(":")[0]
        ):  # fmt: skip
            self._aid_counts["foreign"] += 1
            return
        rows = self._nmea.feed(data) if address is None else self._nmea.datagram(data)
        for row in rows:
            self._take_row(row, now)

    def _take_row(self, row: Array, now: float | None) -> None:
        newest = self._moving.newest
        clock = self._aids.clock
        if newest is None:
            if len(self._early) < _EARLY:
                self._early.append((row, now))
            return
        near = newest
        if clock.kind == "arrival":
            if now is None or self._seen is None:
                self._leave(
                    "off_clock",
                    "a fix has no time of arrival: the clock arrival is for samples and fixes that "
                    "come as they are measured",
                )
                return
            near = self._seen[0] + now - self._seen[1]
        time = clock.on_record(float(row[TIME]), near)
        ahead = time - newest
        if ahead < -_OFF or ahead > (_AHEAD if self._real_time else _FAR_AHEAD):
            self._leave(
                "off_clock",
                f"a fix is {abs(ahead):.4g} s {'before' if ahead < 0.0 else 'after'} the newest "
                "sample: their clocks are not what --imu-time says (18 s: leap seconds; hours: a "
                "time zone)",
            )
            return
        row = row.copy()
        row[TIME] = time
        row, self._last_row = clock.widened(row, self._last_row), row
        if self._moving.moving.add(row[None]):
            self._leave(
                "late",
                "a fix came after the samples of its time had been taken: a longer --latency waits "
                "for such",
            )

    def _leave(self, reason: str, text: str) -> None:
        """Count what is left out; say it once."""
        self._aid_counts[reason] += 1
        if reason not in self._said:
            self._said.add(reason)
            self._notes.append(text)

    # -- results -----------------------------------------------------------------------

    def aid_counts(self) -> dict[str, int]:
        """Return what became of the fixes: of all spans those taken, and those left out."""
        counts = self._aid_counts + self._nmea.counts
        now = self._moving.moving.counts
        out = {"fixes": now["fixes"] + counts["fixes"], "waiting": len(self._early)}
        out["repeated"] = now["repeated_fixes"] + counts["repeated_fixes"]
        out["surplus"] = now["surplus_fixes"] + counts["surplus_fixes"]
        return {**out, **{n: counts[n] for n in ("late", "off_clock", "foreign", *REASONS)}}

    def summary(self) -> str:
        """Return the counts that are not zero, of samples and of fixes."""
        said = [
            f"{n} {name.replace('_', ' ')}" for name, n in self.aid_counts().items()
            if n or name == "fixes"
        ]  # fmt: skip
        return f"{super().summary()}; {', '.join(said)}"

    def _end_span(self) -> None:
        ended = self._moving.moving.counts
        super()._end_span()
        self._aid_counts.update({n: ended[n] for n in _OF_SPANS})
        ended.clear()

    def _better(self, found: SpanFix) -> SpanFix:
        # Where it was heading before the span began tells nothing of now.
        return found

    def finish(self, now: float | None = None) -> Outcome:
        """End the session: take what is held, return the newest result.

        Raises
        ------
        InputError
            If nothing could be aligned, saying what came.
        """
        if self._rest:
            rest, self._rest = self._rest, b""
            self._samples(rest, None, now)
        for row in self._nmea.finish():
            if self._aids.clock.kind != "arrival":
                # Its time of arrival is not known.
                self._take_row(row, None)
        return super().finish(now)

    def _apart(self, last: Alignment, before: SpanFix) -> list[str]:
        # Between two spans the vehicle may have turned.
        return []
