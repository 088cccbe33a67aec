"""The Kalman kernels against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels import kalman


def system(rng, n=15, m=3):
    """Return a stable random system with three measurements."""
    phi = np.eye(n)
    phi[:6, :] += 0.02 * rng.normal(size=(6, n)) * (rng.random((6, n)) < 0.4)
    q = 1e-4 * rng.random(n)
    h = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.4)
    return phi, q, h, 0.1 + rng.random(m)


def dense(p, x, phi, q, z, h, r):
    """Return one step by the textbook."""
    x, p = phi @ x, phi @ p @ phi.T + np.diag(q)
    s = h @ p @ h.T + np.diag(r)
    k = p @ h.T @ np.linalg.inv(s)
    return x + k @ (z - h @ x), (np.eye(len(x)) - k @ h) @ p


def test_a_step_is_the_textbook_s():
    rng = np.random.default_rng(1)
    n = 15
    phi, q, h, r = system(rng)
    p, x = np.eye(n), rng.normal(size=n)
    want_x, want_p = x.copy(), p.copy()
    room = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    for _ in range(50):
        z = rng.normal(size=3)
        kalman.step(p, x, phi, q, z, h, r, *room, n)
        want_x, want_p = dense(want_p, want_x, phi, q, z, h, r)
        np.testing.assert_allclose(x, want_x, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(p, want_p, rtol=1e-8, atol=1e-11)


def test_joseph_s_form_holds_for_any_gain():
    rng = np.random.default_rng(2)
    n = 6
    a = rng.normal(size=(n, n))
    p, h, k, r = a @ a.T, rng.normal(size=n), rng.normal(size=n), 0.3
    left = np.eye(n) - np.outer(k, h)
    want = left @ p @ left.T + r * np.outer(k, k)
    ph, spare = np.zeros(n), np.zeros(n)
    kalman.gain_of(p, h, r, ph, spare, n)
    kalman.joseph(p, h, ph, k, r, spare, n)
    np.testing.assert_allclose(p, want, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_the_covariance_stays_symmetric_and_positive():
    """A stiff system: measurements a million times better than the start, 200,000 steps."""
    rng = np.random.default_rng(3)
    n = 15
    phi, q, h, r = system(rng)
    phi[:6] = np.eye(n)[:6] + 0.01 * (phi[:6] - np.eye(n)[:6])
    p, x = 1e3 * np.eye(n), np.zeros(n)
    room = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(200_000):
        kalman.step(p, x, phi, 1e-12 * q, np.zeros(3), h, 1e-6 * r, *room, n)
        if k % 20_000 == 0:
            assert np.linalg.eigvalsh(p)[0] > -1e-11 * np.linalg.eigvalsh(p)[-1]
    np.testing.assert_array_equal(p, p.T)
    assert np.all(np.diag(p) > 0)


def test_the_smoother_is_the_joint_gaussian():
    """On a short record the smoothed states are the marginals of one dense Gaussian."""
    rng = np.random.default_rng(4)
    n, steps = 4, 12
    phi = np.eye(n) + 0.2 * rng.normal(size=(n, n))
    q, r, h = 0.1 + rng.random(n), np.array([0.5]), rng.normal(size=(1, n))
    z = rng.normal(size=steps)
    keep = np.zeros((steps, 2 * n + 3 * n * n))
    x, p = np.zeros(n), np.eye(n)
    # The oracle: all states stacked, their prior and their measurements.
    big = np.zeros((steps * n, steps * n))
    mean_p = np.eye(n)
    blocks = []
    for k in range(steps):
        mean_p = phi @ mean_p @ phi.T + np.diag(q)
        blocks.append(mean_p)
        big[k * n : (k + 1) * n, k * n : (k + 1) * n] = mean_p
        for j in range(k):
            cross = np.linalg.matrix_power(phi, k - j) @ blocks[j]
            big[k * n : (k + 1) * n, j * n : (j + 1) * n] = cross
            big[j * n : (j + 1) * n, k * n : (k + 1) * n] = cross.T
    rows = np.kron(np.eye(steps), h)
    gain = big @ rows.T @ np.linalg.inv(rows @ big @ rows.T + r[0] * np.eye(steps))
    want_x, want_p = gain @ z, big - gain @ rows @ big
    for k in range(steps):
        x, p = phi @ x, phi @ p @ phi.T + np.diag(q)
        keep[k, :n], keep[k, 2 * n : 2 * n + n * n] = x, p.ravel()
        keep[k, 2 * n + 2 * n * n :] = phi.ravel()
        g = p @ h.T / (h @ p @ h.T + r)
        x, p = x + g[:, 0] * (z[k] - h[0] @ x), p - g @ h @ p
        keep[k, n : 2 * n], keep[k, 2 * n + n * n : 2 * n + 2 * n * n] = x, p.ravel()
    xs, ps = np.zeros((steps, n)), np.zeros((steps, n, n))
    kalman.smooth(keep, n, xs, ps, np.zeros((n, n)), np.zeros((n, n)))
    np.testing.assert_allclose(xs.ravel(), want_x, rtol=1e-8, atol=1e-10)
    for k in range(steps):
        block = want_p[k * n : (k + 1) * n, k * n : (k + 1) * n]
        np.testing.assert_allclose(ps[k], block, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("n", [3, 15])
def test_propagation_is_exact(n):
    rng = np.random.default_rng(5)
    a, phi, q = rng.normal(size=(n, n)), rng.normal(size=(n, n)), rng.random(n)
    p = a @ a.T
    want = phi @ p @ phi.T + np.diag(q)
    kalman.propagate(p, phi, q, np.zeros((n, n)), n)
    np.testing.assert_allclose(p, want, rtol=1e-11, atol=1e-11)
