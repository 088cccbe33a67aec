"""The command ``schuler compare``, all methods and prefilters on one record."""

from __future__ import annotations

import sys
from typing import Any

import click

from schuler.cli.command import CONTRADICTED, Command, echo, wants_text
from schuler.cli.common import (
    Look,
    draw,
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
from schuler.cli.completion import methods, prefilters, specs
from schuler.cli.parameters import Seconds
from schuler.errors import InputError

__all__ = ["command"]


@click.command("compare", cls=Command)
@file_options
@site_options
@gravity_options
@click.option(
    "--spec",
    metavar="GRADE|TOML",
    shell_complete=specs,
    help="The instrument: navigation-rlg, navigation-fog, tactical-fog, industrial-mems or a file.",
)
@click.option(
    "--method",
    "methods",
    metavar="LIST",
    shell_complete=methods,
    help="Methods, with commas; all without it.",
)
@click.option(
    "--prefilter", "prefilters", metavar="LIST", shell_complete=prefilters,
    help="Prefilters, with commas, each before every method that is named (none: without).",
)  # fmt: skip
@click.option("--windows", type=Seconds(), help="Length of the windows for the repeatability.")
@json_option("Write the rows as JSON (- : here).")
@report_option("Write an interactive report.")
def command(**options: Any) -> int:
    """Run every method and prefilter on FILE and put the results side by side.

    \b
      schuler compare truck.imu --spec navigation-rlg --windows 100s
      schuler compare truck.imu --method centred,kalman --prefilter none,emd --json -
    """  # noqa: D301
    from dataclasses import replace

    from schuler.alignment.compare import DEFAULT_PAIRS, compare
    from schuler.record import ImuRecord

    spec, methods, prefilters, window, json_to, report_to = (
        options.pop(k) for k in ("spec", "methods", "prefilters", "windows", "json_to", "report_to")
    )
    start, stop = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    site = site_or_none(options, source)
    if site is None:
        raise InputError("the latitude is needed to find north: say --lat (and --height)")
    pairs = DEFAULT_PAIRS
    if methods or prefilters:
        names = [m.strip() for m in (methods or "auto").split(",")]
        filters = [p.strip() for p in (prefilters or "none").split(",")]
        pairs = tuple((m, p) for p in filters for m in names)
    look = Look(source)
    with progress(source, source.chunks(start=start, stop=stop)) as chunks:
        record = ImuRecord.concatenate(list(look.through(chunks)), quality=source.quality)

    def show(text: str) -> None:
        click.echo(f"\r\x1b[K{text}", err=True, nl=False)

    found = compare(
        record, site, spec, pairs, window=window, progress=show if sys.stderr.isatty() else None
    )
    if sys.stderr.isatty():
        click.echo("\r\x1b[K", err=True, nl=False)
    found = replace(
        found, contradictions=(*source.contradictions, *found.contradictions),
        read_as=source.meaning, assumed=tuple(source.assumed),
    )  # fmt: skip
    if json_to is not None:
        emit_json(found.to_dict(), json_to)
    draw(found, report_to)
    if wants_text():
        echo(str(found))
    finish()
    say_warnings(look.notes(site))
    return 0 if found.consistent else CONTRADICTED
