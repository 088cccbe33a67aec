"""Two positions, a turn about any axis, and a Kalman filter of ten states (Fang, 2006)."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import Position, align, position_limit
from schuler.alignment.stationary.analytic import analytic_attitude
from schuler.attitude import nearest_quat
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter, GroupNoise, Layout, ProcessNoise, ZeroVelocity
from schuler.motion.turntable import AXES, Dwell, Turn, Turntable
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
from schuler.simulation import simulate

__all__ = ["STARTS", "printed_filter", "run", "table_of"]

Array = NDArray[np.float64]

_BLOCK = 15

STARTS = ("P0 as printed", "P0 in the meant order", "wide P0")
"""Orders of the initial variances of the misalignments."""

_SIDES = ("east", "north", "up")
_TILTED = 1.0
"""Pitch or roll, deg, from which on the third accelerometer's bias is a state."""


def _site(case: dict[str, Any]) -> Site:
    """Return the place; the simulated one has normal gravity, and nothing is to be added for it."""
    return Site(case["site"]["lat"], gravity_sigma=0.0, deflection_sigma=0.0)


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
        positions.append(_position(after, dwell, float(sum(turn.time for turn in turns))))
    table = Turntable(tuple(steps), (angles[0][0], angles[0][1], angles[0][2]))
    return table, table.period, positions


def printed_filter(
    record: ImuRecord, site: Site, case: dict[str, Any], start: str, tilted: bool
) -> ErrorStateFilter:
    """Return the document's filter after a record.

    It starts from the analytic attitude of the first position and carries it by the gyros; the
    horizontal velocity is measured to be nothing, at rest and in the turn.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    case : dict
        The conditions of the experiment.
    start : str
        One of `STARTS`.
    tilted : bool
        Whether the third accelerometer's bias is a state.
    """
    rules = case["filter"]
    first = record.rows(0, round(case["simulation"]["dwell"] * case["simulation"]["rate"]))
    span = float(first.dt.sum())
    attitude, _ = analytic_attitude(
        first.dtheta.sum(axis=0) / span, first.dvel.sum(axis=0) / span, site, "gravity"
    )
    tilt, azimuth = rules["tilt_arcsec"] * ARCMIN / 60.0, rules["azimuth_arcmin"] * ARCMIN
    wide = np.array([rules["wide_tilt_deg"]] * 2 + [rules["wide_azimuth_deg"]]) * DEG
    phi = {
        STARTS[0]: np.array([azimuth, tilt, tilt]),
        STARTS[1]: np.array([tilt, tilt, azimuth]),
        STARTS[2]: wide,
    }[start]
    layout = Layout(["phi", "velocity", "gyro_bias", "accelerometer_bias"])
    level = np.array([1.0, 1.0, 0.0])
    force, rate = rules["accelerometer_ug"] * MICRO_G, rules["gyro_deg_h"] * DEG_PER_HOUR
    sigma = np.zeros(layout.size)
    sigma[layout["phi"]] = phi
    sigma[layout["velocity"]] = rules["velocity"] * level
    sigma[layout["gyro_bias"]] = rate
    sigma[layout["accelerometer_bias"]] = force * (np.ones(3) if tilted else level)
    noise = ProcessNoise.of(
        layout, {"velocity": GroupNoise(force**2 * level), "phi": GroupNoise(rate**2)}
    )
    begin = float(record.time[0] - record.dt[0])
    steps = np.arange(1, int((record.time[-1] - begin) / rules["step"] + 1e-6) + 1)
    times = np.minimum(begin + rules["step"] * steps, record.time[-1])
    aid = ZeroVelocity(times, 0.0, rules["velocity_noise"] * level, name="rest")
    f = ErrorStateFilter(
        layout, site, nearest_quat(attitude), np.diag(sigma**2), noise, [aid], fixed_place=True,
        step=rules["step"], vertical=False,
    )  # fmt: skip
    return f.update(record)


def _tilted(angles: list[list[float]]) -> bool:
    return any(max(abs(pitch), abs(roll)) > _TILTED for _, pitch, roll in angles)


def _nees(phi: Array, covariance: Array) -> float:
    """Return phi (arcmin) squared by its covariance (rad^2), divided by three."""
    return float(phi @ np.linalg.solve(covariance / ARCMIN**2, phi)) / 3.0


