"""The filter of 48 states: unbiased, as sure as it says, and as good as the information allows."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from schuler.centrifuge import (
    PUBLISHED_POSITIONS,
    Ekf,
    Plant,
    fit_platform,
    published_truth,
    scheme_information,
    simulate_platform,
)
from schuler.errors import InputError
from tests.conftest import LONG, chi_square_band

RUNS = 50 if LONG else 10


@pytest.fixture(scope="module")
def outputs():
    rng = np.random.default_rng(7)
    return simulate_platform(Plant(), PUBLISHED_POSITIONS, 100.0, published_truth(), rng, RUNS)


@pytest.fixture(scope="module")
def limit():
    information = scheme_information(Plant(), PUBLISHED_POSITIONS, 100.0)
    return np.linalg.inv(information)


@pytest.mark.slow
def test_runs_are_unbiased_consistent_and_reach_the_limit(outputs, limit):
    truth = published_truth()
    fits = [fit_platform(Plant(), PUBLISHED_POSITIONS, run, Ekf(passes=3)) for run in outputs]
    errors = np.array([fit.value - truth for fit in fits])
    # Each of 45 means within 4 standard errors: a false alarm in 350 such tests.
    sigma = np.sqrt(np.diag(limit))
    assert np.abs(errors.mean(axis=0) / sigma).max() * np.sqrt(RUNS) < 4.0
    # No variance is beyond the limit's by more than chance: false alarm 1e-3 for 45 together.
    variance = np.mean(errors**2, axis=0) / sigma**2
    assert variance.max() < chi_square_band(RUNS, 2e-3 / 45)[1] / RUNS
    # Normalised errors: false alarm 1e-3.
    nees = sum(e @ np.linalg.solve(f.covariance, e) for e, f in zip(errors, fits, strict=True))
    low, high = chi_square_band(45 * RUNS, 1e-3)
    assert low < nees < high
    np.testing.assert_allclose(fits[0].sigma, sigma, rtol=0.03)
    # Normalised innovations, 90,000 a run: within five deviations.
    assert np.mean([f.nis for f in fits]) == pytest.approx(1.0, abs=5 * np.sqrt(2 / 90e3 / RUNS))
    # In a typical run the worst error is at most half the published one (2.67 % and 1 %).
    worst = np.abs(errors / truth)
    assert np.median(worst[:, :27].max(axis=1)) < 0.5 * 0.0267
    assert worst[:, 27:].max() < 0.5 * 0.01


def test_one_pass_is_not_enough_and_passes_settle(outputs):
    truth = published_truth()
    passes = {n: fit_platform(Plant(), PUBLISHED_POSITIONS, outputs[0], Ekf(passes=n))
              for n in (1, 3, 4)}  # fmt: skip
    sigma = passes[4].sigma
    assert np.abs((passes[1].value - truth) / sigma).max() > 4.0
    assert np.abs((passes[3].value - passes[4].value) / sigma).max() < 0.1


def test_the_square_root_filter_is_the_same_filter(outputs):
    short = outputs[1][:, :1000]
    plain, root = (fit_platform(Plant(), PUBLISHED_POSITIONS, short, Ekf(2, square_root=s))
                   for s in (False, True))  # fmt: skip
    np.testing.assert_allclose(root.sigma, plain.sigma, rtol=1e-4)
    assert np.abs((root.value - plain.value) / plain.sigma).max() < 1e-2
    np.testing.assert_array_less(np.abs(plain.correlation), 1.0 + 1e-9)


def test_feeding_in_pieces_gives_the_same_bits():
    from schuler.kernels.platform import filter_position

    plant, rng = Plant(), np.random.default_rng(2)
    z = rng.normal(size=(120, 3))
    results = []
    for cuts in ([0, 120], [0, 1, 50, 120]):
        x, off, tally = np.zeros(51), np.zeros(51), np.zeros(2)
        x[45:] = 0.3
        cov = np.diag(np.r_[np.full(45, 1e-6), np.full(6, 1e-6)])
        for a, b in itertools.pairwise(cuts):
            filter_position(x, off, cov, 4 * a, z[a:b], 0, plant.gyro_axes, plant.turning,
                            plant.harmonics(), plant.omega, plant.earth, 0.005, 4, 9, 1e-10, 0.0,
                            False, 0, tally)  # fmt: skip
        results.append((x, cov))
    for first, second in zip(*results, strict=True):
        np.testing.assert_array_equal(first, second)


def test_drift_noise_loosens_the_gyros():
    rng = np.random.default_rng(3)
    z = simulate_platform(Plant(), PUBLISHED_POSITIONS, 10.0, published_truth(), rng)[0]
    still, loose = (fit_platform(Plant(), PUBLISHED_POSITIONS, z, Ekf(1, drift_noise=n))
                    for n in (0.0, 0.1))  # fmt: skip
    assert (loose.sigma[:27] > 1.5 * still.sigma[:27]).all()


def test_two_levels_of_force_find_d_oo():
    plant = Plant(d_oo=True)
    positions = [*PUBLISHED_POSITIONS, *PUBLISHED_POSITIONS]
    forces = [10.0] * 6 + [5.0] * 6
    truth = published_truth()
    truth = np.concatenate([truth[:27], truth[12:15], truth[27:]])
    rng = np.random.default_rng(5)
    z = simulate_platform(plant, positions, 10.0, truth, rng, forces=forces)[0]
    fit = fit_platform(plant, positions, z, forces=forces)
    error = fit.value - truth
    # 48 numbers, normalised: false alarm 1e-3.
    low, high = chi_square_band(48, 1e-3)
    assert low < error @ np.linalg.solve(fit.covariance, error) < high
    limit = np.linalg.inv(scheme_information(plant, positions, 10.0, forces))
    np.testing.assert_allclose(fit.sigma, np.sqrt(np.diag(limit)), rtol=0.05)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: Ekf(passes=0), "once or more"),
        (lambda: Ekf(step=0.0), "step must be positive"),
        (lambda: Ekf(square_root=True, drift_noise=1.0), "takes no drift noise"),
        (lambda: fit_platform(Plant(), [[0, 0, 0]], np.zeros((2, 5, 3))), "expected outputs of 1"),
        (lambda: fit_platform(Plant(), [[0, 0, 0]], np.full((1, 5, 3), np.nan)), "sample 1 of 5"),
        (lambda: fit_platform(Plant(), [[0, 0, 0]], np.zeros((1, 5, 3)), Ekf(step=0.003)),
         "whole number of steps"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_several_passes_converge_where_one_diverges():
    """In the 36th test of `published run xu2017` a filter of one pass is sure before it is near."""
    plant, truth = Plant(order="yzx"), published_truth()
    rng = np.random.default_rng([0, 2017, 35])
    one = simulate_platform(plant, PUBLISHED_POSITIONS, 100.0, truth, rng, 5)[0]
    with pytest.raises(InputError, match="diverged at position"):
        fit_platform(plant, PUBLISHED_POSITIONS, one, Ekf(passes=1))
    fit = fit_platform(plant, PUBLISHED_POSITIONS, one)
    assert fit.nis == pytest.approx(1.0, abs=5 * np.sqrt(2 / 90e3))
    error = fit.value - truth
    low, high = chi_square_band(45, 1e-4)
    assert low < error @ np.linalg.solve(fit.covariance, error) < high
