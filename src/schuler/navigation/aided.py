"""Navigation of a vehicle that moves, aided by whatever else was measured.

A record, GNSS fixes, speeds and constraints go through one `schuler.ins.ErrorStateFilter`. Fixes
that are withheld (`Outages`) are predicted and compared, never used: the score of a result on its
own record.

Source: Groves (2013), chapters 14 and 16; Niu et al. (2025) for scale factors as states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding import BodySpeed, GnssFixes, Rests, find_rest, no_overlap
from schuler.aiding.checks import check_clock, check_speed, inside
from schuler.constants import DEG, DEG_PER_HOUR
from schuler.earth import Site
from schuler.ins import (
    BodyVelocity,
    CustomMeasurement,
    ErrorStateFilter,
    GroupNoise,
    Handling,
    Layout,
    Measurement,
    NonHolonomic,
    OutputEpoch,
    Position,
    ProcessNoise,
    Velocity,
    ZeroRate,
    ZeroVelocity,
    groups_of,
    instrument_noise,
    instrument_prior,
)
from schuler.navigation.aid_estimates import WITHHELD
from schuler.navigation.aid_measurements import (
    AIDS,
    Aid,
    DopplerRows,
    aid_noise,
    aid_priors,
    left_out,
    measurements_of,
)
from schuler.navigation.aided_result import OUTPUT, AidedNavigation, finished
from schuler.navigation.motion_start import motion_start
from schuler.navigation.navigator import Start
from schuler.navigation.outages import Outages
from schuler.record import ImuRecord
from schuler.sensors import CONSUMER_MEMS, ImuSpec

__all__ = ["AidingOptions", "navigate_aided"]

Array = NDArray[np.float64]

_NO_WEIGHT = 1e7
"""Sigma (m) of a fix that teaches nothing."""

_GATE = 0.999999
"""Quantile of chi-square that a fix may reach."""

_DELAY_LEFT, _DELAY_PASSES = 0.01, 3
"""A delay (s) that a pass finds beyond the first is taken off the times, so many times at most."""

_WATCHED = 100_000
"""Samples between two words of progress; any chunking gives the same bits."""

_VIBRATION = 0.03
"""Velocity random walk of a strapdown unit on a road vehicle, m/s/sqrt(s), at least."""

_PRIORS = {"lever": 1.0, "delay": 0.3, "mount": 10.0 * DEG, "scale": 0.02}
"""1-sigma of what is estimated of an aid before anything is measured: m, s, rad, 1."""

_CONSTRAINT = "non_holonomic"
"""Name of the constraint of wheels."""

_BEYOND = 5.0
"""Prior sigmas beyond which an estimate is not what it was meant to be."""

_COARSE = 30.0 * DEG_PER_HOUR
"""A gyro with a larger bias is started from what it reads at rest: the Earth's rate is less."""

#: what a record without a specification is taken for
UNSPECIFIED = CONSUMER_MEMS


@dataclass(frozen=True)
class AidingOptions:
    """What is used beside the fixes, and what is estimated.

    Parameters
    ----------
    non_holonomic : bool
        A wheeled vehicle moves neither sideways nor up.
    constraint_sigma : float
        Of that, m/s.
    constraint_interval : float
        Time between two such measurements, s: side slips are correlated.
    constraint_lever : (3,) array_like
        From the IMU to the rear axle's middle, body axes, m.
    constraint_estimate : tuple of str
        Of "mount" and "lever".
    zero_velocity : bool
        Use rest that the record shows: no velocity, and no rate but the Earth's.
    scale : bool
        Estimate scale factors of gyros and accelerometers.
    scale_sigma : (float, float)
        Their 1-sigma before, gyros and accelerometers, where the specification has none.
    vibration : float
        Velocity random walk on the vehicle, m/s/sqrt(s); the specification's where that is larger.
    robust : {None, "huber", "igg3"}
    smooth : bool
        Smooth afterwards.
    longest_interval : float
        Time between rows of output where nothing is measured, s; half as much more is let pass.
    """

    non_holonomic: bool = False
    constraint_sigma: float = 0.1
    constraint_interval: float = 0.25
    constraint_lever: ArrayLike = (0.0, 0.0, 0.0)
    constraint_estimate: tuple[str, ...] = ("mount",)
    zero_velocity: bool = False
    scale: bool = False
    scale_sigma: tuple[float, float] = (0.01, 0.02)
    vibration: float = _VIBRATION
    robust: str | None = None
    smooth: bool = False
    longest_interval: float = 1.0


