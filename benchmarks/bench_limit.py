"""Heading error of each method over the Cramér-Rao limit of a base at rest, by simulation.

`ours` is the rms error over seeded runs, `peer` the limit, both in arcmin; with a hundred runs the
ratio's standard error is 7 %. Base at rest: white noise alone. Truck: with its crew, biases drawn
from the specification.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

RUNS = 100
METHODS = ("auto", "optimal", "kalman", "kalman-velocity", "kalman-large", "centred", "wahba")
CASES = {"at rest": (300.0,), "truck with crew": (100.0, 300.0)}


def errors(case: str, duration: float, seed: int) -> list[tuple[float, float]]:
    """Simulate a run; return error and limit of each method, arcmin."""
    from dataclasses import replace

    import schuler as sc
    from schuler.motion import DisturbedVehicle, Static
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    rng = np.random.default_rng([seed, round(duration)])
    site, spec = sc.Site(lat=40.0), GRADES["navigation-fog"]
    heading = rng.uniform(0.0, 360.0)
    if case == "at rest":
        motion: Any = Static(heading)
        spec = replace(
            spec, gyro=replace(spec.gyro, bias=1e-12),
            accelerometer=replace(spec.accelerometer, bias=1e-12),
        )  # fmt: skip
    else:
        motion = DisturbedVehicle.with_crew(rng, duration, heading=heading)
    made = simulate(motion, site, duration, 50.0, spec, rng)
    found = []
    for method in METHODS:
        fix = sc.align(made.record, site, method, spec)
        off = (fix.heading_deg - made.heading_deg() + 180.0) % 360.0 - 180.0
        assert fix.limit_arcmin is not None
        found.append((60.0 * off, float(fix.limit_arcmin[2])))
    return found


def run() -> list[dict[str, Any]]:
    """Return the rows."""
    # By its importable name: the workers look the function up.
    from bench_limit import errors

    rows = []
    with ProcessPoolExecutor(2) as pool:
        for case, durations in CASES.items():
            for duration in durations:
                each = pool.map(errors, [case] * RUNS, [duration] * RUNS, range(RUNS), chunksize=10)
                table = np.array(list(each))
                for k, method in enumerate(METHODS):
                    rms = float(np.sqrt(np.mean(table[:, k, 0] ** 2)))
                    limit = float(np.sqrt(np.mean(table[:, k, 1] ** 2)))
                    rows.append({
                        "what": f"{method}, {case}, {duration:g} s: error against the limit",
                        "ours": rms, "peer": limit, "ratio": limit / rms, "unit": "arcmin",
                    })  # fmt: skip
    return rows
