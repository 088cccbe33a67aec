"""Judging a scheme of a centrifuge test, and filtering the test: closed form, direct sum, filters.

The direct sum is the compiled one of 5 ms, with the inverse of the information in both. The filter
runs over 600 s at 5 ms with a measurement every 20 ms; its NumPy peer, dense matrices of 48 states,
does so once. The sides agree before any is timed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.centrifuge import PUBLISHED_POSITIONS, Ekf, Plant, fit_platform, published_truth
from schuler.centrifuge.filter import prior_sigma
from schuler.centrifuge.information import Tables, direct_information
from schuler.centrifuge.simulate import simulate_platform
from schuler.kernels.centrifuge import FIRST, SECOND, SIGN, TERM
from schuler.kernels.gimbals import platform_matrix
from schuler.kernels.scheme import scheme_values

POSITIONS = np.array(PUBLISHED_POSITIONS, dtype=np.float64)
DWELL = 100.0


def best(function: Callable[[], object], repeats: int) -> float:
    """Return the shortest of several runs, ms, after one that is not counted."""
    function()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times) * 1e3


def sum_rho(information: np.ndarray) -> float:
    """Return the sum of |rho|."""
    cov = np.linalg.inv(information)
    sigma = np.sqrt(np.diag(cov))
    return float(np.abs(cov / np.outer(sigma, sigma))[np.triu_indices(len(cov), 1)].sum())


def numpy_filter(plant: Plant, outputs: np.ndarray) -> tuple[Any, Any]:
    """Filter with dense 48 x 48 matrices; return coefficients and covariance."""
    x = np.zeros(plant.unknowns)
    p = np.diag(prior_sigma(plant) ** 2)
    for angles, z in zip(np.deg2rad(POSITIONS), outputs, strict=True):
        x, p = numpy_position(plant, angles, z, x, p)
    return x, p


def numpy_position(
    plant: Plant, angles: np.ndarray, outputs: np.ndarray, x: np.ndarray, known: np.ndarray
) -> tuple[Any, Any]:
    """Filter one position."""
    terms, n, h, every = plant.terms, plant.unknowns, 0.005, 4
    c = np.array(platform_matrix(*angles, plant.order_number)).reshape(3, 3)
    p = np.zeros((n + 3, n + 3))
    p[:n, :n] = known
    p[n:, n:] = plant.attitude_prior**2 * np.eye(3)
    swing, earth = plant.harmonics(), plant.earth
    r = (1e-6 * plant.noise) ** 2 * np.eye(3)

    def force(t: float) -> np.ndarray:
        a = plant.omega * t
        return np.asarray(swing[0] + np.cos(a) * swing[1] + np.sin(a) * swing[2])

    def drift(f: np.ndarray) -> np.ndarray:
        one = np.r_[1.0, f]
        mono = np.r_[1.0, one[FIRST] * one[SECOND]]
        b = np.zeros((3, n))
        for j in range(3):
            b[j, 3 * np.arange(terms) + j] = SIGN[j, :terms] * mono[TERM[j, :terms]]
        return b

    at = 3 * terms
    for k in range(len(outputs)):
        for e in range(every):
            t = (k * every + e) * h
            b = drift(c @ force(t))
            rate = b @ x + c @ earth
            phi = np.eye(n + 3)
            phi[n:, :n] = h * b
            w = h * rate
            cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            c = c + cross @ c + 0.5 * cross @ cross @ c
            p = phi @ p @ phi.T
        f = c @ force((k + 1) * every * h)
        hm = np.zeros((3, n + 3))
        y = np.zeros(3)
        lift = np.array([[0, f[2], -f[1]], [-f[2], 0, f[0]], [f[1], -f[0], 0]])
        th = x[at + 15 :]
        own = f + np.array([0.0, th[0] * f[0], th[1] * f[0] + th[2] * f[1]])
        other = np.array([f[1], -f[2], f[1]])
        k0, k1, k2, k3, kp = x[at : at + 15].reshape(5, 3)
        for i in range(3):
            a = own[i]
            slope = 1 + k1[i] + a * (2 * k2[i] + 3 * a * k3[i]) + kp[i] * other[i]
            y[i] = k0[i] + a * (1 + k1[i] + a * (k2[i] + a * k3[i]) + kp[i] * other[i])
            hm[i, at + 3 * np.arange(5) + i] = 1.0, a, a * a, a**3, a * other[i]
            hm[i, n:] = slope * lift[i]
        hm[1, at + 15], hm[2, at + 16], hm[2, at + 17] = f[0], f[0], f[1]
        s = hm @ p @ hm.T + r
        gain = np.linalg.solve(s, hm @ p).T
        move = gain @ (outputs[k] - y)
        x = x + move[:n]
        u = move[n:]
        turn = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        c = c + turn @ c
        p = p - gain @ hm @ p
        p = 0.5 * (p + p.T)
    return x, p[:n, :n]


def run() -> list[dict[str, Any]]:
    """Measure."""
    plant = Plant()
    tables = Tables(plant, DWELL)
    nodes, blend, root, omega = tables.arrays
    scheme = np.deg2rad(POSITIONS)[None].copy()
    out = np.empty(1)
    wanted = 0.01 * published_truth()

    def closed() -> float:
        scheme_values(
            scheme, plant.order_number, nodes, blend, root, omega, 9, tables.prior, wanted, 0, out
        )
        return float(out[0])

    def direct() -> float:
        return sum_rho(direct_information(plant, POSITIONS, DWELL))

    rng = np.random.default_rng(0)
    outputs = simulate_platform(plant, POSITIONS, DWELL, published_truth(), rng)[0]
    one = Ekf(passes=1)

    def covariance_pass() -> object:
        return fit_platform(plant, POSITIONS, outputs, one)

    np.testing.assert_allclose(closed(), direct(), rtol=1e-4)
    np.testing.assert_allclose(
        covariance_pass().sigma, np.sqrt(np.diag(np.linalg.inv(
            direct_information(plant, POSITIONS, DWELL)))), rtol=0.03,
    )  # fmt: skip
    begin = time.perf_counter()
    _, cov = numpy_filter(plant, outputs)
    numpy_600 = (time.perf_counter() - begin) * 1e3
    np.testing.assert_allclose(np.sqrt(np.diag(cov)), covariance_pass().sigma, rtol=0.03)

    # Interleaved: what disturbs one side disturbs all.
    laps = [(best(closed, 300), best(direct, 3), best(covariance_pass, 2)) for _ in range(3)]
    fast, long_way, filtered = (min(column) for column in zip(*laps, strict=True))
    rows = [
        ("judge a scheme of 600 s (peer: direct sum, 5 ms)", fast, long_way),
        ("judge a scheme of 600 s (peer: our filter's pass of 48 states)", fast, filtered),
        ("judge a scheme of 600 s (peer: the same pass in NumPy)", fast, numpy_600),
        ("filter 600 s at 5 ms (peer: NumPy)", filtered, numpy_600),
    ]
    return [
        {"what": what, "ours": mine, "peer": other, "ratio": other / mine, "unit": "ms"}
        for what, mine, other in rows
    ]


if __name__ == "__main__":
    for row in run():
        print(row)