def navigate_aided(
    record: ImuRecord,
    gnss: GnssFixes,
    *,
    start: Start | None = None,
    spec: ImuSpec | None = None,
    speeds: Sequence[BodySpeed] = (),
    aids: Sequence[Aid | CustomMeasurement] = (),
    options: AidingOptions | None = None,
    outages: Outages | None = None,
    watch: Callable[[float], None] | None = None,
) -> AidedNavigation:
    """Navigate a record with the help of GNSS fixes and whatever else was measured.

    Parameters
    ----------
    record : ImuRecord
    gnss : GnssFixes
        On the record's clock.
    start : Start, optional
        Attitude and velocity at the first fix within the record; found from rest and the first
        motion when not given.
    spec : ImuSpec, optional
        The instrument; a MEMS of consumer grade when not given.
    speeds : sequence of BodySpeed
    aids : sequence of Height, HeadingFixes, BodyVelocity, ZeroRate or CustomMeasurement
        Of `schuler.aiding`, or a user's own, which may bring states (`schuler.ins.StateGroup`).
    options : AidingOptions, optional
    outages : Outages, optional
        Spans whose fixes are withheld, and scored.
    watch : callable, optional
        Is told now and then which share of the record is done; more than once where a delay that
        is found makes another pass.

    Raises
    ------
    InputError
        If fixes and record have no common span, or show no start.
    """
    options = options or AidingOptions()
    record, gnss = _common(record, gnss)
    check_clock(record, gnss)
    rests = _rests(record, gnss)
    instrument = spec or UNSPECIFIED
    bias, bias_sigma = _bias_at_rest(record, rests, instrument)
    begin = _begin(record, gnss, start, bias)
    record = record.between(begin.time, None)
    used, withheld = (gnss, None) if outages is None else outages.divide(gnss, record.start)
    known = [aid for aid in aids if isinstance(aid, AIDS)]
    own = [aid for aid in aids if not isinstance(aid, AIDS)]
    handling = Handling(gate=_GATE, robust=options.robust)
    added = groups_of(own)
    own_noise = {name: group.noise for name, group in added.items()}
    priors: dict[str, Any] = {
        **{f"{speed.name}.scale": speed.scale_sigma for speed in speeds}, **aid_priors(known),
        **{name: group.sigma for name, group in added.items()},
    }  # fmt: skip
    starts = {name: group.start for name, group in added.items()}
    # Fixes are taken when they are valid: a delay that is found to be long is taken off the times,
    # and the record navigated again. A row of H is good to first order in what is left of it.
    delays = dict.fromkeys((used.name, f"{used.name}_velocity"), used.delay)
    for again in range(_DELAY_PASSES, -1, -1):
        measured = _measurements(record, used, withheld, speeds, rests, options, bias, delays)
        measured += measurements_of(known, record, used, handling)
        layout = Layout([
            "phi", "velocity", "position", "gyro_bias", "accelerometer_bias",
            *(["gyro_scale", "accelerometer_scale"] if options.scale else []),
            *dict.fromkeys(group for aid in measured for group in aid.groups),
            *((group.name, group.size) for group in added.values()),
        ])  # fmt: skip
        noise = _noise(layout, instrument, options, {**aid_noise(known), **own_noise})
        prior = _prior(layout, instrument, options, begin, bias_sigma, priors)
        covariance = np.diag(prior**2)
        more = _output_times(record, [*measured, *own], options.longest_interval)
        if len(more):
            measured.append(OutputEpoch(more, name=OUTPUT))
        flt = ErrorStateFilter(
            layout, begin.site, begin.quat_nb, covariance, noise, [*measured, *own],
            v_n=begin.v_n, parameters={"gyro_bias": bias, **starts}, smooth=options.smooth,
            step=0.1,
        )  # fmt: skip
        for begun in range(0, len(record), _WATCHED):
            flt.update(record.rows(begun, min(begun + _WATCHED, len(record))))
            if watch is not None:
                watch(min(1.0, (begun + _WATCHED) / len(record)))
        if not again or not _later(delays, flt, 2.0 * prior):
            break
    found = finished(flt, record, gnss, used, withheld, measured, instrument, outages, delays)
    contradictions, warnings = _against_priors(flt, np.sqrt(np.diag(covariance)))
    return replace(
        found, contradictions=(*found.contradictions, *contradictions),
        warnings=(*found.warnings, *warnings, *left_out([*speeds, *known])),
    )  # fmt: skip


