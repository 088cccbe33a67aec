"""Aids that are worse than they say: their noise is learned from the innovations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.navigation import AidingOptions, navigate_aided
from schuler.sensors import GRADES
from tests.alignment.moving.routes import car, fixes, noisy, truth_of
from tests.navigation.aided_table import error_at

LENGTH, SIGMA = 120.0, 1.0
SPEC = GRADES["tactical-fog"]


def place_nees(perfect, stated, adaptive, seeds):
    """Return NEES/3 of the position at the end; fixes scatter by one metre and state another."""
    out = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 3])
        made = noisy(perfect, "tactical-fog", rng)
        gnss = fixes(perfect, sigma=SIGMA, v_sigma=0.1, rng=rng, first=1.0)
        share = stated / SIGMA
        gnss = replace(
            gnss, sigma=share * np.asarray(gnss.sigma), v_sigma=share * np.asarray(gnss.v_sigma)
        )
        options = AidingOptions(vibration=1e-4, adaptive=adaptive)
        found = navigate_aided(made, gnss, spec=SPEC, options=options)
        error, _ = error_at(found.path, perfect.truth, found.path.time[-1])
        place = error[6:]
        out.append(place @ np.linalg.solve(found.path.covariance[6:9, 6:9], place) / 3.0)
    return float(np.mean(out))


def test_what_innovations_show_of_an_aid_s_noise_enters_sigma():
    perfect = truth_of(car(), LENGTH)
    seeds = range(8)
    believed = place_nees(perfect, 0.25, 0.0, seeds)
    learned = place_nees(perfect, 0.25, 0.05, seeds)
    right = place_nees(perfect, 1.0, 0.05, seeds)
    # Of 8 runs of 3 values the 99.9 % band of a mean is 0.31 to 2.1.
    assert believed > 4.0
    assert learned < 2.1
    assert 0.2 < right < 2.1
