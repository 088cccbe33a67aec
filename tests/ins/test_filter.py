"""The filter against a dense joint Gaussian, in pieces, resumed, robust, and consistent."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import pytest

from schuler.attitude import multiply, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import (
    ErrorStateFilter,
    GroupNoise,
    Handling,
    Layout,
    Position,
    ProcessNoise,
    State,
    Velocity,
    ZeroDisplacement,
    ZeroVelocity,
    instrument_noise,
)
from schuler.kernels import ins_layout as kernel
from schuler.motion import Manoeuvre, Route, Static
from schuler.record import ImuRecord
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import chi_square_band
from tests.ins.tools import CONJUGATE, moved

SITE = Site(40.0, 116.0, 50.0)
TACTICAL = GRADES["tactical-fog"]
FIFTEEN = ("phi", "velocity", "position", "gyro_bias", "accelerometer_bias")
START_SIGMA = np.repeat([2e-3, 0.1, 3.0, 0.0, 0.0], 3)
START_SIGMA[9:12], START_SIGMA[12:15] = TACTICAL.gyro.bias, TACTICAL.accelerometer.bias


@pytest.fixture(scope="module")
def drive():
    """Return a minute of a car without errors."""
    route = Route(
        [Manoeuvre(10, speed=5.0), Manoeuvre(10, turn=90.0), Manoeuvre(10, speed=-3.0),
         Manoeuvre(10, turn=-60.0), Manoeuvre(20, speed=4.0)], heading=30.0, speed=10.0,
    )  # fmt: skip
    return simulate(route, SITE, 60.0, 50.0)


def with_noise(made, rng):
    """Return the record with biases and noise of a tactical instrument, and the biases."""
    record, n = made.record, len(made.record)
    gyro = rng.normal(size=3) * TACTICAL.gyro.bias
    accel = rng.normal(size=3) * TACTICAL.accelerometer.bias
    root = np.sqrt(record.dt)[:, None]
    out = replace(
        record,
        dtheta=record.dtheta + gyro * record.dt[:, None]
        + TACTICAL.gyro.white * root * rng.normal(size=(n, 3)),
        dvel=record.dvel + accel * record.dt[:, None]
        + TACTICAL.accelerometer.white * root * rng.normal(size=(n, 3)),
    )  # fmt: skip
    return out, np.r_[gyro, accel]


def piece(record, a, b):
    """Return the samples a to b - 1."""
    return replace(
        record, time=record.time[a:b], dt=record.dt[a:b], dtheta=record.dtheta[a:b],
        dvel=record.dvel[a:b],
    )  # fmt: skip


def fixes(made, rng, every=25, sigma=(1.0, 0.05), first=13):
    """Return positions at, and velocities between, samples."""
    t = made.truth
    k = np.arange(first, len(t.time), every)
    lat, lon, height = t.position[k].T
    noise = sigma[0] * rng.normal(size=(len(k), 3))
    radius = 6.37e6
    place = np.column_stack([
        lat + noise[:, 1] / radius, lon + noise[:, 0] / (radius * np.cos(lat)),
        height + noise[:, 2],
    ])  # fmt: skip
    return (
        Position(t.time[k], place, sigma[0]),
        Velocity(t.time[k], t.v_n[k] + sigma[1] * rng.normal(size=(len(k), 3)), sigma[1]),
    )


def made_filter(made, aids, rng=None, **options):
    """Return a filter, its start off by its own covariance where there is a generator."""
    layout = Layout(FIFTEEN)
    q, v = made.truth.quat_nb[0], made.truth.v_n[0]
    site = SITE
    x = np.zeros(15)
    if rng is not None:
        x = START_SIGMA * rng.normal(size=15)
        q, v = multiply(rotvec_to_quat(-x[:3]), q), v + x[3:6]
        lat, lon, h = made.truth.position[0]
        from schuler.earth import radii

        rm, rn = (float(r) + h for r in radii(lat))
        site = Site((lat + x[7] / rm) / DEG, (lon + x[6] / (rn * np.cos(lat))) / DEG, h + x[8])
    noise = ProcessNoise.of(layout, instrument_noise(layout, TACTICAL))
    return ErrorStateFilter(layout, site, q, np.diag(START_SIGMA**2), noise, aids, v_n=v, **options)


def error_of(f, made, biases):
    """Return the error (15,) of a filter at the end of the record."""
    from tests.ins.tools import nominal

    t = made.truth
    lat, lon, h = t.position[-1]
    true = nominal(t.quat_nb[-1], t.v_n[-1], Site(lat / DEG, lon / DEG, h))
    return np.concatenate([
        -quat_to_rotvec(multiply(f.quat_nb, t.quat_nb[-1] * CONJUGATE)),
        f.v_n - t.v_n[-1], moved(true, f._state),
        biases[:3] - f.parameter("gyro_bias"), biases[3:] - f.parameter("accelerometer_bias"),
    ])  # fmt: skip


def small_system(feedback, steps=8):
    """Return a filter of a stationary vehicle with velocities at each second, and its aids."""
    rng = np.random.default_rng(3)
    made = simulate(Static(40.0, 3.0, -2.0), SITE, float(steps), 20.0)
    record, _ = with_noise(made, rng)
    layout = Layout([*FIFTEEN, "gyro_markov"])
    noise = ProcessNoise.of(layout, {
        **instrument_noise(layout, TACTICAL),
        "gyro_markov": GroupNoise(0.0, 1e-5, 3.0, "gyro_bias"),
        "position": GroupNoise(1e-4, source="disturbance"),
    })  # fmt: skip
    sigma = np.r_[0.01 * START_SIGMA[:3], 0.02 * np.ones(6), START_SIGMA[9:], 1e-5 * np.ones(3)]
    z = 0.01 * rng.normal(size=(2, steps, 3))
    times = np.arange(1.0, steps + 0.5)
    aids = [ZeroVelocity(times, z[0], 0.01), ZeroDisplacement(times, z[1], (0.01, 0.02, 0.0))]
    f = ErrorStateFilter(
        layout, SITE, made.truth.quat_nb[0], np.diag(sigma**2), noise, aids, fixed_place=True,
        feedback=feedback, smooth=True, budget=True, step=10.0,
    )  # fmt: skip
    f.update(record)
    return f, sigma, noise


def test_filter_and_smoother_are_the_joint_gaussian():
    """All states of eight epochs stacked: one dense Gaussian, conditioned at once."""
    f, sigma, noise = small_system(feedback=False)
    epochs, n = np.concatenate(f._kept_p), f.layout.size
    phis = epochs[1:, 2, :n, :n]
    steps = len(phis)
    decay = np.exp(-noise.fade[:n])
    q = np.diag(noise.walk[:n] + noise.bound[:n] * (1.0 - decay**2))
    big = np.zeros((steps + 1, n, steps + 1, n))
    big[0, :, 0] = np.diag(sigma**2)
    for k in range(steps):
        big[k + 1, :, : k + 1] = np.einsum("ij,jab->iab", phis[k], big[k, :, : k + 1])
        big[: k + 1, :, k + 1] = np.moveaxis(big[k + 1, :, : k + 1], 0, -1)
        big[k + 1, :, k + 1] = phis[k] @ big[k, :, k] @ phis[k].T + q
    big = big.reshape((steps + 1) * n, -1)
    h1 = np.zeros((5, n))
    h1[:3, 3:6], h1[3, 6], h1[4, 7] = np.eye(3), 1.0, 1.0
    rows = np.zeros((5 * steps, (steps + 1) * n))
    z, r = [], []
    for k in range(steps):
        rows[5 * k : 5 * k + 5, (k + 1) * n : (k + 2) * n] = h1
        r += [0.01**2] * 4 + [0.02**2]
    # The nominal is not corrected: predicted minus measured is what each innovation says of it.
    history = f.history()
    xs = np.concatenate(f._kept_x)
    for k in range(steps):
        for aid, columns in (("zero_velocity", (0, 1, 2)), ("zero_displacement", (0, 1))):
            table = next(a for a in f.aids if a.label == aid).table(0)
            value = (
                history.v_n[k] + xs[k + 1, 1, 3:6] if aid == "zero_velocity"
                else history.displacement[k] + xs[k + 1, 1, 6:9]
            )  # fmt: skip
            z += [value[c] - table[k, kernel.M_VALUE + c] for c in columns]
    gain = big @ rows.T @ np.linalg.inv(rows @ big @ rows.T + np.diag(r))
    want_x, want_p = gain @ z, big - gain @ rows @ big
    done = f.smoothed()
    scale = np.maximum(np.sqrt(np.diag(want_p)), 1e-300)
    np.testing.assert_allclose(done.error.ravel() / scale, want_x / scale, atol=1e-6)
    for k in range(steps + 1):
        own = slice(k * n, (k + 1) * n)
        s = np.outer(scale[own], scale[own])
        np.testing.assert_allclose(done.covariance[k] / s, want_p[own, own] / s, atol=1e-6)
    last = slice(steps * n, None)
    np.testing.assert_allclose(f.error_state / scale[last], want_x[last] / scale[last], atol=1e-6)
    np.testing.assert_allclose(
        f.covariance / np.outer(scale[last], scale[last]),
        want_p[last, last] / np.outer(scale[last], scale[last]), atol=1e-6,
    )  # fmt: skip
    # The end of the smoother is the filter, bit for bit.
    np.testing.assert_array_equal(done.quat_nb[-1], history.quat_nb[-1])


def test_feedback_changes_nothing_but_where_the_estimate_is_kept():
    """Filter and smoother of small errors agree to second order, and so does the budget."""
    a, b = (small_system(feedback)[0] for feedback in (False, True))
    sigma = np.sqrt(np.diag(a.covariance))
    np.testing.assert_allclose(b.error_state, 0.0, atol=0.0)
    turn = quat_to_rotvec(multiply(a.quat_nb, b.quat_nb * CONJUGATE))
    assert np.all(np.abs(turn) < 2e-3 * sigma[:3])
    assert np.all(np.abs(a.v_n - b.v_n) < 2e-3 * sigma[3:6])
    for group in ("gyro_bias", "accelerometer_bias", "gyro_markov"):
        off = a.parameter(group) - b.parameter(group)
        assert np.all(np.abs(off) < 2e-3 * sigma[a.layout[group]]), group
    scale = np.outer(sigma, sigma)
    np.testing.assert_allclose(b.covariance / scale, a.covariance / scale, atol=1e-4)
    one, other = a.smoothed(), b.smoothed()
    turn = quat_to_rotvec(multiply(one.quat_nb, other.quat_nb * CONJUGATE))
    assert np.all(np.abs(turn) < 2e-3 * one.sigma("phi"))
    assert np.all(np.abs(one.v_n - other.v_n) < 5e-3 * one.sigma("velocity"))
    for f in (a, b):
        total = sum(f.budget.values())
        np.testing.assert_allclose(total, f.covariance, rtol=1e-9, atol=1e-22)
        assert f.budget["gyro_angle_random_walk"][0, 0] > 0.0


def everything(f):
    """Return all numbers of a filter."""
    return {**f.arrays(), "history": f.history().rows}


def test_any_chunking_gives_the_same_bits(drive):
    """Measurements between samples, at them, and at the ends of chunks."""
    record, _ = with_noise(drive, np.random.default_rng(1))
    aids = fixes(drive, np.random.default_rng(2))
    # Off the samples: each divides one.
    aids = [replace(a, time=np.asarray(a.time) + 0.0073, delay=0.0073) for a in aids]
    aids.append(Velocity(record.time[99::100], 0.0, 1e3, name="weak"))
    ends = []
    for cuts in ([0, 3000], [0, 1, 77, 100, 101, 1500, 2999, 3000]):
        f = made_filter(drive, aids, budget=True)
        for a, b in pairwise(cuts):
            f.update(piece(record, a, b))
        ends.append(everything(f))
    for name, value in ends[0].items():
        np.testing.assert_array_equal(value, ends[1][name], err_msg=name)
    assert len(ends[0]["history"]) > 140


def test_a_filter_resumes_from_its_arrays(drive):
    record, _ = with_noise(drive, np.random.default_rng(1))
    aids = fixes(drive, np.random.default_rng(2))
    whole = made_filter(drive, aids).update(record)
    first = made_filter(drive, aids).update(piece(record, 0, 1234))
    second = made_filter(drive, aids)
    second.restore(first.arrays())
    assert second.samples == 1234
    second.update(piece(record, 1234, None))
    for name, value in whole.arrays().items():
        np.testing.assert_array_equal(value, second.arrays()[name], err_msg=name)
    for name, damage in (("state", lambda a: a[:5]), ("p", lambda a: np.nan * a),
                         ("queue", lambda a: a + 7.5)):  # fmt: skip
        arrays = first.arrays()
        arrays[name] = damage(arrays[name])
        with pytest.raises(InputError, match=f"'{name}'"):
            made_filter(drive, aids).restore(arrays)


@pytest.mark.compiled
def test_measurements_may_come_with_the_stream(drive):
    record, _ = with_noise(drive, np.random.default_rng(1))
    position, velocity = fixes(drive, np.random.default_rng(2))
    whole = made_filter(drive, [position, velocity]).update(record)
    f = made_filter(drive, [replace(a, time=[], value=0.0) for a in (position, velocity)])
    for a, b in pairwise(range(0, 3001, 500)):
        for aid in (position, velocity):
            t = np.asarray(aid.time)
            now = (t > 0.02 * a) & (t <= 0.02 * b + 1e-6)
            f.add(replace(aid, time=t[now], value=np.asarray(aid.value)[now]))
        f.update(piece(record, a, b))
    np.testing.assert_array_equal(f.covariance, whole.covariance)
    np.testing.assert_array_equal(f.quat_nb, whole.quat_nb)
    with pytest.raises(InputError, match="comes after the sample"):
        f.add(replace(velocity, time=[1.0], value=0.0))
    with pytest.raises(InputError, match="no aid 'other'"):
        f.add(replace(velocity, name="other"))
    with pytest.raises(InputError, match="not after the last sample"):
        f.update(piece(record, 0, 10))


@pytest.mark.compiled
def test_errors_and_innovations_are_what_the_covariance_says(drive):
    """20 runs of a minute: NEES of 15 states and all innovations; false alarm 1e-3 each."""
    nees, squares, count, runs = 0.0, 0.0, 0, 20
    for seed in range(runs):
        rng = np.random.default_rng([7, seed])
        record, biases = with_noise(drive, rng)
        f = made_filter(drive, fixes(drive, rng), rng).update(record)
        e = error_of(f, drive, biases)
        nees += e @ np.linalg.solve(f.covariance, e)
        h = f.history()
        squares += float(np.sum(h.mean_square * h.scalars))
        count += int(h.scalars.sum())
    low, high = chi_square_band(15 * runs, 1e-3)
    assert low < nees < high
    low, high = chi_square_band(count, 1e-3)
    assert low < squares < high
    assert count == 20 * 6 * 120


@pytest.mark.compiled
def test_the_smoother_is_consistent_and_better_in_the_middle(drive):
    """20 runs, attitude and velocity half way, without fixes for 20 s; false alarm 1e-3."""
    total, runs, better = 0.0, 20, []
    for seed in range(runs):
        rng = np.random.default_rng([8, seed])
        record, _ = with_noise(drive, rng)
        aids = []
        for aid in fixes(drive, rng):
            t = np.asarray(aid.time)
            keep = (t < 20.0) | (t > 40.0)
            aids.append(replace(aid, time=t[keep], value=np.asarray(aid.value)[keep]))
        # A weak measurement makes an epoch in the middle.
        aids.append(Velocity([30.0], 0.0, 1e4, name="mark"))
        f = made_filter(drive, aids, rng, smooth=True).update(record)
        done, h = f.smoothed(), f.history()
        k = int(np.searchsorted(h.time, 30.0 - 1e-9))
        true = round(30.0 / 0.02)
        e = np.r_[
            -quat_to_rotvec(multiply(done.quat_nb[k + 1],
                                     drive.truth.quat_nb[true] * CONJUGATE)),
            done.v_n[k + 1] - drive.truth.v_n[true],
        ]  # fmt: skip
        total += e @ np.linalg.solve(done.covariance[k + 1][:6, :6], e)
        better.append(done.sigma("velocity")[k + 1] / h.sigma("velocity")[k])
    low, high = chi_square_band(6 * runs, 1e-3)
    assert low < total < high
    assert np.max(better) < 0.7


def test_a_gate_refuses_outliers_and_is_never_locked_out(drive):
    record, biases = with_noise(drive, np.random.default_rng(1))
    position, velocity = fixes(drive, np.random.default_rng(2))
    hit = np.asarray(position.value).copy()
    hit[[30, 60, 61]] += [50.0 / 6.37e6, 0.0, 0.0]
    gate = Handling(gate=0.999999)
    clean = made_filter(drive, [position, velocity]).update(record)
    plain = made_filter(drive, [replace(position, value=hit), velocity]).update(record)
    gated = made_filter(drive, [replace(position, value=hit, handling=gate), velocity])
    gated.update(record)
    assert gated.refused == 9
    assert gated.resets == 0
    off = [np.linalg.norm(error_of(f, drive, biases)[6:8]) for f in (clean, plain, gated)]
    assert off[2] < 1.2 * off[0] + 0.1
    weight = gated.innovations("position")[3]
    np.testing.assert_array_equal(np.flatnonzero(weight == 0.0), [30, 60, 61])
    # A step of 50 m that stays: the sixth fix widens the covariance and is taken.
    late = np.asarray(position.value).copy()
    late[60:] += [50.0 / 6.37e6, 0.0, 0.0]
    step = made_filter(drive, [replace(position, value=late, handling=gate)], budget=True)
    step.update(record)
    assert step.resets >= 1
    # Fixes come every half a second: at the sixth.
    np.testing.assert_array_equal(
        step.innovations("position")[3][60:67] == 0.0, [True] * 5 + [0] * 2
    )
    e = error_of(step, drive, biases)
    assert abs(e[7] - 50.0) < 5.0
    np.testing.assert_allclose(sum(step.budget.values()), step.covariance, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(
    ("rule", "most"), [pytest.param("huber", 0.6, marks=pytest.mark.compiled), ("igg3", 0.25)]
)
def test_robust_rules_weigh_outliers_down(drive, rule, most):
    record, biases = with_noise(drive, np.random.default_rng(1))
    position, velocity = fixes(drive, np.random.default_rng(2))
    hit = np.asarray(velocity.value).copy()
    hit[-3] += [1.0, 0.0, 0.0]
    found = {}
    for name, value, handling in (
        ("clean", velocity.value, Handling()), ("plain", hit, Handling()),
        ("robust", hit, Handling(robust=rule)),
    ):  # fmt: skip
        f = made_filter(drive, [position, replace(velocity, value=value, handling=handling)])
        f.update(record)
        found[name] = error_of(f, drive, biases)
        if name == "robust":
            assert f.weighed + f.refused > 0
            assert (f.refused > 0) == (rule == "igg3")
    plain = abs(found["plain"][3] - found["clean"][3])
    assert abs(found["robust"][3] - found["clean"][3]) < most * plain


def test_adaptive_noise_finds_what_the_noise_is_and_keeps_the_stated_floor(drive):
    record, _ = with_noise(drive, np.random.default_rng(1))
    for factor, low, high in ((5.0, 3.0, 7.0), (0.2, 0.0, 1.0)):
        position, velocity = fixes(drive, np.random.default_rng(2), sigma=(1.0, 0.05 * factor))
        velocity = replace(velocity, sigma=0.05, handling=Handling(adaptive=0.05))
        f = made_filter(drive, [position, velocity]).update(record)
        learned = np.sqrt(f._aid_state[1, kernel.S_NOISE : kernel.S_NOISE + 3]) / 0.05
        assert np.all((low < learned) & (learned < high))
        sigma = f.innovations("velocity")[2]
        assert np.all(sigma > 0.05)


@dataclass(frozen=True)
class Speed:
    """A user's own measurement: horizontal speed, from whatever shows it."""

    time: np.ndarray
    value: np.ndarray
    sigma: float = 0.1
    name: str = "speed"
    handling: Handling = field(default_factory=Handling)

    def rows(self, state: State):
        v = state.v_n[:2]
        speed = float(np.hypot(*v))
        h = state.row({"velocity": [v[0] / speed, v[1] / speed, 0.0]})
        return [speed - self.value[state.index]], [h], [self.sigma**2]


