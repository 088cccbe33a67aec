"""When a vehicle stood still, by the noise of its own sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["RestDetector", "Rests", "find_rest"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RestDetector:
    """How rest is told from motion.

    A window is at rest where its rates and forces scatter no more than `factor` times as much as in
    the quietest tenth of the record, and the mean rate stays within `rate` of that of these.

    Parameters
    ----------
    window : float
        s.
    factor : float
        Of the scatter in the quietest tenth of the record.
    rate : float
        rad/s.
    shortest : float
        A rest is at least so long, s.

    Examples
    --------
    >>> len(find_rest(drive, RestDetector(shortest=5.0)).spans)
    2
    """

    window: float = 0.5
    factor: float = 2.5
    rate: float = 0.01
    shortest: float = 1.0


@dataclass(frozen=True, eq=False)
class Rests:
    """Spans in which the vehicle stood still.

    Parameters
    ----------
    spans : (k, 2) float64
        Begin and end, s.
    window : float
        Length of the windows below, s.
    time : (m,) float64
        Ends of the windows at rest, s.
    rate : (m, 3) float64
        Mean measured rate of each, rad/s.
    rate_sigma : (3,) float64
        1-sigma of such a mean by the scatter of the samples, rad/s.
    """

    spans: Array
    window: float
    time: Array
    rate: Array
    rate_sigma: Array

    def holds(self, time: Array) -> NDArray[np.bool_]:
        """Return which times are within a rest."""
        inside = np.zeros(len(time), bool)
        for begin, end in self.spans:
            inside |= (time >= begin) & (time <= end)
        return inside


def find_rest(
    record: ImuRecord,
    detector: RestDetector | None = None,
    moving: tuple[Array, NDArray[np.bool_]] | None = None,
) -> Rests:
    """Find when a vehicle stood still.

    Parameters
    ----------
    record : ImuRecord
    detector : RestDetector, optional
    moving : ((n,), (n,)) float64, optional
        Times at which a speed was measured, and whether it was one beyond its noise: no window that
        holds such a time is a rest.

    Raises
    ------
    InputError
        If the record is shorter than four windows.

    Examples
    --------
    >>> rests = find_rest(record)
    >>> rests.spans.round(1).tolist()
    [[0.0, 60.0]]
    """
    detector = detector or RestDetector()
    interval = float(np.median(record.dt))
    size = max(round(detector.window / interval), 4)
    count = len(record) // size
    if count < 4:
        raise InputError(
            f"rest is found in windows of {detector.window:g} s, and the record has "
            f"{record.duration:.3g} s"
        )
    shape = (count, size, 3)
    rate = record.gyro[: count * size].reshape(shape)
    force = record.accel[: count * size].reshape(shape)
    ends = record.time[size - 1 : count * size : size]
    begins = ends - size * interval
    scatter = np.stack([np.sqrt(x.var(axis=1).sum(axis=1)) for x in (rate, force)])
    quiet = np.sort(scatter, axis=1)[:, : max(count // 10, 2)].mean(axis=1)
    still = np.all(scatter < detector.factor * np.maximum(quiet, 1e-12)[:, None], axis=0)
    mean = rate.mean(axis=1)
    if np.any(still):
        usual = np.median(mean[still], axis=0)
        still &= np.linalg.norm(mean - usual, axis=1) < detector.rate
    if moving is not None:
        at = np.asarray(moving[0])[np.asarray(moving[1], bool)]
        k = np.searchsorted(at, begins - detector.window)
        still &= np.searchsorted(at, ends + detector.window) == k
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    spans = []
    for first, last in edges.reshape(-1, 2):
        if (last - first) * size * interval >= detector.shortest:
            spans.append((begins[first], ends[last - 1]))
        else:
            still[first:last] = False
    spread = rate[still].std(axis=1) if np.any(still) else np.zeros((1, 3))
    sigma = np.sqrt(np.mean(spread**2, axis=0) / size)
    return Rests(
        np.array(spans, np.float64).reshape(-1, 2), size * interval, ends[still], mean[still], sigma
    )
