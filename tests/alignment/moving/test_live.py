"""Live alignment in motion: clocks, restarts, forged and lost sentences, saved states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.aiding.fix_rows import FixSetting
from schuler.aiding.stream_clock import StreamClock
from schuler.alignment.moving.live import LiveAids, MovingLiveSession
from schuler.alignment.moving.stream_setting import StreamSetting
from schuler.errors import InputError
from tests.alignment.moving.nmea_tools import UTC_DAY, frames, in_turn, sentences
from tests.alignment.moving.routes import car, fixes, heading_error, noisy, truth_of

SPEC = "tactical-fog"
LEAP = 18.0


@pytest.fixture(scope="module")
def drive():
    made, rng = truth_of(car(), 50.0, 50.0), np.random.default_rng(6)
    return made, noisy(made, SPEC, rng), fixes(made, rng=rng)


def session(clock=None, *, latency=1.0, keep=300.0, mixed=False, sender=None, **options):
    antenna = options.pop("antenna", FixSetting())
    setting = StreamSetting(SPEC, antenna, latency=latency, keep=keep)
    return MovingLiveSession(
        LiveAids(clock or StreamClock("utc"), setting, mixed=mixed, only=sender), **options
    )  # fmt: skip


def give(live, items, now=None):
    """Feed what comes; `now` is a clock that advances with the samples, of both as they come."""
    for second, data in items:
        if now is not None:
            now += 0.0 if second else 0.02
        (live.feed_aid if second else live.feed)(data, None, now)
    return now


def right(fix, made, row=-1):
    error = heading_error(fix.quat_nb, made.truth.quat_nb[row])
    return abs(error[2]) < 4.0 * np.sqrt(fix.covariance[2, 2])


@pytest.mark.parametrize(
    ("clock", "shift"),
    [
        (StreamClock("utc"), 0.0),
        (StreamClock("utc"), UTC_DAY),
        (StreamClock("gps", leap_seconds=LEAP), LEAP + 2 * 86400.0),
    ],
)
def test_the_samples_clock(drive, clock, shift):
    """Of the day, since 1970, of the GPS week: the same heading."""
    made, record, gnss = drive
    live = session(clock)
    day = 43200.0
    give(live, in_turn(frames(record, shift + day), sentences(gnss, day)))
    outcome = live.finish()
    assert right(outcome.best.alignment, made)
    assert outcome.contradictions == ()
    assert live.aid_counts()["fixes"] == len(gnss)


def test_over_midnight(drive):
    made, record, gnss = drive
    live = session()
    shift = UTC_DAY - 25.0
    give(live, in_turn(frames(record, shift), sentences(gnss, shift)))
    assert right(live.finish().best.alignment, made)
    assert live.aid_counts()["fixes"] == len(gnss)


def test_leap_seconds_that_are_forgotten_are_said(drive):
    """Samples in GPS time that are said to be UTC: no fix is taken, and the note names 18 s."""
    _, record, gnss = drive
    live = session()
    give(live, in_turn(frames(record, LEAP + UTC_DAY), sentences(gnss, UTC_DAY)))
    with pytest.raises(InputError, match="0 fixes came up to"):
        live.finish()
    assert live.aid_counts()["off_clock"] == len(gnss)
    assert any("leap seconds" in note for note in live.take_notes())


def test_stamps_at_their_arrival(drive):
    """A sender of another clock: the delay of arrival is found within what was said of it."""
    made, record, gnss = drive
    live = session(StreamClock("arrival", error=0.3))
    give(live, in_turn(frames(record, 5000.0), sentences(gnss, UTC_DAY), late=0.2), now=10.0)
    fix = live.finish(100.0).best.alignment
    assert right(fix, made)
    value, sigma = fix.estimated["delay_s"]["gnss_velocity"]
    # The samples are some hundredths old when they have come in order.
    assert abs(value - 0.2) < 4.0 * sigma + 0.03
    assert fix.state.covariance[0, 0] > 0.0
    piped = session(StreamClock("arrival", error=0.3))
    give(piped, in_turn(frames(record, 5000.0), sentences(gnss, UTC_DAY)))
    assert any("no time of arrival" in note for note in piped.take_notes())


def test_any_chunking_of_a_mixed_stream(drive):
    _, record, gnss = drive
    items = in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))
    text = b"".join(data for _, data in items)
    found = []
    for size in (17, 4096):
        live = session(mixed=True)
        give(live, [(False, text[k : k + size]) for k in range(0, len(text), size)])
        found.append(live.finish().best.alignment.to_dict())
        assert live.counts()["malformed"] == 0
    assert found[0] == found[1]


def test_a_sender_that_restarts_begins_a_new_span(drive):
    """Its clock goes back: what comes then is aligned by itself, by fixes of its own time."""
    made, record, gnss = drive
    live = session(StreamClock("arrival", error=0.1))
    half = int(np.searchsorted(record.time, 25.0))
    first = replace(record, **{n: getattr(record, n)[:half] for n in _COLUMNS})
    now = give(live, in_turn(frames(first, 5000.0), sentences(gnss.rows(gnss.time <= 24.5),
                                                              UTC_DAY), 0.1), now=10.0)  # fmt: skip
    last = replace(record, **{n: getattr(record, n)[half:] for n in _COLUMNS})
    later = [(t, data) for t, data in sentences(gnss, UTC_DAY) if t > 25.5]
    give(live, in_turn(frames(last, -25.0), later, 0.1), now=now + 3.0)
    outcome = live.finish(now + 60.0)
    assert outcome.spans == 2
    assert outcome.best.span == 2
    assert outcome.best.alignment.start < 5.0
    assert right(outcome.best.alignment, made)
    assert outcome.contradictions == ()


_COLUMNS = ("time", "dt", "dtheta", "dvel")


def test_a_saved_state_is_taken_up(drive, tmp_path):
    """Saved and resumed twice, before and after the heading is known: the same bits."""
    _, record, gnss = drive
    items = in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))
    whole = session(keep=20.0)
    give(whole, items)
    path = tmp_path / "state.npz"
    begin = 0
    for end in (700, 1800, len(items)):
        part = session(keep=20.0, checkpoint=path)
        give(part, items[begin:end])
        part.save()
        begin = end
    one, other = part.finish().best.alignment, whole.finish().best.alignment
    assert one.to_dict() == other.to_dict()
    assert part.aid_counts()["fixes"] == len(gnss)
    assert any("resumed from" in note for note in part.take_notes())


def test_a_state_of_another_alignment_is_refused(drive, tmp_path):
    _, record, gnss = drive
    path = tmp_path / "state.npz"
    first = session(checkpoint=path)
    give(first, in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))[:1500])
    first.save()
    for other, what in (
        ({"keep": 60.0}, "keep"),
        ({"antenna": FixSetting((0.0, 1.0, 0.0))}, "antenna"),
        ({"clock": StreamClock("gps", leap_seconds=LEAP)}, "clock"),
    ):
        with pytest.raises(InputError, match=f"was saved with {what}"):
            session(checkpoint=path, **other)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged"):
        session(checkpoint=path)


def test_late_sentences_are_said(drive):
    _, record, gnss = drive
    live = session(latency=0.5)
    give(live, in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY), late=2.0))
    with pytest.raises(InputError):
        live.finish()
    assert live.aid_counts()["late"] > 40
    assert any("--latency" in note for note in live.take_notes())


def test_sentences_of_another_sender(drive):
    _, record, gnss = drive
    live = session(sender="192.0.2.7")
    for k, (_, data) in enumerate(sentences(gnss, UTC_DAY)):
        live.feed_aid(data, "192.0.2.7:5006" if k % 2 else "192.0.2.9:5006")
    give(live, [(False, data) for _, data in frames(record, UTC_DAY)])
    live.finish()
    assert live.aid_counts()["foreign"] == 26
    assert live.aid_counts()["fixes"] == 25


def test_it_warms_up():
    live = session()
    live.warm_up()
    assert live.aid_counts()["fixes"] == 0
