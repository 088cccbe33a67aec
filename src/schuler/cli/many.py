"""One command on many records: one table, JSON lines that a second run resumes, one report.

Each record goes through the command as if it were alone, in worker processes or on a Dask cluster;
what a record cannot give is a sentence in its row and does not stop the rest. The file of JSON
lines is the store: a line whose options and whose file's SHA-256 are the same is not computed
again.
"""

from __future__ import annotations

import io
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, as_completed
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import click

from schuler._files import parse_json, replacing
from schuler.cli.command import CONTRADICTED, Command, echo
from schuler.cli.parameters import Count
from schuler.cli.progress import counting
from schuler.cli.provenance import digest, said_options
from schuler.errors import InputError, SchulerError

__all__ = ["SOME_FAILED", "ManyCommand", "records_of", "run_one"]

SOME_FAILED = 4
"""Exit code where some of many records could not be used."""

_JOBS, _SCHEDULER = "schuler.jobs", "schuler.scheduler"

#: options that are for one record alone, by the parameters' names
_OF_ONE = ("follow", "save_mapping", "save_spec", "exports")

Line = dict[str, Any]


class ManyCommand(Command):
    """A command whose FILE may be several files or a folder."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        file = next(param for param in self.params if param.name == "file")
        file.nargs = -1
        for option in (
            click.Option(
                ["--jobs"], type=Count(1, 4096), metavar="N", expose_value=False,
                callback=_keep(_JOBS),
                help="With several records: processes at once (as many as there are cores).",
            ),
            click.Option(
                ["--scheduler"], metavar="ADDRESS", expose_value=False, callback=_keep(_SCHEDULER),
                help="With several records: a Dask cluster that sees the files, tcp://host:8786.",
            ),
        ):  # fmt: skip
            self.params.insert(-3, option)

    def again(self, options: dict[str, Any]) -> dict[str, Any]:
        """Take the record of a result as a list of one."""
        return {**options, "file": (options["file"],)} if "file" in options else options

    def invoke(self, ctx: click.Context) -> Any:
        """Run on one record, or on each of many."""
        named = ctx.params["file"]
        to = ctx.params.get("json_to")
        lines = to is not None and to.lower().endswith(".jsonl")
        if len(named) == 1 and not lines and not _is_folder(named[0]):
            ctx.params["file"] = named[0]
            return super().invoke(ctx)
        for key in _OF_ONE:
            if ctx.params.get(key):
                raise InputError(
                    f"--{key.removesuffix('s').replace('_', '-')} is for one record: leave it out "
                    "beside several"
                )
        if to is not None and to != "-" and not lines:
            raise InputError(f"--json {to}: several records give JSON lines: name a .jsonl file")
        with self.checked(ctx):
            return _run_many(self, ctx, records_of(named), to)


def _keep(key: str) -> Callable[[click.Context, click.Parameter, Any], None]:
    def keep(ctx: click.Context, _: click.Parameter, value: Any) -> None:
        ctx.meta[key] = value

    return keep


def _is_bag(path: Path) -> bool:
    """Say whether a folder is a record: a bag of ROS 2 is one."""
    return (path / "metadata.yaml").is_file()


def _is_folder(name: str) -> bool:
    return Path(name).is_dir() and not _is_bag(Path(name))


def records_of(names: tuple[str, ...]) -> list[str]:
    """Return the files of names; a folder stands for the records in it, by their endings.

    Raises
    ------
    InputError
        If there is none.
    """
    from schuler.io import readers
    from schuler.io.trajectory import truth_path

    endings = {suffix for reader in readers().values() for suffix in reader.suffixes}
    out: list[str] = []
    for name in names:
        if not _is_folder(name):
            out.append(name)
            continue
        found = sorted(
            str(path) for path in Path(name).iterdir()
            if (_is_bag(path) or path.suffix.lower() in endings) and not path.name.startswith(".")
        )  # fmt: skip
        # What `simulate` writes beside a record is no record.
        truths = {str(truth_path(path)) for path in found}
        found = [path for path in found if path not in truths]
        if not found:
            raise InputError(f"{name}: holds no record ({', '.join(sorted(endings))})")
        out += found
    if "-" in out:
        raise InputError("standard input is one record: name files beside others")
    return list(dict.fromkeys(out))


def run_one(command: str, path: str, options: dict[str, Any]) -> Line:
    """Run a command on one record, as the command line would, and return its line.

    Parameters
    ----------
    command : str
    path : str
    options : dict
        By the parameters' names.
    """
    from schuler.cli import cli

    out: Line = {"file": path, "document": None, "error": None, "warnings": []}
    told = io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        to = Path(folder) / "result.json"
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(told):
                root = click.Context(cli, info_name="schuler")
                found = cli.get_command(root, command)
                assert found is not None
                with found.make_context(
                    command, [path, "--json", str(to)], parent=root, default_map=options
                ) as ctx:
                    found.invoke(ctx)
            out["document"] = json.loads(to.read_text(encoding="utf-8"))
        except SchulerError as error:
            out["error"] = str(error)
        except click.ClickException as error:
            out["error"] = error.format_message()
        except MemoryError:
            out["error"] = "there is not enough memory for this record"
        except OSError as error:
            out["error"] = f"{error.filename or path}: {error.strerror or error}"
    told_lines = told.getvalue().splitlines()
    out["warnings"] = [line for line in told_lines if line.startswith("warning: ")]
    return out


def _run_many(command: Command, ctx: click.Context, paths: list[str], to: str | None) -> int:
    from schuler.cli.command import wants_text
    from schuler.cli.drawing import draw
    from schuler.reports.overview import COMMANDS, Overview

    name = command.name or ""
    assert name in COMMANDS
    options = {key: value for key, value in said_options(ctx).items() if key != "file"}
    store = _Store(to, name, options)
    done = {path: line for path in paths if (line := store.known(path)) is not None}
    left = [path for path in paths if path not in done]
    with store.open() as keep, counting(name, "records") as tell:
        tell(len(done), len(paths))
        for line in _lines(ctx, name, left, options):
            done[line["file"]] = line
            keep(line)
            tell(len(done), len(paths), line["file"])
    found = Overview(name, tuple(done[path] for path in paths))
    store.finish([done[path] for path in paths])
    if found.failed == len(paths):
        raise InputError(
            f"none of the {len(paths)} records has a result: {done[paths[0]]['error']}"
        )
    draw(found, ctx.params.get("report_to"))
    if wants_text():
        echo(found)
    else:
        echo(found.headline(), err=True)
    return SOME_FAILED if found.failed else CONTRADICTED if found.contradicted else 0


def _lines(
    ctx: click.Context, name: str, paths: list[str], options: dict[str, Any]
) -> Iterator[Line]:
    """Give the line of each record as it is finished, in any order."""
    jobs = min(ctx.meta.get(_JOBS) or os.cpu_count() or 1, len(paths))
    scheduler = ctx.meta.get(_SCHEDULER)
    if scheduler is None and jobs <= 1:
        for path in paths:
            yield run_one(name, path, options)
        return
    pool: Any
    if scheduler is not None:
        from schuler.campaigns.execute import cluster_executor

        pool = cluster_executor(scheduler)
    else:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        # A forked process would share the threads' locks of this one.
        pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    with pool as executor:
        # Workers of a cluster have folders of their own, and see the files by their full names.
        full = [os.path.abspath(path) if scheduler is not None else path for path in paths]
        yield from _as_done(executor, name, dict(zip(paths, full, strict=True)), options)


def _as_done(
    executor: Executor, name: str, paths: dict[str, str], options: dict[str, Any]
) -> Iterator[Line]:
    waiting = {
        executor.submit(run_one, name, full, options): path for path, full in paths.items()
    }  # fmt: skip
    try:
        for future in as_completed(waiting):
            yield {**future.result(), "file": waiting[future]}
    finally:
        for future in waiting:
            future.cancel()


class _Store:
    """The file of JSON lines: read before, added to while records are finished, put in order."""

    def __init__(self, path: str | None, command: str, options: dict[str, Any]) -> None:
        self._path = None if path in (None, "-") else Path(str(path))
        self._shown = path == "-"
        self._lines: dict[str, Line] = {}
        if self._path is None or not self._path.is_file():
            return
        try:
            text = self._path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise InputError(f"{self._path}: cannot be read ({error})") from None
        for row in text.splitlines():
            try:
                line = parse_json(row)
                made = line["document"]["provenance"]
                own = {key: value for key, value in made["options"].items() if key != "file"}
                same = made["command"] == [command] and own == _as_json(options)
                inputs = [(str(each["file"]), str(each["sha256"])) for each in made["inputs"]]
                if same and inputs and isinstance(line["file"], str):
                    self._lines[line["file"]] = line
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # the line that was being written when a run was stopped, or an error

    def known(self, path: str) -> Line | None:
        """Return the line of a record that has not changed since."""
        line = self._lines.get(path)
        if line is None or not Path(path).is_file():
            return None
        for each in line["document"]["provenance"]["inputs"]:
            if not Path(each["file"]).is_file() or digest(each["file"]) != each["sha256"]:
                return None
        return line

    @contextmanager
    def open(self) -> Iterator[Callable[[Line], None]]:
        """Give a function that adds a line at once."""
        if self._path is None:
            yield lambda line: None
            return
        with self._path.open("a", encoding="utf-8", newline="\n") as file:

            def keep(line: Line) -> None:
                file.write(_text(line))
                file.flush()

            yield keep

    def finish(self, lines: list[Line]) -> None:
        """Write all lines in the order of the files."""
        if self._path is None and not self._shown:
            return
        with replacing("-" if self._path is None else self._path) as part:
            part.write_text("".join(map(_text, lines)), encoding="utf-8", newline="\n")


def _text(line: Line) -> str:
    return json.dumps(line, allow_nan=False) + "\n"


def _as_json(options: dict[str, Any]) -> Any:
    return json.loads(json.dumps(options))
