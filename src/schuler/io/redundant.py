"""The gyros of an array as they came, one column each, before any are fused."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.io.source import Source

__all__ = ["array_increments"]

Array = NDArray[np.float64]


def array_increments(source: Source) -> tuple[Array, Array, float]:
    r"""Return an array's gyros over a whole file, for tests of one against the others.

    Parameters
    ----------
    source : Source
        Opened with ``array`` in its mapping.

    Returns
    -------
    (n,) float64, (n, m) float64, float
        Times, s; increments of each gyro, rad (rates times the interval, where the file has
        rates); the interval of a sample, s.

    Raises
    ------
    InputError
        If no array was named, a value is not a finite number, or the time does not go on.

    Examples
    --------
    >>> from pathlib import Path
    >>> rows = "\n".join(f"{0.1 * k:.1f},0,0,0,1e-6,0,0,0.98" for k in range(20))
    >>> length = Path("array.csv").write_text("t,g1,g2,g3,g4,ax,ay,az\n" + rows)
    >>> source = sc.open_source("array.csv", array="symmetric4", gyro="rad", accel="m/s")
    >>> time, dtheta, interval = array_increments(source)
    >>> dtheta.shape, round(interval, 3)
    ((20, 4), 0.1)
    """
    times, gyros = [], []
    for time, values in source.array_blocks():
        times.append(time)
        gyros.append(values)
    if not times:
        raise InputError(f"{source.path}: holds no rows")
    t, m = np.concatenate(times), np.concatenate(gyros)
    bad = np.flatnonzero(~(np.isfinite(m).all(axis=1) & np.isfinite(t)))
    if bad.size:
        raise InputError(
            f"{source.path}: row {bad[0] + 1} (t = {t[bad[0]]:g} s) has a gyro whose value is not "
            "a finite number"
        )
    if len(t) < 2 or not (np.diff(t) > 0.0).all():
        raise InputError(f"{source.path}: the time of its rows must rise, over two rows or more")
    interval = float(np.median(np.diff(t)))
    return t, m if source.kind == "increments" else interval * m, interval
