"""Kalman filtering: a step of fifteen states, ten million of them, and a whole fine alignment.

A step is a prediction with a full transition of the dynamic states and three scalar updates in
Joseph's form. Beside ours, which knows which entries of the transition are zero: the same with
dense matrices as anybody would write it for Numba; a NumPy filter that allocates nothing in its
loop (three quarters of what it takes are calls); and filterpy's `KalmanFilter` by its public
methods. The first two are written here, and so are no rivals but marks on the scale. pyins' filter
is timed as a whole in `bench_aided`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from _timing import row, side_by_side
from schuler.alignment import KalmanAlignment, align
from schuler.earth import Site
from schuler.kernels import covariance_steps
from schuler.kernels.ins_layout import padded
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulation import simulate

N, M = 15, 3
LONG = 10_000_000
STEPS, FEW = 20_000, 1_000


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


def our_step() -> tuple[Callable[[int], None], np.ndarray]:
    """Return our steps as a job of so many, and the covariance that they work on."""
    import numba

    move_state, predict, sparse_product, apply_gain = (
        getattr(covariance_steps, name).dispatcher
        for name in ("move_state", "predict", "sparse_product", "apply_gain")
    )
    phi, q, h, r = system()
    size = padded(N)
    # The kernels' arrays: rows padded, the transition's dynamic rows alone.
    wide_p, wide_h = np.zeros((size, size)), np.zeros((M, size))
    wide_p[:N, :N], wide_h[:, :N] = 1e-4 * np.eye(N), h
    wide_phi, wide_q, decay = np.zeros((9, size)), np.zeros(size), np.ones(size)
    wide_phi[:, :N], wide_q[:N] = phi[:9], q
    columns = np.zeros((3, size + 1), np.int64)
    covariance_steps.find_columns(wide_phi, columns, 9)
    wide = covariance_steps.WIDTH
    scratch = np.zeros((9, size)), np.zeros((size, wide)), np.zeros((9, wide))
    lines = np.zeros((5, size))

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def loop(count, p, phi, columns, decay, q, h, r, work, flipped, block, lines):  # type: ignore[no-untyped-def]
        x, ph, gain, spare, line = lines[0], lines[1], lines[2], lines[3], lines[4]
        for _ in range(count):
            move_state(x, phi, columns, decay, line, 9)
            predict(p, phi, columns, decay, q, work, flipped, block, 9)
            for m in range(h.shape[0]):
                variance = r[m] + sparse_product(p, h[m], ph)
                innovation = 0.0
                for i in range(x.shape[0]):
                    innovation -= h[m, i] * x[i]
                for i in range(x.shape[0]):
                    gain[i] = ph[i] / variance
                    x[i] += gain[i] * innovation
                apply_gain(p, h[m], ph, gain, r[m], spare)

    arguments = (wide_p, wide_phi, columns, decay, wide_q, wide_h, r, *scratch, lines)
    return lambda count: loop(count, *arguments), wide_p


def plain_numba() -> Callable[[int], None]:
    """Return the same with dense matrices, as anybody would write it for Numba."""
    import numba

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def loop(count, x, p, phi, q, h, r, first, ph, gain):  # type: ignore[no-untyped-def]
        n = x.shape[0]
        for _ in range(count):
            for i in range(n):
                total = 0.0
                for k in range(n):
                    total += phi[i, k] * x[k]
                gain[i] = total
            x[:] = gain
            for i in range(n):
                first[i] = 0.0
                for k in range(n):
                    for j in range(n):
                        first[i, j] += phi[i, k] * p[k, j]
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for k in range(n):
                        total += first[i, k] * phi[j, k]
                    p[i, j] = total
                p[i, i] += q[i]
            for m in range(h.shape[0]):
                variance, innovation = r[m], 0.0
                for i in range(n):
                    total = 0.0
                    for k in range(n):
                        total += p[i, k] * h[m, k]
                    ph[i] = total
                for i in range(n):
                    variance += h[m, i] * ph[i]
                    innovation -= h[m, i] * x[i]
                for i in range(n):
                    gain[i] = ph[i] / variance
                    x[i] += gain[i] * innovation
                # Joseph's form of a scalar update, written out.
                for i in range(n):
                    for j in range(n):
                        p[i, j] += gain[i] * variance * gain[j] - gain[i] * ph[j] - ph[i] * gain[j]

    phi, q, h, r = system()
    arguments = (np.zeros(N), 1e-4 * np.eye(N), phi, q, h, r, np.zeros((N, N)), np.zeros(N),
                 np.zeros(N))  # fmt: skip
    return lambda count: loop(count, *arguments)


def tight_numpy() -> Callable[[int], None]:
    """Return the same in NumPy, without an array made in the loop."""
    phi, q, h, r = system()
    x, p = np.zeros(N), 1e-4 * np.eye(N)
    first, outer, ph, moved = np.zeros((N, N)), np.zeros((N, N)), np.zeros(N), np.zeros(N)
    diagonal = p.ravel()[:: N + 1]

    def job(count: int) -> None:
        nonlocal x, moved
        for _ in range(count):
            np.matmul(phi, x, out=moved)
            x, moved = moved, x
            np.matmul(phi, p, out=first)
            np.matmul(first, phi.T, out=p)
            np.add(diagonal, q, out=diagonal)
            for m in range(M):
                np.matmul(p, h[m], out=ph)
                variance = float(h[m] @ ph) + r[m]
                x += ph * (-float(h[m] @ x) / variance)
                np.multiply(ph[:, None], ph / variance, out=outer)
                np.subtract(p, outer, out=p)

    return job


def filterpy_step() -> Callable[[int], None] | None:
    """Return the same by filterpy's public methods; None where it is not installed."""
    try:
        from filterpy.kalman import KalmanFilter
    except ImportError:
        return None
    phi, q, h, r = system()
    kf = KalmanFilter(dim_x=N, dim_z=1)
    kf.F, kf.Q, kf.P = phi, np.diag(q), 1e-4 * np.eye(N)
    rows = [(np.array([[v]]), h[m : m + 1]) for m, v in enumerate(r)]
    zero = np.zeros((1, 1))

    def job(count: int) -> None:
        for _ in range(count):
            kf.predict()
            for noise, row_ in rows:
                kf.update(zero, R=noise, H=row_)

    return job


