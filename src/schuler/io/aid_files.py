"""Where an aid's file is: as it lies, copied from a pipe, or unpacked from gzip."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from schuler.errors import InputError
from schuler.io.spool import GZIP, Spooled, Unpacked, is_pipe, ordinary

__all__ = ["local_file"]


@contextmanager
def local_file(path: Path) -> Iterator[Path]:
    """Give a path that can be read more than once; errors name the file as it was given.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    """
    try:
        # A copy lasts as long as its object.
        spooled = Spooled(path) if is_pipe(path) else None
        there = path if spooled is None else spooled.path
        if not there.exists():
            raise InputError("there is no such file")
        ordinary(there)
        unpacked = None
        if there.is_file():
            with there.open("rb") as file:
                packed = file.read(2) == GZIP
            unpacked = Unpacked(there) if packed else None
        yield there if unpacked is None else unpacked.path
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
