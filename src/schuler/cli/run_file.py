"""The file of a run: all that was said to a command, so that it can be repeated.

A `RunCommand` takes a TOML file with ``schema = "schuler.run/1"`` in the place of its record: what
the file says are the defaults of the options, and the command line wins over it. Names of files
are relative to the run's folder.
"""

from __future__ import annotations

import os
from collections.abc import Mapping as Dict
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from schuler._files import check_keys, read_toml, replacing
from schuler.cli.command import REPEATED, Command, CommandFiles, add_input
from schuler.cli.parameters import InputFile, OutputFile
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.io import Mapping

__all__ = [
    "RUN_SCHEMA",
    "RunCommand",
    "mapping_of_run",
    "note_mapping",
    "save_run",
    "save_run_option",
]

RUN_SCHEMA = "schuler.run/1"

_RUN, _MAPPING = "schuler.run", "schuler.mapping"
_TABLE_OF_MAPPING = "mapping"

#: table and key of the file -> name of the command's parameter
_PLACES: dict[str, dict[str, str]] = {
    "record": {key: key for key in ("file", "start", "stop", "max_gap", "keep_spikes")},
    "start": {
        **{key: key for key in ("lat", "lon", "height", "heading", "pitch", "roll", "velocity")},
        "align": "align_for",
    },
    "model": {key: key for key in (
        "spec", "gravity", "vertical", "gravity_sigma", "deflection_sigma", "vibration",
        "scale_states", "axes_states",
    )},
    "gnss": {
        "file": "gnss", "sigma": "gnss_sigma", "height": "gnss_height", "topic": "gnss_topic",
        "lever": "lever", "delay": "delay",
    },
    "odometer": {
        "file": "odometer", "scale": "odometer_scale", "wheels": "wheels",
        "lever": "odometer_lever",
    },
    "dvl": {"file": "dvl", "frame": "dvl_frame", "lever": "dvl_lever"},
    "height": {"file": "height_file", "offset": "height_offset"},
    "heading": {"file": "heading_file", "baseline": "baseline"},
    "aids": {"time_offset": "time_offset", "topic": "aid_topic"},
    "filter": {key: key for key in (
        "nhc", "nhc_lever", "zupt", "estimate", "smooth", "outage", "robust", "clock_drift",
        "adaptive",
    )},
    "output": {
        "every": "every", "at": "at", "out": "out_to", "format": "out_format",
        "reference": "reference", "json": "json_to", "report": "report_to",
    },
}  # fmt: skip
_FILES_OF_MAPPING = ("array", "accel_file")


def save_run_option(function: Any) -> Any:
    """Add the option ``--save-run`` to a command."""
    option = click.option(
        "--save-run", "save_run_to", type=OutputFile(".toml"), metavar="OUT.toml",
        help="Write all that was said, for the same command with that file as FILE.",
    )  # fmt: skip
    return option(function)


class RunCommand(Command):
    """A command whose FILE may be the file of a run."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take what a run says as defaults, and its record as FILE."""
        said: dict[str, Any] = {}
        if not ctx.resilient_parsing:
            given = self.make_parser(ctx).parse_args(args=list(args))[0]
            path = given.get("file")
            if isinstance(path, str) and path.lower().endswith(".toml"):
                self._keep(path, given)
                said, mapping = _read(self, ctx, path)
                ctx.meta[_RUN] = path, mapping
                ctx.default_map = {**said, **(ctx.default_map or {})}
        rest = super().parse_args(ctx, args)
        if said:
            ctx.params["file"] = said["file"]
        return rest

    def _keep(self, path: str, given: dict[str, Any]) -> None:
        """Refuse outputs that would replace the run, before it is read."""
        files = CommandFiles()
        files.add_input("the run", path)
        for param in self.params:
            to = given.get(param.name or "")
            if isinstance(param.type, OutputFile) and isinstance(to, str):
                files.add_output(param.opts[0], to)


def mapping_of_run() -> Mapping | None:
    """Return the mapping of the run, or result, that is repeated; its file is an input."""
    meta = click.get_current_context().meta
    if REPEATED in meta:
        from schuler.io import Mapping as Known

        path, said = meta[REPEATED]
        add_input("--again", path)
        return Known.from_dict(said)
    found = meta.get(_RUN)
    if found is None:
        return None
    path, mapping = found
    add_input("the run", path)
    out: Mapping = mapping
    return out


def note_mapping(mapping: Mapping) -> None:
    """Keep what was said of the record, for `save_run`."""
    click.get_current_context().meta[_MAPPING] = mapping


