"""Structures in Thrift's compact protocol, in which Parquet's footers and page headers are."""

from __future__ import annotations

from typing import Any

__all__ = ["structure"]

_DEEPEST = 12
_BYTE, _NUMBERS, _DOUBLE, _BINARY, _LISTS, _STRUCT = 3, (4, 5, 6), 7, 8, (9, 10), 12
_TRUTHS = (1, 2)


def structure(data: bytes, at: int = 0, depth: int = 0) -> tuple[dict[int, Any], int]:
    """Return a structure's fields by number, and where it ends.

    Numbers, texts (bytes), lists and structures are kept; other values are passed over.

    Raises
    ------
    ValueError, IndexError
        If it is none.
    """
    found: dict[int, Any] = {}
    field = 0
    while True:
        mark = data[at]
        at += 1
        if not mark:
            return found, at
        kind = mark & 15
        if mark >> 4:
            field += mark >> 4
        else:
            field, at = _signed(data, at)
        # A field's truth value is its type.
        if kind not in _TRUTHS:
            found[field], at = _value(data, at, kind, depth)


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if depth > _DEEPEST:
        raise ValueError("values inside each other")
    if kind in _NUMBERS:
        return _signed(data, at)
    if kind == _STRUCT:
        return structure(data, at, depth + 1)
    if kind in _LISTS:
        return _list(data, at, depth)
    if kind == _BINARY:
        length, at = _unsigned(data, at)
    elif kind in (_BYTE, _DOUBLE):
        length = 1 if kind == _BYTE else 8
    else:
        raise ValueError(f"type {kind}")
    if at + length > len(data):
        raise ValueError("beyond the end")
    return (data[at : at + length] if kind == _BINARY else None), at + length


def _list(data: bytes, at: int, depth: int) -> tuple[list[Any], int]:
    mark = data[at]
    at += 1
    count = mark >> 4
    if count == 15:
        count, at = _unsigned(data, at)
    if count > len(data) - at:
        # Nothing takes less than a byte.
        raise ValueError("a list beyond the end")
    kind = _BYTE if mark & 15 in _TRUTHS else mark & 15
    found = []
    for _ in range(count):
        value, at = _value(data, at, kind, depth + 1)
        found.append(value)
    return found, at


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number of more than 64 bits")


def _signed(data: bytes, at: int) -> tuple[int, int]:
    value, at = _unsigned(data, at)
    return (value >> 1) ^ -(value & 1), at
