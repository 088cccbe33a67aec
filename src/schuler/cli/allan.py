"""The command ``schuler allan``, which finds an instrument's noise in a static record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import add_output, echo, wants_text
from schuler.cli.common import (
    Look,
    draw,
    emit_json,
    file_options,
    json_option,
    open_file,
    progress,
    report_option,
    say_warnings,
)
from schuler.cli.many import ManyCommand
from schuler.cli.parameters import Number, OutputFile
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.allan_variance.deviation import Allan
    from schuler.allan_variance.noise_fit import NoiseFit

__all__ = ["command"]


@click.command("allan", cls=ManyCommand)
@file_options
@click.option(
    "--kind",
    type=click.Choice(["allan", "hadamard", "total"]),
    default="allan",
    show_default=True,
    help="Overlapping Allan; Hadamard, blind to a steady drift; or total, for long times.",
)
@click.option("--taus", metavar="LIST", help="Averaging times, as 0.1s,1s,10s,5min.")
@click.option(
    "--channel",
    "channels",
    metavar="NAME",
    multiple=True,
    help="Only this one: gyro-x, accel-z ... (may be given several times).",
)
@json_option("Write the result as JSON (- : here); of several records a .jsonl.", ".jsonl")
@report_option("Draw the curves and the fit.")
@click.option(
    "--save-spec",
    type=OutputFile(".toml"),
    metavar="OUT.toml",
    help="Write the fitted noise as a specification (--spec).",
)
@click.option(
    "--gyro-bias", metavar="VALUE", help="Gyro bias for --save-spec (1 sigma), as '0.01 deg/h'."
)
@click.option(
    "--accel-bias", metavar="VALUE", help="Accelerometer bias for --save-spec, as '50 ug'."
)
@click.option(
    "--export",
    "exports",
    type=(click.Choice(["kalibr", "openvins", "vins", "px4", "ros"]), str),
    metavar="TOOL FILE",
    multiple=True,
    help="Write another tool's parameters: kalibr, openvins, vins, px4, ros (several times).",
)
@click.option(
    "--inflate",
    type=Number(above=0.0, high=1e6),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="What the densities of --export are multiplied by.",
)
@click.option(
    "--by-axis",
    is_flag=True,
    help="Write x, y and z of each figure into the specification, not their rms.",
)
@click.option("--note", metavar="TEXT", help="Said in the specification of --save-spec.")
def command(**options: Any) -> None:
    """Tell the noise of each sensor from FILE, a record of an instrument at rest.

    Averaging times are four an octave up to a third of the record when --taus is not given. The fit
    finds quantisation, random walk, bias instability, rate random walk and a steady drift (rate
    ramp), with 1-sigma; a term that is not observable in the record has a limit (95 %) instead.

    \b
      schuler allan static.csv --gyro deg/s --accel g --report noise.html
      schuler allan static.csv --gyro deg/s --accel g --save-spec mine.toml
      schuler align truck.csv --gyro deg/s --accel g --lat 48.1 --spec mine.toml
      schuler allan static.bag --topic /imu/data --export kalibr imu.yaml --inflate 10
    """  # noqa: D301
    from schuler.allan_variance.deviation import allan
    from schuler.allan_variance.fit import fit_noise
    from schuler.allan_variance.output import save_spec, to_dict

    kind, taus = options.pop("kind"), _times(options.pop("taus"))
    wanted = [name.replace("-", "_") for name in options.pop("channels")]
    json_to, report_to, spec_to = (options.pop(k) for k in ("json_to", "report_to", "save_spec"))
    added = _added(
        spec_to, *(options.pop(k) for k in ("gyro_bias", "accel_bias", "note", "by_axis"))
    )
    exports, inflate = options.pop("exports"), options.pop("inflate")
    if inflate != 1.0 and not exports:
        raise InputError("--inflate is for the densities of --export: say --export TOOL FILE")
    for _, path in exports:
        add_output("--export", path)
    topic = options["topic"] if (options["topic"] or "").startswith("/") else "/imu0"
    start, stop = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    look = Look(source)
    with progress(source, source.chunks(start=start, stop=stop)) as chunks:
        found = allan(look.through(chunks), taus, kind)
    if wanted:
        found = found.select(wanted)
    fit: NoiseFit | None = None
    warnings = list(source.quality.warnings() if source.quality else ()) + found.warnings()
    try:
        fit = fit_noise(found)
    except InputError as error:
        if spec_to is not None or exports:
            raise
        warnings.append(str(error))
    else:
        warnings += fit.warnings()
    if json_to is not None:
        emit_json({**to_dict(found, fit), **source.how_read()}, json_to)
    draw(found if fit is None else fit, report_to)
    if spec_to is not None and fit is not None:
        save_spec(fit, spec_to, **added)
    if fit is not None:
        for tool, path in exports:
            fit.export(tool, path, inflate=inflate, topic=topic)
    if wants_text():
        _print(found, fit)
    finish()
    say_warnings([*warnings, *look.notes(at_rest=False), *source.contradictions])


def _added(
    spec_to: str | None, gyro_bias: str | None, accel_bias: str | None, note: str | None,
    by_axis: bool,
) -> dict[str, Any]:  # fmt: skip
    """Return what the specification is to hold that no record shows."""
    from schuler.units import parse

    if spec_to is None and (gyro_bias or accel_bias or note):
        raise InputError("--gyro-bias, --accel-bias and --note go into a file: say --save-spec")
    if spec_to is None and by_axis:
        raise InputError("--by-axis is about the specification: say --save-spec")
    out: dict[str, Any] = {"note": note or "", "by_axis": by_axis}
    for key, text, dimension in (
        ("gyro_bias", gyro_bias, "angular rate"), ("accel_bias", accel_bias, "acceleration"),
    ):  # fmt: skip
        if text is not None:
            out[key] = parse(text, dimension, f"--{key.replace('_', '-')}")
            if out[key] < 0:
                raise InputError(
                    f"--{key.replace('_', '-')} '{text}' is negative; give a 1-sigma magnitude"
                )
    return out


def _times(text: str | None) -> list[float] | None:
    if text is None:
        return None
    from schuler.units import parse

    out = []
    for part in text.split(","):
        try:
            out.append(float(part))
        except ValueError:
            out.append(parse(part.strip(), "time", "--taus"))
    return out


def _print(found: Allan, fit: NoiseFit | None) -> None:
    """Print the curves and the fit for people."""
    from schuler.allan_variance.output import curve_lines, fit_lines

    for line in curve_lines(found):
        echo(line)
    if fit is not None:
        for line in fit_lines(fit):
            echo(line)
