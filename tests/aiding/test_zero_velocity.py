"""Spans at rest: given, found, and as an aid of an alignment in motion."""

import numpy as np
import pytest

import schuler as sc
from schuler.aiding import ZeroVelocity
from schuler.errors import InputError
from schuler.motion import Manoeuvre, Route
from schuler.sensors import GRADES
from tests.alignment.moving.routes import fixes, heading_error, noisy, truth_of
from tests.conftest import LONG, chi_square_band

SPEC = GRADES["navigation-fog"]


def stand_drive_stand():
    legs = [
        Manoeuvre(60.0), Manoeuvre(12.0, speed=12.0), Manoeuvre(10.0, turn=90.0),
        Manoeuvre(12.0, speed=-12.0), Manoeuvre(60.0),
    ]  # fmt: skip
    return truth_of(Route(legs, heading=40.0), 154.0)


def test_instants_lie_within_the_spans():
    rest = ZeroVelocity([(190.0, 205.0), (0.0, 25.0)], window=1.0)
    times = rest.times(10.0, 195.0)
    assert times[0] >= 10.0
    assert times[-1] <= 195.0
    assert not np.any((times > 25.0) & (times < 190.0))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (([(3.0, 2.0)],), "not after its begin"),
        (([1.0, 2.0],), "rows of two times"),
        ((np.zeros((0, 2)),), "no span at rest"),
        (([(0.0, 5.0)], -1.0), "sigma is positive"),
        (([(0.0, 5.0)], 0.1, 0.0), "window is positive"),
    ],
)
def test_bad_spans(arguments, says):
    with pytest.raises(InputError, match=says):
        ZeroVelocity(*arguments)


def test_rest_is_found_before_and_after_a_drive():
    perfect = stand_drive_stand()
    rng = np.random.default_rng(1)
    record, gnss = noisy(perfect, "navigation-fog", rng), fixes(perfect, rng=rng, first=1.0)
    found = ZeroVelocity.found(record, gnss)
    (first, second) = np.asarray(found.spans)
    assert first[0] < 2.0
    assert 55.0 < first[1] < 62.0
    assert 92.0 < second[0] < 98.0
    moving = record.between(62.0, 92.0)
    with pytest.raises(InputError, match="no rest"):
        ZeroVelocity.found(moving, gnss)


@pytest.mark.slow
def test_rest_before_and_after_a_drive_counts_for_the_heading():
    """Sigma is the bound, well below that without rest, and true (false alarm 2e-3)."""
    perfect = stand_drive_stand()
    rest = ZeroVelocity([(0.0, 60.0), (94.0, 154.0)], sigma=0.005)
    plan = fixes(perfect, first=1.0)
    record = perfect.record
    alone, bound = (
        sc.limit_on(perfect.truth, SPEC, aids, record=record).sigma_arcmin[2]
        for aids in (plan, [plan, rest])
    )
    assert bound < 0.75 * alone
    nees, runs = 0.0, 24 if LONG else 3
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        fix = sc.align(
            noisy(perfect, "navigation-fog", rng),
            aiding=[fixes(perfect, rng=rng, first=1.0), rest], spec=SPEC,
        )  # fmt: skip
        assert fix.sigma_arcmin[2] == pytest.approx(bound, rel=0.05)
        phi = heading_error(fix.quat_nb, perfect.truth.quat_nb[-1])
        nees += phi @ np.linalg.solve(fix.covariance, phi)
    low, high = chi_square_band(3 * runs, 2e-3)
    assert low < nees < high
