"""The filter of an aided navigation: its start, priors, noise and measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes, Rests, find_rest, no_overlap
from schuler.aiding.checks import check_speed, inside
from schuler.constants import DEG, DEG_PER_HOUR
from schuler.earth import Site
from schuler.ins import (
    BodyVelocity,
    CustomMeasurement,
    GroupNoise,
    Handling,
    Layout,
    Measurement,
    NonHolonomic,
    Position,
    ProcessNoise,
    Velocity,
    ZeroRate,
    ZeroVelocity,
    instability_walk,
    instrument_noise,
    instrument_prior,
)
from schuler.navigation.aid_estimates import WITHHELD
from schuler.navigation.aiding_options import AidingOptions
from schuler.navigation.motion_start import motion_start
from schuler.navigation.start import Start
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec

__all__ = [
    "CONSTRAINT", "GATE", "PRIORS", "Begin", "begin_of", "bias_at_rest", "common_span",
    "fix_measurements", "noise_of", "output_times", "prior_of", "rests_of", "sensor_groups",
]  # fmt: skip

Array = NDArray[np.float64]

_NO_WEIGHT = 1e7
"""Sigma (m) of a fix that teaches nothing."""

GATE = 0.999999
"""Quantile of chi-square that a fix may reach."""

PRIORS = {"lever": 1.0, "delay": 0.3, "mount": 10.0 * DEG, "scale": 0.02}
"""1-sigma of what is estimated of an aid before anything is measured: m, s, rad, 1."""

CONSTRAINT = "non_holonomic"
"""Name of the constraint of wheels."""

_COARSE = 30.0 * DEG_PER_HOUR
"""A gyro with a larger bias is started from what it reads at rest: the Earth's rate is less."""


def common_span(record: ImuRecord, gnss: GnssFixes) -> tuple[ImuRecord, GnssFixes]:
    """Return the record from the first fix in it on, and the fixes within it."""
    time = np.asarray(gnss.time)
    inside = (time > record.start) & (time <= record.end)
    if inside.sum() < 4:
        span = float(time[0]), float(time[-1])
        raise no_overlap(gnss.name, gnss.clock, span, (record.start, record.end))
    return record, gnss.rows(inside)


def rests_of(record: ImuRecord, gnss: GnssFixes) -> Rests:
    """Return when the vehicle stood still, by the samples and by the fixes."""
    return find_rest(record, moving=gnss.moving)


def bias_at_rest(record: ImuRecord, rests: Rests, spec: ImuSpec) -> tuple[Array, Array]:
    """Return the gyro bias to start from, and its 1-sigma, rad/s."""
    prior = np.full(3, np.maximum(spec.gyro.by_axis("bias"), 1e-9))
    if spec.gyro.bias < _COARSE or not len(rests.spans):
        return np.zeros(3), prior
    early = rests.time <= rests.spans[0, 1] + 30.0
    mean = rests.rate[early].mean(axis=0)
    sigma = rests.rate_sigma / np.sqrt(early.sum())
    # The Earth's rate is in it, and the bias is not that of the whole record.
    return mean, np.minimum(prior, np.hypot(np.hypot(sigma, 20.0 * DEG_PER_HOUR), 0.05 * prior))


@dataclass(frozen=True, eq=False)
class Begin:
    """Where a navigation starts, and 1-sigma of its attitude, velocity and position."""

    time: float
    site: Site
    quat_nb: Array
    v_n: Array
    sigma: Array
    v_sigma: Array
    r_sigma: Array


def begin_of(
    record: ImuRecord, gnss: GnssFixes, start: Start | None, bias: Array, spec: ImuSpec
) -> Begin:
    """Return where, how fast and how turned the vehicle was at the first fix."""
    first = float(np.asarray(gnss.time)[0])
    k = int(np.searchsorted(record.time, first - 1e-9))
    first = float(record.time[k])
    lat, lon, height = (float(np.asarray(x)[0]) for x in (gnss.lat, gnss.lon, gnss.height))
    place = Site(lat / DEG, lon / DEG, height)
    lever = float(np.linalg.norm(gnss.lever)) + (1.0 if "lever" in gnss.estimate else 0.0)
    r_sigma = np.hypot(np.asarray(gnss.sigma)[0], 5.0 + lever)
    v_n, v_sigma = np.zeros(3), np.full(3, 50.0)
    if gnss.v_n is not None:
        v_n = np.asarray(gnss.v_n)[0]
        v_sigma = np.hypot(np.asarray(gnss.v_sigma)[0], 0.5 + 0.05 * float(np.linalg.norm(v_n)))
    if start is None:
        found = motion_start(record.between(first, None), gnss, spec, bias)
        sigma = np.maximum(2.0 * found.sigma, [1.5 * DEG, 1.5 * DEG, 3.0 * DEG])
        return Begin(first, place, found.quat_nb, v_n, sigma, v_sigma, r_sigma)
    sigma = np.array([1.0, 1.0, 5.0]) * DEG
    if start.covariance is not None:
        sigma = np.sqrt(np.diag(np.asarray(start.covariance, np.float64))[:3])
    quat = np.asarray(start.quat_nb, np.float64)
    if gnss.v_n is None:
        v_n = np.asarray(start.v_n, np.float64)
    return Begin(first, place, quat, v_n, sigma, v_sigma, r_sigma)


