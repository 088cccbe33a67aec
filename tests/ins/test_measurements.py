"""Rows of H of each kind of measurement against central differences of its predicted value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.errors import InputError
from schuler.ins import (
    Attitude,
    BodyVelocity,
    ConstantBase,
    Handling,
    Heading,
    Height,
    Layout,
    NonHolonomic,
    Position,
    Rate,
    Velocity,
    ZeroDisplacement,
    ZeroForce,
    ZeroRate,
    ZeroVelocity,
)
from schuler.ins.dynamics import SOURCES
from schuler.kernels import ins_layout as kernel
from schuler.kernels.measurement_rows import fill_rows
from tests.ins.tools import CONJUGATE, SITE, nominal, propagate, settings, with_error

ARM = (0.4, -1.2, 0.7)
RATES = (0.1, -0.2, 0.4, 0.5, -0.3, 0.2)
MOUNT = tuple(rotvec_to_quat(np.array([0.1, -0.2, 0.3])))
LAT, LON = SITE.latitude, SITE.longitude
KINDS = {
    "position": Position([0.0], (LAT + 1e-5, LON - 2e-5, 1990.0), 1.0, lever=ARM,
                         estimate=("lever", "delay")),
    "velocity": Velocity([0.0], (1.0, 2.0, 3.0), 0.1, lever=ARM, delay=0.05,
                         estimate=("lever", "delay")),
    "DVL": BodyVelocity([0.0], (1.0, 2.0, 3.0), 0.1, lever=ARM, mount=MOUNT, scale=0.02,
                        estimate=("scale", "mount", "lever")),
    "odometer": BodyVelocity([0.0], (0.0, 9.0, 0.0), (0.0, 0.1, 0.0), mount_axes="xz",
                             estimate=("scale", "mount")),
    "non-holonomic": NonHolonomic([0.0], sigma=0.1, lever=ARM, estimate=("mount",)),
    "zero velocity": ZeroVelocity([0.0], sigma=0.1),
    "zero rate": ZeroRate([0.0], (1e-4, 2e-4, 0.0), 1e-5),
    "height": Height([0.0], 1990.0, 1.0, lever=ARM, offset=20.0, estimate=("offset", "lever")),
    "heading": Heading([0.0], 1.0, 0.01, baseline=(0.5, 2.0, 0.3)),
    "zero displacement": ZeroDisplacement([0.0], sigma=0.01, lever=ARM, estimate=("lever",)),
    "constant base": ConstantBase([0.0], sigma=1e-4),
    "velocity, rate now": Velocity([0.0], (1.0, 2.0, 3.0), 0.1, lever=ARM, rate_now=True,
                                   estimate=("lever", "delay")),
    "velocity, rates given": Velocity([0.0], (1.0, 2.0, 3.0), 0.1, lever=ARM, rates=[RATES],
                                      estimate=("lever", "delay")),
    "attitude, rates given": Attitude([0.0], (0.0, 0.0, 0.0), 1e-4, mount=MOUNT, delay=0.02,
                                      rates=[RATES], estimate=("mounting", "delay")),
    "attitude": Attitude([0.0], (0.0, 0.0, 0.0), 1e-4, mount=MOUNT, delay=0.02,
                         estimate=("mounting", "delay")),
    "rate": Rate([0.0], (0.02, 0.3, 0.1), 1e-4, mount=MOUNT, estimate=("mounting", "delay")),
}  # fmt: skip
AT_A_PLACE = {"zero displacement", "constant base"}
STEPS = {"phi": 1e-6, "velocity": 1e-3, "position": 1e-1, "gyro_bias": 1e-6, "lever": 1e-3,
         "delay": 1e-4, "scale": 1e-4, "mount": 1e-6, "mounting": 1e-6, "offset": 0.1,
         "base": 1e-6}  # fmt: skip


def predicted(aid, layout, state, est, cfg):
    """Return predicted minus measured, rows and variances."""
    size = layout.padded
    h, z, r = np.zeros((3, size)), np.zeros(3), np.zeros(3)
    count = fill_rows(
        aid.table(0)[0], aid.parameters(layout, SOURCES), state, est, layout.at, cfg,
        np.zeros((9, size)), h, z, r,
    )  # fmt: skip
    return z[:count], h[:count], r[:count]


@pytest.mark.parametrize("which", ["identity", "near identity", "random"])
@pytest.mark.parametrize("name", KINDS)
def test_rows_are_derivatives_of_the_prediction(name, which):
    """To the Earth rate times a lever of metres, which the rows leave out."""
    aid, fixed = KINDS[name], name in AT_A_PLACE
    rng = np.random.default_rng(5)
    size = {"identity": 0.0, "near identity": 1e-8, "random": 1.0}[which]
    layout = Layout(["phi", "velocity", "position", "gyro_bias", *aid.groups])
    cfg, _ = settings(fixed)
    state = nominal(rotvec_to_quat(size * rng.normal(size=3)), [3.0, 11.0, -0.5])
    est = np.zeros(layout.padded)
    if isinstance(aid, Attitude | Rate):
        # Rows are derivatives where what was measured is as it was predicted.
        off = 0.3 * rng.normal(size=3)
        est[layout[f"{aid.label}.mounting"]] = off
        mount = multiply(MOUNT, rotvec_to_quat(off))
    if isinstance(aid, Rate):
        aid = replace(aid, value=quat_to_matrix(mount) @ [0.1, -0.2, 0.4])
    if isinstance(aid, Attitude):
        back = rotvec_to_quat(-0.02 * np.array([0.1, -0.2, 0.4]))
        quat = multiply(
            multiply(state[kernel.QUAT_NB : kernel.QUAT_NB + 4], back), mount * CONJUGATE
        )
        aid = replace(aid, value=quat_to_rotvec(quat))
    rate = np.array([0.1, -0.2, 0.4])
    for now in (kernel.RATE_B, kernel.RATE_NOW, kernel.MEAN_RATE):
        state[now : now + 3] = rate
    at = kernel.MEAN_ACCELERATION
    state[at : at + 3] = 1.0, -2.0, 0.3
    if fixed:
        turn = rotvec_to_quat(size * 1e-3 * rng.normal(size=3))
        state[kernel.QUAT_START : kernel.QUAT_START + 4] = turn
        state[kernel.QUAT_NB : kernel.QUAT_NB + 4] = turn

    def value(x):
        s, e = with_error(layout, state, est, x, fixed)
        # What is left of a gyro bias, truth minus estimate, is in the rate as well.
        for now in (kernel.RATE_B, kernel.RATE_NOW, kernel.MEAN_RATE):
            s[now : now + 3] += x[layout["gyro_bias"]]
        if name == "zero displacement":
            # An error of the attitude is one of the start as well.
            start = s[kernel.QUAT_START : kernel.QUAT_START + 4]
            start[:] = multiply(rotvec_to_quat(-x[:3]), start)
        return predicted(aid, layout, s, e, cfg)[0]

    z, h, r = predicted(aid, layout, state, est, cfg)
    assert (
        len(z)
        == len(r)
        == {"odometer": 1, "non-holonomic": 2, "height": 1, "heading": 1}.get(name, 3)
    )
    for group in layout:
        step = STEPS[group.partition(".")[2] or group]
        for k in range(layout[group].start, layout[group].stop):
            x = np.zeros(layout.size)
            x[k] = step
            found = (value(x) - value(-x)) / (2.0 * step)
            want = h[:, k]
            if group == "base":
                # The base is no part of the prediction: only z = H x says what it is.
                continue
            assert np.abs(found - want).max() < 1e-4 * max(np.abs(h).max(), 1.0), (group, k)
    if name == "constant base":
        np.testing.assert_array_equal(h[:, layout["base"]], np.eye(3))


def test_the_delay_s_part_of_a_position_is_the_velocity():
    aid = replace(KINDS["position"], delay=0.1)
    layout = Layout(["phi", "velocity", "position", "gyro_bias", *aid.groups])
    cfg, _ = settings(False)
    state = nominal(rotvec_to_quat([0.1, 0.2, 0.3]), [3.0, 11.0, -0.5])
    _, h, _ = predicted(aid, layout, state, np.zeros(layout.padded), cfg)
    np.testing.assert_allclose(h[:, 3:6], -0.1 * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(h[:, layout["position.delay"]][:, 0], [-3.0, -11.0, 0.5], rtol=1e-4)


def test_a_fix_in_a_frame_that_wandered_is_still_east_north_up():
    """A quarter of a wander turn: rows of H turn, innovations east and north stay."""
    layout = Layout(["phi", "velocity", "position"])
    cfg, _ = settings(False)
    turn = rotvec_to_quat(np.array([0.0, 0.0, np.pi / 2]))
    q = rotvec_to_quat([0.1, 0.2, 0.3])
    here = nominal(q, [3.0, 11.0, -0.5])
    there = nominal(multiply(turn, q), [-11.0, 3.0, -0.5])
    p = slice(kernel.QUAT_NE, kernel.QUAT_NE + 4)
    there[p] = multiply(here[p], turn * [1.0, -1.0, -1.0, -1.0])
    for aid in (KINDS["position"], KINDS["velocity"]):
        aid = replace(aid, estimate=())
        one, other = (predicted(aid, layout, s, np.zeros(12), cfg) for s in (here, there))
        np.testing.assert_allclose(one[0], other[0], atol=1e-8)
        rotation = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(other[1][:, :3], one[1][:, :3] @ rotation.T, atol=1e-8)


def test_a_position_is_metres_on_the_ellipsoid():
    from schuler.earth import radii

    rm, rn = (float(x) for x in radii(LAT))
    layout = Layout(["phi", "velocity", "position"])
    cfg, _ = settings(False)
    state = nominal([1.0, 0.0, 0.0, 0.0], np.zeros(3))
    north, east = 300.0, -400.0
    place = (LAT + north / (rm + SITE.height), LON + east / ((rn + SITE.height) * np.cos(LAT)),
             SITE.height + 7.0)  # fmt: skip
    z, _, _ = predicted(Position([0.0], place, 1.0), layout, state, np.zeros(12), cfg)
    np.testing.assert_allclose(z, [-east, -north, -7.0], atol=0.05)


def test_the_horizontal_force_has_the_row_of_the_velocity_it_makes():
    layout = Layout(["phi", "velocity", "gyro_bias", "accelerometer_bias"])
    cfg, _ = settings(True)
    up = np.array([0.0, 0.0, SITE.gravity])
    q = rotvec_to_quat(np.array([1e-3, 2e-3, 0.5]))
    end = propagate(layout, nominal(q, np.zeros(3)), np.zeros(12), np.zeros((10, 3)),
                    np.tile(up, (10, 1)), 0.1, True)  # fmt: skip
    phi = np.random.default_rng(3).normal(size=(9, 12))
    h, z, r = np.zeros((3, 12)), np.zeros(3), np.zeros(3)
    aid = ZeroForce([0.0], sigma=1e-3)
    count = fill_rows(aid.table(0)[0], aid.parameters(layout, SOURCES), end, np.zeros(12),
                      layout.at, cfg, phi, h, z, r)  # fmt: skip
    assert count == 2
    np.testing.assert_allclose(z[:2], end[kernel.MEAN_F :][:2] / end[kernel.SPAN])
    np.testing.assert_allclose(h[:2, :3], phi[3:5, :3] / end[kernel.SPAN])
    assert np.all(h[:2, 3:6] == 0.0)


@pytest.mark.parametrize(
    ("make", "text"),
    [(lambda: Velocity([1.0, 0.0]), "must not decrease"),
     (lambda: Velocity([0.0], np.ones((2, 3))), "expected 1 rows"),
     (lambda: Velocity([0.0], sigma=-1.0), "not negative"),
     (lambda: Velocity([0.0], (np.nan, 0.0, 0.0)), "finite"),
     (lambda: Velocity([0.0], estimate=("scale",)), "cannot estimate scale"),
     (lambda: Velocity([0.0], lever=(1.0, 2.0)), "lever arm"),
     (lambda: Height([0.0, 1.0], [1.0, 2.0, 3.0]), "expected 2 numbers"),
     (lambda: Handling(robust="median"), "robust must be"),
     (lambda: Handling(gate=1.5), "quantile"),
     (lambda: Handling(adaptive=2.0), "adaptive")],
)  # fmt: skip
def test_bad_measurements(make, text):
    with pytest.raises(InputError, match=text):
        make()
