"""`BodySpeed`: speeds over ground along the axes of a sensor: odometer, wheels, DVL."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from schuler.aiding.rows import checked_lever
from schuler.errors import InputError

__all__ = ["BodySpeed"]

PARTS = ("scale", "mount", "lever")


@dataclass(frozen=True, eq=False)
class BodySpeed:
    """Speed of a point of the vehicle over ground.

    Parameters
    ----------
    time : (n,) array_like
        On the record's clock, s.
    value : (n,) or (n, 3) array_like
        Forward speed (an odometer), or right, forward, up (a DVL), m/s.
    sigma : float
        1-sigma, m/s.
    scale_sigma : float
        1-sigma of the scale factor before anything is measured.
    lever : (3,) array_like
        From the IMU to the point whose speed it is, body axes, m.
    estimate : tuple of str
        Which of "scale", "mount" and "lever" are estimated.
    name : str
    dropped : mapping of str to int
        Rows that a reader has left out, by reason.
    notes : tuple of str
        How a reader has made the speed.

    Raises
    ------
    InputError
        For arrays of other shapes, times that do not increase, or values that are not finite.
    """

    time: ArrayLike
    value: ArrayLike
    sigma: float = 0.1
    scale_sigma: float = 0.02
    lever: ArrayLike = (0.0, 0.0, 0.0)
    estimate: tuple[str, ...] = ()
    name: str = "odometer"
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time, value = np.asarray(self.time, np.float64), np.asarray(self.value, np.float64)
        if time.ndim != 1 or value.shape not in ((len(time),), (len(time), 3)):
            raise InputError(
                f"{self.name}: expected {len(time)} speeds, or rows of three, got {value.shape}"
            )
        if not (np.all(np.isfinite(time)) and np.all(np.isfinite(value))):
            raise InputError(f"{self.name}: times and speeds must be finite")
        if np.any(np.diff(time) <= 0.0):
            k = int(np.argmax(np.diff(time) <= 0.0))
            raise InputError(f"{self.name}: time does not advance after t = {time[k]:.9g} s")
        if not self.sigma > 0.0:
            raise InputError(f"{self.name}: sigma must be positive, got {self.sigma}")
        checked_lever(self.lever, self.name)
        unknown = set(self.estimate) - set(PARTS)
        if unknown:
            raise InputError(f"{self.name}: cannot estimate {min(unknown)}")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "value", value)

    def __len__(self) -> int:
        return len(np.asarray(self.time))

    def triples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return values and sigmas along right, forward, up, (n, 3); sigma 0 is not measured."""
        value = np.asarray(self.value, np.float64)
        if value.ndim == 2:
            return value, np.full_like(value, self.sigma)
        out, sigma = np.zeros((len(value), 3)), np.zeros((len(value), 3))
        out[:, 1], sigma[:, 1] = value, self.sigma
        return out, sigma
