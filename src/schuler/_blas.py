"""One thread for the linear algebra of small matrices.

Matrices here have tens of rows. With a thread for each core, those of a BLAS spin while they wait
for one another: an alignment of 25 ms then takes 280 ms of processor time on two cores, and more
on more. What solves many small systems runs with one thread, and the caller's setting is put back.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec, TypeVar

__all__ = ["one_blas_thread", "with_one_blas_thread"]

P = ParamSpec("P")
T = TypeVar("T")

_lock = threading.Lock()
_inside = 0
_limit: Any = None
_controllers: dict[bool, Any] = {}


def _begin() -> None:
    """Set one thread, unless another caller has done so and is not done."""
    global _inside, _limit  # the threads of a BLAS are the process's
    with _lock:
        if _inside == 0 and os.environ.get("OPENBLAS_NUM_THREADS") != "1":
            # SciPy brings a BLAS of its own, which is there once it is loaded.
            scipy = "scipy.linalg" in sys.modules
            if scipy not in _controllers:
                from threadpoolctl import ThreadpoolController

                _controllers[scipy] = ThreadpoolController()
            _limit = _controllers[scipy].limit(limits=1, user_api="blas")
        _inside += 1


def _end() -> None:
    """Put the number of threads back where nobody else needs one."""
    global _inside, _limit
    with _lock:
        _inside -= 1
        if _inside == 0 and _limit is not None:
            _limit.restore_original_limits()
            _limit = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Run what is inside with one thread of the linear algebra.

    Examples
    --------
    >>> from schuler._blas import one_blas_thread
    >>> with one_blas_thread():
    ...     float(np.linalg.solve(np.eye(3), np.ones(3)).sum())
    3.0
    """
    _begin()
    try:
        yield
    finally:
        _end()


def with_one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that runs with one thread of the linear algebra."""

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_blas_thread():
            return function(*args, **kwargs)

    return run
