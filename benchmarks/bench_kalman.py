"""Kalman filtering: a step of fifteen states, ten million of them, and a whole fine alignment.

The NumPy peer does the same step with dense matrices, as most scripts do; pyins' own feedback
filter is timed over a static record, a step of it being one row of its measurements.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.alignment import KalmanAlignment, align
from schuler.earth import Site
from schuler.kernels import covariance_steps
from schuler.kernels.ins_layout import padded
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulation import simulate

N, M = 15, 3
LONG = 10_000_000


def system() -> tuple[np.ndarray, ...]:
    """Return transition, noise, rows and variances like those of an aided navigation."""
    rng = np.random.default_rng(1)
    phi = np.eye(N)
    phi[0:3, 9:12] = phi[3:6, 12:15] = 0.01 * rng.normal(size=(3, 3))
    phi[3:6, 0:3] = 0.098 * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    phi[6:9, 3:6] = 0.01 * np.eye(3)
    h = np.zeros((M, N))
    h[:, 6:9] = np.eye(3)
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
    p = 1e-4 * np.eye(N)
    steps, size = 20_000, padded(N)
    # The kernels' arrays: rows padded, the transition's dynamic rows alone.
    wide_p, wide_h = np.zeros((size, size)), np.zeros((M, size))
    wide_p[:N, :N], wide_h[:, :N] = p, h
    wide_phi, wide_q, decay = np.zeros((9, size)), np.zeros(size), np.ones(size)
    wide_phi[:, :N], wide_q[:N] = phi[:9], q
    columns = np.zeros((3, size + 1), np.int64)
    covariance_steps.find_columns(wide_phi, columns, 9)
    wide = covariance_steps.WIDTH
    scratch = np.zeros((9, size)), np.zeros((size, wide)), np.zeros((9, wide))
    lines = np.zeros((5, size))

    import numba

    @numba.njit
    def loop(count, p, phi, columns, decay, q, h, r, work, flipped, block, lines):  # type: ignore[no-untyped-def]
        x, ph, gain, spare, line = lines[0], lines[1], lines[2], lines[3], lines[4]
        for _ in range(count):
            covariance_steps.move_state(x, phi, decay, line, 9)
            covariance_steps.predict(p, phi, columns, decay, q, work, flipped, block, 9)
            for m in range(h.shape[0]):
                variance = r[m] + covariance_steps.sparse_product(p, h[m], ph)
                innovation = 0.0
                for i in range(x.shape[0]):
                    innovation -= h[m, i] * x[i]
                for i in range(x.shape[0]):
                    gain[i] = ph[i] / variance
                    x[i] += gain[i] * innovation
                covariance_steps.apply_gain(p, h[m], ph, gain, r[m], spare)

    arguments = (wide_p, wide_phi, columns, decay, wide_q, wide_h, r, *scratch, lines)
    loop(10, *arguments)
    ours = best(lambda: loop(steps, *arguments)) / steps
    z = np.zeros(M)

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
    loop(LONG, *arguments)
    p = wide_p[:N, :N]
    least = float(np.linalg.eigvalsh(p)[0])
    rng = np.random.default_rng(2)
    made = simulate(DisturbedVehicle.with_crew(rng, 300.0), Site(40.0), 300.0, 100.0,
                    GRADES["navigation-fog"], rng)  # fmt: skip
    align(made.record, Site(40.0), KalmanAlignment(), "navigation-fog")
    whole = best(lambda: _drop(align(made.record, Site(40.0), KalmanAlignment(), "navigation-fog")))

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
