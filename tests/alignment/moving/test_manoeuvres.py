"""Planned aids, the bound at several lengths of a path, and manoeuvres by what they are worth."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.aiding import BodySpeed
from schuler.alignment import PlannedAid, limit_on, path_table, plan_drive
from schuler.alignment.moving.manoeuvres import VEHICLES, _candidates
from schuler.attitude import quat_to_euler
from schuler.constants import STANDARD_GRAVITY
from schuler.errors import InputError
from schuler.simulation import simulate
from tests.alignment.moving.routes import SITE, car, truth_of


@pytest.mark.parametrize(
    ("text", "aid"),
    [
        ("gnss=0.1m/s,3m@1Hz", PlannedAid("gnss", 0.1, 3.0, 1.0)),
        ("gnss=3m@4Hz", PlannedAid("gnss", None, 3.0, 4.0)),
        ("gnss= 2m , 0.05 m/s", PlannedAid("gnss", 0.05, 2.0, 1.0)),
        ("odometer=0.1m/s@10Hz", PlannedAid("odometer", 0.1, None, 10.0)),
        ("dvl=0.02m/s", PlannedAid("dvl", 0.02, None, 1.0)),
        ("master=0.1mrad,0.02m/s@10Hz", PlannedAid("master", 0.02, None, 10.0, 1e-4)),
        ("master=0.02m/s,1m@5Hz", PlannedAid("master", 0.02, 1.0, 5.0)),
    ],
)
def test_an_aid_is_said_in_a_word_and_says_itself_again(text, aid):
    assert PlannedAid.parse(text) == aid
    assert PlannedAid.parse(str(aid)) == aid


@pytest.mark.parametrize(
    "text",
    ["gnss", "gnss=", "sonar=1m/s", "gnss=1m,2m@1Hz", "gnss=1km@1Hz", "gnss=1m@fast",
     "gnss=-1m@1Hz", "gnss=1m@0Hz", "odometer=1m@1Hz", "dvl=1m,0.1m/s@1Hz", "gnss=nanm@1Hz",
     "gnss=1mrad,1m@1Hz", "master=1mrad@10Hz", "master=1m@1Hz", "dvl=1mrad,0.1m/s@1Hz"],
)  # fmt: skip
def test_other_words_are_refused(text):
    with pytest.raises(InputError):
        PlannedAid.parse(text)


def test_speeds_along_a_path_are_those_of_the_body():
    made = truth_of(car(), 30.0)
    dvl = PlannedAid("dvl", 0.02, None, 2.0).along(made.truth)
    forward = PlannedAid("odometer", 0.1, None, 2.0).along(made.truth)
    assert isinstance(dvl, BodySpeed)
    speed = np.linalg.norm(made.truth.v_n[::50], axis=1)
    np.testing.assert_allclose(dvl.value[:, 1], speed, atol=1e-9)
    np.testing.assert_allclose(dvl.value[:, [0, 2]], 0.0, atol=1e-9)
    np.testing.assert_array_equal(forward.value, dvl.value[:, 1])


def test_the_table_is_the_bound_of_each_part_of_the_path():
    made = truth_of(car(), 60.0)
    aid = PlannedAid("gnss", 0.1, 3.0)
    found = path_table(made.truth, "tactical-fog", [aid], [20.0, 60.0], record=made.record)
    for limit, seconds in zip(found.limits, (20.0, 60.0), strict=True):
        part = made.truth.rows(slice(0, round(100 * seconds) + 1))
        alone = limit_on(
            part, "tactical-fog", aid.along(part), record=made.record.between(None, seconds)
        )
        np.testing.assert_allclose(limit.sigma_arcmin, alone.sigma_arcmin, rtol=1e-9)
        assert limit.duration == pytest.approx(seconds)
    # A receiver without velocity knows less, one without positions hardly.
    bare = path_table(made.truth, "tactical-fog", [PlannedAid("gnss", None, 3.0)],
                      record=made.record)  # fmt: skip
    fast = path_table(made.truth, "tactical-fog", [PlannedAid("gnss", 0.1)], record=made.record)
    last = found.limits[-1].sigma_arcmin[2]
    assert bare.limits[0].sigma_arcmin[2] > 2.0 * last
    assert last < fast.limits[0].sigma_arcmin[2] < 1.1 * last
    for times in ([30.0, 20.0], [0.0, 20.0], [90.0]):
        with pytest.raises(InputError, match="the path lasts 60 s"):
            path_table(made.truth, "tactical-fog", [aid], times, record=made.record)


def test_a_turn_helps_and_straight_on_does_not():
    found = plan_drive("tactical-fog", time=20.0, speed=12.0)
    by = {each.name: each.limit.sigma_arcmin[2] for each in found.manoeuvres}
    assert list(by.values()) == sorted(by.values())
    assert max(by["turn"], by["S"]) < by["brake"] < 0.1 * by["straight"]
    assert found.left_out["figure of eight"] > 20.0
    # Given that time, the figure of eight is one of them.
    longer = plan_drive("tactical-fog", time=found.left_out["figure of eight"] + 0.1, speed=12.0)
    assert "figure of eight" in {each.name for each in longer.manoeuvres}
    assert not longer.left_out


def test_manoeuvres_stay_within_what_the_vehicle_can_do():
    for kind, speed, time in (("car", 20.0, 12.0), ("aircraft", 150.0, 30.0), ("ship", 8.0, 300.0)):
        vehicle = VEHICLES[kind]
        motions, _ = _candidates(vehicle, speed, 5.0, time)
        for name, (motion, _) in motions.items():
            made = simulate(motion, SITE, 5.0 + time, 20.0)
            v = made.truth.v_n
            a = np.diff(v, axis=0) / made.step
            ahead = v[1:] / np.linalg.norm(v[1:], axis=1)[:, None]
            along = np.einsum("ia,ia->i", a, ahead)
            across = np.linalg.norm(a - along[:, None] * ahead, axis=1)
            assert np.max(across) < 1.02 * vehicle.lateral + 1e-3, (kind, name)
            assert np.max(np.abs(along)) < 1.02 * vehicle.along + 1e-3, (kind, name)
            if name == "wing rock":
                roll = quat_to_euler(made.truth.quat_nb)[:, 2]
                assert np.degrees(np.max(np.abs(roll))) == pytest.approx(12.0, abs=0.5)
                assert np.max(np.abs(roll[:100])) < 1e-9
            if name == "turn" and vehicle.flies:
                assert np.arctan(np.max(across) / STANDARD_GRAVITY) > 0.3


def test_impossible_plans_are_refused():
    for options, text in (
        ({"vehicle": "tank"}, "vehicle must be"), ({"speed": 0.0}, "speed must be"),
        ({"time": 1.0}, "time must be"), ({"before": np.nan}, "before must be"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=text):
            plan_drive("tactical-fog", **options)


def test_with_a_master_what_shows_the_mounting_helps():
    """Straight on shows neither heading nor the mounting about up; each manoeuvre shows both."""
    master = PlannedAid("master", 0.02, None, 10.0, 1e-4)
    plan = plan_drive("tactical-fog", [master], vehicle="aircraft", speed=200.0, before=5.0)
    by_name = {each.name: each.limit for each in plan.manoeuvres}
    assert plan.manoeuvres[-1].name == "straight"
    assert max(by_name["straight"].mounting_arcmin) > 100.0
    for name in ("S", "wing rock", "turn"):
        assert by_name[name].sigma_arcmin[2] < 1.0
        assert max(by_name[name].mounting_arcmin) < 2.0
    assert "mounting" in str(plan)
    gnss = PlannedAid("gnss", 0.1, 3.0)
    assert gnss.along(truth_of(car(), 5.0).truth) is not None
    with pytest.raises(InputError, match="say it alone"):
        plan_drive("tactical-fog", [master, gnss])
    with pytest.raises(InputError, match="planned_limits"):
        master.along(truth_of(car(), 5.0).truth)


def test_the_bound_with_a_master_is_that_of_a_transfer_alignment():
    """Of a slave without errors, whose alignment is linear about the truth."""
    import schuler as sc
    from schuler.alignment.transfer import MasterNoise

    made = truth_of(car(), 40.0, 50.0)
    master = PlannedAid("master", 0.02, None, 10.0, 1e-4)
    (found,) = path_table(made.truth, "tactical-fog", [master], record=made.record).limits
    fix = sc.transfer(
        made.record, made.truth, spec="tactical-fog", noise=MasterNoise(1e-4, 0.02), vibration=0.0
    )
    np.testing.assert_allclose(found.sigma_arcmin, fix.limit_arcmin, rtol=0.05)
    mounting = np.sqrt(np.diag(fix.mounting_covariance)) * 180.0 * 60.0 / np.pi
    np.testing.assert_allclose(found.mounting_arcmin, mounting, rtol=0.05)
