"""A centrifuge whose platform turns back, so that the IMU sees a turning force without turning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.motion.base import Track

__all__ = ["Centrifuge"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Centrifuge:
    """An arm about the vertical, with a platform at its end.

    Parameters
    ----------
    radius : float
        m.
    rate : float
        Of the arm, counter-clockwise, deg/s.
    spin_up : float
        Time in which the arm reaches its rate, s; 0 starts at the rate.
    counter_rotation : bool
        The platform turns back at the arm's rate.
    orientation : (3,) tuple
        psi, theta, gamma of the IMU on the platform, deg.
    start : float
        Angle of the arm at the start, counter-clockwise from east, deg.

    Examples
    --------
    >>> arm = Centrifuge(radius=2.0, rate=90.0)
    >>> arm.track(np.array([0.0, 1.0])).quat_nb.shape
    (2, 4)
    """

    radius: float
    rate: float
    spin_up: float = 0.0
    counter_rotation: bool = True
    orientation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.radius) and self.radius >= 0 and np.isfinite(self.rate)):
            raise InputError(
                f"a centrifuge needs a radius of 0 m or more and a finite rate, got {self.radius} "
                f"and {self.rate}"
            )
        if not self.spin_up >= 0:
            raise InputError(f"the time to spin up must be 0 s or more, got {self.spin_up}")

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        rate = self.rate * DEG
        arm = np.zeros((len(t), 3))
        if self.spin_up > 0:
            u = np.clip(t / self.spin_up, 0.0, 1.0)
            after = np.maximum(t - self.spin_up, 0.0)
            way = 0.5 * u**2 + (np.cos(2 * np.pi * u) - 1.0) / (4 * np.pi**2)
            arm[:, 0] = rate * (self.spin_up * way + after)
            arm[:, 1] = rate * (u - np.sin(2 * np.pi * u) / (2 * np.pi))
            arm[:, 2] = rate / self.spin_up * (1.0 - np.cos(2 * np.pi * u))
        else:
            arm[:, 0], arm[:, 1] = rate * t, rate
        angles = np.zeros((len(t), 3, 3, 3))
        angles[:, 0, 0] = arm
        angles[:, 0, 0, 0] += self.start * DEG
        if self.counter_rotation:
            angles[:, 1, 0] = -arm
        angles[:, 2, :, 0] = np.array(self.orientation) * DEG
        levers = np.zeros((3, 3))
        levers[0, 0] = self.radius
        return Track(np.zeros((len(t), 3, 3)), angles, levers)