def run() -> list[dict[str, Any]]:
    """Measure."""
    ours, covariance = our_step()
    counts: dict[str, int] = {"ours": STEPS, "Numba": STEPS, "NumPy": FEW, "filterpy": FEW}
    steps: dict[str, Callable[[int], None] | None] = {
        "ours": ours, "Numba": plain_numba(), "NumPy": tight_numpy(), "filterpy": filterpy_step(),
    }  # fmt: skip
    jobs: dict[str, Callable[[], object]] = {
        name: (lambda step=step, n=counts[name]: step(n))
        for name, step in steps.items()
        if step is not None
    }
    # Each time is made one of so many steps as ours.
    found = side_by_side(jobs, rounds=9)

    def per_step(name: str) -> Any:
        each = found[name]
        return type(each)(
            tuple(v / counts[name] for v in each.cpu), tuple(v / counts[name] for v in each.wall)
        )

    name = "predict and three scalar updates, 15 states"
    words = {
        "Numba": "beside plain dense Numba (ours, a mark)",
        "NumPy": "beside NumPy that allocates nothing (ours, a mark)",
        "filterpy": "beside filterpy.kalman.KalmanFilter",
    }
    rows = [
        row(f"{name}, {words[peer]}", per_step("ours"), per_step(peer), 1e6, "us")
        for peer in words
        if peer in found
    ]
    ours(LONG)
    p = covariance[:N, :N]
    rows.append({
        "what": f"least eigenvalue after {LONG // 1_000_000} million steps, covariance symmetric: "
        f"{bool(np.array_equal(p, p.T))}",
        "ours": float(np.linalg.eigvalsh(p)[0]), "peer": None, "ratio": None, "unit": "-",
    })  # fmt: skip
    rng = np.random.default_rng(2)
    made = simulate(DisturbedVehicle.with_crew(rng, 300.0), Site(40.0), 300.0, 100.0,
                    GRADES["navigation-fog"], rng)  # fmt: skip
    whole = side_by_side(
        {"ours": lambda: align(made.record, Site(40.0), KalmanAlignment(), "navigation-fog")}, 5
    )
    rows.append(row("fine alignment, 300 s at 100 Hz, the whole call", whole["ours"]))
    return rows


if __name__ == "__main__":
    for line in run():
        print(line)
