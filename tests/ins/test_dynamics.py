"""The transition against finite differences of the navigation; noise and priors by name."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.ins import GroupNoise, Layout, ProcessNoise, instrument_noise, instrument_prior
from schuler.ins.dynamics import transition
from schuler.sensors import GRADES, ImuSpec
from tests.ins.tools import (
    INSTRUMENT,
    SITE,
    error_between,
    nominal,
    propagate,
    settings,
    sizes_of,
    with_error,
)

NOMINALS = ("identity", "near identity", "random")


def flight(which):
    """Return attitude, velocity, and twenty samples of rate and force over 0.2 s."""
    rng = np.random.default_rng(11)
    up = np.array([0.0, 0.0, SITE.gravity])
    if which == "identity":
        q, v = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        rates, forces = np.zeros((20, 3)), np.tile(up, (20, 1))
    elif which == "near identity":
        q, v = rotvec_to_quat(1e-8 * rng.normal(size=3)), 1e-8 * rng.normal(size=3)
        rates, forces = np.zeros((20, 3)), np.tile(up, (20, 1))
    else:
        q, v = rotvec_to_quat(rng.normal(size=3)), np.array([120.0, -80.0, 5.0])
        rates = rng.normal(size=3) * 0.4 + 0.1 * rng.normal(size=(20, 3))
        forces = quat_to_matrix(q).T @ up + rng.normal(size=(20, 3))
    return np.asarray(q), v, rates, forces


@pytest.mark.parametrize("which", NOMINALS)
@pytest.mark.parametrize("fixed", [False, True], ids=["moving", "fixed place"])
def test_transition_is_the_navigation_s_derivative(which, fixed):
    """Each block, less the identity, within 1 % of its size."""
    groups = ["phi", "velocity", "position", *INSTRUMENT] + (["frame_rate"] if fixed else [])
    layout = Layout(groups)
    q, v, rates, forces = flight(which)
    if fixed:
        v = 0.01 * v
    state, est = nominal(q, v), np.zeros(layout.padded)
    noise = ProcessNoise.of(layout, {})
    dt, sizes = 0.01, sizes_of(layout)
    cfg, options = settings(fixed)
    end = propagate(layout, state, est, rates, forces, dt, fixed)
    phi = transition(layout, noise, end, cfg, options)
    assert phi.shape == (layout.size, layout.size)
    found = np.eye(layout.size)
    for k in range(layout.size):
        x = np.zeros(layout.size)
        x[k] = sizes[k]
        a, b = (
            propagate(layout, *with_error(layout, state, est, s * x, fixed), rates, forces, dt,
                      fixed)
            for s in (1.0, -1.0)
        )  # fmt: skip
        found[:9, k] = error_between(layout, a, b, fixed) / (2.0 * sizes[k])
    off = (found - phi) * sizes[None, :] / sizes[:, None]
    reach = (found - np.eye(layout.size)) * sizes[None, :] / sizes[:, None]
    for row in ("phi", "velocity", "position"):
        for column in layout:
            block = layout[row], layout[column]
            assert np.abs(off[block]).max() < 1e-2 * np.abs(reach[block]).max() + 3e-6, (
                row,
                column,
            )


def test_gravity_is_that_of_the_place():
    """The vertical channel diverges with 2 g / R of its own height, not of a literal."""
    layout = Layout(["phi", "velocity", "position"])
    noise = ProcessNoise.of(layout, {})
    cfg, options = settings(False)
    up = np.array([0.0, 0.0, SITE.gravity])
    q = np.array([1.0, 0.0, 0.0, 0.0])
    end = propagate(layout, nominal(q, np.zeros(3)), np.zeros(12), np.zeros((10, 3)),
                    np.tile(up, (10, 1)), 0.1, False)  # fmt: skip
    phi = transition(layout, noise, end, cfg, options)
    from schuler.earth import radii

    rn = float(radii(SITE.latitude)[1])
    assert phi[5, 8] == pytest.approx(2.0 * SITE.gravity / (rn + SITE.height), rel=1e-6)


def test_without_a_vertical_channel_nothing_comes_of_it():
    layout = Layout(["phi", "velocity", "position", "accelerometer_bias"])
    cfg, options = settings(False, vertical=False)
    q, v, rates, forces = flight("random")
    end = propagate(layout, nominal(q, v), np.zeros(12), rates, forces, 0.01, False, False)
    phi = transition(layout, ProcessNoise.of(layout, {}), end, cfg, options)
    for state in (5, 8):
        np.testing.assert_array_equal(phi[state], np.eye(12)[state])
        np.testing.assert_array_equal(phi[:, state], np.eye(12)[state])


def test_noise_comes_from_the_specification():
    spec = ImuSpec.from_dict(
        {
            "gyro": {"angle_random_walk": "0.003 deg/sqrt(h)", "gauss_markov": "0.01 deg/h",
                     "gauss_markov_time": "300 s", "rate_random_walk": "0.01 deg/h/sqrt(h)"},
            "accelerometer": {"velocity_random_walk": "20 ug/sqrt(Hz)", "bias": "50 ug"},
        }
    )  # fmt: skip
    layout = Layout(["phi", "velocity", "gyro_bias", "accelerometer_bias", "gyro_markov"])
    noise = ProcessNoise.of(layout, instrument_noise(layout, spec))
    n = layout.size
    assert np.all(noise.walk[:3] == spec.gyro.white**2)
    assert np.all(noise.walk[3:6] == spec.accelerometer.white**2)
    assert np.all(noise.walk[layout["gyro_bias"]] == spec.gyro.drift**2)
    assert np.all(noise.fade[layout["gyro_markov"]] == 1.0 / 300.0)
    assert np.all(noise.bound[layout["gyro_markov"]] == spec.gyro.gauss_markov**2)
    assert noise.sources[noise.source[0]] == "gyro_angle_random_walk"
    assert np.all(noise.walk[n:] == 0.0)
    prior = instrument_prior(layout, spec)
    assert prior["accelerometer_bias"] == spec.accelerometer.bias
    assert prior["gyro_bias"] > 0.0
    assert instrument_noise(layout, None) == {}
    with pytest.raises(ValueError, match="no group"):
        ProcessNoise.of(layout, {"motion": GroupNoise(1.0)})
    assert set(instrument_prior(layout, GRADES["navigation-fog"])) <= set(layout)


def test_a_layout_names_its_states():
    layout = Layout(["phi", "velocity", "gyro_bias", ("gnss.lever", 3), ("gnss.delay", 1)])
    assert layout["gnss.delay"] == slice(12, 13)
    assert layout.size == 13
    assert layout.padded == 16
    assert layout.names[12] == "gnss.delay[0]"
    assert "position" not in layout
    assert list(layout.sign[6:9]) == [1.0, 1.0, 1.0]
    assert layout.sign[9] == -1.0
    for bad in (
        ["velocity", "phi"], ["phi", "velocity", "gyro_bias", "position"],
        ["phi", "velocity", "phi"], ["phi", "velocity", ("phi.x", 0)],
        ["phi", "velocity", ("gyro_bias", 2)],
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"group|lead"):
            Layout(bad)
