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


def truncate(x: Array, rank: int, window: int) -> Array:
    """Return a series rebuilt from the strongest singular components of its Hankel matrix.

    Parameters
    ----------
    x : (n,) float64
    rank : int
        Components that are kept.
    window : int
        Rows of the Hankel matrix, at most half the series.

    Raises
    ------
    InputError
        For a rank or window that the series is too short for.
    """
    n = len(x)
    if not 1 <= rank <= window <= n // 2:
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
    _, vectors = np.linalg.eigh(gram)
    out = np.zeros(n)
    size = 1 << int(np.ceil(np.log2(n + window)))
    spectrum = np.fft.rfft(x, size)
    for u in vectors[:, -rank:].T:
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
    rank : int
        Components that are kept.
    window : float
        Length of a window, s.
    channels : {"accel", "gyro", "both"}
    frame : {"inertial", "body"}
        Where the force is filtered (`each_channel`).
    """

    rank: int = 4
    window: float = field(default=4.0, metadata={"unit": "time"})
    channels: str = "accel"
    frame: str = "inertial"

    def __post_init__(self) -> None:
        check_channels(self.channels, self.frame)
        if not (self.rank >= 1 and 0.0 < self.window < float("inf")):
            raise InputError(
                f"rank must be 1 or more and window positive, got {self.rank} and {self.window}"
            )

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record.

        Raises
        ------
        InputError
            For a record that is short or unevenly sampled.
        """
        rows = max(self.rank, round(self.window / even_interval(record)))
        return each_channel(
            record, self.channels, self.frame, lambda x: truncate(x, self.rank, rows)
        )
