"""North on a real, disturbed vehicle: the figures of the benchmark."""

from __future__ import annotations

import numpy as np
import pytest

import schuler as sc
from schuler.alignment import align, align_windows

pytestmark = pytest.mark.realdata


@pytest.fixture(scope="module")
def laser(data_dir):
    return sc.read(data_dir / "psins_lasergyro_vehicle" / "lasergyro.imu")


SITE = sc.Site(34.246048, 108.909664, 380.0)


@pytest.mark.parametrize(
    ("length", "windows", "std"), [(60, 30, 4.5), (100, 18, 1.9), (150, 12, 1.1), (300, 6, 0.9)]
)
def test_repeatability_of_the_default(laser, length, windows, std):
    w = align_windows(laser, SITE, length, at="start")
    assert len(w.each) == windows
    assert w.std_heading_arcmin <= std
    assert w.mean_heading_deg == pytest.approx(90.60, abs=0.03)


@pytest.mark.parametrize("method", ["centred", "wahba", "integral-triad"])
def test_predicted_sigma_against_the_spread(laser, method):
    w = align_windows(laser, SITE, 100.0, method, at="start")
    # A bias that is the same in all windows does not spread them.
    sigma = np.array([np.sqrt(x.budget_arcmin2["disturbance"]) for x in w.each])
    assert 0.5 < np.sqrt(np.mean(sigma**2)) / w.std_heading_arcmin < 2.0
    assert 0.5 < sigma.mean() / w.std_heading_arcmin < 2.0


def test_normalised_errors_window_by_window(laser):
    """Each window's own sigma fits its own error: rms between 0.6 and 1.6."""
    w = align_windows(laser, SITE, 60.0, at="start")
    off = np.array([(x.heading_deg - w.mean_heading_deg) * 60 / x.sigma_arcmin[2] for x in w.each])
    assert 0.6 < np.sqrt(np.mean(off**2)) < 1.6


def test_the_scale_line_read_as_a_sample_gives_the_known_wrong_figures(laser):
    """About 97' and 167' come from taking the header's scale factors for the first sample."""
    first = laser.rows(0, 1)
    from dataclasses import replace

    bad = replace(
        first,
        dtheta=np.full((1, 3), np.deg2rad(0.1 * 0.1 / 3600)),
        dvel=np.full((1, 3), 125.0 * 125e-6 * 9.780327),
    )
    shifted = replace(laser, time=laser.time + 0.01)
    both = sc.ImuRecord.concatenate([bad, shifted])
    spreads = {}
    for method in ("integral-triad", "wahba"):
        w = align_windows(both, SITE, 100.0, method, at="start")
        n = len(w.each)
        spreads[method] = w.std_heading_arcmin * np.sqrt((n - 1) / n)
    assert spreads["integral-triad"] == pytest.approx(97, abs=1)
    assert spreads["wahba"] == pytest.approx(167, abs=1)


def test_whole_record(laser):
    fix = align(laser, SITE, spec="navigation-rlg")
    assert fix.samples == 184718
    assert fix.heading_deg == pytest.approx(90.60, abs=0.03)
    assert 0.3 < fix.sigma_arcmin[2] < 2.0
