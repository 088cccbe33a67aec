"""The command ``schuler north``, one gyro on an indexing table."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.common import check_outputs, emit_json
from schuler.cli.completion import files
from schuler.errors import InputError

__all__ = ["command"]


@click.command("north", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("files", nargs=-1, required=True, shell_complete=files)
@click.option(
    "--angles", required=True, metavar="LIST", help="Table angle of each file, deg: 0,120,240."
)
@click.option(
    "--gyro", default="deg/h", show_default=True, metavar="UNIT", help="Unit of a reading."
)
@click.option("--lat", type=float, metavar="DEG", help="Latitude; fixes the amplitude.")
@click.option("--json", "json_to", metavar="OUT", help="Write the result as JSON (- : here).")
@click.option("--report", "report_to", metavar="OUT.html", help="Draw readings and cosine.")
def command(**options: Any) -> None:
    """Find north with one gyro: FILES hold its readings, one file a table angle.

    The last number of each row is the reading. The result is the table angle at which the input
    axis points north.

    \b
      schuler north a.txt b.txt c.txt --angles 0,120,240
    """  # noqa: D301
    import numpy as np

    from schuler.align.table import load_readings, table_north
    from schuler.constants import DEG
    from schuler.units import parse

    check_outputs(options["json_to"], options["report_to"])
    try:
        angles = [float(text) for text in options["angles"].split(",")]
    except ValueError:
        raise InputError(
            f"--angles: expected numbers with commas, got '{options['angles']}'"
        ) from None
    lat = options["lat"]
    if lat is not None and not abs(lat) < 89.9:
        raise InputError(f"--lat: expected degrees between -89.9 and 89.9, got {lat:g}")
    unit = parse(f"1 {options['gyro']}", "angular rate", "--gyro")
    readings = [load_readings(name, unit) for name in options["files"]]
    found = table_north(np.array(angles), readings, latitude=None if lat is None else lat * DEG)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    if options["report_to"] is not None:
        from schuler.report.north import north_report

        north_report(found, options["report_to"])
    if options["json_to"] != "-":
        click.echo(str(found))
