"""Aided navigation of ``schuler navigate``: its options, and its run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler import __version__
from schuler.cli.command import CONTRADICTED, echo, wants_text
from schuler.cli.common import Look, emit_json, open_file, progress, say_warnings
from schuler.cli.parameters import InputFile, Number
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.navigation import AidedNavigation, Start
    from schuler.sensors import ImuSpec

__all__ = ["aiding_options", "navigate_with_aids", "taken"]

_KEYS = (
    "gnss", "gnss_sigma", "gnss_height", "gnss_offset", "gnss_topic", "lever", "delay", "odometer",
    "dvl", "nhc", "zupt", "scale_states", "estimate", "smooth", "outage", "vibration", "robust",
)  # fmt: skip
_ESTIMATES = ("delay", "lever", "mount", "scale")


def aiding_options(function: Any) -> Any:
    """Add the options of aided navigation to a command."""
    options = [
        click.option(
            "--gnss", type=InputFile(), metavar="FILE",
            help="GNSS fixes: NMEA, u-blox, NovAtel, RTKLIB, KF-GINS, PSINS, ULog, ROS, CSV, "
            "Parquet.",
        ),
        click.option(
            "--gnss-sigma", metavar="M,M/S",
            help="1-sigma of position and velocity, where the file has none (3,0.1).",
        ),
        click.option(
            "--gnss-height", type=click.Choice(["ellipsoid", "geoid"]),
            help="What the heights are above, where the file does not say it.",
        ),
        click.option(
            "--gnss-offset", type=Number(unit="s"), metavar="S",
            help="Added to the fixes' times, to bring them to the record's clock.",
        ),
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
            "--odometer", type=InputFile(), metavar="FILE", help="Forward speed: time, speed."
        ),
        click.option(
            "--dvl", type=InputFile(), metavar="FILE", help="Speed right, forward, up: vx, vy, vz."
        ),
        click.option("--nhc", is_flag=True, help="Wheels move neither sideways nor up."),
        click.option("--zupt", is_flag=True, help="Use rest that the record shows."),
        click.option("--scale-states", is_flag=True, help="Estimate scale factors of the sensors."),
        click.option(
            "--estimate", metavar="LIST", help="Of delay, lever, mount, scale, with commas."
        ),
        click.option("--smooth", is_flag=True, help="Smooth afterwards, over the whole record."),
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
        given = [key for key in _KEYS if out[key] is not None and out[key] is not False]
        if given:
            raise InputError(f"--{given[0].replace('_', '-')} is for aided navigation: say --gnss")
    return out


def _triple(text: str | None, option: str) -> tuple[float, float, float]:
    if text is None:
        return 0.0, 0.0, 0.0
    try:
        x, y, z = (float(cell) for cell in text.split(","))
    except ValueError:
        raise InputError(f"{option}: expected three numbers with commas, got '{text}'") from None
    return x, y, z


def _sigmas(text: str | None) -> tuple[float | None, float | None]:
    if text is None:
        return None, None
    try:
        position, speed = (float(cell.strip().rstrip("m/s")) for cell in text.split(","))
    except ValueError:
        raise InputError(f"--gnss-sigma: expected two numbers as 3,0.1, got '{text}'") from None
    if not (position > 0.0 and speed > 0.0):
        raise InputError(f"--gnss-sigma: both must be positive, got '{text}'")
    return position, speed


def _estimates(text: str | None) -> set[str]:
    wanted = {part.strip() for part in text.split(",")} if text else set()
    unknown = wanted - set(_ESTIMATES)
    if unknown:
        raise InputError(f"--estimate: '{min(unknown)}' is none of {', '.join(_ESTIMATES)}")
    return wanted


def navigate_with_aids(
    options: dict[str, Any], aids: dict[str, Any], start: Start | None, spec: ImuSpec | None,
    outputs: tuple[Any, Any, Any],
) -> int:  # fmt: skip
    """Run an aided navigation and say what came of it; return the exit code."""
    from schuler.io import read_gnss, read_speed
    from schuler.io.trajectory import write_trajectory
    from schuler.navigation import AidingOptions, Outages, navigate_aided
    from schuler.record import ImuRecord

    out_to, json_to, report_to = outputs
    wanted = _estimates(aids["estimate"])
    rolling = aids["odometer"] is not None or aids["dvl"] is not None
    if "scale" in wanted and not rolling:
        raise InputError("--estimate scale is that of --odometer or --dvl: give one")
    if "mount" in wanted and not (rolling or aids["nhc"]):
        raise InputError("--estimate mount needs --nhc, --odometer or --dvl, which show it")
    sigma, v_sigma = _sigmas(aids["gnss_sigma"])
    topic, _, velocity_topic = (aids["gnss_topic"] or "").partition(",")
    gnss = read_gnss(
        aids["gnss"], lever=_triple(aids["lever"], "--lever"), delay=aids["delay"] or 0.0,
        estimate=tuple(sorted(wanted & {"delay", "lever"})), sigma=sigma, v_sigma=v_sigma,
        height=aids["gnss_height"], offset=aids["gnss_offset"] or 0.0,
        topic=topic or None, velocity_topic=velocity_topic or None, variable=topic or None,
    )  # fmt: skip
    speeds = [
        read_speed(aids[key], estimate=tuple(sorted(wanted & {"mount", "scale"})), name=key)
        for key in ("odometer", "dvl") if aids[key] is not None
    ]  # fmt: skip
    outages = None if aids["outage"] is None else Outages.parse(aids["outage"])
    more = {} if aids["vibration"] is None else {"vibration": aids["vibration"]}
    chosen = AidingOptions(
        non_holonomic=aids["nhc"], zero_velocity=aids["zupt"], scale=aids["scale_states"],
        robust=aids["robust"], smooth=aids["smooth"], **more,
    )  # fmt: skip
    begin, end = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    look = Look(source)
    with progress(source, source.chunks(start=begin, stop=end)) as chunks:
        record = ImuRecord.concatenate(list(look.through(chunks)), quality=source.quality)
    found = navigate_aided(
        record, gnss, start=start, spec=spec, speeds=speeds, options=chosen, outages=outages
    )
    if out_to is not None:
        write_trajectory(found.path, out_to)
    if json_to is not None:
        emit_json(_data(found, source), json_to)
    if report_to is not None:
        from schuler.reports.aided import aided_report

        aided_report(found, report_to)
    if wants_text():
        echo(str(found))
    finish()
    quality = list(source.quality.warnings()) if source.quality else []
    say_warnings([*quality, *look.notes(None, at_rest=False), *found.warnings])
    if spec is None:
        say_warnings([f"no specification was given: {found.spec.name}"])
    say_warnings(source.contradictions)
    return CONTRADICTED if source.contradictions or not found.consistent else 0


def _data(found: AidedNavigation, source: Any) -> dict[str, Any]:
    return {
        "schema": "schuler.navigation/3", "schuler": __version__, "file": str(source.path),
        **source.how_read(), "gravity": "somigliana", "vertical": "free", "alignment": None,
        "error": None, **found.to_dict(),
    }  # fmt: skip
