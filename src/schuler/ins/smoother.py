"""Fixed-interval smoothing (Rauch, Tung and Striebel, 1965) of a filter with or without feedback.

It works on plain arrays: error estimates and covariances before and after each epoch, what was fed
back, and the transition between epochs (`schuler.kernels.smoothing`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.ins.layout import Layout
from schuler.ins.result import EpochHistory

__all__ = ["Epochs", "Smoothed", "smooth", "smoothed"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Epochs:
    """What a filter keeps for its smoother.

    Parameters
    ----------
    x : (k, 3, n) float64
        Error estimates before the measurements, after them and the feedback, and what was fed back.
    p : (k, 3, n, n) float64
        Covariance before and after, and the transition from the epoch before.

    Examples
    --------
    >>> Epochs(np.zeros((1, 3, 2)), np.ones((1, 3, 1, 1)) * np.eye(2)).x.shape
    (1, 3, 2)
    """

    x: Array
    p: Array


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed estimates at the start and at all epochs.

    Parameters
    ----------
    layout : Layout
    error : (k, n) float64
        Smoothed error of the navigation as it stood after each epoch.
    covariance : (k, n, n) float64
    quat_nb : (k, 4) float64
    v_n : (k, 3) float64
        m/s.
    history : EpochHistory
        Of the filter, without the start.
    """

    layout: Layout
    error: Array
    covariance: Array
    quat_nb: Array
    v_n: Array
    history: EpochHistory

    def sigma(self, group: str) -> Array:
        """Return 1 sigma of a group, (k, m)."""
        place = self.layout[group]
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)[:, place]
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def smooth(epochs: Epochs) -> tuple[Array, Array]:
    """Return smoothed errors (k, n) and covariances (k, n, n).

    Examples
    --------
    >>> x, p = np.zeros((2, 3, 1)), np.ones((2, 3, 1, 1))
    >>> p[1, 1] = 0.5
    >>> error, covariance = smooth(Epochs(x, p))
    >>> covariance.ravel().tolist()
    [0.5, 0.5]
    """
    from schuler.kernels import smoothing

    x, p = np.ascontiguousarray(epochs.x), np.ascontiguousarray(epochs.p)
    count, _, n = x.shape
    xs, ps = np.zeros((count, n)), np.zeros((count, n, n))
    smoothing.smooth(
        x[:, 0], x[:, 1], x[:, 2], p[:, 0], p[:, 1], p[:, 2], xs, ps, np.zeros((n, n)),
        np.zeros((n, n)), np.zeros(n),
    )  # fmt: skip
    return xs, ps


def smoothed(
    layout: Layout, epochs: Epochs, history: EpochHistory, start: tuple[Array, Array]
) -> Smoothed:
    """Return the smoothed estimates of a filter's epochs.

    Parameters
    ----------
    layout : Layout
    epochs : Epochs
        The first one is the start.
    history : EpochHistory
        Rows of the others; they are filtered estimates, the nominal without x.
    start : (4,) and (3,) float64
        Attitude and velocity at the start.
    """
    from schuler.attitude import multiply, rotvec_to_quat

    xs, ps = smooth(epochs)
    n = layout.size
    # Rows of the history are without what the filter knew; the smoother's errors are against the
    # nominal, which kept x where it was not fed back.
    more = xs - epochs.x[:, 1]
    quat = np.concatenate([start[0][None], history.quat_nb])
    velocity = np.concatenate([start[1][None], history.v_n])
    return Smoothed(
        layout, xs[:, :n], ps[:, :n, :n],
        np.asarray(multiply(rotvec_to_quat(more[:, layout["phi"]]), quat)),
        velocity - more[:, layout["velocity"]], history,
    )  # fmt: skip
