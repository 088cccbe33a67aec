"""Series and closed forms of the quaternion kernels, on both sides of every threshold."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from schuler.kernels import quat

#: squared angles around the threshold of the series, far below it, and far above
AROUND = [
    *[quat.SMALL * f for f in (0.5, 0.9, 0.999, 1 - 1e-15, 1.0, 1 + 1e-15, 1.001, 1.1, 2.0)],
    *[10.0**-k for k in (2, 4, 6, 8, 12, 16, 24, 60, 300)],
    1.0, 4.0, 9.0, 9.8, math.pi**2, 10.0, 30.0,
]  # fmt: skip


@pytest.mark.parametrize("angle2", AROUND)
def test_half_cos_sinc_against_high_precision(angle2):
    with mp.workdps(60):
        a = mp.sqrt(mp.mpf(angle2))
        expected = float(mp.cos(a / 2)), float(mp.sin(a / 2) / a)
    got = quat.half_cos_sinc(angle2)
    # cos(a/2) passes through zero at pi: absolute there, where 1 ulp of a is 4e-16.
    assert got[0] == pytest.approx(expected[0], rel=4e-16, abs=4e-16)
    assert got[1] == pytest.approx(expected[1], rel=1e-15, abs=0)


@pytest.mark.parametrize("angle2", AROUND)
def test_rotation_averages_against_high_precision(angle2):
    with mp.workdps(600):
        a = mp.sqrt(mp.mpf(angle2))
        expected = float((1 - mp.cos(a)) / a**2), float((a - mp.sin(a)) / a**3)
    got = quat.rotation_averages(angle2)
    # Just above the threshold a - sin(a) loses a^2/6, two digits; the term that it multiplies
    # is itself a^2 small, so that the average keeps 1e-15.
    assert got[0] == pytest.approx(expected[0], rel=1e-15, abs=0)
    tight = 6e-16 if angle2 < quat.SMALL else 3e-14
    assert got[1] == pytest.approx(expected[1], rel=tight, abs=0)


def test_series_at_zero_are_the_limits():
    assert quat.half_cos_sinc(0.0) == (1.0, 0.5)
    assert quat.rotation_averages(0.0) == (0.5, 1.0 / 6.0)
    assert quat.qexp((0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0)
    assert quat.qlog((1.0, 0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "angle", [1e-300, 1e-20, 1e-12, 1.9e-9, 2.1e-9, 1e-8, 1e-5, 0.1, 0.24, 0.25, 1.0, 3.0, 3.14159]
)
def test_log_against_high_precision_around_its_threshold(angle):
    # The threshold is sin(a/2) = 1e-9: a = 2e-9.
    with mp.workdps(50):
        s = mp.sin(mp.mpf(angle) / 2)
        axis = [mp.mpf(2) / 7, mp.mpf(-3) / 7, mp.mpf(6) / 7]
        q = (float(mp.cos(mp.mpf(angle) / 2)), *[float(s * x) for x in axis])
        expected = [float(mp.mpf(angle) * x) for x in axis]
    np.testing.assert_allclose(quat.qlog(q), expected, rtol=1e-15, atol=0)
    minus = tuple(-x for x in q)
    np.testing.assert_allclose(quat.qlog(minus), expected, rtol=1e-15, atol=0)


def test_log_of_half_a_turn_has_length_pi():
    for q in [(0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0.0, 0.6, 0.0, 0.8)]:
        np.testing.assert_allclose(quat.qlog(q), math.pi * np.array(q[1:]), rtol=1e-16, atol=0)


@pytest.mark.parametrize("angle", [1e-9, 0.2, 0.3, 2.5, 7.0])
def test_averages_are_the_mean_of_a_turning_vector(angle):
    # By quadrature of the rotation itself, on Gauss points: another road than the formula.
    phi = angle * np.array([2.0, -3.0, 6.0]) / 7.0
    v = np.array([0.3, 1.1, -0.7])
    points, weights = np.polynomial.legendre.leggauss(40)
    mean = sum(
        0.5 * w * np.array(quat.qrotate(quat.qexp(tuple(0.5 * (x + 1) * phi)), tuple(v)))
        for x, w in zip(points, weights, strict=True)
    )
    c1, c2 = quat.rotation_averages(angle * angle)
    got = v + c1 * np.cross(phi, v) + c2 * np.cross(phi, np.cross(phi, v))
    np.testing.assert_allclose(got, mean, rtol=0, atol=2e-14)


def test_hamilton_product_table():
    one, i, j, k = np.eye(4)
    for p, q, r in [(i, j, k), (j, k, i), (k, i, j), (one, i, i), (j, one, j)]:
        np.testing.assert_array_equal(quat.qmul(tuple(p), tuple(q)), r)
        if one is not p and one is not q:
            np.testing.assert_array_equal(quat.qmul(tuple(q), tuple(p)), -r)
    np.testing.assert_array_equal(quat.qmul(tuple(i), tuple(i)), -one)
    assert quat.qconj((1.0, 2.0, -3.0, 4.0)) == (1.0, -2.0, 3.0, -4.0)


def test_matrix_to_quat_takes_each_branch():
    # Half turns about each axis and about the diagonals: one pivot of Shepperd's four each.
    for axis in np.vstack([np.eye(3), [[0.6, 0.8, 0.0], [0.0, 0.6, 0.8], [0.8, 0.0, 0.6]]]):
        m = 2.0 * np.outer(axis, axis) - np.eye(3)
        q = np.array(quat.quat_from_matrix(*(tuple(r) for r in m)))
        np.testing.assert_allclose(np.abs(q), [0.0, *axis], atol=1e-15)
    q = quat.quat_from_matrix(*(tuple(r) for r in np.eye(3)))
    assert q == (1.0, 0.0, 0.0, 0.0)


def test_normalise_scales_only():
    np.testing.assert_allclose(quat.qnormalise((2.0, -4.0, 5.0, 6.0)), np.array([2, -4, 5, 6]) / 9)
