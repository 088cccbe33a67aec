"""Saved states: all that an aligner can give is taken, and what none can give is refused."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import Aligner, Inertial
from schuler.earth import Site
from schuler.errors import InputError
from schuler.kernels.layout import LayoutError, check_intake
from schuler.kernels.tracker_layout import check_aligner
from schuler.record import ImuRecord, Intake

SITE = Site(50.0)


def shaken(rng, n, rate, size, jitter=0.0, holes=0):
    """Return rough motion: white rates of a size, sampled unevenly, with holes."""
    dt = (1.0 + jitter * rng.uniform(-1, 1, n)) / rate
    dt[rng.integers(0, n, holes)] *= 50.0
    dtheta = size * rng.standard_normal((n, 3)) * dt[:, None]
    dvel = (np.array([0.0, 0.0, 9.8]) + 3.0 * size * rng.standard_normal((n, 3))) * dt[:, None]
    return ImuRecord(np.cumsum(dt) + 1000.0, dt, dtheta, dvel)


@pytest.mark.parametrize("subsamples", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("n", "rate", "size", "jitter", "holes"),
    [
        (0, 1.0, 0.0, 0.0, 0), (1, 50.0, 0.1, 0.0, 0), (3, 50.0, 0.1, 0.0, 0),
        (90, 1e3, 3.0, 0.3, 2),
        # Enough for nodes, and for stretches of a second, to be thinned out.
        pytest.param(9001, 200.0, 1e-4, 0.0, 0, marks=pytest.mark.compiled),
        pytest.param(9002, 200.0, 20.0, 0.4, 30, marks=pytest.mark.compiled),
        pytest.param(20_003, 1.0, 0.01, 0.2, 5, marks=pytest.mark.compiled),
        pytest.param(20_000, 0.5, 0.0, 0.0, 0, marks=pytest.mark.compiled),
    ],
)  # fmt: skip
def test_whatever_an_aligner_gives_is_taken(rng, subsamples, n, rate, size, jitter, holes):
    aligner = Aligner(SITE, Inertial(subsamples=subsamples))
    if n:
        aligner.update(shaken(rng, n, rate, size, jitter, holes))
    arrays = aligner.arrays()
    check_aligner(arrays)
    again = Aligner(SITE, Inertial(subsamples=subsamples))
    again.restore(arrays)
    for name, array in again.arrays().items():
        np.testing.assert_array_equal(array, arrays[name])


@pytest.fixture(scope="module")
def arrays():
    rng = np.random.default_rng(4)
    return Aligner(SITE, "centred").update(shaken(rng, 6000, 50.0, 0.1)).arrays()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300, -1e300, -1.0])
@pytest.mark.parametrize("name", ["tracker", "tracker_nodes", "summary", "summary_table"])
def test_an_array_of_one_value_is_refused(arrays, name, value):
    spoilt = {**arrays, name: np.full_like(arrays[name], value)}
    with pytest.raises(LayoutError):
        check_aligner(spoilt)
    with pytest.raises(InputError, match="damaged"):
        Aligner(SITE, "centred").restore(spoilt)


@pytest.mark.parametrize(
    ("name", "at", "text"),
    [("tracker", 48, "'waiting'"), ("tracker", 73, "another length"), ("tracker", 74, "spacing"),
     ("tracker", 75, "miscounts"), ("tracker", 41, "miscounts"), ("tracker", 1, "miscounts"),
     ("summary", 0, "fewer rows"), ("summary", 2, "miscounts"), ("tracker", 2, "'quat_ib0_b'"),
     ("tracker_setting", 0, "entry 'subsamples'")],
)  # fmt: skip
def test_a_counter_that_is_off_is_named(arrays, name, at, text):
    spoilt = {**arrays, name: arrays[name].copy()}
    spoilt[name][at] += 4.0
    with pytest.raises(LayoutError, match=text):
        check_aligner(spoilt)


def test_a_sum_of_the_wrong_sign_is_seen(arrays):
    """Sums near zero are left out: there the sign is all but nothing."""
    state = arrays["tracker"]
    sums = [k for k in (*range(6, 40), *range(76, 80)) if abs(state[k]) > 1.0]
    assert len(sums) > 20
    for k in sums:
        spoilt = {**arrays, "tracker": state.copy()}
        spoilt["tracker"][k] = -state[k]
        with pytest.raises(LayoutError):
            check_aligner(spoilt)


@pytest.mark.parametrize("change", [
    {"tracker": np.zeros(79)}, {"tracker": np.zeros((80, 1))}, {"tracker_nodes": np.zeros(44)},
    {"tracker": np.zeros(80, np.float32)}, {"tracker_tail": np.zeros((2, 5))},
    {"tracker_nodes": np.zeros((5000, 44))}, {"summary_table": np.zeros((0, 15))},
])  # fmt: skip
def test_another_shape_or_type_is_refused(arrays, change):
    with pytest.raises(LayoutError, match="shape"):
        check_aligner({**arrays, **change})


def test_a_missing_array_is_named(arrays):
    with pytest.raises(LayoutError, match="'summary' is missing"):
        check_aligner({k: v for k, v in arrays.items() if k != "summary"})


@pytest.mark.parametrize("kind", ["rates", "mean-rates", "increments"])
@pytest.mark.parametrize("rows", [0, 1, 100, 255, 256, 257, 3000])
def test_whatever_an_intake_gives_is_taken(rng, kind, rows):
    time = np.cumsum(rng.uniform(0.01, 0.012, rows))
    if rows > 300:
        time[280:] += 1.0
    values = rng.standard_normal((rows, 6))
    values[5:7] = np.nan
    intake = Intake(kind, max_gap=5.0)
    if rows:
        intake.push(time, values)
    arrays = {k: np.nan_to_num(v) for k, v in intake.arrays().items()}
    check_intake(arrays)
    Intake(kind, max_gap=5.0).restore(arrays)
    for value in (np.nan, 1e300, -1.0):
        with pytest.raises(LayoutError):
            check_intake({**arrays, "intake": np.full_like(arrays["intake"], value)})
