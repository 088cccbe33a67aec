"""Attitude from vectors: exact fits, three solvers of Wahba's problem, consistent covariances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from schuler.attitude import quat_to_matrix
from schuler.errors import InputError
from schuler.estimate.vectors import (
    VectorSums,
    davenport,
    triad,
    triad_covariance,
    triad_jacobian,
    wahba_covariance,
    wahba_svd,
)
from tests.conftest import chi_square_band

#: the chance that a right covariance fails its chi-square test; the seeds are fixed, so a
#: test that passes keeps passing until the code changes
FALSE_ALARM = 1e-3


def turned(seed):
    """Return a rotation matrix and a generator."""
    return Rotation.random(rng=np.random.default_rng(seed)).as_matrix(), np.random.default_rng(
        seed + 1
    )


def phi_of(estimate, true):
    """Return phi of C_est = (I - [phi x]) C_true; fine for small angles."""
    m = estimate @ true.T
    return 0.5 * np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


# -- TRIAD ---------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.floats(0.01, math.pi - 0.01))
def test_triad_is_exact_without_noise(seed, angle):
    true, rng = turned(seed)
    r1 = rng.normal(size=3)
    axis = np.cross(r1, [1.0, 2.0, 3.0])
    r2 = 7.0 * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).apply(r1)
    got = triad(r1, r2, 3.0 * true.T @ r1, 0.2 * true.T @ r2)
    np.testing.assert_allclose(got, true, atol=1e-13 / math.sin(angle))
    np.testing.assert_allclose(got @ got.T, np.eye(3), atol=1e-14)


def test_triad_fits_the_first_pair_and_the_second_in_its_half_plane(rng):
    true, _ = turned(4)
    r1, r2 = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0])
    v1, v2 = true.T @ r1 + 0.05 * rng.normal(size=3), true.T @ r2 + 0.05 * rng.normal(size=3)
    m = triad(r1, r2, v1, v2)
    np.testing.assert_allclose(m @ v1 / np.linalg.norm(v1), r1, atol=1e-14)
    assert (m @ v2)[0] == pytest.approx(0.0, abs=1e-14)
    assert (m @ v2)[1] > 0


@pytest.mark.parametrize(("s1", "s2"), [(2e-4, 7e-4), (7e-4, 2e-4)])
def test_triad_covariance_by_monte_carlo(s1, s2):
    true, rng = turned(20)
    r1, r2 = np.array([0.1, -0.2, 1.0]), np.array([0.3, 0.5, 0.7])
    r1, r2 = r1 / np.linalg.norm(r1), r2 / np.linalg.norm(r2)
    runs = 3000
    covariance = triad_covariance(r1, r2, s1**2, s2**2)
    errors = np.array(
        [
            phi_of(
                triad(
                    r1, r2,
                    true.T @ r1 + s1 * rng.normal(size=3), true.T @ r2 + s2 * rng.normal(size=3),
                ),
                true,
            )
            for _ in range(runs)
        ]
    )  # fmt: skip
    nees = np.einsum("ni,ij,nj", errors, np.linalg.inv(covariance), errors)
    low, high = chi_square_band(3 * runs, FALSE_ALARM)
    assert low < nees < high
    # NEES alone forgives a swap of axes: each element too, to 6 of its own standard errors.
    sample = errors.T @ errors / runs
    d = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(sample - covariance) < 6.0 * np.outer(d, d) * math.sqrt(2.0 / runs))


@pytest.mark.parametrize(
    ("vectors", "sentence"),
    [
        (([0, 0, 1], [0, 0, 2], [1, 0, 0], [0, 1, 0]), "the two vectors are parallel"),
        (([0, 0, 1], [0, 1, 0], [1, 0, 0], [-3, 0, 0]), "the two vectors are parallel"),
        (([0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0]), "vector one is zero or not finite"),
        (([0, 0, 1], [0, 1, 0], [1, 0, 0], [0, math.nan, 0]), "vector two is zero or not finite"),
        (([0, 0, math.inf], [0, 1, 0], [1, 0, 0], [0, 1, 0]), "vector one is zero or not finite"),
    ],
)
def test_triad_refuses(vectors, sentence):
    with pytest.raises(InputError, match=sentence):
        triad(*vectors)


def test_triad_covariance_refuses_parallel_vectors():
    with pytest.raises(InputError, match="the two vectors are parallel"):
        triad_covariance([0, 0, 1], [0, 0, -1], 1.0, 1.0)


# -- Wahba ---------------------------------------------------------------------------------


def noisy_pairs(seed, n=40, noise=0.05):
    """Return true rotation, references, observations and weights."""
    true, rng = turned(seed)
    r = rng.normal(size=(n, 3)) * [3.0, 1.0, 0.3]
    return true, r, r @ true + noise * rng.normal(size=(n, 3)), rng.uniform(0.1, 2.0, n)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.05, 1.0]))
def test_three_solvers_agree(seed, noise):
    true, r, v, w = noisy_pairs(seed, noise=noise)
    sums = VectorSums.empty()
    sums.add(r, v, w)
    by_svd = wahba_svd(sums.rv)
    np.testing.assert_allclose(sums.solve(), by_svd)
    by_q = davenport(sums.rv)
    assert by_q[0] >= 0
    by_scipy, _ = Rotation.align_vectors(r, v, weights=w)
    np.testing.assert_allclose(quat_to_matrix(by_q), by_svd, atol=1e-9)
    np.testing.assert_allclose(by_scipy.as_matrix(), by_svd, atol=1e-9)
    np.testing.assert_allclose(by_svd @ by_svd.T, np.eye(3), atol=1e-13)
    assert np.linalg.det(by_svd) == pytest.approx(1.0)
    if noise == 0.0:
        np.testing.assert_allclose(by_svd, true, atol=1e-12)


def test_two_vectors_are_enough():
    # Rank two: the third singular value is zero and its sign is chosen for a proper rotation.
    true, rng = turned(31)
    r = rng.normal(size=(2, 3))
    b = r.T @ (r @ true)
    np.testing.assert_allclose(wahba_svd(b), true, atol=1e-12)
    np.testing.assert_allclose(quat_to_matrix(davenport(b)), true, atol=1e-12)


def test_a_mirrored_set_still_gives_a_rotation():
    _, r, _, _ = noisy_pairs(32)
    m = wahba_svd(r.T @ (r * [1.0, 1.0, -1.0]))
    assert np.linalg.det(m) == pytest.approx(1.0)
    expected, _ = Rotation.align_vectors(r, r * [1.0, 1.0, -1.0])
    np.testing.assert_allclose(m, expected.as_matrix(), atol=1e-9)


def test_sums_do_not_care_how_pairs_come():
    _, r, v, w = noisy_pairs(33)
    whole, single = VectorSums.empty(), VectorSums.empty()
    whole.add(r, v, w)
    for row in zip(r, v, w, strict=True):
        single.add(*row)
    for field in ("weight", "r", "v", "rv", "rr"):
        np.testing.assert_allclose(getattr(single, field), getattr(whole, field), rtol=1e-12)
    np.testing.assert_allclose(whole.rr, (r * w[:, None]).T @ r, rtol=1e-13)
    np.testing.assert_allclose(whole.rv, (r * w[:, None]).T @ v, rtol=1e-12, atol=1e-12)


def test_centring_removes_an_offset_and_nothing_else():
    true, r, v, w = noisy_pairs(34, noise=0.0)
    offset = np.array([5.0, -3.0, 8.0])
    clean, spoilt = VectorSums.empty(), VectorSums.empty()
    clean.add(r, v, w)
    spoilt.add(r + np.array([1.0, 2.0, 3.0]), v + offset, w)
    assert np.abs(phi_of(spoilt.solve(), true)).max() > 0.1
    centred = spoilt.centred()
    np.testing.assert_allclose(centred.solve(), true, atol=1e-12)
    np.testing.assert_allclose(centred.rr, clean.centred().rr, atol=1e-9)
    np.testing.assert_array_equal([*centred.r, *centred.v], 0.0)
    rbar = (w @ r) / w.sum()
    np.testing.assert_allclose(
        clean.centred().rr, ((r - rbar) * w[:, None]).T @ (r - rbar), atol=1e-12
    )


@pytest.mark.parametrize("centred", [False, True])
def test_wahba_covariance_by_monte_carlo(centred):
    true, rng = turned(40)
    n, sigma, runs = 25, 3e-4, 2000
    r = rng.normal(size=(n, 3)) * [2.0, 1.0, 0.2] + [0.0, 0.0, 1.0]
    errors, covariance = np.empty((runs, 3)), np.empty((3, 3))
    for k in range(runs):
        sums = VectorSums.empty()
        offset = rng.normal(size=3) if centred else 0.0
        sums.add(r, r @ true + offset + sigma * rng.normal(size=(n, 3)))
        sums = sums.centred() if centred else sums
        errors[k] = phi_of(sums.solve(), true)
        covariance = sums.covariance(sigma**2)
    nees = np.einsum("ni,ij,nj", errors, np.linalg.inv(covariance), errors)
    low, high = chi_square_band(3 * runs, FALSE_ALARM)
    assert low < nees < high
    sample = errors.T @ errors / runs
    d = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(sample - covariance) < 6.0 * np.outer(d, d) * math.sqrt(2.0 / runs))
    # No unbiased estimator beats it, and it is what least squares of r x phi says.
    x = r - r.mean(0) if centred else r
    information = sum(np.dot(a, a) * np.eye(3) - np.outer(a, a) for a in x) / sigma**2
    np.testing.assert_allclose(covariance, np.linalg.inv(information), rtol=1e-9)


@pytest.mark.parametrize("solver", [wahba_svd, davenport])
@pytest.mark.parametrize(
    ("b", "sentence"),
    [
        (np.zeros((3, 3)), "the vectors all lie on one line"),
        (np.outer([1.0, 2, 3], [3.0, 2, 1]), "the vectors all lie on one line"),
        (np.diag([1.0, np.nan, 1.0]), "the vector sums are not finite"),
        (np.full((3, 3), np.inf), "the vector sums are not finite"),
    ],
)
def test_solvers_refuse(solver, b, sentence):
    with pytest.raises(InputError, match=sentence):
        solver(b)


def test_degenerate_sums_are_errors():
    with pytest.raises(InputError, match="no vector pairs to centre"):
        VectorSums.empty().centred()
    one = VectorSums.empty()
    one.add([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="the vectors all lie on one line"):
        one.solve()
    with pytest.raises(InputError, match="the vectors all lie on one line"):
        one.covariance(1.0)
    with pytest.raises(InputError, match="the vectors all lie on one line"):
        wahba_covariance(np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), 1.0)
    with pytest.raises(InputError, match="the vector sums are not finite"):
        wahba_covariance(np.full((3, 3), np.nan), 1.0)


@pytest.mark.parametrize("shapes", [((3,), (2, 3)), ((4, 3), (4, 2)), ((2, 2), (2, 2))])
def test_pairs_must_pair(shapes):
    with pytest.raises(InputError, match="expected two arrays of shape"):
        VectorSums.empty().add(np.ones(shapes[0]), np.ones(shapes[1]))


def test_triad_s_answer_to_errors_is_its_derivative(rng):
    for _ in range(20):
        r1, r2 = rng.standard_normal((2, 3)) * np.array([[3.0], [0.2]])
        wanted = np.empty((2, 3, 3))
        step = 1e-5
        for vector in range(2):
            for axis in range(3):
                tilt = []
                for sign in (1.0, -1.0):
                    v = np.array([r1, r2])
                    v[vector, axis] += sign * step
                    m = triad(r1, r2, *v)
                    # R_est = I - [phi x] about the truth.
                    tilt.append(0.5 * np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2],
                                                m[0, 1] - m[1, 0]]))  # fmt: skip
                wanted[vector, :, axis] = (tilt[0] - tilt[1]) / (2.0 * step)
        # Central differences of a smooth function: the square of step over the shorter vector.
        np.testing.assert_allclose(triad_jacobian(r1, r2), wanted, rtol=1e-4, atol=1e-4)
