"""Coarse alignment from gravity at two instants (Guo and others, 2015): table 1, and the gate.

Each run is one record at rest, 0.1 s to a sample. The document takes the specific force at two
instants of it; the default method takes all of it. So a pair of instants is one of as many
independent pairs, spread over the spans that the document gives for t1 and t2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import align, inertial_frame_error, limit
from schuler.alignment.history import inertial_to_local
from schuler.attitude import euler_to_quat, quat_to_matrix
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import Static
from schuler.published.figures import Curve, Figure
from schuler.published.guo2015_gate import gate_block, gate_rows
from schuler.published.guo2015_instants import (
    FORMS,
    NOISES,
    READINGS,
    SPANS,
    instants,
    phi_of,
    two_instants,
)
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    call,
    conditions,
    each_run,
    experiment,
)
from schuler.record import ImuRecord
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec
from schuler.simulation import Simulation, simulate

__all__ = ["READINGS", "fitted_conditions", "instants", "run", "two_instants"]

Array = NDArray[np.float64]

Changes = tuple[tuple[str, Any], ...]

AXES = "xyz"
_BLOCK = 25
_SHARE = 0.5
"""Part of the biases that the default method is told of (see the errata)."""


@dataclass(frozen=True)
class _Case:
    """A column of table 1 under one reading of its noise."""

    nabla: Array
    eps: Array
    force_noise: float
    rate_noise: float
    step: float

    @classmethod
    @cache
    def of(cls, number: int, noise: str, step: float) -> _Case:
        """Make the case of a number, with its noise, for samples of a step, s."""
        table = conditions("guo2015")["case"][number]  # the table's columns cannot be changed
        more = 1.0 if noise == "per sample" else step**-0.5
        return cls(
            MICRO_G * np.array(table["accel_bias_ug"]),
            DEG_PER_HOUR * np.array(table["gyro_bias_deg_h"]),
            more * MICRO_G * table["accel_noise_ug"],
            more * DEG_PER_HOUR * table["gyro_noise_deg_h"],
            step,
        )

    def measured(self, record: ImuRecord, white: Array) -> ImuRecord:
        """Return the record with biases and noise from standard normal numbers (n, 6)."""
        return replace(
            record,
            dtheta=record.dtheta + self.step * (self.eps + self.rate_noise * white[:, :3]),
            dvel=record.dvel + self.step * (self.nabla + self.force_noise * white[:, 3:]),
        )

    def spec(self, share: float = 0.0) -> ImuSpec:
        """Return the noise as a specification, with a share of the biases."""
        root = self.step**0.5
        return ImuSpec(
            GyroSpec(
                bias=share * float(np.abs(self.eps).mean()),
                angle_random_walk=self.rate_noise * root,
            ),
            AccelerometerSpec(
                bias=share * float(np.abs(self.nabla).mean()),
                velocity_random_walk=self.force_noise * root,
            ),
            name="table 1",
        )


@cache
def fitted_conditions() -> dict[str, Any]:
    """Return the latitude and the attitude that give the twelve printed numbers of theory.

    Least squares of equations 36 to 38, from a grid of starts over latitude and heading.

    Returns
    -------
    dict
        "lat", deg; "euler_deg", psi, theta, gamma; "largest", the largest difference, arcmin.
    """
    from scipy.optimize import least_squares

    table = conditions("guo2015")["case"]
    printed = np.array([case["theory"] for case in table])

    def difference(x: Array) -> Array:
        where = {"lat": float(x[0]), "euler_deg": x[1:]}
        rows = [_theory(where, number) for number in range(len(table))]
        return np.ravel(np.array(rows) - printed)

    low, high = [1.0, -360.0, -60.0, -60.0], [80.0, 360.0, 60.0, 60.0]
    fits = [
        least_squares(difference, [lat, psi, 0.0, 0.0], bounds=(low, high), xtol=1e-12)
        for lat in (20.0, 40.0, 60.0)
        for psi in (-135.0, -45.0, 45.0, 135.0)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    lat, psi, theta, gamma = (float(v) for v in best.x)
    psi = (psi + 180.0) % 360.0 - 180.0
    return {
        "lat": lat, "euler_deg": [psi, theta, gamma], "largest": float(np.abs(best.fun).max()),
    }  # fmt: skip


def _where(changes: Changes) -> dict[str, Any]:
    """Return what is simulated: latitude and attitude of the fit or as set, step and lengths."""
    case = conditions("guo2015", changes)
    return {**fitted_conditions(), **case.get("site", {}), **case["simulation"]}


@cache
def _still(
    length: float, step: float, lat: float, euler_deg: tuple[float, ...]
) -> tuple[Simulation, Site]:
    """Return an error-free record of Table 1."""
    psi, pitch, roll = euler_deg
    site = Site(lat)
    return simulate(Static(-psi, pitch, roll), site, length, 1.0 / step), site


def _record(span: str, where: dict[str, Any]) -> tuple[Simulation, Site]:
    return _still(where[span], where["step"], where["lat"], tuple(where["euler_deg"]))


def _block(
    number: int, first: int, last: int, runs: int, seed: int, changes: Changes
) -> dict[Any, Array]:
    """Return phi in i0, arcmin, of runs `first` to `last` of a case by every reading."""
    where = _where(changes)
    long, site = _record("long", where)
    truth = quat_to_matrix(long.truth.known("quat_nb")[0])
    start = inertial_to_local(0.0, site.latitude)
    true = start.T @ truth
    settings = conditions("guo2015", changes)
    duration = {span: settings["simulation"][span] for span in ("short", "long")}
    every = max(1, runs // settings["best_runs"])
    cases = {noise: _Case.of(number, noise, where["step"]) for noise in NOISES}
    out: dict[Any, list[Array]] = {}
    for k in range(first, last):
        rng = np.random.default_rng([seed, 2015, number, k])
        white = rng.standard_normal((len(long.record), 6))
        pairs = [instants(s, (k + 0.5) / runs, duration[of]) for s, of in SPANS.items()]
        for noise, case in cases.items():
            record = case.measured(long.record, white)
            for form, c in two_instants(record, site, pairs).items():
                for span, phi in zip(SPANS, phi_of(c, true), strict=True):
                    out.setdefault((noise, span, form), []).append(phi)
            for span, length in duration.items() if k % every == 0 else ():
                # The other reading of the noise is asked of the first case alone.
                if noise == "per sample" and number > 0:
                    continue
                part = record.rows(0, round(length / case.step))
                fix = align(part, site, spec=case.spec(_SHARE), at="start")
                found = start.T @ quat_to_matrix(fix.quat_nb)
                out.setdefault((noise, span), []).append(phi_of(found, true))
    return {key: np.array(value) for key, value in out.items()}


def _theory(where: dict[str, Any], number: int, span_sum: float = 0.0) -> Array:
    """Return equations 36 to 38 under printed or recovered conditions, arcmin."""
    site, case = Site(where["lat"]), _Case.of(number, "per sample", 1.0)
    quat = euler_to_quat(np.array(where["euler_deg"]) * DEG)
    # The document's micro-g is a millionth of the local gravity.
    nabla = case.nabla * site.gravity / (1e6 * MICRO_G)
    return inertial_frame_error(site, quat, case.eps, nabla, span_sum) / ARCMIN


def _limit(number: int, noise: str, span: str, where: dict[str, Any]) -> Array:
    """Return the limit of the spread about the biases' error in i0, arcmin."""
    case, (made, site) = _Case.of(number, noise, where["step"]), _record(span, where)
    bound = limit(case.spec(), site, made.record.duration, case.step)
    start = inertial_to_local(0.0, site.latitude)
    return np.asarray(np.sqrt(np.diag(start.T @ bound @ start)) / ARCMIN)


