"""The command ``schuler limit``, the best heading that anybody could reach."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import Command, echo, wants_text
from schuler.cli.common import (
    draw,
    emit_json,
    json_option,
    report_option,
    site_options,
    site_or_none,
)
from schuler.cli.completion import specs
from schuler.cli.limit_path import limit_on_path, times_of
from schuler.cli.parameters import InputFile, Number
from schuler.errors import InputError

__all__ = ["command"]


@click.command("limit", cls=Command)
@click.option(
    "--spec",
    type=InputFile(),
    required=True,
    metavar="GRADE|TOML",
    shell_complete=specs,
    help="The instrument: navigation-rlg, navigation-fog, tactical-fog, industrial-mems or a file.",
)
@site_options
@click.option(
    "--time",
    "times",
    metavar="LIST",
    help="Times in all, as 60s,300s,10min (with --positions their dwells are stretched to it).",
)
@click.option(
    "--positions",
    type=InputFile(),
    metavar="TOML",
    help="[[position]] tables: heading_ccw_deg, pitch_deg, "
    'roll_deg, dwell = "300 s". One position without it.',
)
@click.option(
    "--path",
    type=InputFile(),
    metavar="TOML|FILE",
    help="In motion: a scenario file, or a trajectory with velocity and attitude.",
)
@click.option(
    "--aid",
    "aids",
    multiple=True,
    metavar="KIND=SIGMA@RATE",
    help="With --path, what is measured: gnss=0.1m/s,3m@1Hz, odometer=0.1m/s@10Hz, dvl=..., "
    "or master=0.1mrad,0.02m/s@10Hz alone.",
)
@click.option(
    "--rate",
    type=Number(above=0.0, high=1e6, unit="Hz"),
    default=100.0,
    show_default=True,
    metavar="HZ",
    help="Sampling rate: how far rounding averages.",
)
@click.option(
    "--next-yaw",
    metavar="LOW:HIGH",
    help="Suggest the next position: how far the unit can be turned from the last one, deg.",
)
@click.option(
    "--next-tilt",
    type=Number(0.0, 90.0, unit="deg"),
    default=0.0,
    metavar="DEG",
    help="How far it can be tilted there.",
)
@json_option("Write the rows as JSON (- : here).")
@report_option("Draw sigma against time.")
def command(**options: Any) -> None:
    """Print the Cramér-Rao limit of an alignment: in positions at rest, or on a path.

    \b
      schuler limit --spec navigation-fog --lat 40 --time 60s,300s,600s
      schuler limit --spec mine.toml --lat 40 --positions two.toml --json -
      schuler limit --spec navigation-fog --lat 40 --time 300s --next-yaw 0:360
      schuler limit --spec tactical-fog --path route.toml --aid gnss=0.1m/s,3m@1Hz --time 60s,120s
    """  # noqa: D301
    if options["path"] is not None:
        limit_on_path(options)
        return
    if options["aids"]:
        raise InputError("--aid is of the limit on a path: say --path")
    from dataclasses import replace

    from schuler.alignment import Fixture, Position, load_positions, suggest_position
    from schuler.alignment.limit_table import limit_table
    from schuler.sensors import load_spec

    site = site_or_none(options)
    if site is None:
        raise InputError("the limit depends on the latitude: say --lat")
    rate = options["rate"]
    spec = load_spec(options["spec"])
    assert spec is not None
    positions = load_positions(options["positions"]) if options["positions"] else [Position()]
    total = sum(p.dwell for p in positions)
    if options["times"]:
        times = times_of(options["times"])
    elif options["positions"]:
        times = [total]
    else:
        times = [60.0, 300.0, 600.0]

    found = limit_table(spec, site, times, positions, 1.0 / rate)
    if options["next_yaw"] is not None:
        scale = max(times) / total
        done = [replace(p, dwell=p.dwell * scale) for p in positions]
        fixture = Fixture(_range(options["next_yaw"]), options["next_tilt"])
        suggested = suggest_position(
            spec, site, done, fixture, dwell=done[-1].dwell, interval=1.0 / rate
        )
        found = replace(found, suggested=suggested)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"], interval=1.0 / rate)
    if wants_text():
        echo(str(found))


def _range(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    try:
        return float(low), float(high)
    except ValueError:
        raise InputError(f"--next-yaw: expected LOW:HIGH in degrees, got '{text}'") from None
