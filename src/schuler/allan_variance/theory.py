"""What noise does to Allan, Hadamard and total variance: expected values, spectra, freedom.

Terms and symbols are those of `schuler.sensors.errors` (IEEE Std 952-1997, annex C): quantisation
Q, random walk N, bias instability B, rate random walk K, and the rate ramp R, a steady drift. Each
adds its squared coefficient times a function of the averaging time.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "KINDS",
    "NOISES",
    "TERMS",
    "Kind",
    "bounds",
    "correlations",
    "degrees_of_freedom",
    "filters",
    "freedom",
    "unit_variances",
]

Array = NDArray[np.float64]
Lags = NDArray[np.int64]

Kind = Literal["allan", "hadamard", "total"]

#: the kinds of deviation
KINDS: tuple[Kind, ...] = get_args(Kind)

#: quantisation, angle or velocity random walk, bias instability, rate random walk, rate ramp
TERMS = ("Q", "N", "B", "K", "R")

#: how many of them are noise; the ramp is none, and has no scatter of its own
NOISES = 4

_ALPHAS = (2, 0, -1, -2)
"""Powers of frequency: white phase (Q), white rate (N), flicker rate (B), random walk rate (K)."""

_STEPS = 16
"""Steps to an averaging time in sums over lags."""

_REACH = 64
"""Averaging times that such a sum goes on."""

#: total deviation, for N, B and K: edf = b T/tau - c, expected over Allan variance 1 - a tau/T
_TOTAL = {0: (1.50, 0.0, 0.0), -1: (1.17, 0.22, 1.0 / (3.0 * np.log(2.0))), -2: (0.93, 0.36, 0.75)}


def unit_variances(kind: Kind, tau: Array, duration: float) -> Array:
    """Return the expected variance (k, 5) of each of `TERMS` with coefficient 1.

    Allan: 3/tau^2, 1/tau, 2 ln2/pi, tau/3, tau^2/2 (IEEE Std 952-1997, C.1). Hadamard: from the
    same spectra by third differences, 10/(3 tau^2), 1/tau, ln(256/27)/(2 pi), tau/6, and none of
    a ramp. Total: Allan's, with its known bias for B and K (NIST SP 1065, table 9), for Q and for
    R, whose curvature the reflection turns over.

    Parameters
    ----------
    kind : {"allan", "hadamard", "total"}
    tau : (k,) float64
        s.
    duration : float
        Length of the record, s.
    """
    one = np.ones_like(tau)
    if kind == "hadamard":
        parts = [10.0 / 3.0 / tau**2, 1.0 / tau, np.log(256.0 / 27.0) / (2.0 * np.pi) * one,
                 tau / 6.0, 0.0 * one]  # fmt: skip
    else:
        parts = [3.0 / tau**2, 1.0 / tau, 2.0 * np.log(2.0) / np.pi * one, tau / 3.0,
                 0.5 * tau**2]  # fmt: skip
    if kind == "total":
        # A reflected point brings the end's rounding with it: 10 instead of 6 squares, twice tau/T.
        parts[0] = parts[0] * (1.0 + 4.0 / 3.0 * tau / duration)
        # Within tau of an end a ramp's differences are (2u - u^2) of the others', u = t/tau.
        parts[4] = parts[4] * (1.0 - 14.0 / 15.0 * np.minimum(tau / duration, 0.5))
        for k, alpha in ((2, -1), (3, -2)):
            parts[k] = parts[k] * (1.0 - _TOTAL[alpha][2] * np.minimum(tau / duration, 0.5))
    return np.column_stack(parts)


def _phase_covariance(alpha: int, t: Array) -> Array:
    """Return the generalised autocovariance of a power-law phase, times any constant."""
    u = np.abs(t)
    if alpha == 0:
        return -u
    if alpha == -1:
        return np.asarray(u**2 * np.log(np.where(u > 0.0, u, 1.0)))
    return np.asarray(u**3)


def _freedom(kind: Kind, alpha: int, lag: int, samples: int) -> float:
    """Return the degrees of freedom of an overlapping variance of power-law noise.

    2 E^2 / Var with Var = (2/M^2) sum over i, j of s(i-j)^2 for M differences with
    autocovariance s (Greenhall & Riley 2003, "Uncertainty of stability variances based on finite
    differences", eq. 6 to 10), summed at 16 steps to an averaging time.
    """
    order = 3 if kind == "hadamard" else 2
    weights = np.array([20.0, -15.0, 6.0, -1.0] if order == 3 else [6.0, -4.0, 1.0])
    count = max(samples + 1 - order * lag, 1)
    if alpha == 2:
        # Only differences a whole number of lags apart share a point.
        away = np.arange(1, order + 1)
        share = np.maximum(1.0 - away * lag / count, 0.0)
        return float(count / (1.0 + 2.0 * np.sum(share * (weights[1:] / weights[0]) ** 2)))
    steps = min(lag, _STEPS)
    m = max(count * steps / lag, 1.0)
    j = np.arange(0.0, min(m, _REACH * steps))
    t = j / steps
    s = weights[0] * _phase_covariance(alpha, t)
    for k, w in enumerate(weights[1:], 1):
        s = s + w * (_phase_covariance(alpha, t + k) + _phase_covariance(alpha, t - k))
    ratio = (s / s[0]) ** 2
    return float(m / (1.0 + 2.0 * np.sum((1.0 - j[1:] / m) * ratio[1:])))


def _nearest_power(deviation: Array, lags: Lags, samples: int) -> Lags:
    """Return for each deviation which of `_ALPHAS` its local slope is nearest to."""
    x = np.log(lags.astype(np.float64))
    with np.errstate(divide="ignore"):
        y = 2.0 * np.log(deviation)
    index = np.zeros(len(lags), np.int64)
    for k in range(len(lags)):
        near = (np.abs(x - x[k]) <= np.log(2.9)) & np.isfinite(y)
        # The end of the curve scatters too much to have a slope: it keeps the one before.
        if lags[k] > samples / 8 and k and lags[0] <= samples / 8:
            index[k] = index[k - 1]
        elif near.sum() < 2 or not np.isfinite(y[k]):
            index[k] = 1
        else:
            slope = float(np.polyfit(x[near] - x[k], y[near], 1)[0])
            index[k] = int(np.clip(np.rint(slope + 2.0), 0, 3))
    # Redder noise takes over as time grows. A chance dip at long times would else pass for
    # rounding, which has a thousand times the freedom there.
    return np.asarray(np.maximum.accumulate(index))


def freedom(kind: Kind, lags: Lags, samples: int) -> Array:
    """Return the degrees of freedom (k, 4) that variances would have under each noise alone.

    Total deviation: edf = b T/tau - c of NIST SP 1065, table 8, and Allan's where that is more
    (short times) or for quantisation.

    Parameters
    ----------
    kind : {"allan", "hadamard", "total"}
    lags : (k,) int64
        Averaging times in samples.
    samples : int
        Length of the record.
    """
    table = np.array([[_freedom(kind, a, int(m), samples) for a in _ALPHAS] for m in lags])
    if kind == "total":
        for k, alpha in enumerate(_ALPHAS[1:], 1):
            b, c, _ = _TOTAL[alpha]
            whole = b * samples / lags - c
            table[:, k] = np.where(lags > 8, np.maximum(table[:, k], whole), table[:, k])
    return np.asarray(np.maximum(table, 1.0))


def degrees_of_freedom(kind: Kind, deviation: Array, lags: Lags, samples: int) -> Array:
    """Return equivalent degrees of freedom for each deviation (k, c).

    The noise at each averaging time is taken for the power law that the curve's local slope is
    nearest to. Other parameters as in `freedom`.
    """
    table = freedom(kind, lags, samples)
    rows = np.arange(len(lags))
    return np.column_stack([table[rows, _nearest_power(d, lags, samples)] for d in deviation.T])


def bounds(deviation: Array, edf: Array, confidence: float = 0.6827) -> tuple[Array, Array]:
    """Return the chi-square confidence bounds of deviations: equal tails outside.

    Parameters
    ----------
    deviation, edf : (k, c) float64
    confidence : float
    """
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - confidence)
    half = 0.5 * edf
    return (
        np.asarray(deviation * np.sqrt(half / gammaincinv(half, 1.0 - tail))),
        np.asarray(deviation * np.sqrt(half / gammaincinv(half, tail))),
    )


def filters(kind: Kind, tau: Array, interval: float, duration: float) -> tuple[Array, Array]:
    """Return angular frequencies (n,) and the estimators' filters on the phase (n, k).

    The filters hold the square root of the step, so that sums over n are integrals.

    Parameters
    ----------
    kind : {"allan", "hadamard", "total"}
        Total is taken as Allan: differences at the ends of the record are passed over.
    tau : (k,) float64
        s.
    interval, duration : float
        Sampling interval and length of the record, s.
    """
    f = np.geomspace(0.2 / duration, 0.5 / interval, 6000)
    power = 6 if kind == "hadamard" else 4
    filtered = np.sin(np.pi * f[:, None] * tau) ** power * np.sqrt(f)[:, None]
    return 2.0 * np.pi * f, np.asarray(filtered)


def correlations(w: Array, filtered: Array, interval: float, squares: Array) -> Array:
    """Return the correlation (k, k) of the estimates at different averaging times.

    The covariance of two of them is in proportion to the integral of S^2 |H1|^2 |H2|^2, S the
    spectrum of the noise (Percival & Walden 2000, section 8.3).

    Parameters
    ----------
    w, filtered : (n,), (n, k) float64
        From `filters`.
    interval : float
        Sampling interval, s.
    squares : (5,) float64
        Squared coefficients of `TERMS`; those of the noises are looked at.
    """
    q, n, b, k = squares[:NOISES]
    # The phase's spectrum: white rounding of samples, else the rate's over w^2.
    phase = (n + b / w + k / w**2) / w**2 + q * interval
    parts = filtered * phase[:, None]
    cov = parts.T @ parts
    size = np.sqrt(np.diag(cov))
    return np.asarray(cov / size[:, None] / size)
