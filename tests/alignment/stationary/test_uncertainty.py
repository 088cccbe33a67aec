"""Covariances against Monte Carlo: each false alarm is stated."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import align, limit
from schuler.alignment.stationary.uncertainty import part_covariance
from schuler.record import ImuRecord
from schuler.sensors import GRADES, GyroSpec, ImuSpec
from schuler.sensors.noise import corrupt
from schuler.sensors.theory import flicker_correlation
from tests.alignment.conftest import SITE, WHITE, phi_of
from tests.conftest import LONG, chi_square_band

FULL = ImuSpec.from_dict(
    {
        "gyro": {
            "bias": "0.003 deg/h",
            "angle_random_walk": "0.001 deg/sqrt(h)",
            "bias_instability": "0.01 deg/h",
            "rate_random_walk": "0.03 deg/h/sqrt(h)",
            "quantisation": "0.3 arcsec",
        },
        "accelerometer": {
            "bias": "5 ug",
            "velocity_random_walk": "20 ug/sqrt(Hz)",
            "bias_instability": "20 ug",
            "acceleration_random_walk": "50 ug/sqrt(h)",
            "quantisation": "0.3 mm/s",
        },
    }
)


def runs(still, spec, method, at, count, seed):
    """Yield phi, covariance of the instrument part and total covariance over seeded runs."""
    rng = np.random.default_rng(seed)
    r = still.record
    for _ in range(count):
        gyro = corrupt(r.dtheta, r.dt, spec.gyro, rng).increments
        accel = corrupt(r.dvel, r.dt, spec.accelerometer, rng).increments
        fix = align(ImuRecord(r.time, r.dt, gyro, accel), SITE, method, spec, at=at)
        yield phi_of(fix, still.euler[-1]), fix.covariance - fix.budget["disturbance"], fix


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "at"),
    [("centred", "end"), pytest.param("centred", "start", marks=pytest.mark.long)],
)
def test_nees_of_static_runs(still, method, at):
    """White noise and biases: NEES inside the 99 % band, with and without the disturbance part."""
    count = 250 if LONG else 100
    low, high = chi_square_band(3 * count, 0.01)
    total = instrument = 0.0
    for phi, part, fix in runs(still, WHITE, method, at, count, 11):
        total += phi @ np.linalg.solve(fix.covariance, phi)
        instrument += phi @ np.linalg.solve(part, phi)
    assert low < instrument < high
    assert low < total < high


@pytest.mark.slow
@pytest.mark.parametrize("method", ["wahba", "integral-triad", "analytic"])
def test_nees_of_the_other_methods(still, method):
    """False-alarm rate 1e-3 each."""
    count = 150 if LONG else 60
    low, high = chi_square_band(3 * count, 1e-3)
    nees = sum(
        phi @ np.linalg.solve(part, phi)
        for phi, part, _ in runs(still, WHITE, method, "end", count, 4)
    )
    assert low < nees < high


@pytest.mark.slow
def test_nees_with_every_type_of_noise(still):
    """Bias, walks, flicker and rounding together; false-alarm rate 1e-3."""
    count = 150 if LONG else 60
    low, high = chi_square_band(3 * count, 1e-3)
    nees = sum(
        phi @ np.linalg.solve(part, phi)
        for phi, part, _ in runs(still, FULL, "centred", "end", count, 9)
    )
    assert low < nees < high


@pytest.mark.parametrize(
    "part",
    [
        GyroSpec(bias=1.0),
        GyroSpec(angle_random_walk=1.0),
        GyroSpec(bias_instability=1.0),
        GyroSpec(rate_random_walk=1.0),
        GyroSpec(quantisation=1.0),
    ],
    ids=lambda p: next(f for f in vars(p) if getattr(p, f)),
)
def test_each_noise_type_through_a_known_filter(part):
    """The variance of one weighted sum of noisy increments; false-alarm rate 1e-3."""
    count, n, m, dt = 1500, 512, 32, 0.05
    weight = np.sin(np.linspace(0.0, 4.0, n)) + 0.3
    body = weight.reshape(m, -1).mean(axis=1)[:, None, None]
    (predicted,) = part_covariance(part, body, np.full(m, n // m * dt), dt).values()
    rng = np.random.default_rng(8)
    # Rounding needs a signal that crosses its steps.
    signal = rng.uniform(5.0, 9.0, (n, count))
    noise = corrupt(signal, np.full(n, dt), part, rng).increments - signal
    found = np.sum((weight @ noise) ** 2)
    low, high = chi_square_band(count, 1e-3)
    # A stretch's mean weight stands for its samples: not exact to the last percent.
    assert 0.95 * low < found / float(predicted[0, 0]) < 1.05 * high


def test_flicker_correlation_is_the_same_on_even_and_uneven_grids():
    even = flicker_correlation(np.full(40, 0.5))
    nearly = np.full(40, 0.5)
    nearly[0] = 0.56
    assert np.linalg.eigvalsh(even).min() > 0
    assert flicker_correlation(nearly)[5:, 5:] == pytest.approx(even[5:, 5:], rel=0.02)


def test_limit_of_the_second_specification():
    """Navigation FOG, 300 s, latitude 40: 0.172', 0.172', 4.305'."""
    sigma = np.degrees(np.sqrt(np.diag(limit(WHITE, SITE, 300.0)))) * 60
    assert sigma == pytest.approx([0.172, 0.172, 4.305], abs=6e-4)


