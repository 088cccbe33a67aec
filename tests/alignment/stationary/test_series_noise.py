"""Noise of the series: kept for lengths that differ in their last digits only."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment.stationary.series_noise import (
    rounded_lengths,
    specified_noise,
    white_noise,
)
from schuler.sensors import GRADES

DT = np.full(24, 0.3)


def test_white_noise_is_that_of_drawn_increments():
    rng = np.random.default_rng(1)
    wander, unit = white_noise(DT, 9.8)
    fine = 40
    steps = rng.normal(size=(4000, len(DT) * fine)) * np.sqrt(DT[0] / fine)
    walk = np.cumsum(steps, axis=1) - 0.5 * steps
    mean = walk.reshape(4000, len(DT), fine).mean(axis=2)
    found = mean.T @ mean / 4000
    # 4,000 draws: a variance is known within 2.2 %, and the largest of 24 within four times that.
    np.testing.assert_allclose(np.diag(found), np.diag(wander), rtol=0.1)
    np.testing.assert_allclose(unit[: len(DT), : len(DT)], wander)
    assert unit[-1, -1] == pytest.approx(DT.sum())


def test_time_stamps_that_are_rounded_otherwise_give_the_same_arrays():
    late = np.diff(np.arange(len(DT) + 1) * 0.3 + 12345.6)
    assert not np.array_equal(late, DT)
    assert rounded_lengths(late) == rounded_lengths(DT)
    assert white_noise(late, 9.8)[1] is white_noise(DT, 9.8)[1]
    spec = GRADES["navigation-fog"]
    assert specified_noise(late, 0.01, 9.8, spec)[0] is specified_noise(DT, 0.01, 9.8, spec)[0]


def test_other_lengths_and_instruments_have_their_own():
    fog, mems = GRADES["navigation-fog"], GRADES["tactical-fog"]
    one = specified_noise(DT, 0.01, 9.8, fog)
    assert not np.array_equal(one[1], specified_noise(1.001 * DT, 0.01, 9.8, fog)[1])
    assert not np.array_equal(one[1], specified_noise(DT, 0.01, 9.8, mems)[1])
    with pytest.raises(ValueError, match="read-only"):
        one[0][0, 0] = 1.0
