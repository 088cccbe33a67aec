"""The closed form of a centrifuge test: against direct sums, finite differences, print."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import schuler as sc
from schuler.centrifuge import (
    PUBLISHED_POSITIONS,
    Objective,
    Plant,
    coefficient_names,
    coefficient_units,
    direct_information,
    judge,
    published_truth,
    scheme_information,
    simulate_platform,
    time_to_reach,
)
from schuler.centrifuge.filter import filter_information
from schuler.centrifuge.information import Tables, position_matrices
from schuler.centrifuge.sums import node_integrals, sum_nodes, turn_products
from schuler.errors import InputError
from schuler.kernels import gimbals as kernels


def sigma(information):
    return np.sqrt(np.diag(np.linalg.inv(information)))


@given(st.integers(1, 60), st.integers(1, 4), st.integers(0, 7))
def test_nodes_add_polynomials_exactly(points, order, degree):
    nodes, weights = sum_nodes(points, order)
    if degree > 2 * len(nodes) - 1 and points > order:
        return
    x = np.arange(points, dtype=float)
    scale = max(1.0, points - 1.0)
    assert weights @ (nodes / scale) ** degree == pytest.approx(
        np.sum((x / scale) ** degree), rel=1e-9, abs=1e-9
    )


def test_integrals_up_to_the_nodes_are_those_of_a_parabola():
    nodes, _ = sum_nodes(50, 3)
    p = np.polynomial.Polynomial([0.3, -0.2, 0.01])
    np.testing.assert_allclose(
        node_integrals(nodes) @ p(nodes + 0.5), p.integ()(nodes) - p.integ()(0.0), rtol=1e-10
    )


def test_a_turn_s_products_are_those_of_its_samples():
    g = turn_products(100, 0.02)
    t = 0.02 * np.arange(1, 101)
    assert g[7, 2] == pytest.approx(np.sum(t * np.sin(np.pi * t)))
    assert g[3, 5] == pytest.approx(0.0, abs=1e-10)
    assert g[1, 1] == pytest.approx(50.0)


@pytest.mark.parametrize("dwell", [20.0, pytest.param(100.0, marks=pytest.mark.compiled)])
@pytest.mark.parametrize("tilted", [False, True])
def test_the_closed_form_is_the_direct_sum_to_1e_4_of_each_sigma(dwell, tilted, rng):
    positions = np.array(PUBLISHED_POSITIONS, float)
    if tilted:
        positions = rng.uniform([0, -60, 0], [360, 60, 360], (6, 3))
    ours = sigma(scheme_information(Plant(), positions, dwell))
    direct = sigma(direct_information(Plant(), positions, dwell))
    np.testing.assert_allclose(ours, direct, rtol=1e-4)


@pytest.mark.compiled
def test_d_oo_shows_with_several_levels_of_force_and_not_with_one():
    plant = Plant(d_oo=True)
    positions = [*PUBLISHED_POSITIONS, *PUBLISHED_POSITIONS]
    forces = [10.0] * 6 + [5.0] * 6
    two = scheme_information(plant, positions, 20.0, forces)
    np.testing.assert_allclose(
        sigma(two), sigma(direct_information(plant, positions, 20.0, forces=forces)), rtol=1e-4
    )
    assert judge(plant, positions, 20.0, information=two).relative.max() < 10.0
    # |f|^2 is constant to 1e-3 with one level: D_F, D_II, D_OO and D_SS are one.
    one = scheme_information(plant, positions, 20.0)
    k = list(coefficient_names(True)).index("D_OOx")
    assert np.diag(np.linalg.pinv(one, hermitian=True))[k] >= 0.0
    with pytest.raises(InputError, match="not observable in these measurements: D_"):
        judge(plant, positions, 20.0, information=one)


@pytest.mark.parametrize(
    ("order", "dwell", "j"),
    [("zyx", 100.0, 133.5), ("zyx", 20.0, 123.6), ("yzx", 100.0, 142.1), ("yzx", 20.0, 129.9)],
)
def test_the_published_scheme_has_the_known_objective(order, dwell, j):
    found = judge(Plant(order=order), PUBLISHED_POSITIONS, dwell)
    assert found.values["sum-rho"] == pytest.approx(j, rel=0.01)
    if dwell == 100.0 and order == "zyx":
        relative = 100.0 * found.sigma / published_truth()
        assert relative[:27].max() == pytest.approx(0.83, rel=0.05)
        assert relative[27:].max() == pytest.approx(0.055, rel=0.05)


def test_objectives_are_those_of_numpy():
    found = judge(Plant(), PUBLISHED_POSITIONS, 20.0)
    scaled = found.covariance / np.outer(0.01 * published_truth(), 0.01 * published_truth())
    upper = np.triu_indices(45, 1)
    assert found.values["sum-rho"] == pytest.approx(np.abs(found.correlation[upper]).sum())
    assert found.values["a"] == pytest.approx(np.trace(scaled) / 45)
    assert found.values["d"] == pytest.approx(np.linalg.slogdet(scaled)[1] / 45)
    assert found.values["e"] == pytest.approx(np.linalg.eigvalsh(scaled)[-1], rel=1e-4)
    assert found.values["min-max"] == pytest.approx(np.sqrt(np.diag(scaled)).max())


def test_the_time_to_reach_is_the_first_dwell_that_suffices():
    time = time_to_reach(Plant(), PUBLISHED_POSITIONS)
    inside, before = (judge(Plant(), PUBLISHED_POSITIONS, t).relative.max() for t in
                      (time, time - 2.0))  # fmt: skip
    assert inside <= 1.0 < before
    hopeless = Objective("time", tuple(1e-9 * published_truth()))
    assert time_to_reach(Plant(), PUBLISHED_POSITIONS, hopeless) == np.inf


@pytest.mark.compiled
def test_the_filter_s_information_is_the_closed_form_where_both_hold():
    plant = Plant(order="yzx")
    own = sigma(filter_information(plant, PUBLISHED_POSITIONS, 20.0))
    np.testing.assert_allclose(
        own, sigma(scheme_information(plant, PUBLISHED_POSITIONS, 20.0)), rtol=0.02
    )
    turning = Plant(order="yzx", commanded=(3600.0, 0.0, 0.0))
    other = sigma(scheme_information(turning, PUBLISHED_POSITIONS, 20.0))
    assert np.abs(other / own - 1.0).max() > 0.05


@pytest.mark.compiled
@pytest.mark.parametrize("order", [kernels.ZYX, kernels.YZX])
def test_angles_turn_as_the_matrix_does(rng, order):
    """Eq. 15 for both orders: dC/dt = -[w x] C, by central differences."""
    for _ in range(20):
        angles = rng.uniform([-3, -1.2, -3], [3, 1.2, 3])
        w = rng.normal(size=3)
        out = np.array(kernels.angle_rates.py_func(angles, order, *w))
        h = 1e-6
        ahead, back = (
            np.array(kernels.platform_matrix.py_func(*(angles + s * h * out), order)).reshape(3, 3)
            for s in (1, -1)
        )
        c = np.array(kernels.platform_matrix.py_func(*angles, order)).reshape(3, 3)
        cross = np.cross(np.eye(3), -w)
        np.testing.assert_allclose((ahead - back) / (2 * h), -cross.T @ c, atol=1e-8)


@pytest.mark.compiled
def test_sensitivities_are_finite_differences_of_the_simulated_outputs():
    """The information of one position, from outputs of the nonlinear plant moved a little."""
    plant = Plant(attitude_prior=1e-9)
    position = [[40.0, 20.0, 70.0]]
    units = coefficient_units()[1]
    zero = np.zeros(45)
    quiet = Plant(attitude_prior=1e-12, noise=1e-9)

    def outputs(x):
        return simulate_platform(quiet, position, 4.0, x, np.random.default_rng(1))[0, 0].ravel()

    moved = []
    for k in range(45):
        step = zero.copy()
        step[k] = units[k] * (10.0 if k < 27 else 1.0)
        moved.append((outputs(step) - outputs(-step)) / (2 * step[k]))
    h = np.array(moved).T
    expected = h.T @ h / (1e-6 * plant.noise) ** 2
    found = position_matrices(Tables(plant, 4.0), position)[0]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale),
                               atol=2e-4)  # fmt: skip


def test_the_force_is_the_simulated_centrifuge_s_but_for_the_printed_sign_of_gravity():
    from schuler.motion import Centrifuge
    from schuler.simulation import simulate

    g = 9.7905
    site = sc.Site(28.22)
    motion = Centrifuge(radius=10 * g / np.pi**2, rate=180.0)
    record = simulate(motion, site, 2.0, 200.0).record
    t = record.time - 0.5 * record.dt
    a, b, c = Plant().harmonics()
    expected = a + np.outer(np.cos(np.pi * t), b) + np.outer(np.sin(np.pi * t), c)
    # Middle against mean of a sample, and gravity to 1e-4.
    np.testing.assert_allclose(record.accel / g, expected, atol=2e-3)
    printed = Plant(printed_gravity=True).harmonics()
    np.testing.assert_array_equal(printed[1:], Plant().harmonics()[1:])
    assert printed[0, 2] == -a[2] == -1.0


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: Plant(noise=0.0), "noise must be positive"),
        (lambda: Plant(sampling=50.3), "whole number of samples"),
        (lambda: Plant(latitude=91), "latitude"),
        (lambda: Plant(order="xyz"), "gimbal order"),
        (lambda: Plant(commanded=(1.0, 2.0)), "3 finite numbers"),
        (lambda: direct_information(Plant(commanded=(1.0, 0.0, 0.0)), [[1, 0, 2]], 2.0), "keeps"),
        (lambda: scheme_information(Plant(), PUBLISHED_POSITIONS, 3.0), "whole number of turns"),
        (lambda: scheme_information(Plant(), [[1, 2]], 2.0), "alpha, beta, gamma"),
        (lambda: scheme_information(Plant(), [[1, 89, 2]], 2.0), "beta is too near"),
        (lambda: scheme_information(Plant(), [[1, np.nan, 2]], 2.0), "alpha, beta, gamma"),
        (lambda: scheme_information(Plant(), [[1, 0, 2]], 2.0, [1.0, 2.0]), "forces"),
        (lambda: direct_information(Plant(), [[1, 0, 2]], 2.0, 0.003), "whole number of steps"),
        (lambda: judge(Plant(), [[1, 0, 2]], 20.0), "not observable"),
        (lambda: Objective("luck"), "unknown objective"),
        (lambda: Objective("a", (-1.0,)), "positive"),
        (lambda: judge(Plant(), PUBLISHED_POSITIONS, 20.0, Objective("a", (1.0,))), "expected 45"),
    ],
)
def test_bad_input_is_one_sentence(call, text):
    with pytest.raises(InputError, match=text):
        call()
