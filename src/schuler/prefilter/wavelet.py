"""Wavelet shrinkage of each channel, by PyWavelets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError, SchulerError, how_to_install
from schuler.prefilter.base import Prefilter, check_channels, each_channel, even_interval
from schuler.record import ImuRecord

__all__ = ["Wavelet"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wavelet(Prefilter):
    """Soft threshold at sigma sqrt(2 ln n), sigma from the finest level (Donoho, 1995).

    Parameters
    ----------
    wavelet : str
        Name of a discrete wavelet of PyWavelets.
    levels : int, optional
        As many as the record allows, up to eight, when not given.
    channels : {"accel", "gyro", "both"}
    frame : {"inertial", "body"}
        Where the force is filtered (`each_channel`).

    Examples
    --------
    >>> smooth = Wavelet("db4", levels=3)(record)
    >>> len(smooth)
    1200
    """

    wavelet: str = "db4"
    levels: int | None = None
    channels: str = "accel"
    frame: str = "inertial"

    def __post_init__(self) -> None:
        check_channels(self.channels, self.frame)
        if self.levels is not None and self.levels < 1:
            raise InputError(f"levels must be 1 or more, got {self.levels}")

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record.

        Raises
        ------
        InputError
            For an unknown wavelet, or a record that is short or unevenly sampled.
        SchulerError
            If PyWavelets is not installed.
        """
        try:
            import pywt
        except ImportError:
            raise SchulerError(
                f"wavelet shrinkage needs PyWavelets: {how_to_install('prefilter')}"
            ) from None
        even_interval(record)
        if self.wavelet not in pywt.wavelist(kind="discrete"):
            raise InputError(f"unknown discrete wavelet '{self.wavelet}'")
        most = min(8, pywt.dwt_max_level(len(record), pywt.Wavelet(self.wavelet).dec_len))
        levels = most if self.levels is None else self.levels
        if not 1 <= levels <= most:
            raise InputError(f"levels must be from 1 to {most} for this record, got {levels}")

        def run(x: Array) -> Array:
            parts = pywt.wavedec(x, self.wavelet, mode="symmetric", level=levels)
            sigma = float(np.median(np.abs(parts[-1]))) / 0.6745
            if sigma == 0.0:
                return x
            bound = sigma * np.sqrt(2.0 * np.log(len(x)))
            shrunk = [parts[0], *(pywt.threshold(p, bound, "soft") for p in parts[1:])]
            return np.asarray(pywt.waverec(shrunk, self.wavelet, mode="symmetric")[: len(x)])

        return each_channel(record, self.channels, self.frame, run)
