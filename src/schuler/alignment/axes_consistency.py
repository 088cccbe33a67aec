"""Whether gyros and accelerometers name the same axes, in one unit: f must turn as w says.

For the low frequencies of a base that moves, f = f0 - theta x f0 + a, with the gyros' angle theta
and an acceleration `a` of unknown spectrum; a lever arm adds a part proportional to frequency
squared. The likelihood of this, with the acceleration's spectrum estimated in bands, is compared
over all 48 ways of naming the gyros' axes, and with gyros that were read as degrees for radians or
radians for degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History
from schuler.constants import DEG
from schuler.kernels.states import TrackerNode

__all__ = ["AXES_MARGIN", "AxesTest", "axes_test", "axes_text"]

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

AXES_MARGIN = 15.0
"""Log likelihood by which another naming of the axes must be better."""

_HIGHEST = 1.0
"""Frequency (Hz) up to which the force is looked at: above, a vehicle's shaking hides its tilt."""

_LARGEST = 0.3
"""Angle (rad) of the base within a span beyond which small angles say nothing."""

_LOST = 0.005
"""Share of a span in stretches with lost rows beyond which it says nothing."""

_LEAST = 64
"""Intervals that are enough."""


@dataclass(frozen=True)
class AxesTest:
    """Whether the force turns in the body as the gyros say.

    Parameters
    ----------
    margin : float
        Log likelihood of the best naming of the gyros' axes over the given one.
    axes : str
        The best naming, as ``-x,-y,-z``; ``x,y,z`` where the given one is the best.
    mirrored : bool
        Whether both triads in a mirror would fit as well: it looks like gyros of the other sign.
    scale : float
        What the gyros must be multiplied by to fit best; 1 where the given unit does.
    """

    margin: float
    axes: str
    mirrored: bool
    scale: float = 1.0


_DIGITS = 1e-13
"""Part of a sum of squares below which its difference to another is rounding."""


_SCALES = (1.0 / DEG, DEG)
"""What gyros of a wrong unit are multiplied by."""


@lru_cache(maxsize=1)
def _namings() -> tuple[Array, tuple[str, ...]]:
    """Return what the gyros are tried as (52, 3, 3), and the names of the first 48.

    The 48 signed permutations, the identity first; the given axes in other units; both triads in a
    mirror, which turns as gyros of the other sign; and no turn at all: the gyros show their noise.
    """
    found, names = [], []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            found.append(matrix)
            names.append(
                ",".join(
                    f"{'-' if s < 0 else ''}{'xyz'[k]}" for k, s in zip(order, signs, strict=True)
                )
            )
    scaled = [scale * np.eye(3) for scale in _SCALES]
    return np.array([*found, *scaled, -np.eye(3), np.zeros((3, 3))]), tuple(names)


@dataclass(frozen=True, eq=False)
class _Bands:
    """The frequencies that are looked at.

    Parameters
    ----------
    used : (n // 2 + 1,) bool
        Of the transform's frequencies.
    frequency : (k,) float64
        Hz.
    edges : (b + 1,) int64
        Of the bands within `frequency`.
    """

    used: NDArray[np.bool_]
    frequency: Array
    edges: NDArray[np.int64]

    @classmethod
    def of(cls, n: int, step: float) -> _Bands | None:
        """Make it for n intervals of `step` s; None where too few frequencies are left."""
        frequency = np.asarray(np.fft.rfftfreq(n, step), np.float64)
        used = (frequency >= 3.0 / (n * step)) & (frequency <= min(_HIGHEST, 0.2 / step))
        count = int(used.sum())
        if count < 12:
            return None
        return cls(used, frequency[used], _band_edges(count))

    def spectrum(self, x: Array) -> Spectrum:
        """Return the spectrum (k, c) of series (n, c)."""
        _, window = _trend_and_window(len(x))
        return np.asarray(np.fft.rfft(x * window, axis=0)[self.used])


