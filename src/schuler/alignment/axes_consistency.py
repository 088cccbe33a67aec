"""Whether gyros and accelerometers name the same axes: f must turn in the body as w says.

In the frame that the gyros hold, the force of a base that moves is gravity, which is steady, plus
the vehicle's acceleration `a`, of unknown spectrum. A wrong naming of the gyros' axes leaves a part
of gravity there that moves with the base. The likelihood of the force in that frame, with the
acceleration's spectrum estimated in bands, is compared over all 48 ways of naming the axes. A lever
arm adds a part proportional to frequency squared, which is fitted.

For small motion f = f0 - theta x f0 + a with the gyros' angle theta, and all namings come from one
Fourier transform. A base that turns far is rotated for each naming.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History
from schuler.attitude import multiply, quat_to_rotvec

__all__ = ["AXES_MARGIN", "AxesTest", "axes_test", "axes_text"]

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

AXES_MARGIN = 15.0
"""Log likelihood by which another naming of the axes must be better."""

_HIGHEST = 1.0
"""Frequency (Hz) up to which the force is looked at: above, a vehicle's shaking hides its tilt."""

_SMALL = 0.03
"""Angle (rad) of the base within the record up to which its square is left out."""

_LEAST = 64
"""Intervals that are enough."""

_STEP = 0.2
"""Time (s) between instants that is short enough for `_HIGHEST`."""


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
    """

    margin: float
    axes: str
    mirrored: bool


@lru_cache(maxsize=1)
def _namings() -> tuple[Array, tuple[str, ...]]:
    """Return what the gyros are tried as (50, 3, 3), and the names of the first 48.

    The 48 signed permutations, the identity first; then both triads in a mirror, which turns as
    gyros of the other sign; and no turn at all: the gyros show their noise.
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
    return np.array([*found, -np.eye(3), np.zeros((3, 3))]), tuple(names)


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
        bands = max(3, int(count**0.5))
        edges = np.unique(np.round(np.geomspace(4, count + 4, bands + 1))).astype(np.int64) - 4
        edges[0] = 0
        return cls(used, frequency[used], edges)

    def spectrum(self, x: Array) -> Spectrum:
        """Return the spectrum (..., k, c) of series (..., n, c)."""
        n = x.shape[-2]
        # A parabola is a bias and a drift; it would leak into all frequencies.
        trend, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, n), 3))
        window = np.hanning(n)[:, None] / np.sqrt(0.375 * n)
        return np.asarray(
            np.fft.rfft((x - trend @ (trend.T @ x)) * window, axis=-2)[..., self.used, :]
        )


def axes_test(h: History) -> AxesTest | None:
    """Compare how the force turns in the body with the gyros, over all namings of their axes.

    Parameters
    ----------
    h : History

    Returns
    -------
    AxesTest, or None for a record with too few nodes.
    """
    far = float(np.abs(quat_to_rotvec(h.quat)).max()) > _SMALL
    if far and h.duration < _STEP * (len(h) - 1):
        h, _ = h.thin(int(h.duration / _STEP) + 1)
    n = len(h) - 1
    bands = _Bands.of(n, h.duration / n) if n >= _LEAST else None
    if bands is None:
        return None
    held, lever = (_rotated if far else _small)(h, bands)
    log = _log_likelihood(held, lever * (bands.frequency**2)[:, None], bands.edges)
    _, names = _namings()
    best = int(np.argmax(log[:-2]))
    margin = float(log[best] - max(log[0], log[-1]))
    if margin < AXES_MARGIN:
        return AxesTest(max(margin, 0.0), names[0], mirrored=False)
    return AxesTest(margin, names[best], mirrored=bool(log[-2] > log[best] - 3.0))


def _small(h: History, bands: _Bands) -> tuple[Spectrum, Spectrum]:
    """Return the level force held by each naming, and what its lever arm adds, for small angles."""
    namings, _ = _namings()
    angle = np.diff(h.nodes.sum_dtheta, axis=0)
    f_b = np.diff(h.nodes.sum_dvel, axis=0) / np.diff(h.t)[:, None]
    mean = f_b.mean(axis=0)
    level = _level_axes(mean)
    theta = np.cumsum(angle, axis=0) - 0.5 * angle
    turned, seen = bands.spectrum(theta), bands.spectrum((f_b - mean) @ level)
    # -theta x f for each naming, in one product.
    turns = np.einsum("kc,mac,ab->mkb", turned, namings, -_cross_matrix(mean) @ level)
    return np.asarray(seen[None] - turns), np.asarray(turns)


def _rotated(h: History, bands: _Bands) -> tuple[Spectrum, Spectrum]:
    """Return the same for any angles, by rotating the force with each naming."""
    from schuler.kernels.namings import held_forces

    namings, _ = _namings()
    back = h.quat[:-1] * [1.0, -1.0, -1.0, -1.0]
    phi = quat_to_rotvec(multiply(back, h.quat[1:]))
    f_b = np.diff(h.nodes.sum_dvel, axis=0) / np.diff(h.t)[:, None]
    out = np.empty((len(namings), len(phi), 6))
    held_forces(phi, f_b, f_b.mean(axis=0), namings, out)
    level = np.stack([_level_axes(x) for x in out[:, :, :3].mean(axis=1)])
    # A lever along the mean force moves as the mean force does, in the frame that is held.
    return bands.spectrum(out[:, :, :3] @ level), bands.spectrum(out[:, :, 3:] @ level)


def _level_axes(f: Array) -> Array:
    """Return two unit vectors (3, 2) across a force."""
    up = f / np.linalg.norm(f)
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    level = np.stack([first, np.cross(up, first)], axis=1)
    return np.asarray(level / np.linalg.norm(level, axis=0))


def _cross_matrix(f: Array) -> Array:
    """Return M with theta @ M = theta x f."""
    return np.array([[0.0, -f[2], f[1]], [f[2], 0.0, -f[0]], [-f[1], f[0], 0.0]])


def _log_likelihood(held: Spectrum, lever: Spectrum, edges: NDArray[np.int64]) -> Array:
    """Return the log likelihood (k,) of k held forces, their noise estimated in bands.

    The lever arm's part is fitted for each.
    """
    counts = np.diff(edges)
    left = held
    for _ in range(2):
        weight = np.repeat(1.0 / _power(left, edges), counts, axis=1)[:, :, None]
        top = np.sum((lever.conj() * held).real * weight, axis=(1, 2))
        bottom = np.sum(np.abs(lever) ** 2 * weight, axis=(1, 2))
        left = held - (top / np.maximum(bottom, 1e-300))[:, None, None] * lever
    # A Hann window leaves two thirds of the bins independent.
    return np.asarray(-2.0 * np.log(_power(left, edges)) @ counts / 1.5)


def _power(left: Spectrum, edges: NDArray[np.int64]) -> Array:
    """Return the mean power of one axis in each band, (k, b)."""
    total = np.add.reduceat(np.sum(np.abs(left) ** 2, axis=2), edges[:-1], axis=1)
    return np.asarray(np.maximum(total / (2.0 * np.diff(edges)), 1e-300))


def axes_text(found: AxesTest) -> str:
    """Return the sentence of a contradiction."""
    if found.mirrored:
        return (
            "the force turns in the body against the gyros, as in a mirror: two axes are exchanged "
            f"or one has the wrong sign (gyros {found.axes} would fit); check --axes and --columns"
        )
    return (
        f"the force does not turn in the body as the gyros say; with gyro axes {found.axes} it "
        "would be consistent: check --columns and the axes of gyros and accelerometers"
    )
