"""Aided navigation of ``schuler navigate``: its options, and its run."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from schuler import __version__
from schuler.cli.aid_options import (
    BESIDE,
    beside_options,
    estimates_of,
    gnss_height_option,
    gnss_sigma_option,
    lever_of,
    read_beside,
    sigmas_of,
)
from schuler.cli.command import CONTRADICTED, echo, wants_text
from schuler.cli.common import Look, draw, emit_json, open_file, progress, say_warnings, working
from schuler.cli.parameters import InputFile, Number
from schuler.cli.path_output import PathOutput
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.navigation import AidedNavigation, Evaluation, Start
    from schuler.navigation.aid_measurements import Aid
    from schuler.sensors import ImuSpec
    from schuler.trajectory import Trajectory

__all__ = ["aiding_options", "navigate_with_aids", "taken"]

_KEYS = (
    "gnss", "gnss_sigma", "gnss_height", "gnss_topic", "lever", "delay", "odometer",
    "odometer_scale", "wheels", "odometer_lever", "nhc_lever", "dvl",
    "dvl_frame", "dvl_lever", *BESIDE, "aid_topic", "time_offset", "nhc", "zupt", "scale_states",
    "axes_states", "clock_drift", "estimate", "smooth", "outage", "vibration", "robust", "adaptive",
)  # fmt: skip
_OFFSETS = ("gnss", "odometer", "dvl", "height", "heading")


def aiding_options(function: Any) -> Any:
    """Add the options of aided navigation to a command."""
    options = [
        click.option(
            "--gnss", type=InputFile(), metavar="FILE",
            help="GNSS fixes: NMEA, u-blox, NovAtel, RTKLIB, KF-GINS, PSINS, ULog, ROS, CSV, "
            "Parquet.",
        ),
        gnss_sigma_option("the file has none"),
        gnss_height_option("the file does not say it"),
        click.option(
            "--gnss-topic", metavar="NAME[,NAME]",
            help="Topics of the fixes and of their velocity, a log's message, or a .mat's array.",
        ),
        click.option("--lever", metavar="X,Y,Z", help="From IMU to antenna, m (body axes)."),
        click.option(
            "--delay", type=Number(-10.0, 10.0, unit="s"), metavar="S",
            help="A fix stamped t is valid at t - S.",
        ),
        click.option(
            "--odometer", type=InputFile(), metavar="FILE",
            help="Forward speed: time, and speed, pulses, distance, or fl, fr, rl, rr.",
        ),
        click.option(
            "--odometer-scale", type=Number(above=0.0, unit="m"), metavar="M",
            help="Metres to a pulse of --odometer.",
        ),
        click.option(
            "--wheels", type=click.Choice(["rear", "front", "all"]),
            help="Of four wheels, which --odometer is the mean of (rear, the unsteered pair).",
        ),
        click.option(
            "--odometer-lever", metavar="X,Y,Z", help="From IMU to the wheels of --odometer, m."
        ),
        click.option(
            "--dvl", type=InputFile(), metavar="FILE",
            help="Velocity along a sensor's axes: time, vx, vy, vz, valid.",
        ),
        click.option(
            "--dvl-frame", type=click.Choice(["RFU", "FRD", "FLU"]),
            help="Where x, y, z of --dvl point (RFU; of a ROS bag FLU).",
        ),
        click.option("--dvl-lever", metavar="X,Y,Z", help="From IMU to that sensor, m."),
        *beside_options(),
        click.option(
            "--aid-topic", metavar="AID=NAME", multiple=True,
            help="Topic of odometer or dvl in a ROS bag.",
        ),
        click.option(
            "--time-offset", metavar="AID=S", multiple=True,
            help="Added to times of gnss, odometer, dvl, height or heading, to bring them to the "
            "record's clock.",
        ),
        click.option("--nhc/--no-nhc", default=False, help="Wheels move neither sideways nor up."),
        click.option(
            "--nhc-lever", metavar="X,Y,Z",
            help="From IMU to where wheels do not slip: the rear axle's middle, m.",
        ),
        click.option("--zupt/--no-zupt", default=False, help="Use rest that the record shows."),
        click.option(
            "--scale-states/--no-scale-states", default=False,
            help="Estimate scale factors of the sensors.",
        ),
        click.option(
            "--clock-drift", type=Number(0.0, 1e4, unit="ppm"), metavar="PPM",
            help="How fast the clocks of record and aids drift apart, 1-sigma: an estimated delay "
            "follows.",
        ),
        click.option(
            "--axes-states/--no-axes-states", default=None,
            help="Estimate misalignments of the sensors; where --spec has them by default.",
        ),
        click.option(
            "--estimate", metavar="LIST", help="Of delay, lever, mount, scale, with commas."
        ),
        click.option(
            "--smooth/--no-smooth", default=False, help="Smooth afterwards, over the whole record."
        ),
        click.option(
            "--outage", metavar="TIME/PERIOD[+SHIFT]",
            help="Withhold fixes for TIME in each PERIOD, as 15s/45s, and score the prediction.",
        ),
        click.option(
            "--vibration", type=Number(0.0, 10.0), metavar="M/S/SQRT(S)",
            help="Least velocity random walk on the vehicle (0.03).",
        ),
        click.option(
            "--robust", type=click.Choice(["huber", "igg3"]), help="Weigh down single rows."
        ),
        click.option(
            "--adaptive", type=Number(0.0, 0.9), metavar="SHARE",
            help="Share of an aid's noise learned anew from each fix (0.02), never below that "
            "stated.",
        ),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def taken(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of aided navigation, taken out of those of a command.

    Raises
    ------
    InputError
        If one of them is given without fixes.
    """
    out = {key: options.pop(key) for key in _KEYS}
    if out["gnss"] is None:
        # A zero is given, and no zero of an option is left out.
        given = [k for k in _KEYS if not (out[k] is None or out[k] is False or out[k] == ())]
        if given:
            raise InputError(f"--{given[0].replace('_', '-')} is for aided navigation: say --gnss")
    return out