@lru_cache(maxsize=8)
def _band_edges(count: int) -> NDArray[np.int64]:
    """Return the edges of bands within `count` frequencies, narrow at the low end."""
    bands = max(3, int(count**0.5))
    edges = np.unique(np.round(np.geomspace(4, count + 4, bands + 1))).astype(np.int64) - 4
    edges[0] = 0
    return edges


@lru_cache(maxsize=8)
def _trend_and_window(n: int) -> tuple[Array, Array]:
    """Return orthonormal parabolas (n, 3), and a Hann window (n, 1) that keeps the power."""
    trend, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, n), 3))
    return np.asarray(trend), np.hanning(n)[:, None] / np.sqrt(0.375 * n)


def _left(x: Array) -> Array:
    """Return series (n, c) without their parabola: a bias and a drift leak into all else."""
    trend, _ = _trend_and_window(len(x))
    return np.asarray(x - trend @ (trend.T @ x))


def axes_test(h: History, spans: Sequence[tuple[float, float]] | None = None) -> AxesTest | None:
    """Compare how the force turns in the body with the gyros, over all namings of their axes.

    Parameters
    ----------
    h : History
    spans : sequence of (float, float), optional
        Start and end of the dwells, s since the start; the whole record when not given. What is
        turned on purpose turns too far for small angles.

    Returns
    -------
    AxesTest, or None where no span has enough nodes.
    """
    namings, names = _namings()
    log = np.zeros(len(namings))
    told = False
    for begin, end in [(0.0, h.duration)] if spans is None else spans:
        first, last = np.searchsorted(h.t, [begin - 1e-9, end + 1e-9]) - [0, 1]
        part = _of_span(h.rows[first : last + 1], namings)
        if part is not None:
            log += part
            told = True
    if not told:
        return None
    best = int(np.argmax(log[:-2]))
    margin = float(log[best] - max(log[0], log[-1]))
    if margin < AXES_MARGIN:
        return AxesTest(max(margin, 0.0), names[0], mirrored=False)
    if best >= len(names):
        return AxesTest(margin, names[0], mirrored=False, scale=_SCALES[best - len(names)])
    return AxesTest(margin, names[best], mirrored=bool(log[-2] > log[best] - 3.0))


def _of_span(rows: Array, namings: Array) -> Array | None:
    """Return the log likelihood (k,) of each naming in one span of a history's rows."""
    # More instants than the highest frequency needs cost time, and say nothing.
    span = TrackerNode(rows[-1]).time - TrackerNode(rows[0]).time if len(rows) else 0.0
    stride = int(0.2 * (len(rows) - 1) / (_HIGHEST * span)) if span > 0.0 else 1
    if stride > 1:
        rows = rows[::stride]
    n = len(rows) - 1
    if n < _LEAST:
        return None
    nodes = TrackerNode(rows)
    dt = np.diff(nodes.time)
    step = dt / np.maximum(np.diff(nodes.updates), 1.0)
    # What stands in for lost rows does not turn as the base did.
    if dt[step > 3.0 * np.median(step)].sum() > _LOST * dt.sum():
        return None
    bands = _Bands.of(n, float(dt.mean()))
    if bands is None:
        return None
    angle = np.diff(nodes.sum_dtheta, axis=0)
    theta = np.cumsum(angle, axis=0) - 0.5 * angle
    theta = _left(theta)
    if np.abs(theta).max() > _LARGEST:
        return None
    f_b = np.diff(nodes.sum_dvel, axis=0) / dt[:, None]
    mean = (nodes.sum_dvel[-1] - nodes.sum_dvel[0]) / dt.sum()
    level = _level_axes(mean)
    both = bands.spectrum(np.concatenate([theta, _left(f_b @ level)], axis=1))
    turned, seen = both[:, :3], both[:, 3:]
    # -theta x f for each naming is theta @ its matrix.
    turning = np.einsum("mac,ab->mcb", namings, -_cross_matrix(mean) @ level)
    return _log_likelihood(turned, seen, turning, bands)


