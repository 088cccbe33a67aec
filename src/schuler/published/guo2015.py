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

from schuler.alignment import Inertial, align, inertial_frame_error, limit
from schuler.alignment.history import inertial_to_local
from schuler.attitude import euler_to_quat, quat_to_matrix, rotate
from schuler.constants import ARCMIN, DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.motion import DisturbedVehicle, Static
from schuler.motion.vehicle import Crew
from schuler.prefilter import Gate, LowPass
from schuler.prefilter.base import Prefilter, held_frame
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    conditions,
    each_run,
    experiment,
    misalignment,
)
from schuler.record import ImuRecord
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec, load_spec
from schuler.simulation import Simulation, simulate

__all__ = ["READINGS", "instants", "run", "two_instants"]

Array = NDArray[np.float64]

AXES = "xyz"
NOISES = ("per root hertz", "per sample")
#: how a pair of instants is laid into the record, and which span the record has
SPANS = {
    "100 s: t1 to 50 s, t2 = t1 + 50 s": "short",
    "20 min: t1 to 10 min, t2 = t1 + 10 min": "long",
    "20 min: t1 to 50 s, t2 in the second half": "long",
}
FORMS = ("eq. 6 and 9", "TRIAD")
READINGS = tuple((noise, span, form) for noise in NOISES for span in SPANS for form in FORMS)
_BLOCK = 25
_SHARE = 0.5
"""Part of the biases that the default method is told of (see the errata)."""


def instants(span: str, share: float, duration: float) -> tuple[float, float]:
    """Return t1 and t2, s, of the pair at a share (0 to 1) of the spans.

    Parameters
    ----------
    span : str
        One of `SPANS`.
    share : float
    duration : float
        Of the record, s.
    """
    which = list(SPANS).index(span)
    half = 0.5 * duration
    if which < 2:
        return share * half, (1.0 + share) * half
    return share * 50.0, (1.0 + share) * half


def two_instants(
    record: ImuRecord, site: Site, pairs: list[tuple[float, float]]
) -> dict[str, Array]:
    """Return phi in i0 of C_ib0^i0, times C_ib0^i0, from the force at two instants.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    pairs : list of (t1, t2)
        s since the start.

    Returns
    -------
    dict of str to (k, 3, 3) float64
        The estimated C_ib0^i0 by each of `FORMS`; that of equation 6 is not quite a rotation.
    """
    middle = record.time - 0.5 * record.dt
    force = rotate(held_frame(record), record.accel)
    rows = np.clip(np.searchsorted(record.time, np.array(pairs), "right"), 0, len(record) - 1)
    gravity = site.gravity * inertial_to_local(middle, site.latitude)[:, 2]
    f1, f2, g1, g2 = force[rows[:, 0]], force[rows[:, 1]], gravity[rows[:, 0]], gravity[rows[:, 1]]

    def columns(a: Array, b: Array) -> Array:
        return np.stack([a, b, np.cross(a, b)], axis=-1)

    def triad(a: Array, b: Array) -> Array:
        x = a / np.linalg.norm(a, axis=-1, keepdims=True)
        y = np.cross(a, b)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=-1)

    printed = np.linalg.solve(columns(g1, g2).swapaxes(-1, -2), columns(f1, f2).swapaxes(-1, -2))
    return {
        "eq. 6 and 9": np.asarray(printed, np.float64),
        "TRIAD": triad(g1, g2) @ triad(f1, f2).swapaxes(-1, -2),
    }


def _phi(found: Array, true: Array) -> Array:
    """Return the antisymmetric part of C_est C^T = I + S - [phi x] as phi (..., 3), arcmin."""
    e = found @ true.T
    return np.stack(
        [e[..., 1, 2] - e[..., 2, 1], e[..., 2, 0] - e[..., 0, 2], e[..., 0, 1] - e[..., 1, 0]], -1
    ) / (2.0 * ARCMIN)


