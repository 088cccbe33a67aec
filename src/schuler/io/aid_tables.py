"""Reading heights, headings and velocities of a Doppler log, from tables, NMEA and ROS bags."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding import BodyVelocity, HeadingFixes, Height, pressure_height
from schuler.errors import InputError
from schuler.io.aid_files import local_file
from schuler.io.gnss import aid_reader
from schuler.io.gnss.nmea import read_nmea_headings
from schuler.io.gnss.registry import head_of
from schuler.io.gnss.ros import RosFixReader, choose_topic, topic_numbers
from schuler.io.named_table import read_bytes, read_named
from schuler.io.ros_messages import ODOMETRY, TWISTS, short_type
from schuler.io.rosbag import opened

__all__ = ["read_dvl", "read_heading", "read_height", "read_twists"]

Array = NDArray[np.float64]
Table = dict[str, Array]

_TIME = dict.fromkeys(("t", "time", "timestamp", "seconds", "gpst", "sow", "tow"), "t")
_HEIGHT = {
    **_TIME,
    **dict.fromkeys(
        ("height", "h", "alt", "altitude", "baro", "baroheight", "baroaltitude"), "height"
    ),
    **dict.fromkeys(("depth",), "depth"),
    **dict.fromkeys(("pressure", "press", "p", "baropressure", "staticpressure"), "pressure"),
    **dict.fromkeys(("sd", "sigma", "sdheight", "sdu"), "sdheight"),
}
_HEADING = {
    **_TIME,
    **dict.fromkeys(("heading", "hdt", "azimuth", "compass", "trueheading"), "heading"),
    **dict.fromkeys(("sd", "sigma", "sdheading"), "sdheading"),
}
_DVL = {
    **_TIME,
    **dict.fromkeys(("vx", "dvlx", "velx", "velocityx", "x"), "x"),
    **dict.fromkeys(("vy", "dvly", "vely", "velocityy", "y"), "y"),
    **dict.fromkeys(("vz", "dvlz", "velz", "velocityz", "z"), "z"),
    **dict.fromkeys(("sd", "sigma", "figureofmerit", "fom"), "sd"),
    **dict.fromkeys(("valid", "velocityvalid", "bottomlock", "lock"), "valid"),
}
_FORWARD_LEFT_UP = {ODOMETRY: 43, TWISTS[0]: 0, TWISTS[1]: 0}
"""Types of ROS with a body's velocity -> where it stands among their numbers."""


def read_height(
    path: str | Path,
    *,
    sigma: float | None = None,
    offset_sigma: float = 100.0,
    offset_time: float = 3600.0,
    lever: ArrayLike = (0.0, 0.0, 0.0),
    offset: float = 0.0,
    name: str = "height",
) -> Height:
    r"""Read heights, depths or pressures from a table with named columns.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet with time, and height (m, positive up), depth (m, positive down) or pressure
        (Pa, or its unit in brackets), which becomes the height in the standard atmosphere; sd (m)
        where there is one.
    sigma : float, optional
        1-sigma, m, where the file has none; 1.
    offset_sigma, offset_time, lever, name
        As of `Height`.
    offset : float
        Added to the file's times, s, to bring them to the record's clock.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or height.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("height.csv").write_text("time,height\n1,500\n2,501\n")
    >>> read_height("height.csv", sigma=0.5).height
    array([500., 501.])
    """
    path = Path(path)
    with local_file(path) as there:
        table = read_named(there, _HEIGHT)
        found = [key for key in ("height", "depth", "pressure") if key in table]
        if "t" not in table or not found:
            raise InputError("heights need a column of times and one of height, depth or pressure")
        if len(found) > 1:
            raise InputError(
                f"it has columns of {' and '.join(found)}: which of them is meant? Keep one"
            )
        values = table[found[0]]
        if found == ["depth"]:
            values = -values
        elif found == ["pressure"]:
            values = pressure_height(values)
        spread: Any = table.get("sdheight", 1.0) if sigma is None else sigma
        return Height(table["t"] + offset, values, spread, offset_sigma, offset_time, lever, name)


