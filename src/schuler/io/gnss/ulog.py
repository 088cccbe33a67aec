"""PX4 ULog: ``vehicle_gps_position`` (or ``sensor_gps``), through pyulog.

Position in 1e-7 deg and mm, or, in newer logs, in deg and m; heights above sea level and above the
ellipsoid; velocity north, east, down; stamps in microseconds of the logger's clock, the same as
those of the IMU in that log (PX4, message definition SensorGps).
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError, how_to_install, shown
from schuler.io.gnss.table import Array, FixTable, GnssOptions, drop_rows
from schuler.io.ulogfile import clean

__all__ = ["UlogFixReader"]

_MAGIC = b"ULog\x01\x12\x35"
_MESSAGES = ("vehicle_gps_position", "sensor_gps")
_RECORD = ("vehicle_imu", "sensor_combined")
_BEGINNING = 1 << 20
#: column -> the field's names with their units in SI, the finer first
_FIELDS = {
    "lat": (("latitude_deg", DEG), ("lat", 1e-7 * DEG)),
    "lon": (("longitude_deg", DEG), ("lon", 1e-7 * DEG)),
    "height": (("altitude_ellipsoid_m", 1.0), ("alt_ellipsoid", 1e-3)),
    "above_sea": (("altitude_msl_m", 1.0), ("alt", 1e-3)),
    "vn": (("vel_n_m_s", 1.0),), "ve": (("vel_e_m_s", 1.0),), "vu": (("vel_d_m_s", -1.0),),
    "sde": (("eph", 1.0),), "sdn": (("eph", 1.0),), "sdu": (("epv", 1.0),),
    "sdve": (("s_variance_m_s", 1.0),), "sdvn": (("s_variance_m_s", 1.0),),
    "sdvu": (("s_variance_m_s", 1.0),), "fix": (("fix_type", 1.0),),
    "usable": (("vel_ned_valid", 1.0),),
}  # fmt: skip
#: PX4's kind of a fix -> quality as RTKLIB
_QUALITY = {3: 5, 4: 4, 5: 2, 6: 1}


class UlogFixReader:
    """Reader of the fixes of PX4 logs."""

    name = "ulog"

    def sniff(self, head: bytes) -> bool:
        """Say whether ULog's mark is there."""
        return head.startswith(_MAGIC)

    def alone(self, path: Path) -> bool:
        """Say whether the log has fixes and no samples of an IMU."""
        size = path.stat().st_size
        logged: set[str] = set()
        # An IMU is logged all the time: the beginning of a long log shows it.
        for part in sorted({min(size, _BEGINNING), size}):
            with path.open("rb") as file:
                rows = clean(file, part, (*_MESSAGES, *_RECORD)).rows
            logged = {name.partition(":")[0] for name, count in rows.items() if count}
            if logged & set(_RECORD):
                return False
        return bool(logged & set(_MESSAGES))

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the messages of one receiver."""
        label, data = _choose(_load(path), options.topic)
        columns = {"t": data["timestamp"].astype(np.float64) * 1e-6}
        for name, known in _FIELDS.items():
            found = next(((field, unit) for field, unit in known if field in data), None)
            if found is not None:
                columns[name] = data[found[0]].astype(np.float64) * found[1]
        missing = [name for name in ("lat", "lon", "above_sea") if name not in columns]
        if missing:
            raise InputError(f"its {label} has no {', '.join(missing)}, which PX4 logs there")
        dropped: dict[str, int] = {}
        if "fix" in columns:
            columns["quality"] = np.array([float(_QUALITY.get(int(k), 0)) for k in columns["fix"]])
            columns = drop_rows(
                columns, columns["quality"] > 0.0, "no fix in three dimensions", dropped
            )
        above = "ellipsoid"
        # Zeros are those of a receiver that does not say it.
        if "height" in columns and (np.any(columns["height"] != 0.0) or not len(columns["height"])):
            columns["separation"] = columns["height"] - columns["above_sea"]
        else:
            columns["height"], above = columns["above_sea"], "geoid"
        for names in (("sde", "sdn", "sdu"), ("sdve", "sdvn", "sdvu")):
            if not all(name in columns and np.all(columns[name] > 0.0) for name in names):
                for name in names:
                    columns.pop(name, None)
        if not {"ve", "vn", "vu"} <= set(columns):
            for name in ("ve", "vn", "vu"):
                columns.pop(name, None)
        for name in ("above_sea", "fix", "usable"):
            columns.pop(name, None)
        return FixTable(columns, "logger", label, above, dropped)


def _load(path: Path) -> dict[str, dict[str, Array]]:
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(f"is a PX4 ULog, which needs pyulog: {how_to_install('ulog')}") from None
    try:
        with path.open("rb") as file:
            sound = clean(file, path.stat().st_size, _MESSAGES)
        # pyulog prints what it finds; a command's output must stay its own.
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(io.BytesIO(sound.data), list(_MESSAGES))
    except InputError:
        raise
    except Exception as error:  # pyulog lets many kinds escape from damaged files
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise InputError(f"is a damaged or truncated ULog ({shown(reason)[:120]})") from None
    for item in log.data_list:
        if "timestamp" not in item.data:
            raise InputError(f"its {shown(item.name)} has no timestamp, which PX4 logs there")
    return {f"{shown(item.name)}:{item.multi_id}": item.data for item in log.data_list}


def _choose(found: dict[str, Any], wanted: str | None) -> tuple[str, Any]:
    listing = ", ".join(f"{name} ({len(data['timestamp'])} rows)" for name, data in found.items())
    if not found:
        raise InputError(f"has no messages of {' or '.join(_MESSAGES)}")
    if wanted is None:
        # What PX4 itself navigates by, where it is logged, else the only receiver.
        names = [name for name in found if name.startswith(_MESSAGES[0])] or list(found)
    else:
        names = [name for name in found if wanted in (name, name.partition(":")[0])]
    if not names:
        raise InputError(f"there is no '{wanted}'; it has {listing}")
    if len(names) > 1:
        raise InputError(f"has several receivers: {listing}; say which as the topic")
    return names[0], found[names[0]]
