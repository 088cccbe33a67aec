"""What every motion gives: attitude and displacement with their derivatives, at any times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import euler_to_quat

__all__ = ["Motion", "Pose"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A motion at n times.

    Parameters
    ----------
    euler, euler_rate : (n, 3) float64
        (psi, theta, gamma), rad, and their derivatives, rad/s.
    displacement, velocity, acceleration : (n, 3) float64
        East, north, up from the site, m, m/s, m/s^2; derivatives of one another.
    """

    euler: Array
    euler_rate: Array
    displacement: Array
    velocity: Array
    acceleration: Array

    @property
    def quaternion(self) -> Array:
        """q_b^n (n, 4)."""
        return euler_to_quat(self.euler)

    def body_rate(self) -> Array:
        """Return the rate of b against n, in b, (n, 3) rad/s."""
        _, theta, gamma = self.euler.T
        dpsi, dtheta, dgamma = self.euler_rate.T
        st, ct, sg, cg = np.sin(theta), np.cos(theta), np.sin(gamma), np.cos(gamma)
        return np.column_stack(
            [cg * dtheta - sg * ct * dpsi, dgamma + st * dpsi, sg * dtheta + cg * ct * dpsi]
        )


class Motion(Protocol):
    """A motion about a site."""

    def pose(self, t: Array) -> Pose:
        """Return the motion at times t (n,), s since its start."""
        ...
