"""Kalman filtering: a step of fifteen states, ten million of them, and a whole fine alignment.

The NumPy peer does the same step with dense matrices, as most scripts do; pyins' own feedback
filter is timed over a static record, a step of it being one row of its measurements.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.alignment import Fine, align
from schuler.earth import Site
from schuler.kernels import kalman
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulation import simulate

N, M = 15, 3
LONG = 10_000_000


def system() -> tuple[np.ndarray, ...]:
    """Return transition, noise, rows and variances like those of an alignment."""
    rng = np.random.default_rng(1)
    phi = np.eye(N)
    phi[0:3, 6:9] = phi[3:6, 9:12] = 0.01 * rng.normal(size=(3, 3))
    phi[3:6, 0:3] = 0.098 * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    phi[12:15, 3:6] = 0.01 * np.eye(3)
    h = np.zeros((M, N))
    h[:, 12:15] = np.eye(3)
    return phi, 1e-10 * np.ones(N), h, 1e-4 * np.ones(M)


def best(job: Callable[[], None], repeats: int = 5) -> float:
    """Return the shortest time of a job, s."""
    spans = []
    for _ in range(repeats):
        begin = time.perf_counter()
        job()
        spans.append(time.perf_counter() - begin)
    return min(spans)


def pyins_step() -> float | None:
    """Return seconds a step of pyins' feedback filter over a static minute, or None without it."""
    try:
        import pandas as pd
        from pyins import filters, inertial_sensor, measurements, sim, strapdown, transform, util
    except ImportError:
        return None
    t, dt = 60.0, 0.1
    count = int(t / dt)
    lla = np.tile([40.0, 116.0, 50.0], (count, 1))
    rph = np.tile([0.0, 0.0, 30.0], (count, 1))
    trajectory, imu = sim.generate_imu(np.arange(count) * dt, lla, rph)
    increments = strapdown.compute_increments_from_imu(imu, "rate")
    pva = trajectory.iloc[0]
    model = inertial_sensor.EstimationModel(bias_sd=1e-6, noise=1e-6)
    velocity = measurements.NedVelocity(
        pd.DataFrame(0.0, index=trajectory.index[1:], columns=["VN", "VE", "VD"]), 0.1
    )
    del util, transform
    begin = time.perf_counter()
    filters.run_feedback_filter(
        pva, 1.0, 0.1, 0.1, 1.0, increments, gyro_model=model, accel_model=model,
        measurements=[velocity],
    )  # fmt: skip
    return (time.perf_counter() - begin) / (count - 1)


def run() -> list[dict[str, Any]]:
    """Measure."""
    phi, q, h, r = system()
    p, x = 1e-4 * np.eye(N), np.zeros(N)
    z, room = np.zeros(M), (np.zeros((N, N)), *np.zeros((3, N)))
    steps = 20_000

    import numba

    @numba.njit
    def loop(count, p, x, phi, q, z, h, r, work, ph, k, spare):  # type: ignore[no-untyped-def]
        for _ in range(count):
            kalman.step(p, x, phi, q, z, h, r, work, ph, k, spare, N)

    loop(10, p, x, phi, q, z, h, r, *room)
    ours = best(lambda: loop(steps, p, x, phi, q, z, h, r, *room)) / steps

    def plain() -> None:
        x, p = np.zeros(N), 1e-4 * np.eye(N)
        for _ in range(500):
            x = phi @ x
            p = phi @ p @ phi.T + np.diag(q)
            for j in range(M):
                s = h[j] @ p @ h[j] + r[j]
                k = p @ h[j] / s
                x = x + k * (z[j] - h[j] @ x)
                left = np.eye(N) - np.outer(k, h[j])
                p = left @ p @ left.T + r[j] * np.outer(k, k)

    numpy = best(plain) / 500
    peer = pyins_step()
    loop(LONG, p, x, phi, q, z, h, r, *room)
    least = float(np.linalg.eigvalsh(p)[0])
    rng = np.random.default_rng(2)
    made = simulate(DisturbedVehicle.with_crew(rng, 300.0), Site(40.0), 300.0, 100.0,
                    GRADES["navigation-fog"], rng)  # fmt: skip
    align(made.record, Site(40.0), Fine(), "navigation-fog")
    whole = best(lambda: _drop(align(made.record, Site(40.0), Fine(), "navigation-fog")))

    def row(what: str, value: float, unit: str, other: float | None = None) -> dict[str, Any]:
        ratio = None if other is None else other / value
        return {"what": what, "ours": value, "peer": other, "ratio": ratio, "unit": unit}

    name = "predict and three scalar updates, 15 states"
    return [
        row(f"{name}, beside NumPy", 1e6 * ours, "us", 1e6 * numpy),
        row(f"{name}, beside pyins.filters.run_feedback_filter", 1e6 * ours, "us",
            None if peer is None else 1e6 * peer),
        row(f"least eigenvalue after {LONG // 1_000_000} million steps, covariance symmetric: "
            f"{bool(np.array_equal(p, p.T))}", least, "-"),
        row("fine alignment, 300 s at 100 Hz, the whole call", whole, "s"),
    ]  # fmt: skip


def _drop(_: object) -> None:
    """Take a result and leave nothing."""


if __name__ == "__main__":
    for line in run():
        print(line)
