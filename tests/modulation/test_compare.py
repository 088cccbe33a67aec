"""Errors of hours: the linear propagation against full navigation, schemes, the source's case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.earth import Site, radii
from schuler.errors import InputError
from schuler.modulation import (
    RotationCase,
    TriadErrors,
    compare_rotation,
    end_errors,
    error_series,
    optimise_scheme,
    scheme_residual,
    strapdown_end,
    turned,
)
from schuler.motion import Limits, Static, named_scheme
from schuler.navigation import Navigator, Start, components, evaluate, schuler_rate
from schuler.simulation import simulate
from tests.conftest import ROOT

CASE = ROOT / "examples" / "rotation" / "four_gyro.toml"


@pytest.fixture(scope="module")
def case():
    return RotationCase.from_toml(CASE)


def at(case, lat, psi, scheme, errors=None):
    """Return the 8 h error in m for psi counter-clockwise, deg."""
    e = end_errors(turned(scheme, case.duration), errors or case.errors, [lat], [-psi])
    return float(np.hypot(*e[0, 0]))


def test_source_s_case(case):
    """Within a percentage point: 31.9 % at psi = 90, 25 % at psi = 0; 30.2 % at L = 30, psi 45."""
    fixed = named_scheme("fixed")
    for lat, psi, percent in ((45.78, 90.0, 31.9), (45.78, 0.0, 25.0), (30.0, 45.0, 30.2)):
        cut = 100.0 * (1.0 - at(case, lat, psi, case.single) / at(case, lat, psi, fixed))
        assert cut == pytest.approx(percent, abs=1.0)
    for psi in (225.0, 240.0, 255.0, 270.0):
        cut = 100.0 * (1.0 - at(case, 30.0, psi, case.single) / at(case, 30.0, psi, fixed))
        assert -83.0 < cut < -45.0


def test_one_way_rotation_couples_the_scale_factor(case):
    """6 ppm of 2 deg/s is 0.043 deg/h of vertical drift: 24 to 28 km at 30 to 45.78 deg."""
    spin = named_scheme("continuous", limits=Limits(2.0))
    found = [at(case, lat, 0.0, spin) for lat in (30.0, 45.78)]
    assert 27e3 < found[0] < 28e3
    assert 23.5e3 < found[1] < 24.5e3


def test_fused_bias_is_the_source_s(case):
    np.testing.assert_allclose(
        np.asarray(case.errors.gyro_bias) / DEG_PER_HOUR, [-0.00022, 0.00108, 0.00325], atol=5e-6
    )


def test_two_axes_are_ten_times_better_over_all_headings(case):
    """At every heading up to 60 deg; beyond, the lucky fixed errors come near to what an equal
    scale factor of all axes makes of the Earth's rate, which no rotation takes out."""
    data = compare_rotation(replace(case, latitudes=np.array([0.0, 30.0, 45.78, 60.0]))).to_dict()
    assert min(r["two_axis_least_ratio"] for r in data["latitudes"]) > 10.0
    errors = TriadErrors(gyro_matrix=6e-6 * np.eye(3))
    fixed, two = (at(case, 70.0, 0.0, s, errors) for s in (named_scheme("fixed"), case.double))
    assert two == pytest.approx(fixed, rel=0.2)


@pytest.mark.parametrize("name", ["fixed", "single", "double"])
def test_linear_propagation_is_what_navigation_does(case, name):
    """Eight hours in full at 10 Hz: within 1 m, of kilometres."""
    scheme = named_scheme("fixed") if name == "fixed" else getattr(case, name)
    moved = replace(case, heading=200.0)
    full = strapdown_end(moved, scheme)[0]
    line = end_errors(turned(scheme, case.duration), case.errors, [45.78], [200.0])[0, 0]
    np.testing.assert_allclose(line, full, atol=1.0)


def test_series_ends_where_the_end_errors_are(case):
    motion = turned(case.double, 7200.0)
    general = TriadErrors([1e-8, -2e-8, 3e-8], [1e-4, 2e-4, -3e-4],
                          1e-5 * np.arange(9.0).reshape(3, 3), 1e-5 * np.eye(3))  # fmt: skip
    series = error_series(motion, general, 20.0, 77.0)
    np.testing.assert_allclose(
        series[-1, 5:7], end_errors(motion, general, [20.0], [77.0])[0, 0], rtol=1e-9
    )


def test_noise_adds_what_theory_says(case):
    """Random walk alone: the spread of 200 runs of 2 h against the weights', chi-square 1e-3."""
    from schuler.modulation.propagation import _weights
    from tests.conftest import chi_square_band

    walk = 1e-6
    quiet = replace(case, gyro_bias=np.zeros(4), gyro_scale=np.zeros(4),
                    accel_bias=np.zeros(3), duration=7200.0)  # fmt: skip
    runs = 200
    ends = strapdown_end(quiet, case.single, 5.0, runs, (walk, 0.0), np.random.default_rng(4))
    w = _weights(case.site.latitude, 0.0, 720, 10.0)[:, :, :3]
    sigma = walk * np.sqrt(10.0 * np.sum(w**2, axis=(0, 2)))
    low, high = chi_square_band(runs, 1e-3)
    for k in range(2):
        assert low < np.sum((ends[:, k] / sigma[k]) ** 2) < high


