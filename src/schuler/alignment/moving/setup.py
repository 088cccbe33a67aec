"""The aided filter of an alignment in motion: states, priors, noise, measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes
from schuler.aiding import BodyVelocity as BodyVelocityAid
from schuler.aiding import ZeroVelocity as RestSpans
from schuler.alignment.moving.beside import Beside, offset_noise, offset_priors, rows_beside
from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.constants import DEG, STAMP_ROUNDING
from schuler.earth import Site
from schuler.in_motion.start import Leader
from schuler.ins import (
    SOURCES,
    BodyVelocity,
    ErrorStateFilter,
    GroupNoise,
    Handling,
    Layout,
    Measurement,
    Position,
    ProcessNoise,
    Velocity,
    ZeroVelocity,
    instability_walk,
    instrument_noise,
    instrument_prior,
)
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec

__all__ = [
    "DIFFUSE",
    "Aid",
    "Nominal",
    "as_speed",
    "at_rest",
    "layout_of",
    "make_filter",
    "measurements",
    "prior_sigma",
    "process_noise",
]

Array = NDArray[np.float64]

Aid = Leader


def as_speed(aid: Aid | BodyVelocityAid) -> Aid:
    """Return the velocity of a Doppler log in the body's axes; other aids as they are."""
    if not isinstance(aid, BodyVelocityAid):
        return aid
    turn = quat_to_matrix(rotvec_to_quat(np.asarray(aid.mount, np.float64)))
    value = np.asarray(aid.velocity) @ turn / (1.0 + aid.scale)
    sigma = float(np.sqrt(np.mean(np.square(np.asarray(aid.sigma)))))
    return BodySpeed(
        aid.time, value, sigma, aid.scale_sigma, aid.lever, aid.estimate, aid.name, aid.dropped
    )


DIFFUSE: dict[str, Any] = {
    "phi": np.array([5.0, 5.0, 60.0]) * DEG, "velocity": 10.0, "position": 100.0,
}  # fmt: skip
"""1-sigma before anything is known: attitude (rad), velocity (m/s), position (m)."""

_PARTS = {"lever": 1.0, "delay": 0.3, "mount": 10.0 * DEG}
"""1-sigma of what is estimated of an aid: m, s, rad."""

_SIDEWAYS = 0.2
"""1-sigma of the velocity of wheels sideways and up, m/s: side slips are correlated."""

_LEAST_SCALE = 1e-6
"""1-sigma of a scale factor that is said to be exact."""

_GATE = 0.999999
"""Quantile of chi-square that a fix may reach."""

_SOURCES = (*SOURCES, "aiding")
"""Sources of the budget: those of the instrument, and the noise of what is measured."""


@dataclass(frozen=True, eq=False)
class Nominal:
    """Where a pass of the filter starts.

    Parameters
    ----------
    lat, lon, height : float
        rad, m.
    quat_nb : (4,) float64
        Body to East-North-Up.
    v_n : (3,) float64
        East, north, up, m/s.
    parameters : dict of str to array
        Estimates of the other groups.
    """

    lat: float
    lon: float
    height: float
    quat_nb: Array
    v_n: Array
    parameters: dict[str, Array]

    @property
    def site(self) -> Site:
        """The place."""
        return Site(self.lat / DEG, self.lon / DEG, self.height)


def measurements(
    aids: Sequence[Aid | Beside], record: ImuRecord, *, gate: bool = True
) -> list[Measurement]:
    """Return what the filter takes of the aids within a record."""
    handling = Handling(gate=_GATE if gate else None, source="aiding")
    out: list[Measurement] = []
    for aid in aids:
        if isinstance(aid, Beside):
            out.append(rows_beside(aid, record, handling))
            continue
        time = np.asarray(aid.time)
        inside = (time >= record.start - STAMP_ROUNDING) & (time <= record.end + STAMP_ROUNDING)
        if isinstance(aid, GnssFixes):
            fixes = aid.rows(inside)
            common: dict[str, Any] = {
                "lever": fixes.lever, "delay": fixes.delay, "estimate": fixes.estimate,
                "handling": handling,
            }  # fmt: skip
            place = np.column_stack([fixes.lat, fixes.lon, fixes.height])
            out.append(Position(fixes.time, place, fixes.sigma, name=fixes.name, **common))
            if fixes.v_n is not None:
                shared = {"lever": fixes.name}
                out.append(
                    Velocity(
                        fixes.time, fixes.v_n, fixes.v_sigma, name=f"{fixes.name}_velocity",
                        shared=shared, **common,
                    )
                )  # fmt: skip
            continue
        value, sigma = aid.triples()
        wheels = np.asarray(aid.value).ndim == 1
        if wheels:
            sigma = np.where(sigma > 0.0, sigma, _SIDEWAYS)
        out.append(
            BodyVelocity(
                time[inside], value[inside], sigma[inside], name=aid.name, lever=aid.lever,
                estimate=aid.estimate, mount_axes="xz" if wheels else "xyz", handling=handling,
            )
        )  # fmt: skip
    return out


