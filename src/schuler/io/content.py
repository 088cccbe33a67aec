"""What a reader hands over: blocks of rows in the file's units, and what the file says of itself.

Protocol of a reader
--------------------
A reader is an object with

``name`` : str
    What the format is called.
``suffixes`` : tuple of str
    File name endings, lower case with the dot.
``sniff(head)`` : bool
    Whether a file that begins with these bytes (64 KB, or less) is of this format. A format
    without marks returns False and is chosen by suffix alone.
``open(path, mapping)`` : Content, or an iterable of ``(time, values)``
    Check the file and say what is in it. ``time`` is (n,) float64 in the mapping's time unit, or
    None where the clock comes from the rate; ``values`` is (n, 6) float64, or six arrays of n:
    gyro x, y, z, accelerometer x, y, z in the file's own units and axes. Errors are `InputError`
    without the file's name, which is put before them.

A package adds a reader by an entry point of the group ``schuler.readers`` that names such an
object or a class that makes one without arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from schuler.io.mapping import Mapping

__all__ = ["BLOCK_ROWS", "Array", "Block", "Content", "Reader", "wrapped"]

Array = NDArray[np.float64]

#: time, the six values (as columns, or as an (n, 6) array) and, where the file has them, dt
Block = tuple[Array | None, Sequence[Array] | Array, Array | None]

#: rows in a block of the readers that count in rows
BLOCK_ROWS = 131_072


@dataclass
class Content:
    """An opened file.

    Parameters
    ----------
    blocks : callable
        Gives an iterator over the blocks of rows from the beginning.
    said : Mapping
        Units, axes, rate and flags that the file states itself.
    time_label : str
        What messages call the time column, ``"column 't'"``.
    factors : (6,) float64, optional
        Factors to SI that a header gives more exactly than a unit can say.
    units_label : str, optional
        What messages call those.
    name : str, optional
        The record's name, where the file holds one.
    rows : int, optional
        How many rows there are, where that is known without reading them.
    position : (lat, lon, height), optional
        Degrees, degrees, m.
    notes : list of str
        What a user should know; readers may add to it while reading.
    progress : callable, optional
        Fraction of the file that has been read.
    complete : bool
        The file was written by schuler and says everything itself, so that nothing said about it
        can be right.
    follow : callable, optional
        Iterator over blocks as the file grows; an empty time array is "nothing new".
    mark : (str, str), optional
        The axes that the columns' names are a mark of, and whose names they are.
    fixed : bool
        The format fixes what the numbers are, as that of ROS does: no other unit can be meant.
    stamps : (k,) float64, optional
        The first stamps, by which their unit is found where it is not given.
    sample : sequence of (k,) float64, optional
        The values of the first rows, by which rows are known that hold one sensor or the other.
    """

    blocks: Callable[[], Iterator[Block]]
    said: Mapping = field(default_factory=Mapping)
    time_label: str = "the file's time"
    factors: Array | None = None
    units_label: str | None = None
    name: str | None = None
    rows: int | None = None
    position: tuple[float, float, float] | None = None
    notes: list[str] = field(default_factory=list)
    progress: Callable[[], float] | None = None
    complete: bool = False
    follow: Callable[[], Iterator[Block | None]] | None = None
    mark: tuple[str, str] | None = None
    fixed: bool = False
    stamps: Array | None = None
    sample: Sequence[Array] | None = None


@runtime_checkable
class Reader(Protocol):
    """What a format's reader is; the module's docstring says it in words.

    Examples
    --------
    >>> isinstance(sc.io.readers()["npz"], Reader)
    True
    """

    name: str
    suffixes: tuple[str, ...]

    def sniff(self, head: bytes) -> bool:
        """Say whether a file that begins with `head` is of this format."""
        ...

    def open(
        self, path: Path, mapping: Mapping
    ) -> Content | Iterable[tuple[Array | None, Sequence[Array] | Array]]:
        """Open the file; see the module's docstring."""
        ...


def wrapped(opened: Any) -> Content:
    """Return what a reader gives as a `Content`: a simple one gives pairs of time and values.

    Examples
    --------
    >>> isinstance(wrapped([(np.arange(3.0), np.zeros((3, 6)))]), Content)
    True
    """
    if isinstance(opened, Content):
        return opened

    def blocks() -> Iterator[Block]:
        for item in opened:
            time, values = item[0], item[1]
            yield time, values, None

    return Content(blocks=blocks)
