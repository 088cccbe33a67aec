"""Calibrate the axes of an array from known motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["AxesFit", "fit_axes"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AxesFit:
    """An array's own axes, as calibrated.

    Parameters
    ----------
    array : SensorArray
        With unit directions, scale and bias found.
    sigma : (n, 4) float64
        1 sigma of the three components of (1 + scale) h and of the bias.
    noise : (n,) float64
        Standard deviation of what is left, per sample.
    """

    array: SensorArray
    sigma: Array = field(repr=False)
    noise: Array = field(repr=False)


def fit_axes(truth: ArrayLike, measured: ArrayLike, dt: ArrayLike, name: str = "array") -> AxesFit:
    """Calibrate directions, scale factors and biases from known motion, by least squares.

    Parameters
    ----------
    truth : (k, 3) array_like
        True increments of the body, as of a turntable, rad.
    measured : (k, n) array_like
        The sensors' increments, rad.
    dt : (k,) array_like
        Intervals, s.
    name : str

    Raises
    ------
    InputError
        If the motion does not turn about all three axes.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> array, rng = named_array("symmetric4"), np.random.default_rng(1)
    >>> truth = 1e-3 * rng.standard_normal((200, 3))
    >>> fit = fit_axes(truth, truth @ array.h.T, np.full(200, 0.01))
    >>> bool(np.allclose(fit.array.h, array.h))
    True
    """
    t, m, h = (np.asarray(x, np.float64) for x in (truth, measured, dt))
    if t.ndim != 2 or t.shape[1] != 3 or m.ndim != 2 or len(m) != len(t) or h.shape != (len(t),):
        raise InputError(
            f"expected truth (k, 3), measured (k, n) and dt (k,), got {t.shape}, {m.shape} and "
            f"{h.shape}"
        )
    basis = np.column_stack([t, h])
    size = np.linalg.norm(basis, axis=0)
    if len(t) < 5 or np.any(size == 0) or np.linalg.cond(basis / size) > 1e6:
        raise InputError(
            "the motion does not tell directions and biases apart: turn about all three axes"
        )
    inverse = np.linalg.inv(basis.T @ basis)
    found = m.T @ basis @ inverse
    left = m - basis @ found.T
    noise = np.sqrt(np.sum(left**2, axis=0) / (len(t) - 4))
    gain = np.linalg.norm(found[:, :3], axis=1)
    array = SensorArray(
        found[:, :3] / gain[:, None], name, scale=gain - 1.0, bias=found[:, 3],
        sigma=np.where(noise > 0, noise, 1.0),
    )  # fmt: skip
    return AxesFit(array, noise[:, None] * np.sqrt(np.diag(inverse)), noise)
