"""The command ``schuler rotation``: what turning the instrument does to hours of errors."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import Group, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option
from schuler.cli.completion import scenarios
from schuler.cli.parameters import Count, InputFile, Number, OutputFile, Seconds
from schuler.errors import InputError

__all__ = ["command"]


@click.group("rotation", cls=Group)
def command() -> None:
    """Compare, look at and search for schemes of rotation modulation."""


@command.command("compare")
@click.argument("scenario", type=InputFile(), metavar="SCENARIO.toml", shell_complete=scenarios)
@click.option("--check", is_flag=True, help="Navigate the scenario's own heading in full as well.")
@json_option("Write all rows as JSON (- : here).")
@report_option("Draw the reductions.")
def compare(**options: Any) -> None:
    """Compare the end error fixed, turned about one axis, and about two.

    \b
      schuler rotation compare four_gyro_rotation.toml
      schuler rotation compare four_gyro_rotation.toml --json - --report rotation.html
    """  # noqa: D301
    from schuler.modulation import RotationCase, compare_rotation

    case = RotationCase.from_toml(options["scenario"])
    found = compare_rotation(case)
    if options["check"]:
        found = found.checked()
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(found)


@command.command("run")
@click.argument("scenario", type=InputFile(), metavar="SCENARIO.toml", shell_complete=scenarios)
@click.option("--heading", type=Number(-360.0, 360.0, unit="deg"), metavar="DEG",
              help="In place of the scenario's.")  # fmt: skip
@click.option("--table", "table_to", type=OutputFile(".csv", ".parquet"), metavar="FILE",
              help="Write all curves as a table: .csv or .parquet.")  # fmt: skip
@click.option("--picture", "picture_to", type=OutputFile(".png", ".svg"), metavar="FILE",
              help="Draw the curves as .png or .svg (needs Matplotlib).")  # fmt: skip
@json_option("Write ends, largest values and curves as JSON (- : here).")
@report_option("Draw the curves.")
def run(**options: Any) -> None:
    """Draw position, velocity and attitude error over the hours: fixed, one axis, two axes.

    \b
      schuler rotation run four_gyro_rotation.toml --report hours.html
      schuler rotation run four_gyro_rotation.toml --picture hours.svg --table hours.csv
    """  # noqa: D301
    from dataclasses import replace

    from schuler.modulation import RotationCase, rotation_history

    case = RotationCase.from_toml(options["scenario"])
    if options["heading"] is not None:
        case = replace(case, heading=options["heading"])
    found = rotation_history(case)
    if options["table_to"] is not None:
        found.write_table(options["table_to"])
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    if options["picture_to"] is not None:
        from schuler.reports.results import write_plot

        write_plot(found, options["picture_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(found)


@command.command("residual")
@click.argument("scheme", type=InputFile(), metavar="NAME|TOML")
@click.option("--lat", type=Number(-90.0, 90.0, unit="deg"), default=45.0, show_default=True,
              metavar="DEG", help="Of the Earth's rate, which scale factors see.")  # fmt: skip
@click.option(
    "--rate",
    type=Number(above=0.0, high=1e5, unit="deg/s"),
    metavar="DEG/S",
    help="Of a named scheme's turns (10).",
)
@click.option("--dwell", type=Seconds(0.0, 1e6), metavar="TIME", help="Of a named scheme.")
@json_option("Write the averages as JSON (- : here).")
def scheme_residual(**options: Any) -> None:
    """Say what a scheme leaves of each error on average.

    \b
      schuler rotation residual reciprocating --rate 6 --lat 34.2
      schuler rotation residual mine.toml --json -
    """  # noqa: D301
    from schuler.modulation import scheme_residual as average
    from schuler.motion import SCHEMES, Limits, load_scheme, named_scheme

    name, rate, dwell = options["scheme"], options["rate"], options["dwell"]
    if name in SCHEMES:
        scheme = named_scheme(name, dwell=dwell, limits=Limits(rate or 10.0))
    elif rate is not None or dwell is not None:
        raise InputError("--rate and --dwell are for named schemes; a file says them itself")
    else:
        scheme = load_scheme(name)
    data = {
        "schema": "schuler.residual/1", "name": scheme.name, "latitude_deg": options["lat"],
        **average(scheme).to_dict(options["lat"]),
    }  # fmt: skip
    if options["json_to"] is not None:
        emit_json(data, options["json_to"])
    if not wants_text():
        return
    echo(f"{scheme.name}: period {data['period_s']:.6g} s, table steps {len(scheme.steps)}")
    echo("left of                     x          y          z   of the IMU's axes, largest")
    for label, key, unit in (
        ("bias", "bias_left", "of it"),
        ("scale factor, table", "scale_factor_with_table_deg_h_per_ppm", "deg/h per ppm"),
        ("scale factor, Earth", "scale_factor_with_earth_deg_h_per_ppm", "deg/h per ppm"),
        ("asymmetry", "asymmetry_deg_h_per_ppm", "deg/h per ppm"),
    ):
        rows = data[key]
        worst = [max(abs(rows[i][j]) for i in range(3)) for j in range(3)]
        # Below that is the rounding of the averages.
        shown = "  ".join(f"{v if v > 1e-9 else 0.0:9.3g}" for v in worst)
        echo(f"{label:<20}  {shown}   {unit}")
    value = data["misalignment_largest_deg_h_per_arcsec"]
    echo(f"{'misalignment':<20}  {value if value > 1e-9 else 0.0:9.3g} deg/h per arcsec")
    echo(f"{'random walk':<20}  {1.0:9.3g} of it")


@command.command("optimise")
@click.option(
    "--turns", type=Count(2, 1000), default=16, show_default=True, help="Half turns in a period."
)
@click.option("--gyro-bias", default="0.01 deg/h", show_default=True)
@click.option("--scale", default="10 ppm", show_default=True)
@click.option("--misalignment", default="10 arcsec", show_default=True)
@click.option("--asymmetry", default="1 ppm", show_default=True)
@click.option("--dwell", type=Seconds(0.0, 1e6), default=20.0, show_default=True, metavar="TIME")
@click.option(
    "--rate",
    type=Number(above=0.0, high=1e5, unit="deg/s"),
    default=10.0,
    show_default=True,
    metavar="DEG/S",
)
@click.option(
    "--acceleration",
    type=Number(above=0.0, high=1e6, unit="deg/s^2"),
    default=20.0,
    show_default=True,
    metavar="DEG/S^2",
)
@click.option(
    "--travel",
    type=Number(above=0.0, high=1e6, unit="deg"),
    metavar="DEG",
    help="Without slip rings: furthest turn.",
)
@click.option("--seed", type=Count(0, 2**63), default=0, show_default=True)
@click.option("--tries", type=Count(1, 100_000), default=400, show_default=True)
@click.option("--out", "out_to", type=OutputFile(".toml"), metavar="TOML", help="Write the scheme.")
def optimise(**options: Any) -> None:
    """Search for the order of half turns about two axes that leaves the least drift.

    \b
      schuler rotation optimise --turns 16 --scale "20 ppm" --out best.toml
    """  # noqa: D301
    import numpy as np

    from schuler.constants import DEG_PER_HOUR
    from schuler.modulation import optimise_scheme
    from schuler.motion import Dwell, Limits
    from schuler.units import parse

    scheme, drift = optimise_scheme(
        options["turns"],
        bias=parse(options["gyro_bias"], "angular rate", "gyro-bias"),
        scale=parse(options["scale"], "ratio", "scale"),
        misalignment=parse(options["misalignment"], "angle", "misalignment"),
        asymmetry=parse(options["asymmetry"], "ratio", "asymmetry"),
        dwell=options["dwell"],
        limits=Limits(options["rate"], options["acceleration"], options["travel"]),
        rng=np.random.default_rng(options["seed"]),
        tries=options["tries"],
    )
    if options["out_to"] is not None:
        from pathlib import Path

        import tomli_w

        from schuler._files import replacing

        with replacing(Path(options["out_to"])) as part:
            part.write_text(tomli_w.dumps(scheme.to_dict()), encoding="utf-8")
    words = [
        f"{'+' if step.angle > 0 else '-'}{step.axis}"
        for step in scheme.steps
        if not isinstance(step, Dwell)
    ]
    echo(f"{scheme.name}: {' '.join(words)}")
    echo(f"period {scheme.period:.6g} s; leaves {drift / DEG_PER_HOUR:.3g} deg/h (1 sigma)")
