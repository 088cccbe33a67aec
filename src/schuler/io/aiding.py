"""Reading what else was measured: GNSS fixes and speeds, of known formats and named columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding import BodySpeed, GnssFixes
from schuler.aiding.rows import checked_rows
from schuler.errors import InputError
from schuler.io.aid_files import local_file
from schuler.io.aid_tables import read_twists
from schuler.io.gnss import FixTable, GnssOptions, GnssReader, aid_reader, gnss_readers
from schuler.io.gnss.registry import head_of
from schuler.io.gnss.ros import RosFixReader
from schuler.io.gnss.table import matched
from schuler.io.gnss.text import read_velocity
from schuler.io.named_table import read_named
from schuler.io.odometer import ODOMETER_NAMES, ForwardSpeed, forward_speed

__all__ = ["fix_heights", "fix_noise", "quality_scales", "read_gnss", "read_speed"]

Array = NDArray[np.float64]
Table = dict[str, Array]

_SPEED = {
    **dict.fromkeys(("t", "time", "timestamp", "seconds"), "t"),
    **dict.fromkeys(
        ("speed", "v", "velocity", "odometer", "wheelspeed", "canspeed", "forwardspeed"), "speed"
    ),
    **dict.fromkeys(("vx", "vright"), "right"),
    **dict.fromkeys(("vy", "vforward"), "forward"),
    **dict.fromkeys(("vz", "vup"), "up"),
    **dict.fromkeys(("sd", "sigma"), "sd"),
    **ODOMETER_NAMES,
}
_RTK, _ON_A_VEHICLE = 0.02, 2.0
"""What a receiver says of a position below so many metres is too small for a moving antenna."""

_SCALE_BY_QUALITY = {1: 1.0, 2: 10.0, 4: 20.0, 5: 50.0}
"""Sigma of a fix by RTKLIB's quality, relative to a fixed one; `_OTHER` of another quality."""

_OTHER = 50.0

_LEVEL = (0.5, 0.2)
"""1-sigma of the vertical velocity where a file has none: m/s, and a share of the speed."""

_ABOVE = (None, "ellipsoid", "geoid", "stated")


def read_gnss(
    path: str | Path,
    *,
    lever: ArrayLike = (0.0, 0.0, 0.0),
    delay: float = 0.0,
    estimate: Sequence[str] = (),
    sigma: float | None = None,
    v_sigma: float | None = None,
    height: str | None = None,
    offset: float = 0.0,
    velocity: str | Path | None = None,
    topic: str | None = None,
    velocity_topic: str | None = None,
    variable: str | None = None,
    name: str = "gnss",
) -> GnssFixes:
    """Read GNSS fixes of any known format, which the content decides and not the file's name.

    Known are NMEA 0183 (GGA, RMC, VTG, GST), u-blox NAV-PVT, NovAtel's BESTPOS, BESTGNSSPOS,
    BESTVEL, INSPVA and INSPVAX (ASCII and binary), PX4's ULog, ROS bags (NavSatFix), arrays of
    PSINS in .mat files, RTKLIB's ``.pos``, the text of KF-GINS (seconds, latitude, longitude,
    height, sigma north, east, down; then velocity north, east, down and its sigma), and CSV and
    Parquet with named columns (time, lat, lon, height; ve, vn, vu or vd; speed and course; sd_e
    ...; quality; units in brackets or behind the name), as pyins has them. Any of them may be
    packed by gzip.

    Parameters
    ----------
    path : str or Path
    lever, delay, estimate, name
        As of `GnssFixes`.
    sigma, v_sigma : float, optional
        1-sigma of position (m) and velocity (m/s) where the file has none; 3 and 0.1. That of a
        position is of the best quality in the file: others have more (float 10 times that of a
        fixed one, differential 20, single 50 times).
    height : {"ellipsoid", "geoid", "stated"}, optional
        What the heights are above. A file that says it itself needs no word; one whose heights are
        above the geoid, and that has no separation of geoid and ellipsoid, is refused without one:
        with "geoid" its heights are taken as they are. "stated" takes the heights of any file,
        and `GnssFixes.height_above` has what it says of them.
    offset : float
        Added to the file's times, s, to bring them to the record's clock.
    velocity : str or Path, optional
        A table of velocities of the same instants, as pyins keeps them.
    topic, velocity_topic : str, optional
        Topics of a ROS bag: NavSatFix, and TwistStamped whose velocity is east, north, up; or which
        message of a log.
    variable : str, optional
        Name of an array of a .mat file.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or position.

    Examples
    --------
    >>> gnss = sc.read_gnss("gnss.csv", sigma=3.0, v_sigma=0.1, lever=(0.0, 1.0, 0.5))
    >>> len(gnss.time)
    59
    """
    if height not in _ABOVE:
        raise InputError(f"height must be ellipsoid or geoid, got '{height}'")
    if not np.isfinite(offset):
        raise InputError(f"an offset of times must be finite, got {offset}")
    path = Path(path)
    with local_file(path) as there:
        options = GnssOptions(topic, velocity_topic, variable)
        reader = _reader(there)
        table = reader.read(there, options)
        missing = [key for key in ("t", "lat", "lon", "height") if key not in table.columns]
        if missing:
            raise InputError(
                f"GNSS fixes need time, latitude, longitude and height; {', '.join(missing)} "
                "not found among its columns"
            )
        if velocity is not None:
            with local_file(Path(velocity)) as other:
                more = read_velocity(other)
            names = [key for key in ("ve", "vn", "vu") if key in more]
            table.columns = matched(table.columns, more["t"], more, names, table.dropped)
        table.columns["t"] = table.columns["t"] + offset
        table.columns["height"], above = fix_heights(table, height)
        fixes = _fixes(table, above, sigma, v_sigma, lever, delay, tuple(estimate), name)
        return replace(fixes, format=reader.name)


