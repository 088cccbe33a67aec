"""Windows: each as if cut out by hand, however the chunks fall."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.alignment import align, align_windows
from schuler.errors import InputError
from tests.alignment.conftest import SITE
from tests.conftest import pieces


def test_each_window_is_the_record_between(truck):
    w = align_windows(truck.record, SITE, 30.0)
    assert [(x.start, x.end) for x in w.each] == [
        pytest.approx((a, a + 30.0)) for a in (0.0, 30.0, 60.0)
    ]
    for k, x in enumerate(w.each):
        alone = align(truck.record.between(30.0 * k, 30.0 * (k + 1)), SITE)
        assert np.array_equal(x.quat_nb, alone.quat_nb)
        assert np.array_equal(x.covariance, alone.covariance)
    assert np.array_equal(w.whole.quat_nb, align(truck.record, SITE).quat_nb)


@settings(max_examples=15)
@given(st.lists(st.integers(0, 10_000), max_size=8))
def test_chunking_does_not_matter(truck, cuts):
    whole = align_windows(truck.record, SITE, 20.0)
    chunks = (truck.record.rows(s.start, s.stop) for s in pieces(len(truck.record), cuts))
    part = align_windows(chunks, SITE, 20.0)
    assert part.to_dict() == whole.to_dict()


@pytest.mark.slow
def test_several_processes_give_the_same_bits(truck, monkeypatch):
    monkeypatch.setattr("schuler.alignment.windows._ALONE", 2)
    alone = align_windows(truck.record, SITE, 10.0)
    shared = align_windows(truck.record, SITE, 10.0, workers=2)
    assert len(shared.each) == len(alone.each) > 4
    for x, y in zip(alone.each, shared.each, strict=True):
        assert np.array_equal(x.quat_nb, y.quat_nb)
        assert np.array_equal(x.covariance, y.covariance)
        assert x.warnings == y.warnings
    # Kalman filters run over the same sums.
    filtered = align_windows(truck.record, SITE, 20.0, "kalman", workers=2)
    assert filtered.to_dict() == align_windows(truck.record, SITE, 20.0, "kalman").to_dict()


def test_statistics_wrap_around_north(truck):
    from dataclasses import replace

    from schuler.alignment import Windows
    from schuler.attitude import euler_to_quat

    fix = align(truck.record, SITE)
    each = tuple(
        replace(fix, quat_nb=euler_to_quat([-np.deg2rad(h), 0.0, 0.0]))
        for h in (359.9, 0.1, 359.95, 0.05)
    )
    w = Windows(fix, 20.0, each)
    assert (w.mean_heading_deg + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-9)
    off = np.array([-0.1, 0.1, -0.05, 0.05])
    assert w.std_heading_arcmin == pytest.approx(60 * off.std(ddof=1))
    assert Windows(fix, 20.0, each[:1]).std_heading_arcmin is None


@pytest.mark.parametrize(
    ("length", "words"),
    [(0.0, "positive time"), (-1.0, "positive time"), (1e4, "no window is full")],
)
def test_refusals(truck, length, words):
    with pytest.raises(InputError, match=words):
        align_windows(truck.record, SITE, length)
    with pytest.raises(InputError, match="no samples"):
        align_windows([], SITE, 10.0)
