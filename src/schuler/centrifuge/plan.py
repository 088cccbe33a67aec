"""Find the scheme of positions that tells most: many short searches, each from its own seed.

A round is a function of the problem, the seed and its number: rounds can run anywhere, in any
order, and a search goes on where it stopped. It takes three steps:

1. Fedorov's exchange (1972) of positions from a coarse grid, from a random choice: cheap, since
   the information of a scheme is the sum of its positions'.
2. CMA-ES (Hansen, 2016) from there, free of the grid. Or, in place of both, SciPy's differential
   evolution, or the genetic algorithm of the source, from anywhere.
3. Exchange with neighbours on the grid of whole degrees.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result, table_of_rows
from schuler.centrifuge.objective import OBJECTIVES, Objective, judge
from schuler.centrifuge.plant import PUBLISHED_POSITIONS, Plant, Tables, position_matrices
from schuler.centrifuge.scorecard import Scorecard, score
from schuler.constants import DEG
from schuler.errors import InputError, SchulerError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "SEARCHES",
    "AngleLimits",
    "Plan",
    "Problem",
    "compare_objectives",
    "evaluate_positions",
    "explore",
    "plan",
    "run_round",
]

Array = NDArray[np.float64]

SEARCHES = ("cma", "de", "ga")
_GRID_LARGEST = 1300
HOPELESS = 1e6


@dataclass(frozen=True)
class AngleLimits:
    """Where the angles may lie: lowest and highest, deg; 0 to 360 is the whole circle."""

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


@dataclass(frozen=True)
class Plan(Result):
    """The best scheme found.

    Parameters
    ----------
    problem : Problem
    objective : float
        Its value.
    positions : (p, 3) float64
        alpha, beta, gamma, deg.
    published_objective : float
        The same of the published six positions at the same dwell.
    worst_relative_sigma : float
        Largest sigma over the published coefficient, as a fraction.
    scorecard : Scorecard
        The scheme by every objective, beside the published one and the best found for each.
    evaluations, rounds : int
    seconds : float
    history : list of (seconds, evaluations, best so far)
    """

    problem: Problem
    objective: float
    positions: Array
    published_objective: float
    worst_relative_sigma: float
    scorecard: Scorecard
    evaluations: int
    rounds: int
    seconds: float
    history: list[tuple[float, int, float]]

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as JSON takes it (docs/plan.schema.json)."""
        finite = {
            key: value if np.isfinite(value) else None
            for key, value in (
                ("objective", self.objective), ("published_objective", self.published_objective)
            )
        }  # fmt: skip
        return {
            "schema": "schuler.plan/1",
            "objective_name": self.problem.objective.name,
            **finite,
            "positions": [[float(v) for v in row] for row in self.positions],
            "dwell_s": self.problem.dwell,
            "worst_relative_sigma": self.worst_relative_sigma,
            "objectives": self.scorecard.rows(),
            "evaluations": self.evaluations,
            "rounds": self.rounds,
            "seconds": self.seconds,
        }

    def columns(self) -> dict[str, Any]:
        """Return the scheme by every objective, a row to each."""
        return table_of_rows(self.scorecard.rows())

    def to_pandas(self) -> pd.DataFrame:
        """Return the scheme by every objective as a table by the objective's name."""
        return super().to_pandas().set_index("name").astype(float)


def evaluate_positions(problem: Problem, schemes: Array) -> Array:
    """Return the objectives (m,) of schemes (m, p, 3), deg; `time` as largest sigma / wanted."""
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
    try:
        import cma
    except ImportError:
        raise SchulerError(
            "this search needs the library cma, which is not installed: pip install 'schuler[plan]'"
        ) from None
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
    try:
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.core.problem import Problem as Asked
        from pymoo.optimize import minimize
    except ImportError:
        raise SchulerError(
            "this search needs pymoo, which is not installed: pip install 'schuler[genetic]'"
        ) from None

    class Scheme(Asked):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=size, n_obj=1, xl=low, xu=high)

        def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
            out["F"] = value(np.ascontiguousarray(x))[:, None]

    found = minimize(
        Scheme(), GA(pop_size=60), ("n_gen", 300), seed=int(rng.integers(2**31)), verbose=False
    )
    return np.asarray(found.X), int(found.algorithm.evaluator.n_eval)


