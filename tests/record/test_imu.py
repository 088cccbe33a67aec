"""`ImuRecord`: looking at it and cutting it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.errors import InputError
from schuler.record import ImuRecord


def make(n=100, dt=0.01, start=5.0):
    """Return a record whose samples know their number."""
    number = np.arange(n, dtype=float)
    return ImuRecord(
        time=start + dt * (number + 1),
        dt=np.full(n, dt),
        dtheta=np.column_stack([number, -number, 2 * number]),
        dvel=np.column_stack([3 * number, number, number]),
        name="numbered",
    )


def test_face():
    record = make()
    assert len(record) == 100
    assert record.start == pytest.approx(5.0)
    assert record.end == pytest.approx(6.0)
    assert record.duration == pytest.approx(1.0)
    assert record.rate == pytest.approx(100.0)
    np.testing.assert_allclose(record.gyro, record.dtheta * 100.0, rtol=1e-15)
    np.testing.assert_allclose(record.accel, record.dvel * 100.0, rtol=1e-15)
    assert repr(record) == "ImuRecord('numbered', 100 samples, 5.000 to 6.000 s, 100 Hz)"
    assert repr(record.rows(0, 0)) == "ImuRecord('numbered', empty)"


def test_redundant_arrays_are_welcome():
    n = 7
    record = ImuRecord(np.arange(1.0, n + 1), np.ones(n), np.zeros((n, 6)), np.zeros((n, 4)))
    assert record.gyro.shape == (n, 6)
    assert record.accel.shape == (n, 4)


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("dt", np.ones(3), "ImuRecord: expected dt with 1 dimension(s) and 4 rows, got shape (3,)"),
        ("dtheta", np.ones(4), "ImuRecord: expected dtheta with 2 dimension(s) and 4 rows, got"),
        ("dvel", np.ones((5, 3)), "ImuRecord: expected dvel with 2 dimension(s) and 4 rows, got"),
        ("time", np.ones((4, 1)), "ImuRecord: expected time with 1 dimension(s) and 4 rows, got"),
    ],
)
def test_shapes_are_checked(field, value, sentence):
    fields = {
        "time": np.arange(4.0),
        "dt": np.ones(4),
        "dtheta": np.ones((4, 3)),
        "dvel": np.ones((4, 3)),
    }
    with pytest.raises(InputError) as error:
        ImuRecord(**{**fields, field: value})
    assert str(error.value).startswith(sentence)


def test_rows_is_a_view():
    record = make()
    part = record.rows(10, 20)
    assert len(part) == 10
    assert np.shares_memory(part.dtheta, record.dtheta)
    assert part.dtheta[0, 0] == 10
    assert part.name == "numbered"
    assert len(record.rows(-5, 1000)) == 5


@pytest.mark.parametrize(
    ("start", "stop", "first", "last"),
    [
        (None, None, 0, 99),
        (5.2, None, 20, 99),
        (None, 5.2, 0, 19),
        (5.2, 5.5, 20, 49),
        (5.204, 5.504, 20, 49),  # a sample goes where its middle lies
        (5.206, 5.506, 21, 50),
    ],
)
def test_between(start, stop, first, last):
    part = make().between(start, stop)
    assert (part.dtheta[0, 0], part.dtheta[-1, 0]) == (first, last)


def test_a_middle_on_the_cut_belongs_to_the_earlier_stretch():
    record = make(10, dt=1.0, start=0.0)
    np.testing.assert_array_equal(record.between(None, 2.5).dtheta[:, 0], [0, 1, 2])
    np.testing.assert_array_equal(record.between(2.5, 4.5).dtheta[:, 0], [3, 4])
    np.testing.assert_array_equal(record.after(8.5).dtheta[:, 0], [9])


def test_between_nothing():
    record = make()
    assert len(record.between(7.0, 8.0)) == 0
    assert len(record.between(5.5, 5.5)) == 0
    assert len(record.after(6.0)) == 0
    assert len(record.after(0.0)) == 100


@given(st.lists(st.floats(4.9, 6.1), min_size=1, max_size=5))
def test_consecutive_stretches_share_no_sample_and_lose_none(cuts):
    record = make()
    edges = [None, *sorted(cuts), None]
    parts = [record.between(a, b) for a, b in pairwise(edges)]
    joined = np.concatenate([p.dtheta[:, 0] for p in parts])
    np.testing.assert_array_equal(joined, np.arange(100.0))


@given(st.integers(1, 150))
def test_chunks_cover_the_record(size):
    record = make()
    parts = list(record.chunks(size))
    assert all(len(p) == size for p in parts[:-1])
    joined = ImuRecord.concatenate(parts)
    for field in ("time", "dt", "dtheta", "dvel"):
        np.testing.assert_array_equal(getattr(joined, field), getattr(record, field))
    assert joined.name == record.name


def test_chunk_size_must_be_positive():
    with pytest.raises(InputError, match="chunk size must be at least 1, got 0"):
        next(make().chunks(0))


def test_nothing_cannot_be_joined():
    with pytest.raises(InputError, match="the record has no samples"):
        ImuRecord.concatenate([])


def test_a_record_is_frozen():
    with pytest.raises(AttributeError):
        make().name = "other"