@dataclass(frozen=True)
class _Case:
    """A column of table 1 under one reading of its noise."""

    nabla: Array
    eps: Array
    force_noise: float
    rate_noise: float
    step: float

    @classmethod
    def of(cls, number: int, noise: str) -> _Case:
        case = conditions("guo2015")
        table, step = case["case"][number], float(case["simulation"]["step"])
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
def _still(span: str) -> tuple[Simulation, Site]:
    """Return an error-free record under the recovered conditions."""
    case = conditions("guo2015")
    psi, pitch, roll = case["recovered"]["euler_deg"]
    site, step = Site(case["recovered"]["lat"]), case["simulation"]["step"]
    motion = Static(-psi, pitch, roll)
    return simulate(motion, site, case["simulation"][span], 1.0 / step), site


def _block(number: int, first: int, last: int, runs: int, seed: int) -> dict[Any, Array]:
    """Return phi in i0, arcmin, of runs `first` to `last` of a case by every reading."""
    long, site = _still("long")
    truth = quat_to_matrix(long.truth.known("quat_nb")[0])
    start = inertial_to_local(0.0, site.latitude)
    true = start.T @ truth
    settings = conditions("guo2015")
    duration = {span: settings["simulation"][span] for span in ("short", "long")}
    every = max(1, runs // settings["best_runs"])
    cases = {noise: _Case.of(number, noise) for noise in NOISES}
    out: dict[Any, list[Array]] = {}
    for k in range(first, last):
        rng = np.random.default_rng([seed, 2015, number, k])
        white = rng.standard_normal((len(long.record), 6))
        pairs = [instants(s, (k + 0.5) / runs, duration[of]) for s, of in SPANS.items()]
        for noise, case in cases.items():
            record = case.measured(long.record, white)
            for form, c in two_instants(record, site, pairs).items():
                for span, phi in zip(SPANS, _phi(c, true), strict=True):
                    out.setdefault((noise, span, form), []).append(phi)
            for span, length in duration.items() if k % every == 0 else ():
                # The other reading of the noise is asked of the first case alone.
                if noise == "per sample" and number > 0:
                    continue
                part = record.rows(0, round(length / case.step))
                fix = align(part, site, spec=case.spec(_SHARE), at="start")
                found = start.T @ quat_to_matrix(fix.quat_nb)
                out.setdefault((noise, span), []).append(_phi(found, true))
    return {key: np.array(value) for key, value in out.items()}


def _theory(where: dict[str, Any], number: int, span_sum: float = 0.0) -> Array:
    """Return equations 36 to 38 under printed or recovered conditions, arcmin."""
    site, case = Site(where["lat"]), _Case.of(number, "per sample")
    quat = euler_to_quat(np.array(where["euler_deg"]) * DEG)
    # The document's micro-g is a millionth of the local gravity.
    nabla = case.nabla * site.gravity / (1e6 * MICRO_G)
    return inertial_frame_error(site, quat, case.eps, nabla, span_sum) / ARCMIN


def _limit(number: int, noise: str, span: str) -> Array:
    """Return the limit of the spread about the biases' error in i0, arcmin."""
    case, (made, site) = _Case.of(number, noise), _still(span)
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
    """
    case = conditions("guo2015")
    table, runs = case["case"], options.runs or case["runs"]
    gate_runs = min(runs, case["gate_runs"])
    jobs: list[tuple[Any, ...]] = [
        (_block, number, a, min(a + _BLOCK, runs), runs, options.seed)
        for number in range(len(table))
        for a in range(0, runs, _BLOCK)
    ]
    jobs += [
        (_gate_block, a, min(a + _BLOCK, gate_runs), options.seed)
        for a in range(0, gate_runs, _BLOCK)
    ]
    done = list(each_run(_call, jobs, options))
    found: dict[int, dict[Any, Array]] = {}
    gate: list[dict[str, Array]] = []
    for job, part in zip(jobs, done, strict=True):
        if job[0] is _gate_block:
            gate.append(part)
            continue
        whole = found.setdefault(job[1], {})
        for key, value in part.items():
            whole[key] = value if key not in whole else np.concatenate([whole[key], value])
    rows = _table_rows(case, found)
    rows += _gate_rows(case, {k: np.concatenate([g[k] for g in gate]) for k in gate[0]})
    return experiment(case, "guo2015", options, runs, rows)


def _call(function: Any, *arguments: Any) -> Any:
    return function(*arguments)


def _table_rows(case: dict[str, Any], found: dict[int, dict[Any, Array]]) -> list[Row]:
    table = case["case"]
    rows = []
    for k, printed in enumerate(table):
        recovered, as_printed = (_theory(case[w], k) for w in ("recovered", "printed"))
        rows += [
            Row(f"case {k + 1}, theory phi_{AXES[i]}", "arcmin", printed["theory"][i], recovered[i],
                note=f"recovered conditions; the printed conditions give {as_printed[i]:.2f}")
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
        theory = np.mean([_theory(case["recovered"], k, s) for s in sums], axis=0)
        error = phi.std(axis=0, ddof=1) / np.sqrt(len(phi))
        rows += [
            Row(f"case {k + 1}, mean phi_{AXES[i]}", "arcmin", printed["mean"][i],
                phi[:, i].mean(), None if best is None else best[:, i].mean(),
                note=f"theory {theory[i]:.2f}: {(phi[:, i].mean() - theory[i]) / error[i]:+.1f} "
                "standard errors off")
            for i in range(3)
        ]  # fmt: skip
        bound = _limit(k, noise, kind)
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
        bound = _limit(0, noise, SPANS[span])
        far = ", ".join(f"{x:+.1f}" for x in off[reading])
        rows += [
            Row(f"case 1, std phi_{AXES[i]}: {noise}, {span}, {form}", "arcmin",
                table[0]["std"][i], spread[i], best[i], bound[i],
                f"printed spreads of all cases off by {far} standard errors (x, y, z)")
            for i in range(3)
        ]  # fmt: skip
    return rows


def _gate_block(first: int, last: int, seed: int) -> dict[str, Array]:
    """Return phi, arcmin, of runs of a disturbed vehicle by each filter, and what was rejected."""
    case = conditions("guo2015")
    settings = case["gate"]
    site, spec = Site(case["printed"]["lat"]), load_spec(settings["grade"])
    low = LowPass(settings["cutoff"])
    gates = {
        name: Gate(settings["width"], two_sided=two, gravity=site.gravity)
        for name, two in (("gate as printed", False), ("two-sided gate", True))
    }
    chains: dict[str, Prefilter] = {"low-pass alone": low}
    chains |= {name: low | gate for name, gate in gates.items()}
    out: dict[str, list[Any]] = {}
    for k in range(first, last):
        rng = np.random.default_rng([seed, 44, k])
        crew = Crew(**settings["crew"])
        motion = DisturbedVehicle.with_crew(
            rng, settings["duration"], crew, heading=rng.uniform(0, 360)
        )
        made = simulate(motion, site, settings["duration"], settings["rate"], spec, rng)
        true = made.truth.known("quat_nb")[-1]
        for name, chain in chains.items():
            method = Inertial(settings["estimator"], prefilter=chain)
            fix = align(made.record, site, method, spec)
            out.setdefault(name, []).append(misalignment(fix.quat_nb, true))
        fix = align(made.record, site, spec=spec)
        out.setdefault("default", []).append(misalignment(fix.quat_nb, true))
        out.setdefault("limit", []).append(fix.limit_arcmin)
        passed = low(made.record)
        for name, gate in gates.items():
            out.setdefault(f"rejected: {name}", []).append(np.mean(gate.rejected(passed)))
    return {key: np.array(value) for key, value in out.items()}


def _gate_rows(case: dict[str, Any], found: dict[str, Array]) -> list[Row]:
    settings = case["gate"]
    best, bound = found["default"].std(axis=0, ddof=1), np.sqrt(np.mean(found["limit"] ** 2, 0))
    rows = []
    for name, printed in (
        ("low-pass alone", settings["lowpass_std"]),
        ("gate as printed", settings["gated_std"]),
        ("two-sided gate", [None] * 3),
    ):
        spread = found[name].std(axis=0, ddof=1)
        share = found.get(f"rejected: {name}")
        note = "" if share is None else f"the gate rejects {100 * share.mean():.1f} % of samples"
        rows += [
            Row(f"disturbed vehicle, std {what}: {name}", "arcmin", printed[i], spread[i], best[i],
                bound[i], note)
            for i, what in enumerate(("tilt east", "tilt north", "azimuth"))
        ]  # fmt: skip
    return rows