def _departures(found: dict[int, dict[Any, Array]], table: list[Any], reading: Any) -> Array:
    """Return by how many standard errors the printed spreads are off, all cases together (3,)."""
    ratio = [
        np.log(np.array(case["std"]) / found[k][reading].std(axis=0, ddof=1))
        for k, case in enumerate(table)
    ]
    n = len(found[0][reading])
    # A spread of n normal numbers is right to 1/sqrt(2 n); the printed one is of 500.
    error = np.sqrt((0.5 / n + 0.5 / 500) / len(table))
    return np.asarray(np.mean(ratio, axis=0) / error)


def run(options: Options) -> Experiment:
    """Redo table 1 and the gate's experiment.

    Parameters
    ----------
    options : Options

    Raises
    ------
    InputError
        For a place or an attitude that cannot be.
    """
    case, where = conditions("guo2015", options.changes), _where(options.changes)
    if len(where["euler_deg"]) != 3:
        raise InputError("guo2015: site.euler_deg has three angles: psi, theta, gamma")
    if not case["simulation"]["short"] <= case["simulation"]["long"]:
        raise InputError("guo2015: simulation.short must be no longer than simulation.long")
    _record("long", where)
    table, runs = case["case"], options.runs or case["runs"]
    gate_runs = min(runs, case["gate_runs"])
    jobs: list[tuple[Any, ...]] = [
        (_block, number, a, min(a + _BLOCK, runs), runs, options.seed, options.changes)
        for number in range(len(table))
        for a in range(0, runs, _BLOCK)
    ]
    jobs += [
        (gate_block, a, min(a + _BLOCK, gate_runs), options.seed, options.changes)
        for a in range(0, gate_runs, _BLOCK)
    ]
    done = list(each_run(call, jobs, options))
    found: dict[int, dict[Any, Array]] = {}
    gate: list[dict[str, Array]] = []
    for job, part in zip(jobs, done, strict=True):
        if job[0] is gate_block:
            gate.append(part)
            continue
        whole = found.setdefault(job[1], {})
        for key, value in part.items():
            whole[key] = value if key not in whole else np.concatenate([whole[key], value])
    rows = _table_rows(case, found, where)
    rows += gate_rows(case, {k: np.concatenate([g[k] for g in gate]) for k in gate[0]})
    return experiment(case, "guo2015", options, runs, rows, _figures(case, found, where))


