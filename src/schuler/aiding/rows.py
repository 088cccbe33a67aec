"""What the aids that are tables of rows share: which rows can be used, and in which order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

__all__ = ["checked_lever", "checked_rows"]

Array = NDArray[np.float64]

_LARGEST = 1e6
"""A sigma beyond this is that of no measurement."""

_MOST_LEVER = 100.0


def checked_lever(lever: ArrayLike, name: str) -> Array:
    """Return a lever arm as an array.

    Raises
    ------
    InputError
        If it has not three finite numbers of at most 100 m.
    """
    out = np.asarray(lever, np.float64)
    if out.shape != (3,) or not np.all(np.isfinite(out)) or np.abs(out).max() > _MOST_LEVER:
        raise InputError(f"{name}: a lever arm has three numbers of at most 100 m, got {lever!r}")
    return out


def checked_rows(
    name: str, time: ArrayLike, columns: Mapping[str, ArrayLike], sigma: ArrayLike, width: int,
    dropped: Mapping[str, int], valid: ArrayLike | None = None,
) -> tuple[Array, dict[str, Array], Array, dict[str, int]]:  # fmt: skip
    """Return sorted rows that can be used, with their sigma, and the count of others by reason.

    Parameters
    ----------
    name : str
        Of the aid.
    time : (n,) array_like
    columns : mapping of str to (n,) or (n, width) array_like
        What must be finite.
    sigma : float, (n,) or (n, width) array_like
    width : int
        Numbers of a row: 1 or 3.
    dropped : mapping of str to int
        What a reader has left out already.
    valid : (n,) array_like, optional
        Zero where the instrument calls its value none.

    Raises
    ------
    InputError
        For arrays of other shapes, or if no row is left.
    """
    t = np.asarray(time, np.float64)
    if t.ndim != 1 or not len(t):
        raise InputError(f"{name}: times must be a row of numbers, got shape {t.shape}")
    n = len(t)
    shape = (n,) if width == 1 else (n, width)
    out = {key: np.asarray(value, np.float64) for key, value in columns.items()}
    for key, value in out.items():
        if value.shape != shape:
            raise InputError(f"{name}: {key} must be of shape {shape}, got {value.shape}")
    spread = np.asarray(sigma, np.float64)
    if width > 1 and spread.shape == (n,) and n != width:
        spread = spread[:, None]
    try:
        spread = np.array(np.broadcast_to(spread, shape))
    except ValueError:
        raise InputError(
            f"{name}: sigma must be a number or of shape {shape}, got {spread.shape}"
        ) from None
    counts = dict(dropped)
    flat = spread.reshape(n, -1)
    finite = np.isfinite(t) & np.all(np.isfinite(flat), axis=1)
    for value in out.values():
        finite &= np.all(np.isfinite(value.reshape(n, -1)), axis=1)
    keep = finite.copy()
    _count(counts, "a value that is no number", ~finite)
    if valid is not None:
        bad = keep & ~(np.nan_to_num(np.asarray(valid, np.float64)) > 0.0)
        _count(counts, "the instrument's mark of no value", bad)
        keep &= ~bad
    bad = keep & (np.any(flat <= 0.0, axis=1) | np.any(flat > _LARGEST, axis=1))
    _count(counts, "a sigma of nothing or without bound", bad)
    order = np.flatnonzero(keep & ~bad)
    order = order[np.argsort(t[order], kind="stable")]
    first = np.diff(t[order], prepend=-np.inf) > 0.0
    _count(counts, "a time that repeats", ~first)
    order = order[first]
    if not len(order):
        said = ", ".join(f"{count} with {reason}" for reason, count in counts.items())
        raise InputError(f"{name}: no usable row of {n}{': ' + said if said else ''}")
    return t[order], {key: value[order] for key, value in out.items()}, spread[order], counts


def _count(counts: dict[str, int], reason: str, which: NDArray[np.bool_]) -> None:
    count = int(np.sum(which))
    if count:
        counts[reason] = counts.get(reason, 0) + count
