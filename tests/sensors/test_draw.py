"""Constant errors: drawn as specified, and acting as their formulas say."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import AccelerometerSpec, GyroSpec, Imperfections, ImuSpec, draw
from schuler.sensors.noise import Instrument, drop_out
from tests.conftest import chi_square_band

STEP = 0.01
RATE = np.array([0.3, -0.2, 0.1])
FORCE = np.array([1.0, -2.0, 9.0])


def said(
    gyro=None, accelerometer=None, spec=None, n=50, rng=None, warm=0.0, rate=RATE, force=FORCE
):
    """Return mean rate and force that an instrument reports for constant true ones."""
    w, f = np.tile(rate * STEP, (n, 1)), np.tile(force * STEP, (n, 1))
    instrument = Instrument(
        spec, gyro or Imperfections(), accelerometer or Imperfections(), STEP, rng, warm
    )
    instrument.corrupt(w, f)
    return w / STEP, f / STEP


def test_a_perfect_instrument_tells_the_truth():
    w, f = said()
    np.testing.assert_allclose(w, np.tile(RATE, (50, 1)), rtol=1e-14)
    np.testing.assert_allclose(f, np.tile(FORCE, (50, 1)), rtol=1e-14)


@pytest.mark.parametrize(
    ("field", "value", "gyro", "accelerometer"),
    [
        ("bias", [1e-3, 2e-3, 3e-3], [1e-3, 2e-3, 3e-3], [1e-3, 2e-3, 3e-3]),
        ("matrix", np.diag([1e-3, 0, 0]), [3e-4, 0, 0], [1e-3, 0, 0]),
        ("matrix", [[0, 1e-3, 0], [0, 0, 0], [0, 0, 0]], [-2e-4, 0, 0], [-2e-3, 0, 0]),
        ("asymmetry", [1e-3, 1e-3, 1e-3], [3e-4, 2e-4, 1e-4], [1e-3, 2e-3, 9e-3]),
        ("g2_sensitivity", [1e-3, 1e-3, 0], [1e-3, 4e-3, 0], [1e-3, 4e-3, 0]),
    ],
)
def test_each_constant_error(field, value, gyro, accelerometer):
    """Measured minus true, for gyros and accelerometers."""
    wrong = Imperfections(**{field: np.array(value)})
    w, f = said(wrong, wrong)
    np.testing.assert_allclose(w[7] - RATE, gyro, atol=1e-12)
    np.testing.assert_allclose(f[7] - FORCE, accelerometer, atol=1e-12)


def test_gyros_feel_force():
    g = np.array([[1e-4, 0, 0], [0, 0, 2e-4], [0, 0, 0]])
    w, f = said(Imperfections(g_sensitivity=g))
    np.testing.assert_allclose(w[3] - RATE, g @ FORCE, atol=1e-14)
    np.testing.assert_allclose(f[3], FORCE, rtol=1e-14)


def test_bias_follows_temperature():
    w, _ = said(Imperfections(temperature=[1e-5, 0, 0]), warm=0.5, n=200)
    t = STEP * (np.arange(200) + 0.5)
    np.testing.assert_allclose(w[:, 0] - RATE[0], 1e-5 * 0.5 * t, atol=1e-14)


def test_saturation_and_rounding():
    spec = ImuSpec(GyroSpec(full_scale=0.25), AccelerometerSpec(quantisation=1e-3 / np.sqrt(12.0)))
    w, f = said(spec=spec, rng=np.random.default_rng(1), n=1000)
    np.testing.assert_allclose(w[5], [0.25, -0.2, 0.1], rtol=1e-12)
    counts = f * STEP / 1e-3
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-7)
    np.testing.assert_allclose(f.mean(axis=0), FORCE, atol=2e-4)


def test_draws_have_the_variance_of_the_specification():
    """4000 draws, every kind; false-alarm rate 1e-4 each."""
    part = GyroSpec(
        bias=1.0, scale_factor=2.0, misalignment=3.0, non_orthogonality=4.0,
        scale_factor_asymmetry=5.0, g_sensitivity=6.0, g2_sensitivity=7.0,
        temperature_sensitivity=8.0,
    )  # fmt: skip
    rng = np.random.default_rng(3)
    drawn = [draw(part, rng) for _ in range(4000)]
    matrix = np.array([d.matrix for d in drawn])
    for values, sigma in (
        ([d.bias for d in drawn], 1.0),
        (matrix[:, [0, 1, 2], [0, 1, 2]], 2.0),
        # Below the diagonal only the turn of the triad, above it the lean of the axes too.
        (matrix[:, [1, 2, 2], [0, 0, 1]], 3.0),
        (matrix[:, [0, 0, 1], [1, 2, 2]], 5.0),
        ([d.asymmetry for d in drawn], 5.0),
        ([d.g_sensitivity for d in drawn], 6.0),
        ([d.g2_sensitivity for d in drawn], 7.0),
        ([d.temperature for d in drawn], 8.0),
    ):
        x = np.asarray(values).ravel()
        low, high = chi_square_band(x.size, 1e-4)
        assert low < np.sum(x**2) / sigma**2 < high
    # A rigid turn is antisymmetric.
    rigid = draw(GyroSpec(misalignment=1.0), np.random.default_rng(1)).matrix
    np.testing.assert_allclose(rigid, -rigid.T)


def test_one_more_error_type_leaves_the_others_draws():
    a = draw(GyroSpec(bias=1.0), np.random.default_rng(5))
    b = draw(GyroSpec(bias=1.0, scale_factor=1e-3, g_sensitivity=1.0), np.random.default_rng(5))
    np.testing.assert_array_equal(a.bias, b.bias)


def test_dropouts_are_bridged():
    n = 2000
    time = STEP * np.arange(1, n + 1)
    record = ImuRecord(time, np.full(n, STEP), np.ones((n, 3)), np.ones((n, 3)))
    out = drop_out(record, 0.1, np.random.default_rng(2))
    assert 1600 < len(out) < 1900
    assert out.duration == pytest.approx(record.duration)
    np.testing.assert_allclose(out.dtheta.sum(axis=0), record.dtheta.sum(axis=0))
    np.testing.assert_allclose(out.dtheta / out.dt[:, None], 1 / STEP)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Imperfections(bias=np.zeros(2)), "bias of shape"),
        (lambda: GyroSpec(bias=-1.0), "bias: expected a finite"),
        (lambda: GyroSpec(gauss_markov=1.0), "needs its correlation time"),
        (
            lambda: ImuSpec.from_dict({"gyro": {}, "accelerometer": {}, "dropout": "60 %"}),
            "dropout",
        ),
        (
            lambda: ImuSpec.from_dict({"gyro": {"gauss_markov": "1 deg/h"}, "accelerometer": {}}),
            "gauss_markov_time",
        ),
    ],
)
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call()
