"""Levels on a grid against the same written out with arrays."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels.levels import AXES, PAD, weigh_levels


def padded(values, size, fill):
    out = np.full(size, fill)
    out[: len(values)] = values
    return out


@pytest.mark.parametrize("freedom", [1.0, 2.0])
@pytest.mark.parametrize(("shapes", "modes"), [(1, 5), (2, 22), (3, 30), (4, 51)])
def test_weights_are_those_of_the_written_out_likelihood(shapes, modes, freedom):
    rng = np.random.default_rng(shapes)
    shape = np.abs(rng.normal(size=(shapes, modes))) * 10.0 ** rng.uniform(-3, 3, (shapes, modes))
    known = 10.0 ** rng.uniform(-4, 0, modes)
    share = rng.chisquare(1, modes)
    tried = [np.sort(10.0 ** rng.uniform(-3, 1, 3 + k)) for k in range(shapes)]

    grid = np.stack([a.ravel() for a in np.meshgrid(*tried, indexing="ij")])
    variance = shape.T @ grid + known[:, None]
    log = -0.5 * freedom * np.sum(share[:, None] / variance + np.log(variance), axis=0)
    weight = np.exp(log - log.max())

    size = -(-modes // PAD) * PAD
    axes, counts = np.zeros((AXES, 8)), np.ones(AXES, np.int64)
    every = np.zeros((AXES, size))
    for k, axis in enumerate(tried, AXES - shapes):
        axes[k, : len(axis)], counts[k] = axis, len(axis)
    every[AXES - shapes :, :modes] = shape
    out = np.zeros(2 + AXES)
    out[0] = freedom
    weigh_levels(
        padded(share, size, 0.0), every, padded(known, size, 1.0), axes, counts,
        np.empty_like(every), np.empty(int(counts.prod())), out,
    )  # fmt: skip
    assert out[0] == pytest.approx(log.max(), rel=1e-12)
    assert out[1] == pytest.approx(weight.sum(), rel=1e-11)
    np.testing.assert_allclose(out[2 + AXES - shapes :], grid @ weight / weight.sum(), rtol=1e-11)
