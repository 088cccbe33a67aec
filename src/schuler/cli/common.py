"""What several commands share: options for files, places and times; writing; progress."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from schuler.cli.command import echo, made_by
from schuler.cli.completion import files
from schuler.cli.drawing import draw, draws, report_option
from schuler.cli.parameters import InputFile, Number, OutputFile, RecordTime, Seconds
from schuler.cli.progress import shares
from schuler.cli.run_file import mapping_of_run, note_mapping, save_run
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.earth import Site
    from schuler.io import Source
    from schuler.record import ImuRecord
    from schuler.sensors import ImuSpec

__all__ = [
    "Look",
    "draw",
    "draws",
    "emit_json",
    "file_options",
    "gravity_known",
    "gravity_options",
    "json_option",
    "open_file",
    "progress",
    "reading_options",
    "report_option",
    "say_warnings",
    "site_options",
    "site_or_none",
    "working",
]

_LONG_WORK = 300_000
"""Samples from which a bar shows how far a filter is."""

F = TypeVar("F", bound=Callable[..., Any])

_MAPPING_KEYS = (
    "columns", "gyro", "accel", "time", "mean_rates", "axes", "rate", "start_time",
    "coning_corrected", "sculling_corrected", "array", "delimiter", "comment", "decimal",
    "skip_rows", "header", "variables", "format", "topic", "imu_type", "accel_file", "accel_topic",
)  # fmt: skip


def _stack(options: list[Callable[[Any], Any]]) -> Callable[[F], F]:
    def decorate(function: F) -> F:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


#: everything that says what is in a file
reading_options = _stack(
    [
        click.option(
            "--columns", metavar="NAMES",
            help="Columns for t,gx,gy,gz,ax,ay,az: names, numbers from 1, or _ to pass one over.",
        ),
        click.option(
            "--gyro", metavar="UNIT",
            help="Unit of the gyros: rad/s, deg/s, deg/h ... are rates, rad, deg, '0.1 arcsec' "
            "... increments.",
        ),
        click.option(
            "--accel", metavar="UNIT",
            help="Unit of the accelerometers: m/s^2, g, mg ... are rates, m/s, g*s ... increments.",
        ),
        click.option("--time", metavar="UNIT", help="Unit of the time column (s)."),
        click.option(
            "--axes", metavar="XYZ",
            help="Where x, y, z point: RFU (the default), FRD, FLU, or '-y,x,z'.",
        ),
        click.option(
            "--mean-rates/--instantaneous-rates", "mean_rates", default=None,
            help="Rates are means over the interval that ends at the row, or instantaneous.",
        ),
        click.option(
            "--rate", metavar="HZ", help="Sampling rate; replaces the time column.",
        ),
        click.option("--start-time", metavar="S", help="Time of the first row, with --rate."),
        click.option(
            "--coning-corrected/--no-coning-corrected", default=None,
            help="Whether the instrument has corrected its angle increments for coning.",
        ),
        click.option(
            "--sculling-corrected/--no-sculling-corrected", default=None,
            help="Whether the instrument has corrected its velocity increments for sculling.",
        ),
        click.option(
            "--array", type=InputFile(), metavar="NAME|TOML",
            help="Geometry of redundant gyros (see schuler array): t,g1,g2 ...,ax,ay,az are fused.",
        ),
        click.option("--delimiter", metavar="CHAR", help="What separates cells of a text file."),
        click.option("--comment", metavar="CHAR", help="What starts a comment in a text file."),
        click.option("--decimal", metavar="CHAR", help="Decimal mark of a text file."),
        click.option("--skip-rows", metavar="N", help="Lines of a text file to pass over first."),
        click.option(
            "--header/--no-header", default=None, help="Whether a text file names its columns.",
        ),
        click.option(
            "--variables", metavar="NAMES", help="Arrays of a .mat or .npz: gyro=w,accel=f,time=t.",
        ),
        click.option(
            "--format", metavar="NAME",
            help="Reader to use, for files without marks, as kf-gins; else the content decides.",
        ),
        click.option(
            "--topic", metavar="NAME",
            help="Which stream of a log: a ROS topic, vehicle_imu:1 (ULog), RAWIMUSX (NovAtel).",
        ),
        click.option(
            "--imu-type", metavar="NAME",
            help="Instrument of a NovAtel log that does not say it, as HG4930_AN01 or 58.",
        ),
        click.option(
            "--mapping", type=InputFile(), metavar="TOML",
            help="A file that says all of the above; FILE.toml beside FILE is found by itself.",
        ),
        click.option(
            "--save-mapping", is_flag=True,
            help="Write what was said into FILE.toml, so that it is typed once.",
        ),
        click.option("--max-gap", type=Seconds(0.0), help="Longest gap that is bridged."),
        click.option(
            "--accel-file", type=InputFile(), metavar="FILE",
            help="The accelerometers, where FILE holds the gyros alone; joined on their clock.",
        ),
        click.option(
            "--accel-topic", metavar="NAME",
            help="The accelerometers' topic, where --topic holds the gyros alone.",
        ),
        click.option(
            "--start", "--from", "start", type=RecordTime(),
            help="Use the record from this time on: 100s by its clock, +60s from its first row.",
        ),
        click.option(
            "--stop", "--to", "stop", type=RecordTime(),
            help="Use the record up to this time, said likewise.",
        ),
        click.option(
            "--keep-spikes", is_flag=True,
            help="Take single samples far beyond their neighbours as they are.",
        ),
    ]
)  # fmt: skip


def file_options(function: F) -> F:
    """Add the file, and everything that says what is in it."""
    argument = click.argument("file", type=InputFile(sidecar=True), shell_complete=files)
    return argument(reading_options(function))


def json_option(text: str = "Write the result as JSON (- : here).", *more: str) -> Callable[[F], F]:
    """Return the option ``--json OUT``, as `json_to`, which may end in .json and in more."""
    return click.option(
        "--json", "json_to", type=OutputFile(".json", *more), metavar="OUT", help=text
    )


#: where the vehicle stands
site_options = _stack(
    [
        click.option(
            "--lat",
            type=Number(-90.0, 90.0, unit="deg"),
            metavar="DEG",
            help="Latitude, north positive.",
        ),
        click.option(
            "--lon",
            type=Number(-360.0, 360.0, unit="deg"),
            metavar="DEG",
            help="Longitude (not needed for north).",
        ),
        click.option(
            "--height",
            type=Number(-12_000.0, 1e6, unit="m"),
            metavar="M",
            help="Height above the ellipsoid.",
        ),
    ]
)

#: how well gravity is known there
gravity_options = _stack(
    [
        click.option(
            "--gravity-sigma",
            type=Number(0.0, 1000.0, unit="mGal"),
            metavar="MGAL",
            help="1-sigma of gravity about normal gravity, 20 mGal if not given.",
        ),
        click.option(
            "--deflection-sigma",
            type=Number(0.0, 120.0, unit="arcsec"),
            metavar="ARCSEC",
            help="1-sigma of the deflection of the vertical, 5 arcsec if not given.",
        ),
    ]
)


def open_file(
    options: dict[str, Any], wait: float | None = None, spec: ImuSpec | None = None
) -> tuple[Source, Callable[..., None]]:
    """Open the file of `file_options`, taking its options out of the dictionary.

    Returns
    -------
    Source, callable
        The second says what was assumed and noted, and saves the mapping and the run where that is
        asked for; call it once all has gone well, with ``notes=False`` where they are shown
        already.
    """
    from schuler.io import Mapping, open_source

    said = {key: options.pop(key) for key in _MAPPING_KEYS}
    path, save = options.pop("file"), options.pop("save_mapping")
    mapping, run_to = options.pop("mapping"), options.pop("save_run_to", None)
    base = Mapping.from_toml(mapping) if mapping else None
    given = (mapping_of_run() or Mapping()).merged(base).merged(Mapping.from_cli(**said))
    if save and str(path) == "-":
        raise InputError("--save-mapping: standard input has no place to save it beside")
    beside = Path(f"{path}.toml")
    note_mapping((Mapping.from_toml(beside) if beside.is_file() else Mapping()).merged(given))
    if run_to is not None and str(path) == "-":
        raise InputError("--save-run: standard input cannot be read again; name the record's file")
    bias = None if spec is None else spec.gyro.bias
    source = open_source(
        path, given, max_gap=options.pop("max_gap"), keep_spikes=options.pop("keep_spikes"),
        wait=wait, gyro_bias=bias,
    )  # fmt: skip

    def finish(notes: bool = True) -> None:
        """Say what the reader found, after the work."""
        # After the work: an error is one sentence.
        if source.assumed:
            echo(f"note: assumed: {'; '.join(source.assumed)}", err=True)
        for note in source.notes if notes else ():
            echo(f"note: {note}", err=True)
        if save:
            before = Mapping.from_toml(beside) if beside.is_file() else Mapping()
            before.merged(given).to_toml(beside)
        if run_to is not None:
            save_run(run_to)

    return source, finish


def gravity_known(options: dict[str, Any]) -> dict[str, float]:
    """Return what `gravity_options` say, taken out of the options, for a `Site`."""
    said = {key: options.pop(key, None) for key in ("gravity_sigma", "deflection_sigma")}
    return {key: float(value) for key, value in said.items() if value is not None}


def site_or_none(options: dict[str, Any], source: Source | None = None) -> Site | None:
    """Return the site of `site_options`, or of the file's header, or None."""
    from schuler.earth import Site

    known = gravity_known(options)
    lat, lon, height = (options.pop(key) for key in ("lat", "lon", "height"))
    if lat is None and source is not None and source.position is not None:
        found = source.position
        source.notes.append(
            f"the position is the file's own: {found[0]:.6f} N, {found[1]:.6f} E, {found[2]:g} m"
        )
        return Site(
            found[0],
            found[1] if lon is None else lon,
            found[2] if height is None else height,
            **known,
        )
    if lat is None:
        if lon is not None or height is not None:
            raise InputError("a place needs its latitude: say --lat")
        return None
    return Site(lat, lon or 0.0, height or 0.0, **known)


