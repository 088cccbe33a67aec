"""The tracking kernel against closed-form motion, theory of coning, and NumPy's sums."""

from __future__ import annotations

import json
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from schuler.constants import EARTH_RATE
from schuler.kernels import tracking
from tests.conftest import run_track

ALGORITHMS = (1, 2, 3, 4)


def grid(n, dt, start=0.0):
    """Return ends of n intervals and their lengths."""
    return start + dt * np.arange(1, n + 1), np.full(n, dt)


def rotation_of(row):
    """Return SciPy's rotation of a node's or state's quaternion."""
    return Rotation.from_quat(row[[3, 4, 5, 2]])


def noisy(n=500, dt=0.01, seed=3):
    """Return a record of everything at once."""
    rng = np.random.default_rng(seed)
    time, dts = grid(n, dt, start=7.0)
    return time, dts, rng.normal(scale=0.02, size=(n, 3)), rng.normal(scale=0.1, size=(n, 3))


# -- exact where it should be --------------------------------------------------------------


@pytest.mark.parametrize("n_sub", ALGORITHMS)
@pytest.mark.parametrize("dt", [0.01, 0.3])  # the second turns by 0.9 rad a sample: no series
def test_constant_rate_and_force_are_exact(n_sub, dt):
    rate, force = np.array([1.0, -2.0, 2.0]), np.array([0.5, -9.0, 4.0])
    n = 240
    time, dts = grid(n, dt)
    state, _ = run_track(
        time, dts, np.tile(rate * dt, (n, 1)), np.tile(force * dt, (n, 1)), n_sub=n_sub
    )
    total = float(time[-1])
    expected = Rotation.from_rotvec(rate * total)
    assert (expected.inv() * rotation_of(state)).magnitude() < 1e-12
    # The integral of exp([w t x]) f, in closed form.
    w = np.linalg.norm(rate)
    cross = np.cross(rate, force)
    velocity = (
        force * total
        + (1 - math.cos(w * total)) / w**2 * cross
        + (w * total - math.sin(w * total)) / w**3 * np.cross(rate, cross)
    )
    np.testing.assert_allclose(state[6:9], velocity, rtol=0, atol=1e-12 * np.abs(force).max() * n)
    assert state[0] == total
    assert state[1] == n // n_sub
    assert np.linalg.norm(state[2:6]) == pytest.approx(1.0, abs=2e-15)


@pytest.mark.parametrize("n_sub", ALGORITHMS)
def test_at_rest_velocity_is_force_times_time(n_sub):
    time, dts = grid(120, 0.01)
    state, _ = run_track(
        time, dts, np.zeros((120, 3)), np.tile([0, 0, 0.098], (120, 1)), n_sub=n_sub
    )
    np.testing.assert_array_equal(state[2:6], [1, 0, 0, 0])
    np.testing.assert_allclose(state[6:9], [0, 0, 0.098 * 120], rtol=1e-14)


def test_instruments_that_correct_themselves_are_left_alone():
    # A rotation vector and a velocity resolved at the start of the interval: exact as they are.
    rng = np.random.default_rng(8)
    phi, dv = rng.normal(scale=0.1, size=(50, 3)), rng.normal(size=(50, 3))
    time, dts = grid(50, 0.1)
    state, nodes = run_track(time, dts, phi, dv, coning=0.0, sculling=0.0)
    attitude, velocity = Rotation.identity(), np.zeros(3)
    for i in range(50):
        velocity = velocity + attitude.apply(dv[i])
        attitude = attitude * Rotation.from_rotvec(phi[i])
        np.testing.assert_allclose(nodes[i + 1, 6:9], velocity, atol=1e-13)
    assert (attitude.inv() * rotation_of(state)).magnitude() < 1e-13


# -- coning and sculling: order and level of the drift that theory leaves ------------------

