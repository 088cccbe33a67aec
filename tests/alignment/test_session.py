"""Live sessions: what comes beside the stream, and what becomes of the stream itself."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from schuler.alignment import LiveAligner, LiveSession
from schuler.errors import InputError
from schuler.io.packets import encode_csv, encode_frame
from tests.alignment.live_tools import (
    SENDER,
    SITE,
    Feed,
    frame,
    make_samples,
    make_session,
    right,
)

OTHER = "198.51.100.9:4000"
KEY = b"0123456789abcdef"


@pytest.fixture(scope="module")
def items():
    return make_samples()


@pytest.fixture
def feed():
    return Feed(make_session())


def shifted(items, number=0, time=0.0):
    return [(n + number, t + time, v) for n, t, v in items]


def test_a_clean_stream_is_the_aligner_s_own(items, feed):
    feed.real(items)
    outcome = feed.end()
    plain = LiveAligner(SITE, "increments", "centred", "navigation-rlg")
    plain.push(items)
    plain.finish()
    assert outcome.best.alignment.heading_deg == plain.solution().heading_deg
    assert outcome.contradictions == ()
    counts = feed.session.counts()
    assert counts.pop("aligned") == len(items)
    assert set(counts.values()) == {0}


@pytest.mark.parametrize("method", ["kalman", "kalman-large", "gyrocompass"])
def test_a_filter_runs_live_and_resumes_from_a_checkpoint(items, tmp_path, method):
    """The heading is that of the record at once, to the last bit, though the process ended."""
    whole = LiveAligner(SITE, "increments", method, "navigation-rlg")
    whole.push(items)
    whole.finish()
    first = LiveAligner(SITE, "increments", method, "navigation-rlg")
    first.push(items[:2000])
    first.save(tmp_path / "state.npz")
    second = LiveAligner(SITE, "increments", method, "navigation-rlg")
    second.load(tmp_path / "state.npz")
    second.push(items[2000:])
    second.finish()
    assert second.samples == len(items)
    fix = second.solution()
    np.testing.assert_array_equal(fix.quat_nb, whole.solution().quat_nb)
    np.testing.assert_array_equal(fix.covariance, whole.solution().covariance)
    assert right(fix)


@pytest.mark.parametrize("address", [OTHER, SENDER])
@pytest.mark.parametrize(
    "packet",
    [
        b"hello", b"\x00" * 700, b"SC\x01", encode_csv(5, 1e5, [0.0] * 6),
        encode_frame(9_000_000, -1.0, [0.0] * 6, "increments"),
        encode_frame(3, 0.5, [0.0] * 6, "rates"), b"GET / HTTP/1.1\r\n\r\n",
    ],
)  # fmt: skip
def test_a_foreign_first_datagram_deafens_nobody(items, feed, packet, address):
    feed.burst([packet], address)
    feed.real(items)
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert outcome.contradictions == ()
    counts = feed.session.counts()
    assert counts["aligned"] == len(items)
    assert sum(counts.values()) - len(items) - counts["damaged"] == 1


FORGED = {
    "time -1": ((1500, -1.0, (0.0,) * 6), "wrong_time"),
    "time nan": ((1500, math.nan, (0.0,) * 6), "not_finite"),
    "time inf": ((1500, math.inf, (0.0,) * 6), "not_finite"),
    "time 1e9": ((1500, 1e9, (0.0,) * 6), "wrong_time"),
    "time 1e300": ((1500, 1e300, (0.0,) * 6), "out_of_range"),
    "value 1e300": ((1500, 30.02, (1e300,) * 6), "out_of_range"),
    "value nan": ((1500, 30.02, (math.nan,) * 6), "not_finite"),
    "increment of a rate": ((1500, 30.02, (50.0,) * 6), "out_of_range"),
    "far number": ((2_000_000, 30.02, (0.0,) * 6), "wrong_number"),
    "greatest number": ((2**32 - 1, 30.02, (0.0,) * 6), "wrong_number"),
    "far along the line": ((2_000_000, 40_000.02, (0.0,) * 6), "wrong_number"),
    "a number again": ((1400, 28.02, (0.0,) * 6), "wrong_number"),
    "a number of long ago": ((40, 0.82, (0.0,) * 6), "late"),
}


@pytest.mark.parametrize("name", FORGED)
def test_one_forged_frame_costs_itself_only(items, feed, name):
    forged, reason = FORGED[name]
    feed.real(items[:1500])
    feed.burst([frame(forged)])
    feed.real(items[1500:])
    outcome = feed.end()
    counts = feed.session.counts()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    assert counts["aligned"] == len(items)
    assert counts[reason] == 1
    assert counts["lost"] == 0


@pytest.mark.parametrize("kind", ["rates", "mean-rates"])
def test_a_frame_of_another_kind_is_left_out(items, feed, kind):
    feed.real(items[:1500])
    feed.burst([encode_frame(*items[1500], kind)])
    feed.burst([encode_csv(*items[1500])])
    feed.real(items[1500:])
    assert right(feed.end().best.alignment)
    assert feed.session.counts()["other_kind"] == 2
    assert feed.session.counts()["aligned"] == len(items)


def test_frames_and_lines_in_one_pipe(items):
    session = make_session()
    data = b"".join(
        frame(item) + (encode_csv(*item) if item[0] % 3 == 0 else b"") for item in items
    )
    for at in range(0, len(data), 1000):
        session.feed(data[at : at + 1000])
    assert right(session.finish().best.alignment)
    counts = session.counts()
    assert counts["aligned"] == len(items)
    assert counts["other_kind"] == len(items) // 3
    assert counts["unconfirmed"] == 0
    assert counts["damaged"] == 0


@pytest.mark.parametrize("line", [False, True])
def test_65_far_numbers_are_not_believed(items, feed, line):
    """Random ones, and ones that lie on a line of their own."""
    rng = np.random.default_rng(5)
    feed.real(items[:1500])
    far = [
        (int(rng.integers(10**6, 10**9)) if not line else 10**6 + k, 30.0 + 0.02 * k, (0.0,) * 6)
        for k in range(65)
    ]
    feed.burst(map(frame, far))
    feed.real(items[1500:])
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    assert feed.session.counts()["aligned"] == len(items)
    assert feed.session.counts()["wrong_number"] == 65


@pytest.mark.parametrize("piped", [False, True])
@pytest.mark.parametrize("step", [-1.0, -1000.0, 7.0])
def test_a_clock_step_begins_a_span(items, step, piped):
    feed = Feed(make_session())
    send = feed.real if not piped else (lambda them: feed.session.feed(b"".join(map(frame, them))))
    send(items[:2000])
    send(shifted(items[2000:], time=step))
    outcome = feed.end() if not piped else feed.session.finish()
    notes = [*feed.notes, *feed.session.take_notes()]
    assert any(f"clock stepped by {step:+.4g} s at number 2000; span 2" in n for n in notes)
    assert outcome.spans == 2
    assert outcome.best.span == 1
    assert right(outcome.best.alignment)
    # The sender was followed without a loss, and both spans agree.
    assert feed.session.counts()["aligned"] == len(items)
    assert outcome.contradictions == ()


@pytest.mark.parametrize("clock_too", [True, False])
@pytest.mark.parametrize("after", [40, 150, 1000])
def test_a_sender_that_restarts_begins_a_span(feed, items, after, clock_too):
    feed.real(items[:after])
    again = shifted(items, time=0.0 if clock_too else 400.0)
    # Another second of the same base: other values.
    again = [(n, t, (*v[:5], v[5] + 1e-9)) for n, t, v in again]
    feed.now += 3.0
    feed.real(again)
    outcome = feed.end()
    assert feed.said("the sender restarted, at number 0; span 2 begins")
    assert (outcome.best.span, outcome.spans) == (2, 2)
    assert right(outcome.best.alignment)
    assert outcome.best.alignment.samples == len(items)
    assert outcome.contradictions == ()


def test_a_restart_too_short_to_align_contradicts(feed, items):
    feed.real(items)
    feed.now += 3.0
    feed.real([(n, t, (*v[:5], v[5] + 1e-9)) for n, t, v in items[:20]])
    outcome = feed.end()
    assert outcome.best.span == 1
    assert right(outcome.best.alignment)
    assert "span 2, could not be aligned" in outcome.contradictions[0]


def test_a_base_that_was_turned_contradicts(feed, items):
    feed.real(items)
    # A quarter turn about the vertical: x to the right becomes y.
    turned = [(n, t, (v[1], -v[0], v[2], v[4], -v[3], v[5])) for n, t, v in items]
    feed.now += 3.0
    feed.real(turned)
    outcome = feed.end()
    assert "sigma apart" in outcome.contradictions[0]


@pytest.mark.parametrize("csv", [False, True])
def test_numbers_wrap(items, csv):
    feed = Feed(make_session())
    far = [((n + 2**32 - 1500) % 2**32, t, v) for n, t, v in items]
    if csv:
        for item in far:
            feed.now += 0.02
            feed.burst([encode_csv(*item)])
    else:
        feed.real(far)
    outcome = feed.end()
    assert feed.said("wrapped at 2^32")
    assert (outcome.spans, outcome.contradictions) == (1, ())
    assert outcome.best.alignment.samples == len(items)
    assert feed.session.counts()["lost"] == 0


def test_a_long_gap_begins_a_span_and_a_short_one_is_bridged(items):
    for hole, spans in ((200, 1), (300, 2)):
        feed = Feed(make_session(max_gap=5.0))
        feed.real(items[:1000])
        feed.now += hole / 50.0
        feed.real(items[1000 + hole :])
        outcome = feed.end()
        assert outcome.spans == spans
        assert feed.said("no sample came for") == (spans == 2)
        assert feed.session.counts()["aligned"] == len(items) - hole
        assert right(outcome.best.alignment)


def test_a_gap_of_more_numbers_than_the_window_is_bridged(items):
    feed = Feed(make_session(max_gap=20.0))
    feed.real(items[:1000])
    feed.now += 8.0
    feed.real(items[1400:])
    outcome = feed.end()
    assert outcome.spans == 1
    assert feed.said("no sample came for 8.02 s; the gap is bridged")
    assert feed.session.counts()["lost"] == 400


def test_a_fifth_of_the_samples_lost(items, feed):
    rng = np.random.default_rng(7)
    kept = [item for item in items if rng.random() > 0.2]
    feed.real(kept)
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    # Short losses are interpolated.
    assert outcome.best.alignment.samples >= items[-1][0] - 20


def test_a_sender_from_another_port_takes_over_when_the_first_is_silent(items, feed):
    feed.real(items[:1500])
    feed.real(items[1500:], "192.0.2.7:6000")
    outcome = feed.end()
    assert feed.said("the source 192.0.2.7:5005 is silent")
    assert outcome.spans == 1
    assert feed.session.counts()["aligned"] == len(items)


def test_two_senders_do_not_mix(items, feed):
    for item in items:
        feed.real([item])
        feed.burst([frame((item[0] + 7, item[1] + 50.0, (0.0,) * 6))], OTHER)
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    assert feed.said(f"samples of {OTHER} are left out")
    assert feed.session.counts()["foreign"] == len(items)


@pytest.mark.parametrize("only", ["192.0.2.7", "192.0.2.7:5005"])
def test_a_pinned_sender_is_heard_through_others(items, only):
    feed = Feed(make_session(only=only))
    feed.burst([frame((k, 0.02 * k, (0.0,) * 6)) for k in range(300)], OTHER)
    feed.real(items)
    assert right(feed.end().best.alignment)
    assert feed.session.counts()["foreign"] == 300


def test_a_flood_is_bounded(items, feed):
    """Datagrams of ten thousand senders leave neither memory nor the stream in disorder."""
    rng = np.random.default_rng(9)
    for k, item in enumerate(items):
        feed.real([item])
        if k < 1000:
            flood = [
                frame((int(rng.integers(2**32)), float(rng.uniform(0, 1e6)), (0.0,) * 6))
                for _ in range(10)
            ]
            for j, packet in enumerate(flood):
                feed.burst([packet], f"203.0.113.{j}:{k + 1}")
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert feed.session.counts()["aligned"] == len(items)
    # Sixteen samples of the stream were in no flood's reach to tell it by.
    assert feed.session.counts()["foreign"] + feed.session.counts()["unconfirmed"] == 10_000
    assert len(feed.notes) < 20


# -- a shared key -----------------------------------------------------------------------


def test_only_keyed_frames_are_taken(items):
    feed = Feed(make_session(key=KEY))
    feed.real(items[:500], key=KEY, run=5)
    feed.burst([frame(items[500]), encode_csv(*items[500])])
    feed.burst([frame(items[500], key=b"another key, longer", run=5)])
    feed.burst([frame(items[500], key=KEY, run=5)[:-1] + b"\x00"])
    feed.real(items[500:], key=KEY, run=5)
    outcome = feed.end()
    assert right(outcome.best.alignment)
    counts = feed.session.counts()
    assert counts["aligned"] == len(items)
    assert counts["unauthenticated"] == 4


def test_old_keyed_frames_sent_again_do_no_harm(items):
    feed = Feed(make_session(key=KEY))
    old = [frame((n, t, (0.0,) * 6), key=KEY, run=4) for n, t, _ in items]
    feed.real(items[:1000], key=KEY, run=5)
    feed.burst(old)
    feed.burst([frame(item, key=KEY, run=5) for item in items[:1000]])
    feed.now += 2.5
    feed.burst([frame(item, key=KEY, run=5) for item in items[:1000]])
    feed.real(items[1000:], key=KEY, run=5)
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert (outcome.spans, outcome.contradictions) == (1, ())
    counts = feed.session.counts()
    assert counts["aligned"] == len(items)
    assert counts["replayed"] == len(items)
    assert counts["late"] + counts["repeated"] == 2000


def test_a_new_run_of_a_keyed_sender_begins_a_span(items):
    feed = Feed(make_session(key=KEY))
    feed.real(items[:1000], key=KEY, run=5)
    feed.real(items, key=KEY, run=6)
    outcome = feed.end()
    assert feed.said("the sender restarted")
    assert (outcome.best.span, outcome.spans) == (2, 2)
    assert right(outcome.best.alignment)


def test_keyed_frames_without_a_key_are_not_believed(items):
    feed = Feed(make_session())
    feed.real(items[:100], key=KEY, run=5)
    with pytest.raises(InputError, match=r"no sample could be used .*100 with a tag, and no key"):
        feed.end()


# -- nothing usable ---------------------------------------------------------------------


def test_nothing_came(feed):
    with pytest.raises(InputError, match="no sample came"):
        feed.end()


def test_only_rubbish_came_and_is_told_by_reason(feed, items):
    feed.burst([b"hello", frame(items[0])[:-1] + b"\x00", frame((5, math.nan, (0.0,) * 6))])
    feed.burst([frame(items[0])])
    with pytest.raises(InputError, match=r"1 with a wrong checksum, 1 that are no sample, "
                       r"1 with a value that is not finite, 1 in no stream"):  # fmt: skip
        feed.end()


# -- the checkpoint's disk --------------------------------------------------------------


def test_a_disk_that_fills_up_ends_nothing(items, tmp_path, monkeypatch):
    from schuler.alignment import live

    whole = live.write_checkpoint

    def full(*_):
        raise InputError("state.npz: cannot be written (No space left on device)")

    feed = Feed(make_session(checkpoint=tmp_path / "state.npz"))
    said = []
    for k, item in enumerate(items):
        feed.real([item])
        monkeypatch.setattr(live, "write_checkpoint", full if 500 < k < 2000 else whole)
        if k % 100 == 0:
            feed.session.save()
            said += feed.session.take_notes()
    assert sum("is not saved" in note for note in said) == 1
    assert sum("saved again" in note for note in said) == 1
    outcome = feed.end()
    assert right(outcome.best.alignment)
    assert feed.session.counts()["aligned"] == len(items)


def test_a_session_resumes_as_if_nothing_had_been(items, tmp_path):
    path = tmp_path / "state.npz"
    first = Feed(make_session(checkpoint=path))
    first.real(items[:1200])
    first.session.save()
    second = Feed(make_session(checkpoint=path))
    second.real(items[1190:])
    through = Feed(make_session())
    through.real(items)
    outcome = second.end()
    assert outcome.best.alignment.heading_deg == through.end().best.alignment.heading_deg
    assert outcome.spans == 1
    assert second.said("resumed from")


def test_a_session_resumes_before_a_sender_that_restarted_too(items, tmp_path):
    path = tmp_path / "state.npz"
    first = Feed(make_session(checkpoint=path))
    first.real(items[:1200])
    first.session.save()
    second = Feed(make_session(checkpoint=path))
    second.real(items)
    outcome = second.end()
    assert second.said("the sender restarted")
    assert outcome.best.span == 2
    assert right(outcome.best.alignment)


def test_a_cold_start_keeps_the_refused_file(items, tmp_path):
    path = tmp_path / "state.npz"
    for k in range(3):
        path.write_bytes(b"my own data %d" % k)
        with pytest.raises(InputError, match=r"not a saved state.*--cold-start"):
            make_session(checkpoint=path)
        assert path.read_bytes() == b"my own data %d" % k
        feed = Feed(make_session(checkpoint=path, cold_start=True))
        assert not path.exists()
        feed.real(items[:1000])
        feed.end()
        assert feed.said("a cold start made")
    assert (tmp_path / "state.npz.refused").read_bytes() == b"my own data 0"
    assert (tmp_path / "state.npz.refused-2").read_bytes() == b"my own data 1"
    assert (tmp_path / "state.npz.refused-3").read_bytes() == b"my own data 2"


def test_a_device_is_no_checkpoint_and_stays(tmp_path):
    pipe = tmp_path / "state.npz"
    os.mkfifo(pipe)
    for cold in (False, True):
        with pytest.raises(InputError, match="not a regular file"):
            make_session(checkpoint=pipe, cold_start=cold)
    assert pipe.is_fifo()


def test_a_file_that_is_read_again_after_a_resumption_is_recognised(items, tmp_path):
    path = tmp_path / "state.npz"
    data = [frame(item) for item in items]
    first = make_session(checkpoint=path)
    first.feed(b"".join(data[:1200]))
    first.save()
    second = make_session(checkpoint=path)
    second.feed(b"".join(data))
    outcome = second.finish()
    assert outcome.spans == 1
    assert outcome.best.alignment.samples == len(items)
    assert second.counts()["late"] + second.counts()["repeated"] >= 1190


def test_another_run_in_a_pipe_after_a_resumption_is_a_span(items, tmp_path):
    path = tmp_path / "state.npz"
    first = make_session(checkpoint=path)
    first.feed(b"".join(map(frame, items[:1200])))
    first.save()
    second = make_session(checkpoint=path)
    second.feed(b"".join(frame((n, t, (*v[:5], v[5] + 1e-9))) for n, t, v in items))
    outcome = second.finish()
    assert (outcome.best.span, outcome.spans) == (2, 2)
    assert outcome.best.alignment.samples == len(items)


@pytest.mark.parametrize("kind", ["rates", "mean-rates", "increments"])
@pytest.mark.parametrize("method", ["auto", "analytic"])
def test_every_state_on_the_way_can_be_resumed(items, tmp_path, kind, method):
    """Lost, shuffled and wild samples among them; the bits are those of one session."""
    rng = np.random.default_rng(11)
    scale = 1.0 if kind == "increments" else 50.0
    kept = [(n, t, tuple(scale * x for x in v)) for n, t, v in items if rng.random() > 0.05]
    for k in range(0, len(kept) - 9, 7):
        kept[k], kept[k + 8] = kept[k + 8], kept[k]
    kept[600:600] = [(700, 14.0, (0.1,) * 6), (40, 1.0, (0.1,) * 6)]
    path = tmp_path / "state.npz"

    def make():
        return LiveSession(SITE, kind, method, "navigation-rlg", checkpoint=path)

    through = LiveSession(SITE, kind, method, "navigation-rlg")
    first, at, now = make(), 0, 0.0
    for cut in (17, 40, 270, 275, 280, 300, 610, 1000, 2500, len(kept)):
        for item in kept[at:cut]:
            now += 0.02
            for session in (first, through):
                session.feed(encode_frame(*item, kind), SENDER, now)
        first.save()
        first, at = make(), cut
    # What was counted before a resumption but by the aligner is not in the state.
    mine, other = first.finish(now + 5.0), through.finish(now + 5.0)
    assert mine.best.alignment.heading_deg == other.best.alignment.heading_deg
    assert first.counts()["aligned"] == through.counts()["aligned"] > 2800
    assert (mine.spans, other.spans) == (1, 1)


@pytest.mark.parametrize("piped", [False, True])
def test_gaps_of_a_slow_sender_are_within_its_first_samples_too(items, piped):
    """At 1 Hz a hole of few numbers is long in time."""
    slow = [(n, 50.0 * t, tuple(50.0 * x for x in v)) for n, t, v in items[:600]]
    kept = [item for item in slow if not 8 <= item[0] < 20 and not 300 <= item[0] < 310]
    session = make_session()
    for item in kept:
        session.feed(frame(item), None if piped else SENDER, None if piped else item[1])
    outcome = session.finish(None if piped else kept[-1][1] + 9.0)
    assert outcome.spans == 3
    assert session.counts()["aligned"] == len(kept)
