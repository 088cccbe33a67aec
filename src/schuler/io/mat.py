"""MATLAB's .mat files: versions up to 7 through SciPy, 7.3 (HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

from schuler.errors import InputError
from schuler.io.arrays import from_arrays
from schuler.io.content import Content
from schuler.io.mapping import Mapping

__all__ = ["MatReader"]

_HDF5 = b"\x89HDF\r\n\x1a\n"


class MatReader:
    """Reader of .mat files."""

    name = "mat"
    suffixes: tuple[str, ...] = (".mat",)

    def sniff(self, head: bytes) -> bool:
        """Say whether MATLAB's or HDF5's mark is there."""
        return head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", _HDF5))

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Load the arrays that are needed."""
        with path.open("rb") as file:
            head = file.read(520)
        if head[:8] == _HDF5 or head[512:520] == _HDF5 or head.startswith(b"MATLAB 7.3"):
            return _open_hdf5(path, mapping)
        return _open_classic(path, mapping)


def _open_classic(path: Path, mapping: Mapping) -> Content:
    from scipy.io import loadmat, whosmat

    _check_length(path)
    try:
        names = [name for name, _, kind in whosmat(str(path)) if kind not in ("cell", "struct")]
    except Exception as error:  # SciPy's reader lets many kinds escape from damaged files
        raise _damaged(error) from None

    def load(name: str) -> Any:
        try:
            return loadmat(str(path), variable_names=[name])[name]
        except Exception as error:  # as above
            raise _damaged(error) from None

    return from_arrays(names, load, mapping)


def _check_length(path: Path) -> None:
    """Refuse a version 5 file whose last element is cut off; SciPy would leave it out silently."""
    size, place = path.stat().st_size, 128
    with path.open("rb") as file:
        head = file.read(place)
        if not head.startswith(b"MATLAB 5.0"):
            return
        order: Literal["little", "big"] = "little" if head[126:128] == b"IM" else "big"
        while place < size:
            file.seek(place + 4)
            place += 8 + int.from_bytes(file.read(4), order)
    if place > size:
        raise _damaged(ValueError(f"{size} bytes where {place} are announced"))


def _open_hdf5(path: Path, mapping: Mapping) -> Content:
    try:
        import h5py
    except ImportError:
        raise InputError(
            "is a MATLAB 7.3 file, which needs h5py: install schuler[mat], or save it in MATLAB "
            "with -v7"
        ) from None
    try:
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        raise _damaged(error) from None
    with file:
        names = [name for name in file if isinstance(file.get(name), h5py.Dataset)]

        def load(name: str) -> Any:
            try:
                # HDF5 keeps MATLAB's columns as rows.
                return np.asarray(file[name]).T
            except (OSError, RuntimeError, ValueError, TypeError, KeyError) as error:
                raise _damaged(error) from None

        return from_arrays(names, load, mapping)


def _damaged(error: Exception) -> InputError:
    reason = (str(error).splitlines() or [type(error).__name__])[0]
    return InputError(f"is a damaged or truncated .mat file ({reason[:120]})")
