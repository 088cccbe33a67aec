"""NumPy's .npz archives; pickled objects are never loaded."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.arrays import from_arrays
from schuler.io.content import Content
from schuler.io.mapping import Mapping
from schuler.io.parquet import own_mapping

__all__ = ["NpzReader"]

#: the ways in which NumPy and zipfile say that an archive is damaged
_DAMAGED = (
    zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, KeyError, TypeError,
    NotImplementedError, RuntimeError, SyntaxError, UnicodeError, MemoryError, OverflowError,
)  # fmt: skip


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
        with path.open("rb") as file:
            try:
                archive = np.load(file, allow_pickle=False)
                names = list(archive.files)
            except _DAMAGED as error:
                raise InputError(f"is a damaged npz archive ({error})") from None

            def load(name: str) -> Any:
                try:
                    return archive[name]
                except _DAMAGED as error:
                    if "allow_pickle" in str(error):
                        raise InputError(
                            f"array '{name}' holds Python objects, which are not loaded for "
                            "safety; save it as an array of numbers"
                        ) from None
                    raise InputError(f"array '{name}' is damaged ({error})") from None

            with archive:
                if "schuler" not in names:
                    return from_arrays(names, load, mapping)
                own = _own(load("schuler"))
                rest = [name for name in names if name != "schuler"]
                content = from_arrays(rest, load, Mapping())
        content.said = own_mapping(own)
        content.name = str(own["name"]) if "name" in own else None
        content.complete = True
        return content


def _own(text: Any) -> dict[str, Any]:
    try:
        own = json.loads(str(text))
    except ValueError:
        own = None
    if not isinstance(own, dict):
        raise InputError("the description that schuler wrote into the array 'schuler' is damaged")
    return own
