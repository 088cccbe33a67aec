"""Faults: rates of false alarm and missed detection as chosen, isolation, exclusion, limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest, chi2

from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import Static
from schuler.sensors import (
    Fault,
    FaultMonitor,
    ParityTest,
    SensorArray,
    isolable,
    isolate_by_rate,
    named_array,
    parity_matrix,
)
from schuler.simulation import simulate

BAND = 0.01
"""False-alarm rate of each binomial comparison below."""


@pytest.mark.parametrize("name", ["symmetric4", "cone5", "dodecahedron", "cone8"])
def test_parity_sees_no_motion(name):
    a = named_array(name)
    v = parity_matrix(a)
    np.testing.assert_allclose(v @ a.h, 0.0, atol=1e-13)
    np.testing.assert_allclose(v @ v.T, np.eye(len(a) - 3), atol=1e-13)


def test_parity_of_unequal_sensors_is_white():
    a = SensorArray(named_array("cone5").h, sigma=[1.0, 2.0, 1.0, 3.0, 1.5])
    v = parity_matrix(a)
    np.testing.assert_allclose(v @ a.h, 0.0, atol=1e-13)
    cov = (v * np.asarray(a.sigma) ** 2) @ v.T
    np.testing.assert_allclose(cov, np.mean(np.asarray(a.sigma)) ** 2 * np.eye(2), atol=1e-12)


@pytest.mark.parametrize("window", [1, 8])
@pytest.mark.parametrize("name", ["symmetric4", "cone5", "dodecahedron"])
def test_false_alarms_and_misses_are_what_was_chosen(name, window):
    """Of 50,000 windows, in the binomial 99 % band of chi-square and non-central chi-square."""
    a = named_array(name)
    t = ParityTest(a, 2e-6, 0.01, window)
    rng = np.random.default_rng(21)
    n = 50_000
    x = 2e-6 * rng.standard_normal((n * window, len(a)))
    alarms = int(np.sum(t.statistic(x) > t.threshold))
    assert binomtest(alarms, n, 0.01).pvalue > BAND
    shift = t.smallest_fault(1, miss=0.2)
    x[:, 1] += shift
    missed = int(np.sum(t.statistic(x) <= t.threshold))
    assert t.miss_rate(1, shift) == pytest.approx(0.2, abs=1e-6)
    assert binomtest(missed, n, 0.2).pvalue > BAND


def test_the_motion_does_not_matter():
    """The same noise on a turning body gives the same statistics, to rounding."""
    a = named_array("cone5")
    t = ParityTest(a, 1e-6, 0.01)
    rng = np.random.default_rng(2)
    noise = 1e-6 * rng.standard_normal((1000, 5))
    turn = rng.standard_normal((1000, 3)) @ a.h.T
    np.testing.assert_allclose(t.statistic(noise + turn), t.statistic(noise), rtol=1e-6, atol=1e-6)


def test_mean_delay_is_what_is_seen():
    """Geometric: the mean of 2,000 first alarms within four of its own sigmas."""
    a = named_array("cone6")
    t = ParityTest(a, 1.0, 1e-3, window=5)
    shift = t.smallest_fault(2, miss=0.6)
    rng = np.random.default_rng(9)
    x = rng.standard_normal((2000 * 40 * 5, 6))
    x[:, 2] += shift
    hits = (t.statistic(x) > t.threshold).reshape(2000, 40)
    assert hits.any(axis=1).all()
    delay = 5.0 * (1 + hits.argmax(axis=1))
    expected = t.mean_delay(2, shift)
    assert abs(delay.mean() - expected) < 4.0 * delay.std() / np.sqrt(2000)


def test_isolation_needs_five():
    assert not isolable(named_array("symmetric4"))
    assert not isolable(named_array("triad-plus-one"))
    assert isolable(named_array("cone5"))
    assert isolable(named_array("dodecahedron"))
    # With one of five out, four are left.
    assert not isolable(named_array("cone5"), [0, 1, 2, 3])
    with pytest.raises(InputError, match="no redundancy"):
        parity_matrix(named_array("triad"))


def test_isolation_blames_the_right_sensor():
    a = named_array("dodecahedron")
    t = ParityTest(a, 1.0, 1e-3)
    rng = np.random.default_rng(4)
    for j in range(6):
        x = rng.standard_normal((500, 6))
        x[:, j] += 12.0
        assert np.mean(t.likelihoods(x).argmax(axis=1) == j) > 0.99


def test_sequential_test_holds_wald_s_bounds_and_is_faster():
    """False share of ended tests below alpha / (1 - beta); delay below the window test's."""
    a = named_array("cone6")
    t = ParityTest(a, 1.0, 1e-3, window=40)
    rng = np.random.default_rng(6)
    x = rng.standard_normal((200_000, 6))
    alarms, ended = t.sprt(x, 1.0, miss=0.01)
    bound = 1e-3 / 0.99
    assert binomtest(int(alarms.sum()), int(ended.sum()), bound, "greater").pvalue > BAND
    assert ended.min() > 1000
    y = rng.standard_normal((1000, 60, 6))
    y[:, :, 3] += 1.0
    first = [np.flatnonzero(t.sprt(run, 1.0)[0][:, 3]) for run in y]
    delay = np.mean([f[0] + 1 if len(f) else 60 for f in first])
    assert delay < t.mean_delay(3, 1.0)


