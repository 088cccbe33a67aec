"""PX4 ULog: increments of ``vehicle_imu``, or mean rates of ``sensor_combined``, through pyulog.

Both are in front-right-down axes, with stamps in microseconds since the start (PX4, message
definitions VehicleImu and SensorCombined). ``vehicle_imu`` holds the angle and the velocity over
`delta_angle_dt` and `delta_velocity_dt` before its stamp, the angle corrected for coning (PX4,
Integrator.hpp); they are the better choice, but only where each was logged: loggers often keep
one in many. ``sensor_combined`` holds averages over the sensor's interval.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError, how_to_install, shown
from schuler.io.content import BLOCK_ROWS, Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.io.ulogfile import clean

__all__ = ["UlogReader"]

_MAGIC = b"ULog\x01\x12\x35"
_INCREMENTS, _RATES = "vehicle_imu", "sensor_combined"
_NO_ACCEL = 0x7FFFFFFF

#: increments must cover so much of the time to be taken for all there are
_COVERED = 0.95


@dataclass(frozen=True)
class _Stream:
    """A message and its instance: its columns by name, and how much of the time it covers."""

    name: str
    instance: int
    data: dict[str, Any]
    covered: float

    @property
    def label(self) -> str:
        return f"{self.name}:{self.instance}"

    def __len__(self) -> int:
        return len(self.data["timestamp"])


class UlogReader:
    """Reader of PX4 logs."""

    name = "ulog"
    suffixes: tuple[str, ...] = (".ulg", ".ulog")

    def sniff(self, head: bytes) -> bool:
        """Say whether ULog's mark is there."""
        return head.startswith(_MAGIC)

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Load the messages; pyulog reads a log only whole."""
        streams, notes = _load(path)
        stream = _choose(streams, mapping.topic)
        if stream.name == _INCREMENTS:
            columns, said = _increments(stream, notes)
        else:
            columns, said = _rates(stream, notes)
        time, n = stream.data["timestamp"], len(stream)
        done = [0]

        def blocks() -> Iterator[Block]:
            for begin in range(0, n, BLOCK_ROWS):
                part = slice(begin, begin + BLOCK_ROWS)
                done[0] = min(n, begin + BLOCK_ROWS)
                yield time[part].astype(np.float64), [c[part] for c in columns], None

        return Content(
            blocks=blocks,
            said=Mapping(time="us", axes="FRD").merged(said),
            fixed=True,
            time_label=f"the stamps of {stream.label}",
            rows=n,
            notes=notes,
            progress=lambda: done[0] / n,
        )


def _load(path: Path) -> tuple[list[_Stream], list[str]]:
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(f"is a PX4 ULog, which needs pyulog: {how_to_install('ulog')}") from None
    try:
        with path.open("rb") as file:
            sound = clean(file, path.stat().st_size, (_INCREMENTS, _RATES))
        # pyulog prints what it finds; a command's output must stay its own.
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(io.BytesIO(sound.data), [_INCREMENTS, _RATES])
    except InputError:
        raise
    except Exception as error:  # pyulog lets many kinds escape from damaged files
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise InputError(f"is a damaged or truncated ULog ({shown(reason)[:120]})") from None
    streams = []
    for item in log.data_list:
        missing = [name for name in _fields(item.name) if name not in item.data]
        if missing:
            raise InputError(f"its {item.name} has no {', '.join(missing)}, which PX4 logs there")
        streams.append(_Stream(item.name, item.multi_id, item.data, _coverage(item)))
    if not streams:
        names = sorted(n for n in sound.names if "imu" in n or n.startswith("sensor"))
        raise InputError(
            f"has no samples of {_INCREMENTS} or {_RATES}; what it defines of its sensors is "
            f"{', '.join(names[:20]) or 'nothing'}"
        )
    notes = []
    if sound.cut:
        notes.append("the log ends in the middle of a message: it was cut off, and what came "
                     "after is missing")  # fmt: skip
    short = sum(sound.rows.values()) - sum(map(len, streams))
    if short:
        notes.append(f"{short} of its messages have a wrong size and were left out")
    if log.file_corruption or sound.lost:
        notes.append(
            "parts of the log are damaged and were left out"
            + (f": {sound.lost} bytes belong to no whole message" if sound.lost else "")
        )
    if log.dropouts:
        lost = sum(d.duration for d in log.dropouts)
        notes.append(f"the logger reports {len(log.dropouts)} dropouts of {lost} ms in all")
    return streams, notes


def _fields(name: str) -> list[str]:
    vectors, scalars = {
        _INCREMENTS: (("delta_angle", "delta_velocity"), ("delta_angle_dt", "delta_velocity_dt")),
        _RATES: (("gyro_rad", "accelerometer_m_s2"), ("accelerometer_timestamp_relative",)),
    }[name]
    return ["timestamp", *(f"{v}[{k}]" for v in vectors for k in range(3)), *scalars]


def _coverage(item: Any) -> float:
    """Return the part of the time between the stamps that increments cover."""
    if item.name == _RATES or len(item.data["timestamp"]) < 2:
        return 1.0
    stamps = item.data["timestamp"].astype(np.float64)
    span = stamps[-1] - stamps[0]
    return float(item.data["delta_angle_dt"][1:].sum(dtype=np.float64) / span) if span > 0 else 0.0


def _choose(streams: list[_Stream], wanted: str | None) -> _Stream:
    listing = ", ".join(f"{s.label} ({len(s)} rows)" for s in streams)
    if wanted is not None:
        name, colon, instance = wanted.partition(":")
        hits = [s for s in streams if s.name == name and (not colon or str(s.instance) == instance)]
        if not hits:
            raise InputError(f"there is no '{wanted}'; it has {listing}")
    else:
        whole = [s for s in streams if s.name == _INCREMENTS and s.covered >= _COVERED]
        hits = whole or [s for s in streams if s.name == _RATES]
        if not hits:
            raise InputError(
                f"has increments, but not all of them: they cover {100 * streams[0].covered:.3g} % "
                f"of the time ({listing}); take one with --topic, to be read as mean rates"
            )
    if len(hits) > 1:
        raise InputError(f"has several instruments: {listing}; say which with --topic")
    return hits[0]


def _increments(stream: _Stream, notes: list[str]) -> tuple[list[Array], Mapping]:
    """Return the columns: increments, or mean rates where some were not logged."""
    data = stream.data
    steps = [data[key].astype(np.float64) for key in ("delta_angle_dt", "delta_velocity_dt")]
    dtheta, dvel = (
        [data[f"{key}[{k}]"].astype(np.float64) for k in range(3)]
        for key in ("delta_angle", "delta_velocity")
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        if stream.covered >= _COVERED:
            # The two sensors' intervals differ by a sample now and then; a row has one.
            ratio = steps[0] / steps[1]
            columns = [*dtheta, *(v * ratio for v in dvel)]
            return columns, Mapping(gyro="rad", accel="m/s", coning_corrected=True)
        notes.append(
            f"the increments of {stream.label} cover {100 * stream.covered:.3g} % of the time: "
            "each is read as a rate that is held"
        )
        rates = [x / (1e-6 * steps[k // 3]) for k, x in enumerate([*dtheta, *dvel])]
    return rates, Mapping(gyro="rad/s", accel="m/s^2", mean_rates=True)


def _rates(stream: _Stream, notes: list[str]) -> tuple[list[Array], Mapping]:
    data = stream.data
    columns = [
        data[f"{key}[{k}]"].astype(np.float64)
        for key in ("gyro_rad", "accelerometer_m_s2")
        for k in range(3)
    ]
    late = data["accelerometer_timestamp_relative"]
    invalid = late == _NO_ACCEL
    for column in columns[3:]:
        column[invalid] = np.nan
    if np.any(invalid):
        notes.append(f"{int(invalid.sum())} rows have no valid accelerometer values")
    largest = int(np.max(np.abs(late[~invalid].astype(np.int64)), initial=0))
    if largest:
        notes.append(
            f"accelerometer stamps differ from the gyros' by up to {1e-3 * largest:.3g} ms; "
            "the values are taken at the gyros' stamps"
        )
    return columns, Mapping(gyro="rad/s", accel="m/s^2", mean_rates=True)