@contextmanager
def progress(source: Source, chunks: Iterable[ImuRecord]) -> Iterator[Iterator[ImuRecord]]:
    """Pass chunks on, with a bar on standard error when a person watches and it takes long."""
    if (source.size or 0) < 30_000_000:
        yield iter(chunks)
        return
    with shares("reading") as tell:

        def passed_on() -> Iterator[ImuRecord]:
            for chunk in chunks:
                yield chunk
                if tell is not None:
                    tell(source.progress or 0.0)

        yield passed_on()


@contextmanager
def working(what: str, samples: int) -> Iterator[Callable[[float], None] | None]:
    """Give a function that shows a share of work as a bar, when a person watches and it is long."""
    if samples < _LONG_WORK:
        yield None
        return
    with shares(what) as tell:
        yield tell


class Look:
    """Looks at the samples that a command reads, for the check that all commands share.

    Parameters
    ----------
    source : Source
    """

    def __init__(self, source: Source) -> None:
        from schuler.record import Summariser

        self._source = source
        self._summariser = Summariser()
        self._taken = False

    def through(self, chunks: Iterable[ImuRecord]) -> Iterator[ImuRecord]:
        """Pass chunks on, and look at each."""
        for chunk in chunks:
            self._summariser.push(chunk)
            self._taken = True
            yield chunk

    def notes(self, site: Site | None = None, *, at_rest: bool = True) -> list[str]:
        """Return what gravity and the Earth's rate say against units and axes."""
        from schuler.record import check_record

        if not self._taken:
            return []
        summary = self._summariser.summary()
        return check_record(summary, self._source.reading, site, at_rest=at_rest)


def emit_json(data: dict[str, Any], target: str) -> None:
    """Write JSON with where it is from to a file, or to standard output for ``-``."""
    import json

    text = json.dumps({**data, "provenance": made_by()}, indent=2, allow_nan=False) + "\n"
    from schuler._files import replacing

    with replacing(Path(target)) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def say_warnings(texts: Iterable[str]) -> None:
    """Print warnings to standard error."""
    for text in texts:
        echo(f"warning: {text}", err=True)
