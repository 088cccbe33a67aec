"""Noise parameters from Allan-type deviations, with confidence; from a static record to a spec.

Generalised least squares on the variances at octaves of the averaging time, with the squared
coefficients held at zero or above. The covariance of the variances follows from the fitted noise
itself (degrees of freedom, and the correlation between averaging times from the spectrum), and is
iterated: the weights come from the model and never from the scattered data, so the estimate is
not drawn down by them. A steady drift is a term of its own (rate ramp), which scatters only with
the noise it is seen through. Where no sum of the five terms meets the curve, a relative misfit is
added that makes the chi-square its own expectation. Terms that the data do not demand are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from schuler.allan_variance.deviation import Allan
from schuler.allan_variance.noise_fit import (
    _ACCEL,
    _ACCEL_UNITS,
    _GYRO,
    _GYRO_UNITS,
    ChannelFit,
    NoiseFit,
    NoiseTerm,
)
from schuler.allan_variance.theory import (
    NOISES,
    TERMS,
    correlations,
    filters,
    freedom,
    unit_variances,
)
from schuler.errors import InputError, expect

__all__ = ["fit_noise"]

Array = NDArray[np.float64]

_DEMANDED = 9.0
"""A term stays when leaving it out costs so much chi-square: one false term in 700, one-sided."""

_UNLIKELY = 1e-3
"""Below this probability of the chi-square the model is said to miss the curve."""


_LEAST = 6
"""Octaves of averaging time that the terms need."""


def _octaves(tau: Array) -> list[int]:
    """Return every averaging time that is at least 1.9 times the one before."""
    keep = [0]
    for k in range(1, len(tau)):
        if tau[k] >= 1.9 * tau[keep[-1]]:
            keep.append(k)
    return keep


class _Problem:
    """The variances of one channel, their expected values and their covariance."""

    def __init__(self, y: Array, unit: Array, edf: Array, correlate: Callable[[Array], Array]):
        self.y, self.unit, self.edf = y, unit, edf
        self.correlate = correlate
        self.correlation = np.eye(len(y))
        self.misfit = 0.0
        # Hadamard deviation is blind to a ramp.
        self.visible = [k for k in range(len(TERMS)) if unit[:, k].any()]

    def model(self, squares: Array) -> Array:
        """Return the expected variances, a thousandth of those found at the least."""
        return np.asarray(np.maximum(self.unit @ squares, 1e-3 * self.y))

    def root(self, squares: Array) -> Array:
        """Return the lower Cholesky factor of the variances' covariance."""
        v = self.model(squares)
        share = self.unit * squares / v[:, None]
        noise, ramp = share[:, :NOISES], share[:, NOISES]
        # An upper bound: as if the covariances of all terms had one shape.
        spread = v * math.sqrt(2.0) * np.sum(noise / np.sqrt(self.edf), axis=1)
        # A ramp has no scatter of its own: only its product with the noise has.
        product = 2.0 * v * np.sqrt(ramp * np.sum(noise / self.edf, axis=1))
        spread = np.hypot(spread, product)
        spread = np.maximum(spread, 1e-6 * v)
        cov = self.correlation * spread[:, None] * spread
        cov[np.diag_indices_from(cov)] += (self.misfit**2 + 1e-12) * v**2 + 1e-3 * spread**2
        return np.asarray(np.linalg.cholesky(cov))

    def step(self, active: list[int], root: Array) -> tuple[Array, Array]:
        """Return squares and the active terms' covariance for given weights."""
        from scipy.optimize import nnls

        a = np.linalg.solve(root, self.unit[:, active])
        b = np.linalg.solve(root, self.y)
        # Terms differ by many powers of ten: solve for them in units of what each can explain.
        scale = np.linalg.norm(a, axis=0)
        inside = a / scale
        squares = np.zeros(len(TERMS))
        squares[active] = nnls(inside, b)[0] / scale
        cov = np.linalg.pinv(inside.T @ inside) / scale[:, None] / scale
        return squares, np.asarray(cov)

    def surprise(self, squares: Array) -> tuple[float, float]:
        """Return how surprising the data are: a chi-square, and a cost to compare models by.

        The cube root of a chi-square number is normal nearly from one degree of freedom on
        (Wilson & Hilferty 1931), which its plain value is not: a long averaging time that
        came out at five times its expectation is no reason for another term. The cost adds
        what minus twice the logarithm of the density has beside it.
        """
        v = self.model(squares)
        root = self.root(squares)
        cov = root @ root.T
        variance = np.diag(cov) / v**2 / 9.0
        z = (np.cbrt(self.y / v) - (1.0 - variance)) / np.sqrt(variance)
        spread = np.sqrt(np.diag(cov))
        chi2 = float(z @ np.linalg.solve(cov / spread[:, None] / spread, z))
        return chi2, chi2 + float(np.sum(np.log(variance)) + 2.0 / 3.0 * np.sum(np.log(v)))

    def solve(self, active: list[int], start: Array) -> tuple[Array, Array]:
        """Return squares and the active terms' covariance, the weights iterated."""
        squares = start
        for _ in range(60):
            new, cov = self.step(active, self.root(squares))
            change = np.abs(self.model(new) / self.model(squares) - 1.0).max()
            squares = new
            if change < 1e-7:
                break
        return squares, cov