@pytest.fixture(scope="module")
def day():
    """Return the evaluation of 24 h at rest with 0.01 deg/h to the east, at 45 deg."""
    site = Site(45.0, 20.0)
    made = simulate(
        Static(), site, 86400.0, 5.0, gyro_bias=np.array([0.01 * DEG_PER_HOUR, 0.0, 0.0])
    )
    p = Navigator(Start(site, made.truth.quat_nb[0]), vertical="off", every=300)
    t, k = made.truth, slice(None, None, 300)
    reference = t.rows(k)
    return evaluate(p.update(made.record).path(), reference)


def test_a_day_shows_schuler_and_earth(day):
    """Both tones within 0.5 % of eps R w_s^2/(w_s^2 - W^2) (sin(Wt)/W - sin(w_s t)/w_s)."""
    found = components(day.time, day.position[:, 1], 45.0 * DEG)
    ws, w, eps = schuler_rate(45.0 * DEG), EARTH_RATE, 0.01 * DEG_PER_HOUR
    r = float(radii(45.0 * DEG)[0])
    unit = eps * r * ws**2 / (ws**2 - w**2)
    assert 2 * np.pi / ws / 60.0 == pytest.approx(84.4, abs=0.1)
    assert found.daily == pytest.approx(unit / w, rel=5e-3)
    assert found.schuler == pytest.approx(unit / ws, rel=5e-3)
    assert found.residual < 2.0


def test_a_day_follows_the_linear_theory(day):
    theory = error_series(
        turned(named_scheme("fixed"), 86400.0, 60.0),
        TriadErrors([0.01 * DEG_PER_HOUR, 0.0, 0.0]), 45.0, 0.0,
    )  # fmt: skip
    worst = np.abs(day.position[:, :2] - theory[:, 5:7]).max()
    assert worst < 2e-3 * np.abs(theory[:, 5:7]).max()
    assert worst < 10.0


@pytest.mark.parametrize("name", ["two-axis-8", "two-axis-16", "two-axis-64"])
def test_two_axis_schemes_leave_nothing_of_bias_and_own_scale(name):
    r = scheme_residual(named_scheme(name))
    assert np.abs(r.bias).max() < 1e-12
    assert np.abs(np.einsum("ijj->ij", r.matrix)).max() < 1e-12


def test_sixteen_leave_nothing_of_misalignment_and_asymmetry():
    r = scheme_residual(named_scheme("two-axis-16"))
    assert np.abs(r.matrix).max() < 1e-12
    assert np.abs(r.asymmetry).max() < 1e-12


def test_single_axis_residuals_by_hand():
    """One way: nothing of level bias, all of the vertical's; scale factor times the rate."""
    one_way = scheme_residual(named_scheme("continuous", limits=Limits(2.0)))
    np.testing.assert_allclose(one_way.bias, np.diag([0.0, 0.0, 1.0]), atol=1e-12)
    assert one_way.matrix[2, 2, 2] == pytest.approx(2.0 * DEG, rel=1e-9)
    both = scheme_residual(named_scheme("reciprocating", limits=Limits(2.0)))
    assert abs(both.matrix[2, 2, 2]) < 1e-12
    # The asymmetry is left whole: |w| is 2 deg/s but for the reversals.
    assert both.asymmetry[2, 2] == pytest.approx(2.0 * DEG, rel=5e-3)


def test_earth_term_of_an_equal_scale_factor_cannot_be_turned_away():
    r = scheme_residual(named_scheme("two-axis-16"))
    np.testing.assert_allclose(np.einsum("ijjl->il", r.earth), np.eye(3), atol=1e-12)


def test_the_optimiser_finds_what_sixteen_are():
    """No worse than the named scheme by its own measure, and within the travel."""
    from schuler.modulation.residual import _cost

    limits = Limits(10.0, 20.0, travel=360.0)
    scheme, drift = optimise_scheme(16, limits=limits, tries=160, rng=np.random.default_rng(3))
    weights = (0.01 * DEG_PER_HOUR, 10e-6, 10 * DEG / 3600, 1e-6)
    assert drift == _cost(scheme_residual(scheme, 2.0), weights)
    assert drift <= _cost(scheme_residual(named_scheme("two-axis-16"), 2.0), weights)
    assert all(max(-low, high) <= 360.0 for low, high, _ in scheme.travel().values())
    with pytest.raises(InputError, match="even number"):
        optimise_scheme(7)
    with pytest.raises(InputError, match="no order"):
        optimise_scheme(8, limits=Limits(travel=90.0), tries=5)


def test_a_case_without_errors_has_nothing_to_compare():
    data = {"errors": {"accel_scale": "5 ppm"}, "duration": "1 h"}
    with pytest.raises(InputError, match="nothing to compare"):
        compare_rotation(RotationCase.from_dict(data))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"errors": None}, "errors.* is missing"),
        ({"errors": {"gyro_bias": ["1 deg/h"]}}, "expected 4 values"),
        ({"duration": "1 s"}, "1 min to 30 d"),
        ({"latitudes": [90]}, "within 89 deg"),
        ({"headings": []}, "list of numbers"),
        ({"array": "cube"}, "is no array"),
        ({"single_axis": {"scheme": "round"}}, "is no scheme"),
        ({"colour": 1}, "unknown key 'colour'"),
        ({"site": {"lat": "north"}}, "expected a number"),
    ],
)
def test_bad_cases_are_said(change, sentence):
    data = {"array": "symmetric4", "errors": {"gyro_bias": "0.01 deg/h"}, **change}
    with pytest.raises(InputError, match=sentence):
        RotationCase.from_dict(data)
