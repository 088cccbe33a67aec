"""The closed error formulas against the estimators themselves, and against the printed table."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import (
    align,
    analytic_error,
    bias_formula,
    inertial_error,
    inertial_frame_error,
)
from schuler.alignment.stationary.uncertainty import inertial_responses
from schuler.attitude import euler_to_quat
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import Static
from schuler.simulation import simulate
from tests.alignment.conftest import INERTIAL, SITE, phi_of

EPS = np.array([0.01, -0.02, 0.03]) * DEG_PER_HOUR
NABLA = np.array([50.0, -80.0, 60.0]) * 9.8e-6
STILL = Static(30.0, 2.0, -3.0)


@pytest.fixture(scope="module")
def biased():
    return simulate(STILL, SITE, 300.0, 20.0, gyro_bias=EPS, accel_bias=NABLA)


@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("method", ["centred", "integral-triad"])
def test_inertial_formulas(biased, method, at):
    fix = align(biased.record, SITE, method, at=at)
    phi = phi_of(fix, biased.euler[0])
    theory = inertial_error(SITE, euler_to_quat(biased.euler[0]), EPS, NABLA, 300.0, at)
    # 1 %, and 0.002' for products of two errors.
    assert phi == pytest.approx(theory, rel=0.01, abs=0.002 * ARCMIN)


@pytest.mark.parametrize("base", ["gravity", "earth-rate"])
def test_analytic_formulas(biased, base):
    method = "analytic" if base == "gravity" else "analytic-earth-rate"
    phi = phi_of(align(biased.record, SITE, method), biased.euler[0])
    theory = analytic_error(SITE, euler_to_quat(biased.euler[0]), EPS, NABLA, base)
    assert phi == pytest.approx(theory, rel=0.01, abs=0.002 * ARCMIN)


@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("method", INERTIAL)
def test_bias_jacobians_of_every_estimator(biased, method, at):
    fix = align(biased.record, SITE, method, at=at)
    from schuler.alignment.stationary.inertial import solve

    r = solve(fix.history, SITE.gravity, SITE.latitude, method)
    responses = inertial_responses(fix.history, r, SITE.gravity, SITE.latitude, method, at == "end")
    predicted = responses.bias_jacobian("gyro") @ EPS + responses.bias_jacobian("accel") @ NABLA
    phi = phi_of(fix, biased.euler[0])
    assert phi == pytest.approx(predicted, rel=0.005, abs=0.002 * ARCMIN)


def test_middle_is_between_the_ends():
    q = euler_to_quat([0.1, 0.2, 0.3])
    start, middle, end = (
        inertial_error(SITE, q, EPS, NABLA, 100.0, at) for at in ("start", "middle", "end")
    )
    assert middle == pytest.approx(bias_formula(SITE, q, EPS, NABLA))
    assert 0.5 * (start + end) == pytest.approx(middle)
    assert not np.allclose(start, end)


TABLE = [
    ((100, -100, 100), (0.01, 0.01, -0.01), (-2.80, 0.49, -2.48)),
    ((50, 50, 50), (0.02, -0.02, 0.02), (1.12, 0.07, 1.29)),
    ((-50, 50, -50), (0.01, 0.01, 0.01), (-3.38, -0.24, -2.81)),
    ((100, 100, -100), (-0.02, 0.02, 0.02), (-2.29, 0.11, -1.39)),
]


def table(lat, euler_deg):
    site = Site(lat)
    q = euler_to_quat(np.array(euler_deg) * DEG)
    return np.array(
        [
            inertial_frame_error(
                site, q, np.array(eps) * DEG_PER_HOUR, np.array(nabla) * 1e-6 * site.gravity
            )
            / ARCMIN
            for nabla, eps, _ in TABLE
        ]
    )


def test_recovered_conditions_give_the_printed_theory():
    """All twelve numbers within 0.006' (two of them are printed to two decimals)."""
    printed = np.array([row[2] for row in TABLE])
    assert np.abs(table(40.28, (-59.99, -4.92, 6.18)) - printed).max() < 0.006


def test_printed_conditions_do_not():
    printed = np.array([row[2] for row in TABLE])
    assert np.abs(table(34.24, (-10.0, -0.5, 0.5)) - printed).max() > 1.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bias_formula(Site(90.0), [1, 0, 0, 0], EPS, NABLA), "too near a pole"),
        (lambda: bias_formula(SITE, [1, 0, 0, 0], EPS[:2], NABLA), "two vectors of 3"),
        (lambda: analytic_error(SITE, [1, 0, 0, 0], EPS, NABLA, "sun"), "base must be"),
        (lambda: inertial_error(SITE, [1, 0, 0, 0], EPS, NABLA, 1.0, "noon"), "at must be"),
    ],
)
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call()
