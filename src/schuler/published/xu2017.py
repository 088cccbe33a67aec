"""A platform's coefficients from a centrifuge test of six positions (Xu and Zhang, 2017)."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.centrifuge import (
    PUBLISHED_ESTIMATES,
    PUBLISHED_POSITIONS,
    Ekf,
    Judgement,
    Objective,
    Plant,
    Problem,
    fit_platform,
    judge,
    plan,
    published_truth,
    scheme_information,
    simulate_platform,
)
from schuler.centrifuge.coefficients import coefficient_names, coefficient_units
from schuler.centrifuge.plant import ORDERS
from schuler.errors import InputError
from schuler.published.figures import Curve, Figure
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    call,
    conditions,
    each_run,
    experiment,
)

__all__ = ["figures", "run"]

Array = NDArray[np.float64]

_BLOCK = 5
SEARCHED = ("sum-rho", "min-max")
"""Objectives for which another scheme is searched."""

_GYRO = slice(0, 27)
_ACCEL = slice(27, 42)
_MEDIAN_OF_NORMAL = 0.674489750196082
"""Median size of a normal number of unit sigma."""


def figures(errors: Array) -> Array:
    """Return the figures that the document prints from errors (..., 45) in rad/s, g and rad.

    Worst of the gyros and D_Fz, %; worst of the accelerometers, %; worst k0, ug; worst k1, ug/g.
    """
    names = coefficient_names()
    relative = 100.0 * np.abs(errors / published_truth())
    customary = np.abs(errors) / coefficient_units()[1]

    def worst(stem: str) -> Array:
        return np.asarray(customary[..., [n.startswith(stem) for n in names]].max(axis=-1))

    return np.stack(
        [
            relative[..., _GYRO].max(axis=-1),
            relative[..., names.index("D_Fz")],
            relative[..., _ACCEL].max(axis=-1),
            worst("k0"),
            worst("k1"),
        ],
        axis=-1,
    )


def _plant(case: dict[str, Any], order: str) -> Plant:
    return Plant(order=order, **case["plant"])


def _block(
    first: int, last: int, seed: int, changes: tuple[tuple[str, Any], ...]
) -> tuple[Array, Array]:
    """Return the coefficients' errors (runs, 45) after one pass and after several."""
    case = conditions("xu2017", changes)
    settings, truth = case["simulation"], published_truth()
    plant = _plant(case, settings["order"])
    rng = np.random.default_rng([seed, 2017, first])
    outputs = simulate_platform(
        plant, PUBLISHED_POSITIONS, settings["dwell"], truth, rng, last - first
    )
    errors = np.full((2, len(outputs), len(truth)), np.inf)
    for k, passes in enumerate((1, settings["passes"])):
        for row, one in zip(errors[k], outputs, strict=True):
            # Of one pass that diverges, nothing is known: its errors stay as large as any.
            with contextlib.suppress(InputError):
                row[:] = fit_platform(plant, PUBLISHED_POSITIONS, one, Ekf(passes=passes)).value
                row -= truth
    return errors[0], errors[1]


