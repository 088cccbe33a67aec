"""The parity test over a record: rates, isolation, exclusion, re-inclusion, delays."""

from __future__ import annotations

import json

import numpy as np
import pytest

from schuler.constants import DEG_PER_HOUR
from schuler.errors import InputError
from schuler.sensors import ArrayFigures, Lifetime, Reliability, named_array, scan_faults
from tests.test_docs import schema

DT, SIGMA = 0.01, 1e-7


def record(name, seconds, rng, fault=None, bias=True):
    """Increments of gyros with biases and noise; fault (gyro, deg/h, start, end)."""
    array = named_array(name)
    n = round(seconds / DT)
    t = DT * np.arange(1, n + 1)
    rate = np.array([0.3, -0.2, 0.1]) * np.sin(0.5 * t)[:, None]
    m = rate * DT @ array.h.T + SIGMA * rng.standard_normal((n, len(array)))
    if bias:
        m += 0.5 * DEG_PER_HOUR * DT * rng.standard_normal(len(array))
    if fault is not None:
        gyro, size, start, end = fault
        m[(t > start) & (t <= end), gyro] += size * DEG_PER_HOUR * DT
    return array, t, m


def test_false_alarms_come_as_often_as_said(rng):
    """4,000 windows at 1 %: within four deviations of 40."""
    array, t, m = record("cone5", 4060.0, rng)
    found = scan_faults(array, t, m, DT, false_alarm=0.01, reference=60.0, heal=1)
    above = int(np.sum(found.statistic[60:] > found.test.threshold))
    assert abs(above - 40) < 4 * 40**0.5 + 6  # and the bias of the reference itself


@pytest.mark.parametrize("gyro", range(5))
def test_a_fault_is_isolated_excluded_and_taken_back(gyro, rng):
    array, t, m = record("cone5", 300.0, rng, (gyro, 8.0, 120.5, 200.0))
    found = scan_faults(array, t, m, DT)
    first, last = found.events
    assert (first.action, first.gyro) == ("excluded", gyro + 1)
    assert 120.5 < first.time <= 122.0
    assert first.onset == pytest.approx(120.5, abs=0.3)
    assert first.delay == pytest.approx(first.time - 120.5, abs=0.3)
    assert (last.action, last.gyro) == ("taken back", gyro + 1)
    assert 210.0 <= last.time <= 213.0
    assert found.working == (1, 2, 3, 4, 5)


def test_four_gyros_detect_and_do_not_blame(rng):
    array, t, m = record("symmetric4", 200.0, rng, (2, 2.0, 100.0, 200.0))
    found = scan_faults(array, t, m, DT)
    assert [(e.action, e.gyro) for e in found.events] == [("detected", None)]
    assert found.events[0].onset == pytest.approx(100.0, abs=0.3)
    assert found.working == (1, 2, 3, 4)
    assert "isolation needs five" in str(found)


def test_miss_rate_is_the_one_said(rng):
    """At the smallest fault said, one window of a hundred misses: 600 windows, 4 deviations."""
    array, t, m = record("cone5", 700.0, rng)
    quiet = scan_faults(array, t, m, DT, sigma=SIGMA, reference=90.0)
    size = quiet.smallest_fault(2) / DEG_PER_HOUR
    # The reference stays clean.
    m[(t > 100.0), 1] += size * DEG_PER_HOUR * DT
    found = scan_faults(array, t, m, DT, sigma=SIGMA, reference=90.0)
    missed = int(np.sum(found.statistic[100:] <= found.test.threshold))
    assert missed < 6 + 4 * 6**0.5 + 6


def test_json_table_and_text_say_the_same(rng, tmp_path):
    array, t, m = record("dodecahedron", 200.0, rng, (0, 5.0, 100.0, 130.0))
    found = scan_faults(array, t, m, DT)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    schema("array-faults").validate(data)
    assert data["isolable"] is True
    assert [e["action"] for e in data["events"]] == list(found.to_pandas()["action"])
    assert "false alarms 0.0001 a window" in str(found)
    pytest.importorskip("plotly")
    from schuler.reports import report

    report(found, tmp_path / "f.html")
    assert "What the test finds" in (tmp_path / "f.html").read_text(encoding="utf-8")


def test_working_modes_have_their_determinants():
    for name in ("symmetric4", "cone4"):
        figures = ArrayFigures(named_array(name), Reliability(named_array(name), Lifetime(5000.0)))
        sizes = figures.to_dict()["subset_determinant"]
        assert all(v == pytest.approx(0.7698, abs=1e-4) for k, v in sizes.items() if len(k) == 5)
        assert sizes["0,1,2,3"] == pytest.approx((4.0 / 3.0) ** 1.5)
        assert "0.7698" in str(figures)
        assert figures.to_pandas().loc["0,1,2", "determinant"] == pytest.approx(0.7698, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"array": named_array("triad")}, "no parity"),
        ({"dtheta": np.zeros((500, 3))}, "increments of 5 gyros"),
        ({"dtheta": np.full((500, 5), np.nan)}, "finite"),
        ({"dtheta": np.zeros((500, 5))}, "agree exactly"),
        ({"interval": 0.0}, "positive"),
        ({"window": 1e-4}, "one sample or more"),
        ({"reference": 0.1}, "--reference"),
        ({"reference": 60.0}, "longer record"),
    ],
)
def test_bad_input_is_one_sentence(change, said, rng):
    given = {
        "array": named_array("cone5"), "time": DT * np.arange(1, 501),
        "dtheta": rng.standard_normal((500, 5)), "interval": DT, "reference": 2.0,
    } | change  # fmt: skip
    with pytest.raises(InputError, match=said):
        scan_faults(**given)
