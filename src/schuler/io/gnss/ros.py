"""ROS bags: ``sensor_msgs/NavSatFix``, with velocities from a ``TwistStamped`` topic.

NavSatFix has latitude, longitude (deg) and the height above the ellipsoid, with a covariance in
East-North-Up. A TwistStamped may be in any frame: it is taken as east, north, up only where its
topic is named for that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from schuler.constants import DEG
from schuler.errors import InputError, shown
from schuler.io.gnss.table import FixTable, GnssOptions, as_columns, drop_rows, matched
from schuler.io.ros_messages import NAV_SAT_FIX, TWISTS, decoded, short_type
from schuler.io.rosbag import MCAP, ROS1, is_ros1, opened, raw_messages

__all__ = ["RosFixReader", "choose_topic", "topic_numbers"]

_SQLITE = b"SQLite format 3\0"
_FOLDER = b"rosbag2_bagfile_information"
_IMU = "sensor_msgs/Imu"
#: status of NavSatFix -> quality as RTKLIB
_QUALITY = {0: 5, 1: 4, 2: 4}


class RosFixReader:
    """Reader of the fixes of ROS bags."""

    name = "ros"

    def sniff(self, head: bytes) -> bool:
        """Say whether the mark of a bag is there."""
        if head.startswith(_SQLITE):
            return b"CREATE TABLE topics" in head and b"CREATE TABLE messages" in head
        return head.startswith((ROS1, MCAP)) or _FOLDER in head[:4096]

    def alone(self, path: Path) -> bool:
        """Say whether the bag has fixes and no samples of an IMU."""
        with opened(path) as bag:
            kinds = {short_type(c.msgtype) for c in bag.connections}
        return NAV_SAT_FIX in kinds and _IMU not in kinds

    def read(self, path: Path, options: GnssOptions) -> FixTable:
        """Read the fixes of one topic."""
        with opened(path) as bag:
            topic = choose_topic(bag, (NAV_SAT_FIX,), options.topic)
            others = sorted({c.topic for c in bag.connections if short_type(c.msgtype) in TWISTS})
        stamps, _, rows = topic_numbers(path, topic, (NAV_SAT_FIX,))
        names = ("status", "service", "lat", "lon", "height", *(f"c{k}" for k in range(9)), "known")
        c = as_columns(rows, names)
        dropped: dict[str, int] = {}
        columns = {
            "t": np.array(stamps), "lat": c["lat"] * DEG, "lon": c["lon"] * DEG,
            "height": c["height"],
            "quality": np.array([float(_QUALITY.get(int(s), 0)) for s in c["status"]]),
        }  # fmt: skip
        if np.all(c["known"] > 0.0) and np.all(c["c0"] > 0.0):
            for name, k in (("sde", 0), ("sdn", 4), ("sdu", 8)):
                columns[name] = np.sqrt(np.maximum(c[f"c{k}"], 0.0))
        columns = drop_rows(columns, columns["quality"] > 0.0, "no fix (status below 0)", dropped)
        table = FixTable(columns, "utc", f"the stamps of topic '{shown(topic)}'", "ellipsoid",
                         dropped)  # fmt: skip
        if options.velocity_topic is not None:
            with opened(path) as bag:
                choose_topic(bag, TWISTS, options.velocity_topic)
            when, _, twists = topic_numbers(path, options.velocity_topic, TWISTS)
            v = as_columns([row[:3] for row in twists], ("ve", "vn", "vu"))
            # Drivers of receivers stamp both alike, or a fix and its velocity some ms apart.
            table.columns = matched(
                columns, np.array(when), v, ("ve", "vn", "vu"), dropped, tolerance=0.02
            )
        elif others:
            table.notes.append(
                f"the bag has velocities as well ({', '.join(map(shown, others))}): name the topic "
                "if they are east, north, up"
            )
        return table


def choose_topic(bag: Any, types: tuple[str, ...], wanted: str | None) -> str:
    """Return the topic to be read: the one that is named, or the only one of the types.

    Raises
    ------
    InputError
        If there is none, or there are several and none is named.
    """
    kinds = {str(c.topic): short_type(c.msgtype) for c in bag.connections}
    fitting = sorted(topic for topic, kind in kinds.items() if kind in types)
    said = " or ".join(types)
    if wanted is not None:
        if wanted in fitting:
            return wanted
        raise InputError(
            f"topic '{wanted}' is of type {kinds[wanted]}, not {said}" if wanted in kinds else
            f"there is no topic '{wanted}'; of type {said} are {', '.join(fitting) or 'none'}"
        )  # fmt: skip
    if not fitting:
        raise InputError(
            f"has no topic of type {said}; its topics are {', '.join(sorted(kinds)[:20]) or 'none'}"
        )
    if len(fitting) > 1:
        raise InputError(f"has several topics of type {said}: {', '.join(fitting)}; say which")
    return fitting[0]


def topic_numbers(
    path: Path, topic: str, types: tuple[str, ...]
) -> tuple[list[float], str, list[list[float]]]:
    """Return stamps (s), the frame of the first message, and the numbers of each message.

    Raises
    ------
    InputError
        If the topic has no messages or one that is too short.
    """
    ros1 = is_ros1(path)
    stamps: list[float] = []
    rows: list[list[float]] = []
    frame = ""
    with opened(path) as bag:
        kind = next((short_type(c.msgtype) for c in bag.connections if c.topic == topic), types[0])
        raw = tuple(c.msgtype for c in bag.connections if c.topic == topic)
        for message in raw_messages(bag, topic, raw):
            stamp, name, numbers = decoded(message, kind, ros1)
            frame = frame or name
            stamps.append(stamp)
            rows.append(numbers)
    if not rows:
        raise InputError(f"topic '{shown(topic)}' has no messages")
    return stamps, frame, rows