def _reader(path: Path) -> GnssReader:
    """Return the reader of a file; a text that none knows is a table or KF-GINS' rows."""
    head = head_of(path)
    found = aid_reader(path, head)
    if found is not None:
        return found
    first = next((x for x in head.splitlines() if x.strip() and not x.startswith(b"#")), b"")
    return gnss_readers()["kf-gins" if _all_numbers(first.split()) else "table"]


def _all_numbers(cells: Sequence[bytes]) -> bool:
    try:
        return len([float(cell) for cell in cells]) >= 7
    except ValueError:
        return False


def fix_heights(table: FixTable, said: str | None) -> tuple[Array, str]:
    """Return the heights, above the ellipsoid where that is known, and what they are above."""
    height, above = table.columns["height"], table.above
    if said == "stated":
        said = above
    if "separation" in table.columns:
        separation = table.columns["separation"]
        above = said or "" if above == "unstated" else above
        if above == "unstated":
            return height, above
        if not above:
            raise InputError(
                "it has heights and a separation of geoid and ellipsoid, but does not say what the "
                "heights are above: say ellipsoid or geoid"
            )
        return (height + separation if above == "geoid" else height), "ellipsoid"
    if above == "geoid" and said is None:
        raise InputError(
            "its heights are above the geoid (sea level), and it has no height of the geoid above "
            "the ellipsoid: say geoid, to take them as they are, or ellipsoid, if they are above it"
        )
    if above == "ellipsoid" and said == "geoid":
        raise InputError("its heights are above the ellipsoid, and it has none above the geoid")
    return height, said or above


def quality_scales(quality: ArrayLike) -> Array:
    """Return the sigma of fixes of a quality (RTKLIB's), relative to that of a fixed one."""
    rows = np.nan_to_num(np.asarray(quality, np.float64))
    return np.array([_SCALE_BY_QUALITY.get(int(q), _OTHER) for q in rows])


def fix_noise(
    table: FixTable, sigma: float | None, v_sigma: float | None, best: float | None = None
) -> tuple[Array, Array | None, Array]:
    """Return 1-sigma of positions, velocities where there are, and their 1-sigma, (n, 3) each.

    Parameters
    ----------
    table : FixTable
    sigma, v_sigma : float or None
        As in `read_gnss`.
    best : float, optional
        Of `quality_scales`, that of the fixes whose sigma is said; the best in the table.
    """
    c = table.columns
    count = len(c["t"])
    quality = c.get("quality")
    if {"sde", "sdn", "sdu"} <= set(c) and sigma is None:
        spread = np.column_stack([c["sde"], c["sdn"], c["sdu"]])
        spread = np.where((spread > 0.0) & (spread < _RTK), _ON_A_VEHICLE * spread, spread)
    else:
        factor = np.ones(count)
        if quality is not None:
            factor = quality_scales(quality)
            least = float(np.min(factor, initial=_OTHER)) if best is None else best
            factor = np.maximum(factor / least, 1.0)
        spread = np.repeat((3.0 if sigma is None else sigma) * factor[:, None], 3, axis=1)
    v_n = None
    v_spread: Any = np.full((count, 3), 0.1 if v_sigma is None else v_sigma)
    if {"ve", "vn"} <= set(c):
        v_n = np.column_stack([c["ve"], c["vn"], c.get("vu", np.zeros(count))])
        level = "vu" not in c
    elif {"speed", "course"} <= set(c):
        speed, course = c["speed"], c["course"]
        v_n = np.column_stack([speed * np.sin(course), speed * np.cos(course), 0.0 * speed])
        level = True
    else:
        level = False
    if v_n is not None and level:
        # Taken as level, on a road that need not be.
        slope = _LEVEL[0] + _LEVEL[1] * np.linalg.norm(v_n, axis=1)
        v_spread[:, 2] = np.maximum(v_spread[:, 2], slope)
    if {"sdve", "sdvn", "sdvu"} <= set(c) and v_sigma is None:
        v_spread = np.column_stack([c["sdve"], c["sdvn"], c["sdvu"]])
    return spread, v_n, v_spread


