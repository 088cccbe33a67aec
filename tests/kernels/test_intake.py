"""The kernels that check and integrate rows: what they write, count, fill, and where they stop."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels import gaps
from schuler.kernels import intake as k


def feed(kind, t, x, nominal=0.01, max_gap=0.065, state=None):
    """Return state, samples (time, dt, values), code and row."""
    t, x = np.asarray(t, float), np.asarray(x, float)
    state = np.zeros(k.STATE_SIZE) if state is None else state
    rows = np.empty((len(t), k.ROW))
    n, code, row = k.check(state, nominal, max_gap, t, x, rows)
    size = len(t) + int(np.minimum(rows[:n, 9], gaps.SHORT).sum())
    out_t, out_dt = np.empty(size), np.empty(size)
    turn, push = np.empty((size, 3)), np.empty((size, 3))
    m, end = k.integrate(
        state, np.zeros((gaps.HISTORY, 6)), kind, nominal, rows, 0, n, True,
        np.empty(gaps.WORK), out_t, out_dt, turn, push, np.empty((size + 1, 6)),
    )  # fmt: skip
    assert end == n
    return state, (out_t[:m], out_dt[:m], np.hstack([turn, push])[:m]), code, row


def ramp(n, slope=1.0):
    """Return n rows at 100 Hz whose six values grow linearly, each at its own pace."""
    t = 0.01 * np.arange(1, n + 1)
    return t, slope * t[:, None] * np.arange(1, 7)


@pytest.mark.parametrize("kind", [k.RATES, k.MEAN_RATES, k.INCREMENTS])
def test_rows_in_samples_out(kind):
    t, x = ramp(20)
    state, (time, dt, out), code, row = feed(kind, t, x)
    assert (code, row) == (k.OK, -1)
    assert state[0] == state[72] == 20
    # The first instantaneous rate only opens the first interval.
    np.testing.assert_array_equal(time, t[1:] if kind == k.RATES else t)
    np.testing.assert_allclose(dt, 0.01, rtol=1e-12)
    if kind == k.INCREMENTS:
        np.testing.assert_array_equal(out, x)
    if kind == k.MEAN_RATES:
        np.testing.assert_allclose(out, x * 0.01, rtol=1e-12)
    if kind == k.RATES:
        # Any formula that is worth its name integrates a straight line exactly.
        np.testing.assert_allclose(out, 0.005 * (x[1:] + x[:-1]), rtol=1e-12)


def test_three_points_integrate_a_parabola_exactly_and_the_trapezoid_does_not():
    t = 0.01 * np.arange(12)
    x = (t**2)[:, None] * np.arange(1, 7)
    _, (time, dt, out), _, _ = feed(k.RATES, t, x)
    exact = (time**3 - (time - dt) ** 3)[:, None] / 3.0 * np.arange(1, 7)
    np.testing.assert_allclose(out[1:], exact[1:], rtol=1e-10)
    assert abs(out[0, 0] - exact[0, 0]) > 1e-8  # the first interval has no third point


def test_uneven_grid_takes_the_trapezoid():
    t = np.array([0.0, 0.01, 0.021, 0.03])
    x = (t**2)[:, None] * np.ones(6)
    _, (_, dt, out), _, _ = feed(k.RATES, t, x)
    np.testing.assert_allclose(out[1:, 0], 0.5 * dt[1:] * (x[2:, 0] + x[1:-1, 0]), rtol=1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_row_that_is_not_finite_is_dropped_and_filled(bad):
    t, x = ramp(30)
    spoilt = x.copy()
    spoilt[13, 4] = bad
    spoilt[17, 0] = bad
    state, (time, dt, out), code, _ = feed(k.MEAN_RATES, t, spoilt)
    assert code == k.OK
    assert state[17] == 2
    assert (state[26], state[27], state[28]) == (14, 4, t[13])
    assert (state[72], state[101]) == (28, 2)
    # On a straight line nothing is lost.
    np.testing.assert_allclose(time, t, rtol=1e-12)
    np.testing.assert_allclose(dt, 0.01, rtol=1e-12)
    np.testing.assert_allclose(out, x * 0.01, rtol=1e-9)


@pytest.mark.parametrize("kind", [k.RATES, k.MEAN_RATES, k.INCREMENTS])
@pytest.mark.parametrize("lost", [1, 3, 8])
def test_a_short_gap_in_a_sway_is_interpolated(kind, lost):
    t = 0.01 * np.arange(1, 301)
    x = np.sin(2 * np.pi * t)[:, None] * np.arange(1, 7)
    keep = np.ones(300, bool)
    keep[150 : 150 + lost] = False
    state, (time, dt, out), code, _ = feed(kind, t[keep], x[keep], max_gap=1.0)
    _, (_, _, whole), _, _ = feed(kind, t, x)
    assert code == k.OK
    assert (state[19], state[101]) == (1, lost)
    assert state[20] == pytest.approx(0.01 * (lost + 1))
    np.testing.assert_allclose(time, t[1:] if kind == k.RATES else t, rtol=1e-9)
    np.testing.assert_allclose(dt, 0.01, rtol=1e-6)
    # A held value would be off by 2 pi 0.01 for each lost row.
    np.testing.assert_allclose(out, whole, atol=2e-5 * np.abs(whole).max())


def test_where_there_is_noise_alone_it_is_not_multiplied():
    rng = np.random.default_rng(3)
    t = 0.01 * np.arange(1, 301)
    off = []
    for _ in range(100):
        x = rng.normal(size=(300, 6))
        keep = np.ones(300, bool)
        keep[150:158] = False
        _, (_, _, out), _, _ = feed(k.INCREMENTS, t[keep], x[keep], max_gap=1.0)
        off.append(out[150:158].sum(axis=0))
    # Eight times the mean of sixteen rows; the quintic's sum would have forty times the noise.
    assert np.std(off) == pytest.approx(8.0 / 4.0, rel=0.12)


@pytest.mark.parametrize("kind", [k.RATES, k.MEAN_RATES, k.INCREMENTS])
def test_a_long_gap_gets_the_mean_of_as_many_rows_on_each_side(kind):
    rng = np.random.default_rng(4)
    t = 0.01 * np.arange(1, 401)
    x = rng.normal(size=(400, 6))
    keep = np.ones(400, bool)
    keep[200:220] = False
    state, (_, dt, out), code, _ = feed(kind, t[keep], x[keep], max_gap=1.0)
    assert code == k.OK
    assert (state[19], state[101]) == (1, 20)
    at = int(np.argmax(dt))
    assert dt[at] == pytest.approx(0.21)
    mean = 0.5 * (x[180:200].mean(axis=0) + x[220:240].mean(axis=0))
    scale = 0.01 if kind == k.MEAN_RATES else 1.0
    want = 0.21 * mean if kind == k.RATES else scale * (20 * mean + x[220])
    np.testing.assert_allclose(out[at], want, rtol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "code", "row"),
    [
        (lambda t, x: t.__setitem__(5, t[3]), k.BACKWARD, 5),
        (lambda t, x: t.__setitem__(5, t[4]), k.REPEATED, 5),
        (lambda t, x: t.__setitem__(slice(5, None), t[5:] + 1.0), k.GAP, 5),
        (lambda t, x: t.__setitem__(2, np.nan), k.BAD_TIME, 2),
        (lambda t, x: t.__setitem__(0, np.inf), k.BAD_TIME, 0),
    ],
)
def test_where_it_stops(spoil, code, row):
    t, x = ramp(10)
    spoil(t, x)
    _, (time, _, _), got, at = feed(k.INCREMENTS, t, x)
    assert (got, at) == (code, row)
    # What came before the bad row is out already.
    np.testing.assert_array_equal(time, t[:row])


def test_an_exact_repetition_is_dropped():
    t, x = ramp(10)
    t, x = np.insert(t, 4, t[3]), np.insert(x, 4, x[3], axis=0)
    state, (time, _, out), code, _ = feed(k.INCREMENTS, t, x)
    assert code == k.OK
    assert state[18] == 1
    assert state[72] == 10
    np.testing.assert_array_equal(time, np.delete(t, 4))
    np.testing.assert_array_equal(out, np.delete(x, 4, axis=0))


def test_sums_and_extremes():
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(1, 101)
    x = rng.normal(size=(100, 6))
    state, _, _, _ = feed(k.MEAN_RATES, t, x)
    np.testing.assert_allclose(state[60:66], x.sum(0), rtol=1e-12)
    np.testing.assert_allclose(state[66:72], (x**2).sum(0), rtol=1e-12)
    np.testing.assert_array_equal(state[30:36], np.abs(x).max(0))
    np.testing.assert_allclose(state[76], np.linalg.norm(x[:, :3], axis=1).sum(), rtol=1e-12)
    np.testing.assert_allclose(state[77], np.linalg.norm(x[:, 3:], axis=1).sum(), rtol=1e-12)
    np.testing.assert_allclose(state[21], 0.99, rtol=1e-12)
    assert state[23] == 99
    assert state[75] == t[0]
    assert np.all(state[54:60] == 1)


def test_runs_at_the_extreme_are_counted():
    x = np.sin(np.arange(200.0) / 7.0)[:, None] * np.ones(6)
    x[:, 2] = np.clip(x[:, 2], -0.5, 0.5)
    state, _, _, _ = feed(k.MEAN_RATES, 0.01 * np.arange(1, 201), x)
    assert state[30 + 2] == 0.5
    clipped = np.abs(x[:, 2]) == 0.5
    assert state[48 + 2] == clipped.sum()
    edges = np.flatnonzero(np.diff(np.r_[0, (x[:, 2] == 0.5) * 1 - (x[:, 2] == -0.5) * 1, 0]))
    assert state[42 + 2] == np.diff(edges).max()
    assert state[48] == 0


@pytest.mark.parametrize("value", [1.01 * k.LARGEST, -1e200, 1.7e308])
def test_a_value_beyond_any_instrument_stops_it(value):
    t, x = ramp(20)
    x[7, 4] = value
    state, (time, _, _), code, row = feed(k.INCREMENTS, t, x)
    assert (code, row) == (k.TOO_LARGE, 7)
    assert len(time) == 7
    assert np.isfinite(state).all()
