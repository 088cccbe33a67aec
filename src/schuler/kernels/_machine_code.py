"""Kernels as machine code that is loaded and called without Numba.

Numba needs 0.6 s of a process for itself, a kernel that stands in the folder of compiled kernels
a millisecond: its object code is handed to LLVM's linker (llvmlite) and called by ctypes. Numba
is imported where a kernel has to be compiled, and only then.

An entry point takes each array as Python's object and reads data, shape and strides from NumPy's
`PyArrayObject`, whose layout is part of NumPy's binary interface; it compares type, dimensions and
layout with those that the kernel was compiled for, and answers `MISMATCH` where they differ. What
is assumed of the machine is tried once in a process (`available`); where it does not hold, kernels
are called through Numba.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import platform
import re
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

__all__ = [
    "GENERIC",
    "MISMATCH",
    "available",
    "bind",
    "compile_entry",
    "describe",
    "numba_types",
    "processor",
    "runs_generic_code",
]

MISMATCH = -1000
"""What an entry point answers to arrays that it was not compiled for."""

_DONE = (0, -2)
"""What a function that Numba compiled returns where all went well: with a value, without one."""

_CONTIGUOUS, _ALIGNED, _WRITEABLE = 0x001, 0x100, 0x400
"""Flags of NumPy."""

_GROUPS = {"f8": "f", "i8": "i", "u8": "u", "b1": "b"}
"""Types of arrays, and their kinds."""

_LIBRARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2",
    "expm1", "log", "log2", "log10", "log1p", "pow", "sqrt", "cbrt", "hypot", "fmod", "floor",
    "ceil", "trunc", "round", "rint", "nearbyint", "fabs", "copysign", "erf", "erfc", "fma",
    "fmin", "fmax", "memcpy", "memset", "memmove", "sincos",
)  # fmt: skip
"""Functions of C that a kernel may call: all are looked for before one is."""

_INTRINSIC = re.compile(r"llvm\.(?!powi)[a-z]")

_SCALARS = {"f8": ("double", ctypes.c_double), "i8": ("i64", ctypes.c_int64),
            "b1": ("i8", ctypes.c_bool)}  # fmt: skip
_BACK = {"float64": ctypes.c_double, "int64": ctypes.c_int64, "bool": ctypes.c_int8}


GENERIC = "x86-64-v3"
"""The processor that code for a wheel is compiled for, and what it has."""
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
            and all(llvm.address_of_symbol(name) for name in _LIBRARY)
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
            if word not in _GROUPS or not (arg.ndim and arg.dtype.isnative and flags & _ALIGNED):
                return None
            words.append(f"{word}:{arg.ndim}{'' if flags & _CONTIGUOUS else 'A'}")
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


def numba_types(words: tuple[str, ...]) -> tuple[Any, ...]:
    """Return Numba's types for words of `describe`."""
    return tuple(_numba_type(word) for word in words)


def _numba_type(word: str) -> Any:
    from numba import types

    if word == "none":
        return types.none
    kind, _, dimensions = word.partition(":")
    scalar = {"f8": types.float64, "i8": types.int64, "u8": types.uint64, "b1": types.boolean}[kind]
    if not dimensions:
        return scalar
    return types.Array(scalar, int(dimensions[0]), "A" if dimensions.endswith("A") else "C")


def compile_entry(dispatcher: Any, words: tuple[str, ...], name: str) -> tuple[bytes, bytes] | None:
    """Compile a kernel for types of arguments; return its description and its object code.

    None stands for a kernel that needs more of Numba than its code: one that allocates, raises
    or returns an array.

    Parameters
    ----------
    dispatcher : Numba's dispatcher
        Without wrappers for Python.
    words : tuple of str
        As `describe` gives them.
    name : str
        Of the entry point, the only one of this name in a process.
    """
    import llvmlite.binding as llvm

    given = numba_types(words)
    collecting = gc.isenabled()
    gc.disable()  # a tenth of the time goes into looking for what is not there
    try:
        dispatcher.compile(given)
    finally:
        if collecting:
            gc.enable()
    signature = next(each for each in dispatcher.nopython_signatures if each.args == given)
    returned = _returned(signature.return_type)
    if returned is None:
        return None
    text = dispatcher.inspect_llvm(given)
    native = _native_name(text)
    kept = None if native is None else _reachable(text, native)
    if native is None or kept is None:
        return None
    found = llvm.parse_assembly(text).get_function(native)
    arguments = [(str(each.type), list(each.attributes)) for each in found.arguments]
    entry = _entry(name, native, words, arguments)
    if entry is None:
        return None
    module = llvm.parse_assembly(f"{kept}\n{entry}")
    module.verify()
    header = json.dumps({"entry": name, "words": words, "returned": returned})
    return header.encode(), bytes(_machine().emit_object(module))


