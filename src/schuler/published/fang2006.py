"""Two positions, a turn about any axis, and a Kalman filter of ten states (Fang, 2006)."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import KalmanAlignment, Position, align, position_limit
from schuler.earth import Site
from schuler.motion.turntable import AXES, Dwell, Turn, Turntable
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    conditions,
    each_run,
    experiment,
    misalignment,
)
from schuler.sensors import ImuSpec
from schuler.simulation import simulate

__all__ = ["run", "table_of"]

Array = NDArray[np.float64]

_BLOCK = 15


def _position(angles: list[float], dwell: float, turn: float = 0.0) -> Position:
    psi, pitch, roll = angles
    return Position(psi, pitch, roll, dwell, turn)


def table_of(angles: list[list[float]], dwell: float) -> tuple[Turntable, float, list[Position]]:
    """Return a table that dwells at each attitude, how long it takes, and its positions.

    Parameters
    ----------
    angles : list of (psi, theta, gamma)
        deg.
    dwell : float
        s at each.
    """
    steps: list[Dwell | Turn] = [Dwell(dwell)]
    positions = [_position(angles[0], dwell)]
    for before, after in itertools.pairwise(angles):
        turns = [
            Turn(axis, b - a) for axis, a, b in zip(AXES, before, after, strict=True) if b != a
        ]
        steps += [*turns, Dwell(dwell)]
        took = float(sum(turn.time for turn in turns))
        positions.append(_position(after, dwell, took))
    table = Turntable(tuple(steps), (angles[0][0], angles[0][1], angles[0][2]))
    return table, table.period, positions


def _block(number: int, first: int, last: int, seed: int) -> tuple[Array, Array]:
    """Return phi (runs, 3), arcmin, by the document's filter and by the default method."""
    case = conditions("fang2006")
    settings = case["simulation"]
    spec, site = ImuSpec.from_dict(case["instrument"], "patent"), Site(settings["lat"])
    table, duration, _ = table_of(case["positions"][number]["angles"], settings["dwell"])
    filter_ = KalmanAlignment(10, "velocity", base=False, noise=settings["velocity_noise"])
    found: tuple[list[Array], list[Array]] = ([], [])
    for k in range(first, last):
        rng = np.random.default_rng([seed, 2006, number, k])
        made = simulate(table, site, duration, settings["rate"], spec, rng)
        # A filter knows most at its end; the default method is asked for the start.
        for method, at, to in ((filter_, "end", found[0]), (None, "start", found[1])):
            fix = align(made.record, site, method, spec, at=at)
            true = made.truth.known("quat_nb")[0 if at == "start" else -1]
            to.append(misalignment(fix.quat_nb, true))
    return np.array(found[0]), np.array(found[1])


def run(options: Options) -> Experiment:
    """Redo the two positions, for several turns between them.

    Parameters
    ----------
    options : Options
    """
    case = conditions("fang2006")
    settings = case["simulation"]
    spec, site = ImuSpec.from_dict(case["instrument"], "patent"), Site(settings["lat"])
    runs = options.runs or case["runs"]
    jobs: list[tuple[Any, ...]] = [
        (number, a, min(a + _BLOCK, runs), options.seed)
        for number in range(len(case["positions"]))
        for a in range(0, runs, _BLOCK)
    ]
    done = list(each_run(_block, jobs, options))
    rows = []
    for number, place in enumerate(case["positions"]):
        parts = [part for job, part in zip(jobs, done, strict=True) if job[0] == number]
        document, best = (
            np.sqrt(np.mean(np.concatenate([part[i] for part in parts]) ** 2, axis=0))
            for i in (0, 1)
        )
        _, _, positions = table_of(place["angles"], settings["dwell"])
        bound = position_limit(spec, site, positions, 1.0 / settings["rate"]).sigma_arcmin
        rows += [
            Row(f"{place['name']}, rms phi {what}", "arcmin", None, document[i], best[i], bound[i],
                f"{document[i] / bound[i]:.2f} and {best[i] / bound[i]:.2f} times the limit")
            for i, what in enumerate(("east", "north", "up"))
        ]  # fmt: skip
    return experiment(case, "fang2006", options, runs, rows)
