"""The command ``schuler align``, which finds north."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import click

from schuler import __version__
from schuler.cli.align_moving import (
    align_in_motion,
    follow_in_motion,
    motion_options,
    motion_taken,
)
from schuler.cli.align_transfer import align_by_master, transfer_options, transfer_taken
from schuler.cli.command import CONTRADICTED, echo, wants_text
from schuler.cli.common import (
    draw,
    emit_json,
    file_options,
    gravity_known,
    gravity_options,
    json_option,
    open_file,
    progress,
    report_option,
    say_warnings,
    site_options,
    site_or_none,
)
from schuler.cli.completion import methods, prefilters, specs
from schuler.cli.many import ManyCommand
from schuler.cli.parameters import InputFile, NamesOption, Seconds, method_names, prefilter_names
from schuler.cli.running import budget_line, follow
from schuler.errors import InputError
from schuler.units import time_text

if TYPE_CHECKING:
    from schuler.alignment import Alignment, Windows
    from schuler.alignment.aligner import Aligner
    from schuler.calibration.apply import Calibration
    from schuler.io import Source

__all__ = ["command"]


@click.command("align", cls=ManyCommand)
@file_options
@site_options
@gravity_options
@click.option(
    "--method",
    cls=NamesOption,
    names=method_names,
    metavar="NAME(OPTIONS)",
    shell_complete=methods,
    default="auto",
    show_default=True,
    help="auto goes by what the record shows; options in brackets, as 'kalman(step=2 s)'.",
)
@click.option(
    "--prefilter",
    cls=NamesOption,
    names=prefilter_names,
    metavar="NAME(OPTIONS)",
    shell_complete=prefilters,
    help="One or a chain, as 'lowpass(0.05 Hz), gate(0.003)'; or none.",
)
@click.option(
    "--spec",
    type=InputFile(),
    metavar="GRADE|TOML",
    shell_complete=specs,
    help="The instrument: navigation-rlg, navigation-fog, tactical-fog, industrial-mems or a file.",
)
@click.option(
    "--calibration",
    type=InputFile(),
    metavar="TOML",
    help="Apply a calibration (of `schuler calibrate`) to the record first.",
)
@click.option(
    "--at",
    type=click.Choice(["end", "start"]),
    default="end",
    show_default=True,
    help="The instant of the attitude.",
)
@click.option(
    "--windows", type=Seconds(above=0.0), help="Align each window of this length as well."
)
@click.option(
    "--find-latitude", is_flag=True, help="Find the latitude too; --lat is not needed then."
)
@motion_options
@transfer_options
@click.option("--follow", is_flag=True, help="Read on while the file (or - ) grows, live.")
@click.option("--idle", type=Seconds(0.0), help="With --follow: end after so long without data.")
@json_option("Write the result as JSON (- : here); of several records a .jsonl.", ".jsonl")
@report_option("Write an interactive report.")
def command(**options: Any) -> int:
    """Find heading, pitch and roll from FILE (- : standard input), at rest or with aids in motion.

    \b
      schuler align truck.imu --lat 34.246 --lon 108.91 --height 380
      schuler align truck.csv --gyro deg/s --accel g --axes FRD --lat 48.1 --report truck.html
      schuler align truck.imu --spec navigation-rlg --windows 100s --at start --json -
      schuler align drive.csv --gnss car.pos --estimate delay --from +30s --to +90s
      schuler align slave.csv --master fog.parquet --to +20s --then-free 30s
    """  # noqa: D301
    from schuler._processes import cores
    from schuler.alignment import Aligner, align_windows, parse_method
    from schuler.prefilter import parse_prefilter
    from schuler.sensors import load_spec

    name, prefilter, spec, at = (options.pop(k) for k in ("method", "prefilter", "spec", "at"))
    calibration_from = options.pop("calibration")
    window, follow, idle = (options.pop(key) for key in ("windows", "follow", "idle"))
    json_to, report_to = options.pop("json_to"), options.pop("report_to")
    start, stop = options.pop("start"), options.pop("stop")
    if follow and (window is not None or start is not None or stop is not None):
        raise InputError("--follow aligns all that comes: leave out --windows, --start and --stop")
    if idle is not None and not follow:
        raise InputError("--idle goes with --follow")
    latitude_too, by_master = options.pop("find_latitude"), transfer_taken(options)
    aids = motion_taken(options) if by_master is None else None
    if aids is not None or by_master is not None:
        if latitude_too or name != "auto" or prefilter is not None:
            raise InputError(
                "an alignment in motion has a method of its own: leave out --method, --prefilter "
                "and --find-latitude beside --gnss, --odometer, --dvl and --master"
            )
        if follow and (by_master is not None or at == "start"):
            raise InputError(
                "--follow gives the attitude at the end, by --gnss in motion: leave out --at start "
                "and --master"
            )
        if by_master is not None:
            if window is not None:
                raise InputError("--windows is for --gnss, --odometer and --dvl, not for --master")
            return align_by_master(
                options, by_master, spec, at, (start, stop), (json_to, report_to),
                calibration_from, _with_source,
            )  # fmt: skip
        assert aids is not None
        if follow:
            return follow_in_motion(
                options, aids, spec, idle, (json_to, report_to), calibration_from, _with_source
            )
        return align_in_motion(
            options, aids, spec, at, (start, stop), (json_to, report_to), calibration_from,
            _with_source, window,
        )  # fmt: skip
    if latitude_too:
        if follow or window is not None or name != "auto" or prefilter is not None:
            raise InputError(
                "--find-latitude has a method of its own: leave out --method, --prefilter, "
                "--windows and --follow"
            )
        return _without_latitude(
            options, spec, at, (start, stop), (json_to, report_to), calibration_from
        )
    wait = (math.inf if idle is None else idle) if follow else None
    source, finish = open_file(options, wait, load_spec(spec))
    site = site_or_none(options, source)
    if site is None:
        raise InputError("the latitude is needed to find north: say --lat (and --height)")
    method = parse_method(name)
    if prefilter is not None:
        method = method.with_prefilter(parse_prefilter(prefilter))
    calibration = None
    if calibration_from is not None:
        from schuler.calibration.apply import Calibration

        calibration = Calibration.from_toml(calibration_from)
    aligner = Aligner(site, method, spec, at=at, reading=source.reading)
    windows: Windows | None = None
    if follow:
        fix = _follow(source, aligner, idle, calibration, quiet=json_to == "-")
    else:
        with progress(source, source.chunks(start=start, stop=stop)) as read:
            chunks = read if calibration is None else calibration.each(read)
            if window is not None:
                windows = align_windows(
                    chunks, site, window, method, aligner.spec, at=at, workers=cores()
                )
                fix = windows.whole
            else:
                for chunk in chunks:
                    aligner.update(chunk)
                fix = aligner.solution()
    fix = _with_source(fix, source, spec, calibration_from)
    if windows is not None:
        windows = type(windows)(fix, windows.length, windows.each)
    if json_to is not None:
        emit_json((windows or fix).to_dict(), json_to)
    draw(windows or fix, report_to)
    if wants_text():
        _print(fix, windows)
    finish()
    say_warnings(fix.warnings)
    return 0 if fix.consistent else CONTRADICTED


def _without_latitude(
    options: dict[str, Any], spec: str | None, at: str, span: tuple[float | None, float | None],
    outputs: tuple[str | None, str | None], calibration_from: str | None,
) -> int:  # fmt: skip
    from dataclasses import replace

    from schuler.alignment import align_without_latitude
    from schuler.record import ImuRecord
    from schuler.sensors import load_spec

    json_to, report_to = outputs
    for key in ("lat", "lon"):
        options.pop(key)
    height, known = options.pop("height") or 0.0, gravity_known(options)
    source, finish = open_file(options, spec=load_spec(spec))
    with progress(source, source.chunks(start=span[0], stop=span[1])) as chunks:
        read: Iterable[ImuRecord] = chunks
        if calibration_from is not None:
            from schuler.calibration import Calibration

            read = Calibration.from_toml(calibration_from).each(chunks)
        record = ImuRecord.concatenate(list(read), quality=source.quality)
    found = align_without_latitude(record, spec, height=height, at=at, **known)
    fix = _with_source(found.alignment, source, spec, calibration_from)
    found = replace(found, alignment=fix)
    if json_to is not None:
        emit_json(found.to_dict(), json_to)
    draw(fix, report_to)
    if wants_text():
        echo(str(found).partition("\nwarning: ")[0])
    finish()
    say_warnings(fix.warnings)
    return 0 if fix.consistent else CONTRADICTED


def _with_source(
    fix: Alignment, source: Source, spec: str | None, calibration: str | None
) -> Alignment:
    """Add what the reader knows: what was read as what, and what was found in the rows."""
    quality = source.quality
    site = fix.site
    inputs = {
        "file": str(source.path),
        "format": source.format,
        "read as": source.meaning,
        "span": f"{time_text(fix.start)} to {time_text(fix.end)} s",
        "latitude": f"{site.lat:.7g} deg",
        "longitude": f"{site.lon:.7g} deg",
        "height": f"{site.height:g} m",
        "gravity": f"{site.gravity:.6f} m/s^2",
        "method": repr(fix.method),
        "attitude at": f"{fix.at} (t = {time_text(fix.time)} s)",
        "specification": "none" if fix.spec is None else fix.spec.name,
        "schuler": __version__,
    }
    if calibration is not None:
        inputs["calibration"] = calibration
    if fix.spec is not None:
        for part, values in fix.spec.describe().items():
            for name, value in values.items():
                inputs[f"{part} {name.replace('_', ' ')}"] = value
    inputs.update({f"note {k}": note for k, note in enumerate(source.notes, 1)})
    inputs.update({f"assumed {k}": text for k, text in enumerate(source.assumed, 1)})
    found = quality.warnings() if quality else []
    return fix.noting(found, inputs).contradicted(source.contradictions)


def _print(fix: Alignment, windows: Windows | None) -> None:
    """Print the result for people: plain lines, nothing else."""
    if windows is not None:
        echo(f"{'start s':>10}  {'end s':>10}  {'heading deg':>11}  {'pitch deg':>9}  "
                   f"{'roll deg':>9}  {'sigma':>8}")  # fmt: skip
        for w in windows.each:
            echo(
                f"{w.start:10.2f}  {w.end:10.2f}  {w.heading_deg:11.4f}  {w.pitch_deg:9.4f}  "
                f"{w.roll_deg:9.4f}  {w.sigma_arcmin[2]:7.2f}'"
            )
        echo(str(windows))
        echo("whole span:")
    echo(str(fix).split("\nwarning: ")[0])
    echo(budget_line(fix))


def _follow(
    source: Source, aligner: Aligner, idle: float | None, calibration: Calibration | None,
    quiet: bool,
) -> Alignment:  # fmt: skip
    """Align while data come; show heading and sigma live, and end by --idle or Ctrl-C."""

    def solution() -> tuple[float, Alignment] | None:
        try:
            fix = aligner.solution()
        except InputError:
            # Too few samples yet, or (for seconds only) no attitude in them.
            if aligner.samples > 1000:
                raise
            return None
        return fix.duration, fix

    follow(source.follow(idle=idle), aligner.update, solution, calibration, quiet)
    return aligner.solution()
