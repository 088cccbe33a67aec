"""The traditional analytic alignment: mean specific force and mean rate as two vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.earth import Site
from schuler.errors import InputError
from schuler.estimate.vectors import triad

__all__ = ["analytic_attitude"]

Array = NDArray[np.float64]


def analytic_attitude(
    mean_rate: Array, mean_force: Array, site: Site, base: str
) -> tuple[Array, float]:
    """Return C_b^n (3, 3) and the orthonormality error, rad.

    Parameters
    ----------
    mean_rate, mean_force : (3,) float64
        rad/s and m/s^2, body axes.
    site : Site
    base : {"gravity", "earth-rate"}
        The vector that is fitted exactly.

    Returns
    -------
    (3, 3) float64, float
        Attitude, and the measured angle between the vectors minus that which latitude gives:
        what the Gram-Schmidt process hides.

    Raises
    ------
    InputError
        If a vector is zero or the two are parallel.
    """
    up = np.array([0.0, 0.0, site.gravity])
    earth = site.earth_rate
    if float(np.linalg.norm(mean_rate)) == 0.0:
        raise InputError("the mean rate is zero: the gyros do not see the Earth turn")
    if base == "gravity":
        c = triad(up, earth, mean_force, mean_rate)
    else:
        c = triad(earth, up, mean_rate, mean_force)

    def angle(a: Array, b: Array) -> float:
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))

    return c, angle(mean_rate, mean_force) - angle(earth, up)
