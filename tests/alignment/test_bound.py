"""The limit against the printed table, by formulas of another kind, and its files."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import Position, load_positions, position_limit
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec
from schuler.sensors.noise import corrupt
from schuler.sensors.theory import mean_covariance

SITE = Site(40.0)
FOG = ImuSpec.from_dict(
    {
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.003 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
    }
)
PATENT = ImuSpec.from_dict(
    {
        "gyro": {"bias": "0.1 deg/h", "angle_random_walk": "0.01 deg/sqrt(h)"},
        "accelerometer": {"bias": "100 ug", "velocity_random_walk": "100 ug/sqrt(Hz)"},
    }
)
ONE = Position(30.0)

#: positions after the first, printed sigma (arcmin) of the two instruments
TABLE = [
    ([], (0.172, 0.172, 4.305), (0.344, 0.344, 31.58)),
    ([(210, 0, 0)], (0.003, 0.003, 2.192), (0.014, 0.014, 7.31)),
    ([(120, 0, 0)], (0.004, 0.004, 2.668), (0.020, 0.020, 10.06)),
    ([(60, 0, 0)], (0.011, 0.011, 3.492), (0.054, 0.054, 21.12)),
    ([(70, 25, -20)], (0.007, 0.009, 3.43), (0.035, 0.047, 19.49)),
    ([(210, 0, 0), (30, 90, 0)], (0.002, 0.002, 1.868), (0.012, 0.012, 6.31)),
]


@pytest.mark.parametrize(("more", "fog", "patent"), TABLE)
def test_the_printed_table(more, fog, patent):
    positions = [ONE, *(Position(*angles) for angles in more)]
    for spec, printed in ((FOG, fog), (PATENT, patent)):
        sigma = position_limit(spec, SITE, positions).sigma_arcmin
        # Half of the last digit, and what the choice of g changes (0.05 %).
        for value, text in zip(sigma, printed, strict=True):
            digits = 3 if text < 4 or spec is FOG else 2
            assert value == pytest.approx(text, abs=0.5 * 10.0**-digits + 5e-4 * text + 1e-9)


def test_against_a_direct_sum():
    """Two positions without correlated noise: the textbook sum, inverted by NumPy."""
    positions = [Position(10.0, 5.0, -3.0, 120.0), Position(100.0, -20.0, 40.0, 60.0)]
    info = np.zeros((9, 9))
    up = np.array([0.0, 0.0, SITE.gravity])
    for p in positions:
        for signal, column, part in ((SITE.earth_rate, 3, FOG.gyro), (up, 6, FOG.accelerometer)):
            h = np.zeros((3, 9))
            # d/dphi of C^T (phi x s) by differences.
            for k in range(3):
                h[:, k] = p.matrix.T @ np.cross(np.eye(3)[k], signal)
            h[:, column : column + 3] = np.eye(3)
            info += h.T @ h * p.dwell / part.white**2
    for column, part in ((3, FOG.gyro), (6, FOG.accelerometer)):
        info[range(column, column + 3), range(column, column + 3)] += 1 / part.bias**2
    found = position_limit(FOG, SITE, positions).covariance
    assert np.diag(found) == pytest.approx(np.diag(np.linalg.inv(info)), rel=1e-5)


@pytest.mark.parametrize(
    "part",
    [
        GyroSpec(angle_random_walk=1.0),
        GyroSpec(bias_instability=1.0),
        GyroSpec(rate_random_walk=1.0),
        GyroSpec(quantisation=1.0),
    ],
    ids=lambda p: next(f for f in vars(p) if getattr(p, f)),
)
def test_covariance_of_means_against_draws(part):
    """Four stretches with a pause between; each variance within its 1e-3 chi-square band."""
    from tests.conftest import chi_square_band

    n, count, dt = 400, 4000, 0.1
    edges = [(0, 100), (100, 150), (250, 300), (300, 400)]
    rng = np.random.default_rng(6)
    signal = rng.uniform(5.0, 9.0, (n, count))
    noise = corrupt(signal, np.full(n, dt), part, rng).increments - signal
    means = np.stack([noise[a:b].sum(axis=0) / ((b - a) * dt) for a, b in edges])
    start = np.array([a * dt for a, _ in edges])
    length = np.array([(b - a) * dt for a, b in edges])
    theory = mean_covariance(part, start, length, dt)
    # Contrasts, so that the common level of flicker need not be the same to its last decade.
    contrast = np.array([[1, -1, 0, 0], [0, 1, -1, 0], [1, 0, 0, -1], [0.5, 0.5, -0.5, -0.5]])
    found = np.sum((contrast @ means) ** 2, axis=1)
    predicted = np.diag(contrast @ theory @ contrast.T)
    low, high = chi_square_band(count, 1e-3)
    assert np.all(found / predicted > 0.97 * low)
    assert np.all(found / predicted < 1.03 * high)


def test_perfect_sensors_have_a_floor_not_a_crash():
    perfect = ImuSpec(GyroSpec(), AccelerometerSpec())
    assert position_limit(perfect, SITE, [ONE]).sigma_arcmin.max() < 1e-3


def test_a_second_position_never_hurts():
    alone = position_limit(FOG, SITE, [ONE])
    both = position_limit(FOG, SITE, [ONE, Position(75.0, 10.0, 0.0)])
    gain = alone.covariance - both.covariance
    scale = np.sqrt(np.diag(alone.covariance))
    assert np.linalg.eigvalsh(gain / np.outer(scale, scale)).min() > -1e-9


def test_positions_file(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(
        '[[position]]\nheading_ccw_deg = 30\ndwell = "5 min"\n[[position]]\npitch_deg = 90.0\n'
    )
    assert load_positions(path) == [Position(30.0, dwell=300.0), Position(pitch_deg=90.0)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected one or more"),
        ("position = 3", "expected one or more"),
        ("[[position]]\nyaw = 3", "position 1: unknown key 'yaw'"),
        ('[[position]]\npitch_deg = "up"', "expected a number of degrees"),
        ("[[position]]\ndwell = 300", "expected a text like"),
        (
            '[[position]]\ndwell = "-3 s"',
            "position 1: a position's dwell must be positive|positive time",
        ),
        ("[[position]", "not valid TOML"),
        ("[[position]]\nroll_deg = nan", "expected a number of degrees"),
    ],
)
def test_bad_positions_files(tmp_path, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        load_positions(path)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: position_limit(FOG, SITE, []), "one position at least"),
        (lambda: position_limit(FOG, SITE, [ONE], 0.0), "positive time"),
        (lambda: position_limit(FOG, Site(90.0), [ONE]), "at a pole"),
        (lambda: load_positions("no-such-file.toml"), "cannot be read"),
    ],
)
def test_refusals(call, words):
    with pytest.raises(InputError, match=words):
        call()
