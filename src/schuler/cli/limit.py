"""The command ``schuler limit``, the best heading that anybody could reach."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import Command, echo, wants_text
from schuler.cli.common import (
    emit_json,
    json_option,
    report_option,
    site_options,
    site_or_none,
)
from schuler.cli.completion import specs
from schuler.cli.parameters import InputFile, Number, Seconds
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
    """Print the Cramér-Rao limit of a static alignment, for any sequence of positions.

    \b
      schuler limit --spec navigation-fog --lat 40 --time 60s,300s,600s
      schuler limit --spec mine.toml --lat 40 --positions two.toml --json -
      schuler limit --spec navigation-fog --lat 40 --time 300s --next-yaw 0:360
    """  # noqa: D301
    from schuler.alignment import (
        Fixture,
        Position,
        load_positions,
        position_limit,
        suggest_position,
    )
    from schuler.constants import DEG_PER_HOUR, MICRO_G
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
        convert = Seconds().convert
        times = [convert(text.strip(), None, None) for text in options["times"].split(",")]
    elif options["positions"]:
        times = [total]
    else:
        times = [60.0, 300.0, 600.0]

    def at(time: float) -> Any:
        if not time > 0:
            raise InputError(f"--time: expected positive times, got {time:g} s")
        scaled = [
            Position(p.heading_ccw_deg, p.pitch_deg, p.roll_deg, p.dwell * time / total, p.turn)
            for p in positions
        ]
        return position_limit(spec, site, scaled, 1.0 / rate)

    limits = [at(t) for t in times]
    rows = [
        {
            "time_s": found.duration,
            "sigma_arcmin": dict(
                zip(("east", "north", "up"), map(float, found.sigma_arcmin), strict=True)
            ),
            "gyro_bias_deg_h": [float(v) / DEG_PER_HOUR for v in found.gyro_bias],
            "accelerometer_bias_ug": [float(v) / MICRO_G for v in found.accel_bias],
        }
        for found in limits
    ]
    suggested = None
    if options["next_yaw"] is not None:
        scale = max(times) / total
        done = [
            Position(p.heading_ccw_deg, p.pitch_deg, p.roll_deg, p.dwell * scale, p.turn)
            for p in positions
        ]
        fixture = Fixture(_range(options["next_yaw"]), options["next_tilt"])
        suggested = suggest_position(
            spec, site, done, fixture, dwell=done[-1].dwell, interval=1.0 / rate
        )
    if options["json_to"] is not None:
        data = {
            "schema": "schuler.limit/2",
            "spec": spec.name,
            "latitude_deg": site.lat,
            "positions": len(positions),
            "rows": rows,
        }
        if suggested is not None:
            p = suggested.position
            data["next"] = {
                "heading_ccw_deg": p.heading_ccw_deg,
                "pitch_deg": p.pitch_deg,
                "roll_deg": p.roll_deg,
                "dwell_s": p.dwell,
                "heading_sigma_arcmin": float(suggested.limit.sigma_arcmin[2]),
            }
        emit_json(data, options["json_to"])
    if options["report_to"] is not None:
        from schuler.reports.limit import limit_report

        limit_report(at, spec, site, positions, times, options["report_to"])
    if wants_text():
        echo(f"limit of phi, and what the test leaves of the biases (body x, y, z): {spec.name}")
        echo(f"{'time s':>10}  {'east':>9}  {'north':>9}  {'up':>9}   {'gyro deg/h':^26}   "
                   f"{'accelerometer ug':^26}")  # fmt: skip
        for row in rows:
            sigma = row["sigma_arcmin"]
            gyro = " ".join(f"{v:8.3g}" for v in row["gyro_bias_deg_h"])
            accel = " ".join(f"{v:8.3g}" for v in row["accelerometer_bias_ug"])
            echo(
                f"{row['time_s']:10.6g}  {sigma['east']:8.4g}'  {sigma['north']:8.4g}'  "
                f"{sigma['up']:8.4g}'   {gyro}   {accel}"
            )
        if suggested is not None:
            p = suggested.position
            echo(
                f"next: psi {p.heading_ccw_deg:.4g}, pitch {p.pitch_deg:.4g}, roll "
                f"{p.roll_deg:.4g} deg for {p.dwell:g} s more: up "
                f"{suggested.limit.sigma_arcmin[2]:.4g}'"
            )


def _range(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    try:
        return float(low), float(high)
    except ValueError:
        raise InputError(f"--next-yaw: expected LOW:HIGH in degrees, got '{text}'") from None
