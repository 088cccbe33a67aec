"""`ZeroRate`: spans in which a body is known not to rotate against the Earth."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

__all__ = ["ZeroRate"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ZeroRate:
    """Spans without rotation: what the gyros read there is the Earth's rate and their bias.

    Parameters
    ----------
    spans : (k, 2) array_like
        Begin and end of each, on the record's clock, s.
    window : float
        The rate is averaged over so long, s.
    sigma : (3,) array_like or float, optional
        1-sigma of such a mean, rad/s; by the scatter of the samples when not given.
    name : str

    Raises
    ------
    InputError
        For spans that do not end after they begin, or a window that is not positive.

    Examples
    --------
    >>> ZeroRate([(0.0, 25.0)]).spans.tolist()
    [[0.0, 25.0]]
    """

    spans: ArrayLike
    window: float = 1.0
    sigma: ArrayLike | None = None
    name: str = "zero_rate_given"

    def __post_init__(self) -> None:
        spans = np.asarray(self.spans, np.float64)
        if spans.ndim != 2 or spans.shape[1] != 2 or not np.all(np.isfinite(spans)):
            raise InputError(f"{self.name}: spans are rows of two times, got shape {spans.shape}")
        if np.any(spans[:, 1] <= spans[:, 0]):
            k = int(np.argmax(spans[:, 1] <= spans[:, 0]))
            raise InputError(
                f"{self.name}: a span ends at t = {spans[k, 1]:.9g} s, not after its begin at "
                f"{spans[k, 0]:.9g} s"
            )
        if not 0.0 < self.window < np.inf:
            raise InputError(f"{self.name}: a window is positive, got {self.window} s")
        object.__setattr__(self, "spans", spans[np.argsort(spans[:, 0])])

    def means(self, time: Array, rate: Array) -> tuple[Array, Array, Array]:
        """Return ends of the windows (m,), mean rates (m, 3) and the 1-sigma of one (3,).

        Parameters
        ----------
        time : (n,) float64
            Ends of the samples, s.
        rate : (n, 3) float64
            rad/s.
        """
        ends: list[float] = []
        means: list[Array] = []
        scatter: list[Array] = []
        last = -np.inf
        for begin, end in np.asarray(self.spans):
            begin = max(begin, last)
            count = int((end - begin) / self.window + 1e-9)
            edges = begin + self.window * np.arange(count + 1)
            rows = np.searchsorted(time, edges + 1e-9)
            for first, after in pairwise(rows):
                if after - first < 2 or time[after - 1] <= last:
                    continue
                part = rate[first:after]
                last = float(time[after - 1])
                ends.append(last)
                means.append(part.mean(axis=0))
                scatter.append(part.var(axis=0, ddof=1) / len(part))
        if not ends:
            return np.zeros(0), np.zeros((0, 3)), np.zeros(3)
        sigma = np.sqrt(np.mean(scatter, axis=0))
        if self.sigma is not None:
            sigma = np.broadcast_to(np.asarray(self.sigma, np.float64), 3)
        return np.array(ends), np.array(means), np.maximum(sigma, 1e-9)
