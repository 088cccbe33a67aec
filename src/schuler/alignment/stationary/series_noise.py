"""Noise of the two series that depends on the lengths of the stretches and on the instrument alone.

Records of one length, the runs of a campaign and windows of one record share it: it is kept for the
last few.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.stationary.uncertainty import part_covariance
from schuler.constants import MICRO_G
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["rounded_lengths", "specified_noise", "white_noise"]

Array = NDArray[np.float64]

PARTS = 4
"""Parts of a stretch in which its noise is looked at."""

_LEAST_WHITE = 0.3 * MICRO_G
"""Least noise of the force, m/s^2/sqrt(Hz)."""

_DIGITS = 11
"""Decimals of a length in s that count: time stamps of one record are rounded otherwise at its end
than at its begin."""


def rounded_lengths(dt: Array) -> bytes:
    """Return lengths of stretches, s, without their last digits, to look kept values up by."""
    return np.round(dt, _DIGITS).tobytes()


def white_noise(dt: Array, g: float) -> tuple[Array, Array]:
    """Return what white noise of unit density makes of the series' velocity, and of both.

    Parameters
    ----------
    dt : (m,) float64
        Lengths of the stretches, s.
    g : float
        m/s^2.

    Returns
    -------
    (m, m), (2m + 1, 2m + 1) float64
        By noise of the force; by noise of the rate, of attitude, velocity and, last, the attitude
        at the end. Not to be changed.
    """
    return _white_noise(rounded_lengths(dt), g)


def specified_noise(dt: Array, interval: float, g: float, spec: ImuSpec) -> tuple[Array, Array]:
    """Return the covariances that a specification's noise makes, as `white_noise` has them.

    Biases are unknowns, and no noise.

    Parameters
    ----------
    dt : (m,) float64
        Lengths of the stretches, s.
    interval : float
        Sampling interval, s.
    g : float
        m/s^2.
    spec : ImuSpec
    """
    return _specified(rounded_lengths(dt), round(interval, 12), g, spec)


@lru_cache(maxsize=4)
def _white_noise(lengths: bytes, g: float) -> tuple[Array, Array]:
    dt = np.frombuffer(lengths)
    walk, double, short = _responses(dt)
    made = _of_white_noise(walk, double, short, dt, g)
    for each in made:
        each.flags.writeable = False
    return made


@lru_cache(maxsize=4)
def _specified(lengths: bytes, interval: float, g: float, spec: ImuSpec) -> tuple[Array, Array]:
    dt = np.frombuffer(lengths)
    wander, unit = _white_noise(lengths, g)
    walk, double, short = _responses(dt)
    # The last row is the attitude at the end, which responds to all increments in full.
    stacked = np.vstack([walk, g * double, np.ones((1, walk.shape[1]))])
    # Means over stretches are no better than this, whatever an instrument is said to be.
    force = max(_LEAST_WHITE**2 - spec.accelerometer.white**2, 0.0) * wander
    force += _noise(spec.accelerometer, walk, short, interval, wander)
    gyro = _noise(spec.gyro, stacked, short, interval, unit)
    force.flags.writeable = gyro.flags.writeable = False
    return force, gyro


def _noise(
    part: GyroSpec | AccelerometerSpec, response: Array, dt: Array, interval: float, unit: Array
) -> Array:
    """Return the covariance (a, a) of quantities that answer to increments by (a, m).

    `unit` (a, a) is what white noise of unit density makes.
    """
    found = part_covariance(replace(part, bias=0.0), response.T[:, :, None], dt, interval, unit)
    return np.asarray(sum(found.values(), np.zeros((len(response), len(response)))))


def _of_white_noise(
    walk: Array, double: Array, short: Array, dt: Array, g: float
) -> tuple[Array, Array]:
    """Return what white noise of unit density makes of the responses of `_responses`.

    Of two stretches, the later one responds to what the earlier one sees in full (once summed), or
    by the time since then (twice summed), so that sums over the earlier one's parts are enough.

    Returns
    -------
    (m, m), (2m + 1, 2m + 1) float64
        Of `walk`; and of `walk`, `g * double` and a last row of ones.
    """
    m = len(dt)
    middle = np.cumsum(short) - 0.5 * short
    at = middle.reshape(m, -1).mean(axis=1)
    weighted, doubly = walk * short, double * short
    once, moment = weighted.sum(axis=1), weighted @ middle
    twice, moment_of_twice = doubly.sum(axis=1), doubly @ middle
    # Rows are the earlier stretch, columns the later one; both alike on the diagonal.
    wander = _both_ways(np.repeat(once[:, None], m, axis=1), np.sum(weighted * walk, axis=1))
    tilt_effect = _both_ways(
        at * twice[:, None] - moment_of_twice[:, None], np.sum(doubly * double, axis=1)
    )
    later = at * once[:, None] - moment[:, None]
    mixed = np.triu(later, 1) + np.tril(np.repeat(twice[None, :], m, axis=0), -1)
    mixed[np.diag_indices(m)] = np.sum(weighted * double, axis=1)
    unit = np.empty((2 * m + 1, 2 * m + 1))
    unit[:m, :m], unit[m:-1, m:-1] = wander, g * g * tilt_effect
    unit[:m, m:-1], unit[m:-1, :m] = g * mixed, g * mixed.T
    unit[-1, :m] = unit[:m, -1] = once
    unit[-1, m:-1] = unit[m:-1, -1] = g * twice
    unit[-1, -1] = short.sum()
    return wander, unit


def _both_ways(upper: Array, diagonal: Array) -> Array:
    """Return a symmetric matrix of what stands above the diagonal and on it."""
    half = np.triu(upper, 1)
    out = half + half.T
    out[np.diag_indices(len(out))] = diagonal
    return np.asarray(out)


def _responses(dt: Array) -> tuple[Array, Array, Array]:
    """Return how means over stretches answer to increments, once and twice summed.

    The increments are those of the stretches' parts: summed over whole ones, a random walk would
    have no noise at the highest frequency, and least squares would trust it there without end.

    Returns
    -------
    (m, k), (m, k), (k,) float64
        Responses, and the lengths of the parts, s.
    """
    m = len(dt)
    short = np.repeat(dt / PARTS, PARTS)
    # The time between the middles of two parts, by means over the parts of a stretch.
    middle = np.cumsum(short) - 0.5 * short
    parts = middle.reshape(m, PARTS)
    twice = np.maximum(parts.mean(axis=1)[:, None] - middle, 0.0)
    inside = np.maximum(parts[:, :, None] - parts[:, None, :], 0.0)
    inside += 0.25 * (dt / PARTS)[:, None, None] * np.eye(PARTS)
    own = np.arange(m)
    twice.reshape(m, m, PARTS)[own, own] = inside.mean(axis=1)
    return _once_summed(m), twice, short


@lru_cache(maxsize=8)
def _once_summed(m: int) -> Array:
    """Return how means over m stretches answer to increments of their parts, once summed."""
    k = m * PARTS
    once = np.tril(np.ones((k, k)), -1) + 0.5 * np.eye(k)
    mean = once.reshape(m, PARTS, k).mean(axis=1)
    mean.flags.writeable = False
    return np.asarray(mean)
