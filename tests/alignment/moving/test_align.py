"""`align` with aids: as good as the bound, consistent, and what it says when it cannot be done."""

import json
from dataclasses import replace

import numpy as np
import pytest

import schuler as sc
from schuler.aiding import BodyVelocity
from schuler.alignment.moving.result import MovingAlignment
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR
from schuler.errors import InputError
from schuler.io import Mapping, open_source, read_gnss
from schuler.motion import Manoeuvre, Route
from schuler.navigation import AidingOptions, navigate_aided
from schuler.record import ImuRecord
from schuler.sensors import CONSUMER_MEMS
from schuler.simulation import simulate
from tests.alignment.moving.routes import (
    SITE,
    body_speed,
    car,
    fixes,
    heading_error,
    noisy,
    truth_of,
    walker,
)
from tests.conftest import chi_square_band
from tests.in_motion.test_coarse import LEVER, ending, simulated

GRADE, MEMS = "tactical-fog", "industrial-mems"


def drive(seed=0, name="car", length=60.0, grade=GRADE, **options):
    made = simulated(name, length)
    rng = np.random.default_rng(seed)
    gnss = fixes(made, rng=rng, **options)
    return made, noisy(made, grade, rng), gnss


def error(fix, made):
    at = round((fix.time - made.start) / made.step)
    return heading_error(fix.quat_nb, made.truth.quat_nb[at])


@pytest.mark.parametrize(
    ("name", "grade", "length"),
    [("car", GRADE, 60.0), ("ship", "navigation-fog", 60.0), ("straight", "navigation-fog", 120.0)],
)
def test_it_reaches_the_bound_and_knows_it(name, grade, length):
    """12 runs: NEES of the attitude; sigma is the bound, also where the heading is hardly seen."""
    made, total, runs = simulated(name, length), 0.0, 12
    for seed in range(runs):
        _, record, gnss = drive(seed, name, length, grade)
        fix = sc.align(record, aiding=gnss, spec=grade)
        e = error(fix, made)
        total += e @ np.linalg.solve(fix.covariance, e)
        assert fix.consistent
        assert fix.sigma_arcmin[2] == pytest.approx(fix.limit_arcmin[2], rel=0.05)
    low, high = chi_square_band(3 * runs, 0.001)
    assert low < total < high
    truth = sc.limit_on(made.truth, grade, fixes(made), record=made.record)
    assert fix.limit_arcmin[2] == pytest.approx(truth.sigma_arcmin[2], rel=0.08)


def test_the_result_is_an_alignment_with_velocity_and_position():
    made, record, gnss = drive()
    fix = sc.align(record, aiding=gnss, spec=GRADE)
    assert isinstance(fix, MovingAlignment)
    assert isinstance(fix, sc.Alignment)
    np.testing.assert_allclose(sum(fix.budget.values()), fix.covariance, rtol=1e-6)
    assert max(fix.budget_arcmin2, key=fix.budget_arcmin2.get) == "aiding"
    assert np.all(np.abs(fix.v_n - made.v_n[-1]) < 4.5 * fix.v_sigma)
    assert abs(fix.site.height - made.position[-1, 2]) < 4.5 * fix.position_sigma[2]
    off = (fix.site.latitude - made.position[-1, 0]) * 6.36e6
    assert abs(off) < 4.5 * fix.position_sigma[1]
    assert fix.used == {"gnss": 61, "gnss_velocity": 61}
    text = str(fix)
    assert text.startswith(f"heading {fix.heading_deg:.3f} deg ± ")
    assert "moving: 61 gnss, 61 gnss_velocity" in text
    data = json.loads(fix.to_json())
    assert data["schema"] == "schuler.alignment/3"
    assert data["method"]["name"] == "in-motion"
    assert data["aids"]["used"] == fix.used
    assert data["aids"]["velocity_enu_m_s"] == pytest.approx(list(fix.v_n))


def test_at_the_start_it_is_the_smoothed_attitude():
    made, record, gnss = drive()
    fix = sc.align(record, aiding=gnss, spec=GRADE, at="start")
    assert fix.time == made.start
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0
    assert fix.sigma_arcmin[2] == pytest.approx(fix.limit_arcmin[2], rel=0.05)
    assert np.all(np.abs(fix.v_n - made.v_n[0]) < 4.5 * fix.v_sigma)


def test_a_span_is_a_part_of_the_record():
    made, record, gnss = drive()
    fix = sc.align(record, aiding=gnss, spec=GRADE, span=(10.0, 50.0))
    assert (fix.start, fix.end) == pytest.approx((10.0, 50.0))
    assert fix.used["gnss"] == 41
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0


