"""What is at a path: a file, something that is copied or unpacked to one, or refused."""

from __future__ import annotations

import gzip
import os
import shutil
import stat
import tempfile
import weakref
import zlib
from pathlib import Path

from schuler.errors import InputError
from schuler.io.limits import largest

__all__ = ["GZIP", "Spooled", "Unpacked", "is_pipe", "ordinary"]

GZIP = b"\x1f\x8b"
_PIECE = 1 << 20

_OTHERS = (
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def is_pipe(path: Path) -> bool:
    """Say whether a path is a pipe: a FIFO, or what a shell makes of ``<(...)``."""
    try:
        return stat.S_ISFIFO(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def ordinary(path: Path) -> None:
    """Refuse sockets and devices.

    Raises
    ------
    InputError
        If the path is one.
    """
    mode = path.stat().st_mode
    for test, what in _OTHERS:
        if test(mode):
            raise InputError(f"is {what}, not a file; name a file, or give - for standard input")


class Spooled:
    """A pipe's content in a temporary file, which goes when this object goes.

    A pipe gives each byte once, and readers look at a file's beginning before they read it.

    Parameters
    ----------
    pipe : Path
        Read to its end.

    Raises
    ------
    InputError
        If there is no place for the copy.
    """

    def __init__(self, pipe: Path) -> None:
        handle, name = tempfile.mkstemp(prefix="schuler-", suffix=pipe.suffix)
        self.path = Path(name)
        self._remove = weakref.finalize(self, self.path.unlink, missing_ok=True)
        try:
            with os.fdopen(handle, "wb") as copy, pipe.open("rb") as source:
                shutil.copyfileobj(source, copy, 1 << 20)
        except OSError as error:
            self._remove()
            raise InputError(
                f"is a pipe, and its content cannot be copied to {tempfile.gettempdir()} "
                f"({error.strerror or error})"
            ) from None


class Unpacked:
    """A gzip file's content in a temporary file, which goes when this object goes.

    Parameters
    ----------
    packed : Path
        Its content may be as large as that of any file that expands (`schuler.io.limits`).

    Raises
    ------
    InputError
        If it is damaged, expands to too much, or there is no place for the copy.
    """

    def __init__(self, packed: Path) -> None:
        most = largest(packed.stat().st_size)
        handle, name = tempfile.mkstemp(prefix="schuler-", suffix=Path(packed.stem).suffix)
        self.path = Path(name)
        self._remove = weakref.finalize(self, self.path.unlink, missing_ok=True)
        try:
            with os.fdopen(handle, "wb") as copy, gzip.open(packed, "rb") as source:
                written = 0
                while piece := source.read(_PIECE):
                    written += len(piece)
                    if written > most:
                        raise InputError(
                            f"expands to more than {most >> 20} MB, more than is taken from a gzip "
                            "file of its size: if it is right, unpack it first (gunzip)"
                        )
                    copy.write(piece)
        except InputError:
            self._remove()
            raise
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            self._remove()
            raise InputError(f"is a damaged or truncated gzip file ({error})") from None
        except OSError as error:
            self._remove()
            raise InputError(
                f"cannot be unpacked to {tempfile.gettempdir()} ({error.strerror or error})"
            ) from None
