"""Whether a record that was aligned as one at rest is that of a vehicle that moves."""

from __future__ import annotations

import numpy as np

from schuler.alignment.history import History

__all__ = ["moving_notice"]

_DEGREE = 3
"""What a bias and the Earth's rotation make of the velocity of a unit at rest is a smooth curve."""

_MOVES = 1.0
"""Rms velocity about such a curve that no crew, wind or swell makes, m/s."""

_LEAST_NODES = 16


def moving_notice(h: History) -> str | None:
    """Return a sentence that says that the vehicle moves, and what is needed then, or None."""
    nodes, t = h.nodes, h.t
    if len(t) < _LEAST_NODES:
        return None
    x = 2.0 * t / t[-1] - 1.0
    basis = np.polynomial.legendre.legvander(x, _DEGREE)
    fit, *_ = np.linalg.lstsq(basis, nodes.v_ib0, rcond=None)
    left = nodes.v_ib0 - basis @ fit
    speed = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    if speed < _MOVES:
        return None
    return (
        f"the vehicle moves: its velocity changes by {speed:.2g} m/s rms about a smooth course. An "
        "alignment at rest needs a span at rest (--start, --stop); one in motion needs what else "
        "was measured (--gnss FILE, or --odometer FILE or --dvl FILE with the latitude)"
    )
