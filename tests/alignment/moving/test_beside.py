"""Headings and heights beside the fixes of an alignment in motion."""

from __future__ import annotations

import numpy as np
import pytest

import schuler as sc
from schuler.aiding import HeadingFixes, Height
from schuler.alignment import align_moving_windows
from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.errors import InputError
from schuler.sensors import GRADES
from tests.alignment.moving.routes import (
    SITE,
    fixes,
    heading_error,
    noisy,
    ship,
    straight,
    truth_of,
)

SPEC = GRADES["tactical-fog"]
OFFSET = 3.0


@pytest.fixture(scope="module")
def made():
    return truth_of(ship(), 60.0)


def beside(made, rng, end=60.0):
    """Return a compass of 0.2 deg and a barometer that is off by three metres, once a second."""
    rows = np.searchsorted(made.truth.time, np.arange(1.0, end) - 1e-6)
    time = made.truth.time[rows]
    heading = psi_to_heading(quat_to_euler(made.truth.quat_nb[rows])[:, 0])
    heading = heading + 0.2 * DEG * rng.standard_normal(len(rows))
    height = made.truth.height[rows] + OFFSET + 0.1 * rng.standard_normal(len(rows))
    return (
        HeadingFixes(time, heading, 0.2 * DEG),
        Height(time, height, 0.1, offset_sigma=5.0, offset_time=3600.0),
    )


def test_headings_make_a_slow_ship_s_heading_known(made):
    """Twelve runs: error by sigma within chance, and far below that of fixes alone."""
    squares, heights = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, "tactical-fog", rng)
        heading, height = beside(made, rng)
        fix = sc.align(record, SITE, aiding=[gnss, heading, height], spec=SPEC, vibration=0.0)
        error = heading_error(fix.quat_nb, made.truth.quat_nb[len(record)])[2]
        squares.append((error / ARCMIN / fix.sigma_arcmin[2]) ** 2)
        assert fix.sigma_arcmin[2] < 3.0
        assert fix.consistent
        assert fix.used["heading"] == fix.used["height"] == 59
        up = fix.state.height - made.truth.height[len(record)]
        heights.append(up**2 / fix.state.covariance[8, 8])
        off = float(fix.state.parameters["height.offset"][0])
        assert off == pytest.approx(OFFSET, abs=4.0 * np.sqrt(fix.state.covariance[8, 8]))
    # Chi-square of 12 at 1e-3 and 1 - 1e-3, over 12.
    assert 0.18 < np.mean(squares) < 2.75
    assert 0.18 < np.mean(heights) < 2.75
    alone = sc.align(record, SITE, aiding=gnss, spec=SPEC, vibration=0.0)
    assert alone.sigma_arcmin[2] > 100.0


def test_a_straight_drive_with_headings_has_a_heading():
    """The motion shows none: the fixes begin it, wherever the vehicle points."""
    made = truth_of(straight(), 40.0)
    squares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, "tactical-fog", rng)
        heading, _ = beside(made, rng, 40.0)
        with pytest.raises(InputError, match="brake or turn"):
            sc.align(record, SITE, aiding=gnss, spec=SPEC, vibration=0.0)
        fix = sc.align(record, SITE, aiding=[gnss, heading], spec=SPEC, vibration=0.0)
        error = heading_error(fix.quat_nb, made.truth.quat_nb[len(record)])[2]
        squares.append((error / ARCMIN / fix.sigma_arcmin[2]) ** 2)
        assert fix.sigma_arcmin[2] < 5.0
        assert fix.consistent
    # Chi-square of 8 at 1e-3 and 1 - 1e-3, over 8.
    assert 0.1 < np.mean(squares) < 3.3


def test_windows_take_them_too(made):
    rng = np.random.default_rng(3)
    gnss, record = fixes(made, rng=rng), noisy(made, "tactical-fog", rng)
    heading, height = beside(made, rng)
    found = align_moving_windows(record, [gnss, heading, height], 30.0, SITE, SPEC, vibration=0.0)
    assert len(found.each) == 2
    assert all(each.sigma_arcmin[2] < 4.0 for each in found.each)


def test_what_does_not_fit_is_one_sentence(made):
    rng = np.random.default_rng(3)
    gnss, record = fixes(made, rng=rng), noisy(made, "tactical-fog", rng)
    heading, height = beside(made, rng)
    for aiding, said in (
        ([heading, height], "needs aids: give GnssFixes"),
        ([gnss, heading, heading], "two aids have the name 'heading'"),
        ([gnss, HeadingFixes([900.0, 901.0], [0.1, 0.1])], "none of its times lies within"),
    ):
        with pytest.raises(InputError, match=said):
            sc.align(record, SITE, aiding=aiding, spec=SPEC)
