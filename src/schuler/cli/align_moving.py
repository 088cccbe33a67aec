"""Alignment in motion of ``schuler align``: its options, and its run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.aid_options import (
    BESIDE,
    beside_options,
    estimates_of,
    gnss_sigma_option,
    lever_of,
    read_beside,
    sigmas_of,
)
from schuler.cli.command import CONTRADICTED, echo, wants_text
from schuler.cli.common import draw, emit_json, open_file, progress, say_warnings, site_or_none
from schuler.cli.parameters import InputFile, Number, Seconds
from schuler.cli.running import budget_line, follow
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.alignment import Alignment, MovingWindows
    from schuler.record import ImuRecord

__all__ = [
    "align_in_motion",
    "follow_in_motion",
    "motion_options",
    "motion_taken",
    "read_whole",
    "say_alignment",
]

_FOLLOWED_LATENCY = 10.0
"""Files are written in blocks: fixes may come so much later than samples, s."""

_AIDS = ("gnss", "odometer", "dvl")
_KEYS = (*_AIDS, "dvl_frame", "dvl_lever", "gnss_sigma", "lever", "delay", "estimate", "vibration",
         "latency", "zupt", *BESIDE)  # fmt: skip


class _AutoNumber(Number):
    """A number, or ``auto`` where it is to be found."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the number or "auto"."""
        return value if value == "auto" else super().convert(value, param, ctx)


