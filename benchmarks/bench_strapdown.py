"""Strapdown navigation beside pyins: its compiled kernel and its public Integrator, in one run.

One job: an hour of a turning, climbing, rocking vehicle at 100 Hz, from increments to attitude,
velocity and position after every sample. Rounds are interleaved, and the least of each counts, so
that a busy machine slows all alike. All must be at the same place after ten minutes before any is
timed (pyins leaves out the second-order rotation of the velocity, worth some decimetres by then).
The compiled kernel of
pyins takes increments that are already corrected for coning and sculling; ours corrects them.

Then a campaign: eight hours at rest at 10 Hz, many times, with noise drawn on the way.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.earth import Site
from schuler.kernels import strapdown
from schuler.modulation import RotationCase, strapdown_end
from schuler.motion import Band, Manoeuvre, Route, Sum, Sway
from schuler.navigation import Navigator, Start, navigate
from schuler.simulation import simulate

RATE, DURATION, ROUNDS, RUNS = 100.0, 3600.0, 8, 40
CHECK = 60_000
"""The sample at which the programs are compared."""

SITE = Site(34.2, 108.9, 100.0)
CASE = Path(__file__).parents[1] / "examples" / "rotation" / "four_gyro.toml"


def moving() -> Any:
    """Return the simulated record and its truth."""
    turns = [Manoeuvre(75.0, turn=a, climb=c) for a, c in ((60, 2), (-60, -2)) * 24]
    sway = Sway.draw(
        np.random.default_rng(1), [Band("pitch", 1.0, 0.2, 0.6), Band("roll", 2.0, 0.2, 0.6)]
    )
    return simulate(Sum((Route(turns, heading=40.0, speed=60.0), sway)), SITE, DURATION, RATE)


def interleaved(jobs: list[Callable[[], object]], rounds: int) -> list[float]:
    """Return the least time of each job, s, from rounds in which each has its turn."""
    best = [np.inf] * len(jobs)
    for job in jobs:
        job()
    for _ in range(rounds):
        for k, job in enumerate(jobs):
            start = time.perf_counter()
            job()
            best[k] = min(best[k], time.perf_counter() - start)
    return best


def kernel_job(made: Any, begin: Start, every: int) -> Callable[[], object]:
    """Return our kernel on arrays, as `Navigator` calls it."""
    r = made.record
    options = Navigator(begin, gravity="somigliana1")._options
    out = np.empty((len(r) // every + 2, strapdown.ROW))
    none, zero = np.empty((0, 15)), np.zeros(5)
    start = begin.state().data

    def job() -> None:
        strapdown.navigate(
            start.copy(), 1, 1.0, 1.0, options, r.time, r.dt, r.dtheta, r.dvel, np.empty(0), every,
            out, none, zero, none,
        )  # fmt: skip

    return job


def pyins_jobs(made: Any) -> tuple[list[Callable[[], object]], Callable[[], Any]] | None:
    """Return pyins' kernel and Integrator as jobs, and its end; None where it is not installed."""
    try:
        import pandas as pd
        from pyins import strapdown as peer
        from pyins import transform
        from pyins._numba_integrate import integrate
    except ImportError:
        return None
    r, t = made.record, made.truth
    # Right, front, up to front, right, down.
    imu = pd.DataFrame(
        np.vstack([
            np.zeros((1, 6)),
            np.hstack([x[:, [1, 0, 2]] * [1, 1, -1] for x in (r.dtheta, r.dvel)]),
        ]),
        index=np.concatenate([[r.start], r.time]),
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )  # fmt: skip
    psi, theta, gamma = quat_to_euler(t.quat_nb[0])
    east, north, up = t.v_n[0]
    pva = pd.Series(
        [SITE.lat, SITE.lon, SITE.height, north, east, -up, gamma / DEG, theta / DEG,
         psi_to_heading(psi) / DEG],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=r.start,
    )  # fmt: skip
    increments = peer.compute_increments_from_imu(imu, "increment")
    dt = np.asarray(increments["dt"])
    theta_b = np.ascontiguousarray(increments[["theta_x", "theta_y", "theta_z"]])
    dv_b = np.ascontiguousarray(increments[["dv_x", "dv_y", "dv_z"]])
    n = len(dt)
    lla, velocity, mat = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    lla[0], velocity[0] = pva.iloc[:3], pva.iloc[3:6]
    mat[0] = transform.mat_from_rph(pva.iloc[6:].to_numpy(float))

    def kernel() -> None:
        integrate(dt, lla, velocity, mat, theta_b, dv_b, 0, True)

    def public() -> None:
        rows = peer.compute_increments_from_imu(imu, "increment")
        peer.Integrator(pva).integrate(rows)

    return [kernel, public], lambda: lla[CHECK]


def run() -> list[dict[str, Any]]:
    """Time the kernels and the campaign."""
    made = moving()
    t = made.truth
    begin = Start(SITE, t.quat_nb[0], t.v_n[0])
    n = len(made.record)

    def whole() -> Any:
        path = navigate(made.record, begin, gravity="somigliana1")
        return path.position, path.v_n, path.euler

    jobs = [kernel_job(made, begin, 1), kernel_job(made, begin, 100), whole,
            lambda: navigate(made.record, begin, every=100, spec="navigation-rlg")]  # fmt: skip
    peers = pyins_jobs(made)
    found = interleaved(jobs + (peers[0] if peers else []), ROUNDS)
    us = [1e6 * s / n for s in found]
    kernel, public = (us[4], us[5]) if peers else (None, None)
    if peers:
        lat, lon, height = peers[1]()
        path = navigate(made.record, begin, gravity="somigliana1")
        end = path.rows(slice(0, CHECK + 1)).final
        np.testing.assert_allclose(
            [end["lat_deg"], end["lon_deg"], end["height_m"] * 1e-5],
            [lat, lon, height * 1e-5], rtol=0, atol=2e-5,
        )  # fmt: skip

    def row(what: str, mine: float, peer: float | None) -> dict[str, Any]:
        ratio = None if peer is None else peer / mine
        return {"what": what, "ours": mine, "peer": peer, "ratio": ratio, "unit": "us/sample"}

    rows = [
        row("strapdown kernel, a row a sample (peer: pyins' compiled kernel)", us[0], kernel),
        row("the same beside pyins' public Integrator", us[0], public),
        row("strapdown kernel, a row a second (peer: pyins' compiled kernel)", us[1], kernel),
        row("navigate(), with latitude and angles of every row (peer: Integrator)", us[2], public),
        row("navigate(), a row a second, with the error covariance", us[3], None),
    ]
    case = replace(RotationCase.from_toml(CASE), heading=200.0)
    rng = np.random.default_rng(1)
    strapdown_end(case, case.single, runs=2, walks=(1e-7, 1e-6), rng=rng)
    start = time.perf_counter()
    strapdown_end(case, case.single, runs=RUNS, walks=(1e-7, 1e-6), rng=rng)
    spent = time.perf_counter() - start
    rows.append({
        "what": f"1,000 runs of 8 h at 10 Hz with noise (from {RUNS} on all cores)",
        "ours": spent * 1000.0 / RUNS, "peer": None, "ratio": None, "unit": "s",
    })  # fmt: skip
    return rows


if __name__ == "__main__":
    for line in run():
        print(line)
