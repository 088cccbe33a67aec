"""The command ``schuler compare``, all methods and prefilters on one record."""

from __future__ import annotations

from typing import Any

import click

from schuler._processes import cores
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
from schuler.cli.parameters import Number, Seconds
from schuler.cli.progress import counting
from schuler.errors import InputError

__all__ = ["command"]


class _CompareCommand(Command):
    """A command on one record, or with --records on two."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        next(param for param in self.params if param.name == "file").nargs = -1

    def again(self, options: dict[str, Any]) -> dict[str, Any]:
        """Take the record of a result as a list."""
        named = options.get("file")
        return {**options, "file": (named,)} if isinstance(named, str) else options


@click.command("compare", cls=_CompareCommand)
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
@click.option(
    "--settled", "within", metavar="ANGLE",
    help="Band of the settling times, as 10'; three times the least sigma of all without it.",
)  # fmt: skip
@click.option("--heading", type=Number(-360.0, 360.0, unit="deg"), metavar="DEG",
              help="The true heading, if it is known: settled is then about it.")  # fmt: skip
@click.option(
    "--records", is_flag=True,
    help="Hold two records of one pose against each other: two instruments, or two days.",
)  # fmt: skip
@json_option("Write the rows as JSON (- : here).")
@report_option("Write an interactive report.")
def command(**options: Any) -> int:
    """Run every method and prefilter on FILE and put the results side by side.

    \b
      schuler compare truck.imu --spec navigation-rlg --windows 100s
      schuler compare truck.imu --method centred,kalman --prefilter none,emd --json -
      schuler compare truck.imu --settled "10'" --heading 90.6
      schuler compare --records monday.csv tuesday.csv --lat 48.1 --spec navigation-fog
    """  # noqa: D301
    from dataclasses import replace

    from schuler.alignment.compare import DEFAULT_PAIRS, compare
    from schuler.constants import ARCMIN
    from schuler.record import ImuRecord
    from schuler.units import parse

    named = options.pop("file")
    if options.pop("records"):
        return _two_records(named, options)
    if len(named) != 1:
        raise InputError(
            f"compare takes one record, got {len(named)}: to hold two against each other say "
            "--records"
        )
    options["file"] = named[0]
    spec, methods, prefilters, window, json_to, report_to = (
        options.pop(k) for k in ("spec", "methods", "prefilters", "windows", "json_to", "report_to")
    )
    start, stop = options.pop("start"), options.pop("stop")
    heading, within = options.pop("heading"), options.pop("within")
    band = None if within is None else parse(within, "angle", "--settled") / ARCMIN
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

    with counting("comparing", "methods") as tell:
        done: list[str] = []

        def show(text: str) -> None:
            done.append(text)
            tell(len(done), len(pairs), text)

        found = compare(
            record, site, spec, pairs, window=window, within=band, heading=heading, progress=show,
            workers=cores(),
        )  # fmt: skip
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


def _two_records(named: tuple[str, ...], options: dict[str, Any]) -> int:
    """Align two records, and say whether their poses are the same."""
    from schuler.alignment import Aligner, Alignment, compare_records, parse_method
    from schuler.sensors import load_spec

    if len(named) != 2:
        raise InputError(f"--records takes two records, got {len(named)}")
    methods_only = ("prefilters", "windows", "within", "heading", "save_mapping")
    unused = [
        key for key in methods_only
        if options.get(key) is not None and options[key] is not False and options[key] != ""
    ]  # fmt: skip
    if unused:
        name = {"prefilters": "prefilter", "within": "settled"}.get(unused[0], unused[0])
        raise InputError(f"--{name.replace('_', '-')} is for methods on one record")
    spec = load_spec(options.pop("spec"))
    json_to, report_to = options.pop("json_to"), options.pop("report_to")
    start, stop = options.pop("start"), options.pop("stop")
    method = parse_method(options.pop("methods") or "auto")
    fixes: list[Alignment] = []
    for path in named:
        own = {**options, "file": path}
        source, finish = open_file(own, spec=spec)
        site = site_or_none(own, source)
        if site is None:
            raise InputError("the latitude is needed to find north: say --lat (and --height)")
        aligner = Aligner(site, method, spec, reading=source.reading)
        with progress(source, source.chunks(start=start, stop=stop)) as chunks:
            for chunk in chunks:
                aligner.update(chunk)
        fix = aligner.solution()
        fixes.append(fix.contradicted(source.contradictions))
        finish()
        say_warnings(f"{path}: {text}" for text in fix.warnings)
    found = compare_records(fixes[0], fixes[1], (named[0], named[1]))
    if json_to is not None:
        emit_json(found.to_dict(), json_to)
    draw(found, report_to)
    if wants_text():
        echo(found)
    return CONTRADICTED if found.contradictions else 0