def _block(
    number: int, first: int, last: int, seed: int, changes: tuple[tuple[str, Any], ...]
) -> dict[str, Array]:
    """Return phi (runs, 3), arcmin, and NEES/3 (runs,) at the end by each filter."""
    case = conditions("fang2006", changes)
    settings = case["simulation"]
    spec, site = instrument(case, "patent"), _site(case)
    angles = case["case"][number]["angles"]
    table, duration, _ = table_of(angles, settings["dwell"])
    out: dict[str, list[Any]] = {}
    for k in range(first, last):
        rng = np.random.default_rng([seed, 2006, number, k])
        made = simulate(table, site, duration, settings["rate"], spec, rng)
        true = made.truth.known("quat_nb")[-1]
        for start in STARTS:
            f = printed_filter(made.record, site, case, start, _tilted(angles))
            at = f.layout["phi"]
            phi = misalignment(f.quat_nb, true)
            out.setdefault(start, []).append(phi)
            out.setdefault(f"nees {start}", []).append(_nees(phi, f.covariance[at, at]))
            if k == 0:
                history = f.history()
                sigma = history.sigma("phi")[:, 2] / ARCMIN
                out[f"curve {start}"] = [history.time, sigma]
        fix = align(made.record, site, spec=spec, at="end")
        phi = misalignment(fix.quat_nb, true)
        out.setdefault("default", []).append(phi)
        out.setdefault("nees default", []).append(_nees(phi, fix.covariance))
    return {key: np.array(value) for key, value in out.items()}


def _rms_errors(phi: Array) -> tuple[Array, Array]:
    """Return the rms (3,) of misalignments (runs, 3), and its standard error."""
    each = np.array([rms_error(column) for column in phi.T])
    return each[:, 0], each[:, 1]


def run(options: Options) -> Experiment:
    """Redo the two positions, for several turns between them.

    Parameters
    ----------
    options : Options

    Raises
    ------
    InputError
        For a dwell without ten steps of the filter.
    """
    case = conditions("fang2006", options.changes)
    settings = case["simulation"]
    if settings["dwell"] < 10.0 * case["filter"]["step"]:
        raise InputError("fang2006: simulation.dwell must be ten times filter.step at least")
    spec, site = instrument(case, "patent"), _site(case)
    runs = options.runs or case["runs"]
    jobs: list[tuple[Any, ...]] = [
        (number, a, min(a + _BLOCK, runs), options.seed, options.changes)
        for number in range(len(case["case"]))
        for a in range(0, runs, _BLOCK)
    ]
    done = list(each_run(_block, jobs, options))
    rows: list[Row] = []
    figures: list[Figure] = []
    for number, place in enumerate(case["case"]):
        parts = [part for job, part in zip(jobs, done, strict=True) if job[0] == number]
        found = {
            key: np.concatenate([part[key] for part in parts])
            for key in parts[0] if not key.startswith("curve")
        }  # fmt: skip
        _, _, positions = table_of(place["angles"], settings["dwell"])
        bound = position_limit(spec, site, positions, 1.0 / settings["rate"]).sigma_arcmin
        best, best_error = _rms_errors(found["default"])
        for start in STARTS:
            own, own_error = _rms_errors(found[start])
            rows += [
                Row(f"{place['name']}, rms phi {side}, {start}", "arcmin", None, own[i], best[i],
                    bound[i],
                    f"standard errors {own_error[i]:.2g} and {best_error[i]:.2g}; "
                    f"{own[i] / bound[i]:.2f} and {best[i] / bound[i]:.2f} times the limit")
                for i, side in enumerate(_SIDES)
            ]  # fmt: skip
            rows.append(
                Row(f"{place['name']}, NEES / 3, {start}", "1", None,
                    found[f"nees {start}"].mean(), found["nees default"].mean(),
                    note=f"1 ± {np.sqrt(2.0 / 3.0 / runs):.2f} if consistent")
            )  # fmt: skip
        figures.append(
            Figure(
                f"Sigma of the azimuth that the filter says, {place['name']}, first run",
                "time, s", "sigma, arcmin",
                tuple(Curve(start, *parts[0][f"curve {start}"]) for start in STARTS), log_y=True,
            )
        )  # fmt: skip
    return experiment(case, "fang2006", options, runs, rows, figures)