#: weights of cross(increment k before, last), k = 1, 2, 3; and samples to an update
CONING = {
    1: ((1 / 12,), 1),
    2: ((2 / 3,), 2),
    3: ((27 / 20, 9 / 20), 3),
    4: ((214 / 105, 92 / 105, 54 / 105), 4),
}

#: the drift's power of the frequency at low frequency, by sample interval
ORDER = {1: 5, 2: 5, 3: 7, 4: 9}


def residual(n_sub, alpha):
    """Return what an algorithm misses an update, over the product of amplitudes.

    For amplitudes a and b a quarter apart and a phase alpha a sample, theory wants
    a b (lambda - sin(lambda))/2 an update of lambda = n alpha, and gets 4 a b sin^2(alpha/2)
    sum of K_k sin(k alpha) (Miller, 1983).
    """
    weights, samples = CONING[n_sub]
    with mp.workdps(40):
        alpha = mp.mpf(alpha)
        true = (samples * alpha - mp.sin(samples * alpha)) / 2
        weights = [mp.mpf(round(w * 420)) / 420 for w in weights]
        made = sum(w * mp.sin((k + 1) * alpha) for k, w in enumerate(weights))
        return float(4 * mp.sin(alpha / 2) ** 2 * made - true)


def coning_drift(n_sub, alpha, half_angle=1e-3, coning=1.0):
    """Return the drift a sample about the cone's axis, over the half angle squared."""
    dt, updates = 0.01, 1200
    omega = alpha / dt
    time, dts = grid(updates * n_sub, dt)
    edges = omega * np.r_[0.0, time]
    dtheta = np.column_stack(
        [
            math.sin(half_angle) * np.diff(np.cos(edges)),
            math.sin(half_angle) * np.diff(np.sin(edges)),
            np.full(len(time), -2.0 * omega * math.sin(half_angle / 2) ** 2 * dt),
        ]
    )
    _, nodes = run_track(time, dts, dtheta, 0.0 * dtheta, n_sub=n_sub, coning=coning)

    def truth(t):
        s = math.sin(half_angle / 2)
        q = [math.cos(half_angle / 2), s * math.cos(omega * t), s * math.sin(omega * t), 0.0]
        return Rotation.from_quat(np.asarray(q)[..., [1, 2, 3, 0]])

    def error(row):
        return (rotation_of(row) * (truth(0.0).inv() * truth(row[0])).inv()).as_rotvec()

    # From the hundredth update on: one sample with the one before it starts without a "before".
    a, b = nodes[100], nodes[-1]
    drift = (error(b) - error(a)) / ((b[1] - a[1]) * n_sub)
    return drift[2] / half_angle**2


@pytest.mark.parametrize("n_sub", ALGORITHMS)
@pytest.mark.parametrize("alpha", [0.4, 0.8])
def test_coning_drift_is_what_theory_leaves(n_sub, alpha):
    # Four samples at 0.4 rad a sample miss 8e-7 of the cone: there 1 % is 1e-8.
    measured = coning_drift(n_sub, alpha) * n_sub
    assert measured == pytest.approx(residual(n_sub, alpha), rel=0.015, abs=0)


@pytest.mark.parametrize("n_sub", ALGORITHMS)
def test_coning_order(n_sub):
    slow, fast = coning_drift(n_sub, 0.35), coning_drift(n_sub, 0.7)
    assert math.log2(fast / slow) == pytest.approx(ORDER[n_sub], abs=0.2)


def test_coning_uncorrected_is_the_full_drift():
    # The angles that the gyros sum are true; what is missed is the whole non-commutative part.
    alpha = 0.3
    drift = coning_drift(2, alpha, coning=0.0) * 2
    assert drift == pytest.approx(-(2 * alpha - math.sin(2 * alpha)) / 2, rel=1e-3, abs=0)
    assert abs(coning_drift(2, alpha)) < 0.02 * abs(drift)


