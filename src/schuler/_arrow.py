"""Numbers out of Arrow's columns and into them without pandas, which its conversions import."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["column_of", "numbers"]


def _bits(buffer: Any, offset: int, count: int) -> NDArray[np.bool_]:
    packed = np.frombuffer(buffer, np.uint8)
    return np.unpackbits(packed, bitorder="little")[offset : offset + count].astype(bool)


def _chunk(array: Any) -> NDArray[Any]:
    import pyarrow as pa

    n, offset = len(array), array.offset
    validity, data = array.buffers()
    if n == 0 or data is None:
        return np.full(n, np.nan)
    if pa.types.is_boolean(array.type):
        values: NDArray[Any] = _bits(data, offset, n)
    else:
        # Old versions of Arrow import pandas to say which type of NumPy it is.
        kind = "f" if pa.types.is_floating(array.type) else "iu"[str(array.type).startswith("u")]
        dtype = np.dtype(f"{kind}{array.type.bit_width // 8}")
        values = np.frombuffer(data, dtype, count=offset + n)[offset:]
    if validity is None or not array.null_count:
        return values
    out = values.astype(np.float64)
    out[~_bits(validity, offset, n)] = np.nan
    return out


def numbers(column: Any) -> NDArray[Any]:
    """Return a column of integers, floating-point numbers or booleans; empty cells are NaN.

    Parameters
    ----------
    column : pyarrow.Array or pyarrow.ChunkedArray

    Raises
    ------
    TypeError
        For a column of another type.
    """
    import pyarrow as pa

    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        raise TypeError(f"a column of {kind} holds no numbers")
    if isinstance(column, pa.Array):
        return _chunk(column)
    parts = [_chunk(each) for each in column.chunks]
    if not parts:
        return np.zeros(0)
    return np.concatenate(parts) if len(parts) != 1 else parts[0]


def column_of(values: ArrayLike) -> Any:
    """Return a column of floating-point numbers, a pyarrow.Array."""
    import pyarrow as pa

    array = np.ascontiguousarray(values, np.float64)
    return pa.Array.from_buffers(pa.float64(), len(array), [None, pa.py_buffer(array)])
