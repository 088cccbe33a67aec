"""Fine alignment: every form of the filter, its covariance, its parts, its robustness."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from schuler.alignment import Fine, Gyrocompass, align
from schuler.attitude import euler_to_quat, multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle, Lines, Static, Sway
from schuler.sensors import GRADES
from schuler.simulation import simulate

SITE, FOG = Site(40.0), GRADES["navigation-fog"]
FORMS = {
    "displacement": Fine(),
    "without the base": Fine(base=False),
    "velocity": Fine(12, "velocity"),
    "ten states": Fine(10, "velocity"),
    "force": Fine(12, "force"),
    "any azimuth": Fine(azimuth="large"),
    "coloured": Fine(coloured=True),
    "lever": Fine(lever=True),
    "huber": Fine(robust="huber"),
    "igg3": Fine(robust="igg3"),
    "adaptive": Fine(adaptive=True),
    "no feedback": Fine(feedback=False),
    "three passes": Fine(passes=3),
}


def run(motion, seed, method, at="end", duration=300.0, rate=50.0):
    rng = np.random.default_rng([seed, 6])
    made = simulate(motion(rng), SITE, duration, rate, FOG, rng)
    fix = align(made.record, SITE, method, FOG, at=at)
    k = round((fix.time - made.truth.start) / made.truth.step)
    back = euler_to_quat(made.truth.euler_at(k)) * [1.0, -1.0, -1.0, -1.0]
    return -quat_to_rotvec(multiply(fix.quaternion, back)), fix


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
    assert fix.passed is not None
    assert len(fix.passed.t) == 300
    assert str(fix.method).startswith("kalman")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "ratio"), [(still, 1.06), (truck, 1.15)], ids=["at rest", "truck with crew"]
)
def test_errors_are_those_that_the_covariance_says(motion, ratio):
    """60 runs: mean NEES inside the 99 % band; rms of the heading beside the limit."""
    runs = 60
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda seed: run(motion, seed, Fine()), range(runs)))
    nees = np.mean([p @ np.linalg.solve(f.covariance, p) for p, f in found])
    low, high = np.array(stats.chi2.interval(0.99, 3 * runs)) / runs
    assert 0.75 * low < nees < high
    up = np.array([p[2] for p, _ in found]) / ARCMIN
    limit = np.array([f.limit_arcmin[2] for _, f in found])
    assert np.sqrt(np.mean(up**2) / np.mean(limit**2)) < ratio * (1 + 1.65 / np.sqrt(2 * runs))


def test_parts_add_up_and_smoothing_is_better_at_the_start():
    phi, fix = run(truck, 3, Fine(), at="start")
    assert set(fix.budget) == {"all_sources"}
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(fix.covariance)))
    _, end = run(truck, 3, Fine())
    assert fix.sigma_arcmin[2] < 1.1 * end.sigma_arcmin[2]


def test_a_robust_filter_survives_a_jump_that_throws_a_plain_one():
    rng = np.random.default_rng(9)
    record = simulate(Static(30.0), SITE, 200.0, 50.0, FOG, rng).record
    hit = record.dvel.copy()
    # A knock of 0.1 m/s within two samples (one alone is taken for a bad one), and back later.
    hit[5000:5002, 0] += 0.05
    hit[5050:5052, 0] -= 0.05
    knocked = replace(record, dvel=hit)
    plain = Fine(12, "velocity", base=False, noise=0.01)
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
        fix = align(record, SITE, Fine(azimuth="large"), FOG)
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
        Fine(**options)


def test_too_short_for_a_filter():
    rng = np.random.default_rng(1)
    record = simulate(Static(0.0), SITE, 5.0, 50.0, FOG, rng).record
    with pytest.raises(InputError, match="ten steps"):
        align(record, SITE, Fine(), FOG)


def test_feeding_the_kernel_in_pieces_gives_the_same_bits():
    from schuler.kernels.fine import OUT, STATE_SIZE, fine

    rng = np.random.default_rng(2)
    record = simulate(Static(10.0), SITE, 20.0, 50.0, FOG, rng).record
    ends = []
    for cuts in ([0, 1000], [0, 3, 333, 334, 999, 1000]):
        n = 15
        state, cfg = np.zeros(STATE_SIZE), np.zeros(25)
        state[1:5] = state[32:36] = euler_to_quat(np.radians([-10.0, 0.0, 0.0]))
        cfg[:3] = SITE.earth_rate
        cfg[3:17] = (SITE.gravity, 50, 1e-6, 1e-4, 0, 0, 1e-6, 1e-8, 1e-8, 1e-4, 0, 0, 1.0, 0)
        cfg[18:20], cfg[21], cfg[23:] = (1.5, 4.0), 1.0, 1.0
        p, x, parts = np.diag(np.full(n, 1e-6)), np.zeros(n), np.zeros((6, n, n))
        layout = np.array([n, 12, -1, -1, -1, 3, 3], np.int64)
        for a, b in pairwise(cuts):
            fine(state, x, p, parts, cfg, layout, np.zeros((2 * n + 8, n)), record.time[a:b],
                 record.dt[a:b], record.dtheta[a:b], record.dvel[a:b], np.zeros((30, OUT)),
                 np.zeros((0, 2 * n + 3 * n * n)))  # fmt: skip
        ends.append((state.copy(), p.copy()))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    np.testing.assert_array_equal(ends[0][1], ends[1][1])


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


@pytest.mark.parametrize("method", [Fine(), Fine(passes=3), Gyrocompass()], ids=str)
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
    back = other.quaternion * [1.0, -1.0, -1.0, -1.0]
    return float(np.linalg.norm(quat_to_rotvec(multiply(one.quaternion, back))))


@pytest.mark.parametrize("name", ["displacement", "velocity", "any azimuth", "coloured", "huber"])
def test_a_shaking_vehicle_shows_no_more_than_a_base_at_rest(name):
    """Its own accelerations are noise: a filter that regresses on them states too small a sigma."""
    for seed in range(3):
        rng = np.random.default_rng([seed, 9])
        motion = DisturbedVehicle.draw(rng, 600.0, heading=rng.uniform(0, 360))
        record = simulate(motion, SITE, 600.0, 50.0, FOG, rng).record
        fix = align(record, SITE, FORMS[name], FOG)
        assert fix.sigma_arcmin[2] > 0.99 * fix.limit_arcmin[2]