def _level_axes(f: Array) -> Array:
    """Return two unit vectors (3, 2) across a force."""
    across = _cross_matrix(f / np.linalg.norm(f))
    first = across[np.argmin(np.abs(f))]
    level = np.stack([first, -first @ across], axis=1)
    return np.asarray(level / np.linalg.norm(level, axis=0))


def _cross_matrix(f: Array) -> Array:
    """Return M with theta @ M = theta x f."""
    return np.array([[0.0, -f[2], f[1]], [f[2], 0.0, -f[0]], [-f[1], f[0], 0.0]])


def _log_likelihood(turned: Spectrum, seen: Spectrum, turning: Array, bands: _Bands) -> Array:
    """Return the log likelihood (m,) of each naming, the noise estimated in bands.

    What is left of the force is seen - turned @ turning - c f^2 (turned @ turning), c the lever
    arm's part, fitted for each. Its power in a band follows from products that all namings share.

    Parameters
    ----------
    turned, seen : (k, 3), (k, 2) complex128
        Spectra of the rotation and of the force across the mean one.
    turning : (m, 3, 2) float64
        What makes of the rotation the force that it moves, for each naming.
    bands : _Bands
    """
    counts, first = np.diff(bands.edges), bands.edges[:-1]
    square = bands.frequency[:, None, None] ** 2
    own = (turned.conj()[:, :, None] * turned[:, None, :]).real
    with_force = (turned.conj()[:, :, None] * seen[:, None, :]).real
    force = np.add.reduceat(np.sum(np.abs(seen) ** 2, axis=1), first)

    squared = turning @ turning.transpose(0, 2, 1)

    def power(product: Array) -> Array:
        """Return the power of turned @ turning in each band, (m, b)."""
        return _in_bands(squared, product, first)

    def cross(product: Array) -> Array:
        return _in_bands(turning, product, first)

    rotation, lever = power(own), power(square**2 * own)
    held = force - 2.0 * cross(with_force) + rotation
    shared = cross(square * with_force) - power(square * own)
    # Below the digits of what was subtracted nothing is known.
    least = np.maximum(_DIGITS * (force + rotation), 1e-300)
    left = np.maximum(held, least)
    for _ in range(2):
        weight = counts / left
        c = np.sum(shared * weight, axis=1) / np.maximum(np.sum(lever * weight, axis=1), 1e-300)
        left = np.maximum(held - 2.0 * c[:, None] * shared + c[:, None] ** 2 * lever, least)
    # A Hann window leaves two thirds of the bins independent.
    return np.asarray(-2.0 * np.log(left / (2.0 * counts)) @ counts / 1.5)


def _in_bands(factor: Array, product: Array, first: NDArray[np.int64]) -> Array:
    """Return sums of factor (m, c, d) times product (k, c, d), added up in each band, (m, b)."""
    bands = np.add.reduceat(product.reshape(len(product), -1), first, axis=0)
    return np.asarray(factor.reshape(len(factor), -1) @ bands.T)


def axes_text(found: AxesTest) -> str:
    """Return the sentence of a contradiction."""
    if found.scale != 1.0:
        return (
            f"the force turns in the body by {found.scale:.3g} times what the gyros say: are they "
            f"in {'deg/s, read as rad/s' if found.scale < 1.0 else 'rad/s, read as deg/s'}? Say "
            "what they are (--gyro)"
        )
    if found.mirrored:
        return (
            "the force turns in the body against the gyros, as in a mirror: two axes are exchanged "
            f"or one has the wrong sign (gyros {found.axes} would fit); check --axes and --columns"
        )
    return (
        f"the force does not turn in the body as the gyros say; with gyro axes {found.axes} it "
        "would be consistent: check --columns and the axes of gyros and accelerometers"
    )
