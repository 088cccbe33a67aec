"""The page of an aided navigation: what is drawn across gaps, and progress on the way."""

from __future__ import annotations

import numpy as np

from schuler.navigation import navigate_aided
from schuler.reports.aided import _biases, _innovations, _with_breaks
from tests.navigation.test_aided import QUIET, SPEC, drive


def test_innovations_are_not_drawn_across_gaps() -> None:
    made, gnss = drive(4)
    time = np.asarray(gnss.time)
    found = navigate_aided(
        made.record, gnss.rows((time < 80.0) | (time > 100.0)), spec=SPEC, options=QUIET
    )
    line = _innovations(found, "gnss").figure.data[0]
    broken = np.flatnonzero(np.isnan(line["y"]))
    assert len(broken) == 1
    assert line["x"][broken[0] - 1] < 80.0 < 100.0 < line["x"][broken[0] + 1]


def test_biases_and_their_sigma_are_drawn_as_they_converge() -> None:
    made, gnss = drive(4)
    found = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    drawn = _biases(found)
    assert len(drawn) == 6
    for axis in range(3):
        band, line = drawn[3 + axis].figure.data
        half = len(band["y"]) // 2
        width = np.asarray(band["y"])[:half] - np.asarray(band["y"])[half:][::-1]
        assert width[-1] < 0.5 * width[0]
        value, sigma = (np.array(x)[axis] for x in found.estimated["accel_bias_ug"])
        np.testing.assert_allclose(line["y"][-1], value, rtol=1e-6)
        np.testing.assert_allclose(width[-1], 6.0 * sigma, rtol=1e-3)


def test_a_gap_is_kept_where_points_are_left_out() -> None:
    time = np.concatenate([np.arange(0.0, 1000.0), np.arange(1500.0, 2500.0)])
    k = np.unique(np.linspace(0, len(time) - 1, 50).astype(np.int64))
    t, y = _with_breaks(time, np.ones(len(time)), k)
    assert np.sum(np.isnan(y)) == 1
    at = int(np.argmax(np.isnan(y)))
    assert t[at - 1] < 1000.0 < 1499.0 < t[at + 1]
    assert np.all(np.diff(t) >= 0.0)


def test_a_watcher_hears_how_far_it_is(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    import schuler.navigation.aided as module

    made, gnss = drive(4, length=60.0)
    whole = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)
    monkeypatch.setattr(module, "_WATCHED", 1000)
    heard: list[float] = []
    found = navigate_aided(made.record, gnss, spec=SPEC, options=QUIET, watch=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == 1.0
    assert len(heard) > 4
    np.testing.assert_array_equal(found.path.position, whole.path.position)
