"""How much memory a file may ask for: what it declares is compared before any is taken."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from schuler.errors import InputError

__all__ = ["LEAST", "RATIO", "available_memory", "check_size", "largest"]

#: what any file may expand to, however small it is: bytes
LEAST = 128 << 20

#: so many times a file's own size is the most that is taken from it
RATIO = 50

_SHARE = 0.8
_CGROUP = Path("/sys/fs/cgroup")


def available_memory() -> int:
    """Return the bytes that a process can take without pushing others out."""
    found = []
    with suppress(OSError, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        found += [1024 * int(x.split()[1]) for x in lines if x.startswith("MemAvailable:")]
    with suppress(OSError, ValueError):
        most = int((_CGROUP / "memory.max").read_text())
        found.append(max(0, most - int((_CGROUP / "memory.current").read_text())))
    if not found:
        with suppress(OSError, ValueError, AttributeError):
            found.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return min(found, default=1 << 34)


def largest(size: int) -> int:
    """Return how many bytes a file of `size` bytes may expand to, free memory left aside."""
    return max(LEAST, RATIO * size)


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
    free = available_memory()
    if wanted > _SHARE * free:
        raise InputError(
            f"{what} needs {_mega(wanted)} MB of memory, and {_mega(free)} MB are free; cut the "
            "file, or save it as Parquet or CSV, which are read in pieces"
        )


def _mega(count: int) -> str:
    return f"{count // 1_000_000}" if count >= 10_000_000 else f"{count / 1e6:.3g}"
