"""`GrowingFixes`: a file of GNSS fixes that grows, read anew where it has grown."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.fix_rows import COLUMNS, TIME, rows_of
from schuler.errors import InputError
from schuler.io.aiding import read_gnss
from schuler.io.spool import GZIP

__all__ = ["GrowingFixes"]

Array = NDArray[np.float64]

_HEAD = 4096


class GrowingFixes:
    """Read the fixes that a file has more than at the last look; of a text whole lines only.

    Parameters
    ----------
    path : str or path
    **options
        As of `read_gnss`.

    Raises
    ------
    InputError
        For a file that is compressed or no regular file: neither can be followed.

    Examples
    --------
    >>> growing = GrowingFixes("gnss.csv")
    >>> len(growing.rows()), len(growing.rows())
    (59, 0)
    """

    def __init__(self, path: str | Path, **options: Any) -> None:
        self.path = Path(path)
        self._options = options
        self._size = -1
        self._last = -np.inf
        self.trouble: str | None = None
        if not self.path.is_file():
            raise InputError(f"{self.path}: is no regular file, and cannot be followed")
        with self.path.open("rb") as file:
            if file.read(2) == GZIP:
                raise InputError(f"{self.path}: is compressed, and cannot be followed")

    def rows(self) -> Array:
        """Return the fixes after the last one that was returned, as `schuler.aiding.fix_rows`.

        What cannot be read yet, as a header alone, is none so far; `trouble` says it.

        Raises
        ------
        InputError
            If the file has become shorter, or is gone.
        """
        none = np.zeros((0, COLUMNS))
        try:
            size = self.path.stat().st_size
            if size == self._size:
                return none
            if size < self._size:
                raise InputError(f"{self.path}: has become shorter while it was followed")
            data = self.path.read_bytes()
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror or error})") from None
        self._size = size
        if b"\0" not in data[:_HEAD]:
            # The last line may be half written.
            data = data[: data.rfind(b"\n") + 1]
        with tempfile.TemporaryDirectory() as folder:
            whole = Path(folder) / self.path.name
            whole.write_bytes(data)
            try:
                rows = rows_of(read_gnss(whole, **self._options))
            except InputError as error:
                self.trouble = str(error).replace(str(whole), str(self.path))
                return none
        self.trouble = None
        new = rows[rows[:, TIME] > self._last]
        if len(new):
            self._last = float(new[-1, 0])
        return new