def fix_measurements(
    record: ImuRecord, used: GnssFixes, withheld: GnssFixes | None, speeds: Sequence[BodySpeed],
    rests: Rests, options: AidingOptions, bias: Array, delays: dict[str, float],
) -> list[Measurement]:  # fmt: skip
    """Return the measurements of the filter; fixes at the times at which they are valid."""
    handling = Handling(gate=GATE, robust=options.robust, adaptive=options.adaptive)
    out: list[Measurement] = []
    # Position and velocity share the lever arm; a receiver filters its velocity, which is later.
    common: dict[str, Any] = {
        "lever": used.lever, "estimate": used.estimate, "handling": handling,
    }  # fmt: skip

    def valid(fixes: GnssFixes, name: str) -> tuple[Array, NDArray[np.bool_]]:
        time = np.asarray(fixes.time) - delays[name]
        within = (time > record.start) & (time <= record.end)
        return time[within], within

    time, within = valid(used, used.name)
    place = np.column_stack([used.lat, used.lon, used.height])
    sigma = np.asarray(used.sigma)
    out.append(Position(time, place[within], sigma[within], name=used.name, **common))
    if used.v_n is not None:
        name = f"{used.name}_velocity"
        time, within = valid(used, name)
        v_n, sigma = np.asarray(used.v_n)[within], np.asarray(used.v_sigma)[within]
        out.append(Velocity(time, v_n, sigma, name=name, shared={"lever": used.name}, **common))
    if withheld is not None:
        time, within = valid(withheld, used.name)
        place = np.column_stack([withheld.lat, withheld.lon, withheld.height])
        out.append(
            Position(
                time, place[within], _NO_WEIGHT, name=WITHHELD, lever=used.lever,
                estimate=used.estimate, shared={"lever": used.name, "delay": used.name},
            )
        )  # fmt: skip
    for speed in speeds:
        value, sigma = speed.triples()
        within = inside(speed.name, np.asarray(speed.time), record)
        check_speed(speed, used)
        mount = "xyz" if np.asarray(speed.value).ndim == 2 else "xz"
        estimate, shared_mount = speed.estimate, {}
        if mount == "xz" and options.non_holonomic and "mount" in options.constraint_estimate:
            # Wheels roll along the axis across which they do not slip: one mounting for both.
            estimate = tuple(dict.fromkeys([*estimate, "mount"]))
            shared_mount = {"mount": CONSTRAINT}
        out.append(
            BodyVelocity(
                np.asarray(speed.time)[within], value[within], sigma[within], name=speed.name,
                lever=speed.lever, estimate=estimate, mount_axes=mount, handling=handling,
                shared=shared_mount,
            )
        )  # fmt: skip
    if options.non_holonomic:
        times = _constraint_times(record, options.constraint_interval, bias)
        out.append(
            NonHolonomic(
                times, 0.0, 2.0 * options.constraint_sigma, name=CONSTRAINT,
                lever=options.constraint_lever, estimate=options.constraint_estimate,
                handling=Handling(gate=0.9999963, robust=options.robust),
            )
        )  # fmt: skip
    if options.zero_velocity:
        still = rests.time[rests.time > record.start + rests.window]
        if len(still):
            # Between rests there is none to take for long: that says nothing of the navigation.
            handling = replace(handling, guard_time=np.inf)
            rate = rests.rate[-len(still) :]
            out.append(ZeroVelocity(still, 0.0, 0.02, name="zero_velocity", handling=handling))
            sigma = np.maximum(rests.rate_sigma, 1e-9)
            out.append(ZeroRate(still, rate, sigma, name="zero_rate", handling=handling))
    return out