def test_positions_alone_are_enough_with_more_uncertainty():
    made, record, gnss = drive()
    both = sc.align(record, aiding=gnss, spec=GRADE)
    fix = sc.align(record, aiding=replace(gnss, v_n=None), spec=GRADE)
    assert fix.coarse.form == "position"
    assert 3.0 < fix.sigma_arcmin[2] / both.sigma_arcmin[2] < 8.0
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0


def test_body_velocity_needs_the_latitude_and_a_good_gyro():
    made = simulated("car", 120.0)
    rng = np.random.default_rng(4)
    speed = body_speed(made, sigma=0.02, rng=rng)
    record = noisy(made, "navigation-fog", rng)
    fix = sc.align(record, SITE, aiding=speed, spec="navigation-fog")
    assert fix.coarse.form == "body velocity"
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0
    assert fix.sigma_arcmin[2] < 60.0
    with pytest.raises(InputError, match="give the site"):
        sc.align(record, aiding=speed, spec="navigation-fog")
    steady = simulated("straight")
    with pytest.raises(InputError, match="leaves it to the Earth's rotation"):
        sc.align(noisy(steady, MEMS, rng), SITE, aiding=body_speed(steady), spec=MEMS)


def test_a_doppler_log_in_its_own_frame_is_the_same():
    made = simulated("car", 120.0)
    rng = np.random.default_rng(4)
    speed = body_speed(made, sigma=0.02, rng=rng)
    record = noisy(made, "navigation-fog", rng)
    v = np.asarray(speed.value)
    log = BodyVelocity(
        speed.time, 1.01 * v[:, [1, 0, 2]] * [1.0, 1.0, -1.0], 0.02, frame="FRD", scale=0.01
    )
    one = sc.align(record, SITE, aiding=speed, spec="navigation-fog")
    other = sc.align(record, SITE, aiding=log, spec="navigation-fog")
    assert other.heading_deg == pytest.approx(one.heading_deg, abs=1e-6)


def test_an_odometer_has_a_forward_speed_and_wheels():
    made = simulated("car", 120.0)
    rng = np.random.default_rng(5)
    dvl = body_speed(made, sigma=0.02, rng=rng)
    odometer = replace(dvl, value=np.asarray(dvl.value)[:, 1], name="odometer")
    fix = sc.align(noisy(made, "navigation-fog", rng), SITE, aiding=odometer, spec="navigation-fog")
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0


def test_delay_and_lever_arm_are_estimated():
    made = simulated("car", 120.0)
    rng = np.random.default_rng(6)
    gnss = fixes(made, lever=LEVER, sigma=0.05, v_sigma=0.05, every=0.25, rng=rng)
    made = ending(made, gnss)
    record = noisy(made, GRADE, rng)
    t = np.asarray(gnss.time)
    late = replace(gnss.rows(t < t[-1] - 0.2), time=t[t < t[-1] - 0.2] + 0.12,
                   lever=(0.0, 0.0, 0.0), estimate=("delay", "lever"))  # fmt: skip
    fix = sc.align(record, aiding=late, spec=GRADE)
    delay, sigma = fix.estimated["delay_s"]["gnss"]
    assert abs(delay - 0.12) < 4.5 * sigma < 0.05
    lever, spread = (np.asarray(x) for x in fix.estimated["lever_m"]["gnss"])
    assert np.all(np.abs(lever - LEVER) < 4.5 * spread)
    assert spread[1] < 0.3
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0
    assert "delay of gnss 0.1" in str(fix)


def test_bad_velocities_are_left_out():
    made, record, gnss = drive(7)
    v = np.array(gnss.v_n)
    v[[7, 20, 44]] += [6.0, -5.0, 3.0]
    fix = sc.align(record, aiding=replace(gnss, v_n=v), spec=GRADE)
    assert fix.refused["gnss_velocity"] == 3
    e = error(fix, made)
    assert e @ np.linalg.solve(fix.covariance, e) < 20.0
    assert fix.consistent


def test_a_vibrating_record_has_a_larger_sigma():
    _, record, gnss = drive(8)
    plain = sc.align(record, aiding=gnss, spec=GRADE)
    shaken = replace(
        record,
        dvel=record.dvel + 0.005 * np.random.default_rng(1).standard_normal(record.dvel.shape),
    )
    fix = sc.align(shaken, aiding=gnss, spec=GRADE)
    assert any("vibration" in text for text in fix.warnings)
    # 5 mm/s a sample at 100 Hz.
    assert fix.method.vibration == pytest.approx(0.05, rel=0.1)
    assert fix.sigma_arcmin[2] > 1.1 * plain.sigma_arcmin[2]
    assert fix.limit_arcmin[2] == pytest.approx(plain.limit_arcmin[2], rel=0.05)


