"""`Summary`: what a record looks like, and what seems wrong with its units and axes."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.constants import DEG, MICRO_G
from schuler.earth import Site, earth_rate
from schuler.errors import InputError
from schuler.record import ImuRecord, Reading, check_record
from schuler.record.summary import Summariser
from tests.conftest import pieces

SITE = Site(lat=34.246, height=380.0)
GYRO_NOISE, ACCEL_NOISE = 1e-3 * DEG / 60.0, 20.0 * MICRO_G


def standing(seconds=600, rate=100.0, seed=2, latitude=SITE.latitude):
    """Return a level, north-facing record with white noise."""
    rng = np.random.default_rng(seed)
    n, dt = int(seconds * rate), 1.0 / rate
    root = math.sqrt(dt)
    dtheta = earth_rate(latitude) * dt + GYRO_NOISE * root * rng.normal(size=(n, 3))
    dvel = np.array([0, 0, SITE.gravity]) * dt + ACCEL_NOISE * root * rng.normal(size=(n, 3))
    return ImuRecord(100.0 + dt * np.arange(1, n + 1), np.full(n, dt), dtheta, dvel)


def changed(record, *, gyro=1.0, accel=1.0, axes=None):
    """Return a record with other scales, or axes multiplied by a matrix."""
    m = np.eye(3) if axes is None else np.asarray(axes, float)
    return ImuRecord(record.time, record.dt, gyro * record.dtheta @ m.T, accel * record.dvel @ m.T)


def summary_of(record, cuts=()):
    """Return the summary of a record that is fed in pieces."""
    summariser = Summariser()
    for s in pieces(len(record), cuts):
        summariser.push(record.rows(s.start, s.stop))
    return summariser.summary()


def test_numbers():
    record = standing()
    summary = summary_of(record)
    assert (summary.samples, summary.start, summary.end) == (60000, 100.0, record.end)
    assert summary.duration == pytest.approx(600.0)
    assert summary.interval == pytest.approx(0.01)
    np.testing.assert_allclose(summary.mean_rate, record.dtheta.sum(0) / 600.0, rtol=1e-9)
    np.testing.assert_allclose(summary.mean_force, record.dvel.sum(0) / 600.0, rtol=1e-9)
    norm = np.linalg.norm(record.accel, axis=1)
    assert summary.mean_force_norm == pytest.approx(norm.mean(), rel=1e-12, abs=0)
    # 180,000 second differences, which are correlated: well within 1 %.
    assert summary.noise_gyro == pytest.approx(GYRO_NOISE, rel=0.01, abs=0)
    assert summary.noise_accel == pytest.approx(ACCEL_NOISE, rel=0.01, abs=0)
    # White noise over a second: N / sqrt(1 s), from 1800 means.
    assert summary.wander_rate == pytest.approx(GYRO_NOISE, rel=0.08, abs=0)
    assert summary.hints(SITE) == []
    assert summary.hints() == []


@given(st.lists(st.integers(0, 3000), max_size=8))
def test_chunking_does_not_matter(cuts):
    record = standing(30)
    whole, cut = summary_of(record), summary_of(record, cuts)
    np.testing.assert_array_equal(cut.blocks, whole.blocks)
    assert (cut.noise_gyro, cut.stretches) == (whole.noise_gyro, whole.stretches)


def test_memory_is_constant_and_nothing_is_lost():
    # 40,000 stretches of a second do not fit: they are joined, twice or more.
    record = standing(40000, rate=1.0)
    summary = summary_of(record)
    assert len(summary.blocks) <= 8192
    assert summary.samples == 40000
    assert summary.duration == pytest.approx(40000.0)
    np.testing.assert_allclose(summary.blocks[:, 1].sum(), 40000.0, rtol=1e-12)
    np.testing.assert_allclose(summary.mean_rate, record.dtheta.sum(0) / 40000.0, rtol=1e-9)
    assert summary.blocks[:, 12].max() == pytest.approx(np.linalg.norm(record.gyro, axis=1).max())
    assert summary.blocks[:, 13].max() == pytest.approx(np.linalg.norm(record.accel, axis=1).max())
    assert summary.blocks[:, 14].min() == pytest.approx(np.linalg.norm(record.accel, axis=1).min())
    assert np.all(np.diff(summary.blocks[:, 0]) > 0)


def test_quiet_and_disturbed_stretches():
    record = standing(300)
    t = record.time - 100.0
    shaken = (t > 120) & (t <= 180)
    record.dvel[shaken, 0] += 0.01 * 0.5 * np.sin(2 * math.pi * 0.31 * t[shaken])
    summary = summary_of(record)
    kinds = [s.disturbed for s in summary.stretches]
    assert kinds == [False, True, False]
    quiet, loud, after = summary.stretches
    assert (quiet.start, after.end) == (100.0, pytest.approx(400.0))
    assert (quiet.end, loud.end) == (loud.start, after.start)
    # Told apart over thirty seconds.
    assert loud.start == pytest.approx(220.0, abs=30.5)
    assert loud.end == pytest.approx(280.0, abs=30.5)
    assert summary.quiet_seconds == pytest.approx(300.0 - (loud.end - loud.start))


def test_a_quiet_record_is_one_stretch():
    (only,) = summary_of(standing()).stretches
    assert not only.disturbed


def test_nothing_cannot_be_summarised():
    with pytest.raises(InputError, match="the record has no samples to summarise"):
        Summariser().summary()


def test_dictionary_speaks_the_field_s_units():
    found = summary_of(standing()).to_dict(SITE)
    assert json.loads(json.dumps(found)) == found
    assert found["schema"] == "schuler.info/1"
    assert found["mean_rate_norm_deg_h"] == pytest.approx(15.04, abs=0.01)
    assert found["mean_force_norm_m_s2"] == pytest.approx(SITE.gravity, rel=1e-5, abs=0)
    assert found["noise"]["gyro_deg_sqrt_h"] == pytest.approx(0.001, rel=0.02, abs=0)
    assert found["noise"]["accelerometer_ug_sqrt_hz"] == pytest.approx(20.0, rel=0.02, abs=0)
    assert found["quiet_s"] == pytest.approx(600.0)


# -- what seems wrong ----------------------------------------------------------------------

FRD = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"accel": 1 / 9.80665}, "it would fit if the accelerometer values were in g"),
        ({"accel": 1e3 / 9.80665}, "it would fit if the accelerometer values were in mg"),
        ({"accel": 10.0}, "if the accelerometer values were rates, not increments over each"),
        ({"accel": 0.1}, "if the accelerometer values were increments over each interval, not"),
        ({"accel": 1.02}, "+2.0"),
        ({"accel": 0.0}, "the accelerometers read nothing: their mean |f| is zero; check their"),
        ({"accel": 3.3}, "no usual unit fits: check the accelerometer columns and their unit"),
        ({"gyro": 180 / math.pi}, "it would fit if the gyro values were in deg/s"),
        ({"gyro": 3600 * 180 / math.pi}, "it would fit if the gyro values were in deg/h"),
        ({"gyro": 10.0}, "if the gyro values were rates, not increments over each interval"),
        ({"gyro": 0.1}, "if the gyro values were increments over each interval, not rates"),
        ({"gyro": 0.0}, "the gyros read nothing: their mean |w| is zero; check their columns"),
        ({"gyro": 4.0}, "15.04 deg/h; the gyros have a bias of that size (see --spec)"),
        ({"axes": FRD}, "the force points along -z, down in right-front-up axes"),
        ({"axes": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}, "the force points along +x: the body lies"),
        ({"axes": [[1, 0, 0], [0, 0, -1], [0, 1, 0]]}, "the force points along -y: the body lies"),
    ],
)
def test_a_hint_for_each_usual_mistake(change, words):
    # Two hours: on a short record a sway of a degree may pass for the Earth's rate.
    found = summary_of(changed(standing(7200, rate=10.0), **change)).hints(SITE)
    assert len(found) == 1
    assert words in found[0]


@pytest.mark.compiled
def test_a_large_bias_that_is_declared_is_no_mistake():
    record = changed(standing(7200, rate=10.0), gyro=4.0)
    assert summary_of(record).hints(gyro_bias=1e-4) == []


def test_a_short_record_with_dead_gyros():
    (hint,) = summary_of(changed(standing(10), gyro=0.0)).hints(SITE)
    assert hint.startswith("the gyros read nothing")


def test_latitude_of_the_wrong_sign():
    (hint,) = summary_of(standing(7200, rate=10.0, latitude=-SITE.latitude)).hints(SITE)
    assert "says latitude -34.2 deg, not 34.2 deg: is the sign of the latitude right?" in hint


@pytest.mark.compiled
def test_gyros_and_accelerometers_that_do_not_share_axes():
    record = standing(7200, rate=10.0)
    crossed = ImuRecord(record.time, record.dt, record.dtheta[:, [2, 0, 1]], record.dvel)
    (hint,) = summary_of(crossed).hints(SITE)
    assert "do the gyros and the accelerometers share their axes" in hint


RATES = Reading("rates", "rad/s", "m/s^2")


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("reading", "change", "words", "never"),
    [
        (RATES, {"accel": 1 / 9.80665}, "in g", "rates, not increments"),
        (RATES, {"accel": 10.0}, "no usual unit fits", "not increments"),
        (RATES, {"accel": 0.1}, "were increments over each interval, not rates", "in mg"),
        (RATES, {"gyro": 180 / math.pi}, "in deg/s", "increments"),
        (Reading("rates", "deg/s", "g"), {"accel": 9.80665}, "in m/s^2", "in mg"),
        (Reading("rates", "deg/h", "mg"), {"gyro": 1 / 3600.0}, "in deg/s", "rad/s"),
        (Reading("rates", "rad/s", "m/s^2", units_said=False), {"accel": 1 / 9.80665},
         "in g (both units were assumed: say --gyro and --accel)", "increments"),
        (Reading("increments", "rad", "m/s"), {"accel": 0.5},
         "half of it, so a row's increments cover half the time", "unit"),
        (Reading("increments", "rad", "m/s"), {"accel": 2.0}, "twice of it", "unit"),
        (Reading("increments", "rad", "m/s"), {"accel": 1 / 9.80665}, "in g*s", "in mg"),
        (Reading("increments", "rad", "m/s"), {"accel": 10.0},
         "rates, not increments over each interval", "in g"),
        (Reading("rates", "rad/s", "m/s^2", fixed=True), {"accel": 1 / 9.80665},
         "the format fixes the unit", "it would fit"),
        (Reading("rates", "rad/s", "m/s^2", fixed=True), {"gyro": 180 / math.pi},
         "or columns are wrong", "it would fit"),
    ],
)  # fmt: skip
def test_a_hint_fits_how_the_values_were_read(reading, change, words, never):
    summary = summary_of(changed(standing(7200, rate=10.0), **change))
    (hint,) = check_record(summary, reading, SITE)
    assert words in hint
    assert never not in hint


def test_what_may_move_is_only_told_of_units():
    summary = summary_of(changed(standing(600, rate=10.0), gyro=10.0, accel=1.02, axes=FRD))
    assert check_record(summary, RATES, SITE, at_rest=False) == []
    summary = summary_of(changed(standing(600, rate=10.0), accel=1 / 9.80665))
    (hint,) = check_record(summary, RATES, at_rest=False)
    assert "in g" in hint


def turning(rate_deg_s, seconds=300, axis=(1.0, 0.3, 0.2), tremble=0.0):
    """Return a record of a unit that turns all the time about an axis of its own."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(5)
    n, dt = seconds * 50, 0.02
    t = dt * np.arange(1, n + 1)
    unit = np.array(axis) / np.linalg.norm(axis)
    w = np.outer(np.full(n, rate_deg_s * DEG), unit)
    f = Rotation.from_rotvec(np.outer(rate_deg_s * DEG * t, unit)).inv().apply([0, 0, SITE.gravity])
    f += tremble * rng.normal(size=(n, 3))
    return ImuRecord(t, np.full(n, dt), w * dt, f * dt)


