"""`Intake` and `ImuRecord.from_*`: increments against analytic integrals, errors, chunking."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.errors import InputError
from schuler.record import ImuRecord, Intake
from tests.conftest import pieces

AMPLITUDE = np.array([0.3, -0.2, 0.1, 1.5, -0.7, 0.4])
OFFSET = np.array([1e-5, 5e-5, 4e-5, 0.1, -0.2, 9.8])
OMEGA = 2.0 * math.pi * 1.3


def rate(t):
    """Return six rates at times t."""
    return OFFSET + AMPLITUDE * np.sin(OMEGA * np.asarray(t)[..., None] + np.arange(6))


def integral(a, b):
    """Return the integrals of the six rates from a to b, exactly."""

    def inner(t):
        return -AMPLITUDE / OMEGA * np.cos(OMEGA * np.asarray(t)[..., None] + np.arange(6))

    return OFFSET * (np.asarray(b) - a)[..., None] + inner(b) - inner(a)


def rows(n=1000, dt=0.01):
    """Return times of n rows."""
    return dt * np.arange(1, n + 1)


def values_of(record):
    """Return the increments side by side."""
    return np.hstack([record.dtheta, record.dvel])


# -- the three kinds -----------------------------------------------------------------------


@pytest.mark.parametrize(("dt", "worst"), [(0.01, 1.0), (0.005, 1.0 / 16.0)])
def test_rates_are_integrated_to_fourth_order(dt, worst):
    t = rows(400, dt)
    x = rate(t)
    record = ImuRecord.from_rates(t, x[:, :3], x[:, 3:])
    assert len(record) == len(t) - 1
    assert record.start == pytest.approx(t[0], abs=1e-14)
    assert record.end == t[-1]
    error = values_of(record) - integral(record.time - record.dt, record.time)
    # Adams-Moulton's local error: dt^4 x'''/24.
    bound = worst * 1.1 * 0.01**4 / 24.0 * OMEGA**3 * np.abs(AMPLITUDE)
    assert np.all(np.abs(error[1:]) < bound)
    assert np.any(np.abs(error[1:]) > 0.5 * bound)


def test_mean_rates_are_exact():
    t = rows()
    x = integral(t - 0.01, t) / 0.01
    record = ImuRecord.from_mean_rates(t, x[:, :3], x[:, 3:])
    assert len(record) == len(t)
    np.testing.assert_allclose(record.dt, 0.01, rtol=1e-10)
    np.testing.assert_allclose(values_of(record), integral(t - 0.01, t), rtol=1e-10, atol=1e-15)
    np.testing.assert_allclose(record.gyro, x[:, :3], rtol=1e-14)
    np.testing.assert_allclose(record.accel, x[:, 3:], rtol=1e-14)


def test_increments_pass_unchanged():
    t = rows()
    x = integral(t - 0.01, t)
    record = ImuRecord.from_increments(
        t, x[:, :3], x[:, 3:], coning_corrected=True, sculling_corrected=True, name="lab"
    )
    np.testing.assert_array_equal(values_of(record), x)
    assert record.coning_corrected
    assert record.sculling_corrected
    assert record.name == "lab"
    assert not ImuRecord.from_increments(t, x[:, :3], x[:, 3:]).coning_corrected


def test_total_angle_survives_bridged_holes():
    t = rows()
    x = np.tile(OFFSET, (len(t), 1))
    keep = np.ones(len(t), bool)
    keep[[100, 101, 500]] = False
    for make in (ImuRecord.from_rates, ImuRecord.from_mean_rates):
        record = make(t[keep], x[keep, :3], x[keep, 3:])
        np.testing.assert_allclose(values_of(record).sum(0), OFFSET * record.duration, rtol=1e-12)
        assert record.quality.gaps == 2
        assert record.quality.longest_gap == pytest.approx(0.03)
    record = ImuRecord.from_increments(t[keep], 0.01 * x[keep, :3], 0.01 * x[keep, 3:])
    np.testing.assert_allclose(values_of(record).sum(0), OFFSET * record.duration, rtol=1e-12)


def test_a_given_rate_is_the_nominal_one():
    t = rows(50)
    x = rate(t)
    record = ImuRecord.from_mean_rates(t, x[:, :3], x[:, 3:], rate=100.0)
    assert record.quality.nominal_dt == 0.01
    assert record.dt[0] == 0.01


# -- what is refused -----------------------------------------------------------------------


def imported(t, x=None, **options):
    """Push rows through an intake of increments."""
    t = np.asarray(t, float)
    x = np.arange(6.0 * len(t)).reshape(-1, 6) if x is None else np.asarray(x, float)
    return ImuRecord.from_increments(t, x[:, :3], x[:, 3:], **options)


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (
            lambda t: t.__setitem__(6, 0.035),
            "data row 7 (t = 0.035 s): time goes backward, from 0.06 s; sort the rows, or cut",
        ),
        (
            lambda t: t.__setitem__(6, t[5]),
            "data row 7 (t = 0.06 s): the time of the row before is repeated with other values;",
        ),
        (
            lambda t: t.__setitem__(slice(6, None), t[6:] + 1.0),
            "data row 7 (t = 1.07 s): a gap of 1.01 s since t = 0.06 s is longer than the 0.065 s",
        ),
        (lambda t: t.__setitem__(6, math.nan), "data row 7: the time is not a finite number;"),
        (lambda t: t.__setitem__(0, math.inf), "data row 1: the time is not a finite number;"),
        (lambda t: t.fill(3.0), "time does not advance in the first 20 data rows (t = 3 s)"),
    ],
)
def test_bad_time_is_an_error_that_names_the_row(spoil, sentence):
    t = rows(20)
    spoil(t)
    with pytest.raises(InputError) as error:
        imported(t)
    assert str(error.value).startswith(sentence)


def test_the_row_is_counted_over_chunks():
    intake = Intake("increments", rate=100.0)
    t = rows(20)
    x = np.arange(120.0).reshape(20, 6)
    intake.push(t[:8], x[:8])
    intake.push(t[8:] + 1.0, x[8:])
    with pytest.raises(InputError, match=r"data row 9 \(t = 1.09 s\): a gap of 1.01 s"):
        intake.close()


def test_max_gap_lets_a_gap_through():
    t = rows(20)
    t[10:] += 1.0
    record = imported(t, max_gap=2.0)
    assert record.dt[10] == pytest.approx(1.01)
    with pytest.raises(InputError, match=r"longer than the 0\.5 s that can be bridged"):
        imported(t, max_gap=0.5)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: imported([]), "the record is empty: no data rows were found"),
        (lambda: imported([1.0]), "the record has only one data row: at least two"),
        (lambda: Intake("angles"), "kind must be one of rates, mean-rates, increments, got"),
        (lambda: Intake("rates", rate=0.0), "the rate must be a positive number of Hz, got 0.0"),
        (lambda: Intake("rates", rate=math.nan), "the rate must be a positive number of Hz"),
        (lambda: Intake("rates", max_gap=-1.0), "the longest gap must be a positive time, got -1"),
        (
            lambda: Intake("rates").push(np.zeros(3), np.zeros((3, 5))),
            "expected 3 rows of 6 values, got an array of shape (3, 5)",
        ),
        (
            lambda: imported(rows(5), np.full((5, 6), math.nan)),
            "the record has no samples",
        ),
    ],
)
def test_refusals(call, sentence):
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(sentence)


# -- intervals that are known --------------------------------------------------------------


def saved(n=600):
    """Return rows of a saved record: a gap that was bridged, and one that was not."""
    dt = np.full(n, 0.01)
    dt[40] = 0.05
    t = np.cumsum(dt)
    t[300:] += 0.03
    return t, integral(t - dt, t), dt


@given(cuts=st.lists(st.integers(0, 600), max_size=8))
def test_known_intervals_are_kept_as_they_are(cuts):
    t, x, dt = saved()
    intake = Intake("increments")
    parts = [intake.push(t[s], x[s], dt[s]) for s in pieces(len(t), cuts)]
    record = ImuRecord.concatenate([p for p in [*parts, intake.close()] if len(p)])
    np.testing.assert_array_equal(record.time, t)
    np.testing.assert_array_equal(record.dt, dt)
    np.testing.assert_array_equal(values_of(record), x)
    assert intake.quality().nominal_dt == 0.01


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda dt: dt.__setitem__(9, 0.0), "data row 10 (t = 0.1 s): the interval dt = 0 s must"),
        (lambda dt: dt.__setitem__(9, math.nan), "data row 10 (t = 0.1 s): the interval dt = nan"),
        (
            lambda dt: dt.__setitem__(300, 0.5),
            "data row 301 (t = 3.08 s): its interval dt is longer than the 0.04 s since the row",
        ),
    ],
)
def test_impossible_intervals_are_errors(spoil, sentence):
    t, x, dt = saved()
    spoil(dt)
    with pytest.raises(InputError) as error:
        Intake("increments").push(t, x, dt)
    assert str(error.value).startswith(sentence)


def test_intervals_need_increments():
    t, x, dt = saved()
    with pytest.raises(InputError, match="interval lengths need increments and one for each of"):
        Intake("rates").push(t, x, dt)
    with pytest.raises(InputError, match="interval lengths need increments and one for each of"):
        Intake("increments").push(t, x, dt[:-1])


def test_rows_left_out_before_count():
    intake = Intake("increments", rate=100.0)
    intake.skip(1000)
    intake.push(np.array([0.01, 0.02, 0.01]), np.zeros((3, 6)))
    with pytest.raises(InputError, match=r"data row 1003 \(t = 0.01 s\): time goes backward"):
        intake.close()


# -- any chunking gives the same bits ------------------------------------------------------


def troubled(n=700):
    """Return rows with jitter, holes, rows that are not finite and a repetition."""
    rng = np.random.default_rng(5)
    t = rows(n) + rng.normal(scale=2e-4, size=n)
    x = rate(t)
    x[[50, 300, 301], [1, 3, 0]] = math.nan
    x[[0, 90, 450, 699], [2, 4, 0, 5]] += 30.0
    keep = np.ones(n, bool)
    keep[[120, 121, 260, 600]] = False
    t, x = t[keep], x[keep]
    return np.insert(t, 400, t[399]), np.insert(x, 400, x[399], axis=0)


@pytest.mark.parametrize("kind", ["rates", "mean-rates", "increments"])
@given(cuts=st.lists(st.integers(0, 700), max_size=12), rate=st.sampled_from([None, 100.0]))
def test_chunking_does_not_matter(kind, cuts, rate):
    t, x = troubled()

    def run(slices):
        intake = Intake(kind, rate=rate)
        parts = [intake.push(t[s], x[s]) for s in slices]
        parts.append(intake.close())
        record = ImuRecord.concatenate([p for p in parts if len(p)])
        return record, intake.quality()

    whole, quality = run([slice(0, len(t))])
    cut, cut_quality = run(pieces(len(t), cuts))
    for field in ("time", "dt", "dtheta", "dvel", "values"):
        np.testing.assert_array_equal(getattr(cut, field), getattr(whole, field))
    assert cut_quality == quality
    assert (quality.not_finite, quality.repeated, quality.gaps) == (3, 1, 5)
    assert [(s.channel, s.row) for s in quality.spikes] == [
        ("gyro z", 1), ("accel y", 91), ("gyro x", 449), ("accel z", 697),
    ]  # fmt: skip
