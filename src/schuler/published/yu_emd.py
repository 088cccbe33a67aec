"""Empirical mode decomposition before TRIAD and a Kalman filter on a vehicle (Yu and others).

The chain is the document's: singular values, decomposition with predicted ends, TRIAD of the
inertial frame at the middle and the end, and a Kalman filter that starts from that TRIAD and takes
the velocity for nothing.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import Alignment, Inertial, KalmanAlignment, align
from schuler.attitude import multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle
from schuler.prefilter import Emd, LowPass, Prefilter, VelocityEmd
from schuler.published.figures import Curve, Figure
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    conditions,
    each_run,
    experiment,
    instrument,
    misalignment,
    rms_error,
)
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.simulation import simulate

__all__ = ["curve_error", "filters", "kalman", "run", "settled"]

Array = NDArray[np.float64]

PLAIN, IMPROVED = "EMD", "improved EMD"
NONE, ROBUST, DEFAULT = "no prefilter", "robust Kalman, no prefilter", "default"
_BLOCK = 5
_POINTS = 600


def filters(case: dict[str, Any]) -> dict[str, Prefilter | None]:
    """Return the prefilters that are compared: the document's, none, and others beside them."""
    rules = case["filter"]
    stop = rules["stop"]
    return {
        NONE: None,
        PLAIN: VelocityEmd(stop, ends="mirror"),
        IMPROVED: VelocityEmd(stop, ends="pattern", order=rules["order"], clean=rules["rank"]),
        "EMD, ends by a weighted fit": VelocityEmd(stop),
        "zero-phase low-pass": LowPass(rules["lowpass"], zero_phase=True),
        "EMD of the force": Emd(threshold=stop, first=False),
    }


def kalman(case: dict[str, Any], robust: str | None = None) -> KalmanAlignment:
    """Return the document's filter: ten states, the velocity, a start from TRIAD."""
    return KalmanAlignment(
        10, "velocity", base=False, robust=robust, step=case["filter"]["step"],
        start="integral-triad",
    )  # fmt: skip


def curve_error(fix: Alignment, quat_nb: Array, rate: float) -> tuple[Array, Array]:
    """Return time (k,), s, and azimuth error (k,), arcmin, of what a filter said on its way.

    Parameters
    ----------
    fix : Alignment
        Of a Kalman filter.
    quat_nb : (n + 1, 4) float64
        The truth at the start and at the end of each sample.
    rate : float
        Hz.
    """
    assert fix.filter_history is not None
    t, found = fix.filter_history.t, fix.filter_history.quaternion
    rows = np.clip(np.round(t * rate).astype(np.int64), 0, len(quat_nb) - 1)
    back = quat_nb[rows] * [1.0, -1.0, -1.0, -1.0]
    return t, np.asarray(-quat_to_rotvec(multiply(found, back))[:, 2] / ARCMIN)


def settled(t: Array, error: Array, within: float) -> float:
    """Return the time from which on an error stays within a bound, s; infinite if it never does.

    Parameters
    ----------
    t, error : (k,) float64
    within : float
        In the error's unit. The error is that against the truth, so that a heading that stands
        still at a wrong value has not settled.
    """
    far = np.flatnonzero(np.abs(error) > within)
    if not len(far):
        return float(t[0])
    return float("inf") if far[-1] + 1 >= len(t) else float(t[far[-1] + 1])


def _timed(prefilter: Prefilter | None, record: ImuRecord) -> tuple[ImuRecord, float]:
    begin = time.perf_counter()
    out = record if prefilter is None else prefilter(record)
    return out, time.perf_counter() - begin


