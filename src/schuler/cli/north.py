"""The command ``schuler north``, one gyro on an indexing table."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import CONTRADICTED, Command, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option
from schuler.cli.completion import files
from schuler.cli.parameters import InputFile, Number
from schuler.errors import InputError

__all__ = ["command"]


@click.command("north", cls=Command)
@click.argument("files", type=InputFile(), nargs=-1, required=True, shell_complete=files)
@click.option(
    "--angles", required=True, metavar="LIST", help="Table angle of each file, deg: 0,120,240."
)
@click.option(
    "--gyro", default="deg/h", show_default=True, metavar="UNIT", help="Unit of a reading."
)
@click.option(
    "--lat",
    type=Number(-89.9, 89.9, unit="deg"),
    metavar="DEG",
    help="Latitude; fixes the amplitude.",
)
@json_option()
@report_option("Draw readings and cosine.")
def command(**options: Any) -> int:
    """Find north with one gyro: FILES hold its readings, one file a table angle.

    The last number of each row is the reading. The result is the table angle at which the input
    axis points north.

    \b
      schuler north a.txt b.txt c.txt --angles 0,120,240
    """  # noqa: D301
    import numpy as np

    from schuler.alignment.table_north import load_readings, table_north
    from schuler.constants import DEG
    from schuler.units import parse

    try:
        angles = [float(text) for text in options["angles"].split(",")]
    except ValueError:
        raise InputError(
            f"--angles: expected numbers with commas, got '{options['angles']}'"
        ) from None
    lat = options["lat"]
    unit = parse(f"1 {options['gyro']}", "angular rate", "--gyro")
    readings = [load_readings(name, unit) for name in options["files"]]
    found = table_north(np.array(angles), readings, latitude=None if lat is None else lat * DEG)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(str(found))
    return 0 if found.consistent else CONTRADICTED
