"""What is at a path: a file, or something that is copied to one, or refused."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import weakref
from pathlib import Path

from schuler.errors import InputError

__all__ = ["Spooled", "is_pipe", "ordinary"]

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
