"""Measurements that come late: the bits of those in time, in memory that does not grow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.ins import Velocity

from .test_filter import drive, everything, fixes, made_filter, piece, with_noise

__all__ = ["drive"]


def one(aid, k):
    """Return one measurement of an aid."""
    return replace(aid, time=np.asarray(aid.time)[k : k + 1], value=np.asarray(aid.value)[k])


def streamed(made, record, aids, rng, latency, **options):
    """Return a filter that took random chunks, and measurements late by up to 1.5 s, and memory."""
    f = made_filter(
        made, [replace(a, time=[], value=0.0) for a in aids], max_latency=latency, **options
    )
    waiting = sorted(
        ((float(t) + rng.uniform(0.0, 1.5), n, k) for n, aid in enumerate(aids)
         for k, t in enumerate(np.asarray(aid.time))),
    )  # fmt: skip
    at, kept, late = 0, [], 0
    while at < len(record):
        end = min(at + int(rng.integers(1, 25)), len(record))
        f.update(piece(record, at, end))
        at = end
        while waiting and waiting[0][0] <= f.time + 1e-9:
            _, n, k = waiting.pop(0)
            late += float(np.asarray(aids[n].time)[k]) <= f.time
            f.add(one(aids[n], k))
        kept.append(f.latency_bytes)
    # What has not come yet at the end of the record.
    for _, n, k in waiting:
        f.add(one(aids[n], k))
    assert late > 100
    return f, np.array(kept)


@pytest.mark.compiled
@pytest.mark.parametrize("seed", [1, 2])
def test_late_measurements_give_the_bits_of_those_in_time(drive, seed):
    record, _ = with_noise(drive, np.random.default_rng(1))
    rng = np.random.default_rng(seed)
    position, velocity = fixes(drive, np.random.default_rng(2))
    # Between samples, and two aids of one instant.
    velocity = replace(velocity, time=np.asarray(velocity.time) + 0.0073, delay=0.0073)
    weak = Velocity(position.time, np.zeros((len(position.time), 3)), 1e3, name="weak")
    aids = [position, velocity, weak]
    whole = made_filter(drive, aids, smooth=True, budget=True).update(record)
    f, _ = streamed(drive, record, aids, rng, 2.0, smooth=True, budget=True)
    assert f.samples == whole.samples
    mine, other = everything(whole), everything(f)
    for name, value in mine.items():
        np.testing.assert_array_equal(value, other[name], err_msg=name)
    for aid in ("position", "velocity", "weak"):
        for a, b in zip(whole.innovations(aid), f.innovations(aid), strict=True):
            np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(whole.smoothed().error, f.smoothed().error)


def test_memory_for_late_measurements_does_not_grow(drive):
    record, _ = with_noise(drive, np.random.default_rng(1))
    aids = fixes(drive, np.random.default_rng(2))
    _, kept = streamed(drive, record, aids, np.random.default_rng(3), 2.0, keep_history=False)
    third = len(kept) // 3
    assert kept[2 * third :].max() < 1.1 * kept[third : 2 * third].max()
    assert kept.max() < 300_000
    assert made_filter(drive, aids).update(record).latency_bytes == 0
    # A whole record at once keeps no more.
    at_once = made_filter(drive, aids, max_latency=2.0).update(record)
    assert 0 < at_once.latency_bytes < 300_000


def test_what_comes_too_late_is_refused_and_changes_nothing(drive):
    record, _ = with_noise(drive, np.random.default_rng(1))
    position, _ = fixes(drive, np.random.default_rng(2))
    f = made_filter(drive, [replace(position, time=[], value=0.0)], max_latency=2.0)
    f.update(piece(record, 0, 1000))
    before = everything(f)
    k = int(np.searchsorted(position.time, 17.0))
    with pytest.raises(InputError, match=r"comes 2\.\d+ s late, .* takes 2 s"):
        f.add(one(position, k))
    for name, value in before.items():
        np.testing.assert_array_equal(value, everything(f)[name], err_msg=name)
    f.add(one(position, k + 5))
    assert len(f.innovations("position")[0]) == 1
    # The first instants have no time before the record.
    g = made_filter(drive, [replace(position, time=[], value=0.0)], max_latency=2.0)
    g.update(piece(record, 0, 50))
    with pytest.raises(InputError, match="before the record"):
        g.add(replace(one(position, 0), time=[-0.5]))
    # One that resumes keeps nothing of what was before.
    h = made_filter(drive, [replace(position, time=[], value=0.0)], max_latency=2.0)
    h.restore(f.arrays())
    with pytest.raises(InputError, match="late"):
        h.add(one(position, k + 5))


@pytest.mark.parametrize("latency", [-1.0, np.inf, np.nan])
def test_a_latency_is_a_time(drive, latency):
    with pytest.raises(InputError, match="a latency must be a time"):
        made_filter(drive, [], max_latency=latency)