def save_run(path: str) -> None:
    """Write what was said to the running command, its run and its record's mapping.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    import tomli_w

    ctx = click.get_current_context()
    folder = Path(path).resolve().parent
    kinds = {param.name: param for param in ctx.command.params}
    tables: dict[str, Any] = {"schema": RUN_SCHEMA}
    for table, keys in _PLACES.items():
        values = {}
        for key, name in keys.items():
            value = ctx.params.get(name)
            default = ctx.get_parameter_source(name) == click.core.ParameterSource.DEFAULT
            if default or value is None or value == ():
                continue
            if isinstance(kinds[name].type, InputFile | OutputFile):
                value = _from_folder(value, folder)
            values[key] = list(value) if isinstance(value, tuple) else value
        if values:
            tables[table] = values
    mapping = ctx.meta.get(_MAPPING)
    if mapping is not None:
        said = mapping.said()
        for key in _FILES_OF_MAPPING:
            if key in said:
                said[key] = _from_folder(said[key], folder)
        said = {k: list(v) if isinstance(v, tuple) else v for k, v in said.items()}
        if "variables" in said:
            said["variables"] = dict(said["variables"])
        if said:
            tables[_TABLE_OF_MAPPING] = said
    with replacing(path) as part:
        part.write_text(tomli_w.dumps(tables), encoding="utf-8")


def _from_folder(value: str, folder: Path) -> str:
    """Return a file's name relative to a folder; what is no file's name stays as it is."""
    if value == "-" or os.path.isabs(value) or not Path(value).parent.exists():
        return value
    if not Path(value).exists() and not Path(value).suffix:
        return value
    try:
        return Path(os.path.relpath(Path(value).resolve(), folder)).as_posix()
    except ValueError:  # another drive
        return str(Path(value).resolve())


def _in_folder(value: Any, folder: Path, *, must: bool) -> Any:
    """Return a name that is relative to the run's folder as one from here."""
    if not isinstance(value, str) or value == "-" or os.path.isabs(value):
        return value
    there = os.path.normpath(folder / value)
    return there if must or os.path.exists(there) else value


def _read(command: click.Command, ctx: click.Context, path: str) -> tuple[dict[str, Any], Mapping]:
    """Return what a run says, by the parameters' names, and the mapping of its record."""
    from schuler.io import Mapping

    data = read_toml(path)
    if data.get("schema") != RUN_SCHEMA:
        raise InputError(
            f"{path}: is no run, which says schema = '{RUN_SCHEMA}' (--save-run writes one), and "
            "TOML is no format of a record"
        )
    check_keys(data, ("schema", *_PLACES, _TABLE_OF_MAPPING), path)
    folder = Path(path).parent
    kinds = {param.name: param for param in command.params}
    said: dict[str, Any] = {}
    for table, keys in _PLACES.items():
        values = data.get(table, {})
        check_keys(values, keys, f"{path}: [{table}]")
        for key, value in values.items():
            param = kinds[keys[key]]
            said[keys[key]] = _value(ctx, param, value, folder, f"{path}: {table}.{key}")
    table = data.get(_TABLE_OF_MAPPING, {})
    check_keys(table, [each.name for each in fields(Mapping)], f"{path}: [{_TABLE_OF_MAPPING}]")
    try:
        mapping = Mapping.from_dict(table)
        files = {
            key: _in_folder(value, folder, must=False)
            for key in _FILES_OF_MAPPING
            if (value := getattr(mapping, key)) is not None
        }
        mapping = replace(mapping, **files)
    except (InputError, TypeError) as error:
        raise InputError(f"{path}: [{_TABLE_OF_MAPPING}]: {error}") from None
    if "file" not in said:
        raise InputError(f"{path}: [record] needs file, the record of the run")
    return said, mapping


def _value(ctx: click.Context, param: click.Parameter, value: Any, folder: Path, where: str) -> Any:
    """Return a value of the file as an option's, checked as one of the command line."""
    if isinstance(value, Dict) or (isinstance(value, list) and any(
        isinstance(item, Dict | list) for item in value
    )):  # fmt: skip
        raise InputError(f"{where}: expected a number, a text or a list of them")
    multiple = bool(getattr(param, "multiple", False))
    flag = bool(getattr(param, "is_flag", False))
    if flag != isinstance(value, bool):
        raise InputError(f"{where}: expected {'true or false' if flag else 'no true or false'}")
    if isinstance(value, list) and not multiple:
        value = ",".join(map(str, value))
    elif not isinstance(value, str | list | bool):
        value = str(value)
    if isinstance(param.type, InputFile | OutputFile):
        named = isinstance(param.type, OutputFile) or param.name in ("file", "reference")
        value = _in_folder(value, folder, must=named)
    try:
        param.type_cast_value(ctx, value)
    except click.BadParameter as error:
        raise InputError(f"{where}: {error.message}") from None
    return value
