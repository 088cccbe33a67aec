"""Aided navigation of a simulated car: delay, outages, sigma, refused fixes, and a real drive."""

from dataclasses import replace

import numpy as np
import pytest

from schuler.aiding import GnssFixes
from schuler.earth import Site, radii
from schuler.errors import InputError
from schuler.ins import Handling, StateGroup
from schuler.io import Mapping, open_source, read_gnss
from schuler.motion import Manoeuvre, Route
from schuler.navigation import AidingOptions, Outages, navigate_aided
from schuler.record import ImuRecord
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import chi_square_band

SPEC = GRADES["tactical-fog"]
QUIET = AidingOptions(vibration=1e-4)


def route():
    legs = [Manoeuvre(15.0), Manoeuvre(10.0, speed=12.0)]
    for speed, turn in ((3, 90), (-5, -60), (4, 90), (-3, 30), (2, -90), (-4, 45)):
        legs += [Manoeuvre(10.0, speed=speed), Manoeuvre(8.0, turn=turn), Manoeuvre(8.0)]
    return Route(legs, heading=40.0)


def drive(seed, late=0.0, sigma=0.05, length=170.0):
    rng = np.random.default_rng(seed)
    made = simulate(route(), Site(40.0, 10.0, 100.0), length, 100.0, SPEC, rng)
    truth = made.truth
    t = np.arange(2.0, length - 1.0, 0.25)
    lat, lon, height = (np.interp(t - late, truth.time, x)
                        for x in (truth.lat, truth.lon, truth.height))  # fmt: skip
    off = sigma * rng.standard_normal((len(t), 3))
    meridian, transverse = radii(lat)
    lat, lon = lat + off[:, 1] / meridian, lon + off[:, 0] / (transverse * np.cos(lat))
    v = np.column_stack([np.interp(t - late, truth.time, c) for c in truth.v_n.T])
    v = v + 0.05 * rng.standard_normal(v.shape)
    return made, GnssFixes(t, lat, lon, height + off[:, 2], sigma, v, 0.05)


@pytest.mark.parametrize("late", [-0.14, 0.1])
def test_a_delay_is_found(late):
    made, gnss = drive(1, late)
    found = navigate_aided(
        made.record, replace(gnss, estimate=("delay",)), spec=SPEC, options=QUIET
    )
    for value, sigma in found.estimated["delay_s"].values():
        assert abs(value - late) < 4.5 * sigma
        assert sigma < 0.003
    assert found.consistent


def test_outages_are_scored_and_smoothed():
    made, gnss = drive(2)
    options = replace(QUIET, smooth=True, non_holonomic=True, zero_velocity=True)
    found = navigate_aided(made.record, gnss, spec=SPEC, options=options,
                           outages=Outages(15.0, 30.0))  # fmt: skip
    score = found.outages
    assert (score["count"], score["length_s"]) == (2, 15.0)
    assert score["smoothed"]["rms_horizontal_m"] < score["forward"]["rms_horizontal_m"] < 2.0
    assert found.used["gnss"] < len(gnss) - 100
    assert abs(found.estimated["mount_deg"]["yaw"][0]) < 0.3


@pytest.mark.slow
def test_position_and_heading_are_as_good_as_sigma_says():
    """20 runs, at the end: NEES of position, velocity and heading within the 99.8 % band."""
    total, smooth, runs = np.zeros(3), 0.0, 20
    for seed in range(runs):
        made, gnss = drive(seed + 10)
        found = navigate_aided(made.record, gnss, spec=SPEC, options=replace(QUIET, smooth=True))
        at = int(np.searchsorted(found.path.time, 120.0))
        for path, add in ((found.forward, total), (found.path, None)):
            t = path.time[at]
            error = np.array([
                (np.interp(t, made.truth.time, x) - y[at]) * r for x, y, r in (
                    (made.truth.lon, path.lon, 6.386e6 * np.cos(path.lat[at])),
                    (made.truth.lat, path.lat, 6.36e6), (made.truth.height, path.height, 1.0))
            ])  # fmt: skip
            square = np.sum(error**2 / path.variances[at, 6:9])
            if add is None:
                smooth += square
            else:
                add += square
    low, high = chi_square_band(3 * runs, 0.002)
    assert low < total[0] < high
    assert low < smooth < high


