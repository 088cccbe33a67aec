"""`Source`: an opened file, read whole, in pieces of bounded memory, or while it grows."""

from __future__ import annotations

import time as wall
from collections.abc import Callable, Iterator
from dataclasses import replace
from logging import getLogger
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.apart import with_accelerometers
from schuler.io.axes import Axes
from schuler.io.clock import Clock, timed
from schuler.io.content import Content, wrapped
from schuler.io.flow import Whole, pieces, prefetch
from schuler.io.gyro_array import compare_gyros, say_gyros
from schuler.io.join import alternates, join, split_rows
from schuler.io.mapping import Mapping
from schuler.io.meaning import settle
from schuler.io.opening import PIPE, begin
from schuler.io.registry import find_reader
from schuler.io.span import RecordTime, Span
from schuler.io.spool import Unpacked
from schuler.record import ImuRecord, Intake, Quality
from schuler.record.check import Reading
from schuler.sensors.array_check import ArrayCheck

__all__ = ["Source"]

log = getLogger("schuler.io")

_POLL = 0.2


class Source:
    """A file that holds IMU samples, opened and understood, not yet read.

    Parameters
    ----------
    path : str or Path
        The file, or the folder of a ROS 2 bag; ``"-"`` is standard input (text).
    mapping : Mapping, optional
        What is known about the file. It wins over the sidecar ``FILE.toml`` beside the file, that
        over what the file says of itself, and that over the folder's ``schuler-mapping.toml``.
    max_gap : float, optional
        Longest gap that is bridged, s; six and a half sampling intervals when not given.
    keep_spikes : bool
        Take single bad samples as they are (`schuler.record.Intake`).
    wait : float, optional
        How long to wait for the first whole row of a text file that has only begun to grow, or
        for standard input's first byte, s; not at all, when not given.

    gyro_bias : float, optional
        What a gyro's bias may be (1 sigma, rad/s): the gyros of an array may differ by that.

    Attributes
    ----------
    path : Path
    format : str
        Name of the reader.
    kind : str
        ``"rates"``, ``"mean-rates"`` or ``"increments"``.
    assumed : list of str
        What was not given and was assumed: axes, units; each in a few words.
    contradictions : list of str
        What the record contradicts in itself and could not be resolved, as a faulty gyro of an
        array that cannot be told; may grow while reading.
    notes : list of str
        What was decided or dropped on the way; may grow while reading.
    position : (lat, lon, height) or None
        Degrees, degrees and m, where the file tells.
    rows : int or None
        Number of rows, where that is known without reading.
    size : int or None
        Bytes; None for standard input.

    Raises
    ------
    InputError
        If the file cannot be opened or understood; the sentence begins with its name.
    """

    def __init__(
        self,
        path: str | Path,
        mapping: Mapping | None = None,
        *,
        max_gap: float | None = None,
        keep_spikes: bool = False,
        wait: float | None = None,
        gyro_bias: float | None = None,
    ) -> None:
        self.path = Path(path)
        self._label = "standard input" if self.path == Path("-") else str(path)
        self._max_gap = max_gap
        self._gyro_bias = gyro_bias
        self._working: tuple[int, ...] | None = None
        self._keep_spikes = keep_spikes
        self._quality: Quality | None = None
        self._intake: Intake | None = None
        try:
            self._begun = begun = begin(self.path, mapping or Mapping(), wait)
            given, folder, self.size = begun.mapping, begun.folder, begun.size
            reader = find_reader(begun.named_as, begun.head, folder.merged(given).format)
            self.format = reader.name
            # The folder's units are for files that state none: the reader must not see them.
            plain = replace(folder, gyro=None, accel=None, time=None)
            said = plain.merged(given)
            apart = said.accel_file is not None or said.accel_topic is not None
            if apart:
                said = replace(said, sensor="gyro")
            opened = reader.open(begun.content, said)
            content = wrapped(opened)
            if apart:
                content = with_accelerometers(content, said, self.path, begun.content, max_gap)
            elif content.sample is not None and alternates(content.sample):
                content = join(*split_rows(content), given, max_gap, "other rows")
            self._meaning = settle(content, given, folder, max_gap)
            self._new_intake(content)  # refuses a bad max_gap now
        except InputError as error:
            raise InputError(f"{self._label}: {error}") from None
        except OSError as error:
            raise InputError(f"{self._label}: cannot be read ({error.strerror or error})") from None
        self._content = content
        self.kind = self._meaning.kind
        content.notes[:0] = begun.notes
        self.notes = content.notes
        self.assumed = self._meaning.assumed
        self.contradictions: list[str] = []
        self.position = content.position
        self.rows = content.rows
        log.debug("%s: %s; %s", self._label, self.format, self.meaning)

    def __repr__(self) -> str:
        return f"Source({self._label!r}, {self.format}: {self.meaning})"

    @property
    def mapping(self) -> Mapping:
        """What is said about the file, with every choice filled in."""
        m = self._meaning.mapping
        return m if m.rate is not None else replace(m, time=self._meaning.clock.unit)

    def how_read(self) -> dict[str, Any]:
        """Return what JSON says of how the values were read: ``read_as`` and ``assumed``."""
        return {"read_as": self.meaning, "assumed": list(self.assumed)}

    @property
    def meaning(self) -> str:
        """One sentence that says what the numbers are taken for."""
        return self._meaning.sentence

    @property
    def axes(self) -> Axes:
        """Where the file's axes point."""
        return self._meaning.axes

    @property
    def reading(self) -> Reading:
        """How the values were read, for a check of what they show."""
        return self._meaning.reading

    def _new_intake(self, content: Content) -> Intake:
        m = self._meaning.mapping
        default = "stdin" if self.path == Path("-") else self._begun.named_as.stem
        return Intake(
            self._meaning.kind,
            rate=m.rate,
            max_gap=self._max_gap,
            keep_spikes=self._keep_spikes,
            coning_corrected=bool(m.coning_corrected),
            sculling_corrected=bool(m.sculling_corrected),
            name=content.name if content.name is not None else default,
        )

    # -- reading -----------------------------------------------------------------------

    @property
    def quality(self) -> Quality | None:
        """What has been found so far; None before the first row."""
        if self._intake is None:
            return None
        return self._intake.quality()

    @property
    def progress(self) -> float:
        """Fraction of the file that has been read, 0 to 1."""
        return 0.0 if self._content.progress is None else self._content.progress()

    def chunks(
        self, size: int = 65536, *, start: RecordTime = None, stop: RecordTime = None
    ) -> Iterator[ImuRecord]:
        """Yield the samples in records of at most `size`, in bounded memory.

        Parameters
        ----------
        size : int
            Most samples in a piece; the samples do not depend on it.
        start, stop : float or str, optional
            Read only the rows of this stretch of the file's time, s; what lies outside is not
            checked. Samples are those whose interval's middle lies in it. A text that begins with
            a plus, ``"+60s"``, counts from the first row; a date and time is a Unix time.

        Raises
        ------
        InputError
            For a row that cannot be used, naming the file, the row and its time.
        """
        if size < 1:
            raise InputError(f"chunk size must be at least 1, got {size}")
        span = Span.of(start, stop)
        return self._chunks(size, span)

    def _chunks(self, size: int, span: Span) -> Iterator[ImuRecord]:
        self._intake = intake = self._new_intake(self._content)
        try:
            empty = True
            parts = (
                record.between(span.start, span.stop) if span.limited else record
                for record in self._records(intake, span)
            )
            for piece in pieces(parts, size):
                empty = False
                yield piece
            lost = intake.quality()
            if empty and lost.rows and lost.not_finite == lost.rows:
                raise InputError(
                    f"each of the {lost.rows} data rows has a value that is not a finite number, "
                    f"the first at {lost.first_not_finite}; name other columns with --columns"
                )
            if empty and span.limited:
                raise InputError(span.nothing())
        except InputError as error:
            raise self._named(error) from None
        except OSError as error:
            raise InputError(f"{self._label}: cannot be read ({error.strerror or error})") from None

    def _records(self, intake: Intake, span: Span) -> Iterator[ImuRecord]:
        check = self._check_array(span)
        done = kept = 0
        started = not span.begins
        past: list[int] = []
        clock = self._pass()
        # A thread that waits for standard input could not be ended.
        blocks = self._content.blocks()
        flow = blocks if self.path == Path("-") else prefetch(blocks)
        for block in timed(flow, clock):
            assert block is not None
            clock.check()
            time, values, dt = self._meaning.convert(block, done, clock, self._working)
            if check is not None:
                check.push(self._meaning.gyros(block, time))
            done += len(time)
            span.see(time)
            if not started:
                inside = np.flatnonzero(time >= span.first)
                if not len(inside):
                    intake.skip(len(time))
                    continue
                started, first = True, int(inside[0])
                intake.skip(first)
                time, values, dt = time[first:], values[first:], dt if dt is None else dt[first:]
            past = [] if span.stop is None else np.flatnonzero(time >= span.stop)[:1].tolist()
            if past:
                # Nothing after the first row at or past the stop is looked at.
                n = past[0] + 1
                time, values, dt = time[:n], values[:n], dt if dt is None else dt[:n]
            kept += len(time)
            yield intake.push(time, values, dt)
            if past:
                break
        if check is not None:
            say_gyros(check.verdict(), self.notes, self.contradictions, streamed=True)
        # Less than two rows of a stretch are no samples; of a whole file, they are an error.
        if started and (kept > 1 or (not span.begins and not past)):
            yield intake.close()

    def _check_array(self, span: Span) -> ArrayCheck | None:
        """Compare an array's gyros before they are fused; for a stream, return a check to feed."""
        array = self._meaning.array
        if array is None or len(array) < 4:
            return None
        check = ArrayCheck(array, self._gyro_bias)
        if self.path == Path("-"):
            return check
        verdict = compare_gyros(check, self._content, self._meaning, self._pass().again(), span)
        self._working = verdict.working
        say_gyros(verdict, self.notes, self.contradictions, streamed=False)
        return None

    def _pass(self) -> Clock:
        """Return a clock for one pass over the file."""
        clock = self._meaning.clock
        # Where the stamps are not known yet, what the first pass finds is what is said.
        return clock.again() if clock.decided else clock

    def array_blocks(self) -> Iterator[tuple[Any, Any]]:
        """Yield time (n,), s, and an array's gyros (n, m).

        Rates are rad/s; increments, in files of increments, rad.

        Raises
        ------
        InputError
            If no array was named (``array`` in the mapping).
        """
        if self._meaning.array is None:
            raise InputError(f"{self._label}: name the array of its gyros (--array)")
        done, clock = 0, self._pass()
        try:
            for block in self._content.blocks():
                time = self._meaning.convert(block, done, clock)[0]
                done += len(time)
                yield time, self._meaning.own_gyros(block)
        except InputError as error:
            raise self._named(error) from None

    def read(self, *, start: RecordTime = None, stop: RecordTime = None) -> ImuRecord:
        """Read the file whole, or the stretch from `start` to `stop` (s, as in `chunks`).

        Returns
        -------
        ImuRecord
            With `quality` set.

        Raises
        ------
        InputError
            As `chunks`.
        """
        whole = Whole()
        for part in self.chunks(1 << 62, start=start, stop=stop):
            whole.add(part, self.progress if start is None else 0.0)
        if whole.first is None:
            raise InputError(f"{self._label}: the record has no samples")
        return whole.record(self.quality)

    def follow(
        self,
        poll: float = _POLL,
        idle: float | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> Iterator[ImuRecord]:
        """Yield samples as a text file grows, or as standard input brings them.

        Only whole lines are taken. The first samples wait until 256 rows are there; later ones
        until eight rows after them show that they are good.

        Parameters
        ----------
        poll : float
            How often to look for new lines, s.
        idle : float, optional
            End after so many seconds without anything new; never, when not given.
        stop : callable, optional
            Asked before each look; true ends the following.

        Raises
        ------
        InputError
            If the format cannot be followed, the file becomes shorter, or a row is bad.
        """
        if isinstance(self._begun.spooled, Unpacked):
            raise InputError(f"{self._label}: is compressed, and cannot be followed")
        if self._begun.spooled is not None:
            raise InputError(f"{self._label}: {PIPE}")
        if self._content.follow is None:
            raise InputError(
                f"{self._label}: a {self.format} file cannot be followed, only text can"
            )
        if not poll > 0:
            raise InputError(f"poll must be a positive time, got {poll}")
        if idle is not None and not idle >= 0:
            raise InputError(f"idle must be a time of 0 s or more, got {idle:g} s")
        self._intake = intake = self._new_intake(self._content)
        quiet = done = 0.0
        clock = self._pass()
        try:
            for block in timed(self._content.follow(), clock):
                if block is None:
                    if idle is not None and quiet >= idle:
                        break
                    if stop is not None and stop():
                        break
                    wall.sleep(poll)
                    quiet += poll
                    continue
                quiet = 0.0
                clock.check()
                time, values, dt = self._meaning.convert(block, int(done), clock)
                done += len(time)
                record = intake.push(time, values, dt)
                if len(record):
                    yield record
                if stop is not None and stop():
                    break
            record = intake.close()
            if len(record):
                yield record
        except InputError as error:
            raise self._named(error) from None
        except OSError as error:
            raise InputError(f"{self._label}: cannot be read ({error.strerror or error})") from None

    def _named(self, error: InputError) -> InputError:
        text = str(error)
        return error if text.startswith(f"{self._label}:") else InputError(f"{self._label}: {text}")
