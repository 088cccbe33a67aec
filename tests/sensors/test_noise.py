"""Drawn errors: each type of noise against its own definition, by ensembles with a band."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.kernels.noise import gauss_markov
from schuler.sensors import AccelerometerSpec, GyroSpec
from schuler.sensors.noise import NoiseTrain, corrupt
from tests.conftest import chi_square_band

FALSE_ALARM = 1e-3


def drawn(part, rng, n=100, m=3, dt=0.01, **options):
    """Return noise on increments that are zero, and the bias in it."""
    found = corrupt(np.zeros((n, m)), np.full(n, dt), part, rng, **options)
    return found.increments, found.bias


def allan_variance(rate, cluster):
    """Return the Allan variance over so many samples, mean over all axes."""
    means = rate[: len(rate) // cluster * cluster].reshape(-1, cluster, rate.shape[1]).mean(1)
    return 0.5 * np.mean(np.diff(means, axis=0) ** 2)


def test_no_errors_leave_the_truth(rng):
    truth = rng.normal(size=(50, 3))
    found = corrupt(truth, np.full(50, 0.01), GyroSpec(), rng)
    np.testing.assert_array_equal(found.increments, truth)
    np.testing.assert_array_equal(found.bias, 0.0)


def test_bias_is_drawn_per_axis(rng):
    out, bias = drawn(GyroSpec(bias=2e-7), rng, n=4, m=3000, dt=0.5)
    np.testing.assert_allclose(out, np.tile(0.5 * bias, (4, 1)), rtol=1e-14)
    low, high = chi_square_band(3000, FALSE_ALARM)
    assert low < np.sum((bias / 2e-7) ** 2) < high


def test_bias_that_is_given_is_taken(rng):
    out, bias = drawn(AccelerometerSpec(bias=1.0), rng, n=5, bias=[1e-3, 0.0, -2e-3])
    np.testing.assert_array_equal(bias, [1e-3, 0.0, -2e-3])
    np.testing.assert_allclose(out, 0.01 * np.tile(bias, (5, 1)), rtol=1e-14)
    with pytest.raises(InputError, match=r"expected a bias of shape \(3,\), got \(2,\)"):
        drawn(GyroSpec(), rng, bias=[1.0, 2.0])


@pytest.mark.parametrize("dt", [0.01, 0.25])
def test_random_walk_of_the_angle(rng, dt):
    out, _ = drawn(AccelerometerSpec(velocity_random_walk=3e-4), rng, n=5000, m=4, dt=dt)
    low, high = chi_square_band(out.size, FALSE_ALARM)
    assert low < np.sum(out**2) / (3e-4**2 * dt) < high
    # White: no correlation from one sample to the next, to 4 sigma.
    assert abs(np.sum(out[1:] * out[:-1]) / np.sum(out**2)) < 4.0 / math.sqrt(out.size)


def test_random_walk_of_the_rate(rng):
    k, n, m, dt = 1e-6, 400, 4000, 0.2
    out, _ = drawn(GyroSpec(rate_random_walk=k), rng, n=n, m=m, dt=dt)
    # Drawn every four samples, straight between: the last sample is 1/8 before a draw.
    steps = n // 4 - 1 + (7 / 8) ** 2
    low, high = chi_square_band(m, FALSE_ALARM)
    assert low < np.sum((out[-1] / dt) ** 2) / (k**2 * 4 * dt * steps) < high


@pytest.mark.compiled
def test_bias_instability_has_a_flat_allan_deviation(rng):
    # (2 ln 2 / pi) B^2, that is (0.664 B)^2, at every time between the sample and the record.
    level, dt = 5e-6, 0.1
    out, _ = drawn(GyroSpec(bias_instability=level), rng, n=8192, m=150, dt=dt)
    floor = 2.0 * math.log(2.0) / math.pi * level**2
    for cluster in (8, 32, 128, 512):
        assert allan_variance(out / dt, cluster) == pytest.approx(floor, rel=0.1, abs=0)


def test_quantisation_rounds_the_running_sum():
    rng = np.random.default_rng(6)
    q, n = 2e-6, 4000
    step = q * math.sqrt(12.0)
    truth = 1.7e-6 * rng.normal(size=(n, 3)) + 3e-6
    found = corrupt(truth, np.full(n, 0.01), GyroSpec(quantisation=q), rng).increments
    counts = found / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    error = np.cumsum(found - truth, axis=0)
    assert np.all(np.abs(error) < step * (1 + 1e-9))
    # The rounding's own standard deviation; it does not grow with time.
    assert error.std(axis=0) == pytest.approx(q, rel=0.05, abs=0)


@pytest.mark.parametrize("every", [1, 4])
def test_gauss_markov_is_stationary_and_forgets(every):
    rng = np.random.default_rng(9)
    tau, sigma, n, m, dt = 2.0, 0.3, 40, 5000, 0.1
    rho = np.array([math.exp(-every * dt / tau)])
    kick = sigma * np.sqrt(1.0 - rho**2)
    state = sigma * rng.normal(size=(1, m))
    start, out = state.copy(), np.zeros((n, m))
    line = np.column_stack([np.zeros(m), state[0]])
    normal = rng.normal(size=(n // every, 1, m))
    gauss_markov(every, rho, kick, dt, np.zeros(1, np.int64), state, line, normal, out)
    low, high = chi_square_band(m, FALSE_ALARM)
    assert low < np.sum(state**2) / sigma**2 < high
    correlation = np.mean(start * state) / sigma**2
    assert correlation == pytest.approx(math.exp(-n * dt / tau), abs=4.0 / math.sqrt(m))
    # Straight between two draws: the last sample lies half a sample before the last draw.
    u = (every - 0.5) / every
    np.testing.assert_allclose(out[-1], dt * (line[:, 0] + u * (line[:, 1] - line[:, 0])))


def test_noise_takes_any_chunking():
    part = GyroSpec(
        angle_random_walk=1e-5, bias_instability=1e-6, rate_random_walk=1e-7,
        gauss_markov=1e-6, gauss_markov_time=3.0,
    )  # fmt: skip
    made = []
    for sizes in ((1000,), (1, 63, 500, 436)):
        train = NoiseTrain(part, 0.01, 3, np.random.default_rng(4), 10.0)
        parts = [np.empty((n, 3)) for n in sizes]
        for chunk in parts:
            train.make(chunk)
        made.append(np.concatenate(parts))
    np.testing.assert_array_equal(*made)


def test_normal_numbers():
    """Moments to the fourth, the tail beyond the ziggurat's base, and no memory; 4 sigma each."""
    from scipy.stats import kstest, norm

    from schuler.kernels.normal import standard_normal

    n = 20_000 if os.environ.get("NUMBA_DISABLE_JIT") == "1" else 2_000_000
    x = np.empty(n)
    stream = np.array([7, 0x9E3779B97F4A7C15], np.uint64)
    with np.errstate(over="ignore"):
        standard_normal(stream, x)
    assert abs(x.mean()) < 4 / math.sqrt(n)
    assert abs(np.mean(x**2) - 1) < 4 * math.sqrt(2 / n)
    assert abs(np.mean(x**4) - 3) < 4 * math.sqrt(96 / n)
    assert abs(np.mean(x[1:] * x[:-1])) < 4 / math.sqrt(n)
    beyond = np.count_nonzero(np.abs(x) > 3.6541528853610088)
    expected = n * 2 * norm.sf(3.6541528853610088)
    assert abs(beyond - expected) < 4 * math.sqrt(expected) + 1
    assert kstest(x, "norm").pvalue > 1e-3
