"""What an aided navigation has estimated beside the path, with its 1-sigma, in words and units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import multiply, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.ins import BodyVelocity, ErrorStateFilter, Height, Measurement, groups_of
from schuler.navigation.aid_measurements import DopplerRows
from schuler.units import significant

__all__ = ["WITHHELD", "estimate_rows", "estimates", "levers"]

Array = NDArray[np.float64]

WITHHELD = "withheld"
"""Name of the fixes of outages: the filter predicts them and learns nothing from them."""

_UNITS = {"_s": "s", "_m": "m", "_deg": "deg", "_deg_h": "deg/h", "_ug": "ug"}


def estimate_rows(estimated: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return names and values with 1-sigma of what was estimated, in words."""
    out: list[tuple[str, str]] = []
    for name, value in estimated.items():
        if name == "own":
            out += estimate_rows(value)
            continue
        if isinstance(value, Mapping):
            out += estimate_rows({f"{key} {name}": each for key, each in value.items()})
            continue
        plain, unit = name, ""
        for end, said in _UNITS.items():
            if name.endswith(end):
                plain, unit = name.removesuffix(end), f" {said}"
        centre, sigma = (np.atleast_1d(np.asarray(x, np.float64)) for x in value)
        told = ", ".join(
            f"{significant(c, 4)} ± {significant(s, 2)}" for c, s in zip(centre, sigma, strict=True)
        )
        out.append((plain.replace("_", " "), told + unit))
    return out


def levers(flt: ErrorStateFilter, measured: Sequence[Measurement]) -> dict[str, Array]:
    """Return the lever arm of each aid that has a point of the body."""
    out = {}
    for aid in measured:
        if "lever" in aid.STATES and aid.label != WITHHELD:
            group = aid.group("lever")
            more = flt.parameter(group) if group in flt.layout else 0.0
            out[aid.label] = np.asarray(aid.lever, np.float64) + more
    return out


def estimates(
    flt: ErrorStateFilter, measured: Sequence[Measurement], delays: Mapping[str, float]
) -> dict[str, Any]:
    """Return what was estimated with its 1-sigma: smoothed at the end equals the filter.

    `delays` were taken off the times of fixes, by the aid's name: a state is what is left of one.
    """
    sigma = np.sqrt(np.maximum(np.diag(flt.covariance), 0.0))
    layout = flt.layout
    out: dict[str, Any] = {}

    def pair(group: str, given: Any = 0.0, unit: float = 1.0) -> list[Any]:
        value = (np.asarray(given, np.float64) + flt.parameter(group)) / unit
        spread = sigma[layout[group]] / unit
        if len(value) == 1:
            return [float(value[0]), float(spread[0])]
        return [[float(v) for v in value], [float(s) for s in spread]]

    for aid in measured:
        for group, _ in aid.groups:
            if not group.startswith(f"{aid.label}.") or aid.label == WITHHELD:
                continue
            part = group.rpartition(".")[2]
            if part == "delay":
                out.setdefault("delay_s", {})[aid.label] = pair(
                    group, delays.get(aid.label, aid.delay)
                )
            elif part == "lever":
                out.setdefault("lever_m", {})[aid.label] = pair(group, aid.lever)
            elif part == "offset" and isinstance(aid, Height):
                out.setdefault("offset_m", {})[aid.label] = pair(group, aid.offset)
            elif part == "scale" and isinstance(aid, DopplerRows):
                out.setdefault("doppler_scale", {})[aid.label] = pair(group, aid.scale)
            elif part == "mount" and isinstance(aid, DopplerRows):
                out.setdefault("doppler_mount_deg", {})[aid.label] = _rotation(
                    flt, aid, group, sigma
                )
            elif part == "scale" and isinstance(aid, BodyVelocity):
                out["odometer_scale"] = pair(group, aid.scale)
            elif part == "mount" and isinstance(aid, BodyVelocity):
                out.setdefault("mount_deg", {}).update(_mount(flt, aid, group, sigma))
    for name in groups_of(flt.aids):
        out.setdefault("own", {})[name] = pair(name)
    out["gyro_bias_deg_h"] = pair("gyro_bias", 0.0, DEG_PER_HOUR)
    out["accel_bias_ug"] = pair("accelerometer_bias", 0.0, MICRO_G)
    for group, name in (("gyro_scale", "gyro_scale"), ("accelerometer_scale", "accel_scale")):
        if group in layout:
            out[name] = pair(group)
    for sensor, name in (("gyro", "gyro"), ("accelerometer", "accel")):
        group = f"{sensor}_matrix"
        if group in layout:
            value, spread = (np.array(x).reshape(3, 3) for x in pair(group))
            across = ~np.eye(3, dtype=bool)
            out[f"{name}_scale"] = [np.diag(x).tolist() for x in (value, spread)]
            out[f"{name}_axes_deg"] = [(x[across] / DEG).tolist() for x in (value, spread)]
    return out


def _rotation(
    flt: ErrorStateFilter, aid: DopplerRows, group: str, sigma: Array
) -> list[list[float]]:
    """Return the rotation vector from the body's axes to the sensor's, and its 1-sigma, deg."""
    turn = multiply(rotvec_to_quat(flt.parameter(group)), np.asarray(aid.mount))
    whole = quat_to_rotvec(turn)
    return [[float(x) / DEG for x in whole], [float(x) / DEG for x in sigma[flt.layout[group]]]]


def _mount(
    flt: ErrorStateFilter, aid: BodyVelocity, group: str, sigma: Array
) -> dict[str, list[float]]:
    """Return how the body's axes are turned against the vehicle's, deg.

    Yaw is positive where the body's forward axis points left of travel, pitch where it points
    below it, roll where its right side is up.
    """
    value, spread = flt.parameter(group), sigma[flt.layout[group]]
    out = {}
    for k, axis in enumerate(aid.mount_axes):
        name, sign = {"x": ("pitch", -1.0), "y": ("roll", -1.0), "z": ("yaw", 1.0)}[axis]
        out[name] = [sign * float(value[k]) / DEG, float(spread[k]) / DEG]
    return out