def sculling_drift(n_sub, alpha, angle=1e-3, accel=10.0):
    """Return the velocity drift a sample, over angle times the velocity's amplitude."""
    dt, updates = 0.01, 1200
    omega = alpha / dt
    time, dts = grid(updates * n_sub, dt)
    edges = omega * np.r_[0.0, time]
    zero = np.zeros(len(time))
    # Roll angle sin, force across it in phase.
    dtheta = np.column_stack([angle * np.diff(np.sin(edges)), zero, zero])
    dvel = np.column_stack([zero, -accel / omega * np.diff(np.cos(edges)), zero])
    _, nodes = run_track(time, dts, dtheta, dvel, n_sub=n_sub)
    mean = quad(lambda p: math.sin(p) * math.sin(angle * math.sin(p)), 0, 2 * math.pi)[0]
    mean *= accel / (2 * math.pi)

    def truth(t):
        """Return the integral of accel sin(wt) sin(angle sin(wt)) to third order in the angle."""
        p = omega * t
        first = (p - math.sin(p) * math.cos(p)) / 2
        third = (3 * p / 8 - math.sin(2 * p) / 4 + math.sin(4 * p) / 32) * angle**2 / 6
        return accel / omega * angle * (first - third)

    assert truth(2 * math.pi / omega) == pytest.approx(mean * 2 * math.pi / omega, rel=1e-9, abs=0)
    a, b = nodes[100], nodes[-1]
    drift = (b[8] - truth(b[0])) - (a[8] - truth(a[0]))
    return drift / ((b[1] - a[1]) * n_sub) / (angle * accel / omega)


@pytest.mark.parametrize("n_sub", ALGORITHMS)
@pytest.mark.parametrize("alpha", [0.4, 0.8])
def test_sculling_drift_is_what_theory_leaves(n_sub, alpha):
    # The dual of coning: angle and velocity take the places of the two angles.
    measured = sculling_drift(n_sub, alpha) * n_sub
    assert measured == pytest.approx(residual(n_sub, alpha), rel=0.03, abs=0)


# -- sums and nodes ------------------------------------------------------------------------


@pytest.mark.parametrize("n_sub", ALGORITHMS)
def test_running_sums_are_the_sums_of_the_nodes(n_sub):
    time, dts, dtheta, dvel = noisy()
    state, nodes = run_track(time, dts, dtheta, dvel, n_sub=n_sub)
    assert len(nodes) == 500 // n_sub + 1
    # The samples' own sums (30 to 39) go on while an update waits for its last sample.
    np.testing.assert_array_equal(nodes[-1, :30], state[:30])
    v, t = nodes[1:, 6:9], nodes[1:, 0]
    np.testing.assert_allclose(t, (time - 7.0)[n_sub - 1 :: n_sub], rtol=1e-12)
    wt = EARTH_RATE * t
    b = np.column_stack([np.sin(wt), 2 * np.sin(wt / 2) ** 2, wt]) / EARTH_RATE
    # The same order of addition, the same bits.
    np.testing.assert_array_equal(nodes[1:, 9:12], np.cumsum(v, axis=0))
    np.testing.assert_allclose(nodes[1:, 12:15], np.cumsum(b, axis=0), rtol=1e-13)
    bv = np.cumsum(np.einsum("ni,nj->nij", b, v), axis=0).reshape(-1, 9)
    scale = np.cumsum(np.abs(np.einsum("ni,nj->nij", b, v)), axis=0).reshape(-1, 9)
    assert np.all(np.abs(nodes[1:, 15:24] - bv) <= 1e-13 * scale)
    i, j = np.triu_indices(3)
    np.testing.assert_allclose(nodes[1:, 24:30], np.cumsum(b[:, i] * b[:, j], axis=0), rtol=1e-13)