def _later(delays: dict[str, float], flt: ErrorStateFilter, most: Array) -> bool:
    """Take what was found of delays into the times; return whether that is worth another pass.

    A delay beyond `most` is none: it stays where its contradiction is seen.
    """
    again = False
    for name in delays:
        group = f"{name}.delay"
        if group not in flt.layout:
            continue
        rest = float(flt.parameter(group)[0])
        if _DELAY_LEFT < abs(rest) < float(most[flt.layout[group]][0]):
            again = True
    if again:
        for name in delays:
            if f"{name}.delay" in flt.layout:
                delays[name] += float(flt.parameter(f"{name}.delay")[0])
    return again


def _against_priors(flt: ErrorStateFilter, prior: Array) -> tuple[list[str], list[str]]:
    """Hold each estimate against its own prior: of aids it contradicts, of sensors it is said."""
    aids: list[str] = []
    sensors: list[str] = []
    own = groups_of(flt.aids)
    doppler = {aid.group("mount") for aid in flt.aids if isinstance(aid, DopplerRows)}
    for group in flt.layout:
        part = group.rpartition(".")[2]
        known = part in _PRIORS or group.endswith("_scale")
        if not known or group in own:
            continue
        size = np.abs(flt.parameter(group)) / prior[flt.layout[group]]
        if np.max(size) <= _BEYOND:
            continue
        value = float(np.max(np.abs(flt.parameter(group))))
        if part == "mount" and group in doppler:
            aids.append(
                f"the axes of {group.partition('.')[0]} are turned by {value / DEG:.0f} deg more "
                "than its mounting is said to be: are its frame and its mounting right?"
            )
        elif part == "mount":
            aids.append(
                f"the body's axes are turned by {value / DEG:.0f} deg against the direction of "
                "travel: are the record's axes right (--axes)?"
            )
        else:
            told = f"the estimate of {group.replace('_', ' ').replace('.', ' ')} is {value:.3g}"
            text = f"{told}, {np.max(size):.0f} times the 1-sigma that it was given before"
            (aids if part in _PRIORS else sensors).append(text)
    return aids, sensors


def _common(record: ImuRecord, gnss: GnssFixes) -> tuple[ImuRecord, GnssFixes]:
    """Return the record from the first fix in it on, and the fixes within it."""
    time = np.asarray(gnss.time)
    inside = (time > record.start) & (time <= record.end)
    if inside.sum() < 4:
        span = float(time[0]), float(time[-1])
        raise no_overlap(gnss.name, gnss.clock, span, (record.start, record.end))
    return record, gnss.rows(inside)


def _rests(record: ImuRecord, gnss: GnssFixes) -> Rests:
    return find_rest(record, moving=gnss.moving)


