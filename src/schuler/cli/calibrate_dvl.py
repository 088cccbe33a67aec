"""The command ``schuler calibrate dvl``: scale factor and mounting of a Doppler log."""

from __future__ import annotations

from typing import Any

import click

from schuler import __version__
from schuler.cli.command import Command, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option, say_warnings
from schuler.cli.parameters import InputFile, Number
from schuler.errors import InputError

__all__ = ["dvl"]


@click.command("dvl", cls=Command)
@click.argument("file", type=InputFile())
@click.option(
    "--reference", type=InputFile(), required=True, metavar="FILE",
    help="Trajectory with velocity and attitude, on the same clock: CSV, Parquet, npz.",
)  # fmt: skip
@click.option(
    "--frame", type=click.Choice(["RFU", "FRD", "FLU"]),
    help="Where x, y, z of FILE point (RFU; of a ROS bag FLU).",
)  # fmt: skip
@click.option("--lever", metavar="X,Y,Z", help="From the reference's point to the sensor, m (RFU).")
@click.option(
    "--time-offset", type=Number(unit="s"), default="0", metavar="S",
    help="Added to the times of FILE, to bring them to the reference's clock.",
)  # fmt: skip
@click.option("--topic", metavar="NAME", help="Of a ROS bag: Odometry or a stamped twist.")
@json_option()
@report_option("Draw mounting and residuals.")
def dvl(**options: Any) -> None:
    """Find the scale factor and the mounting of a Doppler log from a reference.

    FILE: time and velocity along the sensor's axes (time, vx, vy, vz, valid).

    \b
      schuler calibrate dvl log.csv --frame FRD --reference ins.csv
    """  # noqa: D301
    from schuler.calibration import fit_body_velocity
    from schuler.io import read_dvl, read_trajectory

    lever = (0.0, 0.0, 0.0)
    if options["lever"] is not None:
        try:
            x, y, z = (float(cell) for cell in options["lever"].split(","))
        except ValueError:
            raise InputError(
                f"--lever: expected three numbers with commas, got '{options['lever']}'"
            ) from None
        lever = (x, y, z)
    log = read_dvl(
        options["file"], frame=options["frame"], lever=lever, offset=options["time_offset"],
        topic=options["topic"],
    )  # fmt: skip
    fit = fit_body_velocity(log, read_trajectory(options["reference"]))
    if options["json_to"] is not None:
        emit_json(
            {
                "schema": "schuler.calibrate-dvl/1", "schuler": __version__,
                "file": options["file"], "dropped": dict(log.dropped), **fit.to_dict(),
            },
            options["json_to"],
        )  # fmt: skip
    draw(fit, options["report_to"])
    if wants_text():
        echo(fit)
        for reason, count in log.dropped.items():
            echo(f"left out  {count} with {reason}")
    say_warnings(fit.warnings)
