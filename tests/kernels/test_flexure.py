"""The second-order process of flexure against the exponential of its rates and its steady state."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from schuler.kernels.flexure import couple_flexure, drive_flexure


def test_flexure_moves_as_the_exponential_of_its_rates_and_keeps_its_steady_covariance():
    b, t, variance, size, first = 4.3, 0.07, 1e-6, 8, 1
    rates = np.zeros((size, size))
    for k in range(3):
        i, j = first + k, first + 3 + k
        rates[i, j], rates[j, i], rates[j, j] = 1.0, -b * b, -2.0 * b
    rng = np.random.default_rng(3)
    x, chain = rng.normal(size=size), rng.normal(size=(size, size))
    root = rng.normal(size=(size, size))
    p = root @ root.T
    parts = np.stack([p, 2.0 * p])
    decay = np.ones(size)
    decay[first : first + 6] = np.exp(-b * t)
    moved, turned, kept, each = x.copy(), p.copy(), chain.copy(), parts.copy()
    couple_flexure(moved, turned, each, kept, first, t, b)
    phi = expm(t * rates)
    np.testing.assert_allclose(decay * moved, phi @ x, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.outer(decay, decay) * turned, phi @ p @ phi.T, atol=1e-11)
    np.testing.assert_allclose(decay[:, None] * kept, phi @ chain, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(each, [turned, 2.0 * turned])

    # What drives it makes up for what fades.
    steady = np.zeros((size, size))
    steady[first : first + 3, first : first + 3] = variance * np.eye(3)
    steady[first + 3 : first + 6, first + 3 : first + 6] = b * b * variance * np.eye(3)
    after = phi @ steady @ phi.T
    drive_flexure(after, first, t, b, variance)
    np.testing.assert_allclose(after, steady, rtol=0.0, atol=1e-18)
