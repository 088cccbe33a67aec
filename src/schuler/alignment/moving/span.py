"""The span of an alignment in motion, and what lies before it: rest that shows a gyro bias."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes, find_rest, no_overlap
from schuler.alignment.moving.setup import Aid
from schuler.constants import DEG, DEG_PER_HOUR, STAMP_ROUNDING
from schuler.earth import Site
from schuler.errors import InputError
from schuler.in_motion.rotation import LEAST_ROWS
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["bias_at_rest", "common_span", "cut_span", "place_at_start"]

Array = NDArray[np.float64]

_COARSE_GYRO = 30.0 * DEG_PER_HOUR
"""A gyro with a larger bias is started from what it reads at rest: the Earth's rate is less."""

_LEAST_FOR_REST = 4.0
"""Less of a record shows no rest, s."""


def cut_span(record: ImuRecord, span: tuple[float | None, float | None] | None) -> ImuRecord:
    """Return the samples of a span."""
    begin, end = span or (None, None)
    if begin is not None and end is not None and not begin < end:
        raise InputError(f"a span ends after its begin, got {begin:g} to {end:g} s")
    out = record.between(begin, end)
    if len(out) < 2:
        raise InputError(
            f"the span from {begin} to {end} s holds no samples: the record goes from "
            f"{time_text(record.start)} to {time_text(record.end)} s"
        )
    return out


def common_span(record: ImuRecord, leader: Aid) -> ImuRecord:
    """Return the samples from the first measurement on."""
    time = np.asarray(leader.time) - getattr(leader, "delay", 0.0)
    inside = (time >= record.start - STAMP_ROUNDING) & (time <= record.end + STAMP_ROUNDING)
    if not np.any(inside):
        clock = leader.clock if isinstance(leader, GnssFixes) else "unstated"
        span = float(time[0]), float(time[-1])
        raise no_overlap(leader.name, clock, span, (record.start, record.end))
    if inside.sum() < LEAST_ROWS:
        raise InputError(
            f"{leader.name}: {int(inside.sum())} measurements lie between t = "
            f"{time_text(record.start)} "
            f"and {time_text(record.end)} s, and an alignment needs {LEAST_ROWS}: take a longer "
            "span"
        )
    # The sample in which the first measurement lies is the first one.
    k = int(np.searchsorted(record.time, float(time[inside][0]) + STAMP_ROUNDING))
    return record.rows(min(k, len(record) - 2), len(record))


def bias_at_rest(
    record: ImuRecord, part: ImuRecord, leader: Aid, spec: ImuSpec
) -> tuple[Array, ImuSpec]:
    """Return the gyro bias of a coarse instrument by rest before the span's end, and the prior."""
    # Only fixes and speeds tell rest from smooth motion: the record begins with the first one.
    if isinstance(leader, GnssFixes):
        moving = leader.moving
        if moving is None:
            return np.zeros(3), spec
    else:
        speed = np.linalg.norm(leader.triples()[0], axis=1)
        moving = np.asarray(leader.time, np.float64), speed > max(5.0 * leader.sigma, 0.2)
    time = moving[0]
    before = record.between(float(time[0]), part.end)
    if spec.gyro.bias < _COARSE_GYRO or before.duration < _LEAST_FOR_REST:
        return np.zeros(3), spec
    rests = find_rest(before, moving=moving)
    if not len(rests.time):
        return np.zeros(3), spec
    mean = rests.rate.mean(axis=0)
    sigma = float(np.max(rests.rate_sigma)) / np.sqrt(len(rests.time))
    # The Earth's rate is in it, and the bias is not that of the whole record.
    least = float(np.hypot(np.hypot(sigma, 20.0 * DEG_PER_HOUR), 0.05 * spec.gyro.bias))
    known = replace(spec, gyro=replace(spec.gyro, bias=min(spec.gyro.bias, least)))
    return mean, known


def place_at_start(leader: Aid, part: ImuRecord, site: Site | None) -> Site:
    """Return where the vehicle is at the first measurement."""
    if isinstance(leader, BodySpeed):
        if site is None:
            raise InputError(
                f"{leader.name}: a velocity in body axes does not say where the vehicle is: give "
                "the site (--lat, --lon, --height)"
            )
        return site
    k = int(np.searchsorted(np.asarray(leader.time) - leader.delay, part.start - STAMP_ROUNDING))
    lat, lon, height = (float(np.asarray(x)[k]) for x in (leader.lat, leader.lon, leader.height))
    return Site(lat / DEG, lon / DEG, height)
