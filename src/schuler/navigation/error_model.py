"""The error equations of a navigator at rest: x' = F x + u with constant F."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.constants import EARTH_RATE
from schuler.earth import gravity, radii

__all__ = ["STATES", "error_matrix"]

Array = NDArray[np.float64]

STATES = ("phi_east", "phi_north", "phi_up", "v_east", "v_north", "east", "north")


def error_matrix(lat: float, height: float = 0.0, force: float | None = None) -> Array:
    """Return F of x' = F x + u for a base at rest, (7, 7).

    States as in `STATES`, u is -C eps for phi and C nabla for velocity (Titterton and Weston,
    2004, chapter 12, in a frame that does not turn about its up axis with the longitude).

    Parameters
    ----------
    lat, height : float
        rad and m.
    force : float, optional
        Specific force upward, m/s^2; normal gravity when not given.

    Examples
    --------
    >>> f = error_matrix(site.latitude)
    >>> f.shape
    (7, 7)
    """
    rm, rn = (float(r) + height for r in radii(lat))
    g = float(gravity(lat, height)) if force is None else force
    we, wn, wu = 0.0, EARTH_RATE * np.cos(lat), EARTH_RATE * np.sin(lat)
    w = np.array([[0.0, -wu, wn], [wu, 0.0, -we], [-wn, we, 0.0]])
    u = np.array([[0.0, -1.0 / rm], [1.0 / rn, 0.0], [0.0, 0.0]])
    f = np.zeros((7, 7))
    f[:3, :3] = -w
    f[:3, 3:5] = u
    f[:3, 5:7] = w @ u
    f[3, 1], f[4, 0] = -g, g
    f[3, 4], f[4, 3] = 2.0 * wu, -2.0 * wu
    f[5, 3] = f[6, 4] = 1.0
    return f