def test_bad_fixes_are_refused_and_do_not_move_the_path():
    made, gnss = drive(3)
    clean = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    rng = np.random.default_rng(0)
    bad = rng.random(len(gnss)) < 0.02
    bad[:20] = False
    lat = np.where(bad, gnss.lat + 50.0 / 6.36e6, gnss.lat)
    found = navigate_aided(made.record, replace(gnss, lat=lat), spec=SPEC, options=QUIET)
    assert found.refused["gnss"] == bad.sum()
    off = (found.path.lat - clean.path.lat) * 6.36e6
    assert np.sqrt(np.mean(off**2)) < 0.02
    assert found.consistent


def test_wrong_fixes_contradict():
    made, gnss = drive(4)
    turned = replace(gnss, v_n=gnss.v_n[:, [1, 0, 2]])
    found = navigate_aided(made.record, turned, spec=SPEC, options=QUIET)
    assert not found.consistent
    assert str(found).startswith("INCONSISTENT: ")


@pytest.mark.parametrize("vibration", [1e-4, 0.03])
def test_a_unit_that_is_mounted_otherwise_than_read_contradicts(vibration):
    """A quarter turn: fixes are refused, or the mounting that is found is far from its prior."""
    made, gnss = drive(6)
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    r = made.record
    record = replace(r, dtheta=r.dtheta @ turn.T, dvel=r.dvel @ turn.T)
    options = AidingOptions(non_holonomic=True, vibration=vibration)
    found = navigate_aided(record, gnss, spec=SPEC, options=options)
    assert not found.consistent
    if vibration > 1e-3:
        assert any("turned by 90 deg" in text for text in found.contradictions)
    assert str(found).startswith("INCONSISTENT: ")


def test_clocks_apart_are_named():
    made, gnss = drive(5, length=60.0)
    with pytest.raises(InputError, match="1 x 86400 s: seconds of the day"):
        navigate_aided(made.record, replace(gnss, time=np.asarray(gnss.time) + 86400.0))
    with pytest.raises(InputError, match="does not move"):
        navigate_aided(made.record, gnss.rows(np.asarray(gnss.time) < 14.0))


@pytest.mark.realdata
@pytest.mark.slow
def test_a_real_drive(data_dir):
    """A roof-mounted hobby unit and RTK: mounting and 15 s outages, beside independent figures."""
    folder = data_dir / "rtk_car_mems"
    source = open_source(folder / "imu.csv", Mapping.from_cli(axes="y,-x,z"))
    record = ImuRecord.concatenate(list(source.chunks()))
    gnss = read_gnss(folder / "gnss.csv", estimate=("delay",))
    options = AidingOptions(non_holonomic=True, zero_velocity=True, scale=True, smooth=True)
    found = navigate_aided(record, gnss, options=options, outages=Outages(15.0, 45.0))
    assert found.consistent
    assert found.estimated["mount_deg"]["yaw"][0] == pytest.approx(-5.4, abs=0.3)
    assert found.estimated["mount_deg"]["pitch"][0] == pytest.approx(6.7, abs=0.5)
    assert -0.2 < found.estimated["delay_s"]["gnss"][0] < -0.1
    assert found.outages["forward"]["rms_horizontal_m"] < 12.0
    assert found.outages["smoothed"]["rms_horizontal_m"] < 0.65