def run(options: Options) -> Experiment:
    """Redo the test of six positions, and judge its scheme.

    Parameters
    ----------
    options : Options

    Raises
    ------
    InputError
        For a plant or a dwell that cannot be.
    """
    case = conditions("xu2017", options.changes)
    settings, printed, runs = case["simulation"], case["printed"], options.runs or case["runs"]
    plant = _plant(case, settings["order"])
    # Refused before the work, if this dwell cannot be.
    Problem(plant, dwell=settings["dwell"])
    jobs: list[tuple[Any, ...]] = [
        (_block, a, min(a + _BLOCK, runs), options.seed, options.changes)
        for a in range(0, runs, _BLOCK)
    ]
    orders = (settings["order"], *(o for o in ORDERS if o != settings["order"]))
    searches = [(name, order) for order in orders for name in SEARCHED]
    jobs = [(_searched, *search, options.changes) for search in searches] + jobs
    each = list(each_run(call, jobs, options))
    found, done = dict(zip(searches, each, strict=False)), each[len(searches) :]
    errors = [np.concatenate([d[i] for d in done]) for i in (0, 1)]
    one, more = (np.median(figures(x), axis=0) for x in errors)
    dwell = settings["dwell"]
    least = np.asarray(np.linalg.inv(scheme_information(plant, PUBLISHED_POSITIONS, dwell)))
    rng = np.random.default_rng([options.seed, 45])
    drawn = rng.standard_normal((4000, len(least))) @ np.linalg.cholesky(least).T
    bound = np.median(figures(drawn), axis=0)
    rows = [
        Row(quantity, unit, printed[key], one[k], more[k], bound[k],
            "median of the runs" + ("; printed: less than this" if key == "k0_ug" else ""))
        for k, (quantity, unit, key) in enumerate((
            ("worst error of a gyro coefficient", "%", "gyro_percent"),
            ("error of D_Fz", "%", "D_Fz_percent"),
            ("worst error of an accelerometer coefficient", "%", "accelerometer_percent"),
            ("worst error of k0", "ug", "k0_ug"),
            ("worst error of k1", "ug/g", "k1_ug_g"),
        ))
    ]  # fmt: skip
    for order in orders:
        schemes = {name: found[name, order] for name in SEARCHED}
        rows += _scheme_rows(case, replace(plant, order=order), schemes)
    lost = [int(np.isinf(x).any(axis=1).sum()) for x in errors]
    rows.append(
        Row("runs in which the filter diverges", "1", None, lost[0], lost[1],
            note=f"of {runs}; their errors count as larger than all others")
    )  # fmt: skip
    number = np.arange(1, len(least) + 1, dtype=np.float64)
    figure = Figure(
        "Error of each coefficient over its sigma, rms of the runs that converge",
        "coefficient, number in the order of table 2", "rms error over the least sigma, 1",
        tuple(
            Curve(name, number, np.sqrt(np.mean(x[np.isfinite(x).all(axis=1)] ** 2, axis=0))
                  / np.sqrt(np.diag(least)))
            for name, x in zip(("one pass", "linearised again"), errors, strict=True)
        ), log_y=True,
    )  # fmt: skip
    return experiment(case, "xu2017", options, runs, rows + _table_rows(errors, least), (figure,))


def _searched(name: str, order: str, changes: tuple[tuple[str, Any], ...]) -> Judgement:
    """Return what a scheme is worth that a search for an objective finds, at the same dwell."""
    case = conditions("xu2017", changes)
    plant = _plant(case, order)
    search, dwell = case["search"], case["simulation"]["dwell"]
    scheme = plan(
        Problem(plant, dwell=dwell, objective=Objective(name)), seed=search["seed"],
        rounds=search["rounds"], workers=1,
    )  # fmt: skip
    return judge(plant, scheme.positions, dwell)


def _table_rows(errors: list[Array], least: Array) -> list[Row]:
    """Return the document's whole Table 2: the size of each coefficient's error, beside ours."""
    units, factor = coefficient_units()
    truth = published_truth() / factor
    one, more = (np.median(np.abs(each), axis=0) / factor for each in errors)
    bound = _MEDIAN_OF_NORMAL * np.sqrt(np.diag(least)) / factor
    return [
        # The document's digits end at four decimals.
        Row(f"error of {name}", units[k], round(abs(printed - truth[k]), 5), one[k], more[k],
            bound[k], f"true {truth[k]:g}, the document's estimate {printed:g}")
        for k, (name, printed) in enumerate(zip(coefficient_names(), PUBLISHED_ESTIMATES,
                                                strict=True))
    ]  # fmt: skip


def _scheme_rows(case: dict[str, Any], plant: Plant, found: dict[str, Judgement]) -> list[Row]:
    """Judge the printed scheme, and those found for two purposes at the same dwell."""
    own = judge(plant, PUBLISHED_POSITIONS, case["simulation"]["dwell"])
    order = ", ".join(plant.order)
    rows = [
        Row(f"sum of |correlation| of the scheme, order {order}", "1", None, own.values["sum-rho"],
            found["sum-rho"].values["sum-rho"],
            note="best: the scheme that a search for this sum finds"),
    ]  # fmt: skip
    for what, part in (("gyro", _GYRO), ("accelerometer", _ACCEL)):
        rows.append(
            Row(f"worst sigma of the scheme, {what}, order {order}", "%", None,
                own.relative[part].max(), found["min-max"].relative[part].max(),
                own.relative[part].max(),
                "best: another scheme, searched for the least worst sigma; limit: of the "
                "document's scheme")
        )  # fmt: skip
    return rows
