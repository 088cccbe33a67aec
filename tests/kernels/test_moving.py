"""The pass behind an alignment in motion: any chunking, instants between samples, integrals."""

import numpy as np
import pytest

from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.errors import InputError
from schuler.in_motion.body import BodyPass, body_rows
from schuler.record import ImuRecord
from tests.conftest import pieces

FIELDS = ("time", "mat_ib0_b", "velocity", "way", "turn", "rate")


def record(n=400, step=0.01, seed=1):
    """Rates and forces that change smoothly."""
    rng = np.random.default_rng(seed)
    t = step * np.arange(1, n + 1)
    phase = rng.uniform(0, 6, 6)
    waves = np.sin(t[:, None] * np.array([1.0, 1.7, 0.6, 2.0, 1.1, 0.8]) + phase)
    return ImuRecord(t, np.full(n, step), step * waves[:, :3], step * (waves[:, 3:] + 9.0))


@pytest.mark.parametrize("cuts", [(1,), (1, 2, 77, 77, 399), tuple(range(0, 400, 7))])
def test_any_chunking_gives_the_same_bits(cuts):
    whole = record()
    due = np.array([0.0, 0.005, 0.01, 0.77, 1.234567, 3.99, 4.0, 5.0])
    straight = body_rows(whole, due)
    step = BodyPass(due)
    for part in pieces(len(whole), cuts):
        step.update(whole.rows(part.start, part.stop))
    again = step.rows()
    assert len(straight) == 7  # the last instant lies behind the record
    for name in FIELDS:
        assert np.array_equal(getattr(straight, name), getattr(again, name)), name


def test_rows_may_be_asked_for_before_the_end():
    whole = record()
    step = BodyPass([1.0, 2.0, 3.0]).update(whole.rows(0, 250))
    assert list(step.rows().time) == [1.0, 2.0]
    rows = step.update(whole.rows(250, 400)).rows()
    assert np.array_equal(rows.velocity, body_rows(whole, [1.0, 2.0, 3.0]).velocity)


def test_a_turntable_under_constant_force_has_closed_forms():
    """Rate w about up, force f forward and g up: velocity, way and the matrix are sines."""
    w, f, g, n, step = 0.5, 2.0, 9.8, 2000, 0.01
    t = step * np.arange(1, n + 1)
    turning = np.tile([0.0, 0.0, step * w], (n, 1))
    force = np.tile([0.0, step * f, step * g], (n, 1))
    rows = body_rows(ImuRecord(t, np.full(n, step), turning, force), t[99::100])
    a = w * rows.time
    s, c, zero = np.sin(a), np.cos(a), np.zeros_like(a)
    np.testing.assert_allclose(rows.velocity, np.column_stack(
        [-f * (1 - c) / w, f * s / w, g * rows.time]), atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(
        rows.way,
        np.column_stack([-f * (rows.time - s / w) / w, f * (1 - c) / w**2, 0.5 * g * rows.time**2]),
        atol=5e-4,
    )
    # The matrix is taken at the middle of each sample: its integral is good to step^2 / 24.
    turn = np.stack([
        np.stack([s / w, -(1 - c) / w, zero], -1), np.stack([(1 - c) / w, s / w, zero], -1),
        np.stack([zero, zero, rows.time], -1)], -2)  # fmt: skip
    np.testing.assert_allclose(rows.turn, turn, atol=1e-5)
    np.testing.assert_allclose(rows.rate, np.tile([0.0, 0.0, w], (len(rows), 1)), atol=1e-12)
    np.testing.assert_allclose(
        rows.mat_ib0_b, quat_to_matrix(rotvec_to_quat(np.column_stack([zero, zero, a]))), atol=1e-12
    )


def test_an_instant_inside_a_sample_lies_between_its_ends():
    rows = body_rows(record(), np.linspace(1.0, 1.01, 11))
    steps = np.diff(rows.velocity, axis=0)
    np.testing.assert_allclose(steps, np.tile(steps.mean(axis=0), (10, 1)), atol=1e-4)


def test_a_gap_backwards_is_refused():
    whole = record()
    step = BodyPass([1.0]).update(whole.rows(100, 200))
    with pytest.raises(InputError, match="not after the last sample"):
        step.update(whole.rows(50, 60))
    with pytest.raises(InputError, match="no samples"):
        BodyPass([1.0]).rows()
