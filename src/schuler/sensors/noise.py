"""Random errors of an instrument, drawn from its specification onto true increments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.errors import AccelerometerSpec, GyroSpec

__all__ = ["Drawn", "corrupt"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drawn:
    """Increments with errors, and the constant bias (SI, per axis) that is in them."""

    increments: Array
    bias: Array


def corrupt(
    increments: Array,
    dt: Array,
    part: GyroSpec | AccelerometerSpec,
    rng: np.random.Generator,
    bias: ArrayLike | None = None,
) -> Drawn:
    """Add bias and noise by type to increments.

    Parameters
    ----------
    increments : (n, m) float64
        rad or m/s.
    dt : (n,) float64
        s.
    part : GyroSpec or AccelerometerSpec
        1-sigma figures per axis.
    rng : numpy.random.Generator
    bias : (m,) array_like, optional
        A fixed bias; drawn from the specification when not given.

    Raises
    ------
    InputError
        If the bias has the wrong shape.
    """
    n, m = increments.shape
    if bias is None:
        constant = np.multiply(part.bias, rng.standard_normal(m))
    else:
        constant = np.asarray(bias, np.float64)
        if constant.shape != (m,):
            raise InputError(f"expected a bias of shape ({m},), got {constant.shape}")
    out: Array = increments + constant * dt[:, None]
    if part.white:
        out += part.white * np.sqrt(dt)[:, None] * rng.standard_normal((n, m))
    if part.drift:
        steps = part.drift * np.sqrt(dt)[:, None] * rng.standard_normal((n, m))
        out += (np.cumsum(steps, axis=0) - 0.5 * steps) * dt[:, None]
    if part.bias_instability:
        _flicker(out, dt, part.bias_instability, rng)
    if part.quantisation:
        step = part.quantisation * np.sqrt(12.0)
        total = np.cumsum(out, axis=0) + step * rng.uniform(0, 1, m)
        out = np.diff(np.floor(total / step), axis=0, prepend=0.0) * step
    return Drawn(out, constant)


def _flicker(out: Array, dt: Array, level: float, rng: np.random.Generator) -> None:
    """Add 1/f noise: Gauss-Markov processes, three a decade, from one sample to the record."""
    from schuler.kernels.noise import gauss_markov

    sigma = level * np.sqrt(np.log(10.0) / 3.0 / np.pi)
    steps = np.arange(np.log10(0.3 * dt.min()), np.log10(100.0 * dt.sum()), 1.0 / 3.0)
    for tau in 10.0**steps:
        state = sigma * rng.standard_normal(out.shape[1])
        gauss_markov(dt, float(tau), sigma, state, rng.standard_normal(out.shape), out)
