"""How strong a disturbance is, from the powers of its modes and the shapes that may make them.

How steeply the powers rise towards the low modes is poorly known from one record, so no single
best fit is taken: the levels are the posterior mean over a grid, log-uniform, with no steep shape
beyond the level at which it alone would make the lowest modes. On the real record of the benchmark
this gives normalised errors of rms about one, window by window.

With a specification the steep shapes are held tighter. A white rate is the noise of the gyros and
nothing else, as gyros follow whatever a base turns: it is left to the specification. A white force
would carry a standing base away: it is allowed to make a third of the lowest modes, in case that
the accelerometers are noisier than they are said to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["TURN_PRIORS", "LevelPrior", "Levels", "posterior", "velocity_levels"]

Array = NDArray[np.float64]

LOWEST = 6
"""Mode powers (three orders, east and north) that set the scale of the grid."""


@dataclass(frozen=True, eq=False)
class LevelPrior:
    """Levels of a shape that are tried, over the level at which it alone makes the powers.

    Parameters
    ----------
    tried : (n,) float64
    lowest : bool
        Whether it is to make the lowest modes alone, as a steep one does, or all.
    """

    tried: Array
    lowest: bool

    def levels(self, share: Array, shape: Array) -> Array:
        """Return the levels to try for the powers of one axis, (n,)."""
        few = LOWEST // 2 if self.lowest else len(share)
        return np.asarray(np.mean(share[:few] / shape[:few]) * self.tried)


_FLAT = LevelPrior(np.logspace(-3.0, 0.4, 9), lowest=False)
_STEEP = LevelPrior(np.logspace(-4.0, 0.05, 9), lowest=True)
_STEEPEST = LevelPrior(np.logspace(-6.0, -0.15, 9), lowest=True)
_STEEP_BESIDE_SPECIFIED = LevelPrior(np.logspace(-4.0, -0.5, 9), lowest=True)

_UNSPECIFIED = (_FLAT, _FLAT, _STEEP, _STEEPEST)
"""Of white displacement, velocity, force and rate."""
_SPECIFIED = (_FLAT, _FLAT, _STEEP_BESIDE_SPECIFIED)
"""Of white displacement, velocity and force."""
TURN_PRIORS = (_STEEP, _STEEPEST)
"""Of a bounded turn and a wandering one (`angle_powers`)."""


@dataclass(frozen=True, eq=False)
class Levels:
    """How strong a disturbance is.

    Parameters
    ----------
    mean : (s,) float64
        Posterior mean, for the uncertainty.
    likely : (s,) float64
        For weights: nothing where no disturbance is the likelier reading, else the mean.
    """

    mean: Array
    likely: Array


def posterior(
    power: Array, shapes: Array, known: Array, priors: tuple[LevelPrior, ...], freedom: int = 1
) -> Levels:
    """Return the levels of shapes whose sum with `known` makes the powers.

    Half of the prior says that there is nothing but what is known; the other half is spread
    log-uniformly over levels up to that at which a shape alone makes the powers.

    Parameters
    ----------
    power : (k,) float64
        Power of each mode, the sum of `freedom` independent squares.
    shapes : (s, k) float64
        What a unit of each level makes of one square.
    known : (k,) float64
        What is there anyway.
    priors : (s,) tuple
        What is tried of each level.
    freedom : int
        Degrees of freedom of a power.
    """
    share = power / freedom
    axes = [prior.levels(share, shape) for prior, shape in zip(priors, shapes, strict=True)]
    nothing = np.zeros(len(shapes))
    if not all(np.all(axis > 0) for axis in axes):
        return Levels(nothing, nothing)
    grid = np.stack([a.ravel() for a in np.meshgrid(*axes)])

    def fit(level: Array) -> Array:
        return np.asarray(-0.5 * freedom * (np.log(level) + share / level).sum(axis=-1))

    log = fit(grid.T @ shapes + known)
    weight = np.exp(log - log.max())
    mean = grid @ weight / weight.sum()
    if not np.all(known > 0):
        return Levels(mean, mean)
    odds = np.exp(min(float(fit(known)) - log.max(), 700.0)) / weight.mean()
    mean = mean / (1.0 + odds)
    return Levels(mean, nothing if odds > 1.0 else mean)


def velocity_levels(found: tuple[Array, Array, Array] | None, specified: bool) -> Levels:
    """Return the levels of white displacement, velocity, force and rate of `velocity_powers`.

    Parameters
    ----------
    found : tuple, or None
    specified : bool
        Whether the instrument's noise is that of a specification, in samples as they came: what
        is interpolated over lost samples has an error of its own.
    """
    if found is None:
        return Levels(np.zeros(4), np.zeros(4))
    power, shapes, known = found
    # East and north share a level: two degrees of freedom to a mode.
    levels = posterior(power, shapes, known, _UNSPECIFIED, freedom=2)
    if not specified:
        return levels
    # Weights that are made for too steep a disturbance cost little, for too flat a one much.
    few = len(_SPECIFIED)
    held = posterior(power, shapes[:few], known, _SPECIFIED, freedom=2)
    return Levels(np.append(held.mean, np.zeros(len(shapes) - few)), levels.likely)
