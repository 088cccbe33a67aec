"""Files of each format, made from rows (t, three rates, three forces) in the format's own axes.

NovAtel's and PX4's bytes are put together here by their specifications, with a checksum of its
own; bags are written by rosbags.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# -- ROS -------------------------------------------------------------------------------

IMU = "sensor_msgs/msg/Imu"


def imu_message(store: Any, row: Sequence[float], frame: str, ros1: bool, **covariance: Any) -> Any:
    """Return a message of rosbags' own types; the stamp is exact to the nanosecond."""
    t = store.types
    stamp = round(row[0] * 1e9)
    header = {"stamp": t["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9),
              "frame_id": frame}  # fmt: skip
    if ros1:
        header = {"seq": 7, **header}
    vector = t["geometry_msgs/msg/Vector3"]
    nine = np.zeros(9)
    return t[IMU](
        header=t["std_msgs/msg/Header"](**header),
        orientation=t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        orientation_covariance=nine,
        angular_velocity=vector(*row[1:4]),
        angular_velocity_covariance=covariance.get("gyro", nine),
        linear_acceleration=vector(*row[4:7]),
        linear_acceleration_covariance=covariance.get("accel", nine),
    )


def write_bag(
    path: Path, topics: dict[str, Array], kind: str, frame: str = "imu_link", **options: Any
) -> Path:
    """Write a bag of kind ros1, sqlite or mcap; return the file or folder."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = getattr(rosbag2.StoragePlugin, "MCAP" if kind == "mcap" else "SQLITE3")
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    if "compression" in options:
        writer.set_compression(*options["compression"])
    covariance = {k: v for k, v in options.items() if k in ("gyro", "accel")}
    with writer:
        said = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        text = store.types["std_msgs/msg/String"]("hello")
        pack = store.serialize_ros1 if ros1 else store.serialize_cdr
        writer.write(said, 1, pack(text, "std_msgs/msg/String"))
        for topic, rows in topics.items():
            connection = writer.add_connection(topic, IMU, typestore=store)
            for row in rows.tolist():
                message = imu_message(store, row, frame, ros1, **covariance)
                writer.write(connection, round(row[0] * 1e9) + 5_000_000, pack(message, IMU))
    return path


# -- ULog ------------------------------------------------------------------------------

FORMATS = {
    "vehicle_imu": "uint64_t timestamp;uint64_t timestamp_sample;uint32_t accel_device_id;"
    "uint32_t gyro_device_id;float[3] delta_angle;float[3] delta_velocity;"
    "uint16_t delta_angle_dt;uint16_t delta_velocity_dt;uint8_t delta_velocity_clipping;"
    "uint8_t[3] _padding0;",
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
    "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    "uint32_t accelerometer_integral_dt;uint8_t accelerometer_clipping;uint8_t[7] _padding0;",
    "battery_status": "uint64_t timestamp;float voltage_v;",
}


def ulog_message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog_file(streams: Iterable[tuple[str, int, Iterable[bytes]]]) -> bytes:
    """Return a log of messages (name, instance, bodies), by PX4's file format."""
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += ulog_message("B", bytes(40))
    out += b"".join(ulog_message("F", f"{k}:{v}".encode()) for k, v in FORMATS.items())
    data = b""
    for number, (name, instance, bodies) in enumerate(streams):
        out += ulog_message("A", struct.pack("<BH", instance, number) + name.encode())
        data += b"".join(ulog_message("D", struct.pack("<H", number) + body) for body in bodies)
    return out + data


def vehicle_imu(rows: Array, dt_us: tuple[int, int] = (10_000, 10_000)) -> list[bytes]:
    """Return bodies of vehicle_imu; the rows hold increments. Padding at the end is not logged."""
    return [
        struct.pack("<QQII6fHHB", round(r[0] * 1e6), 0, 1, 2, *r[1:], *dt_us, 0)
        for r in rows.tolist()
    ]


def sensor_combined(rows: Array, late: int = 0) -> list[bytes]:
    return [
        struct.pack(
            "<Q3fIi3fIB", round(r[0] * 1e6), *r[1:4], 10_000, late, *r[4:], 10_000, 0
        )
        for r in rows.tolist()
    ]  # fmt: skip


# -- NovAtel ---------------------------------------------------------------------------


def novatel_crc(data: bytes) -> int:
    """Return the checksum bit by bit, as the manual describes it."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xEDB88320 if crc & 1 else 0)
    return crc


def novatel_row(kind: str, week: int, t: float, counts: Sequence[int], **more: int) -> list[Any]:
    """Return the fields of a message; counts are gyro x, y, z and accelerometer x, y, z."""
    gx, gy, gz, ax, ay, az = counts
    head = [more.get("info", 4), more.get("imu_type", 58)] if kind.endswith("X") else []
    return [*head, week, t, 0x77, az, -ay, ax, gz, -gy, gx]


def novatel_ascii(kind: str, fields: list[Any]) -> bytes:
    texts = [str(f) for f in fields]
    if kind.endswith("X"):
        texts[0] = f"{fields[0]:02x}"
    texts[-7] = f"{fields[-7]:08x}"
    week, t = fields[-9], fields[-8]
    short = "S" in kind
    head = f"{week},{t:.3f}" if short else f"COM1,0,60.0,FINESTEERING,{week},{t:.3f},00,0dc5,16809"
    body = f"{kind}A,{head};{','.join(texts)}".encode()
    return (b"%" if short else b"#") + body + b"*%08x\r\n" % novatel_crc(body)


NUMBERS = {"RAWIMU": 268, "RAWIMUS": 325, "RAWIMUX": 1461, "RAWIMUSX": 1462}


def novatel_binary(kind: str, fields: list[Any]) -> bytes:
    body = struct.pack("<BBHdI6i" if kind.endswith("X") else "<IdI6i", *fields)
    return novatel_frame(NUMBERS[kind], body, "S" in kind, fields[-9], fields[-8])


def novatel_frame(number: int, body: bytes, short: bool, week: int = 0, t: float = 0.0) -> bytes:
    if short:
        head = struct.pack("<3sBHHI", b"\xaa\x44\x13", len(body), number, week, int(1e3 * t))
    else:
        head = struct.pack(
            "<3sBHBBHHBBHIIHH", b"\xaa\x44\x12", 28, number, 0, 32, len(body), 0, 90, 180, week,
            int(1e3 * t), 0, 0, 16809,
        )  # fmt: skip
    frame = head + body
    return frame + struct.pack("<I", novatel_crc(frame))