def _time_offsets(aids: dict[str, Any]) -> dict[str, float]:
    """Return what is added to the times of each aid, s."""
    out: dict[str, float] = {}
    for text in aids["time_offset"]:
        name, _, seconds = text.partition("=")
        try:
            value = float(seconds.strip().removesuffix("s"))
        except ValueError:
            value = math.nan
        if name not in _OFFSETS or not math.isfinite(value) or name in out:
            raise InputError(
                f"--time-offset: expected one of {', '.join(_OFFSETS)} once, and seconds, as "
                f"gnss=-18, got '{text}'"
            )
        if aids[f"{name}_file" if name in ("height", "heading") else name] is None:
            raise InputError(f"--time-offset {text}: no such aid is given")
        out[name] = value
    return out


def _topics(aids: dict[str, Any]) -> dict[str, str]:
    """Return the topics of odometer and Doppler log."""
    out: dict[str, str] = {}
    for text in aids["aid_topic"]:
        name, _, topic = text.partition("=")
        if name not in ("odometer", "dvl") or not topic or name in out or aids[name] is None:
            raise InputError(
                f"--aid-topic: expected odometer or dvl, which is given, once with a topic, as "
                f"dvl=/odom, got '{text}'"
            )
        out[name] = topic
    return out


def _other_aids(
    aids: dict[str, Any], own: tuple[str, ...], offsets: dict[str, float], topic: str | None
) -> list[Aid]:
    """Read heights, headings and Doppler velocities."""
    from schuler.io import read_dvl

    out: list[Aid] = []
    if aids["dvl"] is not None:
        lever = lever_of(aids["dvl_lever"], "--dvl-lever")
        out.append(
            read_dvl(aids["dvl"], frame=aids["dvl_frame"], lever=lever, estimate=own,
                     offset=offsets.get("dvl", 0.0), topic=topic)
        )  # fmt: skip
    return [*out, *read_beside(aids, offsets)]


