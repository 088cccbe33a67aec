"""NumPy's .npz archives and .npy arrays; pickled objects are never loaded."""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError, shown
from schuler.io.arrays import OWN, from_arrays, from_own_arrays
from schuler.io.columns import choose
from schuler.io.content import Content
from schuler.io.limits import check_size
from schuler.io.mapping import Mapping

__all__ = ["NpyReader", "NpzReader"]

#: bytes of the record at an archive's end, its comment included; a count that is elsewhere
_LONGEST_END = 22 + 0xFFFF
_MORE = 0xFFFF


class NpzReader:
    """Reader of .npz archives with t, gyro and accel, or t, dtheta and dvel."""

    name = "npz"
    suffixes: tuple[str, ...] = (".npz",)

    def sniff(self, head: bytes) -> bool:
        """Say whether this is a zip archive."""
        return head[:4] in (b"PK\x03\x04", b"PK\x05\x06")

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Load the arrays that are needed."""
        if not zipfile.is_zipfile(path):
            raise InputError("is not an npz archive, or a truncated one")
        with _damage("is a damaged npz archive"):
            archive = zipfile.ZipFile(path)
        with archive:
            _check_count(path, len(archive.infolist()))
            arrays = _Arrays(archive, path.stat().st_size)
            if OWN not in arrays.names:
                return from_arrays(arrays.names, arrays.load, mapping)
            return from_own_arrays(str(arrays.load(OWN)), arrays.names, arrays.load, mapping)


class NpyReader:
    """Reader of a single .npy array: a table with a column each, or an array with named fields."""

    name = "npy"
    suffixes: tuple[str, ...] = (".npy",)

    def sniff(self, head: bytes) -> bool:
        """Say whether NumPy's mark is there."""
        return head.startswith(b"\x93NUMPY")

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Load the array."""
        if mapping.variables is not None:
            raise InputError("a .npy file holds one array: --variables is for .npz and .mat files")
        size = path.stat().st_size
        with _damage("is a damaged .npy file"):
            with path.open("rb") as file:
                shape, kind = _header(file)
            if kind.hasobject:
                raise InputError(
                    "holds Python objects, which are not loaded for safety; save it as an array of "
                    "numbers"
                )
            if size < math.prod(shape) * kind.itemsize:
                raise ValueError(f"{size} bytes for an array of shape {shape}")
            check_size(8 * math.prod(shape) * max(1, len(kind.names or ())), size, "its array")
            table = np.load(path, allow_pickle=False)
        if table.dtype.names is None:
            return from_arrays(["array"], lambda _: table, replace(
                mapping, variables={"matrix": "array"}))  # fmt: skip
        names = [str(name) for name in table.dtype.names]
        chosen = choose(names, len(names), mapping)
        columns = {i: np.ravel(_real(names[i], table[names[i]])) for i in chosen.all}
        return Content(
            blocks=lambda: iter([(
                None if chosen.t is None else columns[chosen.t],
                [columns[i] for i in chosen.values],
                None if chosen.dt is None else columns[chosen.dt],
            )]),
            said=chosen.said(),
            time_label=chosen.t_label,
            rows=table.size,
            mark=chosen.mark,
            stamps=None if chosen.t is None else columns[chosen.t],
        )  # fmt: skip


def _real(name: str, column: Any) -> Any:
    if column.dtype.kind not in "iuf":
        raise InputError(f"field '{shown(name)}' is of type {column.dtype}, not real numbers")
    return column.astype(np.float64)


def _check_count(path: Path, found: int) -> None:
    """Compare how many arrays the archive's end announces with those that it lists."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - _LONGEST_END))
        end = file.read()
    at = end.rfind(b"PK\x05\x06")
    announced = int.from_bytes(end[at + 10 : at + 12], "little")
    if at >= 0 and announced not in (found, _MORE):
        raise InputError(f"is a damaged npz archive ({found} of {announced} arrays are listed)")


class _Arrays:
    """The arrays of an archive, whose sizes are checked before they are loaded."""

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive = archive
        self._size = size
        self._taken: dict[str, int] = {}
        self._entries: dict[str, zipfile.ZipInfo] = {}
        with _damage("is a damaged npz archive"):
            for entry in archive.infolist():
                if entry.filename in self._entries:
                    raise ValueError(f"two entries are named '{entry.filename}'")
                # Opening compares the name in the directory with the one at the entry itself.
                with archive.open(entry):
                    self._entries[entry.filename.removesuffix(".npy")] = entry
        self.names = list(self._entries)

    def load(self, name: str) -> Any:
        """Return an array."""
        entry = self._entries[name]
        label = f"array '{shown(name)}'"
        with _damage(f"{label} is damaged"):
            with self._archive.open(entry) as file:
                shape, kind = _header(file)
            if kind.hasobject:
                raise InputError(
                    f"{label} holds Python objects, which are not loaded for safety; save it as "
                    "an array of numbers"
                )
            count = math.prod(shape)
            # Numbers of any width become float64.
            self._taken[name] = max(entry.file_size, 8 * count, kind.itemsize * count)
            check_size(sum(self._taken.values()), self._size, label)
            with self._archive.open(entry) as file:
                return np.lib.format.read_array(file, allow_pickle=False)


def _header(file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read is None:
        raise ValueError(f"version {version[0]}.{version[1]} of the npy format is not known")
    shape, _, kind = read(file)
    return shape, kind


@contextmanager
def _damage(what: str) -> Iterator[None]:
    """Say what NumPy, zipfile and zlib raise for damaged archives, and they raise anything."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except Exception as error:
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise InputError(f"{what} ({shown(reason)[:120]})") from None
