"""The command ``schuler calibrate``: coefficients from poses, turns and a centrifuge."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.calibrate_centrifuge import centrifuge
from schuler.cli.calibrate_dvl import dvl
from schuler.cli.calibrate_table import rate, sixpos, turntable
from schuler.cli.command import Group, add_output, echo, wants_text
from schuler.cli.common import (
    Look,
    draw,
    emit_json,
    file_options,
    json_option,
    open_file,
    reading_options,
    report_option,
    say_warnings,
    site_options,
    site_or_none,
)
from schuler.cli.completion import files, specs
from schuler.cli.parameters import InputFile, Number, OutputFile, Seconds
from schuler.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from schuler.io import Source

__all__ = ["command"]


@click.group("calibrate", cls=Group)
def command() -> None:
    """Find an instrument's coefficients from a test."""


@command.command("poses")
@click.argument(
    "files", type=InputFile(sidecar=True), nargs=-1, required=True, shell_complete=files
)
@reading_options
@site_options
@click.option(
    "--gravity",
    type=Number(9.0, 10.5, unit="m/s^2"),
    metavar="M/S^2",
    help="At the place; else it follows from --lat (and --height).",
)
@click.option("--initial", type=Seconds(0.5), default="1s", show_default=True,
              help="Rest at the start.")  # fmt: skip
@click.option("--gyro-scale", metavar="UNIT", help="Of a count, roughly, as '0.01 deg/s'.")
@click.option(
    "--out",
    type=OutputFile(".toml"),
    metavar="TOML",
    help="Write the calibration for `schuler align`.",
)
@click.option(
    "--export",
    "exports",
    type=(click.Choice(["imu_tk", "kalibr", "ros"]), str),
    metavar="TOOL FILE",
    multiple=True,
    help="Write another tool's calibration: imu_tk, kalibr or ros (several times).",
)
@json_option()
@report_option("Draw poses and turns.")
def poses(**options: Any) -> None:
    """Calibrate from an instrument put down by hand in many poses.

    FILES: one record with gyros and accelerometers, or two tables of time and three counts:
    accelerometers, then gyros. Six poses (each axis up and down) show bias and scale, ten or more
    the axes as well. Gravity at the place is the scale: say --lat, or --gravity.

    \b
      schuler calibrate poses bench.csv --gyro deg/s --accel g --lat 48.1 --out mine.toml
      schuler calibrate poses acc.mat gyro.mat --gyro-scale "0.01 deg/s" --gravity 9.8066 --json -
    """  # noqa: D301
    from schuler.calibration import calibrate_poses
    from schuler.units import parse

    files, scale = options.pop("files"), options.pop("gyro_scale")
    out, json_to, report_to = (options.pop(key) for key in ("out", "json_to", "report_to"))
    exports = options.pop("exports")
    for tool, path in exports:
        for ending in (".acc", ".gyro") if tool == "imu_tk" else ("",):
            add_output("--export", f"{path}{ending}")
    if len(files) > 2:
        raise InputError(f"poses takes one record or two tables, got {len(files)} files")
    given, initial = options.pop("gravity"), options.pop("initial")
    common: dict[str, Any] = {"initial": initial, "name": Path(files[0]).stem}
    warnings: list[str] = []
    finish: Callable[..., None] | None = None
    axes: list[list[float]] | None = None
    if len(files) == 1:
        if scale is not None:
            raise InputError("--gyro-scale goes with two tables of counts")
        start, stop = options.pop("start"), options.pop("stop")
        source, finish = open_file({**options, "file": files[0]})
        gravity, said = _gravity(given, options, source)
        record, axes = source.read(start=start, stop=stop), source.axes.matrix()
        warnings += source.quality.warnings() if source.quality else []
        fit = calibrate_poses(record.time, record.accel, record.gyro, gravity=gravity, **common)
        look = Look(source)
        # By hand the force is gravity on average, whichever way it points.
        for _ in look.through([record]):
            warnings += look.notes(at_rest=False)
    else:
        import numpy as np

        unused = [key for key in _READING if options.get(key) not in (None, False)]
        if unused:
            raise InputError(
                f"--{unused[0].replace('_', '-')} goes with one record; two tables hold time and "
                "three counts each"
            )
        gravity, said = _gravity(given, options, None)
        accel, gyro = (_table(path) for path in files)
        if len(accel) != len(gyro) or np.abs(accel[:, 0] - gyro[:, 0]).max() > 0.005:
            raise InputError(
                f"{files[0]} and {files[1]} do not tell of the same instants: expected the same "
                "times in both"
            )
        if scale is None:
            raise InputError("say roughly what a count of the gyros is: --gyro-scale '0.01 deg/s'")
        fit = calibrate_poses(
            accel[:, 0], accel[:, 1:], gyro[:, 1:], counts=True, gravity=gravity,
            gyro_scale=parse(scale, "angular rate", "--gyro-scale"), **common,
        )  # fmt: skip
    fit = replace(fit, gravity_from=said)
    if out is not None:
        fit.calibration.to_toml(out)
    for tool, path in exports:
        from schuler.calibration.export import export_calibration

        export_calibration(
            fit.calibration, tool, path, has_gyros=bool(fit.turn_error.size), axes=axes
        )
    if json_to is not None:
        emit_json(fit.to_dict(), json_to)
    draw(fit, report_to)
    if wants_text():
        echo(fit)
    if finish is not None:
        finish()
    say_warnings([*warnings, *fit.remarks])


