"""What the noise of a specification does to averages: covariances, not draws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.sensors.errors import AccelerometerSpec, GyroSpec

__all__ = ["flicker_correlation", "gauss_markov_correlation", "mean_covariance"]

Array = NDArray[np.float64]

PER_DECADE = 3
"""Gauss-Markov processes to a decade of correlation time that make up 1/f noise."""


def _flicker_taus(shortest: float, longest: float) -> Array:
    steps = np.arange(np.log10(0.01 * shortest), np.log10(100.0 * longest), 1.0 / PER_DECADE)
    return np.asarray(10.0**steps)


def flicker_correlation(dt: Array, start: Array | None = None) -> Array:
    """Return the covariance (m, m) of means of 1/f noise with B = 1 over stretches.

    Gauss-Markov processes with correlation times from a hundredth of the shortest stretch to a
    hundred times the record, three a decade: variance ln(ratio) / pi each, for the two-sided
    spectrum B^2 / (2 pi f) (IEEE Std 952-1997, C.1.3).

    Parameters
    ----------
    dt : (m,) float64
        Length of each stretch, s.
    start : (m,) float64, optional
        When each begins, s; one after the other when not given.
    """
    x = float(dt.mean())
    even = start is None and float(np.ptp(dt)) < 0.1 * x
    if start is None:
        start = np.cumsum(dt) - dt
    t = start + 0.5 * dt
    # On an even grid one row of lags says all.
    lag = x * np.arange(len(dt)) if even else np.abs(t[:, None] - t[None, :])
    variance = np.log(10.0) / PER_DECADE / np.pi
    out = np.zeros_like(lag)
    diagonal = np.zeros(1 if even else len(dt))
    for tau in _flicker_taus(float(dt.min()), float(t.max() - t.min() + x)):
        out += np.exp(-lag / tau)
        # Within a stretch the process averages.
        u = np.maximum((np.array([x]) if even else dt) / tau, 1e-3)
        diagonal += 2.0 * (u - 1.0 + np.exp(-u)) / u**2
    if even:
        out[0] = diagonal[0]
        k = np.arange(len(dt))
        out = out[np.abs(k[:, None] - k[None, :])]
    else:
        np.fill_diagonal(out, diagonal)
    return np.asarray(variance * out)


def gauss_markov_correlation(tau: float, dt: Array, start: Array | None = None) -> Array:
    """Return the covariance (m, m) of means of unit first-order Gauss-Markov noise over stretches.

    Parameters
    ----------
    tau : float
        Correlation time, s.
    dt, start : (m,) float64
        As in `flicker_correlation`.
    """
    begin = np.cumsum(dt) - dt if start is None else start
    u = np.maximum(dt / tau, 1e-6)
    # Means of exp(-|t - t'| / tau) over two stretches: the gap between them, then each inside.
    gap = np.maximum(begin[:, None], begin[None, :]) - np.minimum(
        (begin + dt)[:, None], (begin + dt)[None, :]
    )
    inside = -np.expm1(-u) / u
    out = np.exp(-np.maximum(gap, 0.0) / tau) * inside[:, None] * inside[None, :]
    small = u < 1e-3
    own = np.where(small, 1.0 - u / 3.0, 2.0 * (u - 1.0 + np.exp(-u)) / np.maximum(u, 1e-3) ** 2)
    np.fill_diagonal(out, own)
    return np.asarray(out)


def mean_covariance(
    part: GyroSpec | AccelerometerSpec, start: Array, dt: Array, interval: float
) -> Array:
    """Return the covariance (m, m) of one axis' mean rate over stretches, without its bias.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    start, dt : (m,) float64
        Begin and length of each stretch, s, in order, without overlap.
    interval : float
        Sampling interval, s; it sets how far quantisation averages.
    """
    cov = np.diag(part.white**2 / dt)
    if part.bias_instability:
        cov += part.bias_instability**2 * flicker_correlation(dt, start)
    if part.gauss_markov:
        cov += part.gauss_markov**2 * gauss_markov_correlation(part.gauss_markov_time, dt, start)
    if part.drift:
        # A random walk from the first start on: min(t, t') between stretches, dt/3 within.
        begin = start - start[0]
        low = np.minimum(begin[:, None], begin[None, :])
        earlier = np.where(begin[:, None] <= begin[None, :], dt[:, None], dt[None, :])
        walk = low + 0.5 * earlier
        np.fill_diagonal(walk, begin + dt / 3.0)
        cov += part.drift**2 * walk
    if part.quantisation:
        q = part.quantisation**2
        cov += np.diag(q * (2.0 + interval / dt) / dt**2)
        # Neighbours that touch share the rounding at their common end.
        touch = np.flatnonzero(np.abs(start[1:] - start[:-1] - dt[:-1]) < 0.5 * interval)
        shared = -q / (dt[touch] * dt[touch + 1])
        cov[touch, touch + 1] += shared
        cov[touch + 1, touch] += shared
    return np.asarray(cov)