def _one(
    record: ImuRecord, quat_nb: Array, case: dict[str, Any], spec: ImuSpec, site: Site
) -> tuple[dict[str, float], dict[str, tuple[Array, Array]]]:
    """Return the figures of one record, and the error curves of its filters."""
    settings = case["simulation"]
    rate, whole = settings["rate"], settings["duration"]
    out: dict[str, float] = {}
    curves = {}
    coarse = Inertial("integral-triad")
    for end in settings["ends"]:
        rows = round(end * rate)
        part, true = record.rows(0, rows), quat_nb[rows]

        def miss(fix: Alignment, true: Array = true) -> float:
            return float(misalignment(fix.quat_nb, true)[2])

        ways = {name: (each, kalman(case)) for name, each in filters(case).items()}
        ways[ROBUST] = (None, kalman(case, "igg3"))
        for name, (prefilter, method) in ways.items():
            smooth, seconds = _timed(prefilter, part)
            fix = align(smooth, site, method, spec)
            out[f"{name} at {end:g} s"] = miss(fix)
            if name != ROBUST:
                out[f"TRIAD {name} at {end:g} s"] = miss(align(smooth, site, coarse, spec))
            if end == whole:
                out[f"seconds {name}"] = seconds
                t, error = curves[name] = curve_error(fix, quat_nb, rate)
                late = error[t >= settings["curve_from"]]
                out[f"curve {name}"] = float(late.std())
                out[f"settled {name}"] = settled(t, error, settings["settled_arcmin"])
        fix = align(part, site, spec=spec)
        out[f"{DEFAULT} at {end:g} s"] = miss(fix)
        if fix.limit_arcmin is not None:
            out[f"limit at {end:g} s"] = float(fix.limit_arcmin[2])
    return out, curves


def _block(
    first: int, last: int, seed: int, changes: tuple[tuple[str, Any], ...]
) -> tuple[dict[str, Array], tuple[Figure, ...]]:
    """Return the figures of runs, and what is drawn of the first run of all."""
    case = conditions("yu_emd", changes)
    settings = case["simulation"]
    site, spec = Site(case["site"]["lat"]), instrument(case, "yu_emd")
    found: dict[str, list[float]] = {}
    figures: tuple[Figure, ...] = ()
    for k in range(first, last):
        rng = np.random.default_rng([seed, 3, k])
        motion = DisturbedVehicle.with_crew(rng, settings["duration"], heading=rng.uniform(0, 360))
        made = simulate(motion, site, settings["duration"], settings["rate"], spec, rng)
        if k == first:
            for each in filters(case).values():
                _timed(each, made.record)  # compiled and cached, so that times are the filter's
        truth = made.truth.known("quat_nb")
        one, curves = _one(made.record, truth, case, spec, site)
        for name, value in one.items():
            found.setdefault(name, []).append(value)
        if k == 0:
            figures = (_heading_figure(curves), *_mode_figures(made.record, case))
    return {key: np.array(value) for key, value in found.items()}, figures


def _heading_figure(curves: dict[str, tuple[Array, Array]]) -> Figure:
    shown = [name for name in curves if name != "EMD of the force"]
    return Figure(
        "Azimuth error of the Kalman filter on the first record", "time, s",
        "azimuth error, arcmin",
        tuple(Curve(name, *(x[10:] for x in curves[name])) for name in shown),
    )  # fmt: skip


