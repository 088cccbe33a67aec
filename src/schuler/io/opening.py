"""What is found at the beginning of a file: the mappings beside it, its first bytes, its content.

A pipe and a compressed file are copied to a temporary file, which is removed with what made it.
"""

from __future__ import annotations

import sys
import time as wall
from dataclasses import dataclass
from pathlib import Path

from schuler.errors import InputError, shown
from schuler.io.dialect import NoRowsError, detect
from schuler.io.flow import readable
from schuler.io.mapping import Mapping
from schuler.io.registry import find_reader
from schuler.io.spool import GZIP, Spooled, Unpacked, is_pipe, ordinary

__all__ = ["FOLDER_MAPPING", "PIPE", "Beginning", "begin"]

#: a mapping beside the files of a folder that say nothing themselves
FOLDER_MAPPING = "schuler-mapping.toml"
PIPE = "is a pipe, which cannot be followed by its name; give - and lead it to standard input"

#: what a ROS 2 bag's folder is known by; its beginning stands for the folder's
_BAG = "metadata.yaml"
_HEAD = 1 << 16
_LONG_HEAD = 1 << 20
_POLL = 0.2


@dataclass(frozen=True)
class Beginning:
    """A file that was looked at and not yet read.

    Parameters
    ----------
    mapping : Mapping
        What the user and the sidecar say.
    folder : Mapping
        What the folder's mapping says.
    notes : list of str
    size : int or None
        Bytes; None for standard input.
    head : bytes
        The first bytes of its content.
    content : Path
        Where the content is.
    spooled : Spooled, Unpacked or None
        What holds the copy of a pipe's or a compressed file's content.
    named_as : Path
        The name by which the format is found: that of what is inside a gzip file.
    """

    mapping: Mapping
    folder: Mapping
    notes: list[str]
    size: int | None
    head: bytes
    content: Path
    spooled: Spooled | Unpacked | None
    named_as: Path


def begin(path: Path, mapping: Mapping, wait: float | None) -> Beginning:
    """Find the sidecars of a file, and read its beginning.

    Parameters
    ----------
    path : Path
        The file, the folder of a ROS 2 bag, or ``-`` for standard input.
    mapping : Mapping
        What the user says.
    wait : float or None
        How long to wait for a first row, s.

    Raises
    ------
    InputError
        If there is no such file, it is empty, or nothing comes in time.
    """
    if wait is not None and not wait >= 0:
        raise InputError(f"the time to wait for rows must be 0 s or more, got {wait:g} s")
    if path == Path("-"):
        if wait is not None and not readable(sys.stdin.buffer, wait):
            raise InputError(f"nothing came in {wait:g} s")
        return Beginning(mapping, Mapping(), [], None, b"", path, None, path)
    pipe = is_pipe(path)
    if pipe and wait is not None:
        raise InputError(PIPE)
    bag = path / _BAG
    if path.is_dir() and not bag.is_file():
        raise InputError("is a folder; name a file in it")
    if not path.exists():
        raise InputError("there is no such file")
    mapping, folder, notes = _beside(path, mapping)
    if path.is_dir():
        size = sum(file.stat().st_size for file in path.iterdir() if file.is_file())
        head = bag.read_bytes()[:_HEAD]
        return Beginning(mapping, folder, notes, size, head, path, None, path)
    if wait is not None:
        _wait(path, folder.merged(mapping), wait)
    ordinary(path)
    content, named_as = path, path
    spooled: Spooled | Unpacked | None = None
    if pipe:
        spooled = Spooled(path)
        content = spooled.path
    head = _first_bytes(content)
    if head.startswith(GZIP):
        spooled = Unpacked(content)
        content = spooled.path
        named_as = path.with_name(path.stem)
        head = _first_bytes(content)
    if not head:
        raise InputError("is empty")
    size = content.stat().st_size
    return Beginning(mapping, folder, notes, size, head, content, spooled, named_as)


def _first_bytes(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD)


def _beside(path: Path, mapping: Mapping) -> tuple[Mapping, Mapping, list[str]]:
    """Return the user's mapping with the sidecar's, the folder's, and what to note of them."""
    folder = Mapping()
    notes = []
    sidecar = path.with_name(path.name + ".toml")
    shared = path.with_name(FOLDER_MAPPING)
    if shared.is_file():
        folder = Mapping.from_toml(shared)
        notes.append(f"defaults were taken from '{shared.name}' in its folder")
    if sidecar.is_file():
        mapping = Mapping.from_toml(sidecar).merged(mapping)
        notes.append(f"the mapping beside it, '{shown(sidecar.name)}', was used")
    return mapping, folder, notes


def _wait(path: Path, mapping: Mapping, patience: float) -> None:
    """Wait until a text file holds a whole row; opening it says what else is wrong."""
    end = wall.monotonic() + patience
    while wall.monotonic() < end:
        with path.open("rb") as file:
            head = file.read(_LONG_HEAD)
        if head and (
            len(head) == _LONG_HEAD or find_reader(path, head, mapping.format).name != "text"
        ):
            return
        try:
            # A last line without its end may still be half a row.
            detect(head, False, mapping)
        except NoRowsError:
            wall.sleep(_POLL)
        except InputError:
            return
        else:
            return
