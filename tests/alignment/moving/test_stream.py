"""A stream of samples and fixes: any chunking, aids that are late or lost, saved states."""

from __future__ import annotations

import numpy as np
import pytest

import schuler as sc
from schuler.aiding.fix_rows import FixSetting, rows_of
from schuler.alignment.moving.stream import MovingStream
from schuler.alignment.moving.stream_setting import StreamSetting
from schuler.constants import ARCMIN
from schuler.errors import InputError
from schuler.motion import Manoeuvre, Route
from tests.alignment.moving.routes import (
    SITE,
    car,
    fixes,
    heading_error,
    noisy,
    truth_of,
)

SPEC = "tactical-fog"


@pytest.fixture(scope="module")
def drive():
    made, rng = truth_of(car(), 100.0, 50.0), np.random.default_rng(4)
    gnss = fixes(made, rng=rng)
    return made, noisy(made, SPEC, rng), gnss


@pytest.fixture(scope="module")
def short(drive):
    """The first part of the drive."""
    made, record, gnss = drive
    return made, record.between(None, 45.0), gnss.rows(np.asarray(gnss.time) <= 45.0)


def stream(keep=300.0, latency=1.0, **antenna):
    return MovingStream(StreamSetting(SPEC, FixSetting(**antenna), latency=latency, keep=keep))


def fed(moving, record, rows, size, *, late=0.2, begin=-np.inf, end=np.inf):
    """Give samples in chunks, and fixes as late as a receiver's, to the end of a time."""
    done = int(np.searchsorted(rows[:, 0] + late, begin, side="right"))
    first, last = (int(np.searchsorted(record.time, t, side="right")) for t in (begin, end))
    at = first
    while at < last:
        stop = min(at + size, last)
        # What has come before the chunk's last sample.
        came = int(np.searchsorted(rows[:, 0] + late, record.time[stop - 1], side="right"))
        if size > 25:
            # A long chunk would be there before fixes of its own samples.
            moving.add(rows[done:came])
            done = came
        moving.update(record.rows(at, stop))
        moving.add(rows[done:came])
        at, done = stop, came
    return moving


@pytest.mark.parametrize("keep", [300.0, 20.0])
def test_any_chunking_gives_the_same_bits(short, keep):
    _, record, gnss = short
    rows = rows_of(gnss)
    results = []
    for size in (1, 7, 500):
        moving = fed(stream(keep), record, rows, size)
        moving.add(rows[moving.counts["fixes"] :])
        moving.finish()
        results.append(moving.solution())
    for other in results[1:]:
        assert other.to_dict() == results[0].to_dict()
        np.testing.assert_array_equal(other.covariance, results[0].covariance)


def test_what_is_kept_whole_ends_as_the_record_does(short):
    """Passes over all that came: the alignment of the record, to the bit."""
    _, record, gnss = short
    moving = fed(stream(), record, rows_of(gnss), 20)
    moving.add(rows_of(gnss)[moving.counts["fixes"] :])
    moving.finish()
    assert moving.solution().to_dict() == sc.align(record, aiding=gnss, spec=SPEC).to_dict()


def test_beyond_what_is_kept_the_filter_runs_on_as_well(drive):
    """With 30 s kept of 100, heading and sigma differ little from those of passes over all."""
    _, record, gnss = drive
    moving = fed(stream(keep=30.0), record, rows_of(gnss), 20)
    moving.add(rows_of(gnss)[-1:])
    moving.finish()
    now = moving.solution()
    part = record.between(None, moving.time)
    whole = sc.align(part, aiding=gnss, spec=SPEC)
    off = np.abs(heading_error(now.quat_nb, whole.quat_nb))
    assert np.all(off < 0.05 * np.sqrt(np.diag(whole.covariance)))
    np.testing.assert_allclose(now.sigma_arcmin, whole.sigma_arcmin, rtol=0.02)
    np.testing.assert_allclose(now.limit_arcmin, whole.limit_arcmin, rtol=0.02)
    assert (now.samples, now.end) == (len(part), part.end)
    assert now.used == whole.used


