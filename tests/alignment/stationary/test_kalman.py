"""Kalman alignment: every form of the filter, its covariance, its parts, its robustness."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from schuler.alignment import Aligner, Gyrocompass, KalmanAlignment, align
from schuler.alignment.intervals import Intervals
from schuler.attitude import euler_to_quat, multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter, Layout, ProcessNoise
from schuler.kernels.ins_layout import DISPLACEMENT
from schuler.motion import DisturbedVehicle, Lines, Static, Sway
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import NORMAL_GRAVITY

SITE, FOG = Site(40.0, **NORMAL_GRAVITY), GRADES["navigation-fog"]
FORMS = {
    "displacement": KalmanAlignment(),
    "without the base": KalmanAlignment(base=False),
    "velocity": KalmanAlignment(12, "velocity"),
    "ten states": KalmanAlignment(10, "velocity"),
    "force": KalmanAlignment(12, "force"),
    "any azimuth": KalmanAlignment(azimuth="large"),
    "coloured": KalmanAlignment(coloured=True),
    "lever": KalmanAlignment(lever=True),
    "huber": KalmanAlignment(robust="huber"),
    "igg3": KalmanAlignment(robust="igg3"),
    "adaptive": KalmanAlignment(adaptive=True),
    "no feedback": KalmanAlignment(feedback=False),
    "three passes": KalmanAlignment(passes=3),
}


METHODS_OF_A_FILTER = (
    KalmanAlignment(), KalmanAlignment(12, "velocity"), KalmanAlignment(azimuth="large"),
    Gyrocompass(),
)  # fmt: skip


def run(motion, seed, method, at="end", duration=300.0, rate=50.0):
    rng = np.random.default_rng([seed, 6])
    made = simulate(motion(rng), SITE, duration, rate, FOG, rng)
    fix = align(made.record, SITE, method, FOG, at=at)
    k = round((fix.time - made.start) / made.step)
    back = euler_to_quat(made.euler_at(k)) * [1.0, -1.0, -1.0, -1.0]
    return -quat_to_rotvec(multiply(fix.quat_nb, back)), fix


def still(rng):
    return Static(rng.uniform(0, 360))


def truck(rng):
    return DisturbedVehicle.with_crew(rng, 300.0, heading=rng.uniform(0, 360))


@pytest.mark.parametrize("name", FORMS)
def test_every_form_finds_north_within_its_sigma(name):
    phi, fix = run(still, 1, FORMS[name])
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(fix.covariance)))
    assert fix.sigma_arcmin[2] < 1.35 * fix.limit_arcmin[2]
    np.testing.assert_allclose(sum(fix.budget.values()), fix.covariance)
    assert np.linalg.eigvalsh(fix.covariance)[0] > 0
    assert fix.filter_history is not None
    assert len(fix.filter_history.t) == 300
    assert str(fix.method).startswith("kalman")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "ratio"), [(still, 1.06), (truck, 1.15)], ids=["at rest", "truck with crew"]
)
def test_errors_are_those_that_the_covariance_says(motion, ratio):
    """60 runs: mean NEES inside the 99 % band; rms of the heading beside the limit."""
    runs = 60
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda seed: run(motion, seed, KalmanAlignment()), range(runs)))
    nees = np.mean([p @ np.linalg.solve(f.covariance, p) for p, f in found])
    low, high = np.array(stats.chi2.interval(0.99, 3 * runs)) / runs
    assert 0.75 * low < nees < high
    up = np.array([p[2] for p, _ in found]) / ARCMIN
    limit = np.array([f.limit_arcmin[2] for _, f in found])
    assert np.sqrt(np.mean(up**2) / np.mean(limit**2)) < ratio * (1 + 1.65 / np.sqrt(2 * runs))


def test_parts_add_up_and_smoothing_is_better_at_the_start():
    phi, fix = run(truck, 3, KalmanAlignment(), at="start")
    assert set(fix.budget) == {"all_sources"}
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(fix.covariance)))
    _, end = run(truck, 3, KalmanAlignment())
    assert fix.sigma_arcmin[2] < 1.1 * end.sigma_arcmin[2]


def test_a_robust_filter_survives_a_jump_that_throws_a_plain_one():
    rng = np.random.default_rng(9)
    record = simulate(Static(30.0), SITE, 200.0, 50.0, FOG, rng).record
    hit = record.dvel.copy()
    # A knock of 0.1 m/s within two samples (one alone is taken for a bad one), and back later.
    hit[5000:5002, 0] += 0.05
    hit[5050:5052, 0] -= 0.05
    knocked = replace(record, dvel=hit)
    plain = KalmanAlignment(12, "velocity", base=False, noise=0.01)
    clean = align(record, SITE, plain, FOG).heading_deg
    off = {
        rule: abs(align(knocked, SITE, replace(plain, robust=rule), FOG).heading_deg - clean)
        for rule in (None, "huber", "igg3")
    }
    assert off["huber"] < 0.5 * off[None]
    assert off["igg3"] < 0.3 * off[None]


def test_a_large_azimuth_needs_no_start():
    for heading in (0.0, 90.0, 180.0, 271.0):
        rng = np.random.default_rng(4)
        record = simulate(Static(heading, 2.0, -3.0), SITE, 300.0, 50.0, FOG, rng).record
        fix = align(record, SITE, KalmanAlignment(azimuth="large"), FOG)
        off = (fix.heading_deg - heading + 180) % 360 - 180
        assert abs(off) * 60 < 4 * fix.sigma_arcmin[2]


@pytest.mark.parametrize(
    ("options", "text"),
    [({"states": 11}, "states must be"), ({"passes": 2}, "odd"), ({"step": 0.0}, "positive"),
     ({"states": 12}, "15 states"), ({"robust": "median"}, "robust must be"),
     ({"states": 12, "measurement": "velocity", "coloured": True}, "displacement")],
)  # fmt: skip
def test_bad_options(options, text):
    with pytest.raises(InputError, match=text):
        KalmanAlignment(**options)


def test_too_short_for_a_filter():
    rng = np.random.default_rng(1)
    record = simulate(Static(0.0), SITE, 5.0, 50.0, FOG, rng).record
    with pytest.raises(InputError, match="ten steps"):
        align(record, SITE, KalmanAlignment(), FOG)


@pytest.mark.parametrize("method", [*METHODS_OF_A_FILTER], ids=str)
def test_a_filter_streams_resumes_and_holds_no_samples(method):
    """In pieces, and taken up from saved arrays: the same bits; memory does not grow."""
    rng = np.random.default_rng(2)
    record = simulate(Static(10.0), SITE, 60.0, 50.0, FOG, rng).record
    whole = Aligner(SITE, method, FOG).update(record).solution()
    pieces = Aligner(SITE, method, FOG)
    for a, b in pairwise([0, 3, 333, 334, 999, 1000, 3000]):
        pieces.update(piece(record, a, b))
    np.testing.assert_array_equal(pieces.solution().quat_nb, whole.quat_nb)
    np.testing.assert_array_equal(pieces.solution().covariance, whole.covariance)
    first = Aligner(SITE, method, FOG).update(piece(record, 0, 1801))
    second = Aligner(SITE, method, FOG)
    second.restore(first.arrays())
    second.update(piece(record, 1801, 3000))
    np.testing.assert_array_equal(second.solution().quat_nb, whole.quat_nb)
    assert sum(a.nbytes for a in second.arrays().values()) < 2_000_000
    assert not second._held


def piece(record, a, b):
    return replace(
        record, time=record.time[a:b], dt=record.dt[a:b], dtheta=record.dtheta[a:b],
        dvel=record.dvel[a:b],
    )  # fmt: skip


def test_a_long_record_has_longer_steps_and_the_same_sigma():
    """Two hours: instants of the history are 1.8 s apart, beyond the step of 1 s."""
    rng = np.random.default_rng(3)
    record = simulate(Static(10.0), SITE, 7200.0, 5.0, FOG, rng).record
    fix = align(record, SITE, KalmanAlignment(), FOG)
    assert 2000 < len(fix.filter_history.t) < 4097
    assert abs(fix.heading_deg - 10.0) * 60.0 < 4.0 * fix.sigma_arcmin[2]
    assert fix.sigma_arcmin[2] < 1.1 * fix.limit_arcmin[2]


def rocking(rate=100.0, duration=20.0):
    lines = [
        Lines(channel, np.array([f]), np.array([amplitude]), np.array([phase]))
        for channel, f, amplitude, phase in (
            ("roll", 0.7, 4.0, 0.0), ("pitch", 1.1, 3.0, 1.5), ("heading", 0.4, 2.0, 0.3),
            ("up", 2.1, 0.02, 0.5),
        )
    ]  # fmt: skip
    sway = Sway(30.0, lines=lines, lever=(0.5, 0.8, 1.0))
    return simulate(sway, SITE, duration, rate, None, np.random.default_rng(8))


@pytest.mark.parametrize("backward", [False, True])
def test_intervals_navigate_as_their_samples_do(backward):
    """A rocking vehicle: attitude, velocity and displacement at the end of half-second steps."""
    made = rocking()
    record = made.record
    h = Aligner(SITE, KalmanAlignment(), FOG).update(record).history()
    intervals = Intervals.of(h, 0.5)
    layout = Layout(["phi", "velocity", "position", "gyro_bias", "accelerometer_bias"])
    bias = {"gyro_bias": [2e-5, -1e-5, 3e-5], "accelerometer_bias": [5e-3, 1e-3, -4e-3]}
    earth = SITE.earth_rate
    q = made.truth.quat_nb[0]
    if backward:
        intervals, earth, q = intervals.reversed(), -earth, made.truth.quat_nb[-1]
        bias["gyro_bias"] = [-x for x in bias["gyro_bias"]]
        # Savage's corrections look at the sample before, which comes after.
        record = replace(
            record, time=record.start + record.end - (record.time - record.dt)[::-1],
            dtheta=np.ascontiguousarray(-record.dtheta[::-1]),
            dvel=np.ascontiguousarray(record.dvel[::-1]),
        )  # fmt: skip
    found = []
    for samples, inside in ((record, None), (intervals.record, intervals.inside)):
        f = ErrorStateFilter(
            layout, SITE, q, np.eye(15), ProcessNoise.of(layout, {}), fixed_place=True,
            earth_rate=earth, parameters=bias,
        )  # fmt: skip
        f.update(samples, inside)
        found.append((f.quat_nb, f.v_n, f._state[DISPLACEMENT : DISPLACEMENT + 3].copy()))
    (q0, v0, r0), (q1, v1, r1) = found
    assert np.linalg.norm(quat_to_rotvec(multiply(q1, q0 * [1.0, -1.0, -1.0, -1.0]))) < 2e-6
    # Of velocities of 0.1 m/s and displacements of metres that the biases make.
    assert np.abs(v1 - v0).max() < 1e-3
    assert np.abs(r1 - r0).max() < 5e-3
    assert len(intervals) == 40
    np.testing.assert_allclose(intervals.record.dt.sum(), 20.0)


def corrected(record, coning, sculling):
    """Return the record as an instrument gives it that corrects its increments itself."""
    a, f = record.dtheta, record.dvel
    before_a, before_f = (np.vstack([np.zeros((1, 3)), x[:-1]]) for x in (a, f))
    turn, push = a, f
    if coning:
        turn = a + np.cross(before_a, a) / 12.0
    if sculling:
        angle = np.linalg.norm(a, axis=1, keepdims=True)
        x = np.cross(a, f)
        push = (
            f + (1.0 - np.cos(angle)) / angle**2 * x
            + (angle - np.sin(angle)) / angle**3 * np.cross(a, x)
            + (np.cross(before_a, f) + np.cross(before_f, a)) / 12.0
        )  # fmt: skip
    return replace(
        record, dtheta=turn, dvel=push, coning_corrected=coning, sculling_corrected=sculling
    )


@pytest.mark.parametrize(
    "method", [KalmanAlignment(), KalmanAlignment(passes=3), Gyrocompass()], ids=str
)
def test_increments_that_the_instrument_corrected_are_not_corrected_again(method):
    rng = np.random.default_rng(8)
    lines = [
        Lines(channel, np.array([1.1]), np.array([amplitude]), np.array([phase]))
        for channel, amplitude, phase in (
            ("roll", 4.0, 0.0),
            ("pitch", 3.0, 1.5),
            ("up", 0.1, 0.5),
        )
    ]
    sway = Sway(30.0, lines=lines, lever=(0.5, 0.8, 1.0))
    record = simulate(sway, SITE, 200.0, 20.0, None, rng).record
    wanted = align(record, SITE, method, FOG)
    for coning, sculling in ((True, True), (True, False), (False, True)):
        done = corrected(record, coning, sculling)
        found = align(done, SITE, method, FOG)
        assert phi_between(found, wanted) < 0.05 * ARCMIN, (coning, sculling)
        # Were the flags not heard, it would show.
        deaf = replace(done, coning_corrected=False, sculling_corrected=False)
        assert phi_between(align(deaf, SITE, method, FOG), wanted) > 0.5 * ARCMIN


def phi_between(one, other):
    back = other.quat_nb * [1.0, -1.0, -1.0, -1.0]
    return float(np.linalg.norm(quat_to_rotvec(multiply(one.quat_nb, back))))


@pytest.mark.parametrize("name", ["displacement", "velocity", "any azimuth", "coloured", "huber"])
def test_a_shaking_vehicle_shows_no_more_than_a_base_at_rest(name):
    """Its own accelerations are noise: a filter that regresses on them states too small a sigma."""
    for seed in range(3):
        rng = np.random.default_rng([seed, 9])
        motion = DisturbedVehicle.draw(rng, 600.0, heading=rng.uniform(0, 360))
        record = simulate(motion, SITE, 600.0, 50.0, FOG, rng).record
        fix = align(record, SITE, FORMS[name], FOG)
        assert fix.sigma_arcmin[2] > 0.99 * fix.limit_arcmin[2]