def test_a_user_s_own_measurement_is_like_any_other(drive):
    """A velocity given as three custom rows has the bits of the compiled kind, and may be mixed."""

    @dataclass(frozen=True)
    class Custom:
        time: np.ndarray
        value: np.ndarray
        name: str = "mine"
        handling: Handling = field(default_factory=Handling)

        def rows(self, state: State):
            h = [state.row({"velocity": np.eye(3)[k]}) for k in range(3)]
            return state.v_n - self.value[state.index], h, np.full(3, 0.05**2)

    record, biases = with_noise(drive, np.random.default_rng(1))
    _, velocity = fixes(drive, np.random.default_rng(2))
    # The x axis of the wander frame is 1e-4 rad off east in the end.
    built = made_filter(drive, [velocity], smooth=True).update(record)
    mine = made_filter(drive, [Custom(velocity.time, velocity.value)], smooth=True).update(record)
    sigma = np.sqrt(np.diag(built.covariance))
    assert np.all(np.abs(mine.v_n - built.v_n) < 0.2 * sigma[3:6])
    np.testing.assert_allclose(np.sqrt(np.diag(mine.covariance)), sigma, rtol=1e-3)
    np.testing.assert_allclose(
        mine.smoothed().sigma("phi"), built.smoothed().sigma("phi"), rtol=1e-3
    )
    t = drive.truth
    k = np.arange(10, len(t.time), 50)
    speed = Speed(t.time[k], np.hypot(*t.v_n[k, :2].T))
    f = made_filter(drive, [fixes(drive, np.random.default_rng(2))[0], speed])
    for a, b in pairwise([0, 500, 510, 511, 3000]):
        f.update(piece(record, a, b))
    again = made_filter(drive, [fixes(drive, np.random.default_rng(2))[0], speed]).update(record)
    np.testing.assert_array_equal(f.covariance, again.covariance)
    e = error_of(f, drive, biases)
    assert e @ np.linalg.solve(f.covariance, e) < 50.0
    assert len(f.innovations("speed")[0]) == len(k)

    class Wrong(Speed):
        def rows(self, state: State):
            return [1.0, 2.0], [np.zeros(15)], [1.0]

    with pytest.raises(InputError, match="as many rows of 15"):
        made_filter(drive, [Wrong(t.time[k], t.time[k])]).update(record)