def test_the_path_at_samples_joins_the_epochs_and_ends_with_the_record():
    made, gnss = drive(7)
    gap = (gnss.time < 90.0) | (gnss.time > 110.0)
    found = navigate_aided(made.record, gnss.rows(gap), spec=SPEC,
                           options=replace(QUIET, smooth=True))  # fmt: skip
    # Where nothing is measured there are epochs all the same, and sigma grows.
    assert np.diff(found.path.time).max() <= 1.5
    assert found.path.time[-1] == made.record.end
    inside = (found.forward.time > 91.0) & (found.forward.time < 110.0)
    assert np.all(np.diff(found.forward.variances[inside, 6]) > 0.0)
    path = found.at_samples(made.record)
    at = np.searchsorted(path.time, found.path.time - 1e-6)
    for name, scale in (("lat", 6.4e6), ("lon", 6.4e6), ("height", 1.0)):
        off = getattr(path, name)[at] - getattr(found.path, name)
        assert np.abs(off).max() * scale < 1e-4
    np.testing.assert_allclose(path.v_n[at], found.path.v_n, atol=1e-4)
    truth = made.truth
    k = np.searchsorted(truth.time, path.time - 1e-6)
    error = np.column_stack([(path.lat - truth.lat[k]) * 6.36e6, path.height - truth.height[k]])
    assert np.abs(np.diff(error, axis=0)).max() < 2e-3
    assert np.abs(error).max() < 2.0
    tenth = found.at_samples(made.record, every=10)
    assert tenth.time[-1] == path.time[-1]
    np.testing.assert_array_equal(tenth.lat, path.lat[(len(path) - 1) % 10 :: 10])


def test_without_smoothing_the_path_at_samples_steps_at_epochs_as_the_filter_does():
    made, gnss = drive(8, length=60.0)
    found = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    path = found.at_samples(made.record)
    assert path.time[-1] == made.record.end
    at = np.searchsorted(path.time, found.path.time - 1e-6)
    np.testing.assert_allclose(path.v_n[at], found.path.v_n, atol=1e-9)
    with pytest.raises(InputError, match="at least 1"):
        found.at_samples(made.record, every=0)


class Altimeter:
    """Heights of a sensor with a scale and an offset that nobody knows: a group of two states."""

    name, handling = "altimeter", Handling()
    states = (StateGroup("altimeter.line", [20.0, 0.1], start=[5.0, 1.0]),)

    def __init__(self, time, height):
        self.time, self.height = time, height

    def rows(self, state):
        offset, scale = state.parameters["altimeter.line"]
        z = offset + scale * state.height - self.height[state.index]
        row = state.row({"position": [0.0, 0.0, scale], "altimeter.line": [1.0, state.height]})
        return [z], [row], [0.05**2]


def test_a_group_of_ones_own_is_estimated():
    made, gnss = drive(3)
    t = np.arange(3.0, 160.0, 0.5)
    height = np.interp(t, made.truth.time, made.truth.height)
    rng = np.random.default_rng(0)
    own = Altimeter(t, 7.0 + 1.02 * height + 0.05 * rng.standard_normal(len(t)))
    found = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET, aids=[own])
    value, sigma = np.array(found.estimated["own"]["altimeter.line"])
    # Height hardly changes: offset and scale are seen together.
    assert np.all(sigma > 0.0)
    assert sigma[0] < 20.0
    assert value @ [1.0, 100.0] == pytest.approx(7.0 + 102.0, abs=0.1)
    assert found.used["altimeter"] == len(t)
    assert "altimeter.line: " in str(found)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: StateGroup("deviation", 1.0), "named as aid.part"),
        (lambda: StateGroup("phi.x", 1.0), "named as aid.part"),
        (lambda: StateGroup("a.b", [1.0, 0.0]), "sigma must be positive"),
        (lambda: StateGroup("a.b", [1.0, 2.0], start=[1.0]), "start must have 2"),
        (lambda: StateGroup("a.b", np.inf), "sigma must be positive"),
    ],
)
def test_groups_that_cannot_be(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_two_groups_of_one_name_are_refused():
    made, gnss = drive(3, length=60.0)
    first, second = (Altimeter(np.array([30.0]), np.array([1.0])) for _ in range(2))
    second.states = (StateGroup("altimeter.line", [1.0, 1.0]),)
    with pytest.raises(InputError, match="add different states 'altimeter"):
        navigate_aided(made.record, gnss, spec=SPEC, aids=[first, second])
    second.states = ("altimeter.line",)
    with pytest.raises(InputError, match="must be StateGroup"):
        navigate_aided(made.record, gnss, spec=SPEC, aids=[second])
