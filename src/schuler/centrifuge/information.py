"""Information of a centrifuge test: what its positions contribute to the coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.centrifuge.plant import Plant
from schuler.centrifuge.sums import node_integrals, sum_nodes, turn_products
from schuler.constants import DEG, EARTH_RATE
from schuler.errors import InputError

__all__ = ["Tables", "direct_information", "position_matrices", "scheme_information"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tables:
    """What the closed form needs of a plant, a dwell and the levels of force; made once.

    Parameters
    ----------
    plant : Plant
    dwell : float
        s at a position.
    levels : tuple of float
        Forces, g; the plant's own where empty.
    order : int
        Nodes over a dwell; two are right to 1e-5 of a sigma up to half a minute, three beyond.
    """

    plant: Plant
    dwell: float
    levels: tuple[float, ...] = ()
    order: int = 0

    @cached_property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Return nodes (levels, q, 10), blend (levels, q, q), root (levels, 10, 10), omega."""
        plant = self.plant
        turns = plant.turns(self.dwell)
        order = self.order or (2 if self.dwell <= 30.0 else 3)
        at, weights = sum_nodes(turns, order)
        samples = round(plant.sampling * plant.period)
        root = np.linalg.cholesky(turn_products(samples, 1.0 / plant.sampling))
        blend = plant.period * node_integrals(at)
        levels = self.levels or (plant.force,)
        nodes = np.zeros((len(levels), len(at), 19))
        nodes[:, :, 0] = weights / (1e-6 * plant.noise) ** 2
        axis = plant.earth / EARTH_RATE
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        for q, x in enumerate(at):
            angle = EARTH_RATE * plant.period * (x + 0.5)
            turned = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
            for level, force in enumerate(levels):
                rotated = plant.harmonics(force) @ turned.T
                nodes[level, q, 1:10] = rotated.ravel()
                nodes[level, q, 10:] = np.cross(plant.earth, rotated).ravel()
        n = len(levels)
        return (
            nodes, np.repeat(blend[None], n, 0), np.repeat(root[None], n, 0),
            np.full(n, plant.omega),
        )  # fmt: skip

    @property
    def prior(self) -> float:
        """Information of an Euler angle at the start, 1/rad^2."""
        return 1.0 / self.plant.attitude_prior**2


def checked_angles(positions: ArrayLike) -> Array:
    """Return positions (p, 3) in rad from alpha, beta, gamma in deg, checked."""
    angles = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    if angles.ndim != 2 or angles.shape[1] != 3 or not np.isfinite(angles).all():
        raise InputError(
            f"positions: expected rows of alpha, beta, gamma in deg, got shape {angles.shape}"
        )
    if np.any(np.abs(np.cos(angles[:, 1] * DEG)) < 0.05):
        raise InputError("positions: beta is too near 90 deg, where alpha and gamma are one turn")
    return np.ascontiguousarray(angles * DEG)


def _needs_still(plant: Plant) -> None:
    if not plant.is_still:
        raise InputError(
            "sums over positions hold for a platform that keeps its attitude: leave out the "
            "commanded rate, the servo error and the gyros' mounting angles"
        )


def position_matrices(
    tables: Tables, positions: ArrayLike, level: Sequence[int] | None = None
) -> Array:
    """Return the information of each position, (p, n, n), its attitude marginalised.

    Parameters
    ----------
    tables : Tables
    positions : (p, 3) array_like
        alpha, beta, gamma, deg.
    level : sequence of int, optional
        Which of the tables' levels of force each position has; the first where left out.

    Raises
    ------
    InputError
        For positions that are not numbers, or beta near 90 deg.
    """
    from schuler.kernels.centrifuge import many_positions

    angles = checked_angles(positions)
    _needs_still(tables.plant)
    which = np.zeros(len(angles), np.int64) if level is None else np.asarray(level, np.int64)
    plant = tables.plant
    out = np.zeros((len(angles), plant.unknowns, plant.unknowns))
    nodes, blend, root, omega = tables.arrays
    many_positions(
        angles, plant.order_number, which, nodes, blend, root, omega, plant.terms, tables.prior, out
    )
    return out


def scheme_information(
    plant: Plant, positions: ArrayLike, dwell: float, forces: Sequence[float] | None = None
) -> Array:
    """Return the information (n, n) of a scheme, in rad/s, g and rad.

    In closed form for a platform that keeps its attitude; with a commanded rate, a servo error or
    mounting angles of the gyros it is what the filter's covariance holds.

    Parameters
    ----------
    plant : Plant
    positions : (p, 3) array_like
        alpha, beta, gamma, deg.
    dwell : float
        s at each position, a whole number of turns of the arm.
    forces : sequence of float, optional
        Level of force at each position, g.

    Raises
    ------
    InputError
        For bad positions, dwells or forces.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> scheme_information(Plant(), PUBLISHED_POSITIONS, 20.0).shape
    (45, 45)
    """
    rows = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    if not plant.is_still:
        from schuler.centrifuge.filter import filter_information

        return filter_information(plant, rows, dwell, forces)
    if forces is None:
        return np.asarray(position_matrices(Tables(plant, dwell), rows).sum(axis=0))
    if len(forces) != len(rows) or not all(f > 0 for f in forces):
        raise InputError(f"forces: expected {len(rows)} positive numbers of g, got {list(forces)}")
    levels = tuple(sorted(set(map(float, forces))))
    which = [levels.index(float(f)) for f in forces]
    return np.asarray(position_matrices(Tables(plant, dwell, levels), rows, which).sum(axis=0))


def direct_information(
    plant: Plant, positions: ArrayLike, dwell: float, step: float = 0.005,
    forces: Sequence[float] | None = None,
) -> Array:  # fmt: skip
    """Return the same as `scheme_information`, added sample by sample: slow, and independent.

    Parameters
    ----------
    plant, positions, dwell, forces
        As there.
    step : float
        Of the integration, s; an output sample must be a whole number of them.

    Examples
    --------
    >>> plant, positions = Plant(), [(45.0, 0.0, 167.0)]
    >>> direct = direct_information(plant, positions, 2.0)
    >>> closed = scheme_information(plant, positions, 2.0)
    >>> bool(np.allclose(direct.diagonal(), closed.diagonal(), rtol=0.01))
    True
    """
    from schuler.kernels.centrifuge_samples import direct_accumulation

    angles = checked_angles(positions)
    _needs_still(plant)
    every = round(1.0 / (plant.sampling * step))
    if every < 1 or abs(every * step * plant.sampling - 1.0) > 1e-9:
        raise InputError(f"an output sample must be a whole number of steps of {step:g} s")
    out = np.zeros((plant.unknowns, plant.unknowns))
    samples = plant.turns(dwell) * round(plant.period / step)
    for k, row in enumerate(angles):
        direct_accumulation(
            row, plant.order_number, plant.harmonics(None if forces is None else forces[k]),
            plant.omega, plant.earth, samples, step, every, plant.terms,
            (1e-6 * plant.noise) ** -2.0, plant.attitude_prior**-2.0, out,
        )  # fmt: skip
    return out
