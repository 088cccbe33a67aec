"""HDF5, and so MATLAB 7.3 files: arrays of numbers at the top, and nothing behind a link.

HDF5 lets a file point elsewhere: soft and external links, datasets whose values are in other files
or put together from others. A file from elsewhere could so bring in any file of the machine; all
of these are refused. What a chunk expands to is checked before it is read.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError, how_to_install, shown
from schuler.io.arrays import OWN, from_arrays, from_own_arrays, holds_samples, own_text
from schuler.io.content import Content
from schuler.io.limits import LEAST, check_size
from schuler.io.mapping import Mapping

__all__ = ["open_hdf5"]

#: the most that deflate can expand
_DEFLATE = 1032
_DEFLATE_ID = 1
#: filters that every HDF5 library has: deflate, shuffle, fletcher32, szip, nbit, scaleoffset; lzf
_FILTERS = (1, 2, 3, 4, 5, 6, 32000)


def open_hdf5(path: Path, mapping: Mapping) -> Content:
    """Load the arrays that are needed.

    Raises
    ------
    InputError
        If h5py is missing, the file is damaged, announces too much or points elsewhere.
    """
    try:
        import h5py
    except ImportError:
        raise InputError(
            f"is an HDF5 file (MATLAB 7.3), which needs h5py: {how_to_install('mat')}, or save it "
            "in MATLAB with -v7"
        ) from None
    try:
        file = h5py.File(path, "r")
    except Exception as error:  # h5py lets many kinds escape from damaged files
        raise _damaged(error) from None
    size = path.stat().st_size
    with file:
        try:
            links = {name: file.get(name, getlink=True) for name in file}
            hard = [name for name, link in links.items() if isinstance(link, h5py.HardLink)]
            datasets = {n: item for n in hard if isinstance(item := file[n], h5py.Dataset)}
            # A structure is a group of its fields; "#refs#" holds what cells refer to.
            groups = [n for n in hard if isinstance(file[n], h5py.Group) and n[0] != "#"]
            fields = {
                f"{n}.{m}": item
                for n in groups
                for m in file[n]
                if isinstance(file[n].get(m, getlink=True), h5py.HardLink)
                and isinstance(item := file[n][m], h5py.Dataset)
                and item.dtype.kind in "iuf"
            }
        except Exception as error:  # as above
            raise _damaged(error) from None
        names = [name for name in links if name in datasets or name not in hard]
        wanted = [*(mapping.variables or {}).values()]
        if not holds_samples(names) or any("." in name for name in wanted):
            datasets |= fields
            names += fields
        taken: dict[str, int] = {}

        def load(name: str) -> Any:
            """Return an array by its name."""
            label = f"array '{shown(name)}'"
            if name not in datasets:
                raise InputError(
                    f"{label} is a link to somewhere else, which is not followed for safety; save "
                    "the array itself"
                )
            try:
                kind = datasets[name].dtype
                if kind.kind not in "iuf":
                    # Of texts, cells and the like, only the type is named.
                    return np.empty(0, kind)
                taken[name] = _check(datasets[name], size, label)
                check_size(sum(taken.values()), size, label)
                # HDF5 keeps MATLAB's columns as rows.
                return np.asarray(datasets[name]).T
            except InputError:
                raise
            except Exception as error:  # as above
                raise _damaged(error) from None

        if OWN in datasets:
            return from_own_arrays(own_text(load(OWN)), names, load, mapping)
        return from_arrays(names, load, mapping)


def _check(dataset: Any, size: int, label: str) -> int:
    """Return the bytes that a dataset needs in memory; refuse what points elsewhere or expands."""
    if dataset.external or dataset.is_virtual:
        raise InputError(
            f"{label} keeps its values in other files, which are not read for safety; save the "
            "values themselves"
        )
    width = max(8, int(dataset.dtype.itemsize))
    wanted: int = width * math.prod(dataset.shape or (0,))
    if dataset.chunks is None:
        return wanted
    nominal = dataset.dtype.itemsize * math.prod(dataset.chunks)
    check_size(nominal, size, label)
    plist = dataset.id.get_create_plist()
    filters = [plist.get_filter(k)[0] for k in range(plist.get_nfilters())]
    for number in filters:
        if number not in _FILTERS:
            raise InputError(f"{label} is compressed by a filter that is not known ({number})")
    if _DEFLATE_ID in filters:
        for k in range(dataset.id.get_num_chunks()):
            _check_chunk(dataset.id, k, nominal, label)
    return wanted


def _check_chunk(identifier: Any, number: int, nominal: int, label: str) -> None:
    """Refuse a chunk that expands to more than its shape; the library would take all of it."""
    info = identifier.get_chunk_info(number)
    if info.size * _DEFLATE <= LEAST:
        return
    data = identifier.read_direct_chunk(info.chunk_offset)[1]
    # Fletcher's checksum adds four bytes before they are compressed.
    most = nominal + 64
    if len(zlib.decompressobj().decompress(data, most + 1)) > most:
        raise InputError(f"{label} has a chunk that expands to more than its {nominal} bytes")


def _damaged(error: Exception) -> InputError:
    reason = (str(error).splitlines() or [""])[0] or type(error).__name__
    return InputError(f"is a damaged or truncated .mat or HDF5 file ({shown(reason)[:120]})")
