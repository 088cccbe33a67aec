"""Heights, headings, Doppler velocities and given rest as measurements of the filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, BodyVelocity, GnssFixes, HeadingFixes, Height, ZeroRate
from schuler.aiding.checks import check_speed, inside
from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.errors import InputError
from schuler.ins import BodyVelocity as VelocityRows
from schuler.ins import GroupNoise, Handling, Measurement
from schuler.ins import Heading as HeadingRows
from schuler.ins import Height as HeightRows
from schuler.ins import ZeroRate as ZeroRateRows
from schuler.record import ImuRecord

__all__ = ["AIDS", "Aid", "DopplerRows", "aid_noise", "aid_priors", "left_out", "measurements_of"]

Array = NDArray[np.float64]

Aid = BodyVelocity | HeadingFixes | Height | ZeroRate
AIDS = (BodyVelocity, HeadingFixes, Height, ZeroRate)

_LEVER = 1.0
"""1-sigma of a lever arm that is estimated, m."""


@dataclass(frozen=True, eq=False)
class DopplerRows(VelocityRows):
    """Velocities of a Doppler log: their scale and mounting are told apart from an odometer's."""

    LABEL: ClassVar[str] = "dvl"


def measurements_of(
    aids: Sequence[Aid], record: ImuRecord, gnss: GnssFixes, handling: Handling
) -> list[Measurement]:
    """Return what the filter takes of aids, within a record.

    Parameters
    ----------
    aids : sequence
    record : ImuRecord
    gnss : GnssFixes
        What velocities are held against.
    handling : Handling

    Raises
    ------
    InputError
        If an aid has nothing within the record, a name is there twice, or velocities have other
        units or axes than they are said to have.
    """
    names = [aid.name for aid in aids]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two aids have the name '{twice}': give one of them another")
    return [_rows(aid, record, gnss, handling) for aid in aids]


def _rows(aid: Aid, record: ImuRecord, gnss: GnssFixes, handling: Handling) -> Measurement:
    common: dict[str, Any] = {"name": aid.name, "handling": handling}
    if isinstance(aid, ZeroRate):
        time, rate, sigma = aid.means(record.time, record.gyro)
        time, rate = time[time > record.start], rate[time > record.start]
        if not len(time):
            raise InputError(
                f"{aid.name}: none of its spans lies within the record, from t = "
                f"{record.start:.9g} to {record.end:.9g} s"
            )
        return ZeroRateRows(time, rate, sigma, **common)
    time = np.asarray(aid.time)
    within = inside(aid.name, time, record, aid.clock)
    time, sigma = time[within], np.asarray(aid.sigma)[within]
    if isinstance(aid, Height):
        estimate = ("offset",) if aid.offset_sigma > 0.0 else ()
        return HeightRows(
            time, np.asarray(aid.height)[within], sigma, lever=aid.lever, estimate=estimate,
            **common,
        )  # fmt: skip
    if isinstance(aid, HeadingFixes):
        heading = np.asarray(aid.heading)[within]
        return HeadingRows(time, heading, sigma, baseline=aid.baseline, **common)
    mount = rotvec_to_quat(np.asarray(aid.mount, np.float64))
    velocity = np.asarray(aid.velocity)
    body = velocity @ quat_to_matrix(mount) / (1.0 + aid.scale)
    check_speed(BodySpeed(aid.time, body, name=aid.name), gnss)
    return DopplerRows(
        time, velocity[within], sigma, lever=aid.lever, mount=mount, scale=aid.scale,
        estimate=aid.estimate, **common,
    )  # fmt: skip


def aid_priors(aids: Sequence[Aid]) -> dict[str, float]:
    """Return 1-sigma of the groups of states of aids before anything is measured."""
    out: dict[str, float] = {}
    for aid in aids:
        if isinstance(aid, Height) and aid.offset_sigma > 0.0:
            out[f"{aid.name}.offset"] = aid.offset_sigma
        elif isinstance(aid, BodyVelocity):
            sigma = {"scale": aid.scale_sigma, "mount": aid.mount_sigma, "lever": _LEVER}
            out |= {f"{aid.name}.{part}": sigma[part] for part in aid.estimate}
    return out


def aid_noise(aids: Sequence[Aid]) -> dict[str, GroupNoise]:
    """Return how the states of aids change by themselves."""
    return {
        f"{aid.name}.offset": GroupNoise(
            sigma=aid.offset_sigma, time=aid.offset_time, source="disturbance"
        )
        for aid in aids
        if isinstance(aid, Height) and aid.offset_sigma > 0.0
    }


def left_out(aids: Sequence[Aid | BodySpeed]) -> list[str]:
    """Return in sentences which rows of aids were left out, and why."""
    out = []
    for aid in aids:
        dropped = {} if isinstance(aid, ZeroRate) else aid.dropped
        if dropped:
            said = ", ".join(f"{count} with {reason}" for reason, count in dropped.items())
            out.append(f"rows of {aid.name} were left out: {said}")
    return out