def motion_options(function: Any) -> Any:
    """Add the options of an alignment in motion to a command."""
    options = [
        click.option(
            "--gnss", type=InputFile(), metavar="FILE",
            help="Align in motion by GNSS fixes: CSV, Parquet, RTKLIB .pos or KF-GINS text.",
        ),
        click.option(
            "--odometer", type=InputFile(), metavar="FILE",
            help="Forward speed of a vehicle on wheels: time, speed.",
        ),
        click.option(
            "--dvl", type=InputFile(), metavar="FILE", help="Speed right, forward, up: vx, vy, vz."
        ),
        click.option(
            "--dvl-frame", type=click.Choice(["RFU", "FRD", "FLU"]),
            help="Where x, y, z of --dvl point (RFU; of a ROS bag FLU).",
        ),
        click.option("--dvl-lever", metavar="X,Y,Z", help="From IMU to that sensor, m."),
        gnss_sigma_option("the file has none"),
        click.option(
            "--lever", metavar="X,Y,Z|auto", help="From IMU to antenna or master, m (body axes)."
        ),
        click.option(
            "--delay", type=_AutoNumber(-10.0, 10.0, unit="s"), metavar="S|auto",
            help="A fix, or a row of the master, stamped t is valid at t - S.",
        ),
        click.option(
            "--estimate", metavar="LIST", help="Of delay, lever, mount, scale, with commas."
        ),
        click.option(
            "--vibration", type=Number(0.0, 10.0), metavar="M/S/SQRT(S)",
            help="Least velocity random walk on the vehicle (as the record shows it).",
        ),
        *beside_options(),
        click.option(
            "--latency", type=Seconds(0.0),
            help="With --follow: how much later than the record fixes may come (10s).",
        ),
        click.option(
            "--zupt", is_flag=True, default=None,
            help="Use rest of five seconds and more that record and fixes show.",
        ),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def motion_taken(options: dict[str, Any]) -> dict[str, Any] | None:
    """Return the options of an alignment in motion, taken out of the command's; None at rest.

    Raises
    ------
    InputError
        If one of them is given without an aid.
    """
    out = {key: options.pop(key) for key in _KEYS}
    if any(out[key] is not None for key in _AIDS):
        return out
    given = [key for key in _KEYS if out[key] is not None]
    if given:
        raise InputError(
            f"--{given[0].replace('_', '-')} is for an alignment in motion: say --gnss, --odometer "
            "or --dvl"
        )
    return None


def _read_aids(aids: dict[str, Any]) -> list[Any]:
    from schuler.io import read_dvl, read_gnss, read_speed

    wanted = estimates_of(aids["estimate"])
    rolling = aids["odometer"] is not None or aids["dvl"] is not None
    if wanted & {"scale", "mount"} and not rolling:
        raise InputError("--estimate scale and mount are those of --odometer or --dvl: give one")
    if wanted & {"delay", "lever"} and aids["gnss"] is None:
        raise InputError("--estimate delay and lever are those of --gnss: give one")
    for key, owner in (
        ("gnss_sigma", "gnss"), ("delay", "gnss"), ("lever", "gnss"), ("dvl_frame", "dvl"),
        ("dvl_lever", "dvl"),
    ):  # fmt: skip
        if aids[key] is not None and aids[owner] is None:
            raise InputError(f"--{key.replace('_', '-')} is for --{owner}: give it")
    for key in ("lever", "delay"):
        if aids[key] == "auto":
            raise InputError(f"--{key} auto is for --master: beside --gnss say --estimate {key}")
    out: list[Any] = []
    if aids["gnss"] is not None:
        sigma, v_sigma = sigmas_of(aids["gnss_sigma"])
        out.append(
            read_gnss(
                aids["gnss"], lever=lever_of(aids["lever"], "--lever"), delay=aids["delay"] or 0.0,
                sigma=sigma, v_sigma=v_sigma, estimate=tuple(sorted(wanted & {"delay", "lever"})),
            )
        )  # fmt: skip
    own = tuple(sorted(wanted & {"mount", "scale"}))
    if aids["odometer"] is not None:
        out.append(read_speed(aids["odometer"], name="odometer", estimate=own))
    if aids["dvl"] is not None:
        lever = lever_of(aids["dvl_lever"], "--dvl-lever")
        out.append(read_dvl(aids["dvl"], frame=aids["dvl_frame"], lever=lever, estimate=own))
    return [*out, *read_beside(aids, {})]


def align_in_motion(
    options: dict[str, Any], aids: dict[str, Any], spec: str | None, at: str,
    span: tuple[Any, Any], outputs: tuple[str | None, str | None], calibration_from: str | None,
    finished: Any, window: float | None = None,
) -> int:  # fmt: skip
    """Align in motion and say what came of it; return the exit code.

    Parameters
    ----------
    options : dict
        Of the file and the site.
    aids : dict
        As of `motion_taken`.
    spec, at, span, outputs, calibration_from
        As the command has them.
    finished : callable
        Adds what the reader knows to a result.
    window : float, optional
        Length of windows that are aligned as well, s.
    """
    from dataclasses import replace

    from schuler.aiding import GnssFixes, ZeroVelocity
    from schuler.alignment import align, align_moving_windows
    from schuler.io.span import parse_record_time
    from schuler.sensors import load_spec

    if aids["latency"] is not None:
        raise InputError("--latency goes with --follow")
    given = _read_aids(aids)
    source, finish = open_file(options, None, load_spec(spec))
    site = site_or_none(options, source)
    # What lies before the span may show rest, and with it the gyros' bias: it is read, too.
    record = read_whole(source, span[1], calibration_from)
    fixes = next((aid for aid in given if isinstance(aid, GnssFixes)), None)
    rest = [ZeroVelocity.found(record, fixes)] if aids["zupt"] else []
    begin = None
    if span[0] is not None:
        seconds, relative = parse_record_time(span[0], "start")
        begin = seconds + (record.start if relative else 0.0)
    if window is not None:
        found = align_moving_windows(
            record, [*given, *rest], window, site, spec, at=at, span=(begin, None),
            vibration=aids["vibration"],
        )  # fmt: skip
        whole = finished(found.whole, source, spec, calibration_from)
        return say_alignment(whole, outputs, finish, replace(found, whole=whole))
    fix: Alignment = align(
        record, site, None, spec, at=at, aiding=[*given, *rest], span=(begin, None),
        vibration=aids["vibration"],
    )  # fmt: skip
    return say_alignment(finished(fix, source, spec, calibration_from), outputs, finish)


def follow_in_motion(
    options: dict[str, Any], aids: dict[str, Any], spec: str | None, idle: float | None,
    outputs: tuple[str | None, str | None], calibration_from: str | None, finished: Any,
) -> int:  # fmt: skip
    """Align in motion while the record and its fixes grow; return the exit code.

    Parameters
    ----------
    options, aids, spec, outputs, calibration_from, finished
        As of `align_in_motion`.
    idle : float or None
        s without a new sample that end it.
    """
    from schuler.aiding.fix_rows import FixSetting
    from schuler.alignment.moving.stream import MovingStream
    from schuler.alignment.moving.stream_setting import StreamSetting
    from schuler.calibration.apply import Calibration
    from schuler.io.growing_fixes import GrowingFixes
    from schuler.sensors import load_spec

    other = [key for key in (*_AIDS[1:], "zupt", *BESIDE) if aids[key]]
    if other or aids["gnss"] is None:
        name = (other or ["gnss"])[0].replace("_", "-")
        raise InputError(f"--follow in motion is for --gnss alone, got --{name}")
    wanted = estimates_of(aids["estimate"])
    if wanted - {"delay", "lever"}:
        raise InputError("--estimate takes delay and lever, of --gnss")
    if "auto" in (aids["lever"], aids["delay"]):
        raise InputError("--lever and --delay auto are for --master: say --estimate lever,delay")
    sigma, v_sigma = sigmas_of(aids["gnss_sigma"])
    antenna = FixSetting(
        lever_of(aids["lever"], "--lever"), aids["delay"] or 0.0, tuple(sorted(wanted))
    )
    latency = _FOLLOWED_LATENCY if aids["latency"] is None else aids["latency"]
    stream = MovingStream(StreamSetting(spec, antenna, latency, vibration=aids["vibration"]))
    growing = GrowingFixes(aids["gnss"], sigma=sigma, v_sigma=v_sigma)
    calibration = None if calibration_from is None else Calibration.from_toml(calibration_from)
    source, finish = open_file(options, math.inf if idle is None else idle, load_spec(spec))
    quiet = outputs[0] == "-"

    def look() -> bool:
        """Take the fixes that are new; the record goes on."""
        stream.add(growing.rows())
        return False

    def update(chunk: ImuRecord) -> None:
        stream.update(chunk)
        look()

    def solution() -> tuple[float, Alignment] | None:
        if stream.starting:
            return None
        fix = stream.solution()
        return fix.end, fix

    look()
    follow(source.follow(idle=idle, stop=look), update, solution, calibration, quiet)
    look()
    stream.finish()
    if growing.trouble is not None and not stream.counts["fixes"]:
        raise InputError(growing.trouble)
    late = stream.counts["late_fixes"]
    if late:
        say_warnings([
            f"{late} fixes came after the samples of their time had been taken, and were left out: "
            "a longer --latency waits for such"
        ])  # fmt: skip
    fix = stream.solution()
    return say_alignment(finished(fix, source, spec, calibration_from), outputs, finish)


def say_alignment(
    fix: Alignment, outputs: tuple[str | None, str | None], finish: Any,
    windows: MovingWindows | None = None,
) -> int:  # fmt: skip
    """Write JSON and report, print the result for people, and return the exit code."""
    json_to, report_to = outputs
    if json_to is not None:
        emit_json((windows or fix).to_dict(), json_to)
    draw(windows or fix, report_to)
    if wants_text():
        if windows is not None:
            _print_windows(windows)
        echo(str(fix).split("\nwarning: ")[0])
        echo(budget_line(fix))
    finish()
    say_warnings(fix.warnings)
    return 0 if fix.consistent else CONTRADICTED


def _print_windows(windows: MovingWindows) -> None:
    from schuler.constants import DEG

    echo(f"{'start s':>10}  {'end s':>10}  {'heading deg':>11}  {'sigma deg':>9}  "
         f"{'off deg':>8}")  # fmt: skip
    for each, off in zip(windows.each, windows.off, strict=True):
        echo(
            f"{each.start:10.2f}  {each.end:10.2f}  {each.heading_deg:11.3f}  "
            f"{each.sigma_arcmin[2] / 60.0:9.3f}  {off / DEG:8.3f}"
        )
    for begin, end, why in windows.refused:
        echo(f"{begin:10.2f}  {end:10.2f}  no heading: {why}")
    echo(str(windows))
    echo("whole span:")


def read_whole(source: Any, stop: Any, calibration_from: str | None) -> ImuRecord:
    """Return the record of a source up to a time, calibrated where that is asked for."""
    from schuler.record import ImuRecord

    with progress(source, source.chunks(stop=stop)) as chunks:
        read = chunks
        if calibration_from is not None:
            from schuler.calibration.apply import Calibration

            read = Calibration.from_toml(calibration_from).each(chunks)
        return ImuRecord.concatenate(list(read), quality=source.quality)