def _constraint_times(record: ImuRecord, interval: float, bias: Array) -> Array:
    """Return when wheels surely roll: not while the vehicle turns fast."""
    each = max(round(interval / float(np.median(record.dt))), 1)
    count = len(record) // each
    turn = (record.gyro[: count * each] - bias).reshape(count, each, 3).mean(axis=1)
    slow = np.linalg.norm(turn, axis=1) < 20.0 * DEG
    return np.asarray(record.time[each - 1 : count * each : each][slow])


def output_times(
    record: ImuRecord, aids: Sequence[Measurement | CustomMeasurement], longest: float
) -> Array:
    """Return instants that leave no longer interval without an epoch, the record's end with it."""
    times = [np.asarray(aid.time, np.float64) for aid in aids]
    edges = np.unique(np.concatenate([[record.start], *times, [record.end]]))
    edges = edges[(edges >= record.start) & (edges <= record.end)]
    out = [] if any(record.end in each for each in times) else [np.array([record.end])]
    for k in np.flatnonzero(np.diff(edges) > 1.5 * longest):
        count = int(np.ceil((edges[k + 1] - edges[k]) / longest))
        wanted = np.linspace(edges[k], edges[k + 1], count + 1)[1:-1]
        # On samples: a row of the path there is one of the record.
        out.append(record.time[np.searchsorted(record.time, wanted - 1e-9)])
    return np.unique(np.concatenate(out)) if out else np.zeros(0)


def sensor_groups(options: AidingOptions, spec: ImuSpec | None) -> list[str]:
    """Return the groups of the sensors' errors beside their biases.

    `spec` is that of the user: one that is assumed says nothing of the axes.
    """
    out = []
    for sensor in ("gyro", "accelerometer"):
        axes = options.axes
        if axes is None:
            errors = None if spec is None else getattr(spec, sensor)
            axes = errors is not None and bool(errors.misalignment or errors.non_orthogonality)
        # A matrix has the scale factors on its diagonal.
        if axes or options.scale:
            out.append(f"{sensor}_{'matrix' if axes else 'scale'}")
    return out


def noise_of(
    layout: Layout, spec: ImuSpec, options: AidingOptions, aids: Mapping[str, GroupNoise],
    span: float,
) -> ProcessNoise:  # fmt: skip
    """Return the noise of a specification on a vehicle that vibrates, and that of aids.

    `span` is the length of the record, s.
    """
    noise = {**instrument_noise(layout, spec), **aids}
    for group in layout:
        if group.endswith(".delay") and options.clock_drift:
            noise[group] = GroupNoise(options.clock_drift**2 * span)
    white = max(spec.accelerometer.white, options.vibration)
    noise["velocity"] = replace(noise["velocity"], walk=white**2)
    for group, least in (("gyro_bias", 1e-7), ("accelerometer_bias", 1e-7)):
        part = spec.gyro if group == "gyro_bias" else spec.accelerometer
        walk = np.asarray(noise[group].walk) + instability_walk(part, span)
        noise[group] = GroupNoise(
            np.maximum(walk, (least * part.bias) ** 2), source=noise[group].source
        )
    return ProcessNoise.of(layout, noise)


def prior_of(
    layout: Layout, spec: ImuSpec, options: AidingOptions, begin: Begin, bias_sigma: Array,
    aids: Mapping[str, Any],
) -> Array:  # fmt: skip
    """Return 1-sigma of each state at the start."""
    sigma: dict[str, Any] = {
        "phi": begin.sigma, "velocity": begin.v_sigma, "position": begin.r_sigma,
        **instrument_prior(layout, spec), "gyro_bias": bias_sigma, **aids,
    }  # fmt: skip
    for k, (sensor, errors) in enumerate(
        (("gyro", spec.gyro), ("accelerometer", spec.accelerometer))
    ):
        scale = errors.scale_factor or options.scale_sigma[k]
        sigma[f"{sensor}_scale"] = scale
        across = float(np.hypot(errors.misalignment, errors.non_orthogonality))
        matrix = np.full((3, 3), across or options.axes_sigma[k])
        np.fill_diagonal(matrix, scale)
        sigma[f"{sensor}_matrix"] = matrix.ravel()
    out = np.zeros(layout.size)
    for group in layout:
        part = group.rpartition(".")[2]
        out[layout[group]] = sigma[group] if group in sigma else PRIORS[part]
    return out
