"""`Allan`: deviations against averaging time, and what they are worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.allan_variance.theory import Kind
from schuler.errors import InputError

__all__ = ["Allan"]

Array = NDArray[np.float64]
Lags = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Allan(Result):
    """Deviations against averaging time, with what they are worth.

    Parameters
    ----------
    kind : {"allan", "hadamard", "total"}
    tau : (k,) float64
        Averaging times, s: whole numbers of samples.
    channels : tuple of str
        ``gyro_x`` ... ``accel_z``; numbered from 1 for redundant arrays.
    deviation, lower, upper : (k, c) float64
        Deviation and its 68 % confidence bounds, rad/s or m/s^2.
    edf : (k, c) float64
        Equivalent degrees of freedom: edf times the estimated over the true variance is
        chi-square distributed (`schuler.allan_variance.theory.degrees_of_freedom`).
    interval : float
        Mean sampling interval, s.
    samples : int
    stride : (k,) int64
        Samples from one overlapping difference to the next: 1 but for long times of a stream.
    bridged : int
        Samples that were made by sharing out the increment over a short gap.
    name : str
        The record's.
    """

    kind: Kind
    tau: Array
    channels: tuple[str, ...]
    deviation: Array
    lower: Array
    upper: Array
    edf: Array
    interval: float
    samples: int
    stride: Lags
    bridged: int = 0
    name: str = "record"

    def to_dict(self) -> dict[str, Any]:
        """Return the deviations with the keys of the JSON schema `schuler.allan/2`, no fit."""
        from schuler.allan_variance.output import to_dict

        return to_dict(self)

    def columns(self) -> dict[str, Any]:
        """Return averaging times, and deviation with its bounds of each channel."""
        from schuler.allan_variance.output import columns

        return columns(self)

    def __str__(self) -> str:
        from schuler.allan_variance.output import curve_lines

        return "\n".join(curve_lines(self))

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.interval * self.samples

    def select(self, channels: Sequence[str]) -> Allan:
        """Return some of the channels only.

        Raises
        ------
        InputError
            For a channel that is not there, or none at all.
        """
        for name in channels:
            if name not in self.channels:
                raise InputError(
                    f"there is no channel '{name}'; this record has {', '.join(self.channels)}"
                )
        if not channels:
            raise InputError(f"name at least one channel of {', '.join(self.channels)}")
        keep = [k for k, name in enumerate(self.channels) if name in channels]
        return Allan(
            self.kind, self.tau, tuple(self.channels[k] for k in keep), self.deviation[:, keep],
            self.lower[:, keep], self.upper[:, keep], self.edf[:, keep], self.interval,
            self.samples, self.stride, self.bridged, self.name,
        )  # fmt: skip

    def warnings(self) -> list[str]:
        """Return what a reader of the curve should know, in sentences."""
        out = []
        if self.bridged:
            out.append(
                f"{self.bridged} of {self.samples} samples lie in gaps that were bridged by "
                "holding the rate; the shortest averaging times come out a little too small"
            )
        dead = [n for n, d in zip(self.channels, self.deviation.T, strict=True) if not d.any()]
        if dead:
            out.append(f"{', '.join(dead)}: every sample is the same, so there is no noise to see")
        return out
