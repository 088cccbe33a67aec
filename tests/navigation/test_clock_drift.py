"""Clocks that drift apart: an estimated delay is a walk, and its sigma holds what it has become."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.navigation import AidingOptions, navigate_aided
from schuler.sensors import GRADES
from tests.alignment.moving.routes import car, fixes, noisy, truth_of

DRIFT, DELAY, LENGTH = 1e-4, 0.03, 200.0


def scores(perfect, seeds, drift):
    """Return errors over sigma of the delays at the end, where clocks drift by `DRIFT` rms."""
    out = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        made = noisy(perfect, "tactical-fog", rng)
        rate = DRIFT * rng.choice([-1.0, 1.0])
        gnss = fixes(perfect, sigma=0.05, v_sigma=0.02, rng=rng, first=1.0)
        stamps = np.asarray(gnss.time) * (1.0 + rate) + DELAY
        gnss = replace(gnss, time=stamps, estimate=("delay",)).rows(stamps < LENGTH - 0.1)
        options = AidingOptions(vibration=1e-4, clock_drift=drift)
        found = navigate_aided(made, gnss, spec=GRADES["tactical-fog"], options=options)
        value, sigma = found.estimated["delay_s"]["gnss"]
        out.append((value - DELAY - rate * LENGTH) / sigma)
    return np.array(out)


def test_sigma_of_a_delay_holds_a_drift_that_is_said():
    perfect = truth_of(car(), LENGTH)
    assert np.sqrt(np.mean(scores(perfect, range(5), DRIFT) ** 2)) < 2.0
    # A constant delay follows by half the drift, and its sigma says nothing of it.
    assert np.abs(scores(perfect, range(2), 0.0)).min() > 2.0