def _meet(problem: _Problem, squares: Array, dof: int) -> tuple[Array, Array]:
    """Find the relative misfit that the full model needs for a likely chi-square; fit it."""
    from scipy.special import gammaincc

    everything = problem.visible
    squares, cov = problem.solve(everything, squares)
    if gammaincc(0.5 * dof, 0.5 * problem.surprise(squares)[0]) >= _UNLIKELY:
        return squares, cov
    low, high = math.log(1e-6), math.log(10.0)
    for _ in range(30):
        middle = 0.5 * (low + high)
        problem.misfit = math.exp(middle)
        squares, cov = problem.solve(everything, squares)
        if problem.surprise(squares)[0] > dof:
            low = middle
        else:
            high = middle
    return squares, cov


def _fit(problem: _Problem, names: tuple[str, ...], units: tuple[str, ...]) -> ChannelFit:
    active = list(problem.visible)
    # A first guess with relative weights of the data themselves.
    root = np.diag(problem.y * np.sqrt(2.0 / problem.edf.min(axis=1)))
    squares = problem.step(active, root)[0]
    for _ in range(4):
        problem.correlation = problem.correlate(squares)
        squares = problem.solve(active, squares)[0]
    squares, cov = _meet(problem, squares, len(problem.y) - len(active))
    limits = np.zeros(len(TERMS))
    limits[active] = np.sqrt(squares[active] + 1.645 * np.sqrt(np.diag(cov)))
    while len(active) > 1:
        here = problem.surprise(squares)[1]
        fewer = [[a for a in active if a != k] for k in active]
        fits = [problem.solve(some, squares) for some in fewer]
        costs = [problem.surprise(found)[1] - here for found, _ in fits]
        cheapest = int(np.argmin(costs))
        if costs[cheapest] >= _DEMANDED:
            break
        active, (squares, cov) = fewer[cheapest], fits[cheapest]
    terms = {}
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        if k not in problem.visible:
            continue
        if k in active and squares[k] > 0.0:
            value = math.sqrt(squares[k])
            at = active.index(k)
            sigma = 0.5 * math.sqrt(cov[at, at]) / value
            terms[name] = NoiseTerm(value, sigma, value + 1.645 * sigma, unit)
        else:
            terms[name] = NoiseTerm(None, None, float(limits[k]), unit)
    return ChannelFit(
        terms, problem.misfit, problem.surprise(squares)[0], len(problem.y) - len(active)
    )


def fit_noise(found: Allan) -> NoiseFit:
    """Fit quantisation, random walk, bias instability, rate random walk and ramp to each channel.

    Parameters
    ----------
    found : Allan
        From `allan`; averaging times over six octaves or more.

    Returns
    -------
    NoiseFit
        Terms that are not observable in the record (leaving them out costs less than 9 of
        chi-square) have no value but a limit.

    Raises
    ------
    InputError
        If there are too few averaging times.

    Examples
    --------
    >>> found = sc.fit_noise(sc.allan(record))
    >>> len(found.channels)
    6
    """
    expect(found, Allan, "found", "it is what schuler.allan gives of a record")
    keep = _octaves(found.tau)
    if len(keep) < _LEAST:
        raise InputError(
            f"{found.name}: the noise fit needs averaging times over {_LEAST} octaves, got "
            f"{len(keep)} ({found.tau[0]:g} to {found.tau[-1]:g} s); use a longer record or more "
            "--taus"
        )
    tau = found.tau[keep]
    lags = np.rint(tau / found.interval).astype(np.int64)
    unit = unit_variances(found.kind, tau, found.duration)
    edf = freedom(found.kind, lags, found.samples)
    w, filtered = filters(found.kind, tau, found.interval, found.duration)
    out: dict[str, ChannelFit] = {}
    for name, deviation in zip(found.channels, found.deviation[keep].T, strict=True):
        gyro = name.startswith("gyro")
        names, units = (_GYRO, _GYRO_UNITS) if gyro else (_ACCEL, _ACCEL_UNITS)
        if not deviation.any():
            absent = [NoiseTerm(None, None, 0.0, unit_name) for unit_name in units]
            out[name] = ChannelFit(dict(zip(names, absent, strict=True)), 0.0, 0.0, len(tau))
            continue
        problem = _Problem(
            deviation**2, unit, edf, lambda s: correlations(w, filtered, found.interval, s)
        )
        out[name] = _fit(problem, names, units)
    return NoiseFit(found, out)