def _returned(kind: Any) -> list[str] | str | None:
    """Return the types of what a kernel gives back: [] for nothing, None for another type."""
    from numba import types

    if kind == types.none:
        return []
    if isinstance(kind, types.BaseTuple):
        each = [str(part) for part in kind.types]
        return each if each and all(part in _BACK for part in each) else None
    return str(kind) if str(kind) in _BACK else None


def _pieces(text: str) -> tuple[list[str], dict[str, str]]:
    """Cut a module's text into its head and what it defines or declares, by name."""
    head, named = [], {}
    name = None
    for line in text.splitlines(keepends=True):
        if name is not None:
            named[name] += line
            if line.startswith("}"):
                name = None
            continue
        if line.startswith(("define ", "declare ", "@")):
            found = re.search(r'@("[^"]+"|[\w.$-]+)', line)
            assert found is not None
            named[found[1]] = line
            name = found[1] if line.startswith("define ") else None
        else:
            head.append(line)
    return head, named


def _native_name(text: str) -> str | None:
    """Return the name of the one function that others may call."""
    names = [
        re.search(r'@("[^"]+"|[\w.$-]+)\(', line)
        for line in text.splitlines()
        if line.startswith("define ") and not re.match(r"define (linkonce|internal|private)", line)
    ]
    if len(names) != 1 or names[0] is None:
        return None
    return names[0][1].strip('"')


def _reachable(text: str, native: str) -> str | None:
    """Return the part of a module that a function needs, or None if that needs Numba's runtime."""
    head, named = _pieces(text)
    wanted, kept = [native], {}
    while wanted:
        name = wanted.pop()
        piece = named.get(name, named.get(f'"{name}"'))
        if name in kept or piece is None:
            continue
        if name in ("NRT_incref", "NRT_decref"):
            # They count who holds memory of Numba's; there is none.
            kept[name] = f"define internal void @{name}(ptr %memory) {{\n  ret void\n}}\n"
            continue
        if piece.startswith("declare ") and not _INTRINSIC.match(name) and name not in _LIBRARY:
            return None
        kept[name] = re.sub(
            r"^(define|@[^=]+=) ?(linkonce_odr |common |weak_odr )?",
            lambda found: f"{found[1]} internal " if found[1] == "define" or found[2] else found[0],
            piece,
        )
        body = piece if not piece.startswith("define ") else piece[piece.index("{") :]
        if "pickledata" in body:
            return None
        wanted += [found.strip('"') for found in re.findall(r'@("[^"]+"|[\w.$-]+)', body)]
    return "".join([*head, *kept.values()])


def _entry(
    name: str, native: str, words: tuple[str, ...], arguments: list[tuple[str, list[bytes]]]
) -> str | None:
    """Return the entry point's text, or None where the function takes other arguments."""
    taken = ["ptr %out"]
    lines = []
    passed: list[tuple[str, str]] = [("ptr", "%out"), ("ptr", "%info")]
    good = "true"
    for k, word in enumerate(words):
        kind, _, dimensions = word.partition(":")
        if word == "none":
            taken.append(f"ptr %a{k}")
            passed.append(("ptr", "null"))
        elif not dimensions:
            taken.append(f"{_SCALARS[kind][0]}{' zeroext' if kind == 'b1' else ''} %a{k}")
            passed.append((_SCALARS[kind][0], f"%a{k}"))
        else:
            taken.append(f"ptr %a{k}")
            n = int(dimensions[0])
            data_at = len(passed) + 4
            if data_at >= len(arguments):
                return None
            attributes = arguments[data_at][1]
            untouched = any(b"readonly" in each or b"readnone" in each for each in attributes)
            flags = _ALIGNED if dimensions.endswith("A") else _ALIGNED | _CONTIGUOUS
            flags |= 0 if untouched else _WRITEABLE
            checks, fields = _array(f"a{k}", kind, n, flags, good)
            good = f"%a{k}.good"
            lines += checks
            passed += fields
    if [each for each, _ in passed] != [each for each, _ in arguments]:
        return None
    loads = [line for line in lines if line.startswith("*")]
    checks = [line for line in lines if not line.startswith("*")]
    call = ", ".join(f"{kind} {value}" for kind, value in passed)
    return "\n".join([
        f"define i32 @{name}({', '.join(taken)}) {{", "start:", "  %info = alloca ptr",
        *checks, f"  br i1 {good}, label %work, label %refuse", "work:",
        *(f"  {line[1:]}" for line in loads),
        f'  %status = call i32 @"{native}"({call})', "  ret i32 %status", "refuse:",
        f"  ret i32 {MISMATCH}", "}",
    ])  # fmt: skip


