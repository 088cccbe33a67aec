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
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.allan_variance.deviation import Allan
from schuler.allan_variance.theory import (
    NOISES,
    TERMS,
    correlations,
    filters,
    freedom,
    unit_variances,
)
from schuler.errors import InputError, expect
from schuler.sensors.errors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["MOVED", "ChannelFit", "NoiseFit", "NoiseTerm", "fit_noise"]

Array = NDArray[np.float64]

_DEMANDED = 9.0
"""A term stays when leaving it out costs so much chi-square: one false term in 700, one-sided."""

_UNLIKELY = 1e-3
"""Below this probability of the chi-square the model is said to miss the curve."""

MOVED = 0.8
"""A larger misfit is motion and no noise."""

_LEAST = 6
"""Octaves of averaging time that the terms need."""

_GYRO = ("quantisation", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")
_ACCEL = (
    "quantisation", "velocity_random_walk", "bias_instability", "acceleration_random_walk",
    "acceleration_ramp",
)  # fmt: skip
_GYRO_UNITS = ("arcsec", "deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)", "deg/h/h")
_ACCEL_UNITS = ("mm/s", "ug/sqrt(Hz)", "ug", "ug/sqrt(h)", "ug/h")


@dataclass(frozen=True)
class NoiseTerm:
    """One noise parameter, SI.

    Parameters
    ----------
    value, sigma : float or None
        The coefficient and its standard deviation; None where the record does not show it.
    below : float
        The coefficient is under this with 95 % confidence.
    unit : str
        The unit in which people speak of it.
    """

    value: float | None
    sigma: float | None
    below: float
    unit: str


@dataclass(frozen=True, eq=False)
class ChannelFit:
    """The noise of one channel.

    Parameters
    ----------
    terms : dict of str to NoiseTerm
        By the names that `GyroSpec` and `AccelerometerSpec` have for them: Q, N, B, K in order;
        then ``rate_ramp`` or ``acceleration_ramp``, but for Hadamard deviation, which is blind to
        it.
    misfit : float
        Relative error of the variance that the terms leave, beyond chance; 0 where they
        meet the curve. It is in the sigmas.
    chi2, dof : float, int
        Of the final fit; with a misfit, chi2 is about dof by construction.
    """

    terms: dict[str, NoiseTerm]
    misfit: float
    chi2: float
    dof: int

    def squares(self) -> Array:
        """Return the squared coefficients (5,), 0 for what is absent."""
        squares = np.zeros(len(TERMS))
        squares[: len(self.terms)] = [(t.value or 0.0) ** 2 for t in self.terms.values()]
        return squares


@dataclass(frozen=True, eq=False)
class NoiseFit(Result):
    """The noise of each channel of a record, and what it was found from."""

    source: Allan
    channels: dict[str, ChannelFit] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return deviations and fit with the keys of the JSON schema `schuler.allan/2`."""
        from schuler.allan_variance.output import to_dict

        return to_dict(self.source, self)

    def columns(self) -> dict[str, Any]:
        """Return averaging times, and deviation, bounds and fitted curve of each channel."""
        from schuler.allan_variance.output import columns

        return columns(self.source, self)

    def __str__(self) -> str:
        from schuler.allan_variance.output import fit_lines

        return "\n".join(fit_lines(self))

    def parts(self, channel: str, tau: Array) -> Array:
        """Return the fitted deviation of each term (k, 5) at averaging times (s)."""
        unit = unit_variances(self.source.kind, tau, self.source.duration)
        return np.asarray(np.sqrt(unit * self.channels[channel].squares()))

    def curve(self, channel: str, tau: Array) -> Array:
        """Return the fitted deviation (k,) at averaging times (s)."""
        return np.asarray(np.sqrt(np.sum(self.parts(channel, tau) ** 2, axis=1)))

    def export(
        self, tool: str, path: str | Path, *, inflate: float = 1.0, topic: str = "/imu0"
    ) -> None:
        """Write another tool's file of noise parameters; see `schuler.allan_variance.export`.

        Parameters
        ----------
        tool : {"kalibr", "openvins", "vins", "px4", "ros"}
        path : str or Path
        inflate : float
            What all densities are multiplied by.
        topic : str
            Of the IMU's messages, for tools that name it.

        Raises
        ------
        InputError
            For another tool, a factor that is not positive, a record in motion, or if the file
            cannot be written.
        """
        from schuler.allan_variance.export import export_noise

        export_noise(self, tool, path, inflate=inflate, topic=topic)

    def warnings(self) -> list[str]:
        """Return where the terms do not meet the curve, in a sentence."""
        out = []
        for moved in (False, True):
            off = [
                f"{c} ({100 * f.misfit:.0f} %)"
                for c, f in self.channels.items()
                if f.misfit > 0.0 and (f.misfit > MOVED) == moved
            ]
            if off and moved:
                out.append(
                    f"{', '.join(off)}: this is not the noise of an instrument at rest (the curve "
                    "is so far off any sum of the terms): take a stretch at rest with --start "
                    "and --stop, and trust no figure of these channels"
                )
            elif off:
                out.append(
                    f"{', '.join(off)}: no sum of the terms meets the curve better (in "
                    "parts of the variance), as when the instrument filters; the sigmas include it"
                )
        return out

    def to_spec(self, name: str = "static record") -> ImuSpec:
        """Return an instrument specification: each figure the rms over the fitted axes.

        Bias, scale factor and misalignment do not show in a static record's noise and stay 0:
        add at least the bias before predicting an alignment's accuracy.
        """
        tables: list[dict[str, float]] = []
        for part, names in (("gyro", _GYRO), ("accel", _ACCEL)):
            squares = [f.squares() for c, f in self.channels.items() if c.startswith(part)]
            rms = np.sqrt(np.mean(squares, axis=0)) if squares else np.zeros(len(names))
            # A ramp is no noise, and an instrument that was warming up has another the next day.
            tables.append(dict(zip(names[:NOISES], rms[:NOISES].tolist(), strict=True)))
        return ImuSpec(
            GyroSpec(**tables[0]),
            AccelerometerSpec(**tables[1]),
            name=name,
            source=f"{self.source.kind} deviation of {self.source.name}, "
            f"{self.source.duration:.6g} s",
        )


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
        Terms that the record does not show (leaving them out costs less than 9 of chi-square)
        have no value but a limit.

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
