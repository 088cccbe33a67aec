"""Compile a kernel to an entry point in machine code that needs Numba no more."""

from __future__ import annotations

import gc
import json
import re
from collections.abc import Container
from typing import Any

import numpy as np

from schuler.kernels._machine_code import (
    ALIGNED,
    BACK,
    CONTIGUOUS,
    GROUPS,
    LIBRARY,
    MISMATCH,
    SCALARS,
    WRITEABLE,
    machine,
)

__all__ = ["compile_entry", "numba_types"]


_INTRINSIC = re.compile(r"llvm\.(?!powi)[a-z]")


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


def compile_entry(
    dispatcher: Any, words: tuple[str, ...], name: str, names: Container[str]
) -> tuple[bytes, bytes] | None:
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
    names : container of str
        Of kernels and helpers (`schuler.kernels._without_engine`).
    """
    import llvmlite.binding as llvm

    from schuler.kernels._without_engine import without_engine

    given = numba_types(words)
    collecting = gc.isenabled()
    gc.disable()  # a tenth of the time goes into looking for what is not there
    try:
        with without_engine(names):
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
    return header.encode(), bytes(machine().emit_object(module))


def _returned(kind: Any) -> list[str] | str | None:
    """Return the types of what a kernel gives back: [] for nothing, None for another type."""
    from numba import types

    if kind == types.none:
        return []
    if isinstance(kind, types.BaseTuple):
        each = [str(part) for part in kind.types]
        return each if each and all(part in BACK for part in each) else None
    return str(kind) if str(kind) in BACK else None


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
        if piece.startswith("declare ") and not _INTRINSIC.match(name) and name not in LIBRARY:
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
            taken.append(f"{SCALARS[kind][0]}{' zeroext' if kind == 'b1' else ''} %a{k}")
            passed.append((SCALARS[kind][0], f"%a{k}"))
        else:
            taken.append(f"ptr %a{k}")
            n = int(dimensions[0])
            data_at = len(passed) + 4
            if data_at >= len(arguments):
                return None
            attributes = arguments[data_at][1]
            untouched = any(b"readonly" in each or b"readnone" in each for each in attributes)
            flags = ALIGNED if dimensions.endswith("A") else ALIGNED | CONTIGUOUS
            flags |= 0 if untouched else WRITEABLE
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
    letters = (GROUPS[kind] + np.dtype(kind).char + order).encode()
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
