"""Simulated records that the alignment tests share, and the error of an attitude."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.attitude import euler_to_quat, quat_to_matrix
from schuler.earth import Site
from schuler.motion import DisturbedVehicle, Static
from schuler.sensors import ImuSpec
from schuler.simulation import simulate
from tests.conftest import NORMAL_GRAVITY

SITE = Site(lat=40.0, lon=116.0, height=50.0, **NORMAL_GRAVITY)
LEAST_SQUARES = ("centred", "wahba")
INERTIAL = (*LEAST_SQUARES, "integral-triad", "instants-triad")
WHITE = ImuSpec.from_dict(
    {
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.003 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
    }
)


def phi_of(fix, euler):
    """Return phi (rad) of a result against true Euler angles: C_est = (I - [phi x]) C_true."""
    error = quat_to_matrix(fix.quat_nb) @ quat_to_matrix(euler_to_quat(euler)).T
    return -0.5 * np.array(
        [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
    )


@pytest.fixture(scope="session")
def still():
    """Return five minutes of an error-free base at rest, 20 Hz."""
    return simulate(Static(30.0, 2.0, -3.0), SITE, 300.0, 20.0)


@pytest.fixture(scope="session")
def truck():
    """Return 100 s of a disturbed vehicle with perfect instruments, 100 Hz."""
    rng = np.random.default_rng(5)
    motion = DisturbedVehicle.draw(rng, 100.0, heading=200.0, pitch=1.0, roll=-1.0)
    return simulate(motion, SITE, 100.0, 100.0)