@pytest.mark.parametrize("rate", [0.5, 5.0, 40.0, 400.0])
def test_a_tumbling_unit_is_quiet_nowhere(rate):
    summary = summary_of(turning(rate))
    assert summary.turned
    assert summary.quiet_seconds == 0.0
    assert [s.disturbed for s in summary.stretches] == [True]
    # At rest nowhere: nothing is said of axes and of the Earth's rate.
    assert check_record(summary, RATES, SITE) == []


def test_a_unit_that_is_picked_up_is_at_rest_before():
    quiet, moved = standing(300, rate=50.0), turning(30.0)
    both = ImuRecord.concatenate(
        [quiet, ImuRecord(moved.time + quiet.end, moved.dt, moved.dtheta, moved.dvel)]
    )
    summary = summary_of(both)
    assert not summary.turned
    assert summary.quiet_seconds == pytest.approx(300.0, abs=31.0)


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(20))
def test_a_truck_with_its_crew_is_at_rest(seed):
    from schuler.motion import DisturbedVehicle
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    rng = np.random.default_rng(seed)
    truck = DisturbedVehicle.draw(rng, 60.0, heading=123.0)
    record = simulate(truck, SITE, 60.0, 50.0, GRADES["navigation-fog"], rng).record
    assert not any(s.moved for s in summary_of(record).stretches)


def test_a_wrong_unit_moves_nothing():
    for change in ({"gyro": 180 / math.pi * 3600}, {"accel": 1 / 9.80665}, {"accel": 1e3}):
        assert not summary_of(changed(standing(100), **change)).turned


@pytest.mark.compiled
@pytest.mark.parametrize("repeats", [1, 5])
def test_noise_is_that_of_the_values_as_they_came(repeats):
    """White rates at 100 Hz, also where a file holds each five times: 0.3 deg/sqrt(h), to 2 %."""
    rng = np.random.default_rng(5)
    x = np.repeat(rng.normal(size=(6000, 6)), repeats, axis=0)
    x *= np.repeat([np.deg2rad(0.05), 0.01], 3)
    t = np.arange(1, len(x) + 1) / (100.0 * repeats)
    summary = summary_of(ImuRecord.from_rates(t, x[:, :3], x[:, 3:]), cuts=(700, 3001))
    assert summary.noise_gyro == pytest.approx(np.deg2rad(0.05) / 10.0, rel=0.02)
    assert summary.noise_accel == pytest.approx(0.001, rel=0.02)
