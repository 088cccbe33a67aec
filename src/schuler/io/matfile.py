"""What is in a .mat file of version 4 or 5: names and sizes of its arrays of numbers.

Only the tags are read (MathWorks, MAT-File Format). An array whose values do not fill its
dimensions is damage. Structures are named with the bytes that they take in the file; cells, texts
and sparse arrays hold no samples and are left out.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import IO, Any

from schuler.errors import InputError

__all__ = ["structures", "survey"]

_MATRIX, _COMPRESSED = 14, 15
_FLAGS, _DIMENSIONS, _NAME = 6, 5, 1
_STRUCTURE = 2
#: classes of arrays of numbers: double, single and the integers
_NUMBERS = range(6, 16)
_COMPLEX = 0x0800
#: width of a value by its storage type
_WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
#: enough for any array's tags
_LOOK = 4096
_MOST_DIMENSIONS = 32
#: MATLAB has names of 63 characters at most
_LONGEST_NAME = 64

_VERSION_4_WIDTHS = (8, 4, 4, 2, 2, 1)


def structures(path: Path) -> dict[str, int]:
    """Return the bytes of each structure of a file of version 5, by name.

    Raises
    ------
    InputError
        If the file is damaged or truncated.
    """
    with path.open("rb") as file:
        head = file.read(128)
        if 0 in head[:4]:
            return {}
        try:
            return _version_5(file, path.stat().st_size, head, structure=True)
        except (struct.error, zlib.error) as error:
            raise _damaged(str(error)) from None


def survey(path: Path) -> dict[str, int]:
    """Return the bytes in memory of each array of numbers, by name.

    Raises
    ------
    InputError
        If the file is damaged or truncated.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(128)
        try:
            if 0 in head[:4]:
                return _version_4(file, size)
            return _version_5(file, size, head)
        except (struct.error, zlib.error) as error:
            raise _damaged(str(error)) from None


def _version_5(file: IO[bytes], size: int, head: bytes, structure: bool = False) -> dict[str, int]:
    if len(head) < 128:
        raise _damaged(f"{len(head)} bytes")
    order = "<" if head[126:128] == b"IM" else ">"
    found: dict[str, int] = {}
    place = 128
    while place < size:
        file.seek(place)
        kind, count = struct.unpack(f"{order}II", file.read(8))
        place += 8 + count
        if place > size:
            raise _damaged(f"{size} bytes where {place} are announced")
        data = file.read(min(count, _LOOK))
        if kind == _COMPRESSED:
            data = zlib.decompressobj().decompress(data, _LOOK)
            kind, count = struct.unpack_from(f"{order}II", data)
            data = data[8:]
        if kind == _MATRIX:
            _add(found, *_matrix(data, order, count, structure))
    return found


def _matrix(data: bytes, order: str, size: int, structure: bool = False) -> tuple[str, int | None]:
    """Return an array's name, and its bytes in memory; None where it is not of the wanted kind."""
    at, kind, flags = _element(data, 0, order)
    if kind != _FLAGS or len(flags) != 8:
        raise _damaged("an array without flags")
    (word,) = struct.unpack_from(f"{order}I", flags)
    at, kind, dimensions = _element(data, at, order)
    if kind != _DIMENSIONS or not 0 < len(dimensions) // 4 <= _MOST_DIMENSIONS:
        raise _damaged("an array without dimensions")
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    at, kind, name = _element(data, at, order)
    if kind != _NAME or len(name) > _LONGEST_NAME:
        raise _damaged("an array without a name")
    text = name.decode("latin-1")
    if structure:
        # MATLAB packs whole numbers into bytes, which become eight times as many.
        return text, 8 * size if word & 0xFF == _STRUCTURE else None
    if word & 0xFF not in _NUMBERS:
        return text, None
    kind, length, begin = _tag(data, at, order)
    values = math.prod(shape)
    if begin + length > size:
        raise _damaged(f"{size} bytes where {begin + length} are announced")
    if min(shape) < 0 or kind not in _WIDTHS or length != values * _WIDTHS[kind]:
        raise _damaged(f"array of {'x'.join(map(str, shape))} values in {length} bytes")
    return text, (16 if word & _COMPLEX else 8) * values


def _tag(data: bytes, at: int, order: str) -> tuple[int, int, int]:
    """Return an element's type, its length and where its data begin."""
    kind, length = struct.unpack_from(f"{order}II", data, at)
    if kind >> 16:
        return kind & 0xFFFF, kind >> 16, at + 4
    return kind, length, at + 8


def _element(data: bytes, at: int, order: str) -> tuple[int, int, bytes]:
    """Return where the next element begins, and this one's type and data."""
    kind, length, begin = _tag(data, at, order)
    if length > len(data) - begin:
        raise _damaged("an array's tags are cut off")
    small = begin == at + 4
    after = at + 8 if small else begin + (length + 7) // 8 * 8
    return after, kind, data[begin : begin + length]


def _version_4(file: IO[bytes], size: int) -> dict[str, int]:
    found: dict[str, int] = {}
    place = 0
    while place < size:
        file.seek(place)
        head = file.read(20)
        # Types are below 5000: as little-endian their upper two bytes are zero.
        order = "<" if head[2:4] == b"\0\0" else ">"
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head)
        machine, rest = divmod(kind, 1000)
        width, matrix = rest // 10 % 10, rest % 10
        sound = 0 <= machine <= 4 and rest < 100 and width < len(_VERSION_4_WIDTHS)
        if not sound or min(rows, columns) < 0 or not 0 < length <= _LONGEST_NAME:
            raise _damaged(f"no array at byte {place}")
        name = file.read(length).rstrip(b"\0").decode("latin-1")
        parts = 2 if imaginary else 1
        place += 20 + length + parts * rows * columns * _VERSION_4_WIDTHS[width]
        if place > size:
            raise _damaged(f"{size} bytes where {place} are announced")
        _add(found, name, 8 * parts * rows * columns if matrix == 0 else None)
    return found


def _add(found: dict[str, Any], name: str, size: int | None) -> None:
    if name in found:
        raise _damaged(f"two arrays are named '{name}'")
    if size is not None:
        found[name] = size


def _damaged(reason: str) -> InputError:
    return InputError(f"is a damaged or truncated .mat file ({reason})")
