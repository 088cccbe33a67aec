"""Attitude: round trips and compositions by property, signs by the convention's own examples."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from schuler import attitude as at
from schuler.errors import InputError

TIGHT = 1e-12

component = st.floats(-1.0, 1.0, allow_subnormal=False)


@st.composite
def unit_quats(draw):
    """Draw unit quaternions, with corners (zeros, ones) more often than a sphere would."""
    q = np.array(draw(st.tuples(component, component, component, component)))
    norm = np.linalg.norm(q)
    return q / norm if norm > 1e-3 else np.array([1.0, 0.0, 0.0, 0.0])


@st.composite
def rotvecs(draw):
    """Draw rotation vectors of any length: zero, tiny, near pi, beyond a turn."""
    q = draw(unit_quats())
    axis = q[1:] / np.linalg.norm(q[1:]) if np.linalg.norm(q[1:]) > 1e-9 else np.array([0, 0, 1.0])
    near_pi = st.floats(-1e-6, 1e-6).map(lambda e: math.pi + e)
    tiny = st.floats(-12, -1).map(lambda e: 10.0**e)
    return axis * draw(st.one_of(st.just(0.0), tiny, near_pi, st.floats(0.0, 20.0)))


angles = st.floats(-math.pi, math.pi)
vectors = arrays(np.float64, 3, elements=st.floats(-100.0, 100.0))


def same_rotation(p, q):
    """Return how far two unit quaternions are apart as rotations (q and -q are one)."""
    return min(np.abs(p - q).max(), np.abs(p + q).max())


# -- round trips and composition -----------------------------------------------------------


@given(unit_quats())
def test_quat_to_matrix_and_back(q):
    m = at.quat_to_matrix(q)
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=TIGHT)
    assert np.linalg.det(m) == pytest.approx(1.0, abs=TIGHT)
    back = at.matrix_to_quat(m)
    assert back[0] >= 0.0
    assert same_rotation(back, q) < TIGHT


@given(unit_quats())
def test_quat_to_rotvec_and_back(q):
    phi = at.quat_to_rotvec(q)
    assert np.linalg.norm(phi) <= math.pi + 1e-15
    assert same_rotation(at.rotvec_to_quat(phi), q) < TIGHT


@given(unit_quats())
def test_quat_to_euler_and_back(q):
    psi, theta, gamma = at.quat_to_euler(q)
    assert -math.pi < psi <= math.pi
    assert -math.pi / 2 <= theta <= math.pi / 2
    assert -math.pi < gamma <= math.pi
    # Beside gimbal lock (cos theta < 1e-8) the attitude itself stays exact to that.
    tight = TIGHT if math.cos(theta) > 2e-8 else 2e-8
    assert same_rotation(at.euler_to_quat([psi, theta, gamma]), q) < tight


@given(angles, st.floats(-math.pi / 2 + 1e-3, math.pi / 2 - 1e-3), angles)
def test_euler_to_quat_and_back(psi, theta, gamma):
    back = at.quat_to_euler(at.euler_to_quat([psi, theta, gamma]))
    wrapped = np.mod(back - [psi, theta, gamma] + math.pi, 2 * math.pi) - math.pi
    # Near +-90 deg the outer angles are known to eps / cos(theta).
    np.testing.assert_allclose(wrapped, 0.0, atol=1e-15 / 1e-3 * 4)


@given(rotvecs())
def test_rotvec_is_exact_for_any_angle(phi):
    expected = Rotation.from_rotvec(phi).as_quat()[..., [3, 0, 1, 2]]
    assert same_rotation(at.rotvec_to_quat(phi), expected) < TIGHT
    angle = np.linalg.norm(phi)
    assert np.linalg.norm(at.rotvec_to_quat(phi)) == pytest.approx(1.0, abs=1e-15)
    if angle < math.pi - 1e-9:
        np.testing.assert_allclose(at.quat_to_rotvec(at.rotvec_to_quat(phi)), phi, atol=TIGHT)


@given(unit_quats(), unit_quats())
def test_product_is_the_composition_of_rotations(p, q):
    product = at.multiply(p, q)
    np.testing.assert_allclose(
        at.quat_to_matrix(product), at.quat_to_matrix(p) @ at.quat_to_matrix(q), atol=TIGHT
    )
    expected = (at.to_scipy(p) * at.to_scipy(q)).as_quat()[..., [3, 0, 1, 2]]
    assert same_rotation(product, expected) < TIGHT


@given(unit_quats(), unit_quats(), unit_quats())
def test_product_is_associative(p, q, r):
    left = at.multiply(at.multiply(p, q), r)
    np.testing.assert_allclose(left, at.multiply(p, at.multiply(q, r)), atol=TIGHT)


@given(unit_quats(), vectors)
def test_rotate_is_the_matrix_and_keeps_length(q, v):
    turned = at.rotate(q, v)
    np.testing.assert_allclose(turned, at.quat_to_matrix(q) @ v, atol=1e-12 * 100)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(v), rel=TIGHT, abs=1e-300)
    np.testing.assert_allclose(turned, at.to_scipy(q).apply(v), atol=1e-12 * 100)


@given(unit_quats())
def test_scipy_there_and_back(q):
    back = at.from_scipy(at.to_scipy(q))
    assert back[0] >= 0.0
    assert same_rotation(back, q) < TIGHT


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(at.skew(a) @ b, np.cross(a, b), atol=1e-10)
    np.testing.assert_array_equal(at.skew(a), -at.skew(a).T)


# -- the convention's signs ----------------------------------------------------------------


def matrix_of(psi=0.0, theta=0.0, gamma=0.0):
    """Return C_b^n from angles in degrees."""
    return at.quat_to_matrix(at.euler_to_quat(np.radians([psi, theta, gamma])))


def test_psi_turns_counter_clockwise_seen_from_above():
    # Forward (y) from north towards west.
    np.testing.assert_allclose(matrix_of(psi=90.0) @ [0, 1, 0], [-1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(matrix_of(psi=90.0) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_positive_pitch_lifts_the_nose():
    np.testing.assert_allclose(matrix_of(theta=90.0) @ [0, 1, 0], [0, 0, 1], atol=1e-15)


def test_positive_roll_lowers_the_right_side():
    np.testing.assert_allclose(matrix_of(gamma=90.0) @ [1, 0, 0], [0, 0, -1], atol=1e-15)


def test_order_of_turns_is_z_x_y():
    angles = np.radians([25.0, -40.0, 130.0])
    expected = Rotation.from_euler("ZXY", angles).as_matrix()
    np.testing.assert_allclose(matrix_of(25.0, -40.0, 130.0), expected, atol=1e-15)


def test_forward_axis_points_along_heading():
    # Heading 30 deg clockwise from north is psi = -30 deg.
    psi = at.heading_to_psi(math.radians(30.0))
    assert math.degrees(psi) == pytest.approx(-30.0, abs=1e-13)
    forward = at.rotate(at.euler_to_quat([psi, 0.0, 0.0]), [0.0, 1.0, 0.0])
    assert math.degrees(math.atan2(forward[0], forward[1])) == pytest.approx(30.0, abs=1e-13)


def test_level_north_at_rest_reads_gravity_up_and_earth_rate_north_and_up():
    from schuler.earth import Site

    site = Site(34.246, 0.0, 380.0)
    q_bn = at.euler_to_quat([0.0, 0.0, 0.0])
    np.testing.assert_array_equal(at.rotate(q_bn, [0, 0, site.gravity]), [0, 0, site.gravity])
    we, la = 7.292115e-5, math.radians(34.246)
    np.testing.assert_allclose(
        at.rotate(q_bn, site.earth_rate), [0, we * math.cos(la), we * math.sin(la)], atol=1e-19
    )


def test_misalignment_sign():
    # C_est = (I - [phi x]) C_true: a computed frame that is turned by -phi.
    phi = np.array([1e-7, -2e-7, 3e-7])
    true = matrix_of(30.0, 10.0, -20.0)
    estimate = at.quat_to_matrix(at.rotvec_to_quat(-phi)) @ true
    np.testing.assert_allclose(estimate, (np.eye(3) - at.skew(phi)) @ true, atol=1e-13)


# -- corners -------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gimbal_lock_is_defined_and_keeps_the_attitude(sign):
    q = at.euler_to_quat(np.array([0.7, sign * math.pi / 2, 0.4]))
    psi, theta, gamma = at.quat_to_euler(q)
    assert gamma == 0.0
    assert theta == pytest.approx(sign * math.pi / 2, abs=1e-15)
    # psi takes the whole turn: at +90 deg the outer angles add, at -90 deg they subtract.
    assert psi == pytest.approx(0.7 + sign * 0.4, abs=TIGHT)
    assert same_rotation(at.euler_to_quat([psi, theta, gamma]), q) < TIGHT


@pytest.mark.parametrize("beside", [1e-9, 1e-7, 1e-6, 1e-4])
def test_pitch_keeps_its_digits_near_the_zenith(beside):
    theta = math.pi / 2 - beside
    got = at.quat_to_euler(at.euler_to_quat([0.3, theta, -0.2]))
    assert got[1] == pytest.approx(theta, abs=5e-16)


def test_half_turns_are_plus_180_degrees():
    # Angles live in (-180, 180]: exact half turns about each axis must not come out as -180.
    assert at.quat_to_euler([0.0, 0.0, 1.0, 0.0])[2] == math.pi
    assert at.quat_to_euler([0.0, 0.0, -1.0, 0.0])[2] == math.pi
    assert at.quat_to_euler([0.0, 0.0, 0.0, 1.0])[0] == math.pi
    assert at.quat_to_euler([0.0, 0.0, 0.0, -1.0])[0] == math.pi


@given(st.floats(-1e3, 1e3))
def test_heading_and_psi(angle):
    heading = at.psi_to_heading(angle)
    assert 0.0 <= heading < 2 * math.pi
    psi = at.heading_to_psi(heading)
    assert -math.pi < psi <= math.pi
    assert math.cos(psi - angle) == pytest.approx(1.0, abs=1e-12)


def test_heading_corners():
    assert at.psi_to_heading(0.0) == 0.0
    assert at.psi_to_heading(1e-20) == 0.0
    assert at.psi_to_heading(-math.pi / 2) == pytest.approx(math.pi / 2)
    assert at.psi_to_heading(math.pi / 2) == pytest.approx(3 * math.pi / 2)
    assert at.heading_to_psi(math.pi) == math.pi
    assert at.heading_to_psi(2 * math.pi) == 0.0
    assert isinstance(float(at.psi_to_heading(1.0)), float)
    assert at.psi_to_heading([[0.1, -0.1]]).shape == (1, 2)


def test_the_nearest_rotation_of_a_mean_is_the_middle_one():
    # Of turns by +a and -a about one axis the mean is no rotation; the nearest one is between.
    q = at.rotvec_to_quat([[0.0, 0.0, 0.4], [0.0, 0.0, -0.4]])
    middle = at.rotvec_to_quat([0.3, -0.2, 0.1])
    mean = at.quat_to_matrix(middle) @ at.quat_to_matrix(q).mean(axis=0)
    with pytest.raises(InputError, match="hold rotations"):
        at.matrix_to_quat(mean)
    assert same_rotation(at.nearest_quat(mean), middle) < TIGHT
    many = at.nearest_quat(np.stack([mean, np.eye(3), 2 * np.eye(3)]))
    np.testing.assert_allclose(many[1:], [[1, 0, 0, 0]] * 2, atol=TIGHT)
    # A reflection is not returned, whatever comes in.
    assert np.linalg.det(at.quat_to_matrix(at.nearest_quat(np.diag([1.0, 1.0, -1.0])))) > 0


def test_leading_dimensions_go_through(rng):
    q = at.rotvec_to_quat(rng.normal(size=(2, 5, 3)))
    assert q.shape == (2, 5, 4)
    assert at.quat_to_matrix(q).shape == (2, 5, 3, 3)
    assert at.matrix_to_quat(at.quat_to_matrix(q)).shape == (2, 5, 4)
    assert at.quat_to_euler(q).shape == (2, 5, 3)
    assert at.quat_to_rotvec(q[0, 0]).shape == (3,)
    assert at.multiply(q[:, :1], q[0]).shape == (2, 5, 4)
    assert at.rotate(q, np.ones(3)).shape == (2, 5, 3)
    assert at.rotate(q[0, 0], np.ones((7, 3))).shape == (7, 3)
    assert at.skew(np.ones((4, 3))).shape == (4, 3, 3)
    assert at.rotvec_to_quat(np.empty((0, 3))).shape == (0, 4)
    assert at.to_scipy(q[0]).as_quat().shape == (5, 4)
    many = tuple(map(int, scipy.__version__.split(".")[:2])) >= (1, 17)
    with nullcontext() if many else pytest.raises(InputError, match="reshape it to"):
        assert at.to_scipy(q).as_quat().shape == (2, 5, 4)
    row = at.multiply(q[1, 3], q[0, 2])
    np.testing.assert_array_equal(at.multiply(q[1, 3:4], q[0, 2:3])[0], row)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: at.rotvec_to_quat([1, 2]), "expected `rotvec` to have shape (..., 3), got (2,)"),
        (lambda: at.quat_to_matrix(1.0), "expected `quat` to have shape (..., 4), got ()"),
        (lambda: at.quat_to_euler(np.ones((2, 3))), "expected `quat` to have shape (..., 4)"),
        (lambda: at.euler_to_quat(np.ones(4)), "expected `euler` to have shape (..., 3), got (4,)"),
        (lambda: at.multiply([1.0], [1.0, 0, 0, 0]), "expected `p` to have shape (..., 4)"),
        (lambda: at.multiply(np.ones(4), np.ones(3)), "expected `q` to have shape (..., 4)"),
        (lambda: at.rotate(np.ones(4), np.ones(2)), "expected `vector` to have shape (..., 3)"),
        (lambda: at.rotate(1.0, np.ones(3)), "expected `quat` to have shape (..., 4), got ()"),
        (lambda: at.to_scipy(np.ones(3)), "expected `quat` to have shape (..., 4), got (3,)"),
        (lambda: at.skew(np.ones(2)), "expected `vector` to have shape (..., 3), got (2,)"),
        (lambda: at.matrix_to_quat(np.eye(2)), "expected `matrix` to have shape (..., 3, 3)"),
        (lambda: at.matrix_to_quat(2 * np.eye(3)), "expected `matrix` to hold rotations"),
        (lambda: at.matrix_to_quat(-np.eye(3)), "expected `matrix` to hold rotations"),
        (lambda: at.matrix_to_quat(np.full((3, 3), np.nan)), "expected `matrix` to hold rotations"),
    ],
)
def test_errors_say_what_was_expected(call, sentence):
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(sentence)
