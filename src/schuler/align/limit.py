"""The Cramér-Rao limit of a static alignment: what no method can beat.

A base at rest sees the force g up and the Earth's rate. For an unbiased reading of both over a
time T the information on phi is sum of H^T S^-1 H, with H = [g x] for the force, [Omega x] for
the rate, and S the covariance of their time averages: bias, white noise, bias instability, rate
random walk and quantisation of the specification. No knowledge of phi beforehand is assumed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.align.uncertainty import flicker_correlation
from schuler.attitude import skew
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["limit", "mean_variance"]

Array = NDArray[np.float64]

_STEPS = 64


def mean_variance(part: GyroSpec | AccelerometerSpec, duration: float, interval: float) -> float:
    """Return the variance of the best estimate of a constant rate over a time.

    Generalised least squares over all noise types, plus the bias squared.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    duration : float
        s.
    interval : float
        Sampling interval, s; it sets how far quantisation averages.

    Returns
    -------
    float
        (rad/s)^2 or (m/s^2)^2.
    """
    dt = np.full(_STEPS, duration / _STEPS)
    t = np.cumsum(dt)
    cov = np.diag(np.full(_STEPS, part.white**2 / dt[0]))
    if part.bias_instability:
        cov += part.bias_instability**2 * flicker_correlation(dt)
    if part.drift:
        # The mean of a random walk over a stretch: min(t, t') between, dt/3 within.
        start = t - dt[0]
        low = np.minimum(start[:, None], start[None, :])
        cov += part.drift**2 * (low + 0.5 * dt[0] - np.eye(_STEPS) * dt[0] / 6.0)
    if part.quantisation:
        # Rounding to steps as fine as the sampling: the ends count, the samples inside average.
        q = part.quantisation**2 / dt[0] ** 2
        cov += q * (2.0 * np.eye(_STEPS) - np.eye(_STEPS, k=1) - np.eye(_STEPS, k=-1))
        cov += np.eye(_STEPS) * q * interval / dt[0]
    if not np.any(cov):
        return part.bias**2
    one = np.ones(_STEPS)
    return float(part.bias**2 + 1.0 / (one @ np.linalg.solve(cov, one)))


def limit(spec: ImuSpec, site: Site, duration: float, interval: float = 0.01) -> Array:
    """Return the Cramér-Rao bound on the covariance of phi for a base at rest.

    Parameters
    ----------
    spec : ImuSpec
        The instrument.
    site : Site
        Latitude and height.
    duration : float
        Time, s.
    interval : float
        Sampling interval, s.

    Returns
    -------
    (3, 3) float64
        rad^2 in ENU. A part of the instrument that is said to be free of any error is taken
        as a millionth of its signal.

    Raises
    ------
    InputError
        If the duration or the interval is not positive.
    """
    if not (np.isfinite(duration) and duration > 0 and interval > 0):
        raise InputError(f"the duration must be a positive time, got {duration} s")
    information = np.zeros((3, 3))
    for part, signal in (
        (spec.accelerometer, np.array([0.0, 0.0, site.gravity])),
        (spec.gyro, site.earth_rate),
    ):
        floor = (1e-6 * float(np.linalg.norm(signal))) ** 2
        variance = max(mean_variance(part, duration, interval), 1e-6 * floor)
        h = skew(signal)
        information += h.T @ h / variance
    return np.asarray(np.linalg.inv(information))