def _mode_figures(record: ImuRecord, case: dict[str, Any]) -> tuple[Figure, ...]:
    """Draw the modes of the first axis' velocity, and its energy by mode."""
    design = filters(case)[IMPROVED]
    assert isinstance(design, VelocityEmd)
    velocity, _ = design.velocity(record)
    interval = float(record.dt[0])
    modes, trend = design.modes(np.ascontiguousarray(velocity[:, 0]), interval)
    every = max(1, velocity.shape[0] // _POINTS)
    t = np.asarray(interval * np.arange(len(velocity), dtype=np.float64)[::every])
    names = [f"mode {k + 1}" for k in range(len(modes) - 1)] + ["residual"]
    lines = [Curve("velocity without its cubic", t, (velocity[:, 0] - trend)[::every])]
    lines += [Curve(name, t, mode[::every]) for name, mode in zip(names, modes, strict=True)]
    number = np.arange(1, len(modes), dtype=np.float64)
    return (
        Figure("Modes of the velocity, first axis of the held frame, improved EMD, first record",
               "time, s", "velocity, m/s", tuple(lines)),
        Figure("Energy of the modes: those before and with the least are dropped", "mode, number",
               "mean square, m²/s²",
               (Curve("energy", number, np.mean(modes[:-1] ** 2, axis=1)),), log_y=True),
    )  # fmt: skip


def run(options: Options) -> Experiment:
    """Redo the alignments of a disturbed vehicle without and with the filter.

    Parameters
    ----------
    options : Options

    Raises
    ------
    InputError
        If the records do not end at the end of the simulation.
    """
    case = conditions("yu_emd", options.changes)
    settings, runs = case["simulation"], options.runs or case["runs"]
    ends = settings["ends"]
    if max(ends) != settings["duration"] or min(ends) < 20.0:
        raise InputError(
            f"yu_emd: the last of simulation.ends ({max(ends):g} s) must be simulation.duration "
            f"({settings['duration']:g} s), and none below 20 s"
        )
    if not settings["curve_from"] < settings["duration"]:
        raise InputError("yu_emd: simulation.curve_from must lie within simulation.duration")
    instrument(case, "yu_emd")
    jobs: list[tuple[Any, ...]] = [
        (a, min(a + _BLOCK, runs), options.seed, options.changes) for a in range(0, runs, _BLOCK)
    ]
    done = list(each_run(_block, jobs, options))
    found = {key: np.concatenate([part[key] for part, _ in done]) for key in done[0][0]}
    rows = _rows(case, found)
    names = [*filters(case), ROBUST, DEFAULT]
    growth = Figure(
        "Azimuth error of ever longer records, rms of the runs", "length of the record, s",
        "azimuth error, arcmin",
        tuple(
            Curve(name, np.array(ends),
                  np.array([rms_error(found[f"{name} at {end:g} s"])[0] for end in ends]))
            for name in names
        ), log_y=True,
    )  # fmt: skip
    return experiment(case, "yu_emd", options, runs, rows, (growth, *done[0][1]))


def _rows(case: dict[str, Any], found: dict[str, Array]) -> list[Row]:
    printed, settings = case["printed"], case["simulation"]
    names = [*filters(case), ROBUST]
    runs = len(found[f"curve {NONE}"])

    def figure(name: str, before: str, after: str) -> float | None:
        return printed[before] if name == NONE else printed[after] if name == IMPROVED else None

    rows = []
    for name in names:
        value, error = rms_error(found[f"curve {name}"])
        rows.append(
            Row(f"std of the heading curve, {name}", "arcmin",
                figure(name, "before_arcmin", "after_arcmin"), value,
                note=f"standard error {error:.2g}")
        )  # fmt: skip
    for stage, used in (("Kalman", names), ("TRIAD", list(filters(case)))):
        for end in settings["ends"]:
            best, bound = (
                rms_error(found[f"{which} at {end:g} s"])[0] if f"{which} at {end:g} s" in found
                else None for which in (DEFAULT, "limit")
            )  # fmt: skip
            for name in used:
                key = f"{name} at {end:g} s"
                value, error = rms_error(found[key if stage == "Kalman" else f"TRIAD {key}"])
                rows.append(
                    Row(f"azimuth rms at {end:g} s, {stage}, {name}", "arcmin", None, value, best,
                        bound, f"standard error {error:.2g}")
                )  # fmt: skip
    difference = np.abs(found[f"{NONE} at {settings['duration']:g} s"]
                        - found[f"{IMPROVED} at {settings['duration']:g} s"])  # fmt: skip
    rows.append(
        Row("mean |heading with improved EMD - without|", "arcmin", printed["difference_arcmin"],
            difference.mean(),
            note=f"standard error {difference.std(ddof=1) / np.sqrt(runs):.2g}")
    )  # fmt: skip
    within = settings["settled_arcmin"]
    for name in names:
        times = found[f"settled {name}"]
        middle = float(np.median(times))
        share = f"{np.count_nonzero(np.isfinite(times))} of {runs} runs settle"
        rows.append(
            Row(f"settled within {within:g}' of the truth, {name}", "s",
                figure(name, "settled_before_s", "settled_after_s"),
                middle if np.isfinite(middle) else None,
                note=share if np.isfinite(middle) else f"longer than the record: {share}")
        )  # fmt: skip
    rows += [
        Row(f"time of the filter, {name}", "s",
            {PLAIN: printed["plain_s"], IMPROVED: printed["improved_s"]}.get(name),
            float(np.median(found[f"seconds {name}"])),
            note=f"{settings['duration']:g} s at {settings['rate']:g} Hz on this machine")
        for name in filters(case) if name != NONE
    ]  # fmt: skip
    return rows
