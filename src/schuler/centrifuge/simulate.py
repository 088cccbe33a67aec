"""Simulate a platform on a centrifuge: its outputs, with attitudes that are off by their prior."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.centrifuge.information import checked_angles
from schuler.centrifuge.plant import Plant

__all__ = ["simulate_platform"]

Array = NDArray[np.float64]


def simulate_platform(
    plant: Plant, positions: ArrayLike, dwell: float, truth: Array, rng: np.random.Generator,
    runs: int = 1, forces: Sequence[float] | None = None,
) -> Array:  # fmt: skip
    """Return outputs (runs, p, m, 3), g, of a platform whose attitudes are off by the prior.

    Parameters
    ----------
    plant : Plant
    positions : (p, 3) array_like
        Nominal alpha, beta, gamma, deg.
    dwell : float
        s at each.
    truth : (n,) float64
        Coefficients, inside units.
    rng : numpy Generator
    runs : int
        Independent tests.
    forces : sequence of float, optional
        Level of force at each position, g.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS, Plant, published_truth
    >>> rng = np.random.default_rng(1)
    >>> simulate_platform(Plant(), PUBLISHED_POSITIONS, 2.0, published_truth(), rng).shape
    (1, 6, 100, 3)
    """
    from schuler.kernels.gimbals import platform_matrix

    nominal = checked_angles(positions)
    count = len(nominal)
    angles = nominal + plant.attitude_prior * rng.standard_normal((runs, count, 3))
    c = np.array(
        [platform_matrix(a, b, g, plant.order_number) for a, b, g in angles.reshape(-1, 3)]
    )
    # Rows and columns first: each operation below is one over all runs and positions.
    c = np.ascontiguousarray(np.moveaxis(c.reshape(runs, count, 3, 3), (2, 3), (0, 1)))
    levels = [plant.force] * count if forces is None else list(forces)
    swing = np.array([plant.harmonics(level) for level in levels]).transpose(1, 2, 0)[:, :, None]
    gyro = truth[: 3 * plant.terms].reshape(-1, 3)
    k0, k1, k2, k3, kp = truth[3 * plant.terms : -3].reshape(5, 3)
    th_py, th_pz, th_oz = truth[-3:]
    axes = plant.gyro_axes
    earth, turning = plant.earth[:, None, None], plant.turning[:, None, None]

    def force_at(t: float, m: Array) -> Array:
        angle = plant.omega * t
        base = swing[0] + math.cos(angle) * swing[1] + math.sin(angle) * swing[2]
        return np.asarray((m * base).sum(axis=1))

    def slope(t: float, m: Array) -> Array:
        """Return the rate of change of the platforms' attitudes, rows and columns first."""
        f = force_at(t, m)
        drift = (m * earth).sum(axis=1) + turning
        for j, d in enumerate(gyro.T):
            i, o, s = np.tensordot(axes[j], f, 1)
            own = d[0] + i * (d[1] + d[4] * i + d[6] * o + d[7] * s)
            own += s * (d[3] + d[5] * s) + o * (d[2] + d[8] * s)
            if len(d) > 9:
                own += d[9] * o * o
            drift += axes[j, 0][:, None, None] * own
        out = np.empty_like(m)
        for k in range(3):
            one, two = (k + 1) % 3, (k + 2) % 3
            out[k] = drift[one] * m[two] - drift[two] * m[one]
        return out

    h = 1.0 / plant.sampling
    samples = plant.turns(dwell) * round(plant.sampling * plant.period)
    out = np.empty((runs, count, samples, 3))
    for k in range(samples):
        t = k * h
        a = slope(t, c)
        b = slope(t + h / 2, c + h / 2 * a)
        d = slope(t + h / 2, c + h / 2 * b)
        e = slope(t + h, c + h * d)
        c = c + h / 6 * (a + 2 * b + 2 * d + e)
        f = np.moveaxis(force_at(t + h, c), 0, -1)
        own = f.copy()
        own[..., 1] += th_py * f[..., 0]
        own[..., 2] += th_pz * f[..., 0] + th_oz * f[..., 1]
        other = np.stack([f[..., 1], -f[..., 2], f[..., 1] - th_oz * f[..., 2]], axis=-1)
        out[:, :, k] = k0 + (1 + k1) * own + k2 * own**2 + k3 * own**3 + kp * own * other
    return out + 1e-6 * plant.noise * rng.standard_normal(out.shape)
