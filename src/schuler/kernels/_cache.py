"""The folder of compiled kernels: a comfort, never a condition.

Each file ends in the SHA-256 of what stands before it. A file that is damaged, cannot be read or
cannot be written is said once, and the kernel is compiled; where the folder can be written to, the
file is made anew.
"""

from __future__ import annotations

import hashlib
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from schuler.kernels._machine_code import processor, runs_generic_code

__all__ = [
    "AHEAD",
    "CACHE_FOLDER",
    "has_code",
    "in_words",
    "read_code",
    "read_whole",
    "say_once",
    "sources_digest",
    "write_code",
]

_log = logging.getLogger("schuler")
_DIGEST = 32
_said: set[str] = set()


def say_once(kind: str, text: str) -> None:
    """Warn of the cache, once of each kind in a process."""
    if kind not in _said:
        _said.add(kind)
        _log.warning("note: kernel cache: %s", text)


_HERE = Path(__file__).parent

AHEAD = _HERE / "compiled"
"""Where a wheel has machine code that was compiled ahead (`schuler.kernels.ahead`)."""


def sources_digest() -> str:
    """Return a hash of all kernel sources and of the constants that they freeze."""
    digest = hashlib.sha256()
    for source in [*sorted(_HERE.glob("*.py")), _HERE.parent / "constants.py"]:
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()


_SOURCES = sources_digest()


def _digest() -> str:
    """Return a hash of the sources, and of what else compiled code depends on."""
    facts = f"{_SOURCES} {version('numba')} {sys.version} {processor()}"
    return hashlib.sha256(facts.encode()).hexdigest()[:16]


def _bases() -> Iterator[Path]:
    """Give the places for the folder, best first."""
    if given := os.environ.get("SCHULER_CACHE_DIR"):
        yield Path(given)
    elif given := os.environ.get("XDG_CACHE_HOME"):
        yield Path(given) / "schuler"
    else:
        home = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
        with suppress(RuntimeError):
            yield Path(home).expanduser() / "schuler"
    if hasattr(os, "getuid"):
        # Compiled code is run: nobody else may be able to write there.
        own = Path(tempfile.gettempdir()) / f"schuler-kernels-{os.getuid()}"
        with suppress(OSError):
            own.mkdir(mode=0o700, exist_ok=True)
            found = own.lstat()
            if (
                stat.S_ISDIR(found.st_mode)
                and found.st_uid == os.getuid()
                and not found.st_mode & 0o077
            ):
                yield own


def _folder() -> str | None:
    """Return the first folder that can be written to, or None."""
    name = f"kernels-{_digest()}"
    for base in _bases():
        folder = base / name
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return str(folder)
    say_once(
        "folder",
        "no folder for it can be written to, so kernels are compiled in each process; "
        "set SCHULER_CACHE_DIR to a folder of yours",
    )
    return None


CACHE_FOLDER = _folder()


def read_whole(path: Path) -> bytes | None:
    """Return what stands in a file before its digest; None, with the file removed, if damaged."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    if hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]:
        return data[:-_DIGEST]
    say_once("damaged", f"{path} is damaged; the kernel is compiled again")
    with suppress(OSError):
        path.unlink()
    return None


@cache
def _compiled_ahead() -> bool:
    """Say whether code of these sources was compiled ahead, which this processor runs."""
    try:
        same = (AHEAD / "sources").read_text(encoding="ascii") == _SOURCES
    except OSError:
        return False
    return same and runs_generic_code()


def _folder_of(name: str) -> Path | None:
    """Return the folder where a kernel is, or would be kept."""
    if _compiled_ahead() and (AHEAD / name).is_file():
        return AHEAD
    return None if CACHE_FOLDER is None else Path(CACHE_FOLDER)


def has_code(name: str) -> bool:
    """Say whether a kernel is in a folder."""
    folder = _folder_of(name)
    return folder is not None and (folder / name).is_file()


def read_code(name: str) -> tuple[bytes, bytes] | None:
    """Return a kernel's description and its machine code, or None where it must be compiled."""
    folder = _folder_of(name)
    if folder is None:
        return None
    try:
        data = read_whole(folder / name)
    except OSError as error:
        say_once("read", f"cannot be read ({in_words(error)}); kernels are compiled again")
        return None
    if data is None:
        return None
    header, _, code = data.partition(b"\n")
    return header, code


def write_code(name: str, header: bytes = b"", code: bytes = b"") -> None:
    """Keep a kernel's description and its machine code, where that is possible."""
    if CACHE_FOLDER is None:
        return
    data = header + b"\n" + code
    path = Path(CACHE_FOLDER) / name
    try:
        _put(path, data + hashlib.sha256(data).digest())
    except OSError as error:
        say_once("write", f"cannot be written ({in_words(error)}); it is compiled anew next time")


def _put(path: Path, data: bytes) -> None:
    """Write a file at once: others see all of it, or nothing."""
    part = path.with_suffix(f".{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise


def in_words(error: Exception) -> str:
    """Return what an error says."""
    return getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
