"""The one decorator for kernels: Numba with a disk cache that cannot go stale.

Numba's own cache looks only at the file that holds a function. A kernel that calls a helper in
another file would keep the helper's old code. So the cache lives in a folder named by a hash of
all kernel sources and of the constants that they freeze.

Numba is imported when a kernel has to be compiled: one that stands in the folder is called without
it (`schuler.kernels._machine_code`).
"""

from __future__ import annotations

import hashlib
import inspect
import os
import re
from collections.abc import Callable
from pathlib import Path
from threading import RLock
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from schuler.kernels import _machine_code as machine_code
from schuler.kernels._cache import read_code, write_code

F = TypeVar("F", bound=Callable[..., Any])
Way = Callable[..., Any]

_lock = RLock()

_FUSE = frozenset({"contract"})
"""Let a product and a sum be rounded once; no other liberty is taken with the arithmetic."""

_PLAIN = {np.float64: float, np.int64: int, np.bool_: bool}
"""What scalars of NumPy are passed as."""

_UNCOMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


def _with_dispatchers(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose calls of kernels and helpers are ones of Numba's dispatchers."""
    assert isinstance(function, FunctionType)
    names = {
        name: value.dispatcher
        for name in function.__code__.co_names
        if isinstance(value := function.__globals__.get(name), _Compiled)
    }
    made = FunctionType(
        function.__code__, {**function.__globals__, **names}, function.__name__,
        function.__defaults__, function.__closure__,
    )  # fmt: skip
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    made.__doc__ = function.__doc__
    return made


class _Compiled:
    """A function that is compiled when it is needed.

    Parameters
    ----------
    function : callable
    options : dict
        Of `numba.njit`.
    cached : bool
        Whether Numba keeps it on disk.
    """

    def __init__(
        self, function: Callable[..., Any], options: dict[str, Any], cached: bool = False
    ) -> None:
        self.py_func = function
        self._cached = cached
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.__wrapped__ = function
        self._options = options
        self._dispatcher: Any = None
        self._wrapped: Any = None

    @property
    def dispatcher(self) -> Any:
        """Numba's dispatcher for calls from other kernels."""
        with _lock:
            if self._dispatcher is None:
                import numba

                # Without an array of its own a kernel needs nobody who counts what holds memory.
                self._dispatcher = numba.njit(
                    error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True,
                    _nrt=_makes_arrays(self.py_func), **self._options,
                )(_with_dispatchers(self.py_func))  # fmt: skip
        return self._dispatcher

    @property
    def wrapped(self) -> Any:
        """Numba's dispatcher for calls from Python."""
        if self._wrapped is None:
            with _lock:
                if self._wrapped is None:
                    import numba

                    from schuler.kernels._numba_cache import attach_cache

                    function = _with_dispatchers(self.py_func)
                    made = numba.njit(error_model="numpy", **self._options)(function)
                    if self._cached:
                        attach_cache(made, function)
                    # Others see it with its cache only.
                    self._wrapped = made
        return self._wrapped

    def __call__(self, *args: Any, **named: Any) -> Any:
        return self.wrapped(*args, **named)

    def __repr__(self) -> str:
        return f"<kernel {self.__module__}.{self.__name__}>"


_MAKERS = frozenset(
    {"argsort", "array", "copy", "empty", "full", "median", "ones", "ravel", "sort", "zeros"}
)
"""Names of what makes arrays; a kernel that uses one is called through Numba, which frees them."""


def _makes_arrays(function: Callable[..., Any]) -> bool:
    """Say whether a function, or one that it calls, uses a name of `_MAKERS`."""
    assert isinstance(function, FunctionType)
    names = function.__code__.co_names
    return not _MAKERS.isdisjoint(names) or any(
        _makes_arrays(called.py_func)
        for name in names
        if isinstance(called := function.__globals__.get(name), _Compiled)
    )


def file_of(place: str, words: tuple[str, ...]) -> str:
    """Return the name of the file of a kernel (module.name) that is compiled for some types."""
    digest = hashlib.sha256("/".join([place, *words]).encode()).hexdigest()[:12]
    return f"{place}-{digest}.kernel"


class _Kernel(_Compiled):
    """A compiled loop: a way to call it for each combination of Python's types that has come."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, options, cached=True)
        self._signature = inspect.signature(function)
        self._count = len(self._signature.parameters)
        self._ways: dict[tuple[type, ...], list[Way]] = {}
        self._codes: dict[tuple[str, ...], Way | None] = {}
        self._by_numba: bool | None = None

    def __call__(self, *args: Any, **named: Any) -> Any:
        if named or len(args) != self._count:
            bound = self._signature.bind(*args, **named)
            bound.apply_defaults()
            args = bound.args
        for way in self._ways.get(tuple(map(type, args)), ()):
            found = way(*args)
            if found is not NotImplemented:
                return found
        return self._call_first(args)

    def _call_first(self, args: tuple[Any, ...]) -> Any:
        """Call a kernel for arguments that no way so far takes; keep the way that does."""
        words = None if self._through_numba() else machine_code.describe(args)
        if words is None:
            return self.wrapped(*args)
        with _lock:
            if words not in self._codes:
                self._codes[words] = self._code(words)
        code = self._codes[words]
        if code is None:
            return self.wrapped(*args)
        way = _plain(code, args)
        found = way(*args)
        if found is NotImplemented:
            # An array that must not be changed, or one of a type that is like another.
            return self.wrapped(*args)
        self._ways.setdefault(tuple(map(type, args)), []).append(way)
        return found

    def compile_for(self, words: tuple[str, ...]) -> None:
        """Compile a kernel for types of arguments, as `describe` has them, unless it was before."""
        if self._through_numba():
            from schuler.kernels._entry_points import numba_types

            self.wrapped.compile(numba_types(words))
            # Says that Numba has it.
            write_code(file_of(f"{self.__module__.rpartition('.')[2]}.{self.__name__}", words))
        else:
            self._code(words)

    def _through_numba(self) -> bool:
        if self._by_numba is None:
            self._by_numba = not machine_code.available() or _makes_arrays(self.py_func)
        return self._by_numba

    def _code(self, words: tuple[str, ...]) -> Way | None:
        """Return machine code from the folder, or compile it and put it there."""
        file = file_of(f"{self.__module__.rpartition('.')[2]}.{self.__name__}", words)
        kept = read_code(file)
        if kept is None:
            from schuler.kernels._entry_points import compile_entry

            name = "schuler_" + re.sub(r"\W", "_", Path(file).stem)
            kept = compile_entry(self.dispatcher, words, name) or (b"", b"")
            write_code(file, *kept)
        if not kept[1]:
            self._by_numba = True
            return None
        return machine_code.bind(*kept)


def _plain(way: Way, args: tuple[Any, ...]) -> Way:
    """Return a way that takes scalars of NumPy where these arguments have some."""
    those = [(k, _PLAIN[type(arg)]) for k, arg in enumerate(args) if type(arg) in _PLAIN]
    if not those:
        return way

    def converted(*args: Any) -> Any:
        given = list(args)
        for k, plain in those:
            given[k] = plain(given[k])
        return way(*given)

    return converted


def _kernel(function: F, liberties: frozenset[str]) -> F:
    if _UNCOMPILED:
        return function
    return cast(F, _Kernel(function, {"fastmath": set(liberties), "nogil": True}))


def kernel(function: F) -> F:
    """Compile a function with `numba.njit`, cached in schuler's own folder."""
    return _kernel(function, _FUSE)


def summing_kernel(function: F) -> F:
    """Compile a function whose sums may be taken in another order: several at a time."""
    return _kernel(function, _FUSE | {"reassoc"})


def helper(function: F) -> F:
    """Compile a small function that is only ever inlined into kernels."""
    if _UNCOMPILED:
        return function
    return cast(F, _Compiled(function, {"fastmath": set(_FUSE), "forceinline": True}))


def inlined(function: F) -> F:
    """Compile a small function as if its lines stood in the kernel: the same bits as if they did.

    A `helper` is inlined later, when products and sums are chosen that are rounded once.
    """
    if _UNCOMPILED:
        return function
    return cast(F, _Compiled(function, {"fastmath": set(_FUSE), "inline": "always"}))
