"""The sums behind Allan-type variances: against plain definitions, and in any chunking."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.allan_variance.ladder import CAP, Ladder, grid
from schuler.kernels import allan as kernels

from ..conftest import pieces


def phase_of(n: int, seed: int = 1) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=n))


@pytest.mark.parametrize("n", [5, 300, 2 * kernels.TILE + 7])
@pytest.mark.parametrize("order", [2, 3])
def test_sums_are_those_of_the_definition(n, order):
    """numpy.diff of the decimated phases, summed in extended precision."""
    x = phase_of(n)
    lags = np.array([m for m in (1, 2, 3, 17, 90, 1500) if order * m < n])
    sums = np.zeros(len(lags))
    (kernels.allan_sums if order == 2 else kernels.hadamard_sums)(x, 0, 0, lags, sums)
    for m, found in zip(lags, sums, strict=True):
        wide = x.astype(np.longdouble)
        want = sum(float(np.sum(np.diff(wide[k::m], order) ** 2)) for k in range(m))
        assert found == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize("order", [2, 3])
def test_a_whole_phase_gives_what_a_stream_gives(order):
    """Lags on both sides of where four differences go together, and with any remainder."""
    x = phase_of(6000)
    lags = np.array([1, 31, 32, 33, 100, 857, 999, 1000, 1100, 1500, 1999])
    stream, whole = np.zeros(len(lags)), np.zeros(len(lags))
    (kernels.allan_sums if order == 2 else kernels.hadamard_sums)(x, 0, 0, lags, stream)
    (kernels.allan_whole if order == 2 else kernels.hadamard_whole)(x, lags, whole)
    np.testing.assert_allclose(whole, stream, rtol=1e-12)


def test_points_before_the_first_valid_one_are_left_alone():
    x = phase_of(100)
    x[:10] = np.nan
    sums, want = np.zeros(2), np.zeros(2)
    lags = np.array([1, 20])
    kernels.allan_sums(x, 10, 30, lags, sums)
    for k, m in enumerate(lags):
        e = np.arange(max(30, 10 + 2 * m), 100)
        want[k] = np.sum((x[e] - 2 * x[e - m] + x[e - 2 * m]) ** 2)
    np.testing.assert_allclose(sums, want, rtol=1e-12)


@pytest.mark.parametrize("m", [1, 2, 30, 49, 50, 60, 97, 98])
def test_total_edges_are_those_of_the_reflected_phase(m):
    """The extended phase written out (NIST SP 1065, eq. 25), 100 points."""
    x = phase_of(100)
    n = len(x)
    left = 2 * x[0] - x[1 : n - 1][::-1]
    right = 2 * x[-1] - x[1 : n - 1][::-1]
    whole = np.concatenate([left, x, right])
    mid = len(left) + np.arange(1, n - 1)
    want = np.sum((whole[mid - m] - 2 * whole[mid] + whole[mid + m]) ** 2)
    sums = np.zeros(1)
    lags = np.array([m])
    kernels.allan_sums(x, 0, 0, lags, sums)
    kernels.total_edges(x, lags, sums)
    assert sums[0] == pytest.approx(want, rel=1e-12)


@given(
    cuts=st.lists(st.integers(0, 9000), max_size=8),
    order=st.sampled_from([2, 3]),
    given_lags=st.sampled_from([None, (1, 5, 700, 1025, 2047)]),
)
def test_any_chunking_gives_the_same_bits(cuts, order, given_lags):
    increments = np.random.default_rng(3).normal(size=(9000, 2)) + 5.0
    lags = None if given_lags is None else np.array(given_lags)
    whole, split = (Ladder(2, order, lags) for _ in range(2))
    whole.push(increments)
    for s in pieces(9000, cuts):
        split.push(increments[s])
    for a, b in zip(whole.finish(), split.finish(), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("order", [2, 3])
def test_a_ladder_takes_every_second_point_on_each_rung(order):
    """Long lags: differences that start at multiples of the stride; short ones: all of them."""
    n = 40_000
    increments = np.random.default_rng(4).normal(size=(n, 1))
    ladder = Ladder(1, order, None)
    ladder.push(increments)
    lags, strides, counts, sums = ladder.finish()
    x = np.concatenate([[0.0], np.cumsum(increments[:, 0] - increments[0, 0])])
    assert strides.max() >= 8
    for m, step, count, found in zip(lags, strides, counts, sums[:, 0], strict=True):
        y = x[::step]
        k = m // step
        assert k <= CAP
        assert step == 1 or k > CAP // 2
        if count < 1:
            assert order * k >= len(y)
            continue
        d = y[2 * k :] - 2 * y[k:-k] + y[: -2 * k] if order == 2 else (
            y[3 * k :] - 3 * y[2 * k : -k] + 3 * y[k : -2 * k] - y[: -3 * k])  # fmt: skip
        assert count == len(d)
        assert found == pytest.approx(np.sum(d**2), rel=1e-10)


def test_the_grid_is_four_an_octave_and_fits_the_ladder():
    lags = grid(10**7)
    assert lags[0] == 1
    assert lags[-1] <= 10**7
    ratio = lags[1:] / lags[:-1]
    assert np.all(np.diff(lags) > 0)
    np.testing.assert_allclose(ratio[lags[:-1] >= CAP], 2**0.25, rtol=2e-3)
    ladder = Ladder(1, 2, None)
    ladder.push(np.random.default_rng(0).normal(size=(20_000, 1)))
    found = ladder.finish()[0]
    np.testing.assert_array_equal(found[found <= 6000], grid(6000))


def test_looking_does_not_disturb_a_stream():
    increments = np.random.default_rng(5).normal(size=(7000, 1))
    looked, plain = Ladder(1, 2, None), Ladder(1, 2, None)
    for s in pieces(7000, [100, 2500, 4000]):
        looked.push(increments[s])
        looked.copy().finish()
        plain.push(increments[s])
    for a, b in zip(looked.finish(), plain.finish(), strict=True):
        np.testing.assert_array_equal(a, b)
