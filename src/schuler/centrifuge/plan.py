"""Find the scheme of positions with the most information: many short searches from many seeds.

Rounds (`schuler.centrifuge.search`) can run anywhere, in any order, and a search goes on where it
stopped.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler._result import Result, table_of_rows
from schuler.centrifuge.objective import OBJECTIVES, judge
from schuler.centrifuge.plant import PUBLISHED_POSITIONS
from schuler.centrifuge.scorecard import Scorecard, score
from schuler.centrifuge.search import HOPELESS, Problem, run_round
from schuler.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Plan",
    "compare_objectives",
    "explore",
    "plan",
]

Array = NDArray[np.float64]


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


@with_one_blas_thread
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
        To resume an earlier search: its `rounds`, and its value and positions.
    progress : callable, optional
        Told seconds, best value, evaluations after each round.

    Raises
    ------
    InputError
        For times or numbers that are not positive, or a problem that cannot be solved.
    SchulerError
        If the method's library is not installed.

    Examples
    --------
    >>> found = plan(Problem(positions=4, dwell=2.0, method="de"), rounds=1, workers=1)
    >>> len(found.positions)
    4
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


@with_one_blas_thread
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


@with_one_blas_thread
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
