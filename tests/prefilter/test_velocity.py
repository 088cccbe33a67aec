"""Decomposition of the velocity: what it keeps, the document's end prediction, cleaning by gap."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import KalmanAlignment, align
from schuler.earth import Site
from schuler.errors import InputError
from schuler.kernels.end_conditions import predict_by_pattern
from schuler.motion import DisturbedVehicle
from schuler.prefilter import Emd, Hankel, VelocityEmd, decompose, parse_prefilter
from schuler.prefilter.hankel import gap_rank, truncate
from schuler.record import ImuRecord
from schuler.sensors import load_spec
from schuler.simulation import simulate

SITE = Site(40.0)
N, DT = 12_000, 0.01
TIME = DT * np.arange(1, N + 1)


def record_of(velocity):
    """Return a record at rest in inertial space whose velocity integral (n + 1,) is given."""
    steps = np.outer(np.diff(velocity), [1.0, 0.5, -2.0])
    return ImuRecord(TIME, np.full(N, DT), np.zeros((N, 3)), steps, coning_corrected=True,
                     sculling_corrected=True)  # fmt: skip


AT = np.concatenate([[0.0], TIME])
SLOW = 9.8 * AT - 3e-4 * AT**2 + 2e-7 * AT**3


def test_a_cubic_passes_untouched():
    record = record_of(SLOW)
    np.testing.assert_allclose(VelocityEmd()(record).dvel, record.dvel, atol=1e-9)


@pytest.mark.parametrize(
    "design", [VelocityEmd(), VelocityEmd(ends="mirror"), VelocityEmd(ends="pattern"),
               VelocityEmd(clean="gap"), VelocityEmd(ensemble=4)], ids=str,
)  # fmt: skip
def test_shaking_goes_and_gravity_s_part_stays(design):
    """2 Hz and 11 Hz over a cubic: the velocity that is left is the cubic's to a fraction."""
    shake = 0.02 * np.sin(2 * np.pi * 2.03 * AT) + 0.01 * np.sin(2 * np.pi * 11.1 * AT + 1.0)
    smooth = design(record_of(SLOW + shake))
    left = np.cumsum(smooth.dvel[:, 0]) - (SLOW[1:] - SLOW[0])
    assert np.std(left) < 0.25 * np.std(shake)


def oracle(v, other, order):
    """Return the document's prediction of the next v, as `predict_by_pattern` says it, plainly."""
    n = len(v)
    signs = lambda i: (v[i] > v[i - 1], other[i] > other[i - 1])  # noqa: E731
    alike = [i for i in range(1, n - 1) if signs(i) == signs(n - 1)]
    follow = [signs(i + 1) for i in alike]
    wanted = max(sorted(set(follow)), key=follow.count)
    chosen = [i for i, after in zip(alike, follow, strict=True) if after == wanted]
    chosen.sort(key=lambda i: abs(v[i] - v[-1]) + abs(other[i] - other[-1]))
    chosen = [i for i in chosen if i >= order][: order + 1]
    assert len(chosen) == order + 1
    a = np.array([[v[i - j] for j in range(order + 1)] for i in chosen])
    coefficients = np.linalg.solve(a, [v[i + 1] for i in chosen])
    return float(coefficients @ [v[-1 - j] for j in range(order + 1)])


@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_the_document_s_prediction_against_its_equations(order):
    checked = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        v, other = 2.0 + 0.3 * rng.standard_normal(80), -1.0 + 0.3 * rng.standard_normal(80)
        wanted = oracle(v, other, order)
        if abs(wanted - 0.5 * (v.min() + v.max())) > 1.5 * np.ptp(v):
            continue  # the kernel lowers the order there
        assert predict_by_pattern(v, other, 80, 80, order) == pytest.approx(wanted, rel=1e-6)
        checked += 1
    assert checked > 5


def test_the_document_s_prediction_continues_a_recurrence():
    """Extrema that obey v[i+1] = 0.5 v[i] + 0.5 v[i-2] with forcing by pattern are continued."""
    t = np.arange(60)
    v = 3.0 + np.sin(0.9 * t)
    other = -3.0 + np.sin(0.9 * t + 0.4)
    # A sine about a constant obeys a recurrence of order two with three coefficients.
    found = predict_by_pattern(v, other, 60, 60, 2)
    assert found == pytest.approx(3.0 + np.sin(0.9 * 60), abs=1e-6)


def test_too_few_extrema_leave_the_last_value():
    v, other = np.array([1.0, 2.0]), np.array([-1.0, -2.0])
    assert predict_by_pattern(v, other, 2, 2, 2) == 2.0
    assert predict_by_pattern(v[:1], other[:1], 1, 1, 2) == 1.0