def _bias_at_rest(record: ImuRecord, rests: Rests, spec: ImuSpec) -> tuple[Array, Array]:
    """Return the gyro bias to start from, and its 1-sigma, rad/s."""
    prior = np.full(3, max(spec.gyro.bias, 1e-9))
    if spec.gyro.bias < _COARSE or not len(rests.spans):
        return np.zeros(3), prior
    early = rests.time <= rests.spans[0, 1] + 30.0
    mean = rests.rate[early].mean(axis=0)
    sigma = rests.rate_sigma / np.sqrt(early.sum())
    # The Earth's rate is in it, and the bias is not that of the whole record.
    return mean, np.minimum(prior, np.hypot(np.hypot(sigma, 20.0 * DEG_PER_HOUR), 0.05 * prior))


@dataclass(frozen=True, eq=False)
class _Begin:
    time: float
    site: Site
    quat_nb: Array
    v_n: Array
    sigma: Array
    v_sigma: Array
    r_sigma: Array


def _begin(record: ImuRecord, gnss: GnssFixes, start: Start | None, bias: Array) -> _Begin:
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
        found = motion_start(record.between(first, None), gnss, bias)
        sigma = np.maximum(2.0 * found.sigma, [1.5 * DEG, 1.5 * DEG, 3.0 * DEG])
        return _Begin(first, place, found.quat_nb, v_n, sigma, v_sigma, r_sigma)
    sigma = np.array([1.0, 1.0, 5.0]) * DEG
    if start.covariance is not None:
        sigma = np.sqrt(np.diag(np.asarray(start.covariance, np.float64))[:3])
    quat = np.asarray(start.quat_nb, np.float64)
    if gnss.v_n is None:
        v_n = np.asarray(start.v_n, np.float64)
    return _Begin(first, place, quat, v_n, sigma, v_sigma, r_sigma)


def _measurements(
    record: ImuRecord, used: GnssFixes, withheld: GnssFixes | None, speeds: Sequence[BodySpeed],
    rests: Rests, options: AidingOptions, bias: Array, delays: dict[str, float],
) -> list[Measurement]:  # fmt: skip
    """Return the measurements of the filter; fixes at the times at which they are valid."""
    handling = Handling(gate=_GATE, robust=options.robust)
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
            shared_mount = {"mount": _CONSTRAINT}
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
                times, 0.0, 2.0 * options.constraint_sigma, name=_CONSTRAINT,
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


def _output_times(
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


def _noise(
    layout: Layout, spec: ImuSpec, options: AidingOptions, aids: Mapping[str, GroupNoise]
) -> ProcessNoise:
    noise = {**instrument_noise(layout, spec), **aids}
    white = max(spec.accelerometer.white, options.vibration)
    noise["velocity"] = replace(noise["velocity"], walk=white**2)
    for group, least in (("gyro_bias", 1e-7), ("accelerometer_bias", 1e-7)):
        part = spec.gyro if group == "gyro_bias" else spec.accelerometer
        # What is called bias instability wanders within minutes: a walk that reaches it in 300 s.
        wander = part.bias_instability**2 / 300.0
        walk = float(np.max(np.asarray(noise[group].walk))) + wander
        noise[group] = GroupNoise(max(walk, (least * part.bias) ** 2), source=noise[group].source)
    return ProcessNoise.of(layout, noise)


def _prior(
    layout: Layout, spec: ImuSpec, options: AidingOptions, begin: _Begin, bias_sigma: Array,
    aids: Mapping[str, Any],
) -> Array:  # fmt: skip
    """Return 1-sigma of each state at the start."""
    sigma: dict[str, Any] = {
        "phi": begin.sigma, "velocity": begin.v_sigma, "position": begin.r_sigma,
        **instrument_prior(layout, spec), "gyro_bias": bias_sigma, **aids,
    }  # fmt: skip
    if options.scale:
        gyro, accel = spec.gyro.scale_factor, spec.accelerometer.scale_factor
        sigma["gyro_scale"] = gyro or options.scale_sigma[0]
        sigma["accelerometer_scale"] = accel or options.scale_sigma[1]
    out = np.zeros(layout.size)
    for group in layout:
        part = group.rpartition(".")[2]
        out[layout[group]] = sigma[group] if group in sigma else _PRIORS[part]
    return out