def navigate_with_aids(
    options: dict[str, Any], aids: dict[str, Any], start: Start | None, spec: ImuSpec | None,
    truth: Trajectory | None, outputs: tuple[PathOutput, Any, Any],
) -> int:  # fmt: skip
    """Run an aided navigation and say what came of it; return the exit code."""
    from schuler.aiding.clock import utc_of_zero
    from schuler.io import read_gnss, read_speed
    from schuler.navigation import AidingOptions, Outages, evaluate, navigate_aided
    from schuler.record import ImuRecord

    out, json_to, report_to = outputs
    wanted = estimates_of(aids["estimate"])
    rolling = aids["odometer"] is not None or aids["dvl"] is not None
    if "scale" in wanted and not rolling:
        raise InputError("--estimate scale is that of --odometer or --dvl: give one")
    if "mount" in wanted and not (rolling or aids["nhc"]):
        raise InputError("--estimate mount needs --nhc, --odometer or --dvl, which show it")
    offsets, topics = _time_offsets(aids), _topics(aids)
    for option, file in (
        ("dvl_frame", "dvl"), ("dvl_lever", "dvl"), ("odometer_scale", "odometer"),
        ("wheels", "odometer"), ("odometer_lever", "odometer"),
    ):  # fmt: skip
        if aids[option] is not None and aids[file] is None:
            raise InputError(
                f"--{option.replace('_', '-')} goes with --{file.replace('_', '-')}: give one"
            )
    if aids["nhc_lever"] is not None and not aids["nhc"]:
        raise InputError("--nhc-lever goes with --nhc: give it")
    sigma, v_sigma = sigmas_of(aids["gnss_sigma"])
    topic, _, velocity_topic = (aids["gnss_topic"] or "").partition(",")
    gnss = read_gnss(
        aids["gnss"], lever=lever_of(aids["lever"], "--lever"), delay=aids["delay"] or 0.0,
        estimate=tuple(sorted(wanted & {"delay", "lever"})), sigma=sigma, v_sigma=v_sigma,
        height=aids["gnss_height"], offset=offsets.get("gnss", 0.0),
        topic=topic or None, velocity_topic=velocity_topic or None, variable=topic or None,
    )  # fmt: skip
    own = tuple(sorted(wanted & {"mount", "scale"}))
    speeds = [] if aids["odometer"] is None else [
        read_speed(aids["odometer"], estimate=own, offset=offsets.get("odometer", 0.0),
                   topic=topics.get("odometer"), pulse_length=aids["odometer_scale"],
                   wheels=aids["wheels"],
                   lever=lever_of(aids["odometer_lever"], "--odometer-lever"))
    ]  # fmt: skip
    more_aids = _other_aids(aids, own, offsets, topics.get("dvl"))
    outages = None if aids["outage"] is None else Outages.parse(aids["outage"])
    more = {} if aids["vibration"] is None else {"vibration": aids["vibration"]}
    axle = lever_of(aids["nhc_lever"], "--nhc-lever")
    chosen = AidingOptions(
        non_holonomic=aids["nhc"], constraint_lever=axle, zero_velocity=aids["zupt"],
        scale=aids["scale_states"], axes=aids["axes_states"], robust=aids["robust"],
        smooth=aids["smooth"], clock_drift=1e-6 * (aids["clock_drift"] or 0.0),
        adaptive=aids["adaptive"] or 0.0, **more,
    )  # fmt: skip
    begin, end = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    look = Look(source)
    with progress(source, source.chunks(start=begin, stop=end)) as chunks:
        record = ImuRecord.concatenate(list(look.through(chunks)), quality=source.quality)
    with working("navigating", len(record)) as watch:
        found = navigate_aided(
            record, gnss, start=start, spec=spec, speeds=speeds, aids=more_aids, options=chosen,
            outages=outages, watch=watch,
        )  # fmt: skip
    evaluation = None
    if truth is not None:
        # At the samples: a reference may have more rows than there are epochs.
        evaluation = evaluate(replace(out, every=1).of_aided(found, record), truth)
    zero = utc_of_zero(gnss.clock, gnss.epoch)
    utc = None if zero is None else zero - offsets.get("gnss", 0.0)
    out.write(out.of_aided(found, record), utc)
    if json_to is not None:
        emit_json(_data(found, source, evaluation), json_to)
    draw(found, report_to, evaluation=evaluation)
    if wants_text():
        echo(str(found))
        if evaluation is not None:
            echo(_against(found, evaluation))
    finish()
    for note in (note for speed in speeds for note in speed.notes):
        echo(f"note: {speeds[0].name}: {note}", err=True)
    quality = list(source.quality.warnings()) if source.quality else []
    say_warnings([*quality, *look.notes(None, at_rest=False), *found.warnings])
    if spec is None:
        say_warnings([f"no specification was given: {found.spec.name}"])
    say_warnings(source.contradictions)
    return CONTRADICTED if source.contradictions or not found.consistent else 0


def _against(found: AidedNavigation, evaluation: Evaluation) -> str:
    """Say how far a path is from its reference, and whether its sigma says so."""
    from schuler.navigation.evaluate import normalised_rms

    e = evaluation.to_dict()
    rms = e["rms_m"]
    ratio = normalised_rms(evaluation, found.path)["position"]
    return (
        f"error     {rms['east']:.3g} m east, {rms['north']:.3g} north, {rms['up']:.3g} up, rms "
        f"against {evaluation.reference}; {ratio:.2f} of its sigma rms"
    )


def _data(found: AidedNavigation, source: Any, evaluation: Evaluation | None) -> dict[str, Any]:
    from schuler.navigation.evaluate import normalised_rms

    error = None
    if evaluation is not None:
        error = {
            **evaluation.to_dict(), "normalised_rms": normalised_rms(evaluation, found.path)
        }  # fmt: skip
    return {
        "schema": "schuler.navigation/3", "schuler": __version__, "file": str(source.path),
        **source.how_read(), "gravity": "somigliana", "vertical": "free", "alignment": None,
        "error": error, **found.to_dict(),
    }  # fmt: skip
