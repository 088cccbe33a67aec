"""Where a JSON document is from: command, options, mapping, files with their digests; ``--again``.

Options are kept as the command took them, so that a run's file, a mapping and the command line all
leave the same, and ``schuler align --again result.json`` repeats them. A file that has changed
since is refused: the result would be another.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, TypeGuard

import click

from schuler import __version__
from schuler._files import is_special, parse_json
from schuler.cli.parameters import OutputFile, OutputFolder
from schuler.errors import InputError

__all__ = ["again_option", "digest", "options_again", "provenance", "said_options"]

_MAPPING = "schuler.mapping"
_BLOCK = 1 << 20

#: inputs that only say options, which are kept themselves
_EXPANDED = ("--again", "the run", "--mapping")

#: parameters that say where and how to write, not what to find
_WRITING = ("again", "exports", "inflate", "debug", "save_mapping", "figure_format", "quiet")


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    found = hashlib.sha256()
    try:
        with Path(path).open("rb") as file:
            while block := file.read(_BLOCK):
                found.update(block)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    return found.hexdigest()


def said_options(ctx: click.Context) -> dict[str, Any]:
    """Return the options of a command that were said, by the parameters' names."""
    # The mapping holds what its options, its file and the file beside the record say.
    left = _WRITING if ctx.meta.get(_MAPPING) is None else (*_WRITING, *_said_by_mapping())
    options: dict[str, Any] = {}
    for param in ctx.command.params:
        name = param.name or ""
        if name in left or isinstance(param.type, OutputFile | OutputFolder):
            continue
        value = ctx.params.get(name)
        if value is None or value == () or (
            ctx.get_parameter_source(name) == click.core.ParameterSource.DEFAULT
            and not isinstance(param, click.Argument)
        ):  # fmt: skip
            continue
        options[name] = list(value) if isinstance(value, tuple) else value
    return options


def provenance(inputs: list[tuple[str, str]]) -> dict[str, Any]:
    """Return what the running command needs to be repeated.

    Parameters
    ----------
    inputs : list of (str, str)
        What names each file that was read, and its path.
    """
    ctx = click.get_current_context()
    mapping = ctx.meta.get(_MAPPING)
    files = {
        path: {"file": path, "bytes": Path(path).stat().st_size, "sha256": digest(path)}
        for label, path in inputs
        if label not in _EXPANDED and path != "-" and Path(path).is_file() and not is_special(path)
    }
    return {
        "schuler": __version__,
        "command": ctx.command_path.split()[1:],
        "options": said_options(ctx),
        "mapping": {} if mapping is None else _plain(mapping.said()),
        "inputs": list(files.values()),
    }


def _said_by_mapping() -> tuple[str, ...]:
    from dataclasses import fields

    from schuler.io import Mapping

    return ("mapping", *(each.name for each in fields(Mapping)))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, list | tuple) else value


def again_option() -> click.Option:
    """Return the option ``--again``, which every command with JSON has."""
    return click.Option(
        ["--again"], type=click.Path(), metavar="RESULT.json", expose_value=False,
        help="Repeat what a result of this command was made by; options here win.",
    )  # fmt: skip


def options_again(ctx: click.Context, path: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return options and mapping of a result, whose files are as they were.

    Raises
    ------
    InputError
        If the file is no result of this command, or a file that it was made of has changed.
    """
    try:
        data = parse_json(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError:
        raise InputError(f"{path}: is no JSON; --again takes what --json wrote") from None
    found = data.get("provenance") if isinstance(data, dict) else None
    if not _is_whole(found):
        raise InputError(f"{path}: says not how it was made; --again takes what --json wrote")
    own = ctx.command_path.split()[1:]
    if found["command"] != own:
        raise InputError(
            f"{path}: was made by schuler {' '.join(map(str, found['command']))}, and not by "
            f"schuler {' '.join(own)}"
        )
    moved = {}
    for each in found["inputs"]:
        there = _where(each["file"], path)
        if digest(there) != each["sha256"]:
            raise InputError(
                f"{there}: has changed since {path} was made of it (its SHA-256 is another); "
                "give the command anew, without --again"
            )
        moved[each["file"]] = there
    options = {name: _renamed(value, moved) for name, value in found["options"].items()}
    known = {param.name for param in ctx.command.params}
    if unknown := sorted(set(options) - known):
        raise InputError(
            f"{path}: was made with --{unknown[0].replace('_', '-')}, which schuler {__version__} "
            f"does not have (it is of schuler {found.get('schuler')})"
        )
    return options, dict(found.get("mapping") or {})


def _is_whole(found: Any) -> TypeGuard[dict[str, Any]]:
    """Say whether something has all that a command is repeated by."""
    return (
        isinstance(found, dict)
        and isinstance(found.get("command"), list)
        and isinstance(found.get("options"), dict)
        and isinstance(found.get("mapping", {}), dict)
        and isinstance(found.get("inputs"), list)
        and all(
            isinstance(each, dict) and {"file", "sha256"} <= set(each)
            and isinstance(each["file"], str)
            for each in found["inputs"]
        )
    )  # fmt: skip


def _where(name: str, result: str) -> str:
    """Return where a file is: as it was named, or beside the result."""
    for there in (Path(name), Path(result).parent / name, Path(result).parent / Path(name).name):
        if there.is_file():
            return str(there)
    raise InputError(f"{name}: is not there any more, and {result} was made of it")


def _renamed(value: Any, moved: dict[str, str]) -> Any:
    if isinstance(value, list):
        return tuple(_renamed(each, moved) for each in value)
    return moved.get(value, value) if isinstance(value, str) else value
