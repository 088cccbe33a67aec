"""The steps of a covariance against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels import covariance_steps as steps
from schuler.kernels.ins_layout import padded


def system(rng, n=15, m=3, dynamic=9):
    """Return a random transition of dynamic and fading states, and three measurements, padded."""
    size = padded(n)
    phi, decay, q = np.zeros((dynamic, size)), np.ones(size), np.zeros(size)
    phi[:, :dynamic] = np.eye(dynamic)
    phi[:, :n] += 0.02 * rng.normal(size=(dynamic, n)) * (rng.random((dynamic, n)) < 0.4)
    decay[dynamic:n] = 0.9 + 0.1 * rng.random(n - dynamic)
    q[:n] = 1e-4 * rng.random(n)
    h = np.zeros((m, size))
    h[:, :n] = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.4)
    return phi, decay, q, h, 0.1 + rng.random(m)


def dense(phi, decay):
    """Return the whole transition."""
    out = np.diag(decay)
    out[: len(phi)] = phi
    return out


class Filter:
    """The kernels with their arrays."""

    def __init__(self, n, dynamic=9, scale=1.0):
        self.n, self.dynamic, size = n, dynamic, padded(n)
        self.p, self.x = np.zeros((size, size)), np.zeros(size)
        self.p[:n, :n] = scale * np.eye(n)
        self.columns = np.zeros((3, size + 1), np.int64)
        self.scratch = (
            np.zeros((9, size)),
            np.zeros((size, steps.WIDTH)),
            np.zeros((9, steps.WIDTH)),
        )
        self.ph, self.spare, self.line = np.zeros((3, size))

    def predict(self, phi, decay, q):
        steps.find_columns(phi, self.columns, self.dynamic)
        steps.move_state(self.x, phi, self.columns, decay, self.line, self.dynamic)
        steps.predict(self.p, phi, self.columns, decay, q, *self.scratch, self.dynamic)

    def measure(self, z, h, r):
        variance = r + steps.sparse_product(self.p, h, self.ph)
        gain = self.ph / variance
        self.x += gain * (z - h @ self.x)
        steps.apply_gain(self.p, h, self.ph, gain, r, self.spare)


@pytest.mark.parametrize(("n", "dynamic"), [(15, 9), (12, 6), (21, 9), (9, 9)])
def test_steps_are_the_textbook_s(n, dynamic):
    rng = np.random.default_rng(1)
    phi, decay, q, h, r = system(rng, n, dynamic=dynamic)
    f = Filter(n, dynamic)
    f.x[:n] = rng.normal(size=n)
    whole = dense(phi, decay)
    p, x = f.p.copy(), f.x.copy()
    for _ in range(50):
        z = rng.normal(size=3)
        f.predict(phi, decay, q)
        for m in range(3):
            f.measure(z[m], h[m], r[m])
        x, p = whole @ x, whole @ p @ whole.T + np.diag(q)
        s = h @ p @ h.T + np.diag(r)
        k = p @ h.T @ np.linalg.inv(s)
        x, p = x + k @ (z - h @ x), (np.eye(len(x)) - k @ h) @ p
        np.testing.assert_allclose(f.x, x, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(f.p, p, rtol=1e-8, atol=1e-11)
    assert np.all(f.p[n:] == 0.0)


def test_transitions_are_chained():
    rng = np.random.default_rng(6)
    chain, want = np.eye(16), np.eye(16)
    columns, work = np.zeros((3, 17), np.int64), np.zeros((9, 16))
    for _ in range(3):
        phi, decay, *_ = system(rng)
        steps.find_columns(phi, columns, 9)
        steps.chain_transition(chain, phi, columns, decay, work, 9)
        want = dense(phi, decay) @ want
    np.testing.assert_allclose(chain, want, rtol=1e-12, atol=1e-14)


def test_joseph_s_form_holds_for_any_gain():
    rng = np.random.default_rng(2)
    n = 8
    a = rng.normal(size=(n, n))
    p, h, k, r = a @ a.T, rng.normal(size=n), rng.normal(size=n), 0.3
    left = np.eye(n) - np.outer(k, h)
    want = left @ p @ left.T + r * np.outer(k, k)
    ph, spare = np.zeros(n), np.zeros(n)
    assert steps.sparse_product(p, h, ph) == pytest.approx(h @ p @ h)
    steps.apply_gain(p, h, ph, k, r, spare)
    np.testing.assert_allclose(p, want, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(p, p.T)


@pytest.mark.slow
@pytest.mark.compiled
def test_the_covariance_stays_symmetric_and_positive():
    """A stiff system: measurements a million times better than the start, 50,000 steps."""
    rng = np.random.default_rng(3)
    n = 15
    phi, decay, q, h, r = system(rng)
    phi[:, :9] = np.eye(9) + 0.01 * (phi[:, :9] - np.eye(9))
    decay[:] = 1.0
    f = Filter(n, scale=1e3)
    for k in range(50_000):
        f.predict(phi, decay, 1e-12 * q)
        for m in range(3):
            f.measure(0.0, h[m], 1e-6 * r[m])
        if k % 10_000 == 0:
            least, *_, most = np.linalg.eigvalsh(f.p[:n, :n])
            assert least > -1e-11 * most
    np.testing.assert_array_equal(f.p, f.p.T)
    assert np.all(np.diag(f.p)[:n] > 0)


def test_the_joint_square_is_e_s_e():
    rng = np.random.default_rng(4)
    a = rng.normal(size=(6, 6))
    s, e = a @ a.T, rng.normal(size=6)
    for n in range(1, 7):
        want = e[:n] @ np.linalg.solve(s[:n, :n], e[:n])
        assert steps.joint_square(e.copy(), s.copy(), n) == pytest.approx(want, rel=1e-9)
    singular = np.diag([1.0, 0.0])
    assert steps.joint_square(np.array([2.0, 0.0]), singular.copy(), 2) == 4.0
    assert steps.joint_square(np.array([2.0, 1.0]), singular.copy(), 2) > 1e200
