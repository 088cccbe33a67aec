"""Scale factor and mounting of a Doppler log: simulated with its sigma, and thirteen real runs."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from schuler.aiding import BodyVelocity
from schuler.attitude import euler_to_quat, multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.calibration import fit_body_velocity
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io import read_dvl, read_trajectory, write_trajectory
from schuler.trajectory import Trajectory
from tests.conftest import chi_square_band

LEVER = np.array([0.4, 1.5, -0.3])


def path(n=2001):
    """Return 200 s of a vehicle that turns, climbs and drifts sideways."""
    t = 0.1 * np.arange(n)
    psi, pitch, roll = (
        0.02 * t + 0.3 * np.sin(0.1 * t),
        0.1 * np.sin(0.15 * t),
        0.2 * np.sin(0.2 * t),
    )
    quat = euler_to_quat(np.column_stack([psi, pitch, roll]))
    body = np.column_stack([0.5 * np.sin(0.13 * t), 2.0 + 0.3 * np.sin(0.05 * t),
                            0.3 * np.cos(0.17 * t)])  # fmt: skip
    v_n = np.einsum("iab,ib->ia", quat_to_matrix(quat), body)
    flat = np.zeros(n)
    return Trajectory(t, flat + 0.6, flat, flat, v_n, quat), body


def log(seed, scale=0.015, mount=(0.03, -0.02, 0.7), sigma=0.02, every=10):
    trajectory, body = path()
    rng = np.random.default_rng(seed)
    step = multiply(trajectory.quat_nb[:-1] * [1, -1, -1, -1], trajectory.quat_nb[1:])
    rate = np.vstack([quat_to_rotvec(step) / 0.1, np.zeros(3)])
    rows = slice(5, -5, every)
    there = (body + np.cross(rate, LEVER))[rows]
    seen = (1.0 + scale) * there @ quat_to_matrix(rotvec_to_quat(np.array(mount))).T
    seen += sigma * rng.standard_normal(seen.shape)
    return trajectory, BodyVelocity(trajectory.time[rows], seen, sigma, lever=LEVER)


def test_what_was_put_in_comes_out():
    trajectory, dvl = log(0, sigma=0.0 + 1e-9)
    fit = fit_body_velocity(replace(dvl, sigma=0.01), trajectory)
    # Rates of the reference come from its own steps, half a step off.
    assert fit.scale == pytest.approx(0.015, abs=1e-4)
    assert fit.mount == pytest.approx([0.03, -0.02, 0.7], abs=3e-4)
    assert fit.gain == pytest.approx(1.0 / 1.015, abs=1e-4)
    assert fit.warnings == ()


def test_sigma_are_those_of_the_errors():
    """40 runs: normalised squares of scale and the three angles within the 99.9 % band."""
    squares, runs = np.zeros(4), 40
    true = rotvec_to_quat(np.array([0.03, -0.02, 0.7]))
    for seed in range(runs):
        trajectory, dvl = log(seed, sigma=0.03)
        fit = fit_body_velocity(dvl, trajectory)
        off = quat_to_rotvec(multiply(rotvec_to_quat(fit.mount), true * [1, -1, -1, -1]))
        squares += np.square(
            np.concatenate([[(fit.scale - 0.015) / fit.scale_sigma], off / fit.mount_sigma])
        )
    low, high = chi_square_band(runs, 0.001)
    assert np.all((low < squares) & (squares < high)), squares


def test_far_rows_are_left_out():
    trajectory, dvl = log(1)
    velocity = np.array(dvl.velocity)
    velocity[::20] += 1.0
    fit = fit_body_velocity(replace(dvl, velocity=velocity), trajectory)
    assert fit.left_out == len(velocity[::20])
    assert fit_body_velocity(replace(dvl, velocity=velocity), trajectory, leave_out=0).left_out == 0
    with pytest.raises(InputError, match="leave_out"):
        fit_body_velocity(dvl, trajectory, leave_out=0.9)
    assert fit.scale == pytest.approx(0.015, abs=4e-3)


def test_what_does_not_show_is_said():
    trajectory, dvl = log(2)
    straight = np.column_stack(
        [0 * trajectory.time, 2.0 + 0 * trajectory.time, 0 * trajectory.time]
    )
    trajectory = replace(
        trajectory, v_n=np.einsum("iab,ib->ia", quat_to_matrix(trajectory.quat_nb), straight)
    )
    seen = np.tile([0.0, 2.02, 0.0], (len(dvl), 1))
    seen += 0.01 * np.random.default_rng(3).standard_normal(seen.shape)
    fit = fit_body_velocity(BodyVelocity(dvl.time, seen), trajectory)
    assert any("mounting about forward is not observable" in text for text in fit.warnings)
    assert fit.mount_sigma[1] > 100.0 * fit.mount_sigma[2]
    # Of all rotations about forward the least is taken.
    assert np.abs(fit.mount).max() < 0.05
    assert fit.warnings == fit.warnings[:1]


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda v: 3.6 * v, "with a factor of 3.6"),
     (lambda v: np.roll(v, 50, axis=0)[:, [1, 2, 0]] + np.sin(np.arange(len(v)))[:, None],
      "are the clock, the axes and the units right")],
)  # fmt: skip
def test_what_no_rotation_explains_is_refused(change, words):
    trajectory, dvl = log(4, mount=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match=words):
        fit_body_velocity(replace(dvl, velocity=change(np.array(dvl.velocity))), trajectory)


def test_left_handed_axes_are_named():
    trajectory, _ = path()
    t = trajectory.time
    v_n = 2.0 * np.column_stack([np.sin(0.1 * t), np.cos(0.1 * t), np.sin(0.07 * t)])
    trajectory = replace(trajectory, v_n=v_n)
    body = np.einsum("iba,ib->ia", quat_to_matrix(trajectory.quat_nb), v_n)
    assert fit_body_velocity(BodyVelocity(t, body), trajectory).residual_rms < 1e-9
    with pytest.raises(InputError, match="left-handed: one of them has its sign turned"):
        fit_body_velocity(BodyVelocity(t, body * [1.0, 1.0, -1.0]), trajectory)


def test_a_wrong_frame_is_warned_of():
    trajectory, dvl = log(5, mount=(0.0, 0.0, 0.0))
    fit = fit_body_velocity(replace(dvl, frame="FRD"), trajectory)
    assert any("its frame is another" in text for text in fit.warnings)


def test_spans_apart_and_rest_are_refused():
    trajectory, dvl = log(6)
    with pytest.raises(InputError, match="share 0 rows"):
        fit_body_velocity(replace(dvl, time=np.asarray(dvl.time) + 1e4), trajectory)
    with pytest.raises(InputError, match="nothing shows"):
        fit_body_velocity(dvl, replace(trajectory, v_n=1e-3 * trajectory.v_n))
    with pytest.raises(InputError, match="has no attitude"):
        fit_body_velocity(dvl, replace(trajectory, quat_nb=None))


def test_the_command(tmp_path, root):
    from click.testing import CliRunner

    from schuler.cli.calibrate import command

    trajectory, dvl = log(7)
    frd = np.asarray(dvl.velocity)[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    table = np.column_stack([np.asarray(dvl.time) + 3.0, frd])
    np.savetxt(tmp_path / "dvl.csv", table, "%.9g", ",", header="time,vx,vy,vz", comments="")
    write_trajectory(trajectory, tmp_path / "ref.csv")
    args = ["dvl", str(tmp_path / "dvl.csv"), "--reference", str(tmp_path / "ref.csv"), "--frame",
            "FRD", "--lever", "0.4,1.5,-0.3", "--time-offset", "-3"]  # fmt: skip
    ran = CliRunner().invoke(command, [*args, "--json", "-"], catch_exceptions=False)
    data = json.loads(ran.stdout)
    schema = json.loads((root / "docs" / "calibrate-dvl.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(data)
    assert data["scale"] == pytest.approx(0.015, abs=4 * data["scale_sigma"])
    assert data["mount_deg"][2] * DEG == pytest.approx(0.7, abs=0.01)
    ran = CliRunner().invoke(command, args, catch_exceptions=False)
    assert "scale factor +0.0" in ran.stdout
    with pytest.raises(InputError, match="--lever: expected three numbers"):
        CliRunner().invoke(command, [*args[:-4], "--lever", "1,2"], catch_exceptions=False)


@pytest.mark.realdata
def test_thirteen_real_runs(data_dir):
    """A Doppler log in the sea beside its vehicle's navigation: scale, mounting and residual.

    Of runs 1, 5, 9 and 12 an independent computation by least squares of the reference on the log
    had factors of 0.982 to 0.992 and mountings of at most 2.3 deg.
    """
    folder = data_dir / "akit_auv_dvl"
    scales, residuals = [], []
    for k in range(1, 14):
        dvl = read_dvl(folder / f"DVL_trajectory{k}.csv.gz", frame="FRD")
        reference = read_trajectory(folder / f"GT_trajectory{k}.csv.gz")
        fit = fit_body_velocity(dvl, reference)
        scales.append(fit.scale)
        residuals.append(fit.residual_rms)
        assert fit.left_out <= 40
        if k in (1, 5, 9, 12):
            whole = fit_body_velocity(dvl, reference, leave_out=0.0)
            assert 0.9815 < whole.reverse_gain < 0.9925
            assert np.abs(whole.mount[2]) < 2.35 * DEG
            assert 0.01 < whole.residual_rms < 0.18
            assert whole.left_out == 0
    assert np.max(np.abs(scales)) < 0.02
    assert np.std(scales) < 0.008
    assert min(residuals) > 0.01
    assert max(residuals) < 0.18
