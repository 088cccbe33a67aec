"""Kernels as machine code that is loaded and called without Numba.

Numba needs 0.6 s of a process for itself, a kernel that stands in the folder of compiled kernels
a millisecond: its object code is handed to LLVM's linker (llvmlite) and called by ctypes. Numba
is imported where a kernel has to be compiled (`_entry_points`), and only then.

An entry point takes each array as Python's object and reads data, shape and strides from NumPy's
`PyArrayObject`, whose layout is part of NumPy's binary interface; it compares type, dimensions and
layout with those that the kernel was compiled for, and returns `MISMATCH` where they differ. What
is assumed of the machine is tried once in a process (`available`); where it does not hold, kernels
are called through Numba.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import sys
from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import numpy as np

__all__ = ["GENERIC", "MISMATCH", "available", "bind", "describe", "processor", "runs_generic_code"]

MISMATCH = -1000
"""What an entry point returns for arrays that it was not compiled for."""

_DONE = (0, -2)
"""What a function that Numba compiled returns where all went well: with a value, without one."""

CONTIGUOUS, ALIGNED, WRITEABLE = 0x001, 0x100, 0x400
"""Flags of NumPy."""

GROUPS = {"f8": "f", "i8": "i", "u8": "u", "b1": "b"}
"""Types of arrays, and their kinds."""

LIBRARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2",
    "expm1", "log", "log2", "log10", "log1p", "pow", "sqrt", "cbrt", "hypot", "fmod", "floor",
    "ceil", "trunc", "round", "rint", "nearbyint", "fabs", "copysign", "erf", "erfc", "fma",
    "fmin", "fmax", "memcpy", "memset", "memmove", "sincos",
)  # fmt: skip
"""Functions of C that a kernel may call: all are looked for before one is."""


SCALARS = {"f8": ("double", ctypes.c_double), "i8": ("i64", ctypes.c_int64),
            "b1": ("i8", ctypes.c_bool)}  # fmt: skip
"""Types of scalars that a kernel takes: LLVM's and C's."""
BACK = {"float64": ctypes.c_double, "int64": ctypes.c_int64, "bool": ctypes.c_int8}
"""Types that it gives back."""


GENERIC = "x86-64-v3"
"""The processor that code for a wheel is compiled for."""
_OF_GENERIC = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")


def runs_generic_code() -> bool:
    """Say whether this processor runs code for `GENERIC`."""
    import llvmlite.binding as llvm

    if os.environ.get("NUMBA_CPU_NAME") or os.environ.get("NUMBA_CPU_FEATURES"):
        return False
    has = llvm.get_host_cpu_features()
    return all(has.get(feature, False) for feature in _OF_GENERIC)


def processor() -> str:
    """Return what compiled code depends on: the processor, and what Numba was told of it."""
    import llvmlite
    import llvmlite.binding as llvm

    told = [os.environ.get(f"NUMBA_{name}", "") for name in ("CPU_NAME", "CPU_FEATURES", "OPT")]
    host = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return "/".join([llvmlite.__version__, platform.machine(), *host, *told])


@cache
def available() -> bool:
    """Say whether machine code can be loaded here as this module does it."""
    if not sys.platform.startswith("linux") or platform.machine() != "x86_64":
        return False
    import llvmlite.binding as llvm

    if llvm.llvm_version_info < (16,) or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    probe = np.zeros((3, 2))
    _linker()  # with it LLVM looks for functions of C in this process
    try:
        interface = probe.__array_interface__
        at = id(probe)
        header = (ctypes.c_uint64 * 8).from_address(at)
        kind = bytes((ctypes.c_char * 3).from_address(header[7] + 24))
        return (
            header[1] == id(np.ndarray)
            and header[2] == interface["data"][0]
            and header[3] & 0xFFFFFFFF == 2
            and list((ctypes.c_int64 * 2).from_address(header[4])) == [3, 2]
            and list((ctypes.c_int64 * 2).from_address(header[5])) == [16, 8]
            and header[7] == id(probe.dtype)
            and ctypes.c_uint32.from_address(at + 64).value == probe.flags.num
            and kind == b"fd="
            and all(llvm.address_of_symbol(name) for name in LIBRARY)
        )
    except (AttributeError, KeyError, ValueError):
        return False


def describe(args: tuple[Any, ...]) -> tuple[str, ...] | None:
    """Return the types of arguments by words, or None where one is not of these.

    A word is "f8", "f8:2" for a matrix, or "f8:2A" for one whose rows do not follow each other.
    """
    words = []
    for arg in args:
        kind = type(arg)
        if kind is np.ndarray:
            word = arg.dtype.str[1:]
            flags = arg.flags.num
            if word not in GROUPS or not (arg.ndim and arg.dtype.isnative and flags & ALIGNED):
                return None
            words.append(f"{word}:{arg.ndim}{'' if flags & CONTIGUOUS else 'A'}")
        elif kind is float or kind is np.float64:
            words.append("f8")
        elif kind is bool or kind is np.bool_:
            words.append("b1")
        elif kind is int or kind is np.int64:
            if not -(2**63) <= int(arg) < 2**63:
                return None
            words.append("i8")
        elif arg is None:
            words.append("none")
        else:
            return None
    return tuple(words)


def machine() -> Any:
    """Return LLVM's description of this processor, with the settings that Numba has."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    host = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=os.environ.get("NUMBA_CPU_NAME") or host[0],
        features=host[1] if (told := os.environ.get("NUMBA_CPU_FEATURES")) is None else told,
        opt=int(os.environ.get("NUMBA_OPT", "3")), reloc="static", codemodel="jitdefault", jit=True,
    )  # fmt: skip


