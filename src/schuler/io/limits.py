"""How much memory a file may request: what it declares is compared before any is taken."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from schuler.errors import InputError

__all__ = [
    "LEAST",
    "RATIO",
    "ROW_BYTES",
    "STREAM_RATIO",
    "available_memory",
    "check_rows",
    "check_size",
    "largest",
]

#: what any file may expand to, however small it is: bytes
LEAST = 128 << 20

#: so many times a file's own size is the most that is taken from it
RATIO = 50

#: the same for samples of formats that are read in pieces; without noise, ours reach 40
STREAM_RATIO = 200

#: bytes of a sample in memory: time, dt, three angles, three velocities
ROW_BYTES = 64

_SHARE = 0.8
_SMALL = 1 << 22
"""Bytes for which free memory is not looked up: that takes longer than to read as many."""
_CGROUP = Path("/sys/fs/cgroup")


def available_memory() -> int:
    """Return the bytes that a process can take without pushing others out."""
    found = []
    with suppress(OSError, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        found += [1024 * int(x.split()[1]) for x in lines if x.startswith("MemAvailable:")]
    with suppress(OSError, ValueError):
        most = int((_CGROUP / "memory.max").read_text())
        used = int((_CGROUP / "memory.current").read_text())
        stat = dict(x.split() for x in (_CGROUP / "memory.stat").read_text().splitlines())
        # What was read from files is given up when memory is wanted.
        cache = int(stat.get("file", 0)) - int(stat.get("shmem", 0))
        found.append(max(0, most - used + cache))
    if not found:
        with suppress(OSError, ValueError, AttributeError):
            found.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return min(found, default=1 << 34)


def largest(size: int) -> int:
    """Return how many bytes a file of `size` bytes may expand to, free memory left aside."""
    return max(LEAST, RATIO * size)


def check_rows(rows: int, size: int) -> None:
    """Refuse a number of rows that cannot be in a file which is read in pieces.

    Parameters
    ----------
    rows : int
        Rows that are announced.
    size : int
        Bytes of the file.

    Raises
    ------
    InputError
        If they take more than `STREAM_RATIO` times the file's size, as samples.
    """
    if rows * ROW_BYTES > max(LEAST, STREAM_RATIO * size):
        raise InputError(
            f"announces {rows} rows in {size} bytes, more than are taken from a file of that "
            "size: it is damaged, or made to fill the memory; if it is right, save it without "
            "compression"
        )


def check_size(wanted: int, size: int, what: str) -> None:
    """Refuse what would take too much memory.

    Parameters
    ----------
    wanted : int
        Bytes that are announced.
    size : int
        Bytes of the file.
    what : str
        Who announces them, as ``"array 'gyro'"``.

    Raises
    ------
    InputError
        If they are more than `RATIO` times the file's size (and more than `LEAST`), or more than
        the machine has.
    """
    if wanted > largest(size):
        raise InputError(
            f"{what} announces {_mega(wanted)} MB in a file of {size} bytes, more than the "
            f"{_mega(largest(size))} MB that are taken from it: it is damaged, or made to fill "
            "the memory; if it is right, save it without compression"
        )
    if wanted <= _SMALL:
        return
    free = available_memory()
    if wanted > _SHARE * free:
        raise InputError(
            f"{what} needs {_mega(wanted)} MB of memory, and {_mega(free)} MB are free; cut the "
            "file, or save it as Parquet or CSV, which are read in pieces"
        )


def _mega(count: int) -> str:
    return f"{count // 1_000_000}" if count >= 10_000_000 else f"{count / 1e6:.3g}"
