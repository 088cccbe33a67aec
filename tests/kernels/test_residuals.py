"""Blocks of rows are learnt from as their rows would be, one after the other."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels import residuals, spikes

N = 640
KINDS = ("rest", "shaken", "rounded", "still then shaken")


def rows_of(kind):
    """Return rows of a record, and settings that were learnt from their begin."""
    rng = np.random.default_rng(KINDS.index(kind))
    rows = np.zeros((N, 11))
    rows[:, 0] = np.arange(N)
    rows[:, 1] = 0.01 * rows[:, 0]
    values = rng.normal(size=(N, 6)) * np.geomspace(1e-6, 1e-2, 6) + [0, 0, 0, 0.1, 0, 9.8]
    shaken = np.sin(2.0 * np.pi * 3.0 * rows[:, 1])[:, None] * np.geomspace(1e-3, 1.0, 6)
    if kind == "shaken":
        values += shaken
    elif kind == "still then shaken":
        values[N // 2 :] += shaken[N // 2 :]
    elif kind == "rounded":
        values = np.round(values / [1e-6, 1e-5, 1e-3, 1e-2, 1e-2, 0.5]) * [
            1e-6, 1e-5, 1e-3, 1e-2, 1e-2, 0.5,
        ]  # fmt: skip
    rows[:, 2:8] = values
    settings = np.zeros((6, residuals.SETTING))
    residuals.learn(rows, 256, settings, np.zeros(256))
    return rows, settings


def one_by_one(rows, settings, begin, end):
    """Learn row by row."""
    ways, limits = np.zeros(6, np.int64), np.zeros(6)
    for i in range(begin, end):
        residuals.update(rows, i, len(rows), settings, ways, limits)


@pytest.mark.parametrize("kind", KINDS)
def test_a_block_is_learnt_from_as_row_by_row(kind):
    rows, settings = rows_of(kind)
    before = rows.copy()
    other = settings.copy()
    work = np.zeros(spikes.WORK)
    for begin in range(16, N - 80, residuals.BLOCK):
        end = begin + residuals.BLOCK
        # What is learnt from lies `REACH` rows before what would be judged.
        found = residuals.look_over(rows, begin + 3, end + 3, settings, work)
        residuals.learn_rows(rows, begin, end, N, settings, found == residuals.QUIET, work)
        one_by_one(rows, other, begin, begin + residuals.BLOCK)
        np.testing.assert_allclose(settings, other, rtol=1e-12)
    np.testing.assert_array_equal(rows, before)


@pytest.mark.parametrize("kind", KINDS[:3])
@pytest.mark.parametrize("channel", range(6))
def test_a_block_with_a_spike_or_an_uneven_row_is_seen(kind, channel):
    rows, settings = rows_of(kind)
    work = np.zeros(spikes.WORK)
    begin, end = 320, 320 + residuals.BLOCK
    assert residuals.look_over(rows, begin, end, settings, work) != residuals.DOUBTFUL
    bad = rows.copy()
    bad[begin + 11, 2 + channel] += 1e3 * (1e-6 + np.ptp(rows[:, 2 + channel]))
    assert residuals.look_over(bad, begin, end, settings, work) == residuals.DOUBTFUL
    uneven = rows.copy()
    uneven[begin + 11, 10] = -1.0
    assert residuals.look_over(uneven, begin, end, settings, work) == residuals.DOUBTFUL