def _figures(
    case: dict[str, Any], found: dict[int, dict[Any, Array]], where: dict[str, Any]
) -> list[Figure]:
    """Draw theory by case, and the azimuth error of the first case by the pair of instants."""
    number = np.arange(1, len(case["case"]) + 1, dtype=np.float64)
    theory = Figure(
        "Theory of Table 1 (equations 36 to 38), phi_x", "case, number", "phi_x, arcmin",
        tuple(
            Curve(name, number, np.array([rows[0] for rows in each]))
            for name, each in (
                ("as printed", [np.array(c["theory"]) for c in case["case"]]),
                ("fitted conditions", [_theory(where, k) for k in range(len(number))]),
                ("printed conditions",
                 [_theory(case["printed"], k) for k in range(len(number))]),
            )
        ),
    )  # fmt: skip
    runs = len(found[0][READINGS[0]])
    run = np.arange(1, runs + 1, dtype=np.float64)
    spread = Figure(
        "Azimuth error of each run, case 1, noise per root hertz, TRIAD",
        "run, number (the pairs of instants move through their spans)", "phi_z, arcmin",
        tuple(
            Curve(span, run, found[0][NOISES[0], span, FORMS[1]][:, 2]) for span in SPANS
        ),
    )  # fmt: skip
    return [theory, spread]


def _table_rows(
    case: dict[str, Any], found: dict[int, dict[Any, Array]], where: dict[str, Any]
) -> list[Row]:
    table = case["case"]
    rows = []
    for k, printed in enumerate(table):
        recovered, as_printed = _theory(where, k), _theory(case["printed"], k)
        rows += [
            Row(f"case {k + 1}, theory phi_{AXES[i]}", "arcmin", printed["theory"][i], recovered[i],
                note=f"{_said(where)}; the printed conditions give {as_printed[i]:.2f}")
            for i in range(3)
        ]  # fmt: skip
    off = {reading: _departures(found, table, reading) for reading in READINGS}
    nearest = min(READINGS, key=lambda reading: float(np.abs(off[reading]).max()))
    noise, span, form = nearest
    kind = SPANS[span]
    for k, printed in enumerate(table):
        phi, best = found[k][nearest], found[k].get((noise, kind), None)
        sums = [sum(instants(span, (j + 0.5) / len(phi), case["simulation"][kind]))
                for j in range(len(phi))]  # fmt: skip
        theory = np.mean([_theory(where, k, s) for s in sums], axis=0)
        error = phi.std(axis=0, ddof=1) / np.sqrt(len(phi))
        rows += [
            Row(f"case {k + 1}, mean phi_{AXES[i]}", "arcmin", printed["mean"][i],
                phi[:, i].mean(), None if best is None else best[:, i].mean(),
                note=f"theory {theory[i]:.2f}: {(phi[:, i].mean() - theory[i]) / error[i]:+.1f} "
                "standard errors off")
            for i in range(3)
        ]  # fmt: skip
        bound = _limit(k, noise, kind, where)
        rows += [
            Row(f"case {k + 1}, std phi_{AXES[i]}", "arcmin", printed["std"][i],
                phi[:, i].std(ddof=1), None if best is None else best[:, i].std(ddof=1), bound[i],
                f"noise {noise}; {span}; {form}")
            for i in range(3)
        ]  # fmt: skip
    named = float(np.abs(off[nearest]).max()) < 3.0
    rows.append(
        Row("readings that give the printed spreads", "of all that were run",
            document_method=sum(float(np.abs(x).max()) < 3.0 for x in off.values()),
            note=("it is" if named else "none does; the nearest is")
            + f" noise {noise}, {span}, {form}")
    )  # fmt: skip
    for reading in READINGS:
        noise, span, form = reading
        spread = found[0][reading].std(axis=0, ddof=1)
        best = found[0][noise, SPANS[span]].std(axis=0, ddof=1)
        bound = _limit(0, noise, SPANS[span], where)
        far = ", ".join(f"{x:+.1f}" for x in off[reading])
        rows += [
            Row(f"case 1, std phi_{AXES[i]}: {noise}, {span}, {form}", "arcmin",
                table[0]["std"][i], spread[i], best[i], bound[i],
                f"printed spreads of all cases off by {far} standard errors (x, y, z)")
            for i in range(3)
        ]  # fmt: skip
    return rows


def _said(where: dict[str, Any]) -> str:
    psi, theta, gamma = where["euler_deg"]
    return f"lat {where['lat']:.2f}, (psi, theta, gamma) ({psi:.2f}, {theta:.2f}, {gamma:.2f}) deg"
