"""A navigation at every sample, from a filter's epochs."""

import numpy as np
import pytest

from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import (
    EpochStates,
    ErrorStateFilter,
    GroupNoise,
    Layout,
    OutputEpoch,
    Position,
    ProcessNoise,
)
from schuler.motion import Manoeuvre, Route
from schuler.simulation import simulate

SITE = Site(40.0, 10.0, 100.0)


@pytest.mark.parametrize("smooth", [False, True])
def test_samples_follow_from_epochs(smooth):
    made = simulate(Route([Manoeuvre(4.0, speed=4.0, turn=20.0)], speed=5.0), SITE, 5.0, 20.0)
    truth = made.truth
    layout = Layout(["phi", "velocity", "position", "gyro_bias", "accelerometer_bias"])
    k = np.array([17, 40, 63, 90])
    # One instant lies between two samples.
    time = truth.time[k] + [0.0, 0.02, 0.0, 0.0]
    place = np.column_stack([np.interp(time, truth.time, x)
                             for x in (truth.lat, truth.lon, truth.height)])  # fmt: skip
    sigma = np.concatenate([np.full(3, 1e-3), np.full(3, 0.1), np.ones(3), np.full(6, 1e-4)])
    flt = ErrorStateFilter(
        layout, SITE, truth.quat_nb[0], np.diag(sigma**2),
        ProcessNoise.of(layout, {"velocity": GroupNoise(1e-6)}),
        [Position(time, place, 0.1), OutputEpoch([truth.time[-1]])], v_n=truth.v_n[0],
        smooth=smooth,
    )  # fmt: skip
    flt.update(made.record)
    smoothed = flt.smoothed() if smooth else None
    found = EpochStates.of(flt, 0.0, smoothed).at_samples(made.record)
    assert len(found.time) == len(made.record)
    np.testing.assert_allclose(found.v_n, truth.v_n[1:], atol=0.02)
    np.testing.assert_allclose(found.height, truth.height[1:], atol=0.02)
    at = np.searchsorted(found.time, flt.history().time[[0, 2, 3, 4]] - 1e-9)
    wanted = (flt.history().v_n if smoothed is None else smoothed.v_n[1:])[[0, 2, 3, 4]]
    np.testing.assert_allclose(found.v_n[at], wanted, atol=1e-9)
    with pytest.raises(InputError, match="before the navigation starts"):
        EpochStates.of(flt, 9.0, smoothed).at_samples(made.record)
