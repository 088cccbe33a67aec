"""Figures of an experiment, drawn from what was computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "Figure"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a figure.

    Parameters
    ----------
    name : str
    x, y : (n,) float64
        In the units that the figure's axes name.

    Examples
    --------
    >>> Curve("heading", np.array([0.0, 60.0]), np.array([5.0, 2.0])).name
    'heading'
    """

    name: str
    x: Array
    y: Array


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure of an experiment, drawn from what was computed.

    Parameters
    ----------
    title : str
    x, y : str
        What the axes show, with units.
    curves : tuple of Curve
    log_y : bool
        Whether the second axis is logarithmic.

    Examples
    --------
    >>> line = Curve("heading", np.array([0.0, 60.0]), np.array([5.0, 2.0]))
    >>> Figure("Settling", "time, s", "1 sigma, arcmin", (line,)).title
    'Settling'
    """

    title: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    log_y: bool = False