def test_rest_before_shows_the_bias_of_a_coarse_gyro():
    legs = [Manoeuvre(20.0)]
    for speed, turn in ((12.0, 60.0), (-4.0, -80.0)):
        legs += [Manoeuvre(8.0, speed=speed), Manoeuvre(8.0, turn=turn)]
    route = Route(legs, heading=40.0)
    made = truth_of(route, 60.0)
    rng = np.random.default_rng(2)
    gnss, record = fixes(made, rng=rng), noisy(made, "industrial-mems", rng)
    with_rest = sc.align(record, aiding=gnss, spec="industrial-mems", span=(19.0, 60.0))
    without = sc.align(record.between(21.0, None), aiding=gnss.rows(np.asarray(gnss.time) > 21.0),
                       spec="industrial-mems")  # fmt: skip
    s = np.sqrt(np.diag(with_rest.bias_covariance))[:3] / DEG_PER_HOUR
    assert np.all(s < 60.0)
    assert with_rest.sigma_arcmin[2] < without.sigma_arcmin[2]
    e = error(with_rest, made)
    assert e @ np.linalg.solve(with_rest.covariance, e) < 20.0


def test_a_navigation_starts_from_it():
    made, record, gnss = drive(9)
    fix = sc.align(record, aiding=gnss, spec=GRADE, span=(0.0, 40.0))
    start = sc.Start.from_alignment(fix)
    assert start.site == fix.site
    np.testing.assert_array_equal(start.v_n, fix.v_n)
    assert np.asarray(start.covariance).shape == (9, 9)
    path = sc.navigate(record.between(40.0, None), start, spec=GRADE)
    error_m = (path.lat[-1] - made.position[-1, 0]) * 6.36e6
    assert abs(error_m) < 4.5 * np.sqrt(path.variances[-1, 7])
    with pytest.raises(InputError, match="needs its place"):
        sc.Start.from_alignment(fix.site)


def test_a_span_without_acceleration_says_what_is_missing():
    _, record, gnss = drive(1, "straight")
    with pytest.raises(InputError, match="no acceleration in this span: brake or turn"):
        sc.align(record, aiding=gnss, spec=GRADE, span=(0.0, 20.0))


def test_a_span_that_would_fill_the_memory_is_refused(monkeypatch):
    from schuler.alignment.moving import fine

    monkeypatch.setattr(fine, "_MEMORY", 1e5)
    _, record, gnss = drive()
    with pytest.raises(InputError, match=r"take one of at most 16 s \(--from, --to\)"):
        sc.align(record, aiding=gnss, spec=GRADE)


def test_bad_input_is_one_sentence():
    _, record, gnss = drive()
    shifted = replace(gnss, time=np.asarray(gnss.time) + 86400.0)
    with pytest.raises(InputError, match="near 1 x 86400 s"):
        sc.align(record, aiding=shifted, spec=GRADE)
    with pytest.raises(InputError, match="ends after its begin"):
        sc.align(record, aiding=gnss, span=(40.0, 20.0))
    with pytest.raises(InputError, match="holds no samples"):
        sc.align(record, aiding=gnss, span=(400.0, 420.0))
    with pytest.raises(InputError, match="method of its own"):
        sc.align(record, None, "kalman", aiding=gnss)
    with pytest.raises(InputError, match="needs the latitude"):
        sc.align(record)
    with pytest.raises(InputError, match="give aiding"):
        sc.align(record, SITE, vibration=0.1)
    with pytest.raises(InputError, match="got str"):
        sc.align(record, aiding=["car.pos"])
    with pytest.raises(InputError, match="needs aids"):
        sc.align(record, aiding=[])
    with pytest.raises(InputError, match="start or end"):
        sc.align(record, aiding=gnss, at="middle")


def test_an_odometer_in_kilometres_an_hour_is_named():
    made, record, gnss = drive(3)
    dvl = body_speed(made)
    fast = replace(dvl, value=3.6 * np.asarray(dvl.value)[:, 1], name="odometer")
    with pytest.raises(InputError, match="in km/h"):
        sc.align(record, aiding=[gnss, fast], spec=GRADE)


def test_axes_of_a_left_handed_frame_contradict():
    _, record, gnss = drive()
    mirrored = replace(record, dvel=record.dvel * [-1.0, 1.0, 1.0])
    fix = sc.align(mirrored, aiding=gnss, spec=GRADE)
    assert not fix.consistent
    assert fix.headline().startswith("INCONSISTENT: innovations are ")
    assert fix.to_dict()["heading_deg"] is None


@pytest.mark.parametrize("name", ["car", "accel", "plane"])
def test_a_record_that_moves_says_what_it_needs(name):
    _, record, _ = drive(0, name)
    fix = sc.align(record, SITE, spec=GRADE)
    assert any("the vehicle moves" in text and "--gnss FILE" in text for text in fix.warnings)


