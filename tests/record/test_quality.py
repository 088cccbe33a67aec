"""`Quality`: each finding is one plain sentence, and a clean record has none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.record import ImuRecord


def clean(rng, n=2000):
    """Return 100 Hz mean rates of a resting instrument."""
    t = 0.01 * np.arange(1, n + 1)
    x = np.array([0, 5e-5, 4e-5, 0, 0, 9.8]) + rng.normal(size=(n, 6)) * [*[1e-5] * 3, *[1e-3] * 3]
    return t, x


def quality_of(t, x, **options):
    """Return what the import found."""
    return ImuRecord.from_mean_rates(t, x[:, :3], x[:, 3:], **options).quality


def test_a_clean_record_has_nothing_to_say(rng):
    t, x = clean(rng)
    quality = quality_of(t, x)
    assert quality.warnings() == []
    assert (quality.rows, quality.valid_rows) == (2000, 2000)
    assert quality.nominal_dt == pytest.approx(0.01, rel=1e-12, abs=0)
    assert quality.jitter_rms == 0.0
    np.testing.assert_allclose(quality.mean, x.mean(0), rtol=1e-12)
    np.testing.assert_allclose(quality.std, x.std(0), rtol=1e-6)
    assert quality.mean_norm_accel == pytest.approx(9.8, rel=1e-4, abs=0)
    assert quality.mean_norm_gyro == pytest.approx(np.linalg.norm(x[:, :3], axis=1).mean())


def test_rows_that_are_not_finite(rng):
    t, x = clean(rng)
    x[[700, 900], [4, 1]] = math.nan
    assert quality_of(t, x).warnings()[0] == (
        "2 row(s) with a value that is not a number were dropped, "
        "the first at data row 701 (t = 7.01 s), accel y"
    )


def test_repeated_rows(rng):
    t, x = clean(rng)
    t, x = np.insert(t, 4, t[3]), np.insert(x, 4, x[3], axis=0)
    assert quality_of(t, x).warnings() == ["1 row(s) that repeat the row before them were dropped"]


def test_gaps(rng):
    t, x = clean(rng)
    keep = np.ones(len(t), bool)
    keep[500:503] = keep[1200] = False
    assert quality_of(t[keep], x[keep]).warnings() == [
        "2 gap(s) bridged by interpolation, the first after t = 5 s, the longest 0.04 s"
    ]


def test_jitter(rng):
    t, x = clean(rng)
    t = t + rng.uniform(-2e-3, 2e-3, len(t))
    quality = quality_of(t, x)
    steps = np.diff(t)
    assert quality.jitter_rms == pytest.approx(steps.std(), rel=1e-9, abs=0)
    assert quality.shortest_dt == steps.min()
    assert quality.longest_dt == steps.max()
    (sentence,) = quality.warnings()
    assert sentence.startswith("the time stamps jitter by 1.6")
    assert "ms rms around 10" in sentence
    assert sentence.endswith("give its rate instead of the time column")


def test_rounded_stamps_are_no_jitter(rng):
    t, x = clean(rng)
    assert quality_of(t + 1.7e9, x).warnings() == []


def test_saturation(rng):
    t, x = clean(rng)
    burst = slice(800, 900)
    x[burst, 1] += 0.5 * np.sin(2 * math.pi * t[burst])
    x[:, 1] = np.clip(x[:, 1], -0.4, 0.4)
    run = int((x[:, 1] == 0.4).sum())
    assert quality_of(t, x).warnings() == [
        f"gyro y stays at its extreme 0.4 for {run} rows running ({2 * run} rows in all): "
        "saturated?"
    ]


def test_coarse_quantisation_is_not_saturation(rng):
    t, x = clean(rng)
    x = np.round(x / 1e-3) * 1e-3 + [1e-3, 0, 0, 0, 0, 0]
    x[::7, :3] += 1e-3
    assert not any("saturated" in s for s in quality_of(t, x).warnings())


def test_a_stuck_channel(rng):
    t, x = clean(rng)
    x[:, 3] = 0.125
    assert quality_of(t, x).warnings() == [
        "accel x is 0.125 in every row: is the channel connected?"
    ]