def _array(
    a: str, kind: str, dimensions: int, flags: int, good: str
) -> tuple[list[str], list[tuple[str, str]]]:
    """Return lines that check and read an array, and what is passed of it.

    Lines with a star read what stands behind the checks.
    """
    order = "|" if kind == "b1" else "="
    letters = (_GROUPS[kind] + np.dtype(kind).char + order).encode()
    lines = []

    def field(what: str, offset: int, type_: str, of: str = f"%{a}") -> None:
        lines.append(f"  %{a}.{what}.at = getelementptr i8, ptr {of}, i64 {offset}")
        lines.append(f"  %{a}.{what} = load {type_}, ptr %{a}.{what}.at")

    field("descr", 56, "ptr")
    field("letters", 24, "i32", f"%{a}.descr")
    field("count", 24, "i32")
    field("flags", 64, "i32")
    lines += [
        f"  %{a}.three = and i32 %{a}.letters, 16777215",
        f"  %{a}.kindly = icmp eq i32 %{a}.three, {int.from_bytes(letters, 'little')}",
        f"  %{a}.sized = icmp eq i32 %{a}.count, {dimensions}",
        f"  %{a}.flagged = and i32 %{a}.flags, {flags}",
        f"  %{a}.flat = icmp eq i32 %{a}.flagged, {flags}",
        f"  %{a}.both = and i1 %{a}.kindly, %{a}.sized",
        f"  %{a}.all = and i1 %{a}.both, %{a}.flat",
        f"  %{a}.good = and i1 %{a}.all, {good}",
    ]
    first = len(lines)
    field("data", 16, "ptr")
    field("shape", 32, "ptr")
    field("strides", 40, "ptr")
    for j in range(dimensions):
        field(f"n{j}", 8 * j, "i64", f"%{a}.shape")
        field(f"s{j}", 8 * j, "i64", f"%{a}.strides")
    items = f"%{a}.n0"
    for j in range(1, dimensions):
        lines.append(f"  %{a}.items{j} = mul i64 {items}, %{a}.n{j}")
        items = f"%{a}.items{j}"
    lines[first:] = ["*" + line.strip() for line in lines[first:]]
    passed = [("ptr", "null"), ("ptr", "null"), ("i64", items),
              ("i64", "1" if kind == "b1" else "8"), ("ptr", f"%{a}.data"),
              *(("i64", f"%{a}.n{j}") for j in range(dimensions)),
              *(("i64", f"%{a}.s{j}") for j in range(dimensions))]  # fmt: skip
    return lines, passed


def _machine() -> Any:
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


@cache
def _linker() -> Any:
    import llvmlite.binding as llvm

    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())


def bind(header: bytes, code: bytes) -> Callable[..., Any]:
    """Return a function that calls object code; it gives `NotImplemented` for other arrays.

    Parameters
    ----------
    header, code : bytes
        As `compile_entry` gives them.
    """
    import llvmlite.binding as llvm

    facts = json.loads(header)
    linker = _linker()
    linker.add_object_file(llvm.ObjectFileRef.from_data(code))
    linker.finalize_object()
    address = linker.get_function_address(facts["entry"])
    arguments: list[Any] = [
        ctypes.py_object if ":" in word or word == "none" else _SCALARS[word][1]
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
        "_fields_": [(f"part{k}", _BACK[part]) for k, part in enumerate(parts)],
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
