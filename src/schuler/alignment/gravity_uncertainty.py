"""What is not known of gravity itself: its size (anomalies) and its direction (deflection).

No sensor of a stationary vehicle distinguishes gravity from what acts like it. The plumb line
stands for the ellipsoid's normal, so its deflection is an error of the level, and of the heading by
tan L (Laplace's equation). An error of gravity's size is an accelerometer bias along the vertical
as long as the unit is not turned; where it is turned between positions, it makes of attitude and
biases what a second estimate with a slightly larger gravity differs by.

Neither is estimated: both are added to the covariance of an estimate that takes normal gravity for
exact (Schmidt, 1966, "consider" covariance).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.method import Estimate
from schuler.earth import Site

__all__ = ["deflection_covariance", "with_gravity_uncertainty"]

Array = NDArray[np.float64]

_GRADIENT = 3.086e-6
"""Loss of gravity with height, 1/s^2: a height says a gravity to the estimate."""


def deflection_covariance(site: Site) -> Array:
    """Return the covariance of phi (east, north, up) by the deflection of the vertical, rad^2.

    Parameters
    ----------
    site : Site
        Its `deflection_sigma` about north and about east alike.

    Examples
    --------
    >>> import numpy as np
    >>> found = np.sqrt(np.diag(deflection_covariance(Site(45.0, deflection_sigma=5.0))))
    >>> print(np.round(np.degrees(found) * 3600, 6))
    [5. 5. 5.]
    """
    about_east = np.array([1.0, 0.0, 0.0])
    about_north = np.array([0.0, 1.0, np.tan(site.latitude)])
    shape = np.outer(about_east, about_east) + np.outer(about_north, about_north)
    return np.asarray(site.deflection**2 * shape)


def with_gravity_uncertainty(
    found: Estimate, site: Site, again: Callable[[Site], Estimate]
) -> Estimate:
    """Return an estimate whose covariance holds what is not known of gravity.

    Parameters
    ----------
    found : Estimate
    site : Site
    again : callable
        Makes the estimate for another site; used where the unit was turned between positions.
    """
    sigma = site.gravity_uncertainty
    covariance = deflection_covariance(site)
    biases = found.bias_covariance
    # What one 1-sigma of gravity makes of the attitude, and of the biases.
    up = found.attitude[2]
    of_biases = np.concatenate([np.zeros(3), sigma * up])
    if sigma > 0.0 and len(found.positions) > 1:
        other = again(replace(site, height=site.height - sigma / _GRADIENT))
        turn = other.attitude @ found.attitude.T
        phi = 0.5 * np.array(
            [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        )
        covariance = covariance + np.outer(phi, phi)
        if found.biases is not None and other.biases is not None:
            of_biases = other.biases - found.biases
    if biases is not None:
        biases = biases + np.outer(of_biases, of_biases)
    if not covariance.any():
        return replace(found, bias_covariance=biases)
    budget = {**found.budget, "gravity": covariance}
    return replace(found, budget=budget, bias_covariance=biases)
