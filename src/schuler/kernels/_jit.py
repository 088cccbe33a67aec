"""The one decorator for kernels: Numba with a disk cache that cannot go stale.

Numba's own cache looks only at the file that holds a function. A kernel that calls a helper in
another file would keep the helper's old code. So the cache lives in a folder named by a hash of
all kernel sources and of the constants that they freeze.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config

F = TypeVar("F", bound=Callable[..., Any])


def _cache_folder() -> str:
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in [*sorted(here.glob("*.py")), here.parent / "constants.py"]:
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    base = os.environ.get("SCHULER_CACHE_DIR") or os.path.join(
        os.environ.get("XDG_CACHE_HOME")
        or (
            os.path.expanduser("~/Library/Caches")
            if sys.platform == "darwin"
            else os.path.expanduser("~/.cache")
        ),
        "schuler",
    )
    return os.path.join(base, f"kernels-{digest.hexdigest()[:16]}")


CACHE_FOLDER = _cache_folder()


def _writable(folder: str) -> bool:
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


# Without a folder of its own, Numba would cache beside the sources, where old code can come back.
_CACHE = _writable(CACHE_FOLDER)


_FUSE = {"contract"}
"""Let a product and a sum be rounded once; no other liberty is taken with the arithmetic."""


def _compile(function: F, liberties: set[str]) -> F:
    before = config.CACHE_DIR
    config.CACHE_DIR = CACHE_FOLDER
    try:
        compiled: F = numba.njit(cache=_CACHE, error_model="numpy", fastmath=liberties, nogil=True)(
            function
        )
    finally:
        config.CACHE_DIR = before
    return compiled


def kernel(function: F) -> F:
    """Compile a function with `numba.njit`, cached in schuler's own folder."""
    return _compile(function, _FUSE)


def summing_kernel(function: F) -> F:
    """Compile a function whose sums may be taken in another order: several at a time."""
    return _compile(function, _FUSE | {"reassoc"})


def helper(function: F) -> F:
    """Compile a small function that is only ever inlined into kernels."""
    compiled: F = numba.njit(forceinline=True, error_model="numpy", fastmath=_FUSE)(function)
    return compiled
