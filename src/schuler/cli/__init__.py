"""The command line: a map of commands, each imported when it is called."""

from __future__ import annotations

import sys
from importlib import import_module

import click

from schuler import __version__
from schuler.errors import SchulerError

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
        "plan": "Find the test that shows an instrument's coefficients best.",
        "array": "Say what an array of redundant gyros is worth.",
    },
    "Go on by inertia": {
        "navigate": "Navigate by inertia alone, from a known start.",
        "rotation": "Say what turning the instrument does to its errors.",
    },
    "Judge": {
        "simulate": "Make a record, and its truth, from a scenario file.",
        "campaign": "Simulate and align many times: is sigma what it says?",
        "published": "Redo published experiments beside what was printed.",
    },
}
_COMMANDS = [name for group in _MAP.values() for name in group]


class _LazyGroup(click.Group):
    """A group that imports a command only when it is called or asked for help."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return _COMMANDS

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"schuler.cli.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, group in _MAP.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:<10}", text) for name, text in group.items()])


@click.command(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="schuler")
def cli() -> None:
    """Inertial alignment, calibration and error control.

    From a raw record of gyros and accelerometers to true north, with an honest uncertainty.

    \b
      schuler demo                                        try it without a record
      schuler info truck.csv --gyro deg/s --accel g       is this record what I think it is?
      schuler align truck.csv --lat 34.2 --report r.html  where is north?
      schuler COMMAND --help                              options and examples
    """  # noqa: D301


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; every foreseen error is one sentence and exit code 2."""
    try:
        code = cli.main(args=arguments, prog_name="schuler", standalone_mode=False)
    except SchulerError as error:
        _stop(str(error), 2)
    except click.UsageError as error:
        hint = f" (see {error.ctx.command_path} --help)" if error.ctx else ""
        _stop(f"{error.format_message().rstrip('.')}{hint}", 2)
    except click.ClickException as error:
        _stop(error.format_message(), 2)
    except (click.Abort, KeyboardInterrupt):
        _stop("stopped", 130)
    except MemoryError:
        _stop("there is not enough memory for this; cut the record with --start and --stop", 2)
    else:
        sys.exit(code if isinstance(code, int) else 0)


def _stop(text: str, code: int) -> None:
    click.echo(f"schuler: {' '.join(text.split())}", err=True)
    sys.exit(code)
