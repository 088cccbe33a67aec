"""KF-GINS: rows of seconds of week, three angle and three velocity increments, and no header.

rad and m/s over the interval that ends at the row, in front-right-down axes; plain text, or the
same as little-endian float64 (i2Nav group of Wuhan University, KF-GINS, README 2.2). Further
columns, as an odometer's speed, are passed over. The files carry no mark, and a table of rates
looks alike, so this reader is used only where it is named: ``format="kf-gins"``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.errors import InputError
from schuler.io.binary import BinaryReader
from schuler.io.content import Content
from schuler.io.mapping import ROLES, Mapping
from schuler.io.text import TextReader

__all__ = ["KfGinsReader"]

_HEAD = 1 << 16
_WIDTHS = (7, 8)
_LOOK = 64
_PRINTED = bytes(range(32, 127)) + b"\t\r\n"


class KfGinsReader:
    """Reader of KF-GINS and OB-GINS IMU files, text or binary."""

    name = "kf-gins"
    suffixes: tuple[str, ...] = ()

    def sniff(self, head: bytes) -> bool:
        """Never: increments and rates look alike."""
        return False

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Say what the columns are, and let the readers of text or of numbers open the file."""
        if path == Path("-"):
            head = b""
        else:
            with path.open("rb") as file:
                head = file.read(_HEAD)
        columns = mapping.columns
        if head.translate(None, _PRINTED):
            width = _width(path, head) if columns is None else 0
            columns = columns or (*ROLES, *("_" for _ in range(width - len(ROLES))))
            content = BinaryReader().open(path, replace(mapping, columns=columns))
        else:
            content = TextReader().open(path, replace(mapping, columns=columns or ROLES))
        content.said = Mapping(gyro="rad", accel="m/s", time="s", axes="FRD").merged(content.said)
        content.time_label = "the seconds of the week"
        return content


def _width(path: Path, head: bytes) -> int:
    """Return how many columns a row has: those with which the first one runs forward."""
    size = path.stat().st_size
    fits = []
    for width in _WIDTHS:
        rows = min(len(head) // (8 * width), _LOOK)
        time = np.frombuffer(head, "<f8", rows * width)[::width]
        forward = bool(np.all(np.isfinite(time))) and bool(np.all(np.diff(time) > 0))
        if size % (8 * width) == 0 and rows and forward:
            fits.append(width)
    if len(fits) != 1:
        raise InputError(
            f"is truncated, or not a KF-GINS file of 7 or 8 float64 columns whose first is time: "
            f"{size} bytes; name every column with --columns, as t,gx,gy,gz,ax,ay,az,_"
        )
    return fits[0]
