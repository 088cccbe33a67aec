"""The command ``schuler array``: what a geometry of redundant gyros is worth, and its faults."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import Command, Group, echo, wants_text
from schuler.cli.common import (
    draw,
    emit_json,
    file_options,
    json_option,
    report_option,
    say_warnings,
)
from schuler.cli.parameters import Count, Number, Seconds
from schuler.errors import InputError

__all__ = ["command"]


class _FiguresOrFaults(Group):
    """A geometry right after the command's name means its figures."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] not in (*self.commands, "-h", "--help", "--debug"):
            args = ["figures", *args]
        return super().parse_args(ctx, args)


@click.group("array", cls=_FiguresOrFaults)
def command() -> None:
    """Say what an array of gyros is worth, and find faults of its gyros in a record.

    `schuler array symmetric4` is short for `schuler array figures symmetric4`.
    """


@command.command("figures", cls=Command)
@click.argument("geometry", metavar="NAME|TOML")
@click.option("--mtbf", type=float, default=5000.0, show_default=True, metavar="H",
              help="Mean life of one sensor, h.")  # fmt: skip
@click.option("--weibull", type=Number(0.01, 100.0), default=1.0, show_default=True, metavar="K",
              help="Shape of the lives: 1 is exponential.")  # fmt: skip
@click.option("--coverage", type=Number(0.0, 1.0), default=1.0, show_default=True, metavar="C",
              help="Chance that a failure is found and isolated.")  # fmt: skip
@click.option("--mission", default="1000h,2000h,5000h,10000h", show_default=True, metavar="LIST",
              help="Times at which the reliability is told.")  # fmt: skip
@json_option("Write the figures as JSON (- : here).")
@report_option("Draw variances and reliability.")
def figures(**options: Any) -> None:
    """Say what an array of gyros is worth: fusion, working modes, failures, reliability.

    GEOMETRY is triad, triad-plus-one, symmetric4, cone4 (cone5 ...), tetrahedron, skewed4,
    dodecahedron, or a TOML file with directions.

    \b
      schuler array symmetric4 --json -
      schuler array mine.toml --mtbf 20000 --coverage 0.95 --report mine.html
    """  # noqa: D301
    from schuler.sensors import ArrayFigures, Lifetime, Reliability, load_array

    array = load_array(options["geometry"])
    life = Lifetime(options["mtbf"], options["weibull"])
    reliability = Reliability(array, life, options["coverage"])
    convert = Seconds().convert
    hours = [convert(t.strip(), None, None) / 3600.0 for t in options["mission"].split(",")]
    found = ArrayFigures(array, reliability, hours)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(found)


@command.command("faults", cls=Command)
@file_options
@click.option("--window", type=Seconds(above=0.0, high=1e6), default="1s", show_default=True,
              help="Time that is tested at once: long ones find small faults, late.")  # fmt: skip
@click.option("--false-alarm", type=Number(1e-12, 0.1), default=1e-4, show_default=True,
              metavar="P", help="Chance that a window without a fault alarms.")  # fmt: skip
@click.option("--reference", type=Seconds(above=0.0, high=1e7), default="60s", show_default=True,
              help="Time at the start in which the gyros are sound.")  # fmt: skip
@click.option("--heal", type=Count(1, 100_000), default=10, show_default=True, metavar="N",
              help="Windows after which an excluded gyro that agrees is taken back.")  # fmt: skip
@json_option("Write events and rates as JSON (- : here).")
@report_option("Draw the test over the record.")
def faults(**options: Any) -> None:
    """Test the parity of an array's gyros over FILE: detect, isolate, exclude, take back.

    FILE has a column for each gyro; --array names their geometry. Four gyros show that one is
    wrong, five which one.

    \b
      schuler array faults record.csv --array cone5
      schuler array faults record.csv --array mine.toml --window 10s --report faults.html
    """  # noqa: D301
    from schuler.cli.common import open_file
    from schuler.io import array_increments
    from schuler.sensors import load_array, scan_faults

    if options["array"] is None:
        raise InputError("say the geometry of the gyros: --array NAME or a TOML file")
    settings = {key: options.pop(key) for key in ("window", "false_alarm", "reference", "heal")}
    json_to, report_to = options.pop("json_to"), options.pop("report_to")
    array = load_array(options["array"])
    begin, end = options.pop("start"), options.pop("stop")
    if begin is not None or end is not None:
        raise InputError("the whole record is tested: leave out --start and --stop")
    source, finish = open_file(options)
    time, increments, interval = array_increments(source)
    found = scan_faults(array, time, increments, interval, **settings)
    if json_to is not None:
        emit_json(found.to_dict(), json_to)
    draw(found, report_to)
    if wants_text():
        echo(found)
    finish()
    say_warnings(source.contradictions)