def test_sums_of_samples():
    time, dts, dtheta, dvel = noisy(n=501)
    state, _ = run_track(time, dts, dtheta, dvel, n_sub=4)
    # All samples count here, the one that still waits for its update too.
    assert (state[41], state[48]) == (501, 1)
    np.testing.assert_allclose(state[30:33], dtheta.sum(0), rtol=0, atol=1e-13)
    np.testing.assert_allclose(state[33:36], dvel.sum(0), rtol=0, atol=1e-12)
    w, f = np.linalg.norm(dtheta, axis=1) / 0.01, np.linalg.norm(dvel, axis=1) / 0.01
    np.testing.assert_allclose(
        state[36:40], [w.sum(), (w**2).sum(), f.sum(), (f**2).sum()], rtol=1e-12
    )


@pytest.mark.parametrize("t", [1e-3, 1.0, 600.0, 43082.0])
def test_gravity_basis_keeps_its_digits(t):
    with mp.workdps(40):
        w, x = mp.mpf(EARTH_RATE), mp.mpf(t)
        expected = [float(mp.sin(w * x) / w), float((1 - mp.cos(w * x)) / w), t]
    np.testing.assert_allclose(tracking.gravity_basis(t), expected, rtol=1e-15, atol=1e-11)


@pytest.mark.parametrize("n", [4095, 4096, 4097, 8193, pytest.param(40000, marks=pytest.mark.slow)])
def test_halving_the_nodes_keeps_ends_and_even_spacing(n):
    time, dts, dtheta, dvel = noisy(n=n)
    state, nodes = run_track(time, dts, dtheta, dvel)
    spacing = int(state[74])
    assert spacing == 2 ** max(0, math.ceil(math.log2((n + 1) / 4096)))
    assert len(nodes) <= tracking.NODE_CAPACITY
    assert len(nodes) == n // spacing + 1
    np.testing.assert_array_equal(nodes[:, 1], spacing * np.arange(len(nodes)))
    # A node is a snapshot: the same as a shorter run's end.
    for k in (0, 1, len(nodes) // 2, len(nodes) - 1):
        m = k * spacing
        short, _ = run_track(time[:m], dts[:m], dtheta[:m], dvel[:m])
        np.testing.assert_array_equal(nodes[k, 2:], np.r_[short[2 : tracking.PLAIN], short[76:80]])
    if n % spacing == 0:
        np.testing.assert_array_equal(nodes[-1], np.r_[state[: tracking.PLAIN], state[76:80]])


@pytest.mark.parametrize("n_sub", ALGORITHMS)
@given(cuts=st.lists(st.integers(0, 5000), max_size=10))
def test_chunking_does_not_matter(n_sub, cuts):
    # Long enough for the nodes to be halved when every sample is an update.
    time, dts, dtheta, dvel = noisy(n=5000)
    state, nodes = run_track(time, dts, dtheta, dvel, n_sub=n_sub)
    cut, cut_nodes = run_track(time, dts, dtheta, dvel, n_sub=n_sub, cuts=cuts)
    np.testing.assert_array_equal(cut, state)
    np.testing.assert_array_equal(cut_nodes, nodes)


# -- another program's truth ---------------------------------------------------------------


@pytest.mark.realdata
@pytest.mark.parametrize("n_sub", ALGORITHMS)
def test_a_flight_of_another_program(reference_dir, n_sub):
    """Ten minutes of rocking, climbing S-turns, whose increments and truth pyins made.

    C_b^ib0 against the true attitude carried into inertial axes, and the velocity integral
    against the change of inertial velocity less the integral of gravitation, both from the
    10 Hz truth alone (its attitudes have 1e-12 deg, its positions 1e-8 deg).
    """
    table = np.genfromtxt(reference_dir / "pyins_traj.csv", delimiter=",", skip_header=2)
    truth = np.genfromtxt(reference_dir / "pyins_traj_truth_10hz.csv", delimiter=",", names=True)
    frd_to_rfu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    n = 59_880  # whole updates for each algorithm, and a row of the truth
    dtheta, dvel = table[:n, 1:4] @ frd_to_rfu, table[:n, 4:7] @ frd_to_rfu
    state, _ = run_track(*grid(n, 0.01), dtheta, dvel, n_sub=n_sub)

    t = truth["time_s"]
    lat, lon = np.radians(truth["lat"]), np.radians(truth["lon"])
    psi, theta, gamma = (np.radians(truth[k]) for k in ("heading", "pitch", "roll"))
    earth = Rotation.from_rotvec(np.outer(EARTH_RATE * t, [0.0, 0.0, 1.0]))
    # ENU in the Earth frame: turn by lon + 90 deg about z, then tilt up to the zenith.
    n_to_e = Rotation.from_euler("ZX", np.column_stack([lon + np.pi / 2, np.pi / 2 - lat]))
    attitude = earth * n_to_e * Rotation.from_euler("ZXY", np.column_stack([-psi, theta, gamma]))
    last = n // 10
    turned = attitude[0].inv() * attitude[last]
    error = (turned.inv() * rotation_of(state)).magnitude()
    assert t[last] == pytest.approx(state[0])

    s, e2, a = np.sin(lat), 6.6943799901413e-3, 6378137.0
    rn = a / np.sqrt(1 - e2 * s**2)
    r = np.column_stack(
        [
            (rn + truth["alt"]) * np.cos(lat) * np.cos(lon),
            (rn + truth["alt"]) * np.cos(lat) * np.sin(lon),
            ((1 - e2) * rn + truth["alt"]) * s,
        ]
    )
    spin = np.array([0.0, 0.0, EARTH_RATE])
    v_n = np.column_stack([truth["VE"], truth["VN"], -truth["VD"]])
    v_i = earth.apply(n_to_e.apply(v_n) + np.cross(spin, r))
    k = math.sqrt(1 - e2) * 9.8321849378 / 9.7803253359 - 1
    g = 9.7803253359 * (1 + k * s**2) / np.sqrt(1 - e2 * s**2) * (1 - 2 * truth["alt"] / a)
    down = n_to_e.apply(np.array([0.0, 0.0, -1.0]))
    gravitation = earth.apply(down * g[:, None] + np.cross(spin, np.cross(spin, r)))
    pulled = CubicSpline(t, gravitation).integrate(0.0, t[last])
    expected = attitude[0].inv().apply(v_i[last] - v_i[0] - pulled)
    # Four samples an update (25 Hz) end 0.0024 arcsec and 0.02 mm/s off, one sample 0.0002
    # arcsec and 0.0002 mm/s.
    assert error < 0.004 / 3600 * math.pi / 180
    np.testing.assert_allclose(state[6:9], expected, rtol=0, atol=4e-5)


# -- compiled or not -----------------------------------------------------------------------

SMALL_RUN = """
import json
import numpy as np
from schuler.kernels import quat, tracking
assert hasattr(tracking.track, "py_func") == COMPILED
rng = np.random.default_rng(11)
n, ends = 60, {}
for n_sub in (1, 2, 3, 4):
    state = np.zeros(tracking.STATE_SIZE)
    state[2] = state[74] = 1.0
    nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
    tracking.track(state, nodes, n_sub, 1.0, 1.0, 0.01 * np.arange(1, n + 1), np.full(n, 0.01),
                   rng.normal(scale=0.1, size=(n, 3)), rng.normal(scale=0.1, size=(n, 3)))
    ends[n_sub] = state.tolist()
print(json.dumps(ends))
"""


def test_uncompiled_kernels_give_the_same(run_python):
    plain = run_python("COMPILED = False" + SMALL_RUN, NUMBA_DISABLE_JIT="1")
    fast = run_python("COMPILED = True" + SMALL_RUN, NUMBA_DISABLE_JIT="0")
    plain, fast = json.loads(plain), json.loads(fast)
    for n_sub in plain:
        np.testing.assert_allclose(plain[n_sub], fast[n_sub], rtol=1e-12, atol=1e-12)
