"""Numba's compilation without its engine: code is optimised as ever, and not loaded.

Numba makes machine code of each function that it compiles, helpers too, and loads it for Python to
call. A kernel is called through an entry point of its own, whose machine code is made once more
(`schuler.kernels._entry_points`), and a helper only as a part of kernels: a sixth of the time of
compilation would be spent on what nobody calls. What LLVM is given, and what it makes of it, is the
same with and without the engine.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys

__all__ = ["without_engine"]


class _NoEngine:
    """Numba's code generator, which adds no module to its engine."""

    def __init__(self, codegen: Any) -> None:
        self._whole = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._whole, name)

    def _add_module(self, module: Any) -> None:
        """Keep a module away from the engine."""

    def set_env(self, name: str, environment: Any) -> None:
        """Leave the environment of a function unset: it is for those that Python calls."""


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """A function's optimised code; others link it from here as from any of Numba's libraries."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(_NoEngine(codegen), name)

    def get_pointer_to_function(self, name: str) -> int:
        """Link and optimise, as Numba does when it asks for this; return 0: nothing is loaded."""
        self._ensure_finalized()
        return 0

    def _finalize_specific(self) -> None:
        """Make no machine code."""


@contextmanager
def without_engine(names: Container[str]) -> Iterator[None]:
    """Have functions that Numba compiles meanwhile, in this thread, not loaded.

    Parameters
    ----------
    names : container of str
        Qualified names of those functions, which have no wrapper for Python. What Numba compiles of
        its own for them may be used by others in this process, and is loaded as ever.
    """
    context = cpu_target.target_context
    codegen = context.codegen()

    def library(codegen: Any, name: str) -> JITCodeLibrary:
        return (_Library if name in names else JITCodeLibrary)(codegen, name)

    with global_compiler_lock:
        # Numba's own runtime is for everyone: it is made and loaded as ever.
        rtsys.initialize(context)
        codegen._library_class = library
        try:
            yield
        finally:
            del codegen._library_class
