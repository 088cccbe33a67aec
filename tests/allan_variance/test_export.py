"""Noise for other tools: the files say the densities of the fit by each tool's own rule."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from schuler.allan_variance import Allan, ChannelFit, NoiseFit, NoiseTerm, densities, noise_text
from schuler.errors import InputError

RATE = 200.0
N_GYRO, K_GYRO, N_ACCEL, K_ACCEL = 2e-4, 3e-6, 4e-3, 5e-5


def channel(white: float, walk: float, unseen: bool = False, misfit: float = 0.0) -> ChannelFit:
    nothing = NoiseTerm(None, None, 1e-9, "-")
    terms = {
        "quantisation": nothing,
        "white": NoiseTerm(white, 0.01 * white, 1.02 * white, "-"),
        "bias_instability": nothing,
        "walk": NoiseTerm(None, None, walk, "-") if unseen else NoiseTerm(walk, 0.1 * walk, 0, "-"),
        "ramp": nothing,
    }
    return ChannelFit(terms, misfit, 1.0, 1)


def fit(**changes: object) -> NoiseFit:
    names = tuple(f"{part}_{axis}" for part in ("gyro", "accel") for axis in "xyz")
    curve = np.ones((2, 6))
    source = Allan(
        "allan", np.array([0.1, 1.0]), names, curve, curve, curve, curve, 1.0 / RATE, 4000,
        np.ones(2, np.int64),
    )  # fmt: skip
    return NoiseFit(source, {
        **{f"gyro_{a}": channel(N_GYRO, K_GYRO, **changes) for a in "xyz"},  # type: ignore[arg-type]
        **{f"accel_{a}": channel(N_ACCEL, K_ACCEL) for a in "xyz"},
    })  # fmt: skip


def numbers(text: str) -> dict[str, float]:
    """Return all ``key: value`` and parameter lines with one number."""
    found = re.findall(r"^ *(\w+): (-?[\d.e+-]+)(?: +#.*)?$", text, re.M)
    found += re.findall(r"^1\t1\t(\w+)\t([\d.e+-]+)\t9$", text, re.M)
    return {key: float(value) for key, value in found}


@pytest.mark.parametrize("tool", ["kalibr", "openvins"])
def test_kalibr_and_openvins_have_the_densities(tool: str) -> None:
    found = numbers(noise_text(fit(), tool, topic="/imu/data"))
    assert found["gyroscope_noise_density"] == pytest.approx(N_GYRO)
    assert found["gyroscope_random_walk"] == pytest.approx(K_GYRO)
    assert found["accelerometer_noise_density"] == pytest.approx(N_ACCEL)
    assert found["accelerometer_random_walk"] == pytest.approx(K_ACCEL)
    assert found["update_rate"] == RATE
    assert "rostopic: /imu/data\n" in noise_text(fit(), tool, topic="/imu/data")


def test_openvins_has_all_that_it_needs_to_start() -> None:
    text = noise_text(fit(), "openvins")
    assert text.startswith("%YAML:1.0\n")
    for key in ("T_i_b", "Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg"):
        assert re.search(rf"^  {key}:\n    - \[", text, re.M)


def test_vins_propagates_what_the_densities_say() -> None:
    """A second of its midpoint preintegration: velocity and bias gain N^2 and K^2."""
    found = numbers(noise_text(fit(), "vins"))
    dt, steps = 1.0 / RATE, round(RATE)
    for white, walk, n, k in (("acc_n", "acc_w", N_ACCEL, K_ACCEL),
                              ("gyr_n", "gyr_w", N_GYRO, K_GYRO)):  # fmt: skip
        velocity = steps * 2.0 * (0.5 * dt) ** 2 * found[white] ** 2
        assert velocity == pytest.approx(n**2, rel=1e-5)
        assert steps * dt**2 * found[walk] ** 2 == pytest.approx(k**2, rel=1e-5)


def test_px4_propagates_what_the_densities_say() -> None:
    """A second of EKF2's prediction at 10 ms; below the firmware's range the least value stands."""
    text = noise_text(fit(), "px4")
    found = numbers(text)
    dt, steps = 0.01, 100
    for name, density in (("EKF2_ACC_NOISE", N_ACCEL), ("EKF2_GYR_NOISE", N_GYRO),
                          ("EKF2_ACC_B_NOISE", K_ACCEL), ("EKF2_GYR_B_NOISE", K_GYRO)):  # fmt: skip
        assert steps * (found[name] * dt) ** 2 == pytest.approx(density**2, rel=1e-5)
    tiny = numbers(noise_text(fit(), "px4", inflate=1e-3))
    assert tiny["EKF2_ACC_NOISE"] == 0.01
    assert tiny["EKF2_GYR_NOISE"] == 0.0001


def test_ros_has_the_variances_of_a_sample() -> None:
    text = noise_text(fit(), "ros")
    found = dict(re.findall(r"^(\w+_covariance): \[(.*)\]$", text, re.M))
    for name, density in (("angular_velocity", N_GYRO), ("linear_acceleration", N_ACCEL)):
        matrix = np.reshape([float(v) for v in found[f"{name}_covariance"].split(",")], (3, 3))
        np.testing.assert_allclose(matrix, density**2 * RATE * np.eye(3), rtol=1e-6)


def test_what_was_not_seen_is_its_limit_and_is_said() -> None:
    found = densities(fit(unseen=True))
    assert found.gyro_walk.value == pytest.approx(K_GYRO)
    assert found.gyro_walk.seen == 0
    text = noise_text(fit(unseen=True), "kalibr")
    assert (
        "rad/s^2/sqrt(Hz); not seen in this record: the limit under which it is with 95 %" in text
    )


def test_inflation_is_in_the_values_and_said() -> None:
    text = noise_text(fit(), "kalibr", inflate=10.0)
    assert numbers(text)["gyroscope_noise_density"] == pytest.approx(10.0 * N_GYRO)
    assert "# All values are multiplied by 10." in text


def test_what_cannot_be_exported_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no tool 'matlab' to export to: kalibr, openvins"):
        noise_text(fit(), "matlab")
    with pytest.raises(InputError, match="positive factor, got 0"):
        noise_text(fit(), "kalibr", inflate=0.0)
    with pytest.raises(InputError, match="gyro_x, gyro_y, gyro_z: this is not the noise"):
        fit(misfit=0.9).export("kalibr", tmp_path / "imu.yaml")
    assert list(tmp_path.iterdir()) == []
    alone = NoiseFit(fit().source, {"gyro_x": channel(1.0, 1.0)})
    with pytest.raises(InputError, match="the noise of accelerometers is needed too"):
        noise_text(alone, "ros")