def test_a_record_at_rest_is_not_said_to_move():
    from schuler.motion import DisturbedVehicle

    rng = np.random.default_rng(0)
    made = truth_of(DisturbedVehicle.with_crew(rng, 60.0), 60.0)
    fix = sc.align(noisy(made, "industrial-mems", rng), SITE, spec="industrial-mems")
    assert fix.sigma_arcmin[2] > 600.0
    assert not any("moves" in text for text in fix.warnings)


@pytest.mark.realdata
@pytest.mark.slow
def test_a_real_drive(data_dir):
    """Hobby unit and RTK: windows of 30 s against the smoothed heading of the whole drive."""
    folder = data_dir / "rtk_car_mems"
    source = open_source(folder / "imu.csv", Mapping.from_cli(axes="y,-x,z"))
    record = ImuRecord.concatenate(list(source.chunks()))
    gnss = read_gnss(folder / "gnss.csv", estimate=("delay",))
    options = AidingOptions(non_holonomic=True, zero_velocity=True, scale=True, smooth=True)
    path = navigate_aided(record, gnss, options=options).path
    psi = np.unwrap(path.euler[:, 0])
    off, sigma = [], []
    for begin in np.arange(record.start + 25.0, record.end - 30.0, 30.0):
        fix = sc.align(record, aiding=gnss, span=(begin, begin + 30.0))
        known = -np.interp(fix.time, path.time, psi) / DEG
        off.append((fix.heading_deg - known + 180.0) % 360.0 - 180.0)
        sigma.append(fix.heading_sigma_arcmin * ARCMIN / DEG)
    off, sigma = np.abs(off), np.array(sigma)
    assert len(off) >= 15
    assert np.median(off) < 1.6
    assert np.mean(off < 3.0 * sigma) >= 0.95


@pytest.mark.slow
def test_a_coarse_gyro_without_rest_converges_and_its_sigma_holds():
    """12 drives of an industrial MEMS, phase fixes, two minutes in motion; false alarm 2e-3.

    Its bias turns the navigation by degrees: passes are linear about what the coarse stage found.
    With the specification's bias instability as too slow a walk, errors were 1.5 sigma.
    """
    perfect, runs = truth_of(car(), 120.0), 12
    nees = 0.0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        gnss = fixes(perfect, rng=rng, first=1.0, sigma=0.05, v_sigma=0.05)
        fix = sc.align(noisy(perfect, "industrial-mems", rng), aiding=gnss, spec="industrial-mems")
        phi = heading_error(fix.quat_nb, perfect.truth.quat_nb[-1])
        nees += phi @ np.linalg.solve(fix.covariance, phi)
    low, high = chi_square_band(3 * runs, 2e-3)
    assert low < nees < high


@pytest.mark.parametrize("factor", [1.0 / 57.2958, 2.0])
@pytest.mark.parametrize("spec", ["industrial-mems", None])
def test_gyros_in_another_unit_contradict(factor, spec):
    """A wide prior of bias and scale factor, and noise for vibration, would hide it."""
    perfect = truth_of(car(), 60.0)
    rng = np.random.default_rng(3)
    gnss = fixes(perfect, rng=rng, first=1.0)
    record = noisy(perfect, "industrial-mems", rng)
    assert sc.align(record, aiding=gnss, spec=spec).consistent
    wrong = sc.align(replace(record, dtheta=factor * record.dtheta), aiding=gnss, spec=spec)
    assert not wrong.consistent


def test_passes_that_diverge_are_one_sentence(monkeypatch):
    perfect = truth_of(car(), 60.0)
    rng = np.random.default_rng(3)
    monkeypatch.setattr("schuler.alignment.moving.fine._FARTHEST", 1e-6)
    with pytest.raises(InputError, match=r"diverges: pass 1 moves the start by .* m\."):
        sc.align(
            noisy(perfect, "tactical-fog", rng), aiding=fixes(perfect, rng=rng, first=1.0),
            spec="tactical-fog",
        )  # fmt: skip


def test_a_phone_in_a_walking_hand():
    """A gyro bias of half a degree a second, and turns that come late: heading within 3 sigma.

    Over a minute such a gyro loses the frame of the coarse stage, which therefore takes short
    windows wherever the walker turns, and makes its series again without the bias it has found.
    """
    for seed, length in ((5, 100.0), (2, 320.0)):
        rng = np.random.default_rng(seed)
        motion = walker(rng)
        perfect = simulate(motion, SITE, length, 25.0)
        made = simulate(motion, SITE, length, 25.0, CONSUMER_MEMS, rng)
        fix = sc.align(made.record, aiding=fixes(perfect, rng=rng, first=0.5))
        assert fix.consistent
        phi = heading_error(fix.quat_nb, perfect.truth.quat_nb[-1])
        assert abs(phi[2]) < 3.0 * np.sqrt(fix.covariance[2, 2])
        assert np.sqrt(fix.covariance[2, 2]) < 8.0 * DEG