def test_pattern_ends_beat_straight_lines_on_a_slow_tone():
    t = np.arange(2000) / 100.0
    worse = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0, 2 * np.pi)
        tone = np.sin(2 * np.pi * 0.97 * t + phase)
        x = tone + 0.3 * np.sin(2 * np.pi * 0.11 * t)
        error = {}
        for ends in ("pattern", "linear"):
            modes = decompose(x, ends=ends, stop="fixed", siftings=10)
            mode = max(modes, key=lambda m: abs(np.corrcoef(m, tone)[0, 1]))
            error[ends] = np.sqrt(np.mean((mode - tone)[-100:] ** 2))
        worse += error["pattern"] > error["linear"]
    assert worse <= 6


def test_rank_by_the_gap():
    """Two tones have four singular values above those of weak noise."""
    rng = np.random.default_rng(2)
    t = np.arange(4000) / 100.0
    clean = np.sin(2 * np.pi * 3.1 * t) + 0.6 * np.sin(2 * np.pi * 9.7 * t)
    noisy = clean + 0.01 * rng.standard_normal(len(t))
    found = truncate(noisy, "gap", 100)
    np.testing.assert_allclose(found, truncate(noisy, 4, 100), atol=1e-12)
    assert np.std(found - clean) < 0.5 * np.std(noisy - clean)
    assert gap_rank(np.array([5.0, 4.0, 3.0, 0.01, 0.009, 0.008, 0.007])) == 3


@pytest.mark.parametrize(
    "text",
    ["emd-velocity", "emd-velocity-improved", "emd-velocity(0.3, ends=pattern, order=4)",
     "emd-velocity(clean=gap, window=2 s)", "emd-velocity(ensemble=10, seed=3)",
     "hankel(gap)", "emd(clean=gap, ends=pattern)"],
)  # fmt: skip
def test_texts_and_tables_keep_the_options(text):
    design = parse_prefilter(text)
    assert parse_prefilter(str(design)) == design
    assert parse_prefilter(design.to_table()) == design


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: VelocityEmd(threshold=0.0), "threshold and siftings"),
        (lambda: VelocityEmd(ends="sideways"), "ends must be"),
        (lambda: VelocityEmd(clean="most"), "clean must be gap"),
        (lambda: VelocityEmd(clean=-1), "clean must be gap"),
        (lambda: VelocityEmd(order=99), "order must be 0 to 12"),
        (lambda: VelocityEmd(trend=0), "degree of 1 to 9"),
        (lambda: VelocityEmd(noise=0.0), "window and noise"),
        (lambda: VelocityEmd(ensemble=-1), "ensemble and seed"),
        (lambda: Hankel("most"), "rank must be 1 or more, or gap"),
        (lambda: Emd(order=-1), "order must be"),
        (lambda: KalmanAlignment(start="luck"), "start must be one of"),
        (lambda: KalmanAlignment(azimuth="large", start="wahba"), "needs no start"),
        (lambda: VelocityEmd()(record_of(SLOW).rows(0, 9)), "16 samples"),
    ],
)
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.fixture(scope="module")
def truck():
    rng = np.random.default_rng([0, 3, 1])
    motion = DisturbedVehicle.with_crew(rng, 150.0, heading=70.0)
    return simulate(motion, SITE, 150.0, 100.0, load_spec("navigation-fog"), rng)


def test_the_heading_curve_of_a_velocity_filter_is_calmer(truck):
    """On a shaken truck, from 100 s on, less than two thirds of the scatter without it."""
    spec = load_spec("navigation-fog")
    scatter = {}
    for name in ("none", "emd-velocity"):
        prefilter = parse_prefilter(name)
        method = KalmanAlignment(10, "velocity", base=False, prefilter=prefilter)
        fix = align(truck.record, SITE, method, spec)
        late = fix.filter_history.t > 100.0
        q = fix.filter_history.quaternion[late]
        psi = np.unwrap(np.arctan2(q[:, 3], q[:, 0]) * 2.0)
        scatter[name] = psi.std()
    assert scatter["emd-velocity"] < 0.67 * scatter["none"]


@pytest.mark.parametrize("start", ["integral-triad", "optimal", "position-triad"])
def test_a_kalman_filter_starts_where_it_is_told(truck, start):
    """Its start is wide, so that the end hardly depends on it; its first step does."""
    spec = load_spec("navigation-fog")
    fixes = {name: align(truck.record, SITE, KalmanAlignment(10, "velocity", start=name), spec)
             for name in ("centred", start)}  # fmt: skip
    off = abs(fixes[start].heading_deg - fixes["centred"].heading_deg) * 60.0
    assert off < 3.0 * fixes["centred"].sigma_arcmin[2]
    first = [fix.filter_history.sigma[0, 2] for fix in fixes.values()]
    assert first[1] >= first[0] * (1.0 - 1e-9)