def at_rest(rests: Sequence[RestSpans], record: ImuRecord) -> list[Measurement]:
    """Return what the filter takes of spans at rest within a record."""
    handling = Handling(gate=_GATE, source="aiding")
    out: list[Measurement] = []
    for rest in rests:
        time = rest.times(record.start, record.end)
        if len(time):
            out.append(ZeroVelocity(time, 0.0, rest.sigma, name=rest.name, handling=handling))
    return out


def layout_of(spec: ImuSpec, measured: Sequence[Measurement]) -> Layout:
    """Return the error states: navigation, biases, and what is estimated of aids."""
    markov = [
        f"{name}_markov"
        for name, part in (("gyro", spec.gyro), ("accelerometer", spec.accelerometer))
        if part.gauss_markov
    ]
    # A matrix has the scale factors on its diagonal.
    scale = [
        f"{name}_{'matrix' if part.misalignment else 'scale'}"
        for name, part in (("gyro", spec.gyro), ("accelerometer", spec.accelerometer))
        if part.scale_factor or part.misalignment
    ]
    return Layout([
        "phi", "velocity", "position", "gyro_bias", "accelerometer_bias", *markov, *scale,
        *dict.fromkeys(group for aid in measured for group in aid.groups),
    ])  # fmt: skip


def prior_sigma(
    layout: Layout,
    spec: ImuSpec,
    aids: Sequence[Aid | Beside],
    diffuse: dict[str, Any] | None = None,
) -> Array:
    """Return 1-sigma (n,) of each state before anything is measured."""
    sigma: dict[str, Any] = {**instrument_prior(layout, spec), **(diffuse or DIFFUSE)}
    for sensor, errors in (("gyro", spec.gyro), ("accelerometer", spec.accelerometer)):
        matrix = np.full((3, 3), errors.misalignment)
        np.fill_diagonal(matrix, max(errors.scale_factor, _LEAST_SCALE))
        sigma[f"{sensor}_matrix"] = matrix.ravel()
    sigma |= offset_priors(aids)
    for aid in aids:
        if isinstance(aid, GnssFixes):
            delays = (f"{aid.name}.delay", f"{aid.name}_velocity.delay")
            sigma |= dict.fromkeys(delays, aid.delay_sigma)
    scales = {aid.name: aid.scale_sigma for aid in aids if isinstance(aid, BodySpeed)}
    out = np.zeros(layout.size)
    for group in layout:
        name, _, part = group.rpartition(".")
        value = sigma.get(group)
        if value is None:
            value = scales[name] if part == "scale" else _PARTS[part]
        out[layout[group]] = value
    return out


def process_noise(
    layout: Layout, spec: ImuSpec, vibration: float, span: float,
    more: Mapping[str, GroupNoise] | None = None,
) -> ProcessNoise:  # fmt: skip
    """Return the noise of a specification, with no less velocity random walk than vibration's.

    `span` is the length of the record, s; `more` is the noise of other groups.
    """
    noise = instrument_noise(layout, spec)
    white = max(spec.accelerometer.white, vibration)
    noise["velocity"] = replace(noise["velocity"], walk=white**2)
    for group, part in (("gyro_bias", spec.gyro), ("accelerometer_bias", spec.accelerometer)):
        walk = np.asarray(noise[group].walk) + instability_walk(part, span)
        noise[group] = GroupNoise(walk, source=noise[group].source)
    return ProcessNoise.of(layout, {**noise, **(more or {})}, _SOURCES)


def make_filter(
    nominal: Nominal, spec: ImuSpec, vibration: float, measured: Sequence[Measurement],
    aids: Sequence[Aid | Beside], *, error_state: Array | float = 0.0, budget: bool = False,
    smooth: bool = False,
) -> ErrorStateFilter:  # fmt: skip
    """Return a filter that starts at a nominal with the diffuse prior, without feedback."""
    layout = layout_of(spec, measured)
    covariance = np.diag(prior_sigma(layout, spec, aids) ** 2)
    time = np.concatenate([np.asarray(aid.time, np.float64) for aid in measured])
    span = float(time.max() - time.min())
    return ErrorStateFilter(
        layout, nominal.site, nominal.quat_nb, covariance,
        process_noise(layout, spec, vibration, span, offset_noise(aids)), measured, v_n=nominal.v_n,
        error_state=error_state, parameters=nominal.parameters, feedback=False, budget=budget,
        smooth=smooth, keep_history=True,
    )  # fmt: skip
