"""PSINS: an array of GNSS fixes in a .mat file.

PSINS (G. Yan) keeps fixes as rows ``[vE vN vU lat lon hgt t]``, or without velocity as
``[lat lon hgt t]``, in m/s, rad, m and s. The number of columns says which. Heights are above the
ellipsoid, times those of the IMU beside it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler.errors import InputError, shown
from schuler.io.gnss.table import FixTable, GnssOptions
from schuler.io.limits import check_size
from schuler.io.mat import load_array
from schuler.io.matfile import survey

__all__ = ["PsinsFixReader"]

_LAYOUTS = {
    4: ("lat", "lon", "height", "t"),
    7: ("ve", "vn", "vu", "lat", "lon", "height", "t"),
}
_NAMES = ("gps", "gnss")
_RECORD = ("imu", "wm", "vm", "gyro", "acc")


class PsinsFixReader:
    """Reader of PSINS's arrays of fixes."""

    name = "psins"

    def sniff(self, head: bytes) -> bool:
        """Say whether MATLAB's mark is there."""
        return head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT", b"\x89HDF\r\n\x1a\n"))

    def alone(self, path: Path) -> bool:
        """Say whether it has an array of fixes by its name, and none that is a record's."""
        try:
            names = {name.lower() for name in survey(path)}
        except InputError:
            return False
        return bool(names & set(_NAMES)) and not names & set(_RECORD)

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the array that is named, or the only one that can be it."""
        with path.open("rb") as file:
            head = file.read(520)
        if b"HDF\r\n" in head or head.startswith(b"MATLAB 7.3"):
            raise InputError(
                "is a MATLAB 7.3 file, of which fixes are not read: save it in MATLAB with -v7"
            )
        sizes = survey(path)
        if options.variable is not None:
            if options.variable not in sizes:
                raise InputError(
                    f"has no array '{options.variable}'; it has {_listing(list(sizes))}"
                )
            names = [options.variable]
        else:
            names = [name for name in sizes if name.lower() in _NAMES] or list(sizes)
        fitting = {}
        for name in names:
            check_size(sizes[name], path.stat().st_size, f"array '{shown(name)}'")
            value = np.asarray(load_array(path, name))
            if value.ndim == 2 and value.shape[1] in _LAYOUTS and value.dtype.kind in "iuf":
                fitting[name] = value
        if len(fitting) != 1:
            raise InputError(
                f"{_listing(list(fitting))} could be the fixes: say which variable"
                if fitting else
                f"has no array of 4 or 7 columns ([vE vN vU] lat lon hgt t): {_listing(names)}"
            )  # fmt: skip
        table = next(iter(fitting.values())).astype(np.float64)
        columns = {
            name: np.ascontiguousarray(table[:, k])
            for k, name in enumerate(_LAYOUTS[table.shape[1]])
        }
        dropped: dict[str, int] = {}
        return FixTable(columns, "unstated", "", "ellipsoid", dropped)


def _listing(names: list[str]) -> str:
    return ", ".join(f"'{shown(name)}'" for name in names[:20]) or "nothing"
