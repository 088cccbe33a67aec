"""Truncated singular value decomposition of a series' Hankel matrix.

The matrix holds the series in overlapping windows. Its strongest singular components, averaged
back over anti-diagonals, are the series' strongest oscillations and trend. They come from the
eigenvectors of the window's covariance (window by window, accumulated by FFT), so that 60,000
samples are no more work than a few filters.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.prefilter.base import Prefilter, check_channels, each_channel, even_interval
from schuler.record import ImuRecord

__all__ = ["Hankel", "truncate"]

Array = NDArray[np.float64]


def gap_rank(singular: Array) -> int:
    """Return how many singular values stand before the widest gap, as a ratio of neighbours.

    Parameters
    ----------
    singular : (k,) float64
        Singular values, the largest first.

    Notes
    -----
    The gap is looked for in the first half of the values: what lies behind is noise, whose smallest
    values are a matter of chance and rounding. Without any gap (all values alike) it is the first.

    Examples
    --------
    >>> gap_rank(np.array([9.0, 8.0, 7.0, 0.2, 0.19, 0.18, 0.17, 0.16]))
    3
    """
    head = np.maximum(singular[: len(singular) // 2 + 1], 1e-12 * singular[0] + 1e-300)
    return int(np.argmax(head[:-1] / head[1:])) + 1


def truncate(x: Array, rank: int | str, window: int) -> Array:
    """Return a series rebuilt from the strongest singular components of its Hankel matrix.

    Parameters
    ----------
    x : (n,) float64
    rank : int or "gap"
        Components that are kept; "gap": those before the widest gap (`gap_rank`).
    window : int
        Rows of the Hankel matrix, at most half the series.

    Raises
    ------
    InputError
        For a rank or window that the series is too short for.
    """
    n = len(x)
    least = 2 if isinstance(rank, str) else rank
    if not 1 <= least <= window <= n // 2:
        raise InputError(
            f"a Hankel filter needs 1 <= rank <= window <= half the samples, got rank {rank}, "
            f"window {window}, {n} samples"
        )
    columns = n - window + 1
    view = np.lib.stride_tricks.sliding_window_view(x, columns)
    # H H^T (window x window) has H's left singular vectors; two rows differ by one sample each
    # end, so each diagonal is a running update of its first element.
    gram = np.empty((window, window))
    gram[0] = view @ x[:columns]
    gram[:, 0] = gram[0]
    for i in range(1, window):
        gram[i, i:] = (
            gram[i - 1, i - 1 : -1]
            - x[i - 1] * x[i - 1 : window - 1]
            + x[columns + i - 1] * x[columns + i - 1 : columns + window - 1]
        )
        gram[i:, i] = gram[i, i:]
    values, vectors = np.linalg.eigh(gram)
    kept = gap_rank(np.sqrt(np.maximum(values[::-1], 0.0))) if isinstance(rank, str) else rank
    out = np.zeros(n)
    size = 1 << int(np.ceil(np.log2(n + window)))
    spectrum = np.fft.rfft(x, size)
    for u in vectors[:, -kept:].T:
        kernel = np.fft.rfft(u, size)
        # Row weights u^T H are a correlation, and spreading them back a convolution.
        weights = np.fft.irfft(spectrum * np.conj(kernel), size)[:columns]
        out += np.fft.irfft(np.fft.rfft(weights, size) * kernel, size)[:n]
    count = np.minimum(np.minimum(np.arange(1, n + 1), np.arange(n, 0, -1)), window)
    return np.asarray(out / count)


@dataclass(frozen=True)
class Hankel(Prefilter):
    """Keep the strongest oscillations and trend of each channel.

    Parameters
    ----------
    rank : int or "gap"
        Components that are kept, or those before the widest gap (`gap_rank`).
    window : float
        Length of a window, s.
    channels : {"accel", "gyro", "both"}
    frame : {"inertial", "body"}
        Where the force is filtered (`each_channel`).

    Examples
    --------
    >>> smooth = Hankel(rank=2, window=1.0)(record.between(None, 10.0))
    >>> len(smooth)
    200
    """

    rank: int | str = 4
    window: float = field(default=4.0, metadata={"unit": "time"})
    channels: str = "accel"
    frame: str = "inertial"

    def __post_init__(self) -> None:
        check_channels(self.channels, self.frame)
        known = self.rank == "gap" if isinstance(self.rank, str) else self.rank >= 1
        if not (known and 0.0 < self.window < float("inf")):
            raise InputError(
                "rank must be 1 or more, or gap, and window positive, got "
                f"{self.rank} and {self.window}"
            )

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record.

        Raises
        ------
        InputError
            For a record that is short or unevenly sampled.
        """
        least = 2 if isinstance(self.rank, str) else self.rank
        rows = max(least, round(self.window / even_interval(record)))
        return each_channel(
            record, self.channels, self.frame, lambda x: truncate(x, self.rank, rows)
        )
