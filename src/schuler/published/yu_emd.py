"""Empirical mode decomposition before TRIAD and a Kalman filter on a vehicle (Yu and others)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment import Inertial, KalmanAlignment, Method, align
from schuler.alignment.compare import settle_time
from schuler.earth import Site
from schuler.motion import DisturbedVehicle
from schuler.prefilter import Emd
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    conditions,
    each_run,
    experiment,
    misalignment,
)
from schuler.sensors import load_spec
from schuler.simulation import simulate

__all__ = ["methods", "run"]

Array = NDArray[np.float64]

_BLOCK = 5


def methods(stop: float) -> dict[str, Method | None]:
    """Return the stages of the chain without and with each filter, and the default method.

    Parameters
    ----------
    stop : float
        The document's stop criterion.
    """
    filters = {
        "no prefilter": None,
        "EMD as printed": Emd(threshold=stop, first=False, channels="both", frame="body"),
        "EMD as printed, of the force": Emd(threshold=stop, first=False),
        "EMD improved": Emd(),
    }
    out: dict[str, Method | None] = {}
    for name, emd in filters.items():
        out[f"TRIAD: {name}"] = Inertial("integral-triad", prefilter=emd)
        out[f"Kalman: {name}"] = KalmanAlignment(10, "velocity", prefilter=emd)
    return {**out, "default": None}


def _block(first: int, last: int, seed: int) -> dict[str, Array]:
    """Return azimuth errors, arcmin, and settling times, s, of runs by every method."""
    case = conditions("yu_emd")
    settings = case["simulation"]
    site, spec = Site(settings["lat"]), load_spec(settings["grade"])
    duration = settings["duration"]
    out: dict[str, list[float]] = {}
    for k in range(first, last):
        rng = np.random.default_rng([seed, 3, k])
        motion = DisturbedVehicle.with_crew(rng, duration, heading=rng.uniform(0, 360))
        made = simulate(motion, site, duration, settings["rate"], spec, rng)
        true = made.truth.known("quat_nb")[-1]
        for name, method in methods(case["printed"]["stop"]).items():
            fix = align(made.record, site, method, spec)
            out.setdefault(name, []).append(float(misalignment(fix.quat_nb, true)[2]))
            if not name.startswith("TRIAD"):
                settled = settle_time(fix, 50)
                out.setdefault(f"settled {name}", []).append(
                    duration if settled is None else settled
                )
            if name == "default" and fix.limit_arcmin is not None:
                out.setdefault("limit", []).append(float(fix.limit_arcmin[2]))
    return {key: np.array(value) for key, value in out.items()}


def run(options: Options) -> Experiment:
    """Redo the alignments of a disturbed vehicle without and with the filter.

    Parameters
    ----------
    options : Options
    """
    case = conditions("yu_emd")
    printed, runs = case["printed"], options.runs or case["runs"]
    jobs: list[tuple[Any, ...]] = [
        (a, min(a + _BLOCK, runs), options.seed) for a in range(0, runs, _BLOCK)
    ]
    done = list(each_run(_block, jobs, options))
    found = {key: np.concatenate([part[key] for part in done]) for key in done[0]}

    def rms(name: str) -> float:
        return float(np.sqrt(np.mean(found[name] ** 2)))

    def settled(name: str) -> float:
        return float(np.median(found[f"settled {name}"]))

    best, bound = rms("default"), rms("limit")
    rows = []
    for stage in ("Kalman", "TRIAD"):
        for name, figure in (
            ("no prefilter", "before_arcmin"),
            ("EMD as printed", "after_arcmin"),
            ("EMD as printed, of the force", None),
            ("EMD improved", None),
        ):
            value = None if stage == "TRIAD" or figure is None else printed[figure]
            note = "the coarse stage alone" if stage == "TRIAD" else ""
            rows.append(
                Row(f"azimuth rms, {stage}, {name}", "arcmin", value, rms(f"{stage}: {name}"),
                    best, bound, note)
            )  # fmt: skip
    plain = found["Kalman: no prefilter"]
    difference = float(np.mean(np.abs(plain - found["Kalman: EMD as printed"])))
    rows.append(
        Row("mean |heading with filter - without|", "arcmin", printed["difference_arcmin"],
            difference, float(np.mean(np.abs(plain - found["default"]))),
            note="best: default method less Kalman without a filter")
    )  # fmt: skip
    for name, figure in (
        ("no prefilter", "settled_before_s"),
        ("EMD as printed", "settled_after_s"),
        ("EMD as printed, of the force", None),
        ("EMD improved", None),
    ):
        rows.append(
            Row(f"settled, {name}", "s", None if figure is None else printed[figure],
                settled(f"Kalman: {name}"), settled("default"), note="median of the runs")
        )  # fmt: skip
    return experiment(case, "yu_emd", runs, rows)
