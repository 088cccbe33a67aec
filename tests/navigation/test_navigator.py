"""The navigator on moving truth, over a pole, across the date line, in any chunking."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.attitude import psi_to_heading
from schuler.constants import DEG, EARTH_A, EARTH_E2, EARTH_RATE
from schuler.earth import Site, gravity, radii
from schuler.errors import InputError
from schuler.io.trajectory import read_trajectory
from schuler.motion import Manoeuvre, Route, Static
from schuler.navigation import (
    Gravity,
    Navigator,
    Start,
    Vertical,
    at_lever,
    evaluate,
    navigate,
    parse_gravity,
    parse_vertical,
)
from schuler.record import ImuRecord
from schuler.simulation import simulate
from tests.conftest import chi_square_band, pieces


@pytest.fixture(scope="module")
def flight(reference_dir):
    """Return the reference flight: its record, start and 10 Hz truth."""
    file = reference_dir / "pyins_traj.csv"
    with file.open(encoding="utf-8") as lines:
        next(lines)
        first = np.array(next(lines).strip().split(",")[7:], float)
        rows = np.array([line.split(",")[:7] for line in lines], float)
    time = rows[:, 0]
    # Front, right, down to right, front, up.
    a, v = (np.ascontiguousarray(rows[:, c][:, [1, 0, 2]] * [1, 1, -1]) for c in
            (slice(1, 4), slice(4, 7)))  # fmt: skip
    record = ImuRecord(time, np.full(len(time), 0.01), a, v)
    lat, lon, height, vn, ve, vd, roll, pitch, heading = first
    start = Start.from_angles(Site(lat, lon, height), heading, pitch, roll, (ve, vn, -vd))
    return record, start, read_trajectory(reference_dir / "pyins_traj_truth_10hz.csv")


@pytest.mark.parametrize("subsamples", [1, 2])
def test_reference_flight_within_a_centimetre(flight, subsamples):
    """Asked: 0.01 m in each of north, east, down and 1e-6 deg, after 600 s."""
    record, start, truth = flight
    path = navigate(record, start, gravity="somigliana1", subsamples=subsamples)
    e = evaluate(path, truth)
    assert np.abs(e.position).max() < 0.01
    assert np.rad2deg(np.linalg.norm(e.phi, axis=1).max()) < 1e-6


@pytest.mark.parametrize("subsamples", [1, 2])
def test_reference_flight_at_half_the_rate(flight, subsamples):
    """Pairs of increments summed, 50 Hz: 0.05 m asked."""
    r, start, truth = flight
    pairs = ImuRecord(
        r.time[1::2], np.full(len(r) // 2, 0.02), r.dtheta[::2] + r.dtheta[1::2],
        r.dvel[::2] + r.dvel[1::2],
    )  # fmt: skip
    e = evaluate(navigate(pairs, start, gravity="somigliana1", subsamples=subsamples), truth)
    assert np.abs(e.position).max() < 0.05
    # At the end: between updates of 0.04 s a 10 Hz truth can only be met by interpolation.
    assert np.rad2deg(np.linalg.norm(e.phi[-1])) < 1e-6


def test_another_gravity_shows(flight):
    """The second-order height term is 3 h^2/a^2 g and a slope of (f + m - 2 f s^2): 0.3 m here."""
    record, start, truth = flight
    e = evaluate(navigate(record, start, gravity="somigliana"), truth)
    assert 0.2 < abs(e.position[-1, 2]) < 0.5


def test_across_the_date_line(flight):
    """The same flight elsewhere: longitudes differ by the shift, the rest is the same."""
    record, start, _ = flight
    shift = 179.95 - start.site.lon
    there = Start(Site(start.site.lat, 179.95, start.site.height), start.quat_nb, start.v_n)
    a, b = navigate(record, start), navigate(record, there)
    assert b.position[0, 1] > 0 > b.position[-1, 1]
    turn = np.remainder(b.position[:, 1] - a.position[:, 1] - shift * DEG + 1.0, 2 * np.pi) - 1.0
    np.testing.assert_allclose(turn, 0.0, atol=1e-12)
    np.testing.assert_allclose(b.position[:, [0, 2]], a.position[:, [0, 2]], rtol=0, atol=1e-7)


def over_the_pole(start_lat: float, speed: float, height: float, time: float, rate: float):
    """Return a level flight north along a meridian, over the pole: increments and its end angle.

    The body's front is along the meridian, up along the normal; theta goes on past 90 deg. In body
    axes w = (-theta', W cos theta, W sin theta) and f = (-2 v W sin theta, 0, g - v theta').
    """
    from scipy.integrate import solve_ivp

    def slope(_t, theta):
        w2 = 1.0 - EARTH_E2 * np.sin(theta) ** 2
        return speed / (EARTH_A * (1.0 - EARTH_E2) / w2**1.5 + height)

    n = round(time * rate)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    at = (np.arange(n)[:, None] + 0.5 + 0.5 * nodes) / rate
    solved = solve_ivp(slope, (0.0, time), [start_lat], "DOP853", rtol=1e-13, atol=1e-15,
                       dense_output=True)  # fmt: skip
    theta = solved.sol(at.ravel())[0].reshape(at.shape)
    rate_of = slope(0.0, theta)
    w = np.stack([-rate_of, EARTH_RATE * np.cos(theta), EARTH_RATE * np.sin(theta)], axis=-1)
    g = gravity(theta, height)
    f = np.stack([-2 * speed * EARTH_RATE * np.sin(theta), 0 * theta, g - speed * rate_of], axis=-1)
    share = 0.5 * weights[:, None] / rate
    record = ImuRecord(
        np.arange(1, n + 1) / rate, np.full(n, 1.0 / rate), (w * share).sum(1), (f * share).sum(1)
    )
    return record, float(solved.y[0, -1])


@pytest.mark.parametrize("subsamples", [1, 2])
def test_over_the_pole(subsamples):
    """Level along a meridian at 250 m/s from 89 deg over the pole: 1 mm; the heading turns."""
    record, theta = over_the_pole(89.0 * DEG, 250.0, 3000.0, 900.0, 50.0)
    start = Start.from_angles(Site(89.0, 20.0, 3000.0), 0.0, velocity=(0.0, 250.0, 0.0))
    path = navigate(record, start, subsamples=subsamples)
    lat, lon, height = path.position[-1]
    assert theta > 91.0 * DEG
    assert abs(lat - (np.pi - theta)) * 6.4e6 < 1e-3
    assert (
        abs(np.remainder(lon - 200.0 * DEG + np.pi, 2 * np.pi) - np.pi) * 6.4e6 * np.cos(lat) < 1e-3
    )
    assert abs(height - 3000.0) < 1e-3
    np.testing.assert_allclose(path.v_n[-1], [0.0, -250.0, 0.0], atol=1e-5)
    assert psi_to_heading(path.euler[-1, 0]) == pytest.approx(np.pi, abs=1e-8)
    assert np.all(np.isfinite(path.position))
    assert np.abs(path.position[:, 0]).max() < 0.5 * np.pi + 1e-12


@pytest.mark.parametrize(("lat", "height"), [(-34.0, 120.0), (72.0, -40.0), (5.0, 9000.0)])
def test_moving_truth_in_both_hemispheres(lat, height):
    """Turns, climbs and speeds up: 5 mm after a minute, at any latitude and height."""
    motion = Route(
        [Manoeuvre(20, speed=30), Manoeuvre(20, turn=90), Manoeuvre(20, climb=5)], heading=300.0
    )
    made = simulate(motion, Site(lat, -70.0, height), 60.0)
    t = made.truth
    start = Start(Site(lat, -70.0, height), t.quat_nb[0], t.v_n[0])
    p = navigate(made.record, start)
    assert np.abs(p.v_n - t.v_n).max() < 3e-6
    metres = np.abs(p.position[-1] - t.position[-1]) * [6.4e6, 6.4e6 * np.cos(lat * DEG), 1.0]
    assert metres.max() < 5e-3


@pytest.mark.parametrize("spec", [None, "navigation-rlg"])
def test_chunks_do_not_matter(spec):
    made = simulate(Route([Manoeuvre(20, speed=30)], heading=10.0), Site(40.0), 20.0)
    r = made.record
    results = []
    for cuts in ((), (1, 7, 7, 500, 1203)):
        n = Navigator(Start.from_angles(Site(40.0), 10.0), every=7, spec=spec, subsamples=2)
        for s in pieces(len(r), cuts):
            n.update(ImuRecord(r.time[s], r.dt[s], r.dtheta[s], r.dvel[s]))
        results.append(n.path())
    a, b = results
    for name in ("time", "position", "v_n", "quat_nb"):
        assert np.array_equal(getattr(a, name), getattr(b, name))
    assert a.time[-1] == r.time[-1]
    if spec:
        assert np.array_equal(a.variances, b.variances)
        assert np.array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("every", [1, 7])
def test_drained_rows_are_those_of_the_path(every):
    site = Site(40.0)
    record = simulate(Static(30.0), site, 30.0, 100.0).record
    start = Start.from_angles(site, 30.0)
    whole = Navigator(start, every=every, spec="navigation-fog").update(record).path()
    navigator = Navigator(start, every=every, spec="navigation-fog")
    found = []
    for part in pieces(len(record), [5, 6, 1000, 2500]):
        navigator.update(ImuRecord(
            record.time[part], record.dt[part], record.dtheta[part], record.dvel[part]
        ))  # fmt: skip
        found.append(navigator.drain())
    rest = navigator.path()
    found = [part for part in found if part is not None]
    found.append(rest.rows(slice(int(rest.time[0] <= found[-1].time[-1]), None)))
    joined = found[0]
    for part in found[1:]:
        joined = joined.joined(part)
    for name in ("time", "lat", "height", "v_n", "quat_nb", "variances"):
        assert np.array_equal(getattr(joined, name), getattr(whole, name)), name
    assert np.array_equal(rest.covariance, whole.covariance)
    assert navigator.drain() is None
    with pytest.raises(InputError, match="no samples"):
        Navigator(start).path()


def test_free_height_runs_away_and_others_do_not():
    """1 m of height: free it grows as cosh(sqrt(2 g/R) t), damped it dies out, off it stays."""
    site = Site(45.0, 0.0, 100.0)
    record = simulate(Static(), site, 600.0, 10.0).record
    high = Start.from_angles(Site(45.0, 0.0, 101.0), 0.0)
    free = navigate(record, high, vertical="free").position[-1, 2] - 100.0
    g = float(gravity(45.0 * DEG, 100.0))
    rate = np.sqrt(2.0 * g / 6371000.0)
    assert free == pytest.approx(np.cosh(rate * 600.0), rel=5e-3)
    damped = navigate(record, high, vertical=Vertical("damped", 100.0, 20.0)).position[-1, 2]
    assert abs(damped - 100.0) < 1e-4
    off = navigate(record, high, vertical="off")
    assert np.all(off.position[:, 2] == 101.0)
    assert np.all(off.v_n[:, 2] == 0.0)


def test_damping_takes_out_a_vertical_bias_by_its_integral():
    site = Site(45.0, 0.0, 100.0)
    record = simulate(Static(), site, 600.0, 10.0, accel_bias=np.array([0, 0, 1e-3])).record
    p = navigate(record, Start.from_angles(site, 0.0), vertical=Vertical("damped", None, 20.0))
    assert np.abs(p.position[:, 2] - 100.0).max() > 0.05
    assert abs(p.position[-1, 2] - 100.0) < 1e-4


def test_height_follows_the_heights_given():
    site = Site(45.0)
    record = simulate(Static(), site, 300.0, 10.0).record
    heights = 0.1 * np.minimum(record.time, 100.0)
    n = Navigator(Start.from_angles(site, 0.0), vertical=Vertical("damped", time_constant=5.0))
    assert n.update(record, heights).path().position[-1, 2] == pytest.approx(10.0, abs=1e-3)


def test_gravity_models_against_each_other():
    """Seen as vertical velocity; PSINS's series is GRS-80: 1.4e-6 m/s^2 below WGS-84's equator."""
    site = Site(34.2, 108.9, 400.0)
    record = simulate(Static(), site, 10.0, 10.0).record
    up = {
        m: navigate(record, Start.from_angles(site, 0.0), gravity=m).v_n[-1, 2] / 10.0
        for m in ("somigliana", "somigliana1", "psins", "constant")
    }
    assert abs(up["somigliana"]) < 1e-10
    assert up["constant"] == pytest.approx(0.0, abs=1e-10)
    assert up["psins"] == pytest.approx(-1.4e-6, abs=0.1e-6)
    first = float(gravity(34.2 * DEG, 0.0)) * (1.0 - 2.0 * 400.0 / EARTH_A)
    assert up["somigliana1"] == pytest.approx(site.gravity - first, rel=1e-4)


def test_lever_arm_is_the_motion_simulated_there():
    lever = (1.0, 5.0, -2.0)
    steps = [Manoeuvre(20, speed=30), Manoeuvre(20, turn=90)]
    made = simulate(Route(steps, heading=30.0), Site(40.0), 40.0)
    there = simulate(Route(steps, heading=30.0, lever=lever), Site(40.0), 40.0)
    p = navigate(made.record, Start(Site(40.0), made.truth.quat_nb[0], made.truth.v_n[0]))
    moved = at_lever(p, lever)
    k = slice(10, -10)
    np.testing.assert_allclose(moved.v_n[k], there.truth.v_n[k], atol=2e-4)
    # The simulated IMU starts at the site; the way from there is what must agree.
    way = (moved.position - moved.position[0]) - (there.truth.position - there.truth.position[0])
    rm, rn = radii(40.0 * DEG)
    metres = way * [float(rm), float(rn) * np.cos(40.0 * DEG), 1.0]
    assert np.abs(metres).max() < 5e-3
    with pytest.raises(InputError, match="three finite"):
        at_lever(p, (1.0, 2.0))


@pytest.mark.parametrize("vertical", ["free", "off"])
def test_covariance_is_honest(vertical):
    """NEES of 9 states over 150 runs of 20 min in the chi-square band of 1e-3."""
    from schuler.kernels import strapdown
    from schuler.kernels.strapdown import many
    from schuler.navigation.navigator import local_rows
    from schuler.sensors import ImuSpec

    rng = np.random.default_rng(5)
    spec = ImuSpec.from_dict({
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.01 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug", "velocity_random_walk": "50 ug/sqrt(Hz)"},
    })  # fmt: skip
    site = Site(60.0, 10.0, 50.0)
    motion = Route([Manoeuvre(100, speed=80.0), Manoeuvre(300, turn=200.0), Manoeuvre(800)], 30.0)
    made = simulate(motion, site, 1200.0, 10.0)
    sigma = np.array([2e-5] * 2 + [2e-4] + [0.05] * 3 + [5.0] * 3)
    if vertical == "off":
        sigma[[5, 8]] = 0.0
    start = Start(site, made.truth.quat_nb[0], made.truth.v_n[0], np.diag(sigma**2))
    path = Navigator(start, vertical=vertical, spec=spec, every=100_000).update(made.record).path()
    cov = path.covariance[:9, :9]

    runs = 150
    drawn = sigma * rng.standard_normal((runs, 9))
    states = np.tile(start.state().data, (runs, 1))
    rm, rn = (float(r) + 50.0 for r in radii(site.latitude))
    for state, x in zip(states, drawn, strict=True):
        # C_est = (I - [phi x]) C_true, in the frame of the place that is believed in.
        moved = Site(
            60.0 + x[7] / rm / DEG, 10.0 + x[6] / rn / np.cos(site.latitude) / DEG, 50.0 + x[8]
        )
        # A step east turns north itself: the frame of the start's wander is the believed one's.
        phi = x[:3]
        q = np.r_[1.0, -0.5 * phi]
        from schuler.attitude import multiply

        state[:] = Start(moved, multiply(q / np.linalg.norm(q), start.quat_nb),
                         start.v_n + x[3:6]).state().data  # fmt: skip
        if vertical == "off":
            state[6] = start.v_n[2]
    g, a = spec.gyro, spec.accelerometer
    errors = np.zeros((runs, 26))
    errors[:, :3] = g.bias * rng.standard_normal((runs, 3))
    errors[:, 12:15] = a.bias * rng.standard_normal((runs, 3))
    errors[:, 24:] = g.white, a.white
    ends = np.empty((runs, strapdown.ROW))
    mode = strapdown.OFF if vertical == "off" else strapdown.FREE
    options = np.array([strapdown.SOMIGLIANA, 0, mode, 0, 0, 0, 50.0], float)
    many(states, options, 0.1, made.record.dtheta, made.record.dvel, errors, rng, ends)
    ends = local_rows(ends)
    from schuler.attitude import multiply, quat_to_rotvec

    truth = made.truth
    rm, rn = (float(r) + 50.0 for r in radii(truth.position[-1, 0]))
    phi = quat_to_rotvec(multiply(truth.quat_nb[-1], ends.quat_nb * [1, -1, -1, -1]))
    dp = (np.column_stack([ends.lat, ends.lon, ends.height]) - truth.position[-1])[:, [1, 0, 2]]
    dp *= [rn * np.cos(truth.position[-1, 0]), rm, 1.0]
    x = np.column_stack([phi, ends.v_n - truth.v_n[-1], dp])
    keep = np.arange(9) if vertical == "free" else np.array([0, 1, 2, 3, 4, 6, 7])
    nees = np.einsum("ri,ij,rj->r", x[:, keep], np.linalg.inv(cov[np.ix_(keep, keep)]), x[:, keep])
    low, high = chi_square_band(runs * len(keep), 1e-3)
    assert low < nees.sum() < high, (nees.sum() / runs, x.std(0) / np.sqrt(np.diag(cov)))


def test_bad_input_is_said():
    site = Site(40.0)
    start = Start.from_angles(site, 0.0)
    record = simulate(Static(), site, 1.0).record
    with pytest.raises(InputError, match="three gyros"):
        navigate(ImuRecord(record.time, record.dt, np.ones((100, 4)), record.dvel), start)
    with pytest.raises(InputError, match="no samples"):
        Navigator(start).path()
    n = Navigator(start).update(record)
    with pytest.raises(InputError, match="not after the last"):
        n.update(record)
    with pytest.raises(InputError, match="unit quaternion"):
        Navigator(Start(site, (1.0, 1.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="gravity must be one of"):
        parse_gravity("wgs")
    with pytest.raises(InputError, match="takes no value"):
        Gravity("psins", 9.8)
    with pytest.raises(InputError, match="expected a number"):
        parse_vertical("damped=high")
    with pytest.raises(InputError, match="damped vertical"):
        Navigator(start).update(record, np.zeros(100))
    with pytest.raises(InputError, match="no attitude"):
        navigate(record, site)


@pytest.mark.realdata
def test_psins_gravity_is_what_its_record_was_made_with(reference_dir):
    """The mean force of 300 s less 50 ug a axis, along up: 3 sigma of 10 ug/sqrt(Hz) noise."""
    from schuler.attitude import euler_to_quat, rotate

    rows = np.loadtxt(reference_dir / "psins_static.csv", delimiter=",", skiprows=6)
    up = rotate(euler_to_quat(np.deg2rad([30.0, 1.0, 2.0])) * [1, -1, -1, -1], [0.0, 0.0, 1.0])
    g0 = 9.7803267715
    found = float((rows[:, 4:7].mean(axis=0) - 50e-6 * g0) @ up)
    site = Site(34.2, 108.9, 400.0)
    record = simulate(Static(), site, 10.0, 10.0).record
    fall = navigate(record, Start.from_angles(site, 0.0), gravity="psins").v_n[-1, 2] / 10.0
    assert found == pytest.approx(site.gravity - fall, abs=3.0 * 10e-6 * g0 / np.sqrt(300.0))
