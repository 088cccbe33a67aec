"""Fitted noise as the parameter files of other tools, each with the tool's own rule.

kalibr, openvins
    Continuous densities (`Densities`) and the rate; OpenVINS needs the intrinsic matrices too,
    identities where none are known.
vins
    Its preintegration (VINS-Mono, VINS-Fusion) takes two independent samples, each with half the
    interval: velocity gains (acc_n dt)^2 / 2 a sample, and the bias (acc_w dt)^2. So that these
    are the N^2 dt and K^2 dt of the densities, acc_n is N sqrt(2 / dt) and acc_w is K / sqrt(dt).
px4
    EKF2 predicts with (EKF2_ACC_NOISE dt)^2 of velocity and (EKF2_ACC_B_NOISE dt)^2 of bias at its
    own interval, 10 ms: the parameters are N / sqrt(dt) and K / sqrt(dt) at that interval.
ros
    The covariances of sensor_msgs/Imu are variances of a sample: N^2 times the rate.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from schuler._files import replacing
from schuler._version import __version__
from schuler.allan_variance.density import Densities, Density, densities
from schuler.allan_variance.noise_fit import NoiseFit
from schuler.errors import InputError, printable

__all__ = ["TOOLS", "export_noise", "noise_text"]

_PX4_INTERVAL = 0.01
"""Prediction interval of EKF2 (EKF2_PREDICT_US), s."""

#: name, what it holds (density, default of the firmware, least value that the firmware takes)
_PX4 = (
    ("EKF2_GYR_NOISE", "gyro_noise", 0.015, 0.0001, "rad/s"),
    ("EKF2_ACC_NOISE", "accel_noise", 0.35, 0.01, "m/s^2"),
    ("EKF2_GYR_B_NOISE", "gyro_walk", 0.001, 0.0, "rad/s^2"),
    ("EKF2_ACC_B_NOISE", "accel_walk", 0.003, 0.0, "m/s^3"),
)
_PX4_FLOAT = 9
"""Type of a parameter in a QGroundControl file: a 32-bit floating-point number."""

_KALIBR = (
    ("accelerometer_noise_density", "accel_noise", "m/s^2/sqrt(Hz)"),
    ("accelerometer_random_walk", "accel_walk", "m/s^3/sqrt(Hz)"),
    ("gyroscope_noise_density", "gyro_noise", "rad/s/sqrt(Hz)"),
    ("gyroscope_random_walk", "gyro_walk", "rad/s^2/sqrt(Hz)"),
)
_ADVICE = (
    "Noise at rest is the least that a filter should be told: vibration, scale factors and",
    "temperature are not in it. For low-cost (MEMS) units Kalibr's manual takes values ten times",
    "as large, or more: --inflate 10.",
)


def _head(d: Densities, inflated: float, rule: tuple[str, ...]) -> list[str]:
    lines = [
        f"# Noise of {printable(d.name)}, {d.duration:.6g} s at rest, by schuler {__version__}.",
        *(f"# {line}" for line in rule),
    ]
    if inflated != 1.0:
        lines.append(f"# All values are multiplied by {inflated:g}.")
    return lines


def _entries(d: Densities, indent: str) -> list[str]:
    """Return the four continuous densities, each under a comment: OpenVINS reads whole lines."""
    lines = []
    for key, name, unit in _KALIBR:
        density: Density = getattr(d, name)
        lines += [f"{indent}# {unit}; {density.origin}", f"{indent}{key}: {density.value:.6e}"]
    return lines


def _kalibr(d: Densities, inflated: float, topic: str) -> str:
    rule = ("Continuous-time densities, the rms over the axes.", *_ADVICE)
    lines = [
        *_head(d, inflated, rule), *_entries(d, ""), f"rostopic: {topic}",
        f"update_rate: {d.rate:.6g}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _matrix(name: str, diagonal: float, size: int = 3) -> list[str]:
    rows = [
        ", ".join(f"{diagonal if i == j else 0.0:.1f}" for j in range(size)) for i in range(size)
    ]
    return [f"  {name}:", *(f"    - [{row}]" for row in rows)]


def _openvins(d: Densities, inflated: float, topic: str) -> str:
    rule = (
        "kalibr_imu_chain.yaml: continuous-time densities, the rms over the axes.",
        *_ADVICE,
        "The matrices say that the unit is calibrated; OpenVINS does not start without them.",
    )
    lines = [
        "%YAML:1.0", *_head(d, inflated, rule), "imu0:", *_matrix("T_i_b", 1.0, 4),
        *_entries(d, "  "), f"  rostopic: {topic}", "  time_offset: 0.0",
        f"  update_rate: {d.rate:.6g}", '  model: "kalibr"', *_matrix("Tw", 1.0),
        *_matrix("R_IMUtoGYRO", 1.0), *_matrix("Ta", 1.0), *_matrix("R_IMUtoACC", 1.0),
        *_matrix("Tg", 0.0),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _vins(d: Densities, inflated: float, topic: str) -> str:
    rule = (
        "Standard deviations of a sample as the preintegration of VINS takes them, at the rate of",
        f"this record, {d.rate:.6g} Hz: acc_n = N sqrt(2 rate), acc_w = K sqrt(rate). Make them",
        "anew for another rate.",
        *_ADVICE,
    )
    white, walk = (2.0 * d.rate) ** 0.5, d.rate**0.5
    lines = [*_head(d, inflated, rule), f'imu_topic: "{topic}"']
    for key, density, factor, unit in (
        ("acc_n", d.accel_noise, white, "m/s^2"), ("gyr_n", d.gyro_noise, white, "rad/s"),
        ("acc_w", d.accel_walk, walk, "m/s^3"), ("gyr_w", d.gyro_walk, walk, "rad/s^2"),
    ):  # fmt: skip
        lines.append(f"{key}: {density.value * factor:.6e}  # {unit}; {density.origin}")
    return "\n".join(lines) + "\n"


def _px4(d: Densities, inflated: float, _: str) -> str:
    rule = (
        "Parameters of EKF2 for QGroundControl (vehicle, component, name, value, type): standard",
        "deviations at its prediction interval of 10 ms, N / sqrt(dt) and K / sqrt(dt).",
        "The defaults cover the vibration of an airframe, and a record on the bench does not: go",
        "below them only where the record was taken with the motors running.",
    )
    lines = _head(d, inflated, rule)
    for name, key, default, least, unit in _PX4:
        density: Density = getattr(d, key)
        value = density.value / _PX4_INTERVAL**0.5
        lines.append(
            f"# {unit}, default {default:g}; {density.origin}"
            + (f"; {value:.3g} raised to the least value" if value < least else "")
        )
        lines.append(f"1\t1\t{name}\t{max(value, least):.9g}\t{_PX4_FLOAT}")
    return "\n".join(lines) + "\n"


def _ros(d: Densities, inflated: float, topic: str) -> str:
    rule = (
        "Covariances of sensor_msgs/Imu, row by row: variances of a sample at the rate of this",
        f"record, {d.rate:.6g} Hz, which are N^2 times the rate. The first -1 says that the",
        "message has no orientation. Drift of the bias has no place in the message.",
        *_ADVICE,
    )

    def covariance(density: Density) -> str:
        v = f"{density.value**2 * d.rate:.6e}"
        return f"[{v}, 0.0, 0.0, 0.0, {v}, 0.0, 0.0, 0.0, {v}]"

    lines = [
        *_head(d, inflated, rule),
        f"imu_topic: {topic}",
        "orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
        f"# (rad/s)^2; {d.gyro_noise.origin}",
        f"angular_velocity_covariance: {covariance(d.gyro_noise)}",
        f"# (m/s^2)^2; {d.accel_noise.origin}",
        f"linear_acceleration_covariance: {covariance(d.accel_noise)}",
    ]
    return "\n".join(lines) + "\n"


#: tool -> what writes its file from densities, their factor and the topic
TOOLS: dict[str, Callable[[Densities, float, str], str]] = {
    "kalibr": _kalibr, "openvins": _openvins, "vins": _vins, "px4": _px4, "ros": _ros,
}  # fmt: skip


def noise_text(fit: NoiseFit, tool: str, *, inflate: float = 1.0, topic: str = "/imu0") -> str:
    """Return the text of a tool's file of noise parameters.

    Parameters
    ----------
    fit : NoiseFit
    tool : {"kalibr", "openvins", "vins", "px4", "ros"}
    inflate : float
        What all densities are multiplied by.
    topic : str
        Of the IMU's messages, for tools that name it.

    Raises
    ------
    InputError
        For another tool, a factor that is not positive, or a fit without gyros or accelerometers.

    Examples
    --------
    >>> noise_text(noise_fit, "kalibr").splitlines()[-1]
    'update_rate: 20'
    """
    if tool not in TOOLS:
        raise InputError(f"there is no tool '{tool}' to export to: {', '.join(TOOLS)}")
    return TOOLS[tool](densities(fit).times(inflate), inflate, topic)


def export_noise(
    fit: NoiseFit, tool: str, path: str | Path, *, inflate: float = 1.0, topic: str = "/imu0"
) -> None:
    """Write a tool's file of noise parameters, whole or not at all; see `noise_text`.

    Raises
    ------
    InputError
        As `noise_text`, or if the file cannot be written.

    Examples
    --------
    >>> export_noise(noise_fit, "kalibr", "imu.yaml", inflate=2.0)
    """
    text = noise_text(fit, tool, inflate=inflate, topic=topic)
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
