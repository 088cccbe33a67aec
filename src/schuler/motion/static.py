"""A base at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.motion.base import Pose

__all__ = ["Static"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Static:
    """A base at rest with an attitude in degrees: heading clockwise, pitch, roll."""

    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    def pose(self, t: Array) -> Pose:
        """Return the pose at times t (n,), s."""
        zero = np.zeros((len(t), 3))
        euler = np.tile(np.array([-self.heading, self.pitch, self.roll]) * DEG, (len(t), 1))
        return Pose(euler, zero, zero, zero, zero)
