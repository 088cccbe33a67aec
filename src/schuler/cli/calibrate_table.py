"""The commands ``schuler calibrate sixpos``, ``rate`` and ``turntable``: tests on a turntable."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from schuler.cli.command import Command, echo, wants_text
from schuler.cli.common import (
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
from schuler.cli.completion import files
from schuler.cli.parameters import InputFile, Number, OutputFile, Seconds
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.calibration import TableTest

__all__ = ["rate", "sixpos", "turntable"]

F = TypeVar("F", bound=Callable[..., Any])


def _results(function: F) -> F:
    """Add what every test on a table writes, and the calibration that it goes on from."""
    for option in (
        report_option("Draw dwells or turns, and what the fit leaves."),
        json_option(),
        click.option(
            "--out", type=OutputFile(".toml"), metavar="TOML",
            help="Write the calibration for `schuler align`.",
        ),
        click.option(
            "--base", type=InputFile(), metavar="TOML",
            help="An earlier calibration, which has what is not observable in this test.",
        ),
    ):  # fmt: skip
        function = option(function)
    return function


def _static(function: F) -> F:
    """Add the options of a test in positions."""
    for option in (
        click.option("--initial", type=Seconds(0.5), default="1s", show_default=True,
                     help="Rest at the start."),
        click.option("--gravity", type=Number(9.0, 10.5, unit="m/s^2"), metavar="M/S^2",
                     help="At the place; else it follows from --lat (and --height)."),
        site_options, reading_options,
        click.argument("files", type=InputFile(sidecar=True), nargs=-1, required=True,
                       shell_complete=files),
    ):  # fmt: skip
        function = option(function)
    return function


@click.command("sixpos", cls=Command)
@_static
@_results
def sixpos(**options: Any) -> None:
    """Calibrate the accelerometers in six positions: each axis up and down.

    FILES: one record in which the dwells are found, or six of one dwell each, in any order.

    \b
      schuler calibrate sixpos bench.csv --gyro deg/s --accel g --lat 48.1 --out mine.toml
    """  # noqa: D301
    _positions(options, 6)


@click.command("turntable", cls=Command)
@_static
@click.option("--positions", type=click.Choice(["6", "12", "18", "24"]), metavar="N",
              help="6, 12, 18 or 24 are expected; without it they are recognised.")  # fmt: skip
@click.option(
    "--sequence", type=InputFile(), metavar="TOML",
    help="Where the table was: [[position]] with attitude = [psi, theta, gamma], start, stop.",
)  # fmt: skip
@_results
def turntable(**options: Any) -> None:
    """Calibrate in 12, 18 or 24 positions of a table, or in a sequence of your own.

    FILES: one record in which the dwells are found (or their times are in the sequence), or one
    for each dwell. Without --positions and --sequence the positions are recognised: directions of
    up from the force, headings from the turns. With attitudes and --lat the gyros' bias is found
    as well.

    \b
      schuler calibrate turntable table.csv --lat 48.1 --base rates.toml --out mine.toml
      schuler calibrate turntable table.csv --positions 18 --lat 48.1 --out mine.toml
      schuler calibrate turntable table.csv --sequence table.toml --lat 48.1 --base rates.toml
    """  # noqa: D301
    from schuler.calibration import positions_from_toml

    count, path = options.pop("positions"), options.pop("sequence")
    if count is not None and path is not None:
        raise InputError("say --positions, or where the table was by --sequence, not both")
    positions: Any = None if count is None else int(count)
    _positions(options, positions if path is None else positions_from_toml(path))


def _positions(options: dict[str, Any], positions: Any) -> None:
    from schuler.calibration import Calibration, calibrate_positions

    paths = options.pop("files")
    write, base = _writer(options), options.pop("base")
    given, initial = options.pop("gravity"), options.pop("initial")
    begin, end = options.pop("start"), options.pop("stop")
    place = {key: options.pop(key) for key in ("lat", "lon", "height")}
    records, finishers, source = [], [], None
    for path in paths:
        source, finish = open_file({**options, "file": path})
        records.append(source.read(start=begin, stop=end))
        finishers.append(finish)
    site = site_or_none(place, source)
    if given is None and site is None:
        raise InputError(
            "gravity at the place is the scale of the accelerometers: say --lat (and --height), or "
            "--gravity"
        )
    gravity = given if given is not None else site.gravity if site is not None else 0.0
    found = calibrate_positions(
        records, gravity, positions=positions, site=site, initial=initial,
        base=None if base is None else Calibration.from_toml(base), name=Path(paths[0]).stem,
    )  # fmt: skip
    write(found)
    for finish in finishers:
        finish()
    say_warnings(text for r in records if r.quality is not None for text in r.quality.warnings())


@click.command("rate", cls=Command)
@file_options
@site_options
@click.option(
    "--sequence", type=InputFile(), required=True, metavar="TOML",
    help='The turns: [[turn]] with axis = "z", rate = "10 deg/s", and start, stop if wanted.',
)  # fmt: skip
@_results
def rate(**options: Any) -> None:
    """Calibrate the gyros' bias, scale and axes from turns at known rates.

    Stretches of constant rate are found in FILE in the sequence's order, or their times are given.

    \b
      schuler calibrate rate turns.csv --sequence turns.toml --lat 48.1 --base six.toml --out mine.toml
    """  # noqa: D301, E501
    from schuler.calibration import Calibration, calibrate_rates, turns_from_toml

    turns = turns_from_toml(options.pop("sequence"))
    write, base, name = _writer(options), options.pop("base"), Path(options["file"]).stem
    begin, end = options.pop("start"), options.pop("stop")
    source, finish = open_file(options)
    site = site_or_none(options, source)
    if site is None:
        raise InputError("the Earth's rate along the table's axis is taken off: say --lat")
    record = source.read(start=begin, stop=end)
    base = None if base is None else Calibration.from_toml(base)
    write(calibrate_rates(record, turns, site, base=base, name=name))
    finish()
    say_warnings(source.quality.warnings() if source.quality is not None else [])


def _writer(options: dict[str, Any]) -> Callable[[TableTest], None]:
    """Return what writes and prints a result, as the options ask for."""
    out, json_to, report_to = (options.pop(key) for key in ("out", "json_to", "report_to"))

    def write(found: TableTest) -> None:
        if out is not None:
            found.calibration.to_toml(out)
        if json_to is not None:
            emit_json(found.to_dict(), json_to)
        draw(found, report_to)
        if wants_text():
            echo(found)

    return write
