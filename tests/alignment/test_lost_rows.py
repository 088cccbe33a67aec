"""What lost rows cost an alignment: interpolated, next to nothing, and sigma says what it is."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import Aligner, Site
from schuler.alignment import align
from schuler.motion import DisturbedVehicle, Static
from schuler.record import ImuRecord
from schuler.sensors import load_spec
from schuler.simulation import simulate

SITE = Site(48.1)


def without(record, lost):
    """Return the record as a file without some of its rows gives it."""
    keep = np.ones(len(record), bool)
    keep[lost] = False
    return ImuRecord.from_increments(
        record.time[keep], record.dtheta[keep], record.dvel[keep], max_gap=10.0
    )


def off(fix, truth):
    """Return the heading's error, deg."""
    return (fix.heading_deg - truth + 180.0) % 360.0 - 180.0


@pytest.mark.slow
@pytest.mark.parametrize("length", [5, 40])
def test_sigma_is_consistent_where_a_fifth_of_the_record_is_bridged(length):
    """rms(error/sigma) of 50 records at rest, navigation grade, in 0.7 to 1.3."""
    spec = load_spec("navigation-fog")
    z = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        made = simulate(Static(rng.uniform(0.0, 360.0)), SITE, 120.0, 25.0, spec, rng)
        starts = np.arange(5 * length, len(made.record) - 5 * length, 5 * length)
        starts = starts + rng.integers(0, 4 * length, len(starts))
        lost = (starts[:, None] + np.arange(length)).ravel()
        fix = align(without(made.record, lost), SITE, spec=spec)
        pitch = 60.0 * fix.pitch_deg / np.sqrt(np.mean(np.square(fix.sigma_arcmin[:2])))
        z.append((off(fix, made.heading_deg()) / (fix.sigma_arcmin[2] / 60.0), pitch))
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert np.all((rms > 0.7) & (rms < 1.3))


def test_lost_rows_are_no_contradiction():
    """Sixteen good records, a fifth lost in gaps up to a second: none is said to be inconsistent.

    Means over stretches with such gaps are those of other instants than their middles; taken for
    these, the Earth's turn between looked like a gyro bias in four of the sixteen. A good record
    is contradicted with a probability of 1e-3, so that the test has no cause to fail by chance.
    """
    spec = load_spec("navigation-fog")
    for seed in range(1010, 1026):
        rng = np.random.default_rng(seed)
        made = simulate(Static(rng.uniform(0.0, 360.0)), SITE, 120.0, 50.0, spec, rng)
        n = len(made.record)
        keep = np.ones(n, bool)
        while keep.mean() > 0.8:
            at = int(rng.integers(300, n - 60))
            keep[at : at + int(rng.integers(1, 50))] = False
        fix = align(without(made.record, np.flatnonzero(~keep)), SITE, spec=spec)
        assert fix.consistent, f"seed {seed}: {fix.contradictions}"


@pytest.mark.slow
def test_one_lost_row_of_a_moving_base_costs_nothing():
    """Twelve disturbed vehicles: less than a tenth of the heading's error, and of its sigma."""
    spec = load_spec("navigation-fog")
    whole, spoilt = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        motion = DisturbedVehicle.draw(rng, 120.0, heading=rng.uniform(0.0, 360.0))
        made = simulate(motion, SITE, 120.0, 100.0, spec, rng)
        fix = align(made.record, SITE, spec=spec)
        other = align(without(made.record, [int(rng.integers(300, 11_700))]), SITE, spec=spec)
        assert other.sigma_arcmin[2] == pytest.approx(fix.sigma_arcmin[2], rel=0.1)
        whole.append(off(fix, made.heading_deg()))
        spoilt.append(off(other, made.heading_deg()))
    change = np.sqrt(np.mean(np.square(np.subtract(spoilt, whole))))
    assert change < 0.1 * np.sqrt(np.mean(np.square(whole)))


def test_what_was_lost_is_known_after_a_restart():
    """A saved aligner gives the sigma of the one that was saved: 2 % of the rows are lost."""
    spec, rng = load_spec("navigation-fog"), np.random.default_rng(1)
    motion = DisturbedVehicle.draw(rng, 60.0, heading=30.0)
    record = simulate(motion, SITE, 60.0, 50.0, spec, rng).record
    record = without(record, rng.choice(np.arange(100, 2900), 60, replace=False))
    one = Aligner(SITE, spec=spec).update(record)
    other = one.fresh()
    other.restore(one.arrays())
    assert one.history().sampling_faults
    assert np.array_equal(other.solution().covariance, one.solution().covariance)
