"""Dwells and turns of a table in a record: by the times of a sequence, or found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schuler.calibration.rests import find_rests
from schuler.calibration.table_sequence import Position, RateTurn
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["TOO_FAR", "dwells_of", "nearest_directions", "turn_stretches"]

Array = NDArray[np.float64]

TOO_FAR = 15.0 * DEG
"""A force is not that of a position so far from it."""

_BLOCK = 0.5
_SHORTEST = 2.0


def dwells_of(
    records: Sequence[ImuRecord], given: list[Position] | None, count: int, initial: float
) -> list[ImuRecord]:
    """Return the dwells: records of one each, those at a sequence's times, or those that are found.

    Raises
    ------
    InputError
        If there are not as many as the positions, or a time holds no samples.
    """
    if given is not None and any(p.start is not None for p in given):
        if len(records) != 1 or any(p.start is None or p.stop is None for p in given):
            raise InputError(
                "a sequence with times is for one record, and needs start and stop of each position"
            )
        return [_between(records[0], p.start, p.stop, f"position {k}")
                for k, p in enumerate(given, 1)]  # fmt: skip
    if len(records) == 1:
        r = records[0]
        rests = find_rests(r.time, r.accel, r.gyro, initial=initial)
        found = [r.rows(int(a), int(b)) for a, b in rests]
    else:
        found = list(records)
    if len(found) != count:
        raise InputError(
            f"found {len(found)} dwells, but {count} positions were asked for: say their times in "
            "a sequence, give one file for each dwell, or --positions"
        )
    return found


def _between(record: ImuRecord, start: float | None, stop: float | None, what: str) -> ImuRecord:
    part = record.between(start, stop)
    if len(part) < 10:
        raise InputError(f"{what}: {start} to {stop} s holds {len(part)} samples of the record")
    return part


def nearest_directions(force: Array, known: Array) -> Array:
    """Return which direction of a scheme each force is along, each as often as it has it."""
    unit = force / np.linalg.norm(force, axis=1)[:, None]
    directions, times = np.unique(np.round(known, 12), axis=0, return_counts=True)
    cosine = unit @ directions.T
    nearest = cosine.argmax(axis=1)
    far = np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0))
    if far.max() > TOO_FAR:
        k = int(far.argmax())
        raise InputError(
            f"dwell {k + 1}: its force is {far[k] / DEG:.0f} deg from any position of this scheme; "
            "say where the table was with a sequence"
        )
    seen = np.bincount(nearest, minlength=len(directions))
    if not np.array_equal(seen, times):
        k = int(np.argmax(np.abs(seen - times)))
        axis = ", ".join(f"{v:.2g}" for v in directions[k])
        raise InputError(
            f"{seen[k]} dwell(s) have up along ({axis}), where this scheme has {times[k]}"
        )
    return np.asarray(directions[nearest])


def turn_stretches(record: ImuRecord, turns: Sequence[RateTurn]) -> list[tuple[float, float]]:
    """Return begin and end of each turn, s, where the rate is constant.

    Raises
    ------
    InputError
        If there are not as many as in the sequence.
    """
    if any(t.start is not None for t in turns):
        if any(t.start is None or t.stop is None for t in turns):
            raise InputError("a sequence with times needs start and stop of every turn")
        return [(float(t.start or 0.0), float(t.stop or 0.0)) for t in turns]
    least = 0.5 * min(abs(t.rate) for t in turns)
    each = max(2, round(_BLOCK / float(np.median(record.dt))))
    k = len(record) // each
    mean = record.gyro[: k * each].reshape(k, each, 3).mean(axis=1)
    ends = record.time[each - 1 :: each][:k]
    size = np.linalg.norm(mean, axis=1)
    same = np.linalg.norm(np.diff(mean, axis=0), axis=1) < 0.01 * np.maximum(size[1:], least)
    found: list[tuple[float, float]] = []
    a = 0
    for i in range(1, k + 1):
        if i < k and same[i - 1]:
            continue
        length = ends[i - 1] - ends[a]
        if size[a] > least and length >= _SHORTEST:
            # The first block and the last may hold a part of the table's speeding up.
            found.append((float(ends[a]), float(ends[i - 1] - _BLOCK)))
        a = i
    if len(found) != len(turns):
        raise InputError(
            f"found {len(found)} stretches of constant rate, but the sequence has {len(turns)} "
            "turns: give start and stop of each"
        )
    return found