def test_the_filter_runs_on_as_a_pass_does(drive):
    """From the same start, the running filter has the bits of a pass over the whole."""
    from schuler.alignment.moving.align import prepare
    from schuler.alignment.moving.fine import difference, filtered_end, known_heading, run_pass
    from schuler.alignment.moving.running import RunningAlignment
    from schuler.alignment.moving.setup import layout_of, make_filter, measurements
    from schuler.sensors import GRADES

    _, record, gnss = drive
    spec = GRADES[SPEC]
    first = record.between(None, 30.0)
    prepared = prepare(first, [gnss], spec, None)
    leader, rough = prepared.coarse()
    found, taken = prepared.fine(rough, leader, 0.0)
    running = RunningAlignment(prepared, rough, found, taken, spec, ())
    for k in range(len(first), len(record), 33):
        running.feed(record.rows(k, k + 33), gnss)
    measured = measurements([gnss], record)
    start, nominal = prepared.nominal(rough), found.start.nominal
    again = make_filter(
        nominal, prepared.spec, 0.0, measured, prepared.aids,
        error_state=difference(layout_of(spec, measured), nominal, start), budget=True,
    )  # fmt: skip
    run_pass(again, record, late=known_heading(spec))
    state, _ = filtered_end(again)
    now = running.solution()
    # The process noise of a bias depends on the length of the record, and so does the last bit.
    np.testing.assert_allclose(now.quat_nb, state.quat_nb, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(now.covariance, state.covariance[:3, :3], rtol=1e-3, atol=1e-14)


@pytest.mark.parametrize("when", [3.0, 20.0, 60.0])
def test_a_saved_state_goes_on_to_the_bit(drive, when):
    """Before the heading is known, while all is kept, and when the filter runs on."""
    _, record, gnss = drive
    rows = rows_of(gnss)
    whole = fed(stream(keep=30.0), record, rows, 20)
    first = fed(stream(keep=30.0), record, rows, 20, end=when)
    second = stream(keep=30.0)
    second.restore(first.arrays())
    for moving in (first, second):
        fed(moving, record, rows, 20, begin=when)
    for moving in (whole, first, second):
        moving.finish()
    assert second.solution().to_dict() == first.solution().to_dict()
    np.testing.assert_array_equal(second.solution().quat_nb, whole.solution().quat_nb)
    assert second.counts == first.counts


def test_a_damaged_state_is_refused(drive):
    _, record, gnss = drive
    saved = fed(stream(keep=30.0), record, rows_of(gnss), 20, end=40.0).arrays()
    for name, array in saved.items():
        for bad in (None, array[:0] if array.ndim == 1 else array[:, :1]):
            broken = {**saved, name: bad}
            if bad is None:
                del broken[name]
            elif bad.shape == array.shape:
                continue
            with pytest.raises(InputError, match="damaged"):
                stream(keep=30.0).restore(broken)


def test_memory_does_not_grow(drive):
    """Four times as long a drive keeps no more."""
    made = truth_of(car(), 160.0, 50.0)
    record, rows = made.record, rows_of(fixes(made))
    moving = stream(keep=25.0)
    sizes = []
    for end in (40.0, 80.0, 160.0):
        fed(moving, record, rows, 20, begin=moving.newest, end=end)
        sizes.append(sum(array.nbytes for array in moving.arrays().values()))
    assert max(sizes) < 1.05 * sizes[0]


def test_late_fixes_are_left_out_and_counted(short):
    """Two seconds late with a latency of one: all; with one of three: none."""
    _, record, gnss = short
    rows = rows_of(gnss)
    patient = fed(stream(latency=3.0), record, rows, 20, late=2.0)
    prompt = fed(stream(), record, rows, 20)
    for moving in (patient, prompt):
        moving.add(rows[moving.counts["fixes"] :])
        moving.finish()
    assert patient.solution().to_dict() == prompt.solution().to_dict()
    hasty = fed(stream(latency=1.0), record, rows, 20, late=2.0)
    hasty.finish()
    assert hasty.counts["late_fixes"] > 40
    with pytest.raises(InputError, match="an alignment needs 6"):
        hasty.solution()


def test_out_of_order_and_repeated_fixes(short):
    _, record, gnss = short
    rows = rows_of(gnss)
    plain, shuffled = stream(), stream()
    plain.add(rows)
    shuffled.add(np.random.default_rng(1).permutation(rows))
    shuffled.add(rows[:10])
    for moving in (plain, shuffled):
        moving.update(record)
        moving.finish()
    assert shuffled.counts["repeated_fixes"] == 10
    assert shuffled.solution().to_dict() == plain.solution().to_dict()


def test_fixes_that_cease_are_said_and_widen_sigma(drive):
    made, record, gnss = drive
    rows = rows_of(gnss)
    moving = stream(keep=30.0)
    moving.add(rows[rows[:, 0] <= 50.0])
    fed(moving, record, rows[:0], 20)
    moving.finish()
    fix = moving.solution()
    assert any("no fix for 50 s" in text for text in fix.warnings)
    assert fix.position_sigma[0] > 3.0
    error = heading_error(fix.quat_nb, made.truth.quat_nb[-1])[2] / ARCMIN
    assert abs(error) < 4.0 * fix.sigma_arcmin[2]


def test_a_long_steady_drive_before_the_turn():
    """What shows no heading is forgotten bit by bit; the turn at last shows it."""
    made = truth_of(Route([Manoeuvre(90.0), Manoeuvre(10.0, turn=90.0)], heading=40.0, speed=15.0),
                    110.0, 50.0)  # fmt: skip
    rng = np.random.default_rng(7)
    gnss, record = fixes(made, rng=rng), noisy(made, SPEC, rng)
    moving = fed(stream(keep=30.0), record, rows_of(gnss), 20, end=80.0)
    with pytest.raises(InputError, match="brake or turn"):
        moving.solution()
    fed(moving, record, rows_of(gnss), 20, begin=80.0)
    moving.finish()
    fix = moving.solution()
    assert fix.start > 50.0
    error = heading_error(fix.quat_nb, made.truth.quat_nb[-1])[2] / ARCMIN
    assert abs(error) < 4.0 * fix.sigma_arcmin[2] < 120.0


def test_a_delay_that_is_estimated(drive):
    """Fixes stamped 0.2 s late: the delay is found, and the stream goes on beyond what is kept."""
    from dataclasses import replace

    _, record, gnss = drive
    late = replace(gnss, time=np.asarray(gnss.time) + 0.2)
    moving = fed(stream(keep=40.0, estimate=("delay",)), record, rows_of(late), 20)
    moving.finish()
    value, sigma = moving.solution().estimated["delay_s"]["gnss_velocity"]
    assert abs(value - 0.2) < 4.0 * sigma < 0.2
    assert moving.solution().used["gnss"] > 85


def test_times_since_1970(drive):
    """Stamps of which a double holds a quarter of a microsecond."""
    from dataclasses import replace

    _, record, gnss = drive
    shift = 1.7e9
    moved = replace(record, time=record.time + shift)
    late = replace(gnss, time=np.asarray(gnss.time) + shift)
    one = sc.align(record, SITE, aiding=gnss, spec=SPEC)
    other = sc.align(moved, SITE, aiding=late, spec=SPEC)
    np.testing.assert_allclose(other.quat_nb, one.quat_nb, atol=1e-4 * one.sigma_arcmin[2])
    assert other.used == one.used


def test_a_heading_that_is_lost_is_looked_for_anew(drive, monkeypatch):
    """The fixes cease until sigma says that there is no heading; those that come then find it."""
    from schuler.alignment.moving import stream as module

    made, record, gnss = drive
    rows = rows_of(gnss)
    moving = fed(stream(keep=20.0), record, rows[rows[:, 0] < 30.0], 20, end=45.0)
    assert moving.solution().end > 40.0
    monkeypatch.setattr(module, "ENOUGH", 10.0 * ARCMIN)
    fed(moving, record, rows[:0], 20, begin=moving.newest, end=60.0)
    with pytest.raises(InputError, match=r"at t = 4.* the heading had been lost"):
        moving.solution()
    monkeypatch.undo()
    saved = stream(keep=20.0)
    saved.restore(moving.arrays())
    for each in (moving, saved):
        fed(each, record, rows, 20, begin=60.0)
        each.finish()
    fix = moving.solution()
    assert fix.start > 55.0
    error = heading_error(fix.quat_nb, made.truth.quat_nb[round(50 * fix.end)])[2] / ARCMIN
    assert abs(error) < 4.0 * fix.sigma_arcmin[2]
    assert saved.solution().to_dict() == fix.to_dict()


@pytest.mark.parametrize("every", [0.1, 0.2])
def test_fixes_that_come_often_are_all_taken(every):
    """Known long before their samples, or as they come: the same alignment."""
    made, rng = truth_of(car(), 40.0, 50.0), np.random.default_rng(3)
    gnss, record = fixes(made, rng=rng, every=every), noisy(made, SPEC, rng)
    ahead, prompt = stream(keep=20.0), stream(keep=20.0)
    ahead.add(rows_of(gnss))
    ahead.update(record)
    fed(prompt, record, rows_of(gnss), 5)
    prompt.add(rows_of(gnss)[prompt.counts["fixes"] :])
    for moving in (ahead, prompt):
        moving.finish()
        assert moving.solution().used["gnss"] == len(gnss)
    np.testing.assert_array_equal(ahead.solution().quat_nb, prompt.solution().quat_nb)


def test_no_more_fixes_are_held_than_a_receiver_has(drive, monkeypatch):
    from schuler.alignment.moving import fix_queue as module

    monkeypatch.setattr(module, "_MOST_FIXES", 50)
    moving = stream()
    moving.add(rows_of(drive[2]))
    assert (moving.counts["fixes"], moving.counts["surplus_fixes"]) == (50, 51)


def test_bad_chunks_and_rows(drive):
    record = drive[1]
    moving = stream()
    moving.update(record.rows(0, 10))
    with pytest.raises(InputError, match="not after the last sample"):
        moving.update(record.rows(5, 15))
    with pytest.raises(InputError, match="rows of 14"):
        moving.add(np.zeros((2, 3)))
    wrong = rows_of(drive[2])[:1]
    wrong[0, 1] = 2.0
    with pytest.raises(InputError, match="no place on Earth"):
        moving.add(wrong)
    with pytest.raises(InputError, match="latency"):
        StreamSetting(SPEC, latency=-1.0)
    with pytest.raises(InputError, match="samples are kept"):
        StreamSetting(SPEC, keep=5.0)
