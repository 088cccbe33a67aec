"""`Prepared`: a span with its aids, aligned coarsely and then finely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes, HeadingFixes, ZeroVelocity
from schuler.alignment.moving.beside import Beside, turned_to
from schuler.alignment.moving.fine import FineAlignment, fine
from schuler.alignment.moving.setup import (
    Aid,
    Nominal,
    at_rest,
    measurements,
)
from schuler.attitude import nearest_quat, quat_to_matrix
from schuler.constants import STAMP_ROUNDING
from schuler.earth import Site, radii
from schuler.in_motion.coarse import ENOUGH, CoarseAlignment
from schuler.in_motion.start import Span
from schuler.ins import Measurement
from schuler.record import ImuRecord, Summariser
from schuler.sensors import ImuSpec

__all__ = ["Prepared", "Taken", "mean_square", "restamped"]

Array = NDArray[np.float64]


_VIBRATION = (0.003, 0.01, 0.03, 0.1)
"""Velocity random walks that are tried until the innovations agree, m/s/sqrt(s)."""

_NOISIER = 1.2
"""A record that has so much more noise than its specification is one of a vehicle that vibrates."""

_AGREES = 1.3
"""Mean squared normalised innovation up to which the noise is what it was said to be."""

_PROMPT = 0.005
"""A delay that is longer than this is taken off the stamps, s."""


@dataclass(frozen=True, eq=False)
class Taken:
    """What the filter took, and with which noise.

    `restamped` is what was taken off the stamps of each aid, s.
    """

    measured: tuple[Measurement, ...]
    restamped: dict[str, float]
    noise: float
    square: float


@dataclass(frozen=True, eq=False)
class Prepared:
    """A span, its aids and what is assumed of the instrument."""

    record: ImuRecord
    leader: Aid
    aids: list[Aid | Beside]
    spec: ImuSpec
    bias: Array
    site: Site
    rests: tuple[ZeroVelocity, ...] = ()

    def coarse(self) -> tuple[Aid, CoarseAlignment]:
        """Return the leader's measurements in the span, and the attitude at the start."""
        span = Span(self.record, self.leader, self.spec, self.bias, self.site)
        headings = [each for each in self.aids if isinstance(each, HeadingFixes)]
        if not headings:
            return span.coarse()
        # What the motion does not show of the heading, the fixes say.
        cut, found = span.coarse(np.inf)
        if found.heading_sigma > ENOUGH:
            found = turned_to(found, headings[0], self.record, self.bias)
        return cut, found

    def nominal(self, rough: CoarseAlignment) -> Nominal:
        """Return where the filter starts: the first measurement, and the coarse attitude."""
        quat = nearest_quat(rough.mat_nb)
        lat, lon, height = self.site.latitude, self.site.longitude, self.site.height
        leader, mat = self.leader, quat_to_matrix(quat)
        rate = self.record.dtheta[0] / self.record.dt[0] - self.bias
        arm = np.asarray(leader.lever, np.float64)
        turning = mat @ np.cross(rate, arm)
        if isinstance(leader, GnssFixes):
            k = int(np.searchsorted(
                np.asarray(leader.time) - leader.delay, self.record.start - STAMP_ROUNDING
            ))  # fmt: skip
            east, north, up = (float(x) for x in mat @ arm)
            meridian, transverse = (float(r) for r in radii(lat))
            lat -= north / (meridian + height)
            lon -= east / ((transverse + height) * np.cos(lat))
            height -= up
            if leader.v_n is not None:
                v_n = np.asarray(leader.v_n)[k] - turning
            else:
                place, time = leader.local(), np.asarray(leader.time)
                v_n = (place[k + 1] - place[k]) / (time[k + 1] - time[k])
        else:
            k = int(np.searchsorted(np.asarray(leader.time), self.record.start - STAMP_ROUNDING))
            v_n = mat @ leader.triples()[0][k] - turning
        return Nominal(lat, lon, height, quat, v_n, {"gyro_bias": self.bias})

    def _vibrations(self) -> list[float]:
        """Return the velocity random walks to try: first that of the samples' own scatter."""
        summariser = Summariser()
        summariser.push(self.record)
        seen = summariser.summary().noise_accel
        first = seen if seen > _NOISIER * self.spec.accelerometer.white else 0.0
        return [first, *(each for each in _VIBRATION if each > first)]

    def fine(
        self, rough: CoarseAlignment, cut: Aid, vibration: float | None
    ) -> tuple[FineAlignment, Taken]:
        """Return the filter's result with the noise that its innovations agree with."""
        aids: list[Aid | Beside] = [cut if aid is self.leader else aid for aid in self.aids]
        measured = measurements(aids, self.record) + at_rest(self.rests, self.record)
        start = self.nominal(rough)
        # A coarse gyro turns by degrees within the span: linear is what the coarse stage left.
        about = replace(start, parameters={
            **start.parameters, "gyro_bias": self.bias + rough.gyro_bias,
            "accelerometer_bias": rough.accelerometer_bias,
        })  # fmt: skip
        for noise in self._vibrations() if vibration is None else (vibration,):
            found = fine(self.record, start, self.spec, noise, measured, aids, nominal=about)
            square = mean_square(found, measured)
            if square < _AGREES:
                break
        late = _delays(found, measured)
        moved = any(abs(each) > _PROMPT for each in late.values())
        if moved:
            # A delay is linear in the filter only where it is small: the stamps take most of it.
            measured = [restamped(each, late.get(each.label, 0.0), self.record)
                        for each in measured]  # fmt: skip
            found = fine(self.record, start, self.spec, noise, measured, aids, nominal=about)
            square = mean_square(found, measured)
        return found, Taken(tuple(measured), late if moved else {}, noise, square)


def _delays(found: FineAlignment, measured: Sequence[Measurement]) -> dict[str, float]:
    """Return the delay that was found of each aid whose delay is estimated, s."""
    return {
        aid.label: aid.delay + float(found.end.parameters[f"{aid.label}.delay"][0])
        for aid in measured if f"{aid.label}.delay" in found.end.layout
    }  # fmt: skip


def restamped(aid: Measurement, late: float, record: ImuRecord) -> Measurement:
    """Return measurements with stamps that are earlier by a delay; what is left is estimated."""
    if not late:
        return aid
    time = np.asarray(aid.time) - late
    inside = (time >= record.start) & (time <= record.end)
    cut: dict[str, Any] = {
        name: np.asarray(getattr(aid, name))[inside] for name in ("value", "sigma")
        if np.ndim(getattr(aid, name)) and len(getattr(aid, name)) == len(time)
    }  # fmt: skip
    return replace(aid, time=time[inside], delay=0.0, **cut)


def mean_square(found: FineAlignment, measured: Sequence[Measurement]) -> float:
    """Return the mean squared normalised innovation of what was taken."""
    total, count = 0.0, 0
    for aid in measured:
        _, z, sigma, weight = found.filter.innovations(aid.label)
        good = (sigma > 0.0) & (weight > 0.0)[:, None]
        total += float(np.sum((z[good] / sigma[good]) ** 2))
        count += int(good.sum())
    return total / max(count, 1)