def test_limit_falls_with_time_to_the_bias():
    sigmas = [limit(WHITE, SITE, t)[2, 2] for t in (10.0, 100.0, 1000.0, 1e6)]
    assert sigmas == sorted(sigmas, reverse=True)
    bias_only = ImuSpec.from_dict(
        {"gyro": {"bias": "0.01 deg/h"}, "accelerometer": {"bias": "50 ug"}}
    )
    assert sigmas[-1] == pytest.approx(limit(bias_only, SITE, 1.0)[2, 2], rel=1e-2)


def test_limit_needs_a_time():
    from schuler.errors import InputError

    with pytest.raises(InputError, match="positive time"):
        limit(WHITE, SITE, 0.0)


@pytest.mark.parametrize("method", ["centred", "analytic"])
def test_no_method_beats_the_limit(still, method):
    fix = align(still.record, SITE, method, WHITE)
    instrument = fix.covariance - fix.budget["disturbance"]
    # Perfect increments are quieter than the specification: compare at the scaled noise.
    assert np.all(np.diag(instrument) > 0.99 * np.diag(fix.bound))


def test_grades_are_ordered():
    names = ("navigation-rlg", "navigation-fog", "tactical-fog", "industrial-mems")
    sigmas = [limit(GRADES[name], SITE, 300.0)[2, 2] for name in names]
    assert sigmas == sorted(sigmas)


@pytest.mark.parametrize(
    ("section", "key", "text"),
    [
        ("gyro", "scale_factor", "1000 ppm"),
        pytest.param("gyro", "misalignment", "200 arcsec", marks=pytest.mark.long),
        pytest.param("gyro", "non_orthogonality", "200 arcsec", marks=pytest.mark.long),
        ("gyro", "g_sensitivity", "0.02 deg/h/g"),
        pytest.param("gyro", "g2_sensitivity", "0.02 deg/h/g^2", marks=pytest.mark.long),
        pytest.param("accelerometer", "scale_factor", "1000 ppm", marks=pytest.mark.long),
        ("accelerometer", "misalignment", "200 arcsec"),
        pytest.param("accelerometer", "non_orthogonality", "200 arcsec", marks=pytest.mark.long),
        pytest.param("accelerometer", "g2_sensitivity", "500 ug/g^2", marks=pytest.mark.long),
    ],
)
def test_constant_errors_of_a_tilted_base(section, key, text):
    """What scale and axis errors do to phi: predicted and drawn variance; false alarm 1e-3."""
    from schuler.motion import Static
    from schuler.simulation import simulate

    spec = ImuSpec.from_dict({"gyro": {}, "accelerometer": {}, section: {key: text}})
    motion, count = Static(50.0, 20.0, -30.0), 150 if LONG else 100
    rng = np.random.default_rng(7)
    total = np.zeros(3)
    for _ in range(count):
        made = simulate(motion, SITE, 60.0, 5.0, spec, rng)
        fix = align(made.record, SITE, spec=spec, at="start")
        (predicted,) = (cov for name, cov in fix.budget.items() if name == f"{section}_{key}")
        phi = phi_of(fix, made.euler[0])
        scale = np.trace(predicted)
        total += phi**2 / np.maximum(np.diag(predicted), 1e-3 * scale)
    low, high = chi_square_band(count, 1e-3)
    strong = np.diag(predicted) > 0.01 * np.trace(predicted)
    assert np.all(total[strong] > low)
    assert np.all(total[strong] < high)
