"""The command ``schuler navigate``: free-inertial from a known start, or aided."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from schuler import __version__
from schuler.cli.aided import aiding_options, navigate_with_aids, taken
from schuler.cli.command import CONTRADICTED, echo, wants_text
from schuler.cli.common import (
    Look,
    draw,
    draws,
    emit_json,
    file_options,
    gravity_options,
    json_option,
    open_file,
    progress,
    report_option,
    say_warnings,
    site_options,
    site_or_none,
)
from schuler.cli.completion import specs
from schuler.cli.parameters import InputFile, Number, Seconds
from schuler.cli.path_output import PathOutput, path_options
from schuler.cli.run_file import RunCommand, save_run_option
from schuler.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from schuler.alignment import Alignment
    from schuler.earth import Site
    from schuler.navigation import Navigator, Start
    from schuler.record import ImuRecord
    from schuler.sensors import ImuSpec
    from schuler.trajectory import Trajectory

__all__ = ["command"]


@click.command("navigate", cls=RunCommand)
@file_options
@site_options
@gravity_options
@click.option(
    "--heading",
    type=Number(-360.0, 360.0, unit="deg"),
    metavar="DEG",
    help="At the start, clockwise from north.",
)
@click.option(
    "--pitch",
    type=Number(-90.0, 90.0, unit="deg"),
    metavar="DEG",
    help="At the start, nose up positive.",
)
@click.option(
    "--roll",
    type=Number(-180.0, 180.0, unit="deg"),
    metavar="DEG",
    help="At the start, right side down positive.",
)
@click.option(
    "--align",
    "align_for",
    type=Seconds(above=0.0),
    metavar="TIME",
    help="Find the attitude in the first TIME of the record, at rest; navigate what follows.",
)
@click.option("--velocity", metavar="E,N,U", help="At the start, m/s (0,0,0).")
@click.option(
    "--gravity",
    metavar="MODEL",
    default="somigliana",
    show_default=True,
    help="somigliana, somigliana1 (height to first order), psins, constant or constant=9.7944.",
)
@click.option(
    "--vertical",
    metavar="MODE",
    default="free",
    show_default=True,
    help="free, off (no vertical motion), damped or damped=HEIGHT (m).",
)
@click.option(
    "--spec",
    type=InputFile(),
    metavar="GRADE|TOML",
    shell_complete=specs,
    help="The instrument: propagates the uncertainty as well.",
)
@path_options
@click.option(
    "--reference",
    type=InputFile(),
    metavar="FILE",
    help="Compare with this path (CSV with names, or Parquet).",
)
@aiding_options
@save_run_option
@json_option()
@report_option("Write an interactive report.")
def command(**options: Any) -> int:
    """Navigate FILE (- : standard input): free-inertially from a known start, or with --gnss aided.

    \b
      schuler navigate drive.csv --gnss car.pos --nhc --zupt --estimate delay,mount --smooth
      schuler navigate drive.csv --gnss car.pos --nhc --out path.csv --save-run drive.toml
      schuler navigate drive.toml --smooth
      schuler navigate flight.csv --lat 34.2 --lon 108.9 --height 100 --heading 40 --velocity 38,46,0
      schuler navigate truck.parquet --lat 34.2 --lon 108.9 --align 300s --reference truth.parquet
    """  # noqa: D301, E501
    from schuler.io import read_trajectory
    from schuler.navigation import (
        FreeNavigation,
        Navigator,
        evaluate,
        parse_gravity,
        parse_vertical,
    )
    from schuler.sensors import load_spec

    names = ("heading", "pitch", "roll")
    angles = {name: options.pop(name) for name in names}
    align_for, velocity = options.pop("align_for"), _velocity(options.pop("velocity"))
    gravity, vertical = parse_gravity(options.pop("gravity")), parse_vertical(
        options.pop("vertical")
    )  # fmt: skip
    spec = load_spec(options.pop("spec"))
    out = PathOutput.taken(options, aided=options["gnss"] is not None)
    json_to, report_to = options.pop("json_to"), options.pop("report_to")
    start, stop = options.pop("start"), options.pop("stop")
    against, aids = options.pop("reference"), taken(options)
    if aids["gnss"] is not None:
        options.update(start=start, stop=stop)
        return _aided(options, aids, angles, velocity, spec, align_for, against,
                      (out, json_to, report_to))  # fmt: skip
    if align_for is not None and any(v is not None for v in angles.values()):
        raise InputError("--align finds the attitude: leave out --heading, --pitch and --roll")
    if align_for is None and angles["heading"] is None:
        raise InputError("the start's attitude is needed: say --heading, or --align 300s")
    truth = read_trajectory(against) if against else None
    source, finish = open_file(options)
    site = site_or_none(options, source)
    if site is None:
        raise InputError("the start's place is needed: say --lat, --lon and --height")

    fix: Alignment | None = None
    look = Look(source)
    with progress(source, source.chunks(start=start, stop=stop)) as chunks:
        flow = look.through(chunks)
        if align_for is not None:
            fix, flow = _align(flow, site, align_for, spec)
        begin = _start(site, angles, velocity, fix)
        navigator = Navigator(
            begin, gravity=gravity, vertical=vertical, every=out.every_free, spec=spec
        )
        if not draws(report_to) and truth is None and out.in_pieces:
            path = _in_pieces(navigator, flow, out)
        else:
            for chunk in flow:
                navigator.update(chunk)
            path = navigator.path()
            out.write(out.of_free(path))
    found = FreeNavigation(
        path, navigator.gravity.model, navigator.vertical.mode,
        None if fix is None else _summary(fix),
        None if truth is None else evaluate(path, truth),
    )  # fmt: skip
    if json_to is not None:
        about = {"schuler": __version__, "file": str(source.path), **source.how_read()}
        emit_json({"schema": "schuler.navigation/3", **about, **found.to_dict()}, json_to)
    draw(found, report_to)
    if wants_text():
        if fix is not None and not fix.consistent:
            echo(fix.headline())
        echo(found)
    finish()
    warnings = list(source.quality.warnings()) if source.quality else []
    # A vehicle that moves still has gravity's force on average.
    say_warnings([*warnings, *look.notes(site, at_rest=False), *source.contradictions])
    contradicted = bool(source.contradictions)
    if fix is not None:
        say_warnings(f"alignment: {text}" for text in fix.warnings)
        contradicted |= not fix.consistent
    return CONTRADICTED if contradicted else 0


def _in_pieces(navigator: Navigator, flow: Iterator[ImuRecord], out: PathOutput) -> Trajectory:
    """Navigate and write what comes, in constant memory; return the first and the last row."""
    first: Trajectory | None = None
    written = -math.inf
    with out.stream() as stream:
        for chunk in flow:
            rows = navigator.update(chunk).drain()
            if rows is not None:
                first = first or rows.rows(slice(0, 1))
                written = float(rows.time[-1])
                stream.write(rows)
        last = navigator.path()
        stream.write(last.rows(slice(int(last.time[0] <= written), None)))
    return last if first is None else first.joined(last.rows(slice(-1, None)), last.covariance)


def _aided(
    options: dict[str, Any], aids: dict[str, Any], angles: dict[str, float | None], velocity: Any,
    spec: ImuSpec | None, align_for: float | None, against: Any, outputs: Any,
) -> int:  # fmt: skip
    """Navigate with aids, from a start that is given or found."""
    from schuler.io import read_trajectory

    if align_for is not None:
        raise InputError("--align is for free-inertial navigation: leave it out beside --gnss")
    place = site_or_none(options)
    start: Start | None = None
    if angles["heading"] is not None:
        if place is None:
            raise InputError("a start's attitude needs its place: say --lat, --lon and --height")
        start = _start(place, angles, velocity, None)
    truth = read_trajectory(against) if against else None
    return navigate_with_aids(options, aids, start, spec, truth, outputs)


def _velocity(text: str | None) -> tuple[float, float, float]:
    if text is None:
        return 0.0, 0.0, 0.0
    try:
        east, north, up = (float(cell) for cell in text.split(","))
    except ValueError:
        raise InputError(
            f"--velocity: expected three numbers, east,north,up in m/s, got '{text}'"
        ) from None
    return east, north, up


def _start(
    site: Site, angles: dict[str, float | None], velocity: Any, fix: Alignment | None
) -> Start:
    from schuler.navigation import Start

    if fix is not None:
        return Start.from_alignment(site, fix, velocity)
    heading, pitch, roll = (angles[name] or 0.0 for name in ("heading", "pitch", "roll"))
    return Start.from_angles(site, heading, pitch, roll, velocity)


def _align(
    flow: Iterator[ImuRecord], site: Site, length: float, spec: Any
) -> tuple[Alignment, Iterator[ImuRecord]]:
    """Align the first part of a stream; return what was found and the rest of the stream."""
    from itertools import chain

    from schuler.alignment import Aligner

    aligner = Aligner(site, None, spec)
    end: float | None = None
    for chunk in flow:
        end = chunk.start + length if end is None else end
        aligner.update(chunk.between(None, end))
        if chunk.time[-1] > end:
            rest = chunk.between(end, None)
            return aligner.solution(), chain([rest] if len(rest) else [], flow)
    raise InputError(
        f"--align {length:g} s takes the whole record: nothing is left to navigate; shorten it"
    )


def _summary(fix: Alignment) -> dict[str, Any]:
    """Return what the result of a navigation says of the alignment at its start."""
    sigma = zip(("east", "north", "up"), map(float, fix.sigma_arcmin), strict=True)
    return {
        "consistent": fix.consistent,
        "contradictions": list(fix.contradictions),
        "heading_deg": float(fix.heading_deg),
        "sigma_arcmin": dict(sigma),
    }