@pytest.mark.parametrize(
    ("change", "text"),
    [({"covariance": np.eye(4)}, "expected a finite"), ({"quat_nb": [1.0, 1.0, 0.0, 0.0]}, "unit"),
     ({"v_n": [0.0, np.inf, 0.0]}, "three finite"), ({"step": 0.0}, "positive time"),
     ({"aids": [Velocity([1.0], estimate=("lever",))]}, "no group 'velocity.lever'")],
)  # fmt: skip
def test_bad_arguments(change, text):
    layout = Layout(FIFTEEN)
    options = {"quat_nb": [1.0, 0.0, 0.0, 0.0], "covariance": np.eye(15), **change}
    with pytest.raises(InputError, match=text):
        ErrorStateFilter(layout, SITE, noise=ProcessNoise.of(layout, {}), **options)


def test_a_measurement_before_the_record_is_an_error(drive):
    with pytest.raises(InputError, match="before the record"):
        made_filter(drive, [Velocity([-1.0])]).update(drive.record)


@pytest.mark.parametrize("fixed", [False, True], ids=["moving", "fixed place"])
def test_what_the_instrument_has_corrected_is_not_corrected_again(fixed):
    rng = np.random.default_rng(5)
    a, f = 0.02 * rng.standard_normal((2, 400, 3))
    f[:, 2] += 0.1
    before_a, before_f = (np.vstack([np.zeros((1, 3)), x[:-1]]) for x in (a, f))
    turn = a + np.cross(before_a, a) / 12.0
    x = np.cross(a, f)
    push = (
        f + 0.5 * x + np.cross(a, x) / 6.0
        + (np.cross(before_a, f) + np.cross(before_f, a)) / 12.0
    )  # fmt: skip
    layout = Layout(["phi", "velocity"])
    ends = {}
    for coning in (False, True):
        for sculling in (False, True):
            record = ImuRecord(
                0.01 * np.arange(1, 401), np.full(400, 0.01), turn if coning else a,
                push if sculling else f, coning, sculling,
            )  # fmt: skip
            made = ErrorStateFilter(
                layout, SITE, [1.0, 0.0, 0.0, 0.0], np.eye(6), ProcessNoise.of(layout, {}),
                fixed_place=fixed,
            )  # fmt: skip
            made.update(record)
            ends[coning, sculling] = np.r_[made.quat_nb, made.v_n]
    wanted = ends.pop((False, False))
    np.testing.assert_allclose(ends[False, True], wanted, atol=2e-6)
    for end in ends.values():
        # The rotation correction of corrected angles differs by a twelfth of their correction.
        np.testing.assert_allclose(end[:4], wanted[:4], atol=1e-12)
        np.testing.assert_allclose(end[4:], wanted[4:], atol=2e-4)
    # Were the flags not heard, it would show.
    deaf = replace(record, coning_corrected=False, sculling_corrected=False)
    made = ErrorStateFilter(
        layout, SITE, [1.0, 0.0, 0.0, 0.0], np.eye(6), ProcessNoise.of(layout, {}),
        fixed_place=fixed,
    )  # fmt: skip
    made.update(deaf)
    assert np.abs(made.quat_nb - wanted[:4]).max() > 1e-5
