"""How much compressed data can expand to, told from their block headers, without expanding them."""

from __future__ import annotations

import bz2
from typing import IO

__all__ = ["expansion"]

_ZSTD, _ZSTD_SKIPPED = 0xFD2FB528, range(0x184D2A50, 0x184D2A60)
#: no block of zstd gives more
_ZSTD_BLOCK = 128 << 10
_LZ4 = 0x184D2204
_LZ4_BLOCKS = {4: 64 << 10, 5: 256 << 10, 6: 1 << 20, 7: 4 << 20}
_PIECE = 1 << 20


def expansion(file: IO[bytes], begin: int, size: int, codec: str, most: int) -> int:
    """Return a bound of what some bytes of a file expand to.

    Parameters
    ----------
    file : file
    begin, size : int
        Where the compressed bytes are.
    codec : {"zstd", "lz4", "bz2"}
    most : int
        Counting ends beyond so many bytes.
    """
    count = {"zstd": _zstd, "lz4": _lz4, "bz2": _bz2}[codec]
    return count(_Bytes(file, begin, begin + size), most)


class _Bytes:
    """Little-endian numbers from a part of a file; zeros beyond its end."""

    def __init__(self, file: IO[bytes], at: int, end: int) -> None:
        self.file, self.at, self.end = file, at, end

    def number(self, width: int) -> int:
        self.file.seek(self.at)
        data = self.file.read(max(0, min(width, self.end - self.at)))
        self.at += width
        return int.from_bytes(data, "little")

    @property
    def left(self) -> bool:
        return self.at < self.end


def _zstd(data: _Bytes, most: int) -> int:
    """Follow RFC 8878: frames of blocks, each with three bytes of header."""
    total = 0
    while data.left and total <= most:
        magic = data.number(4)
        if magic in _ZSTD_SKIPPED:
            data.at += data.number(4)
            continue
        if magic != _ZSTD:
            return total
        flags = data.number(1)
        single = flags >> 5 & 1
        data.at += (1 - single) + (0, 1, 2, 4)[flags & 3] + (single, 2, 4, 8)[flags >> 6]
        last = 0
        while not last and data.left and total <= most:
            head = data.number(3)
            last, kind, size = head & 1, head >> 1 & 3, head >> 3
            # Raw and repeated blocks say what they give.
            total += min(size, _ZSTD_BLOCK) if kind < 2 else _ZSTD_BLOCK
            data.at += 1 if kind == 1 else size
        data.at += 4 * (flags >> 2 & 1)
    return total


def _lz4(data: _Bytes, most: int) -> int:
    """Follow the LZ4 frame format: blocks of at most the size that the frame names."""
    total = 0
    while data.left and total <= most:
        magic = data.number(4)
        if magic in _ZSTD_SKIPPED:
            data.at += data.number(4)
            continue
        if magic != _LZ4:
            return total
        flags = data.number(1)
        block = _LZ4_BLOCKS.get(data.number(1) >> 4 & 7, max(_LZ4_BLOCKS.values()))
        data.at += 8 * (flags >> 3 & 1) + 4 * (flags & 1) + 1
        while data.left and total <= most:
            head = data.number(4)
            if not head:
                break
            size = head & 0x7FFFFFFF
            total += size if head >> 31 else block
            data.at += size + 4 * (flags >> 4 & 1)
        data.at += 4 * (flags >> 2 & 1)
    return total


def _bz2(data: _Bytes, most: int) -> int:
    """Expand piece by piece and keep nothing: its blocks have no sizes."""
    total = 0
    data.file.seek(data.at)
    rest = data.file.read(max(0, data.end - data.at))
    while rest and total <= most:
        engine = bz2.BZ2Decompressor()
        try:
            piece = engine.decompress(rest, _PIECE)
            while total <= most and (piece or not engine.needs_input) and not engine.eof:
                total += len(piece)
                piece = engine.decompress(b"", _PIECE)
        except OSError:
            return total
        total += len(piece)
        if not engine.eof:
            return total
        rest = engine.unused_data
    return total
