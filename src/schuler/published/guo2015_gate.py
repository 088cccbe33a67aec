"""The gate's experiment of Guo and others (2015): what a gate gains behind a low-pass.

The low-pass starts from what gravity alone would have made before the record. Started from the mean
of its first second instead, it holds the vehicle's motion for its own memory of twenty seconds, and
a gate then repairs that.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import Inertial, align
from schuler.earth import Site
from schuler.motion import DisturbedVehicle
from schuler.motion.vehicle import Crew
from schuler.prefilter import Chain, Gate, LowPass, Prefilter
from schuler.published.result import Row, conditions, misalignment, std_error
from schuler.sensors import load_spec
from schuler.simulation import simulate
from schuler.units import percent

__all__ = ["gate_block", "gate_chains", "gate_rows"]

Array = NDArray[np.float64]
Changes = tuple[tuple[str, Any], ...]

_RIGHT, _WRONG = "low-pass", "low-pass started from the mean of 1 s"
_GATED = {"": None, ", gate as printed": False, ", two-sided gate": True}
"""Ends of the names of rows, and whether the gate is two-sided."""


def gate_chains(case: dict[str, Any], gravity: float) -> dict[str, Prefilter | None]:
    """Return no filter, and the low-pass by its start, alone and with each gate after it."""
    rules = case["gate"]
    out: dict[str, Prefilter | None] = {"no filter": None}
    for name, low in (
        (_RIGHT, LowPass(rules["cutoff"])),
        (_WRONG, LowPass(rules["cutoff"], start_span=1.0)),
    ):
        for end, two_sided in _GATED.items():
            gate = None if two_sided is None else Gate(
                rules["width"], two_sided=two_sided, gravity=gravity
            )  # fmt: skip
            out[name + end] = low if gate is None else low | gate
    return out


def gate_block(first: int, last: int, seed: int, changes: Changes) -> dict[str, Array]:
    """Return phi, arcmin, of runs of a disturbed vehicle by each filter, and what was rejected."""
    case = conditions("guo2015", changes)
    settings = case["gate"]
    site, spec = Site(settings["lat"]), load_spec(settings["grade"])
    chains = gate_chains(case, site.gravity)
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
            if isinstance(chain, Chain):
                low, gate = chain.filters
                assert isinstance(gate, Gate)
                share = np.mean(gate.rejected(low(made.record)))
                out.setdefault(f"rejected: {name}", []).append(share)
        fix = align(made.record, site, spec=spec)
        out.setdefault("default", []).append(misalignment(fix.quat_nb, true))
        out.setdefault("limit", []).append(fix.limit_arcmin)
    return {key: np.array(value) for key, value in out.items()}


def gate_rows(case: dict[str, Any], found: dict[str, Array]) -> list[Row]:
    """Return the rows of the gate's experiment: spreads by filter, and what the gates reject."""
    best, bound = found["default"].std(axis=0, ddof=1), np.sqrt(np.mean(found["limit"] ** 2, 0))
    rows = []
    for name in gate_chains(case, 9.8):
        printed = {
            _RIGHT: case["printed"]["lowpass_std"],
            f"{_RIGHT}, gate as printed": case["printed"]["gated_std"],
        }.get(name, [None] * 3)
        spread = found[name].std(axis=0, ddof=1)
        share = found.get(f"rejected: {name}")
        gate = "" if share is None else f"; the gate rejects {percent(share.mean())} of samples"
        error = std_error(found[name])
        rows += [
            Row(f"disturbed vehicle, std {what}: {name}", "arcmin", printed[i], spread[i], best[i],
                bound[i], f"standard error {error[i]:.2g}{gate}")
            for i, what in enumerate(("tilt east", "tilt north", "azimuth"))
        ]  # fmt: skip
    return rows
