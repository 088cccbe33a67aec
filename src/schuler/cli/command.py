"""What every command does before and after its work: look at its files, name what it wrote.

The check stands in one place and takes its list from the command's own options (`InputFile`,
`OutputFile`), so that a new option cannot be forgotten.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from logging import getLogger
from typing import Any

import click

from schuler._files import check_target, is_special
from schuler.cli.parameters import InputFile, OutputFile
from schuler.cli.progress import quiet_option, watched
from schuler.cli.provenance import again_option, options_again, provenance
from schuler.errors import InputError, printable
from schuler.kernels import first_need

__all__ = [
    "CONTRADICTED", "REPEATED", "Command", "Group", "add_input", "add_output", "debug_option",
    "echo", "made_by", "wants_text",
]  # fmt: skip

CONTRADICTED = 3
"""Exit code of a result that its record contradicts."""

_KEY = "schuler.files"

REPEATED = "schuler.again"
"""Key of the result, and of the mapping in it, that the running command repeats."""

_HELP = {"help_option_names": ["-h", "--help"]}


def echo(text: object = "", *, err: bool = False) -> None:
    """Print a line; control characters that came from a file or a name are made visible."""
    click.echo(printable(str(text)), err=err)


def _identity(path: str) -> tuple[Any, ...]:
    """Return what two names of one file have in common."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return ("name", os.path.normcase(os.path.realpath(path)))
    return (found.st_dev, found.st_ino)


def _state(path: str) -> tuple[int, int, int] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


@dataclass
class CommandFiles:
    """The files that one command reads and writes.

    Parameters
    ----------
    inputs, outputs : list of (str, str)
        What names the file (an option, or ``input``) and its path.
    before : dict
        How each output was before the command.
    """

    inputs: list[tuple[str, str]] = field(default_factory=list)
    outputs: list[tuple[str, str]] = field(default_factory=list)
    before: dict[str, Any] = field(default_factory=dict)

    def add_input(self, label: str, path: str) -> None:
        """Add a file that is read; it may not be one of the outputs."""
        for other, output in self.outputs:
            self._part(other, output, label, path)
        self.inputs.append((label, path))

    def add_output(self, label: str, path: str) -> None:
        """Add a file that is written; it may be no input and no other output."""
        for other, there in self.inputs:
            self._part(label, path, other, there)
        for other, there in self.outputs:
            if path == there == "-":
                raise InputError(
                    f"{label} and {other} cannot both go to standard output; name a file for one"
                )
            if "-" not in (path, there) and _same(path, there):
                raise InputError(f"{label} and {other} both name {path}; name two files")
        check_target(path)
        self.outputs.append((label, path))
        self.before[path] = _state(path)

    @staticmethod
    def _part(label: str, output: str, other: str, path: str) -> None:
        if "-" not in (output, path) and _same(output, path):
            raise InputError(
                f"{label} {output}: is the file of {other}, which is read; an output never "
                "replaces an input: name another file"
            )

    def written(self) -> Iterator[str]:
        """Give each output that has changed."""
        for _, path in self.outputs:
            if path != "-" and not is_special(path) and _state(path) != self.before[path]:
                yield path


def _same(a: str, b: str) -> bool:
    # Two outputs may both go to /dev/null.
    return _identity(a) == _identity(b) and not is_special(a)


def _files() -> CommandFiles:
    found: CommandFiles = click.get_current_context().meta[_KEY]
    return found


def add_input(label: str, path: str | os.PathLike[str]) -> None:
    """Tell the running command of a file that it reads, beside those of its options."""
    _files().add_input(label, str(path))


def add_output(label: str, path: str | os.PathLike[str]) -> None:
    """Tell the running command of a file that it will write, beside those of its options.

    Raises
    ------
    InputError
        If it is an input or another output, or cannot be written.
    """
    _files().add_output(label, str(path))


def _note(text: str) -> None:
    """Tell a person who watches what takes its time."""
    if watched():
        echo(f"note: {text}", err=True)


def made_by() -> dict[str, Any]:
    """Return where the running command's result is from; see `schuler.cli.provenance`."""
    return provenance(_files().inputs)


def wants_text() -> bool:
    """Say whether the result may be printed: no output goes to standard output."""
    return all(path != "-" for _, path in _files().outputs)


def _debug(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    if value:
        ctx.find_root().meta["schuler.debug"] = True


def debug_option() -> click.Option:
    """Return the option --debug, which every command has."""
    return click.Option(
        ["--debug"], is_flag=True, expose_value=False, is_eager=True, callback=_debug,
        help="Show the traceback of an internal fault (as SCHULER_DEBUG=1 does).",
    )  # fmt: skip


class Command(click.Command):
    """A command whose files are checked before it runs and named after it."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        settings.setdefault("context_settings", _HELP)
        super().__init__(*args, **settings)
        self._repeats = any(param.name == "json_to" for param in self.params)
        if self._repeats:
            self.params.append(again_option())
        self.params += [quiet_option(), debug_option()]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take what the result of ``--again`` was made by as defaults."""
        if self._repeats and not ctx.resilient_parsing:
            given = self.make_parser(ctx).parse_args(args=list(args))[0]
            path = given.get("again")
            if isinstance(path, str):
                options, mapping = options_again(ctx, path)
                ctx.default_map = {**self.again(options), **(ctx.default_map or {})}
                ctx.meta[REPEATED] = path, mapping
        return super().parse_args(ctx, args)

    def again(self, options: dict[str, Any]) -> dict[str, Any]:
        """Return the options of a result as this command takes them."""
        return options

    def invoke(self, ctx: click.Context) -> Any:
        """Check the files, run, and name what was written."""
        with self.checked(ctx):
            return super().invoke(ctx)

    @contextmanager
    def checked(self, ctx: click.Context) -> Iterator[None]:
        """Check the files before what is done within, and name what was written after it."""
        files = CommandFiles()
        ctx.meta[_KEY] = files
        for label, path, sidecar in self._named(ctx, InputFile):
            files.add_input(label, path)
            if sidecar and path != "-":
                if ctx.params.get("save_mapping"):
                    files.add_output("--save-mapping", f"{path}.toml")
                else:
                    files.add_input(f"{label} (its mapping)", f"{path}.toml")
        for label, path, _ in self._named(ctx, OutputFile):
            files.add_output(label, path)
        first_need.tell(ctx.info_name, _note)
        log = getLogger("schuler.cli")
        log.info("%s: reads %s", ctx.command_path, [path for _, path in files.inputs])
        try:
            yield
        finally:
            log.info("%s: ends", ctx.command_path)
            for path in files.written():
                echo(f"wrote {path}", err=True)

    def _named(self, ctx: click.Context, kind: type) -> Iterator[tuple[str, str, bool]]:
        for param in self.params:
            value = ctx.params.get(param.name or "")
            if not isinstance(param.type, kind) or value is None:
                continue
            label = param.opts[0] if isinstance(param, click.Option) else "the input"
            for path in value if isinstance(value, tuple) else (value,):
                yield label, path, getattr(param.type, "sidecar", False)


class Group(click.Group):
    """A group of commands; without one it shows its help."""

    command_class = Command

    def __init__(self, *args: Any, **settings: Any) -> None:
        settings.setdefault("context_settings", _HELP)
        # Click's own way turns the help into a usage error.
        settings["invoke_without_command"], settings["no_args_is_help"] = True, False
        settings["callback"] = _help_without_command
        super().__init__(*args, **settings)
        self.params.append(debug_option())


def _help_without_command() -> None:
    ctx = click.get_current_context()
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help(), color=ctx.color)
