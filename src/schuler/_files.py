"""Files that appear whole or not at all, and TOML files that a user wrote."""

from __future__ import annotations

import difflib
import hashlib
import itertools
import json
import math
import os
import platform
import re
import shutil
import stat
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from schuler.errors import InputError

__all__ = [
    "check_keys", "check_target", "is_special", "number", "parse_json", "parse_toml", "read_toml",
    "replacing",
]  # fmt: skip

_STANDARD_OUTPUT = "-"
_counter = itertools.count()

#: a name of fixed length, short beside the longest file name
_PART = re.compile(r"^\.(?P<digest>[0-9a-f]{12})\.(?P<host>[0-9a-f]{8})-(?P<pid>\d+)-\d+\.part$")


def is_special(path: str | Path) -> bool:
    """Say whether a path is a device, a FIFO or a socket, which is written to and not replaced."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _standard_stream(path: Path) -> int | None:
    """Return 1 or 2 where a path is what standard output or standard error goes to."""
    for descriptor in (1, 2):
        with suppress(OSError, ValueError):
            if os.path.samestat(os.stat(path), os.fstat(descriptor)):
                return descriptor
    return None


def check_target(path: str | Path) -> None:
    """Refuse a file that cannot be written, before the work and not after it.

    Parameters
    ----------
    path : str or Path
        ``-`` is standard output, which is always allowed.

    Raises
    ------
    InputError
        If it is a folder, its folder is missing or cannot be written to, its name is too long,
        or the file that is there may not be changed.
    """
    if str(path) == _STANDARD_OUTPUT:
        return
    shown = str(path)
    if "\0" in shown or not shown:
        raise InputError(f"{shown!r}: is no name of a file")
    try:
        target = Path(os.path.realpath(path))
        with suppress(FileNotFoundError):
            mode = os.stat(target).st_mode
            if stat.S_ISDIR(mode):
                raise InputError(f"{path}: is a folder; name a file in it")
            if stat.S_ISSOCK(mode):
                raise InputError(f"{path}: is a socket, which cannot be written to; name a file")
            if not os.access(target, os.W_OK):
                raise InputError(f"{path}: may not be written to; name another file")
            if not stat.S_ISREG(mode):
                return
        parent = target.parent
        if not parent.is_dir():
            raise InputError(f"{path}: there is no folder '{Path(path).parent}' to write it to")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: the folder '{parent}' may not be written to; name another")


def _host() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _remove_leftovers(target: Path, digest: str) -> None:
    """Remove parts of this file whose writers were killed on this machine."""
    host = _host()
    with suppress(OSError):
        for entry in os.scandir(target.parent):
            found = _PART.match(entry.name)
            if found is None or found["host"] != host or found["digest"] != digest:
                continue
            if os.name == "posix" and not _alive(int(found["pid"])):
                with suppress(OSError):
                    os.unlink(entry.path)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary name, and put what was written there into `path` when all went well.

    A regular file is replaced in one step: it is the old one or the new one, whole. Symlinks are
    followed, permissions are kept. A device, a FIFO or standard output (``-``) gets the bytes, and
    stays what it is. What killed writers of the same file left behind is removed.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        if str(path) == _STANDARD_OUTPUT:
            with _passing_on(1) as part:
                yield part
            return
        check_target(path)
        stream = _standard_stream(Path(path))
        if stream is not None or is_special(path):
            with _passing_on(Path(path) if stream is None else stream) as part:
                yield part
            return
        target = Path(os.path.realpath(path))
        digest = hashlib.sha256(target.name.encode(errors="surrogateescape")).hexdigest()[:12]
        _remove_leftovers(target, digest)
        part = target.with_name(f".{digest}.{_host()}-{os.getpid()}-{next(_counter)}.part")
        try:
            yield part
            _keep_permissions(target, part)
            _flush_to_disk(part)
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        shown = "standard output" if str(path) == _STANDARD_OUTPUT else path
        raise InputError(f"{shown}: cannot be written ({error.strerror or error})") from None


@contextmanager
def _passing_on(where: Path | int) -> Iterator[Path]:
    """Give a temporary file whose bytes go to a special file or a descriptor afterwards."""
    with tempfile.TemporaryDirectory(prefix="schuler-") as folder:
        part = Path(folder) / "part"
        yield part
        with part.open("rb") as source:
            if isinstance(where, int):
                stream = sys.stdout if where == 1 else sys.stderr
                stream.flush()
                binary = getattr(stream, "buffer", None)
                if binary is None:  # a stream of text alone, as under a test runner
                    stream.write(source.read().decode(errors="replace"))
                else:
                    shutil.copyfileobj(source, binary)
                stream.flush()
            else:
                with where.open("wb") as out:
                    shutil.copyfileobj(source, out)


def _keep_permissions(target: Path, part: Path) -> None:
    with suppress(FileNotFoundError):
        os.chmod(part, stat.S_IMODE(os.stat(target).st_mode))


def _flush_to_disk(part: Path) -> None:
    """Let a full disk be seen before the old file is given up."""
    descriptor = os.open(part, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def parse_toml(text: str) -> dict[str, Any]:
    """Return what a TOML text holds.

    Raises
    ------
    ValueError
        If it is not TOML, is nested too deep or has a number that is too long to convert; the
        message says which.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return what is in a TOML file.

    Raises
    ------
    InputError
        If it cannot be read or is not TOML.
    """
    try:
        return parse_toml(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(f"{path}: is not valid TOML ({error})") from None


def check_keys(table: Any, known: Iterable[str], where: str = "", prefix: str = "") -> None:
    """Refuse what is no table, and keys that a table has not.

    Parameters
    ----------
    table : object
        As it came from a file.
    known : iterable of str
    where : str
        What the table is, for the message.
    prefix : str
        Put before the key in the message.

    Raises
    ------
    InputError
        Naming the first key that is unknown, the nearest known one, and all known ones.
    """
    before = f"{where}: " if where else ""
    if not isinstance(table, dict):
        what = where or prefix.rstrip(".") or "the file"
        raise InputError(f"{what}: expected a table, got {table!r}")
    names = list(known)
    for key in table:
        if key not in names:
            near = difflib.get_close_matches(key, names, 1)
            hint = f"did you mean '{prefix}{near[0]}'? known" if near else "known"
            raise InputError(f"{before}unknown key '{prefix}{key}'; {hint}: {', '.join(names)}")


def number(value: Any, what: str, unit: str = "") -> float:
    """Return a finite number of a table.

    Raises
    ------
    InputError
        If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{what}: expected a number{unit}, got {value!r}")
    return float(value)


def parse_json(text: str | bytes) -> Any:
    """Return what a JSON text holds.

    Raises
    ------
    ValueError
        If it is not JSON, is nested too deep or has a number that is too long to convert.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
