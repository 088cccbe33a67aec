"""A standing vehicle with its engine idling, wind, crew at work and doors slamming.

Sway and displacement are sums of sinusoids drawn in a band, so that every derivative is exact
and the displacement is bounded; settling steps (a crew member boards, a door slams) are smooth
to the third derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.motion.base import Pose

__all__ = ["DisturbedVehicle"]

Array = NDArray[np.float64]

_LINES = 24
"""Sinusoids to a band: enough for a nearly Gaussian sum."""

_SETTLING = 0.15
"""Time constant of a settling step, s."""


@dataclass(frozen=True, eq=False)
class DisturbedVehicle:
    """A disturbed vehicle; `draw` makes one from a random generator.

    Parameters
    ----------
    mean : (3,) float64
        Mean (psi, theta, gamma), rad.
    frequency, phase : (6, k) float64
        Of the lines of psi, theta, gamma, east, north, up: rad/s and rad.
    amplitude : (6, k) float64
        rad and m.
    step_time : (j,) float64
        When a settling step begins, s.
    step : (j, 6) float64
        How far each channel settles, rad and m.
    """

    mean: Array
    frequency: Array
    phase: Array
    amplitude: Array
    step_time: Array
    step: Array

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        duration: float,
        *,
        heading: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        sway_deg: tuple[float, float, float] = (0.05, 0.2, 0.3),
        sway_band: tuple[float, float] = (0.2, 2.0),
        shake_mm: tuple[float, float, float] = (4.0, 4.0, 2.0),
        shake_band: tuple[float, float] = (0.2, 5.0),
        steps: int = 6,
        step_mm: float = 3.0,
    ) -> DisturbedVehicle:
        """Draw a vehicle.

        Parameters
        ----------
        rng : numpy.random.Generator
        duration : float
            Span over which the steps are spread, s.
        heading, pitch, roll : float
            Mean attitude, deg.
        sway_deg : (3,) tuple
            Rms of heading, pitch and roll, deg.
        shake_mm : (3,) tuple
            Rms of the displacement east, north, up, mm.
        sway_band, shake_band : (2,) tuple
            Hz.
        steps : int
            Number of settling steps, each of `step_mm` in a random horizontal direction.
        step_mm : float
            mm.
        """
        rms = np.concatenate([np.array(sway_deg) * DEG, np.array(shake_mm) * 1e-3])
        bands = np.array([sway_band] * 3 + [shake_band] * 3)
        frequency = 2 * np.pi * rng.uniform(bands[:, :1], bands[:, 1:], (6, _LINES))
        step = np.zeros((steps, 6))
        direction = rng.uniform(0, 2 * np.pi, steps)
        step[:, 3] = 1e-3 * step_mm * np.cos(direction)
        step[:, 4] = 1e-3 * step_mm * np.sin(direction)
        return cls(
            mean=np.array([-heading, pitch, roll]) * DEG,
            frequency=frequency,
            phase=rng.uniform(0, 2 * np.pi, (6, _LINES)),
            amplitude=np.repeat(rms[:, None] * np.sqrt(2.0 / _LINES), _LINES, axis=1),
            step_time=np.sort(rng.uniform(0, duration, steps)),
            step=step,
        )

    def pose(self, t: Array) -> Pose:
        """Return the pose at times t (n,), s."""
        value, rate, acceleration = (np.zeros((len(t), 6)) for _ in range(3))
        for w, p, a in zip(self.frequency.T, self.phase.T, self.amplitude.T, strict=True):
            angle = t[:, None] * w + p
            s, c = a * np.sin(angle), a * np.cos(angle)
            value += s
            rate += w * c
            acceleration -= w * w * s
        for begin, size in zip(self.step_time, self.step, strict=True):
            x = np.maximum((t - begin) / _SETTLING, 0.0)[:, None]
            e = np.exp(-x)
            value += size * (1.0 - e * (1.0 + x + x**2 / 2 + x**3 / 6))
            rate += size / _SETTLING * e * x**3 / 6
            acceleration += size / _SETTLING**2 * e * (x**2 / 2 - x**3 / 6)
        return Pose(
            self.mean + value[:, :3], rate[:, :3], value[:, 3:], rate[:, 3:], acceleration[:, 3:]
        )