def plan(
    problem: Problem | None = None,
    *,
    seed: int = 0,
    time_limit: float = 60.0,
    rounds: int | None = None,
    workers: int = 2,
    executor: Executor | None = None,
    first_round: int = 0,
    best: tuple[float, Array] | None = None,
    progress: Callable[[float, float, int], None] | None = None,
) -> Plan:
    """Search until the time is over or the rounds are done.

    Parameters
    ----------
    problem : Problem
    seed : int
        Round k draws from (seed, k).
    time_limit : float
        s, looked at between rounds.
    rounds : int, optional
        Stop after so many: then the answer depends on the seed alone.
    workers : int
        Rounds at a time.
    executor : concurrent.futures.Executor, optional
        Where rounds run; threads of this process where left out (the kernels let go of the GIL).
    first_round, best
        To go on with an earlier search: its `rounds`, and its value and positions.
    progress : callable, optional
        Told seconds, best value, evaluations after each round.

    Raises
    ------
    InputError
        For times or numbers that are not positive, or a problem that cannot be solved.
    SchulerError
        If the method's library is not installed.
    """
    problem = problem or Problem()
    if not time_limit > 0 or workers < 1 or (rounds is not None and rounds < 1):
        raise InputError("a search needs a positive time limit, and one round and worker or more")
    begin = time.perf_counter()
    reached, positions = best if best is not None else (np.inf, np.zeros((problem.positions, 3)))
    history: list[tuple[float, int, float]] = []
    spent, done, started = 0, 0, 0
    own = ThreadPoolExecutor(workers) if executor is None else None
    pool: Executor = own if own is not None else executor  # type: ignore[assignment]
    waiting: set[Future[tuple[float, Array, int]]] = set()
    try:
        while True:
            late = time.perf_counter() - begin >= time_limit
            while len(waiting) < workers and not late and (rounds is None or started < rounds):
                waiting.add(pool.submit(run_round, problem, seed, first_round + started))
                started += 1
            if not waiting:
                break
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                found, scheme, count = future.result()
                spent += count
                done += 1
                if found < reached:
                    reached, positions = found, scheme
                seconds = time.perf_counter() - begin
                history.append((seconds, spent, float(reached)))
                if progress is not None:
                    progress(seconds, float(reached), spent)
    finally:
        for future in waiting:
            future.cancel()
        if own is not None:
            own.shutdown(wait=True, cancel_futures=True)
    if not reached < HOPELESS:
        raise InputError(
            f"no scheme of {problem.positions} position(s) within the limits shows every "
            "coefficient: allow more positions or wider angles"
        )
    return _finish(problem, positions, spent, first_round + done, begin, history)


def _finish(
    problem: Problem, positions: Array, spent: int, rounds: int, begin: float,
    history: list[tuple[float, int, float]],
) -> Plan:  # fmt: skip
    positions = positions[np.lexsort(positions.T[::-1])]
    printed = np.array(PUBLISHED_POSITIONS, dtype=np.float64)
    name = problem.objective.name
    card = Scorecard(
        name,
        score(problem.plant, positions, problem.dwell, problem.objective),
        score(problem.plant, printed, problem.dwell, problem.objective),
    )
    own = judge(problem.plant, positions, problem.dwell)
    return Plan(
        problem=problem,
        objective=card.plan[name],
        positions=positions,
        published_objective=card.published[name],
        scorecard=card,
        worst_relative_sigma=0.01 * float(own.relative.max()),
        evaluations=spent,
        rounds=rounds,
        seconds=time.perf_counter() - begin,
        history=history,
    )


def compare_objectives(
    found: Plan, *, rounds: int = 1, seed: int = 0, workers: int = 2,
    executor: Executor | None = None, progress: Callable[[str], None] | None = None,
) -> Plan:  # fmt: skip
    """Return a plan with the best that a search finds for each objective, of as many positions.

    Parameters
    ----------
    found : Plan
    rounds : int
        Of the search for each of the other objectives.
    seed, workers, executor
        As `plan` takes them.
    progress : callable, optional
        Told the name of each objective before its search.
    """
    problem, card = found.problem, found.scorecard
    schemes = [found.positions]
    for name in OBJECTIVES:
        # The least time is that of the least largest sigma.
        if name in (card.optimised, "time") or {name, card.optimised} == {"min-max", "time"}:
            continue
        if progress is not None:
            progress(name)
        other = replace(problem, objective=replace(problem.objective, name=name))
        schemes.append(
            plan(
                other, seed=seed, rounds=rounds, time_limit=1e9, workers=workers, executor=executor
            ).positions
        )
    values = [card.plan, card.published] if problem.positions == 6 else [card.plan]
    values += [score(problem.plant, each, problem.dwell, problem.objective) for each in schemes[1:]]
    best = {name: min(each[name] for each in values) for name in OBJECTIVES}
    return replace(found, scorecard=replace(card, best=best))


def explore(
    problem: Problem,
    counts: range,
    *,
    total: float | None = None,
    progress: Callable[[int, float, float, int], None] | None = None,
    **options: Any,
) -> list[Plan]:
    """Plan with several numbers of positions, to see the trade.

    Parameters
    ----------
    problem : Problem
    counts : range
        Numbers of positions.
    total : float, optional
        Time in all, s, shared by the positions in whole turns; the problem's dwell where left out.
    progress : callable, optional
        Told the number of positions, then seconds, best value and evaluations after each round.
    **options
        As `plan` takes them; the time limit is for each number.
    """
    from functools import partial

    out = []
    for count in counts:
        if progress is not None:
            options["progress"] = partial(progress, count)
        dwell = problem.dwell
        if total is not None:
            dwell = max(1, int(total / count / problem.plant.period)) * problem.plant.period
        out.append(plan(replace(problem, positions=count, dwell=dwell), **options))
    return out
