"""The file of a saved state: arrays in an npz archive, with a digest of their content.

The format is strict, so that nothing of a file is believed before it is checked: arrays are
stored without compression (sizes that are declared can not exceed the file), hold float64 or
uint8, and are named by the reader. ``meta`` is JSON text; ``digest`` is the SHA-256 of all other
arrays with their names, types and shapes, so that a damaged file is refused even where its values
look possible.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import replacing
from schuler.errors import InputError

__all__ = ["FORMAT", "read_checkpoint", "write_checkpoint"]

Array = NDArray[Any]

FORMAT = "schuler.checkpoint/2"
"""Raised when arrays are added or change their meaning."""

LARGEST_FILE = 8 << 20
"""Bytes; a full state of a live alignment takes a third."""

_HEADER = re.compile(
    rb"\{'descr': '(<f8|\|u1)', 'fortran_order': False, 'shape': \((\d{1,9}(?:, ?\d{1,9})*,?)?\),? "
    rb"?\} *\n"
)
_DTYPES: dict[bytes, np.dtype[Any]] = {b"<f8": np.dtype("<f8"), b"|u1": np.dtype("u1")}

#: the ways in which zipfile says that an archive is damaged
_DAMAGED = (
    zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, KeyError, TypeError,
    NotImplementedError, RuntimeError, OverflowError, IndexError,
)  # fmt: skip


def write_checkpoint(
    path: str | Path, meta: Mapping[str, Any], arrays: Mapping[str, Array]
) -> None:
    """Write arrays and their description, whole or not at all.

    Parameters
    ----------
    path : str or path
    meta : dict
        What JSON can hold; the format is added.
    arrays : dict of str to array
        float64.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = json.dumps({"format": FORMAT, **meta}).encode()
    held = {name: np.ascontiguousarray(a, "<f8") for name, a in arrays.items()}
    held["meta"] = np.frombuffer(text, np.uint8)
    held["digest"] = np.frombuffer(_digest(held), np.uint8)
    # In memory first: an archive that cannot be finished leaves a file object in disorder.
    made = io.BytesIO()
    np.savez(made, **held)  # type: ignore[arg-type]
    with replacing(path) as temporary:
        temporary.write_bytes(made.getbuffer())


def read_checkpoint(
    path: str | Path, largest: int = LARGEST_FILE
) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Return the description and the arrays of a file of `write_checkpoint`.

    Parameters
    ----------
    path : str or path
    largest : int
        Bytes that such a file may have.

    Raises
    ------
    InputError
        If the file cannot be read, is too large, damaged, of another format, or not a file of
        `write_checkpoint` at all.
    """
    path = Path(path)
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is not a regular file, so no saved state")
        if status.st_size > largest:
            raise InputError(
                f"{path}: is not a saved state ({status.st_size} bytes; none is larger than "
                f"{largest})"
            )
        with path.open("rb") as file:
            data = file.read(largest)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason})") from None
    try:
        arrays = _members(data)
    except _DAMAGED as error:
        raise InputError(f"{path}: is not a saved state, or a damaged one ({error})") from None
    said = arrays.pop("digest", np.empty(0, np.uint8))
    if "meta" not in arrays or arrays["meta"].dtype != np.uint8:
        raise InputError(f"{path}: is not a saved state (it has no description)")
    try:
        meta = json.loads(arrays["meta"].tobytes().decode())
    except (ValueError, RecursionError):
        meta = None
    if not isinstance(meta, dict):
        raise InputError(f"{path}: is not a saved state (its description is not JSON)")
    if meta.get("format") != FORMAT:
        raise InputError(
            f"{path}: has the format {str(meta.get('format'))[:40]!r}, and this version reads "
            f"'{FORMAT}'; start anew with another file"
        )
    if said.tobytes() != _digest(arrays):
        raise InputError(f"{path}: is damaged (its content does not fit its SHA-256 digest)")
    del arrays["meta"]
    return meta, arrays


def _digest(arrays: Mapping[str, Array]) -> bytes:
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        total.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        total.update(array.tobytes())
    return total.digest()


def _members(data: bytes) -> dict[str, Array]:
    """Return the arrays of an archive whose members are all stored as they are."""
    out: dict[str, Array] = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        # Members may overlap: each is smaller than the file, and all of them must be as well.
        if sum(info.file_size for info in archive.infolist()) > len(data):
            raise ValueError("its arrays are larger than the file")
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            if name in out or not info.filename.endswith(".npy"):
                raise ValueError(f"an archive member {info.filename[:40]!r} too many")
            if info.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"array {name[:40]!r} is compressed")
            out[name] = _array(name, archive.read(info))
    return out


def _array(name: str, data: bytes) -> Array:
    """Return an array of the npy format, whose header is matched and never evaluated."""
    length = int.from_bytes(data[8:10], "little")
    header = _HEADER.fullmatch(data[10 : 10 + length])
    if data[:8] != b"\x93NUMPY\x01\x00" or header is None:
        raise ValueError(f"array {name[:40]!r} has no header that is known")
    dtype = _DTYPES[header[1]]
    shape = tuple(int(n) for n in (header[2] or b"").replace(b",", b" ").split())
    size = dtype.itemsize
    for n in shape:
        size *= n
    if len(shape) > 2 or size != len(data) - 10 - length:
        raise ValueError(f"array {name[:40]!r} has another size than its header says")
    return np.frombuffer(data, dtype, offset=10 + length).reshape(shape).copy()
