"""The readers by name, and which of them a file needs."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from schuler.errors import InputError, near
from schuler.io.content import Reader

__all__ = ["find_reader", "readers", "register"]

GROUP = "schuler.readers"

_registered: dict[str, Reader] = {}


@cache
def _built_in() -> dict[str, Reader]:
    from schuler.io.binary import BinaryReader
    from schuler.io.kfgins import KfGinsReader
    from schuler.io.mat import MatReader
    from schuler.io.novatel import NovatelReader
    from schuler.io.npz import NpyReader, NpzReader
    from schuler.io.parquet import ParquetReader
    from schuler.io.psins import PsinsReader
    from schuler.io.ros import RosReader
    from schuler.io.text import TextReader
    from schuler.io.ulog import UlogReader

    kinds = (ParquetReader, NpzReader, NpyReader, MatReader, RosReader, UlogReader, NovatelReader,
             PsinsReader, KfGinsReader, BinaryReader, TextReader)  # fmt: skip
    return {kind.name: kind() for kind in kinds}


def readers() -> dict[str, Reader]:
    """Return all readers by name: schuler's own, registered ones, and those of other packages.

    Raises
    ------
    InputError
        If another package's reader cannot be loaded or takes a name that is taken.

    Examples
    --------
    >>> "parquet" in readers()
    True
    """
    found = dict(_built_in())
    found.update(_registered)
    for name, entry in _entries():
        if name in found:
            raise InputError(
                f"the reader '{name}' of '{entry.value}' has the name of a reader that is already "
                "there; remove that package or ask its makers to rename it"
            )
        found[name] = _load(name, entry)
    return found


def register(reader: Reader) -> None:
    """Add a reader for this process; `schuler.io.content` says what it must be.

    Raises
    ------
    InputError
        If it is no reader or its name belongs to a reader of schuler's own.

    Examples
    --------
    >>> class Counting:
    ...     name, suffixes = "counting", (".cnt",)
    ...     def sniff(self, head):
    ...         return head.startswith(b"CNT")
    ...     def open(self, path, mapping):
    ...         return [(np.arange(3.0), np.zeros((3, 6)))]
    >>> register(Counting())
    >>> "counting" in readers()
    True
    """
    if not isinstance(reader, Reader):
        raise InputError(f"{reader!r} is no reader: it needs name, suffixes, sniff and open")
    if reader.name in _built_in():
        raise InputError(f"the reader '{reader.name}' has the name of one of schuler's own")
    _registered[reader.name] = reader


def find_reader(path: Path, head: bytes, name: str | None = None) -> Reader:
    """Choose a file's reader: the one that is named, or by its content, its suffix, then text.

    Other packages' readers are loaded only for a file that none of schuler's own knows.

    Raises
    ------
    InputError
        If nothing fits, or a reader that is needed cannot be loaded or is unknown.
    """
    if name is not None:
        known = readers()
        if name not in known:
            raise InputError(
                f"format: unknown reader '{name}'{near(name, known)}; known: {', '.join(known)}"
            )
        return known[name]
    own = [*_registered.values(), *_built_in().values()]
    suffix = path.suffix.lower()
    for reader in own:
        if reader.sniff(head):
            return reader
    for reader in own:
        # A binary format's suffix on a text file does not make it binary.
        if suffix in reader.suffixes and (reader.name != "mat" or b"\0" in head):
            return reader
    if _entries():
        others = [reader for name, reader in readers().items() if name not in _built_in()]
        for reader in others:
            if reader.sniff(head) or suffix in reader.suffixes:
                return reader
    if b"\0" in head and head[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        names = ", ".join(_built_in())
        raise InputError(
            f"is neither text nor a known binary format (known: {names}); for plain float64 "
            "records name it .bin"
        )
    return _built_in()["text"]


def _entries() -> list[tuple[str, EntryPoint]]:
    return [(entry.name, entry) for entry in entry_points(group=GROUP)]


@cache
def _load(name: str, entry: EntryPoint) -> Reader:
    try:
        loaded: Any = entry.load()
        reader = loaded() if isinstance(loaded, type) else loaded
    except Exception as error:  # any package's code may run here
        raise InputError(
            f"the reader '{name}' of '{entry.value}' cannot be loaded "
            f"({type(error).__name__}: {error}); repair or remove that package"
        ) from None
    if not isinstance(reader, Reader):
        raise InputError(
            f"the reader '{name}' of '{entry.value}' is no reader: it needs name, suffixes, "
            "sniff and open"
        )
    return reader
