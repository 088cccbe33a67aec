"""The error state's transition against finite differences of the navigation itself."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.attitude import multiply, quat_to_rotvec, rotvec_to_quat
from schuler.earth import Site, radii
from schuler.kernels.strapdown import DAMPED, FREE, OFF, ROW, SOMIGLIANA, many, navigate
from schuler.motion import Manoeuvre, Route
from schuler.navigation import Start
from schuler.simulation import simulate

LAT, HEIGHT, STEP, RATE = 55.0, 2000.0, 2.0, 20.0
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
#: sizes of the perturbations: phi, velocity, position, gyro bias, accelerometer bias
SIZES = np.repeat([1e-5, 1e-2, 10.0, 1e-6, 1e-4], 3)


@pytest.fixture(scope="module")
def flight():
    """Return two seconds of a fast flight that turns a little and climbs, and its start."""
    site = Site(LAT, 10.0, HEIGHT)
    made = simulate(
        Route([Manoeuvre(2, turn=1.0, climb=2.0)], heading=70.0, speed=250.0), site, STEP, RATE
    )
    t = made.truth
    return made.record, Start(site, t.quat_nb[0], t.v_n[0]).state().data


def options(vertical):
    gains = (0.01, 0.001, 0.0) if vertical == DAMPED else (0.0, 0.0, 0.0)
    return np.array([SOMIGLIANA, 0.0, vertical, *gains, HEIGHT], float)


def flown(flight, vertical, error):
    """Return the end state with an error put in at the start and in the instrument."""
    r, start = flight
    rm, rn = (float(x) + HEIGHT for x in radii(np.deg2rad(LAT)))
    s = start.copy()
    s[:4] = multiply(rotvec_to_quat(-error[:3]), s[:4])
    s[4:7] += error[3:6]
    turn = np.array([-error[7] / rm, error[6] / rn, 0.0])
    s[7:11] = multiply(s[7:11], rotvec_to_quat(turn))
    s[11] += error[8]
    state, row, end = s[None].copy(), np.zeros((1, 26)), np.empty((1, ROW))
    row[0, :3], row[0, 12:15] = error[9:12], error[12:15]
    many(state, options(vertical), 1.0 / RATE, r.dtheta, r.dvel, row, np.random.default_rng(0), end)
    return state[0]


@pytest.mark.parametrize("vertical", [FREE, DAMPED, OFF], ids=["free", "damped", "off"])
def test_transition_is_the_navigation_s_derivative(flight, vertical):
    """Each block, less the identity, within 5 % of its size: steps are of second order."""
    r, start = flight
    if vertical == OFF:
        start = start.copy()
        start[6] = 0.0
        flight = r, start
    state, n = start.copy(), len(r)
    state[19] = 1.0
    work, noise = np.zeros((45, 15)), np.array([0.0, 0.0, 0.0, 0.0, STEP])
    out, variances = np.empty((n, ROW)), np.empty((n, 15))
    navigate(
        state, 1, 1.0, 1.0, options(vertical), r.time, r.dt, r.dtheta, r.dvel, np.empty(0), 1, out,
        work, noise, variances,
    )  # fmt: skip
    phi = work[30:45]
    rm, rn = (float(x) + HEIGHT for x in radii(np.deg2rad(LAT)))
    found = np.zeros((15, 15))
    for k in range(15):
        error = np.zeros(15)
        error[k] = SIZES[k]
        a, b = flown(flight, vertical, error), flown(flight, vertical, -error)
        turn = quat_to_rotvec(multiply(b[7:11] * CONJUGATE, a[7:11]))
        found[:3, k] = quat_to_rotvec(multiply(b[:4], a[:4] * CONJUGATE))
        found[3:6, k] = a[4:7] - b[4:7]
        found[6:9, k] = rn * turn[1], -rm * turn[0], a[11] - b[11]
        found[:, k] /= 2.0 * SIZES[k]
        found[9:, k] = np.eye(15)[9:, k]
    keep = [i for i in range(15) if vertical != OFF or i not in (5, 8)]
    scaled = (found - phi) * SIZES[None, :] / SIZES[:, None]
    reach = np.abs(found - np.eye(15)) * SIZES[None, :] / SIZES[:, None]
    for i in range(0, 9, 3):
        for j in range(0, 15, 3):
            rows = [x for x in range(i, i + 3) if x in keep]
            columns = [x for x in range(j, j + 3) if x in keep]
            block = np.ix_(rows, columns)
            assert np.abs(scaled[block]).max() < 5e-2 * reach[block].max() + 2e-6, (i, j)


def test_covariance_is_phi_p_phi_t_plus_noise(flight):
    r, start = flight
    state, n = start.copy(), len(r)
    state[19] = 1.0
    a = np.random.default_rng(1).standard_normal((15, 15))
    p = a @ a.T
    work = np.zeros((45, 15))
    work[:15] = p
    noise = np.array([2.0, 3.0, 5.0, 7.0, STEP])
    out, variances = np.empty((n, ROW)), np.empty((n, 15))
    navigate(
        state, 1, 1.0, 1.0, options(FREE), r.time, r.dt, r.dtheta, r.dvel, np.empty(0), 1, out,
        work, noise, variances,
    )  # fmt: skip
    added = np.diag([4.0] * 3 + [6.0] * 3 + [0.0] * 3 + [10.0] * 3 + [14.0] * 3)
    np.testing.assert_allclose(work[:15], work[30:] @ p @ work[30:].T + added, rtol=1e-9)
    np.testing.assert_array_equal(variances[-1], np.diag(work[:15]))
    np.testing.assert_array_equal(variances[0], np.diag(p))
