"""Arrays: figures of the source, fusion, designs, calibration, reliability."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest, chi2

from schuler.constants import DEG_PER_HOUR
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import Manoeuvre, Route, Static
from schuler.navigation import Start, navigate
from schuler.record import ImuRecord
from schuler.sensors import (
    ARRAYS,
    Lifetime,
    Mounting,
    Reliability,
    SensorArray,
    design_array,
    fit_axes,
    load_array,
    named_array,
)
from schuler.simulation import simulate

NAMES = [*ARRAYS, "cone5", "cone7"]


@pytest.mark.parametrize("name", ["symmetric4", "cone4", "tetrahedron", "cone5", "dodecahedron"])
def test_optimal_arrays_have_equal_variances(name):
    a = named_array(name)
    n = len(a)
    np.testing.assert_allclose(a.h.T @ a.h, n / 3.0 * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(a.variance(), 3.0 / n, atol=1e-12)
    assert a.figures()["optimal"]


def test_variance_after_each_single_failure():
    """Published as worse or better; exactly 1.5 each, against 0.75, 2.25, 1.5."""
    for row in named_array("symmetric4").figures()["after_one_failure"]:
        np.testing.assert_allclose(row["variance"], 1.5, atol=1e-12)
    for row in named_array("cone4").figures()["after_one_failure"]:
        np.testing.assert_allclose(sorted(row["variance"]), [0.75, 1.5, 2.25], atol=1e-12)
        assert row["variance"][2] == pytest.approx(1.5, abs=1e-12)


def test_the_cone_turned_by_45_deg_is_the_symmetric_skew():
    turned = named_array("cone4").turned(Rotation.from_euler("z", 45, degrees=True).as_matrix())
    mine = {tuple(np.round(row, 9)) for row in named_array("symmetric4").h}
    assert {tuple(np.round(row, 9)) for row in turned.h} == mine
    for name in ("symmetric4", "cone4"):
        dets = named_array(name).figures()["triple_determinants"]
        np.testing.assert_allclose(dets, 0.7698, atol=5e-5)


@given(st.sampled_from(NAMES), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_fusion_returns_the_motion_with_every_set_of_sensors(name, rate):
    a = named_array(name)
    measured = a.h @ np.array(rate)
    for picked in a.subsets():
        broken = measured.copy()
        broken[[i for i in range(len(a)) if i not in picked]] = 1e6
        np.testing.assert_allclose(a.estimator(picked) @ broken, rate, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_weighted_fusion_is_the_least_squares_covariance(seed):
    rng = np.random.default_rng(seed)
    a = SensorArray(rng.standard_normal((6, 3)), sigma=rng.uniform(0.5, 2.0, 6))
    w = np.diag(1.0 / np.asarray(a.sigma) ** 2)
    np.testing.assert_allclose(a.covariance(), np.linalg.inv(a.h.T @ w @ a.h), rtol=1e-9)


def test_subsets_are_those_of_full_rank():
    a = named_array("triad-plus-one")
    assert set(a.subsets()) == {(0, 1, 2, 3), (0, 1, 2), (0, 1, 3)}
    b = named_array("cone5")
    assert sum(len(s) == 3 for s in b.subsets()) == len(list(combinations(range(5), 3)))


def test_known_bias_and_scale_are_taken_out():
    a = SensorArray(named_array("cone5").h, "cone5", bias=np.arange(5) * 1e-6,
                    scale=np.array([1, -2, 3, -4, 5]) * 1e-4)  # fmt: skip
    record = simulate(Route([Manoeuvre(10, turn=90)]), Site(40.0), 10.0).record
    np.testing.assert_allclose(a.fuse(a.measure(record)).dtheta, record.dtheta, atol=1e-15)


@pytest.mark.compiled
def test_records_of_arrays_flow_through_align_and_navigate():
    import schuler as sc

    site, a = Site(40.0), named_array("symmetric4")
    made = simulate(Static(30.0), site, 60.0)
    record = a.measure(made.record)
    assert record.dtheta.shape[1] == 4
    assert sc.align(record, site, array="symmetric4").heading_deg == pytest.approx(30.0, abs=1e-5)
    p = navigate(record, Start.from_angles(site, 30.0), array=a)
    q = navigate(made.record, Start.from_angles(site, 30.0))
    np.testing.assert_allclose(p.position, q.position, atol=1e-9)
    with pytest.raises(InputError, match="has 4 gyro columns, but the array 'cone5' has 5"):
        navigate(record, Start.from_angles(site, 30.0), array="cone5")


def test_equivalent_error_of_the_source():
    e = named_array("symmetric4").equivalent(np.array([1.0, 1.5, 2.0, 3.0]) * 1e-3)
    np.testing.assert_allclose(e, [-0.000217, 0.001083, 0.003248], atol=1e-6)


@pytest.mark.parametrize("n", [4, 5, 6])
def test_a_free_design_reaches_the_bound(n):
    assert design_array(n).figures()["total_variance"] == pytest.approx(9.0 / n, rel=1e-6)


def test_a_design_keeps_its_mounting_limits_and_survives():
    m = Mounting(elevation=(10.0, 60.0), apart=30.0)
    a = design_array(5, m, criterion="failure", starts=6)
    elevation = np.rad2deg(np.arcsin(a.h[:, 2]))
    assert elevation.min() > 10.0 - 1e-6
    assert elevation.max() < 60.0 + 1e-6
    angles = np.rad2deg(np.arccos(np.abs((a.h @ a.h.T)[np.triu_indices(5, 1)])))
    assert angles.min() > 30.0 - 1e-4
    worst = max(r["total"] for r in a.figures()["after_one_failure"])
    assert worst == pytest.approx(2.7, rel=0.02)  # what five on the optimal cone have
    with pytest.raises(InputError, match="widen"):
        design_array(6, Mounting((0.0, 5.0), apart=60.0), starts=3)


def test_axes_are_calibrated_with_honest_sigmas():
    """NEES of directions, scale and bias over 60 calibrations in the band of 1e-3."""
    rng = np.random.default_rng(8)
    truth = named_array("cone5")
    k, dt, noise = 400, np.full(400, 0.1), 1e-5
    turn = rng.standard_normal((k, 3)) * 0.1
    bias, scale = rng.normal(0, 1e-4, 5), rng.normal(0, 1e-3, 5)
    h = (1.0 + scale)[:, None] * truth.h
    total, runs = 0.0, 60
    for _ in range(runs):
        measured = turn @ h.T + dt[:, None] * bias + noise * rng.standard_normal((k, 5))
        fit = fit_axes(turn, measured, dt)
        gain = 1.0 + np.asarray(fit.array.scale)
        found = np.column_stack([gain[:, None] * fit.array.h, fit.array.bias])
        total += np.sum(((found - np.column_stack([h, bias])) / fit.sigma) ** 2)
    # Directions and bias are nearly uncorrelated here, so the squares add as independent ones.
    low, high = chi2.ppf([5e-4, 1 - 5e-4], runs * 20)
    assert low < total < high
    with pytest.raises(InputError, match="turn about all three"):
        fit_axes(np.zeros((10, 3)), np.zeros((10, 5)), np.ones(10))


# -- reliability -----------------------------------------------------------------------------


def test_mtbf_of_the_source():
    """1.75 times three single gyros, 1.4 times a doubled axis, 2916.7 h of 5000 h gyros."""
    three, double, four = (
        Reliability(named_array(n)).mtbf for n in ("triad", "triad-plus-one", "symmetric4")
    )
    assert three == pytest.approx(5000.0 / 3.0, rel=1e-12)
    assert double == pytest.approx(5000.0 * 5.0 / 12.0, rel=1e-12)
    assert four == pytest.approx(2916.6667, abs=1e-3)
    assert four / three == pytest.approx(1.75, rel=1e-12)
    assert four / double == pytest.approx(1.4, rel=1e-12)


@pytest.mark.parametrize("shape", [0.7, 1.0, 2.5])
@pytest.mark.parametrize("name", ["triad-plus-one", "skewed4", "dodecahedron"])
def test_mtbf_is_the_integral_of_reliability(name, shape):
    r = Reliability(named_array(name), Lifetime(5000.0, shape), 0.9)
    assert r.at(0.0) == pytest.approx(1.0)
    reach = 200.0 if shape < 1 else 8.0
    found, _ = quad(lambda x: 5000.0 * r.at(5000.0 * x), 0.0, reach, limit=400)
    assert r.mtbf == pytest.approx(found, rel=1e-5)


@pytest.mark.parametrize("coverage", [1.0, 0.8])
@pytest.mark.parametrize("shape", [1.0, 1.8])
def test_reliability_against_draws(shape, coverage):
    """The share of 20,000 draws that outlives 2000 h, in the binomial band of 1e-3."""
    r = Reliability(named_array("cone5"), Lifetime(5000.0, shape), coverage)
    lives = r.simulate(np.random.default_rng(3), 20_000)
    alive = int(np.sum(lives > 2000.0))
    assert binomtest(alive, len(lives), float(r.at(2000.0))).pvalue > 1e-3
    spread = lives.std() / np.sqrt(len(lives))
    assert abs(lives.mean() - r.mtbf) < 3.3 * spread


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: named_array("cube"), "is no array"),
        (lambda: SensorArray(np.eye(3)[:2]), "n >= 3"),
        (lambda: SensorArray(np.ones((4, 3))), "in a plane"),
        (lambda: SensorArray(np.eye(3), sigma=[1.0, 1.0]), "3 finite numbers for sigma"),
        (lambda: SensorArray(np.eye(3), sigma=[1.0, 1.0, 0.0]), "positive"),
        (lambda: named_array("triad-plus-one").estimator([0, 2, 3]), "do not measure all three"),
        (lambda: named_array("triad").estimator([0, 1, 7]), "numbered 0 to 2"),
        (lambda: Lifetime(-1.0), "mean life"),
        (lambda: Reliability(named_array("triad"), coverage=2.0), "chance from 0 to 1"),
        (lambda: design_array(3, criterion="failure"), "4 to 12"),
        (lambda: list(named_array("cone20").subsets()), "too many"),
    ],
)
def test_bad_arrays_are_said(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


def test_array_files(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        "directions = [[2, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]\n"
        "bias_deg_h = [0.1, 0, 0, 0]\nscale_ppm = [0, 5, 0, 0]\n", encoding="utf-8"
    )  # fmt: skip
    a = load_array(file)
    assert a.name == "mine"
    np.testing.assert_allclose(np.linalg.norm(a.h, axis=1), 1.0)
    assert np.asarray(a.bias)[0] == pytest.approx(0.1 * DEG_PER_HOUR)
    assert np.asarray(a.scale)[1] == pytest.approx(5e-6)
    for text, sentence in (
        ("x = 1", "unknown key"), ("", "'directions' is missing"),
        ("directions = [[1, 2], [3]]", "lists of numbers"), ("directions = ", "not valid TOML"),
    ):  # fmt: skip
        file.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=sentence):
            load_array(file)


def test_measure_needs_a_triad():
    record = ImuRecord(np.ones(1), np.ones(1), np.ones((1, 4)), np.ones((1, 3)))
    with pytest.raises(InputError, match="expected three gyros"):
        named_array("cone4").measure(record)