#: options that say how one record is read
_READING = (
    "columns", "gyro", "accel", "time", "axes", "mean_rates", "rate", "start_time", "array",
    "delimiter", "comment", "decimal", "skip_rows", "header", "variables", "format", "topic",
    "imu_type", "mapping", "save_mapping", "max_gap", "start", "stop", "accel_file", "accel_topic",
)  # fmt: skip


def _gravity(given: float | None, options: dict[str, Any], source: Source | None) -> Any:
    """Return gravity at the place, and where it is from."""
    if given is not None:
        if options["lat"] is not None:
            raise InputError("gravity is given by --gravity or follows from --lat, not both")
        return given, "as given"
    site = site_or_none(dict(options), source)
    if site is None:
        raise InputError(
            "gravity at the place is the scale of the accelerometers: say --lat (and --height), "
            "or --gravity"
        )
    return site.gravity, f"normal gravity at latitude {site.lat:g} deg, height {site.height:g} m"


def _table(path: str) -> Any:
    """Return a text table of time and three numbers (n, 4)."""
    import warnings

    import numpy as np

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty file is said below
            data = np.loadtxt(path, ndmin=2)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(
            f"{path}: is not a table of numbers ({str(error).splitlines()[0]})"
        ) from None
    if data.shape[1] != 4 or len(data) < 100:
        raise InputError(
            f"{path}: expected 100 rows or more of time and three counts, got {data.shape[0]} rows "
            f"of {data.shape[1]} columns"
        )
    return data


@command.command("systematic")
@file_options
@site_options
@click.option("--align", "rest", type=Seconds(above=0.0), default="60s", show_default=True,
              help="Rest at the start, by which the instrument is aligned.")  # fmt: skip
@click.option("--spec", type=InputFile(), required=True, metavar="GRADE|TOML", shell_complete=specs,
              help="The instrument: its noise, and how large its biases may be.")  # fmt: skip
@click.option(
    "--out",
    type=OutputFile(".toml"),
    metavar="TOML",
    help="Write the calibration for `schuler align`.",
)
@json_option()
@report_option("Draw what was found, with its sigma.")
def systematic(**options: Any) -> None:
    """Calibrate FILE from a navigator's errors: turned in place, at rest between the turns.

    \b
      schuler calibrate systematic turns.csv --lat 48 --spec navigation-fog --out mine.toml
    """  # noqa: D301
    from schuler.alignment import Aligner
    from schuler.calibration import calibrate_systematic
    from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
    from schuler.record import ImuRecord
    from schuler.sensors import load_spec

    rest, out, json_to, report_to = (
        options.pop(key) for key in ("rest", "out", "json_to", "report_to")
    )
    spec = load_spec(options.pop("spec"))
    assert spec is not None
    begin, end = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    site = site_or_none(options, source)
    if site is None:
        raise InputError("the navigator needs its place: say --lat (and --height)")
    look = Look(source)
    record = ImuRecord.concatenate(list(look.through(source.chunks(start=begin, stop=end))))
    aligner = Aligner(site, None, spec, at="start")
    aligner.update(record.between(stop=record.start + rest))
    fix = aligner.solution()
    # Neither noise nor priors may be zero, whatever a specification leaves out.
    settings = {
        "attitude_prior": max(0.02, 1.5 * max(fix.sigma_arcmin) / 60.0) * DEG,
        "gyro_noise": max(spec.gyro.angle_random_walk, 1e-7),
        "accel_noise": max(spec.accelerometer.velocity_random_walk, 1e-5),
        "gyro_bias_prior": max(3.0 * spec.gyro.bias, 0.01 * DEG_PER_HOUR),
        "accel_bias_prior": max(3.0 * spec.accelerometer.bias, 10.0 * MICRO_G),
    }
    fit = calibrate_systematic(record, site, fix.quat_nb, **settings)
    if out is not None:
        fit.calibration.to_toml(out)
    if json_to is not None:
        emit_json(fit.to_dict(), json_to)
    draw(fit, report_to)
    if wants_text():
        echo(fit)
    finish()
    say_warnings([*look.notes(site, at_rest=False), *source.contradictions])


for _each in (centrifuge, dvl, sixpos, rate, turntable):
    command.add_command(_each)
