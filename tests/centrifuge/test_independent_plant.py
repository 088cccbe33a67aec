"""The filter against a plant of its own: equations 2 to 18 written out here, angles integrated."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.centrifuge import (
    PUBLISHED_POSITIONS,
    Plant,
    coefficient_names,
    coefficient_units,
    fit_platform,
    published_truth,
    simulate_platform,
)
from schuler.constants import ARCSEC, DEG, DEG_PER_HOUR, EARTH_RATE
from tests.conftest import chi_square_band


def turn_about(axis, angle):
    """M_j of eq. 7, of many angles."""
    c, s, one, zero = np.cos(angle), np.sin(angle), np.ones_like(angle), np.zeros_like(angle)
    rows = {
        "x": [[one, zero, zero], [zero, c, s], [zero, -s, c]],
        "y": [[c, zero, -s], [zero, one, zero], [s, zero, c]],
        "z": [[c, s, zero], [-s, c, zero], [zero, zero, one]],
    }[axis]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


class OwnPlant:
    """Equations 2 to 18 for runs and positions at a time; angles by Runge and Kutta."""

    def __init__(self, order, truth, commanded=(0, 0, 0), mounting=(0,) * 6, latitude=28.22):
        units = dict(zip(coefficient_names(), truth, strict=True))
        self.k = {n: np.array([units[n + a] for a in "xyz"]) for n in ("k0", "k1", "k2", "k3",
                                                                       "k_IP")}  # fmt: skip
        terms = ("D_F", "D_I", "D_O", "D_S", "D_II", "D_SS", "D_IO", "D_IS", "D_OS")
        self.d = {n: np.array([units[n + a] for a in "xyz"]) for n in terms}
        py, pz, oz = units["th_py"], units["th_pz"], units["th_oz"]
        self.accel = np.array([
            [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            [[py, 1, 0], [0, 0, -1], [-1, py, 0]],
            [[pz, oz, 1], [0, 1, -oz], [-1, 0, pz]],
        ])  # fmt: skip
        ox, sx, oy, sy, oz, sz = np.array(mounting) * ARCSEC
        self.gyro = np.array([
            [[1, -ox, -sx], [-sx, 0, -1], [ox, 1, 0]],
            [[oy, 1, -sy], [0, -sy, -1], [-1, oy, 0]],
            [[sz, -oz, 1], [1, 0, -sz], [0, 1, oz]],
        ])  # fmt: skip
        self.order = order
        self.commanded = np.array(commanded) * DEG_PER_HOUR
        lat = latitude * DEG
        self.north, self.up = EARTH_RATE * np.cos(lat), EARTH_RATE * np.sin(lat)
        self.rate = 180.0 * DEG
        self.reach = 10.0 / self.rate**2

    def matrix(self, a):
        first, second = ("z", "y") if self.order == "zyx" else ("y", "z")
        return (turn_about(first, a[..., 2]) @ turn_about(second, a[..., 1])
                @ turn_about("x", a[..., 0]))  # fmt: skip

    def force(self, t):
        w, r, x = self.rate, self.reach, self.rate * t
        return np.array([
            -(w * w + 2 * w * self.up) * r * np.cos(x),
            -(w * w + 2 * w * self.up) * r * np.sin(x),
            2 * w * r * self.north * np.sin(x) + 1.0,
        ])  # fmt: skip

    def slope(self, t, a):
        c = self.matrix(a)
        f = c @ self.force(t)
        w = c @ np.array([0.0, self.north, self.up])
        for j in range(3):
            i, o, s = (f @ self.gyro[j, k] for k in range(3))
            d = {name: three[j] for name, three in self.d.items()}
            eps = (d["D_F"] + d["D_I"] * i + d["D_O"] * o + d["D_S"] * s + d["D_II"] * i * i
                   + d["D_SS"] * s * s + d["D_IO"] * i * o + d["D_IS"] * i * s
                   + d["D_OS"] * o * s)  # fmt: skip
            w = w + (eps + self.commanded[j])[..., None] * self.gyro[j, 0]
        x, y, z = np.moveaxis(w, -1, 0)
        beta, g = a[..., 1], a[..., 2]
        if self.order == "zyx":
            alpha = (np.cos(g) * x - np.sin(g) * y) / np.cos(beta)
            rates = alpha, np.sin(g) * x + np.cos(g) * y, z - np.sin(beta) * alpha
        else:
            alpha = (np.cos(g) * x + np.sin(g) * z) / np.cos(beta)
            rates = alpha, np.cos(g) * z - np.sin(g) * x, y + np.sin(beta) * alpha
        return -np.stack(rates, axis=-1)

    def outputs(self, a, dwell, rng, noise=1e-5, h=0.02):
        out = []
        for k in range(round(dwell / h)):
            t = k * h
            p = self.slope(t, a)
            q = self.slope(t + h / 2, a + h / 2 * p)
            r = self.slope(t + h / 2, a + h / 2 * q)
            s = self.slope(t + h, a + h * r)
            a = a + h / 6 * (p + 2 * q + 2 * r + s)
            f = self.matrix(a) @ self.force(t + h)
            i = np.einsum("jk,...k->...j", self.accel[:, 0], f)
            other = np.einsum("jk,...k->...j", self.accel[:, 1], f)
            k_ = self.k
            out.append(k_["k0"] + (1 + k_["k1"]) * i + k_["k2"] * i**2 + k_["k3"] * i**3
                       + k_["k_IP"] * i * other)  # fmt: skip
        out = np.stack(out, axis=-2)
        return out + noise * rng.standard_normal(out.shape)


def starts(rng, runs):
    nominal = np.array(PUBLISHED_POSITIONS) * DEG
    return nominal + 1e-3 * rng.standard_normal((runs, 6, 3))


@pytest.mark.parametrize(
    ("order", "commanded", "mounting", "seed"),
    [("zyx", (0, 0, 0), (0,) * 6, 1), ("yzx", (0, 0, 0), (0,) * 6, 2),
     ("yzx", (90.0, -60.0, 30.0), (200.0, -150.0, 100.0, 50.0, -80.0, 120.0), 3)],
)  # fmt: skip
def test_the_filter_is_consistent_on_a_plant_written_apart(order, commanded, mounting, seed):
    rng, runs, truth = np.random.default_rng(seed), 5, published_truth()
    own = OwnPlant(order, truth, commanded, mounting)
    plant = Plant(order=order, commanded=commanded, gyro_mounting=mounting)
    nees = 0.0
    for one in own.outputs(starts(rng, runs), 40.0, rng):
        fit = fit_platform(plant, PUBLISHED_POSITIONS, one)
        error = fit.value - truth
        nees += error @ np.linalg.solve(fit.covariance, error)
    low, high = chi_square_band(45 * runs, 0.01)
    assert low < nees < high


def test_a_neglected_commanded_rate_shows():
    rng, truth = np.random.default_rng(4), published_truth()
    own = OwnPlant("zyx", truth, (90.0, -60.0, 30.0))
    one = own.outputs(starts(rng, 1), 20.0, rng)[0]
    fit = fit_platform(Plant(), PUBLISHED_POSITIONS, one)
    error = fit.value - truth
    assert error @ np.linalg.solve(fit.covariance, error) > 10 * 45
    assert fit_platform(Plant(commanded=(90.0, -60.0, 30.0)), PUBLISHED_POSITIONS, one).nis < 1.1


@pytest.mark.parametrize(
    "settings",
    [{}, {"order": "yzx"}, {"commanded": (900.0, 0.0, -300.0), "gyro_mounting": (90.0,) * 6}],
)
def test_the_simulated_platform_is_the_one_written_apart(settings):
    """Both from the same attitude, without noise: to 1e-9 g after ten seconds."""
    truth = published_truth()
    quiet = Plant(noise=1e-12, attitude_prior=1e-14, **settings)
    ours = simulate_platform(quiet, PUBLISHED_POSITIONS, 10.0, truth, np.random.default_rng(0))[0]
    own = OwnPlant(quiet.order, truth, quiet.commanded, quiet.gyro_mounting)
    theirs = own.outputs(np.array(PUBLISHED_POSITIONS) * DEG, 10.0, np.random.default_rng(0), 0.0)
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    assert coefficient_units()[0][0] == "deg/h"
