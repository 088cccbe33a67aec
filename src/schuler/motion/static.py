"""A base at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.motion.base import Track, angles_track

__all__ = ["Static"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Static:
    """A base at rest with an attitude in degrees: heading clockwise, pitch, roll.

    Examples
    --------
    >>> round(sc.simulate(Static(30.0, pitch=2.0), site, 10.0, 20.0).heading_deg(), 3)
    30.0
    """

    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        angles = np.zeros((len(t), 3, 3))
        angles[:, :, 0] = np.array([-self.heading, self.pitch, self.roll]) * DEG
        return angles_track(angles)
