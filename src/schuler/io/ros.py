"""ROS bags: ``sensor_msgs/Imu`` of ROS 1 (.bag) and ROS 2 (a bag's folder, .db3, .mcap).

Rates in rad/s and m/s^2 at the header's stamp, in axes x forward, y left, z up (REP 103, REP 145).
The containers are rosbags' work. The message itself is fixed: a stamp, the frame's name, then 37
float64 (orientation 4 and its covariance 9, angular velocity 3 and 9, linear acceleration 3 and
9), which are cut out of a block of messages at once. ROS 1 puts a sequence number before the
stamp, ROS 2 the byte order of CDR, and numbers there at multiples of eight bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError, shown
from schuler.io.content import BLOCK_ROWS, Block, Content
from schuler.io.mapping import Mapping
from schuler.io.rosbag import MCAP, ROS1, is_ros1, opened, raw_messages

__all__ = ["RosReader"]

_SQLITE = b"SQLite format 3\0"
_FOLDER = b"rosbag2_bagfile_information"
_TYPES = ("sensor_msgs/msg/Imu", "sensor_msgs/Imu")

_BODY = 37 * 8
_GYRO, _GYRO_COVARIANCE, _ACCEL, _ACCEL_COVARIANCE = 13, 16, 25, 28
_CDR_PLAIN = (b"\0\0", b"\0\1")
_ROWS = BLOCK_ROWS // 4


class RosReader:
    """Reader of ROS 1 and ROS 2 bags, through rosbags."""

    name = "ros"
    suffixes: tuple[str, ...] = (".bag", ".db3", ".mcap")

    def sniff(self, head: bytes) -> bool:
        """Say whether the mark of a bag, of MCAP, or a bag's tables in SQLite are there."""
        tables = b"CREATE TABLE topics" in head and b"CREATE TABLE messages" in head
        if head.startswith(_SQLITE):
            return tables
        return head.startswith((ROS1, MCAP)) or _FOLDER in head[:4096]

    def open(self, path: Path, mapping: Mapping) -> Content:
        """Choose the topic."""
        with opened(path) as bag:
            topic, count = _choose(bag, mapping.topic)
            first = next(raw_messages(bag, topic, _TYPES), None)
        if first is None:
            said = f", though it announces {count}: the bag is damaged" if count else ""
            raise InputError(f"topic '{topic}' has no messages{said}")
        ros1 = is_ros1(path)
        values = _decode([first], ros1, topic)[1]
        for lacking, columns in (("angular velocity", slice(0, 3)),
                                 ("linear acceleration", slice(3, 6))):  # fmt: skip
            # Of two topics, each may lack what the other holds.
            wanted = mapping.sensor is None or columns.start == 3 * (mapping.sensor == "accel")
            if wanted and np.all(np.isnan(values[:, columns])):
                raise InputError(
                    f"topic '{topic}' says that it has no {lacking} (its covariance begins with "
                    "-1, or the values are NaN); take another with --topic"
                )
        done = [0]
        notes: list[str] = []

        def blocks() -> Iterator[Block]:
            """Yield the rows of the topic, as they are read."""
            done[0] = 0
            with opened(path) as bag:
                held: list[bytes] = []
                for message in raw_messages(bag, topic, _TYPES):
                    held.append(message)
                    if len(held) == _ROWS:
                        done[0] += len(held)
                        yield (*_decode(held, ros1, topic), None)
                        held = []
                done[0] += len(held)
                if held:
                    yield (*_decode(held, ros1, topic), None)
            if count and done[0] != count:
                note = (
                    f"the bag announces {count} messages of '{shown(topic)}', and {done[0]} could "
                    "be read: it is damaged"
                )
                if note not in notes:
                    notes.append(note)

        return Content(
            blocks=blocks,
            said=Mapping(gyro="rad/s", accel="m/s^2", time="s", axes="FLU"),
            fixed=True,
            time_label=f"the stamps of topic '{topic}'",
            rows=count or None,
            notes=notes,
            progress=lambda: done[0] / max(1, count),
        )


def _choose(bag: Any, wanted: str | None) -> tuple[str, int]:
    """Return the topic to read and how many messages it has."""
    counts: dict[str, int] = {}
    kinds: dict[str, str] = {}
    for connection in bag.connections:
        kinds[connection.topic] = connection.msgtype
        if connection.msgtype in _TYPES:
            counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
    if wanted is not None:
        if wanted in counts:
            return wanted, counts[wanted]
        if wanted in kinds:
            raise InputError(
                f"topic '{wanted}' is of type {kinds[wanted]}, not sensor_msgs/Imu; the topics "
                f"of that type are {_listing(counts)}"
            )
        raise InputError(
            f"there is no topic '{wanted}'; the topics of type sensor_msgs/Imu are "
            f"{_listing(counts)}"
        )
    if not counts:
        raise InputError(
            "has no topic of type sensor_msgs/Imu; its topics are "
            f"{', '.join(sorted(kinds)[:20]) or 'none'}"
        )
    if len(counts) > 1:
        raise InputError(
            f"has several topics of type sensor_msgs/Imu: {_listing(counts)}; say which with "
            "--topic"
        )
    return next(iter(counts.items()))


def _listing(counts: dict[str, int]) -> str:
    shown = (f"{topic} ({n} messages)" for topic, n in sorted(counts.items()))
    return ", ".join(shown) or "none"


def _decode(messages: list[bytes], ros1: bool, topic: str) -> tuple[Any, Any]:
    """Return stamps (s) and values (n, 6) of serialised messages.

    Values whose covariance begins with -1 are not there, says the message's definition: NaN.
    """
    stamps, bodies = [], []
    big = False
    for data in messages:
        try:
            if ros1:
                _, seconds, nanoseconds, length = struct.unpack_from("<IIII", data)
                begin = 16 + length
            else:
                if bytes(data[:2]) not in _CDR_PLAIN:
                    raise InputError(
                        f"topic '{topic}' is serialised as {bytes(data[:2]).hex()}, where plain "
                        "CDR (0000 or 0001) is understood"
                    )
                big = data[1] == 0
                seconds, nanoseconds, length = struct.unpack_from(
                    ">iII" if big else "<iII", data, 4
                )
                begin = 4 + (12 + length + 7) // 8 * 8
        except struct.error:
            raise _not_imu(topic, len(data)) from None
        if len(data) < begin + _BODY:
            raise _not_imu(topic, len(data))
        stamps.append(seconds + 1e-9 * nanoseconds)
        bodies.append(data[begin : begin + _BODY])
    table = np.frombuffer(b"".join(bodies), ">f8" if big else "<f8").reshape(-1, 37)
    values = np.hstack([table[:, _GYRO : _GYRO + 3], table[:, _ACCEL : _ACCEL + 3]])
    values = values.astype(np.float64)
    values[table[:, _GYRO_COVARIANCE] == -1.0, :3] = np.nan
    values[table[:, _ACCEL_COVARIANCE] == -1.0, 3:] = np.nan
    return np.array(stamps), values


def _not_imu(topic: str, size: int) -> InputError:
    return InputError(f"topic '{topic}' has a message of {size} bytes, too few for sensor_msgs/Imu")