def data(array, fault, seed=0, seconds=200.0, sigma=1e-6):
    """Return times, increments of a swaying body with a fault, and the clean ones, at 100 Hz."""
    rng = np.random.default_rng(seed)
    n = round(seconds * 100)
    time, dt = 0.01 * np.arange(1, n + 1), np.full(n, 0.01)
    rate = np.array([2e-6, 5e-6, 4e-6]) * (1.0 + 10.0 * np.sin(0.5 * time))[:, None]
    clean = rate @ array.h.T + sigma * rng.standard_normal((n, len(array)))
    return time, fault.apply(time, dt, clean, sigma, rng), clean


@pytest.mark.compiled
@pytest.mark.parametrize(
    "fault",
    [
        Fault(2, "step", 2e-4, 50.0, 100.0),
        Fault(2, "drift", 2e-5, 50.0, 100.0),
        Fault(2, "stuck", 0.0, 50.0, 100.0),
        Fault(2, "noise", 8.0, 50.0, 100.0),
        Fault(2, "scale", 4.0, 50.0, 100.0),
    ],
    ids=lambda f: f.kind,
)
def test_a_monitor_excludes_and_takes_back(fault):
    a = named_array("dodecahedron")
    window = 1 if fault.kind == "noise" else 50
    t = ParityTest(a, 1e-6, 1e-6, window)
    m = FaultMonitor(t, heal=20 if window == 50 else 200)
    time, x, clean = data(a, fault, seed=5)
    fused = m.run(time, x)
    said = [v for v in m.verdicts if v.action == "excluded"]
    assert said
    assert {v.sensor for v in said} == {2}
    assert said[0].time > 50.0
    assert m.verdicts[-1].action == "taken back"
    assert m.working == list(range(6))
    # After the exclusion the fused rate is that of the clean sensors, to their noise.
    k = (time > said[0].time + 5.0) & (time < 95.0)
    if fault.kind in ("step", "scale"):
        off = (fused[k] - clean[k] @ a.estimator().T).mean(axis=0)
        assert np.abs(off).max() < 5.0 * 1e-6 / np.sqrt(k.sum())


def test_a_monitor_without_faults_stays_quiet():
    a = named_array("cone5")
    m = FaultMonitor(ParityTest(a, 1e-6, 1e-9, 20))
    time, _, clean = data(a, Fault(0), seed=1)
    fused = m.run(time, clean)
    assert m.verdicts == []
    np.testing.assert_allclose(fused, clean @ a.estimator().T, atol=1e-18)


def test_four_sensors_say_that_they_cannot_tell():
    a = named_array("symmetric4")
    m = FaultMonitor(ParityTest(a, 1e-6, 1e-6, 50))
    time, x, _ = data(a, Fault(1, "step", 3e-4, 50.0), seed=2)
    m.run(time, x)
    assert [v.action for v in m.verdicts] == ["detected"]
    assert m.verdicts[0].sensor is None
    assert "not which" in m.verdicts[0].reason
    assert m.working == [0, 1, 2, 3]


@pytest.mark.parametrize("j", range(4))
def test_a_known_rate_tells_among_four(j):
    """At rest the Earth's rate, known by an alignment, blames each of the four in turn."""
    a = named_array("symmetric4")
    record = simulate(Static(77.0), Site(40.0), 20.0).record
    rng = np.random.default_rng(j)
    x = a.measure(record).dtheta + 1e-6 * rng.standard_normal((len(record), 4))
    quiet = isolate_by_rate(a, x, record.dtheta, 1e-6, 1e-6)
    assert quiet.sensor is None
    x = Fault(j, "step", 3e-5).apply(record.time, record.dt, x, 1e-6, rng)
    found = isolate_by_rate(a, x, record.dtheta, 1e-6, 1e-6)
    assert found.sensor == j
    assert found.size == pytest.approx(3e-7, abs=5 * 1e-6 / np.sqrt(len(x)))


def test_blame_by_rate_has_its_false_alarm_rate():
    a = named_array("symmetric4")
    rng = np.random.default_rng(12)
    runs = 4000
    hits = sum(
        isolate_by_rate(a, rng.standard_normal((4, 4)), np.zeros(3), 1.0, 0.02).sensor is not None
        for _ in range(runs)
    )
    # Bonferroni of four independent sensors: 1 - (1 - 0.005)^4.
    assert binomtest(hits, runs, 1 - (1 - 0.005) ** 4).pvalue > BAND


def test_threshold_is_chi_square_s():
    t = ParityTest(named_array("dodecahedron"), 1.0, 0.01)
    assert chi2.sf(t.threshold, 3) == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Fault(0, "loose"), "must be one of"),
        (lambda: Fault(0, "step", 1.0, 5.0, 2.0), "later end"),
        (lambda: ParityTest(named_array("cone5"), 0.0), "must be positive"),
        (lambda: ParityTest(named_array("cone5"), 1.0, 0.7), "0 to 0.5"),
        (lambda: ParityTest(named_array("cone5"), 1.0, window=0), "one sample or more"),
        (
            lambda: ParityTest(named_array("triad-plus-one"), 1.0).smallest_fault(0),
            "does not enter",
        ),
        (lambda: FaultMonitor(ParityTest(named_array("cone5"), 1.0), 0), "one window or more"),
        (lambda: data(named_array("cone5"), Fault(7, "step", 1.0)), "sensor 7"),
    ],
)
def test_bad_faults_are_said(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()
