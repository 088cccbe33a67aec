"""What is not known of gravity: in the covariance as large as it is in simulated records."""

import numpy as np
import pytest

from schuler import ImuRecord, Site, align, simulate
from schuler.alignment.gravity_uncertainty import deflection_covariance
from schuler.attitude import quat_to_matrix
from schuler.constants import ARCSEC, MGAL, MICRO_G
from schuler.motion import Static
from schuler.motion.turntable import Dwell, Turn, Turntable
from schuler.sensors import GRADES, ImuSpec
from tests.alignment.conftest import phi_of
from tests.conftest import NORMAL_GRAVITY, chi_square_band

SITE = Site(48.0)
GOOD = ImuSpec.from_dict(
    {
        "gyro": {"bias": "0.003 deg/h", "angle_random_walk": "0.0005 deg/sqrt(h)"},
        "accelerometer": {"bias": "3 ug", "velocity_random_walk": "3 ug/sqrt(Hz)"},
    }
)
"""So good that gravity's uncertainty is the larger part of the tilt's."""


def with_other_gravity(made, rng):
    """Return the record of a place whose gravity is not the formula's."""
    anomaly = SITE.gravity_sigma * MGAL * rng.standard_normal()
    off = SITE.deflection_sigma * ARCSEC * rng.standard_normal(2) * SITE.gravity
    record, c_bn = made.record, quat_to_matrix(made.truth.quat_nb).transpose(0, 2, 1)
    more = 0.5 * (c_bn[1:] + c_bn[:-1]) @ np.array([*off, anomaly])
    return ImuRecord(record.time, record.dt, record.dtheta, record.dvel + more * record.dt[:, None])


def nees(make, runs, seed, **options):
    """Return the sum of the NEES of the attitude over runs, and the last result."""
    rng = np.random.default_rng(seed)
    total = 0.0
    for _ in range(runs):
        made = make(rng)
        fix = align(with_other_gravity(made, rng), SITE, spec=GOOD, **options)
        phi = phi_of(fix, made.euler[-1])
        total += phi @ np.linalg.solve(fix.covariance, phi)
    return total, fix


def one_place(rng):
    return simulate(Static(rng.uniform(0, 360), 3.0, -2.0), SITE, 120.0, 20.0, GOOD, rng)


def two_places(rng):
    turns = [Turn("psi", 170.0), Turn("theta", 40.0)]
    table = Turntable([Dwell(120.0), *turns, Dwell(120.0)], (rng.uniform(0, 360), 2.0, -1.0))
    length = 240.0 + sum(turn.time for turn in turns)
    return simulate(table, SITE, length, 20.0, GOOD, rng)


@pytest.mark.slow
@pytest.mark.parametrize(("make", "method"), [(one_place, "auto"), (two_places, "auto"),
                                              (two_places, "kalman-10")])  # fmt: skip
def test_nees_where_gravity_is_not_that_of_the_formula(make, method):
    runs = 40
    total, fix = nees(make, runs, 7, method=method)
    low, high = chi_square_band(3 * runs, 0.002)
    assert low * 0.7 < total < high
    # Taken for known, gravity would make the tilts look far better than they are.
    assert fix.sigma_arcmin[0] * 60.0 > SITE.deflection_sigma


def test_the_up_bias_is_no_better_than_gravity():
    rng = np.random.default_rng(3)
    turn = Turn("psi", 120.0)
    table = Turntable([Dwell(100.0), turn, Dwell(100.0)], (20.0, 0.0, 0.0))
    made = simulate(table, SITE, 200.0 + turn.time, 20.0, GRADES["navigation-fog"], rng)
    sigma = [
        align(made.record, site, "kalman", "navigation-fog").bias_covariance[5, 5] ** 0.5
        for site in (SITE, Site(48.0, **NORMAL_GRAVITY))
    ]
    assert sigma[1] < 5.0 * MICRO_G < 18.0 * MICRO_G < sigma[0]


def test_deflection_turns_the_heading_by_laplace():
    """An attitude from the tilted plumb line and the Earth's axis, beside the formula."""
    for lat in (-65.0, 10.0, 48.0):
        site = Site(lat, deflection_sigma=1.0)
        axis = np.array([0.0, np.cos(site.latitude), np.sin(site.latitude)])
        parts = []
        for tilt in ([ARCSEC, 0.0, 0.0], [0.0, ARCSEC, 0.0]):
            up = np.array([tilt[1], -tilt[0], 1.0])
            east = np.cross(axis, up)
            east /= np.linalg.norm(east)
            turned = np.array([east, np.cross(up, east), up])
            part = turned - np.eye(3)
            parts.append([part[1, 2], part[2, 0], part[0, 1]])
        expected = sum(np.outer(p, p) for p in parts)
        assert deflection_covariance(site) == pytest.approx(expected, rel=1e-4, abs=1e-14)


@pytest.mark.parametrize("name", ["gravity_sigma", "deflection_sigma"])
def test_bad_values(name):
    with pytest.raises(ValueError, match=name):
        Site(48.0, **{name: -1.0})
