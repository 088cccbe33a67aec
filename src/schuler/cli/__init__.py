"""The command line: a map of commands, each imported when it is called."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import NoReturn

import click

from schuler import __version__
from schuler.cli.command import Group
from schuler.errors import SchulerError, near, printable

__all__ = ["cli", "main"]

#: what for -> command -> what `schuler --help` says of it; its module has its name
_MAP = {
    "Begin": {
        "demo": "Align a simulated truck and compare with the truth.",
        "completion": "Print what lets a shell complete commands, methods and files.",
    },
    "Find north": {
        "info": "Look at a record: rate, gravity, Earth rate, noise, hints.",
        "align": "Find north: heading, pitch and roll with their uncertainty.",
        "compare": "Run every method and prefilter on one record.",
        "live": "Align samples as they come: UDP, a serial port or a pipe.",
        "north": "Find north with one gyro on an indexing table.",
        "limit": "Say how good an alignment can be at all: no record needed.",
    },
    "Know the instrument": {
        "allan": "Tell an instrument's noise from a static record.",
        "calibrate": "Find an instrument's coefficients from a test.",
        "plan": "Find the best test of an instrument, or manoeuvre for a heading.",
        "array": "Say what an array of redundant gyros is worth.",
    },
    "Navigate": {
        "navigate": "Navigate free-inertially, from a known start.",
        "rotation": "Say what turning the instrument does to its errors.",
    },
    "Simulate and validate": {
        "simulate": "Make a record, and its truth, from a scenario file.",
        "campaign": "Simulate and align many times: is sigma what it says?",
        "published": "Redo published experiments beside what was printed.",
    },
}
_COMMANDS = [name for group in _MAP.values() for name in group]


_LEVELS = ("debug", "info", "warning", "error")

#: errors of writing; files are written by `replacing`, which gives them a name
_OF_A_STREAM = (errno.ENOSPC, errno.EIO, errno.EPIPE, errno.EBADF, errno.EFBIG, errno.EDQUOT)


class _LazyGroup(Group):
    """A group that imports a command only when it is called or asked for help."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return _COMMANDS

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"schuler.cli.{name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Name the command that is nearest to an unknown one."""
        if args and not args[0].startswith("-") and args[0] not in _COMMANDS:
            hint = near(args[0], _COMMANDS)
            raise click.UsageError(f"No such command '{args[0]}'{hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, group in _MAP.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:<10}", text) for name, text in group.items()])


@click.command(cls=_LazyGroup)
@click.version_option(__version__, prog_name="schuler")
def cli() -> None:
    """Inertial alignment, calibration and error control.

    From a raw record of gyros and accelerometers to true north, with the uncertainty that it has.

    \b
      schuler demo                                        try it without a record
      schuler info truck.csv --gyro deg/s --accel g       is this record what I think it is?
      schuler align truck.csv --lat 34.2 --report r.html  where is north?
      schuler COMMAND --help                              options and examples
    """  # noqa: D301


def main(arguments: list[str] | None = None) -> None:
    """Run the command line.

    Every foreseen error is one sentence and exit code 2; what nobody foresaw is one sentence, how
    to report it, and exit code 70.
    """
    if "numpy" not in sys.modules:
        # Matrices here have tens of rows: threads of the linear algebra wait for each other and
        # take the other cores from whoever runs beside.
        for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
            os.environ.setdefault(name, "1")
    _start_log()
    try:
        code = cli.main(args=arguments, prog_name="schuler", standalone_mode=False)
        # What cannot be written is found out when it is, not when the process ends.
        sys.stdout.flush()
    except SystemExit:
        raise
    except BaseException as error:
        given = sys.argv[1:] if arguments is None else arguments
        _end(error, "--debug" in given or os.environ.get("SCHULER_DEBUG") == "1")
    else:
        sys.exit(code if isinstance(code, int) else 0)


def _start_log() -> None:
    """Send what modules log to standard error, from the level of SCHULER_LOG on."""
    wanted = os.environ.get("SCHULER_LOG")
    if not wanted:
        return
    import logging

    if wanted.lower() not in _LEVELS:
        _stop(f"SCHULER_LOG={wanted}: expected one of {', '.join(_LEVELS)}", 2)
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(relativeCreated)8.0f ms  %(name)s: %(message)s"))
    log = logging.getLogger("schuler")
    log.handlers[:] = [handler]
    log.setLevel(wanted.upper())


def _end(error: BaseException, debug: bool) -> NoReturn:
    """Say an error in one sentence, and end with its exit code."""
    if isinstance(error, SchulerError):
        _stop(str(error), 2)
    if isinstance(error, click.UsageError):
        hint = f" (see {error.ctx.command_path} --help)" if error.ctx else ""
        _stop(f"{error.format_message().rstrip('.')}{hint}", 2)
    if isinstance(error, click.ClickException):
        _stop(error.format_message(), 2)
    if isinstance(error, click.Abort | KeyboardInterrupt):
        # Click takes an end of file for Ctrl-C; nothing here asks questions.
        if isinstance(error.__cause__, EOFError):
            _fault(error.__cause__, debug)
        _stop("stopped", 130)
    if isinstance(error, MemoryError):
        _stop("there is not enough memory for this; cut the record with --start and --stop", 2)
    if isinstance(error, OSError) and error.filename is not None:
        _stop(f"{error.filename}: {error.strerror or error}", 2)
    if isinstance(error, OSError) and error.errno in _OF_A_STREAM:
        _give_up_standard_output()
        _stop(f"standard output: cannot be written ({error.strerror or error})", 2)
    _fault(error, debug)


def _give_up_standard_output() -> None:
    """Let what is left go nowhere: Python would try again at the end, in words of its own."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fault(error: BaseException, debug: bool) -> NoReturn:
    """Say a fault of schuler itself, and how to report it."""
    if debug:
        import traceback

        traceback.print_exception(error)
    last = error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    where = "" if last is None else (
        f" ({os.path.basename(last.tb_frame.f_code.co_filename)}, line {last.tb_lineno})"
    )  # fmt: skip
    what = " ".join(f"{type(error).__name__}: {error}".split())
    if len(what) > 200:
        what = f"{what[:200]}..."
    _stop(
        f"internal fault, {what}{where}; please report this line with the command and the "
        "version; --debug shows where it came from",
        70,
    )


def _stop(text: str, code: int) -> NoReturn:
    with suppress(OSError):
        click.echo(f"schuler: {printable(' '.join(text.split()))}", err=True)
    sys.exit(code)
