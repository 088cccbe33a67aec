"""Where an aided navigation starts from, when nobody gives it an attitude."""

from dataclasses import replace

import numpy as np
import pytest

from schuler.attitude import multiply, nearest_quat
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.navigation import motion_start
from schuler.sensors import CONSUMER_MEMS, GRADES
from schuler.simulation import simulate
from tests.alignment.moving.routes import SITE, car, fixes, heading_error, straight, walker

FOG = GRADES["tactical-fog"]


@pytest.mark.parametrize("velocity", [True, False], ids=["velocities", "positions"])
def test_a_car_is_aligned_by_its_first_motion(velocity):
    rng = np.random.default_rng(3)
    made = simulate(car(), SITE, 90.0, 50.0, FOG, rng)
    gnss = fixes(made, rng=rng, first=0.5, sigma=0.5, velocity=velocity)
    found = motion_start(made.record, gnss, FOG)
    error = heading_error(found.quat_nb, made.truth.quat_nb[0])
    assert np.all(np.abs(error) < 4.0 * found.sigma)
    assert found.sigma[2] < 5.0 * DEG


def test_a_unit_that_lies_across_in_a_hand_is_aligned_too():
    """The course says nothing of its heading, and its first turn comes late."""
    rng = np.random.default_rng(5)
    made = simulate(walker(rng), SITE, 100.0, 25.0, CONSUMER_MEMS, rng)
    gnss = fixes(made, rng=rng, first=0.5)
    across = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    record = replace(
        made.record, dtheta=made.record.dtheta @ across.T, dvel=made.record.dvel @ across.T
    )
    found = motion_start(record, gnss, CONSUMER_MEMS)
    true = multiply(made.truth.quat_nb[0], nearest_quat(across.T))
    error = heading_error(found.quat_nb, true)
    assert np.all(np.abs(error) < 4.0 * found.sigma)
    assert found.sigma[2] < 15.0 * DEG


def test_what_does_not_accelerate_or_move_is_said():
    made = simulate(straight(), SITE, 60.0, 20.0, CONSUMER_MEMS, np.random.default_rng(1))
    gnss = fixes(made, rng=np.random.default_rng(2), first=0.5)
    with pytest.raises(InputError, match=r"brake or turn.*give the attitude at the start"):
        motion_start(made.record, gnss, CONSUMER_MEMS)
    still = replace(gnss, v_n=np.zeros((len(gnss.time), 3)))
    with pytest.raises(InputError, match="does not move"):
        motion_start(made.record, still, CONSUMER_MEMS)


def test_one_function_navigates_alone_and_with_aids():
    import schuler as sc

    rng = np.random.default_rng(3)
    made = simulate(car(), SITE, 60.0, 50.0, FOG, rng)
    gnss = fixes(made, rng=rng, first=0.5, sigma=0.5)
    drive = sc.navigate(made.record, aiding=gnss, spec=FOG, smooth=True)
    assert drive.path is not drive.forward
    aligned = sc.align(made.record, aiding=gnss, spec=FOG, at="start")
    from_it = sc.navigate(made.record, aligned, aiding=[gnss], spec=FOG)
    ends = [
        heading_error(each.path.quat_nb[-1], made.truth.quat_nb[-2]) for each in (drive, from_it)
    ]
    assert np.abs(ends).max() < 0.5 * DEG
    for words, options in (
        ("takes GNSS fixes of one receiver", {"aiding": []}),
        ("every is for a navigation without aids", {"aiding": gnss, "every": 2}),
        ("smooth goes with aids", {"start": sc.Start.from_alignment(aligned), "smooth": True}),
        ("measurements of your own, got str", {"aiding": [gnss, "odometer"]}),
    ):
        with pytest.raises(InputError, match=words):
            sc.navigate(made.record, **options)