def _fixes(
    table: FixTable, above: str, sigma: float | None, v_sigma: float | None, lever: ArrayLike,
    delay: float, estimate: tuple[str, ...], name: str,
) -> GnssFixes:  # fmt: skip
    c = table.columns
    spread, v_n, v_spread = fix_noise(table, sigma, v_sigma)
    return GnssFixes(
        c["t"], c["lat"], c["lon"], c["height"], spread, v_n, v_spread, c.get("quality"),
        lever=lever, delay=delay, estimate=estimate, name=name, dropped=table.dropped,
        clock=table.clock, epoch=table.epoch, height_above=above, notes=tuple(table.notes),
    )  # fmt: skip


def speed_roles(path: str | Path) -> set[str]:
    """Return the roles of the columns of a table of speeds; none for a ROS bag.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    path = Path(path)
    with local_file(path) as there:
        bag = RosFixReader().sniff(head_of(there))
        return set() if bag else set(read_named(there, _SPEED))


def read_speed(
    path: str | Path,
    *,
    sigma: float | None = None,
    lever: ArrayLike = (0.0, 0.0, 0.0),
    estimate: Sequence[str] = (),
    offset: float = 0.0,
    topic: str | None = None,
    name: str = "odometer",
    pulse_length: float | None = None,
    wheels: str | None = None,
) -> BodySpeed:
    """Read speeds along the axes of a sensor: one column of forward speed, or right, forward, up.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet with named columns: time and speed; pulses or distance, counted since the
        start; fl, fr, rl, rr of four wheels; or vx, vy, vz (right, forward, up). Or a ROS bag with
        Odometry or a stamped twist, of which the forward speed is taken. Rows that cannot be used
        are left out and counted.
    sigma : float, optional
        1-sigma, m/s, where the file has none; 0.1.
    lever, estimate, name
        As of `BodySpeed`.
    offset : float
        Added to the file's times, s, to bring them to the record's clock.
    topic : str, optional
        Of a bag.
    pulse_length : float, optional
        Metres to a pulse, of a column pulses.
    wheels : {"rear", "front", "all"}, optional
        Of four wheels, which the speed is the mean of: the unsteered pair, the rear one by
        default, or all.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or speed.

    Examples
    --------
    >>> odometer = sc.read_speed("speed.csv", sigma=0.05)
    >>> len(odometer.time)
    61
    """
    path = Path(path)
    with local_file(path) as there:
        if RosFixReader().sniff(head_of(there)):
            twists = read_twists(there, topic)
            table = {"t": twists["t"], "speed": twists["x"]}
        else:
            table = read_named(there, _SPEED)
        if "t" not in table:
            raise InputError("speeds need a column of times")
        counted = ForwardSpeed(table["t"], np.zeros(0))
        if {"right", "forward", "up"} <= set(table):
            if pulse_length is not None or wheels is not None:
                raise InputError("it has three axes: no pulses and no wheels")
            value, width = np.column_stack([table["right"], table["forward"], table["up"]]), 3
        else:
            counted = forward_speed(table, pulse_length, wheels)
            value, width = counted.speed, 1
        if sigma is None:
            sigma = float(np.nanmedian(table["sd"])) if "sd" in table else 0.1
        sigma = float(np.hypot(sigma, counted.sigma))
        time, rows, _, dropped = checked_rows(
            name, counted.time + offset, {"speed": value}, sigma, width, counted.dropped
        )
        return BodySpeed(
            time, rows["speed"], sigma, lever=lever, estimate=tuple(estimate), name=name,
            dropped=dropped, notes=counted.notes,
        )  # fmt: skip
