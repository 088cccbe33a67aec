"""When an instrument lies still: dwells of a record that was put down or turned in between."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

__all__ = ["find_rests"]

Index = NDArray[np.int64]


def find_rests(
    time: ArrayLike, accel: ArrayLike, gyro: ArrayLike | None = None, *, window: float = 0.4,
    initial: float = 1.0, factor: float = 5.0, shortest: float = 1.0,
) -> Index:  # fmt: skip
    """Find when an instrument lies still: the variance over a window stays small.

    Parameters
    ----------
    time : (n,) array_like
        s.
    accel : (n, 3) array_like
        In any unit.
    gyro : (n, 3) array_like, optional
        In any unit; a turn about the vertical is seen by the gyros only.
    window : float
        Length of the moving variance, s.
    initial : float
        The instrument is known to lie still for so long at the start, s.
    factor : float
        So many times the deviation of then is still rest.
    shortest : float
        A dwell lasts so long at least, s.

    Returns
    -------
    (m, 2) int64
        First sample of each dwell, and the one after its last.

    Raises
    ------
    InputError
        If the record is too short, or does not begin at rest.

    Examples
    --------
    >>> time, rng = np.arange(0.0, 20.0, 0.01), np.random.default_rng(1)
    >>> accel = rng.normal(0.0, 0.01, (2000, 3)) + [0.0, 0.0, 9.8]
    >>> accel[900:1100] += np.sin(20.0 * time[900:1100])[:, None]
    >>> len(find_rests(time, accel))
    2
    """
    t, f = np.asarray(time, np.float64), np.asarray(accel, np.float64)
    step = float(np.median(np.diff(t))) if len(t) > 2 else np.inf
    half = max(1, round(0.5 * window / step)) if np.isfinite(step) and step > 0 else 0
    if half == 0 or t[-1] - t[0] < initial + shortest:
        raise InputError(
            f"the record is too short to find poses: it needs {initial:g} s of rest and a pose more"
        )
    a = np.clip(np.arange(len(t)) - half, 0, None)
    b = np.clip(np.arange(len(t)) + half + 1, None, len(t))
    begin = t - t[0] < initial
    still = np.ones(len(t), dtype=bool)
    for x in (f,) if gyro is None else (f, np.asarray(gyro, np.float64)):
        centred = x - x[begin].mean(axis=0)
        sums = np.vstack([np.zeros((1, 3)), np.cumsum(centred, axis=0)])
        squares = np.vstack([np.zeros((1, 3)), np.cumsum(centred**2, axis=0)])
        n = (b - a)[:, None]
        mean = (sums[b] - sums[a]) / n
        variance = np.sum((squares[b] - squares[a]) / n - mean**2, axis=1)
        rest = max(float(np.median(variance[begin])), np.finfo(float).tiny)
        still &= variance < factor**2 * rest
        if x is not f:
            # A steady turn about the vertical moves no force, and has no variance.
            still &= np.sum(mean**2, axis=1) < factor**2 * rest
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.view(np.int8), [0]])))
    dwells = edges.reshape(-1, 2)
    # The window reaches over the edges: still there means still half a window further.
    inside = t[dwells[:, 1] - 1] - t[dwells[:, 0]] + 2 * half * step
    long_enough = inside >= 0.95 * shortest
    found = dwells[long_enough]
    if not len(found) or found[0, 0] > half:
        raise InputError(
            f"the record does not begin with {initial:g} s of rest, by which the poses are found "
            "(--initial)"
        )
    return found.astype(np.int64)
