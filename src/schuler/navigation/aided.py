"""Navigation of a vehicle that moves, aided by whatever else was measured.

A record, GNSS fixes, speeds and constraints go through one `schuler.ins.ErrorStateFilter`. Fixes
that are withheld (`Outages`) are predicted and compared, never used: the score of a result on its
own record.

Source: Groves (2013), chapters 14 and 16; Niu et al. (2025) for scale factors as states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes
from schuler.aiding.checks import check_clock
from schuler.constants import DEG
from schuler.ins import (
    CustomMeasurement,
    ErrorStateFilter,
    Handling,
    Layout,
    OutputEpoch,
    groups_of,
)
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
from schuler.navigation.aided_setup import (
    GATE,
    PRIORS,
    begin_of,
    bias_at_rest,
    common_span,
    fix_measurements,
    noise_of,
    output_times,
    prior_of,
    rests_of,
    sensor_groups,
)
from schuler.navigation.aiding_options import AidingOptions
from schuler.navigation.outages import Outages
from schuler.navigation.start import Start
from schuler.record import ImuRecord
from schuler.sensors import CONSUMER_MEMS, ImuSpec, load_spec

__all__ = ["navigate_aided"]

Array = NDArray[np.float64]

_DELAY_LEFT, _DELAY_PASSES = 0.01, 3
"""A delay (s) that a pass finds beyond the first is taken off the times, so many times at most."""

_WATCHED = 100_000
"""Samples between two words of progress; any chunking gives the same bits."""

_BEYOND = 5.0
"""Prior sigmas beyond which an estimate is not what it was meant to be."""

#: what a record without a specification is taken for
UNSPECIFIED = CONSUMER_MEMS


def navigate_aided(
    record: ImuRecord,
    gnss: GnssFixes,
    *,
    start: Start | None = None,
    spec: ImuSpec | str | Path | None = None,
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
    spec : ImuSpec, str or path, optional
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

    Examples
    --------
    >>> from schuler.navigation import AidingOptions, navigate_aided
    >>> path = navigate_aided(drive, gnss, spec=spec, options=AidingOptions(smooth=True)).path
    >>> path.quat_nb.shape[1]
    4
    """
    options = options or AidingOptions()
    record, gnss = common_span(record, gnss)
    check_clock(record, gnss)
    rests = rests_of(record, gnss)
    spec = load_spec(spec)
    instrument = spec or UNSPECIFIED
    bias, bias_sigma = bias_at_rest(record, rests, instrument)
    # Of the bias that rest did not show, the coarse stage has to know.
    left = replace(instrument, gyro=replace(instrument.gyro, bias=float(bias_sigma.max())))
    begin = begin_of(record, gnss, start, bias, left)
    record = record.between(begin.time, None)
    used, withheld = (gnss, None) if outages is None else outages.divide(gnss, record.start)
    known = [aid for aid in aids if isinstance(aid, AIDS)]
    own = [aid for aid in aids if not isinstance(aid, AIDS)]
    handling = Handling(gate=GATE, robust=options.robust, adaptive=options.adaptive)
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
        measured = fix_measurements(record, used, withheld, speeds, rests, options, bias, delays)
        measured += measurements_of(known, record, used, handling)
        layout = Layout([
            "phi", "velocity", "position", "gyro_bias", "accelerometer_bias",
            *sensor_groups(options, spec),
            *dict.fromkeys(group for aid in measured for group in aid.groups),
            *((group.name, group.size) for group in added.values()),
        ])  # fmt: skip
        noise = noise_of(
            layout, instrument, options, {**aid_noise(known), **own_noise}, record.duration
        )
        prior = prior_of(layout, instrument, options, begin, bias_sigma, priors)
        covariance = np.diag(prior**2)
        more = output_times(record, [*measured, *own], options.longest_interval)
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
        known = part in PRIORS or group.endswith(("_scale", "_matrix"))
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
            (aids if part in PRIORS else sensors).append(text)
    return aids, sensors
