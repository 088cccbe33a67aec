"""The kernel behind a record's summary: sums over stretches, joined when the table is full."""

from __future__ import annotations

import numpy as np

from schuler.kernels import blocks
from tests.conftest import pieces


def feed(dtheta, dvel, dt, wanted=1.0, capacity=blocks.CAPACITY, cuts=()):
    """Return state and table."""
    state, table = np.zeros(blocks.STATE_SIZE), np.zeros((capacity, blocks.ROW))
    state[1] = wanted
    dts = np.full(len(dtheta), dt)
    time = np.cumsum(dts)
    for s in pieces(len(dtheta), cuts):
        blocks.summarise(state, table, time[s], dts[s], dtheta[s], dvel[s])
    return state, table


def test_a_stretch_is_the_sum_of_its_samples(rng):
    a, v = rng.normal(size=(100, 3)), rng.normal(size=(100, 3))
    state, table = feed(a, v, 0.1)
    assert state[0] == 10
    w, f = np.linalg.norm(a, axis=1) / 0.1, np.linalg.norm(v, axis=1) / 0.1
    for k in range(10):
        s = slice(10 * k, 10 * k + 10)
        expected = [
            k + 1.0, 1.0, 10.0, *a[s].sum(0), *v[s].sum(0), (w[s] ** 2).sum(), (f[s] ** 2).sum(),
            f[s].sum(), w[s].max(), f[s].max(), f[s].min(),
        ]  # fmt: skip
        np.testing.assert_allclose(table[k], expected, rtol=1e-12)
    np.testing.assert_array_equal(table[10], 0.0)


def test_second_differences(rng):
    a, v = rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    state, _ = feed(a, v, 0.1)
    assert state[5] == 38
    np.testing.assert_allclose(state[3], (np.diff(a / 0.1, 2, axis=0) ** 2).sum(), rtol=1e-12)
    np.testing.assert_allclose(state[4], (np.diff(v / 0.1, 2, axis=0) ** 2).sum(), rtol=1e-12)


def test_a_full_table_is_joined_pair_by_pair(rng):
    a, v = rng.normal(size=(107, 3)), rng.normal(size=(107, 3))
    state, table = feed(a, v, 0.1, capacity=4, cuts=(13, 50, 51))
    # 10.7 s in at most four stretches: of a second, then two, then four.
    assert state[1] == 4.0
    used = table[: int(state[0]) + 1]
    assert used[:, 2].sum() == 107
    np.testing.assert_allclose(used[:, 1], [4.0, 4.0, 2.7], rtol=1e-12)
    np.testing.assert_allclose(used[:, 3:6].sum(0), a.sum(0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(used[:, 6:9].sum(0), v.sum(0), rtol=0, atol=1e-12)
    largest = np.linalg.norm(a, axis=1).max() / 0.1
    np.testing.assert_allclose(used[:, 12].max(), largest, rtol=1e-14)
    np.testing.assert_allclose(used[:, 0], [4.0, 8.0, 10.7], rtol=1e-12)
