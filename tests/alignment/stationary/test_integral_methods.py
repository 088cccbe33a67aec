"""The estimators of the field, the gyrocompass loop, the unknown latitude, the comparison."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from schuler.alignment import align, align_without_latitude
from schuler.alignment.compare import compare, settle_time
from schuler.alignment.convergence import heading_history
from schuler.alignment.stationary.integral_methods import FIELD
from schuler.attitude import euler_to_quat, multiply, quat_to_rotvec
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle, Static
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import NORMAL_GRAVITY

SITE, FOG = Site(40.0, **NORMAL_GRAVITY), GRADES["navigation-fog"]


def run(seed, method, duration=200.0, crew=True):
    rng = np.random.default_rng([seed, 9])
    motion = DisturbedVehicle.with_crew(rng, duration, heading=30.0) if crew else Static(30.0)
    made = simulate(motion, SITE, duration, 50.0, FOG, rng)
    fix = align(made.record, SITE, method, FOG)
    back = euler_to_quat(made.euler_at(round(fix.duration / made.step)))
    return -quat_to_rotvec(multiply(fix.quat_nb, back * [1.0, -1.0, -1.0, -1.0])), fix


@pytest.mark.slow
@pytest.mark.parametrize("method", [*FIELD, "gyrocompass"])
def test_errors_are_those_that_the_covariance_says(method):
    """40 runs on a truck with its crew: mean NEES in the 99 % band, sigma at most 10 % short."""
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda seed: run(seed, method), range(40)))
    nees = np.mean([p @ np.linalg.solve(f.covariance, p) for p, f in found])
    low, high = np.array(stats.chi2.interval(0.99, 120)) / 40
    assert 0.7 * low < nees < 1.1 * high


@pytest.mark.parametrize("method", FIELD)
def test_at_rest_all_find_north(method):
    phi, fix = run(1, method, crew=False)
    assert np.all(np.abs(phi) < 4 * np.sqrt(np.diag(fix.covariance)))
    assert str(fix.method) == method


@pytest.mark.slow
def test_latitude_comes_out_with_its_sigma():
    """24 runs: the mean square of the normalised error inside its 99.9 % band."""
    z = []
    for seed in range(24):
        rng = np.random.default_rng([seed, 10])
        lat = rng.uniform(-65, 65)
        motion = DisturbedVehicle.with_crew(rng, 200.0) if seed % 2 else Static(40.0)
        made = simulate(motion, Site(lat, **NORMAL_GRAVITY), 200.0, 20.0, FOG, rng)
        found = align_without_latitude(made.record, FOG)
        z.append((found.latitude - lat * DEG) / found.sigma)
        assert found.sigma < 0.2 * DEG
        assert found.alignment.covariance == pytest.approx(
            sum(found.alignment.budget.values()), rel=1e-9
        )
    low, high = np.array(stats.chi2.interval(0.999, 24)) / 24
    assert low < np.mean(np.square(z)) < high


@pytest.mark.realdata
def test_latitude_of_the_real_record(data_dir):
    import schuler as sc

    record = sc.read(data_dir / "psins_lasergyro_vehicle" / "lasergyro.imu")
    found = align_without_latitude(record, "navigation-rlg", height=380.0)
    assert abs(found.latitude / DEG - 34.246048) < 4 * found.sigma / DEG
    assert found.sigma / DEG < 0.05
    assert found.alignment.heading_deg == pytest.approx(90.60, abs=0.05)
    # Two sigma off, the latitude is no contradiction of the record that it was found in.
    assert found.alignment.consistent


def test_a_record_without_latitude_says_so():
    rng = np.random.default_rng(1)
    made = simulate(Static(0.0), SITE, 20.0, 20.0, GRADES["industrial-mems"], rng)
    with pytest.raises(InputError, match="latitude"):
        align_without_latitude(made.record, "industrial-mems")


def test_comparison():
    rng = np.random.default_rng(4)
    record = simulate(Static(30.0), SITE, 200.0, 10.0, FOG, rng).record
    pairs = (("auto", "none"), ("kalman", "none"), ("analytic", "lowpass"))
    said = []
    found = compare(record, SITE, FOG, pairs, window=60.0, progress=said.append)
    assert [(r.method, r.prefilter) for r in found.rows] == list(pairs)
    assert said == ["auto", "kalman", "analytic, lowpass"]
    for row in found.rows:
        assert abs(row.heading_deg - 30.0) * 60 < 5 * row.sigma_arcmin
        assert row.std_heading_arcmin > 0
        assert row.settle_s is None or 0 < row.settle_s <= 200.0
    assert found.rows[0].note == "chose optimal"
    short = compare(record.between(0.0, 30.0), SITE, FOG, (("gyrocompass", "none"),))
    assert short.rows[0].heading_deg is None
    assert "settle" in short.rows[0].note
    assert settle_time(align(record, SITE, "centred", FOG)) < 200.0
    least = min(row.sigma_arcmin for row in found.rows)
    assert found.within_arcmin == pytest.approx(3.0 * least)
    assert settle_time(align(record, SITE, "centred", FOG), within=0.5 * least) is None
    assert "within" in str(found).splitlines()[-1]
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.consistent
    assert all(row.consistent for row in found.rows)


def test_a_comparison_says_first_what_its_record_contradicts():
    rng = np.random.default_rng(4)
    record = simulate(Static(30.0), SITE, 120.0, 20.0, FOG, rng).record
    wrong = replace(record, dvel=-record.dvel)
    found = compare(wrong, SITE, FOG, (("auto", "none"),))
    assert (found.consistent, found.rows[0].consistent) == (False, False)
    assert str(found).startswith("INCONSISTENT: the gyros' mean rate")
    assert found.to_dict()["contradictions"] == list(found.contradictions)


@pytest.fixture(scope="module")
def shaken():
    rng = np.random.default_rng(8)
    motion = DisturbedVehicle.with_crew(rng, 200.0, heading=30.0)
    return simulate(motion, SITE, 200.0, 50.0, FOG, rng).record


def test_settled_is_the_first_time_from_which_the_heading_stays_in_the_band(shaken):
    """By the headings of ever longer records, each aligned by itself."""
    fix = align(shaken, SITE, "centred", FOG)
    t, heading = heading_history(fix, 25)
    for end, found in zip(t[2::4], heading[2::4], strict=True):
        alone = align(shaken.between(None, end), SITE, "centred", FOG)
        assert alone.heading_deg == pytest.approx(found, abs=0.02 + 0.02 * alone.sigma_arcmin[2])
    sigma = float(fix.sigma_arcmin[2])
    for band, middle in ((sigma, None), (3.0 * sigma, None), (3.0 * sigma, 30.0), (90.0, 31.0)):
        stays = [
            all(60.0 * abs(heading[k:] - (heading[-1] if middle is None else middle)) <= band)
            for k in range(len(t))
        ]
        wanted = t[stays.index(True)] if any(stays) else None
        assert settle_time(fix, 25, within=band, heading=middle) == wanted
    assert settle_time(fix, 25) == settle_time(fix, 25, within=3.0 * sigma)


def test_a_filter_settles_when_it_would_have_if_the_record_had_ended(shaken):
    """The loops begin with what the whole record gave them: their own way settles at once."""
    fix = align(shaken, SITE, "gyrocompass", FOG)
    found = settle_time(fix, within=60.0)
    assert found is None or found >= 40.0
    assert fix.filter_history.t[0] < 2.0


def test_a_comparison_about_the_true_heading(shaken):
    found = compare(shaken, SITE, FOG, (("centred", "none"),), within=600.0, heading=30.0)
    assert (found.within_arcmin, found.heading_deg) == (600.0, 30.0)
    assert found.rows[0].settle_s < 60.0
    away = compare(shaken, SITE, FOG, (("centred", "none"),), within=600.0, heading=230.0)
    assert away.rows[0].settle_s is None
    for bad in ({"within": -1.0}, {"within": float("nan")}, {"heading": float("inf")}):
        with pytest.raises(InputError):
            compare(shaken, SITE, FOG, (("centred", "none"),), **bad)
