"""MATLAB's .mat files: versions up to 7 through SciPy, 7.3 (HDF5) through h5py.

The sizes that a file announces are checked here before either library takes memory for them
(`schuler.io.matfile`, `schuler.io.hdf5`).
"""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError, shown
from schuler.io.arrays import OWN, from_arrays, from_own_arrays, holds_samples, own_text
from schuler.io.content import Content
from schuler.io.hdf5 import open_hdf5
from schuler.io.limits import check_size
from schuler.io.mapping import Mapping
from schuler.io.matfile import structures, survey

__all__ = ["MatReader", "load_array", "numeric_array"]

#: structures in structures
_DEEPEST = 4
_HDF5 = b"\x89HDF\r\n\x1a\n"


class MatReader:
    """Reader of .mat files, and of HDF5 with arrays at its top."""

    name = "mat"
    suffixes: tuple[str, ...] = (".mat", ".h5", ".hdf5")

    def sniff(self, head: bytes) -> bool:
        """Say whether MATLAB's or HDF5's mark is there."""
        return head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", _HDF5))

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Load the arrays that are needed."""
        with path.open("rb") as file:
            head = file.read(520)
        if head[:8] == _HDF5 or head[512:520] == _HDF5 or head.startswith(b"MATLAB 7.3"):
            return open_hdf5(path, mapping)
        return _open_classic(path, mapping)


def load_array(path: Path, name: str) -> Any:
    """Return one array of a file of version 4 or 5; its size must have been checked.

    Raises
    ------
    InputError
        If the file is damaged or truncated.
    """
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return loadmat(str(path), variable_names=[name])[name]
    except Exception as error:  # SciPy's reader lets many kinds escape from damaged files
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise InputError(f"is a damaged or truncated .mat file ({shown(reason)[:120]})") from None


def numeric_array(path: Path, name: str) -> NDArray[np.float64]:
    """Return an array of numbers of a file of version 4 or 5.

    Raises
    ------
    InputError
        If the file is another one, is damaged, or has no such array.
    """
    try:
        with path.open("rb") as file:
            head = file.read(520)
        if _HDF5 in head or head.startswith(b"MATLAB 7.3"):
            raise InputError("is a MATLAB 7.3 file: save it in MATLAB with -v7")
        sizes = survey(path)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})") from None
    if name not in sizes:
        raise InputError(f"has no array '{name}'; it has {shown(', '.join(sizes)) or 'nothing'}")
    check_size(sizes[name], path.stat().st_size, f"array '{name}'")
    value = np.asarray(load_array(path, name))
    if value.dtype.kind not in "iuf":
        raise InputError(f"array '{name}' does not hold real numbers")
    return value.astype(np.float64)


def _open_classic(path: Path, mapping: Mapping) -> Content:
    sizes = survey(path)
    parts = structures(path)
    taken: dict[str, int] = {}
    size = path.stat().st_size

    def load(name: str) -> Any:
        taken[name] = sizes[name]
        check_size(sum(taken.values()), size, f"array '{shown(name)}'")
        return load_array(path, name)

    def field(name: str) -> Any:
        top, *rest = name.split(".")
        if not rest:
            return load(name)
        value = whole(top)
        for part in rest:
            value = value[part].item()
        return value

    @cache
    def whole(name: str) -> Any:
        sizes[name] = parts[name]
        return load(name)

    wanted = [*(mapping.variables or {}).values()]
    names = list(sizes)
    # A structure's fields are only known once it is loaded; arrays at the top come first.
    if not holds_samples(names) or any("." in name for name in wanted):
        for name in parts:
            names += _fields(whole(name), name)
    if OWN in sizes:
        return from_own_arrays(own_text(load(OWN)), names, field, mapping)
    return from_arrays(names, field, mapping)


def _fields(value: Any, prefix: str, depth: int = 0) -> list[str]:
    """Return the names of a structure's fields that hold numbers, ``imu.wb``."""
    out: list[str] = []
    if value.size != 1 or depth > _DEEPEST:
        return out
    for name in value.dtype.names or ():
        inner = value[name].item()
        label = f"{prefix}.{name}"
        if getattr(inner, "dtype", None) is None:
            continue
        if inner.dtype.names:
            out += _fields(inner, label, depth + 1)
        elif inner.dtype.kind in "iuf":
            out.append(label)
    return out
