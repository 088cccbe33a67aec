"""PSINS .imu: a ``%`` comment, three header rows of six numbers, then counts an interval.

Row 1: pitch, roll, yaw (deg), velocity (m/s). Row 2: latitude, longitude (deg), height (m), t0 (s),
interval (ms), g (m/s^2). Row 3: size of a gyro count (arcsec) and of an accelerometer count (ug*s)
for each axis, where ug is a millionth of row 2's g. Axes are right, forward, up.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.constants import ARCSEC
from schuler.errors import InputError
from schuler.io.columns import choose
from schuler.io.content import Content
from schuler.io.dialect import Dialect
from schuler.io.mapping import ROLES, Mapping
from schuler.io.text import TextTable, arrange

__all__ = ["PsinsReader"]

_HEAD = 1 << 16
_ROWS = ("attitude and velocity", "position, t0, interval and g", "sizes of the counts")


class PsinsReader:
    """Reader of PSINS .imu text files."""

    name = "psins"
    suffixes: tuple[str, ...] = (".imu",)

    def sniff(self, head: bytes) -> bool:
        """Say whether the file begins with a ``%`` comment that names PSINS."""
        first = head.lstrip(b"\xef\xbb\xbf\r\n\t ")
        return first.startswith(b"%") and b"PSINS" in first[:4096].upper()

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Read the header."""
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if not head.lstrip(b"\xef\xbb\xbf\r\n\t ").startswith(b"%"):
            raise InputError(
                "has no PSINS header (a comment of lines that begin with %); if it is a plain "
                "table, name it .txt"
            )
        rows, offset, line = _header(head)
        lat, lon, height, t0, interval, g = rows[1]
        if not (abs(lat) <= 90 and -180 <= lon <= 360):
            raise InputError(f"PSINS header row 2: {lat:g}, {lon:g} is no position in degrees")
        if not interval > 0:
            raise InputError(f"PSINS header row 2: the interval is {interval:g} ms, not positive")
        if not 9 < g < 10:
            raise InputError(f"PSINS header row 2: g is {g:g} m/s^2, expected about 9.8")
        if not all(rows[2]):
            raise InputError("PSINS header row 3: the size of a count is zero")
        factors = np.array(rows[2]) * np.repeat([ARCSEC, 1e-6 * g], 3)
        said = Mapping(
            gyro=f"{rows[2][0]:.12g} arcsec",
            accel=f"{rows[2][3]:.12g} ug*s",
            rate=1e3 / interval,
            start_time=t0,
            axes="RFU",
        )
        dialect = Dialect(" ", (b"%",), ".", False, ROLES[1:], 6, offset, line)
        chosen = choose(ROLES[1:], 6, replace(mapping, rate=mapping.rate or said.rate))
        table = TextTable(path, dialect, chosen.all)
        return Content(
            blocks=lambda: arrange(table.blocks(), chosen),
            said=said,
            fixed=True,
            factors=factors,
            units_label=(
                f"counts of {'/'.join(_short(rows[2][:3]))} arcsec and "
                f"{'/'.join(_short(rows[2][3:]))} ug*s (g = {g:.9g} m/s^2)"
            ),
            position=(lat, lon, height),
            notes=table.notes,
            progress=table.progress,
        )


def _short(sizes: list[float]) -> list[str]:
    texts = [f"{size:.9g}" for size in sizes]
    return texts[:1] if len(set(texts)) == 1 else texts


def _header(head: bytes) -> tuple[list[list[float]], int, int]:
    """Return the three rows, and the byte and line at which the counts begin."""
    rows: list[list[float]] = []
    offset = number = 0
    while len(rows) < 3:
        end = head.find(b"\n", offset)
        if end < 0:
            raise InputError(
                f"the PSINS header has {len(rows)} of its 3 rows of numbers "
                f"(missing: {_ROWS[len(rows)]})"
            )
        number += 1
        text = head[offset:end].decode("utf-8", errors="replace").strip("\ufeff \t\r")
        offset = end + 1
        if not text or text.startswith("%"):
            continue
        try:
            row = [float(cell) for cell in text.split()]
        except ValueError:
            row = []
        if len(row) != 6 or not np.all(np.isfinite(row)):
            raise InputError(
                f"line {number}: PSINS header row {len(rows) + 1} ({_ROWS[len(rows)]}) must be "
                f"six numbers, got '{text[:60]}'"
            )
        rows.append(row)
    if not head[offset:].strip():
        raise InputError("has a PSINS header but no data rows")
    return rows, offset, number + 1
