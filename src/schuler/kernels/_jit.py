"""The one decorator for kernels: Numba with a disk cache that cannot go stale.

Numba's own cache looks only at the file that holds a function. A kernel that calls a helper in
another file would keep the helper's old code. So the cache lives in a folder named by a hash of
all kernel sources and of the constants that they freeze.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from schuler.kernels._cache import attach_cache

F = TypeVar("F", bound=Callable[..., Any])

_FUSE = {"contract"}
"""Let a product and a sum be rounded once; no other liberty is taken with the arithmetic."""


def _compile(function: F, liberties: set[str]) -> F:
    compiled: F = numba.njit(error_model="numpy", fastmath=liberties, nogil=True)(function)
    attach_cache(compiled, function)
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


def inlined(function: F) -> F:
    """Compile a small function as if its lines stood in the kernel: the same bits as if they did.

    A `helper` is inlined later, when products and sums are chosen that are rounded once.
    """
    compiled: F = numba.njit(inline="always", error_model="numpy", fastmath=_FUSE)(function)
    return compiled