def read_heading(
    path: str | Path,
    *,
    sigma: float | None = None,
    baseline: ArrayLike = (0.0, 1.0, 0.0),
    declination: float = 0.0,
    offset: float = 0.0,
    name: str = "heading",
) -> HeadingFixes:
    r"""Read headings of two antennas or a compass from a table, or HDT sentences of NMEA.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet with time and heading (deg clockwise from north, or its unit in brackets),
        and sd where there is one; or NMEA with HDT.
    sigma : float, optional
        1-sigma, rad, where the file has none; 0.2 deg.
    baseline, name
        As of `HeadingFixes`.
    declination : float
        Of a compass: added to its headings, rad, east positive.
    offset : float
        Added to the file's times, s, to bring them to the record's clock.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or heading.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("compass.csv").write_text("time,heading\n1,30\n2,31\n")
    >>> read_heading("compass.csv").time.tolist()
    [1.0, 2.0]
    """
    path = Path(path)
    with local_file(path) as there:
        reader = aid_reader(there, head_of(there))
        clock = "unstated"
        dropped: dict[str, int] = {}
        if reader is not None and reader.name == "nmea":
            table, _, dropped = read_nmea_headings(read_bytes(there))
            clock = "utc-day"
        else:
            table = read_named(there, _HEADING)
        if not {"t", "heading"} <= set(table):
            raise InputError("headings need a column of times and one named heading")
        usual = np.radians(0.2)
        spread: Any = table.get("sdheading", usual) if sigma is None else sigma
        return HeadingFixes(
            table["t"] + offset, table["heading"] + declination, spread, baseline, name, dropped,
            clock,
        )  # fmt: skip


def read_dvl(
    path: str | Path,
    *,
    frame: str | None = None,
    sigma: float | None = None,
    scale: float = 0.0,
    mount: ArrayLike = (0.0, 0.0, 0.0),
    lever: ArrayLike = (0.0, 0.0, 0.0),
    estimate: Sequence[str] = (),
    offset: float = 0.0,
    topic: str | None = None,
    name: str = "dvl",
) -> BodyVelocity:
    r"""Read velocities along a sensor's axes from a table, or from Odometry or a twist of ROS.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet with time, vx, vy, vz (m/s, or their unit in brackets), and sd and valid (0
        where the bottom was lost) where there are any; or a ROS bag.
    frame : {"RFU", "FRD", "FLU"}, optional
        Where x, y, z point; "RFU" of a table and "FLU" of a bag when not given.
    sigma : float, optional
        1-sigma, m/s, where the file has none; 0.02.
    scale, mount, lever, estimate, name
        As of `BodyVelocity`.
    offset : float
        Added to the file's times, s, to bring them to the record's clock.
    topic : str, optional
        Of a bag: Odometry, TwistStamped or TwistWithCovarianceStamped.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time or velocity.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("dvl.csv").write_text("time,vx,vy,vz\n1,0,2,0\n2,0,2.1,0\n")
    >>> read_dvl("dvl.csv", frame="RFU").time.tolist()
    [1.0, 2.0]
    """
    path = Path(path)
    with local_file(path) as there:
        clock = "unstated"
        if RosFixReader().sniff(head_of(there)):
            table, clock, usual = read_twists(there, topic), "utc", "FLU"
        else:
            table, usual = read_named(there, _DVL), "RFU"
        missing = [key for key in ("t", "x", "y", "z") if key not in table]
        if missing:
            raise InputError(
                f"velocities need time, vx, vy and vz; {', '.join(missing)} not found among its "
                "columns"
            )
        spread: Any = table.get("sd", 0.02) if sigma is None else sigma
        return BodyVelocity(
            table["t"] + offset, np.column_stack([table["x"], table["y"], table["z"]]), spread,
            frame or usual, table.get("valid"), scale=scale, mount=mount, lever=lever,
            estimate=tuple(estimate), name=name, clock=clock,
        )  # fmt: skip


def read_twists(path: Path, topic: str | None) -> dict[str, Array]:
    """Return time (s) and velocity along x, y, z (m/s) of a topic of Odometry or a stamped twist.

    Raises
    ------
    InputError
        If there is no such topic, or several and none is named.
    """
    types = tuple(_FORWARD_LEFT_UP)
    with opened(path) as bag:
        chosen = choose_topic(bag, types, topic)
        kind = next(short_type(c.msgtype) for c in bag.connections if c.topic == chosen)
    stamps, _, rows = topic_numbers(path, chosen, types)
    first = _FORWARD_LEFT_UP[kind]
    table = np.array([row[first : first + 3] for row in rows])
    return {"t": np.array(stamps), "x": table[:, 0], "y": table[:, 1], "z": table[:, 2]}