_linkers: list[Any] = []
"""The one linker, which owns the code of all kernels."""

_linker_lock = Lock()


def _linker() -> Any:
    """Return the linker; of several threads that ask for it first, one makes it.

    A second one that was dropped would take the code that it holds away from under its callers.
    """
    import llvmlite.binding as llvm

    with _linker_lock:
        if not _linkers:
            _linkers.append(llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine()))
    return _linkers[0]


def bind(header: bytes, code: bytes) -> Callable[..., Any]:
    """Return a function that calls object code; it gives `NotImplemented` for other arrays.

    Parameters
    ----------
    header, code : bytes
        As `_entry_points.compile_entry` gives them.
    """
    import llvmlite.binding as llvm

    facts = json.loads(header)
    linker = _linker()
    linker.add_object_file(llvm.ObjectFileRef.from_data(code))
    linker.finalize_object()
    address = linker.get_function_address(facts["entry"])
    arguments: list[Any] = [
        ctypes.py_object if ":" in word or word == "none" else SCALARS[word][1]
        for word in facts["words"]
    ]
    enter = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, *arguments)(address)
    returned = facts["returned"]
    if not returned:
        # A kernel that returns nothing writes an empty pointer.
        nothing = ctypes.addressof(_keep(ctypes.c_void_p()))

        def call(*args: Any) -> Any:
            status = enter(nothing, *args)
            if status == MISMATCH:
                return NotImplemented
            if status not in _DONE:
                raise RuntimeError(f"{facts['entry']} ended with status {status}")
            return None

        return call
    parts = [returned] if isinstance(returned, str) else returned
    result = type("Result", (ctypes.Structure,), {
        "_fields_": [(f"part{k}", BACK[part]) for k, part in enumerate(parts)],
    })  # fmt: skip
    truths = [part == "bool" for part in parts]
    names = [f"part{k}" for k in range(len(parts))]

    def call_back(*args: Any) -> Any:
        """Call the code and return what it gives."""
        out = result()
        status = enter(ctypes.addressof(out), *args)
        if status == MISMATCH:
            return NotImplemented
        if status not in _DONE:
            raise RuntimeError(f"{facts['entry']} ended with status {status}")
        values = tuple(
            bool(getattr(out, name)) if truth else getattr(out, name)
            for name, truth in zip(names, truths, strict=True)
        )
        return values[0] if isinstance(returned, str) else values

    return call_back


_kept: list[Any] = []


def _keep(value: Any) -> Any:
    _kept.append(value)
    return value
