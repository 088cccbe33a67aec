"""A round of a search for a scheme of positions: the problem, and how it is searched.

A round is a function of the problem, the seed and its number. It takes three steps:

1. Fedorov's exchange (1972) of positions from a coarse grid, from a random choice: cheap, since
   the information of a scheme is the sum of its positions'.
2. CMA-ES (Hansen, 2016) from there, free of the grid. Or, in place of both, SciPy's differential
   evolution, or the genetic algorithm of the source, from anywhere.
3. Exchange with neighbours on the grid of whole degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.centrifuge.information import Tables, position_matrices
from schuler.centrifuge.objective import Objective
from schuler.centrifuge.plant import Plant
from schuler.constants import DEG
from schuler.errors import InputError, installed

__all__ = [
    "HOPELESS", "SEARCHES", "AngleLimits", "Problem", "evaluate_positions", "run_round",
]  # fmt: skip

Array = NDArray[np.float64]

SEARCHES = ("cma", "de", "ga")
_GRID_LARGEST = 1300
HOPELESS = 1e6
"""Value from which on a scheme shows not every coefficient."""


@dataclass(frozen=True)
class AngleLimits:
    """Where the angles may lie: lowest and highest, deg; 0 to 360 is the whole circle.

    Examples
    --------
    >>> AngleLimits(beta=(-30.0, 30.0)).beta
    (-30.0, 30.0)
    """

    alpha: tuple[float, float] = (0.0, 360.0)
    beta: tuple[float, float] = (0.0, 0.0)
    gamma: tuple[float, float] = (0.0, 360.0)

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "gamma"):
            low, high = getattr(self, name)
            if not (np.isfinite(low) and np.isfinite(high) and low <= high <= low + 360.0):
                raise InputError(
                    f"limits of {name}: expected low <= high in deg, got {low}, {high}"
                )
        if self.beta[0] < -80.0 or self.beta[1] > 80.0:
            raise InputError(f"limits of beta must lie within -80 and 80 deg, got {self.beta}")

    @property
    def box(self) -> Array:
        """The limits as (3, 2), deg."""
        return np.array([self.alpha, self.beta, self.gamma], dtype=np.float64)

    def keep(self, positions: Array) -> Array:
        """Return positions (..., 3) brought within: whole circles wrap, ranges clip."""
        box = self.box
        out = np.array(positions, dtype=np.float64)
        for k, (low, high) in enumerate(box):
            if high - low >= 360.0:
                out[..., k] = low + np.mod(out[..., k] - low, 360.0)
            else:
                out[..., k] = np.clip(out[..., k], low, high)
        return out

    def grid(self, step: float) -> Array:
        """Return all positions (c, 3) on a grid of a step, deg."""
        axes = []
        for low, high in self.box:
            count = int(np.floor((high - low) / step + 1e-9)) + 1
            axis = low + step * np.arange(count)
            axes.append(axis[:-1] if high - low >= 360.0 and axis[-1] >= low + 360.0 else axis)
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class Problem:
    """What is to be planned.

    Parameters
    ----------
    plant : Plant
    positions : int
        How many.
    dwell : float
        At each, s.
    objective : Objective
    limits : AngleLimits
    method : {"cma", "de", "ga"}
    whole : bool
        Whole degrees only.

    Examples
    --------
    >>> Problem(positions=4, dwell=10.0).method
    'cma'
    """

    plant: Plant = field(default_factory=Plant)
    positions: int = 6
    dwell: float = 20.0
    objective: Objective = field(default_factory=Objective)
    limits: AngleLimits = field(default_factory=AngleLimits)
    method: str = "cma"
    whole: bool = True

    def __post_init__(self) -> None:
        if not 1 <= self.positions <= 60:
            raise InputError(f"a scheme has 1 to 60 positions, got {self.positions}")
        if self.method not in SEARCHES:
            raise InputError(f"unknown method '{self.method}'; known: {', '.join(SEARCHES)}")
        if self.plant.d_oo:
            raise InputError("D_OO needs several levels of force, which a plan does not vary")
        if not self.plant.is_still:
            raise InputError(
                "a plan is for a platform that keeps its attitude: leave out the commanded rate, "
                "the servo error and the gyros' mounting angles"
            )
        self.plant.turns(self.dwell)
        self.objective.scale(self.plant)


def evaluate_positions(problem: Problem, schemes: Array) -> Array:
    """Return the objectives (m,) of schemes (m, p, 3), deg; `time` as largest sigma / wanted.

    Examples
    --------
    >>> scheme = [[45, 0, 167], [350, 0, 325], [209, 0, 182], [134, 0, 141]]
    >>> schemes = np.array([scheme], float)
    >>> evaluate_positions(Problem(positions=4), schemes).shape
    (1,)
    """
    from schuler.kernels.scheme import scheme_values

    tables = Tables(problem.plant, problem.dwell)
    return _evaluate(problem, tables, np.asarray(schemes, np.float64), scheme_values)


def _evaluate(problem: Problem, tables: Tables, schemes: Array, kernel: Any) -> Array:
    out = np.empty(len(schemes))
    nodes, blend, root, omega = tables.arrays
    kernel(
        np.ascontiguousarray(schemes * DEG), problem.plant.order_number, nodes, blend, root, omega,
        problem.plant.terms, tables.prior, problem.objective.scale(problem.plant),
        problem.objective.kind, out,
    )  # fmt: skip
    return out


def run_round(problem: Problem, seed: int, number: int) -> tuple[float, Array, int]:
    """Run one round.

    Returns
    -------
    (float, (p, 3) float64, int)
        The value reached, the positions (deg), the evaluations spent.

    Raises
    ------
    SchulerError
        If the method's library is not installed.
    """
    from schuler.kernels.scheme import exchange, scheme_values

    rng = np.random.default_rng([seed, number])
    tables = Tables(problem.plant, problem.dwell)
    wanted, kind = problem.objective.scale(problem.plant), problem.objective.kind
    limits, p = problem.limits, problem.positions
    box = limits.box
    free = box[:, 1] > box[:, 0]

    def value(x: Array) -> Array:
        """Return the objectives of rows (m, p * free) of free angles."""
        schemes = np.empty((len(x), p, 3))
        schemes[:] = box[:, 0]
        schemes[:, :, free] = x.reshape(len(x), p, -1)
        return _evaluate(problem, tables, limits.keep(schemes), scheme_values)

    def settle(positions: Array, spent: int) -> tuple[float, Array, int]:
        """Exchange with neighbours in whole degrees until nothing helps."""
        best = limits.keep(np.rint(positions) if problem.whole else positions)
        reach = [s * np.array([0, 1, 3] if s == 1 else [1, 3]) for s in (-1, 1)]
        moves = np.unique(np.concatenate(reach))
        axes = [moves if f else np.zeros(1) for f in free]
        around = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        reached = np.inf
        for _ in range(20):
            pool = np.concatenate([best, limits.keep(best[:, None] + around).reshape(-1, 3)])
            chosen = np.arange(p)
            found, count = exchange(position_matrices(tables, pool), chosen, 10**9, wanted, kind)
            spent += int(count)
            if not found < reached - 1e-9 * abs(reached if np.isfinite(reached) else 0.0):
                break
            best, reached = pool[chosen], float(found)
        return reached, best, spent

    if not free.any():
        best = np.repeat(box[None, :, 0], p, 0)
        return float(_evaluate(problem, tables, best[None], scheme_values)[0]), best, 1
    size = p * int(free.sum())
    low = np.tile(box[free, 0], p)
    high = np.tile(box[free, 1], p)
    if problem.method == "cma":
        step = 15.0
        while len(limits.grid(step)) > _GRID_LARGEST:
            step *= 1.5
        grid = limits.grid(step)
        chosen = rng.integers(0, len(grid), p)
        _, spent = exchange(position_matrices(tables, grid), chosen, 10**9, wanted, kind)
        start = grid[chosen][:, free].ravel()
        x, count = _cma(value, start, low, high, rng)
        coarse = settle(grid[chosen], int(spent) + count)
        fine = settle(_whole(x, box, free, p), coarse[2])
        return (*min(coarse[:2], fine[:2], key=lambda r: r[0]), fine[2])
    x, count = (_de if problem.method == "de" else _ga)(value, size, low, high, rng)
    return settle(_whole(x, box, free, p), count)


def _whole(x: Array, box: Array, free: NDArray[np.bool_], p: int) -> Array:
    out = np.repeat(box[None, :, 0], p, 0)
    out[:, free] = x.reshape(p, -1)
    return out


def _cma(
    value: Callable[[Array], Array], start: Array, low: Array, high: Array,
    rng: np.random.Generator,
) -> tuple[Array, int]:  # fmt: skip
    """Search by CMA-ES around a start; limits are kept by `value` itself, which wraps or clips."""
    with installed("this search needs the library cma", "plan"):
        import cma
    options = {
        "verbose": -9, "verb_log": 0, "verb_disp": 0, "seed": np.nan, "popsize": 16,
        "maxfevals": 3000, "tolx": 0.02, "tolfun": 1e-3,
        "randn": lambda *shape: rng.standard_normal(shape),
    }  # fmt: skip
    search = cma.CMAEvolutionStrategy(start, 4.0, options)
    while not search.stop():
        rows = search.ask()
        search.tell(rows, value(np.asarray(rows)).tolist())
    return np.asarray(search.result.xbest), int(search.result.evaluations)


def _de(
    value: Callable[[Array], Array], size: int, low: Array, high: Array, rng: np.random.Generator
) -> tuple[Array, int]:
    """Search by differential evolution, (0.3, 0.7) and 0.9: the defaults do worse on angles."""
    from scipy.optimize import differential_evolution

    count = 0

    def counted(x: Array) -> Array:
        nonlocal count
        count += x.shape[1]
        return value(np.ascontiguousarray(x.T))

    found = differential_evolution(
        counted, list(zip(low, high, strict=True)),
        mutation=(0.3, 0.7), recombination=0.9, popsize=4, maxiter=600, tol=1e-4, polish=False,
        updating="deferred", vectorized=True, rng=rng,
    )  # fmt: skip
    return np.asarray(found.x), count


def _ga(
    value: Callable[[Array], Array], size: int, low: Array, high: Array, rng: np.random.Generator
) -> tuple[Array, int]:
    """Search by the source's genetic algorithm, as pymoo has it."""
    with installed("this search needs pymoo", "genetic"):
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem as Asked
        from pymoo.optimize import minimize

    class Scheme(Asked):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=size, n_obj=1, xl=low, xu=high)

        def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
            out["F"] = value(np.ascontiguousarray(x))[:, None]

    found = minimize(
        Scheme(), GA(pop_size=60), ("n_gen", 300), seed=int(rng.integers(2**31)), verbose=False
    )
    return np.asarray(found.X), int(found.algorithm.evaluator.n_eval)
