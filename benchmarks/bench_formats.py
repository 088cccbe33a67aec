"""Reading logs of other programs, each beside the plain loop of its own library.

The peers only hand out messages or numbers: rosbags' own loop (`messages` and `deserialize`),
pyulog's `ULog` of the same message, `numpy.fromfile`. `schuler.read` also cuts the values out,
checks every row, turns the axes and makes increments. NovAtel has no library here: its row says
how long a million messages take.
"""

from __future__ import annotations

import struct
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pyulog import ULog
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import schuler as sc

MESSAGES = 100_000
ROWS = 2_000_000
COUNTS = 1_000_000
REPEATS = 3
IMU = "sensor_msgs/msg/Imu"


def bag(path: Path, kind: str) -> Path:
    """Write a bag of one topic at 200 Hz."""
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    writer: Any = rosbag1.Writer(path) if ros1 else rosbag2.Writer(
        path, version=9,
        storage_plugin=rosbag2.StoragePlugin.MCAP if kind == "mcap"
        else rosbag2.StoragePlugin.SQLITE3,
    )  # fmt: skip
    tail = np.zeros(37)
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((MESSAGES, 6))
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=store)
        for k in range(MESSAGES):
            stamp = 5_000_000 * k
            tail[13:16], tail[25:28] = 1e-3 * noise[k, :3], noise[k, 3:] + [0, 0, 9.8]
            head = (struct.pack("<IIII", k, *divmod(stamp, 10**9), 4) + b"base" if ros1 else
                    b"\0\1\0\0" + struct.pack("<iII", *divmod(stamp, 10**9), 8) + b"base_im\0"
                    + bytes(4))  # fmt: skip
            writer.write(connection, stamp, head + tail.tobytes())
    return path


def ulog(path: Path) -> Path:
    """Write a PX4 log of sensor_combined at 200 Hz."""
    fields = (
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
        "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    )
    kind = np.dtype([("size", "<u2"), ("kind", "u1"), ("number", "<u2"), ("t", "<u8"),
                     ("w", "<f4", 3), ("dt", "<u4"), ("late", "<i4"), ("f", "<f4", 3)])  # fmt: skip
    rows = np.zeros(MESSAGES, kind)
    rows["size"], rows["kind"] = kind.itemsize - 3, ord("D")
    rows["t"] = 5000 * np.arange(1, MESSAGES + 1)
    rng = np.random.default_rng(3)
    rows["w"], rows["f"] = 1e-3 * rng.standard_normal((MESSAGES, 3)), [0, 0, -9.8]
    rows["f"] += rng.standard_normal((MESSAGES, 3)).astype(np.float32)

    def message(letter: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + letter + body

    path.write_bytes(
        b"ULog\x01\x12\x35\x01" + bytes(8) + message(b"B", bytes(40))
        + message(b"F", fields.encode()) + message(b"A", b"\0\0\0sensor_combined")
        + rows.tobytes()
    )  # fmt: skip
    return path


def kfgins(path: Path) -> Path:
    """Write a binary KF-GINS file at 200 Hz."""
    rng = np.random.default_rng(3)
    table = np.column_stack([np.arange(1, ROWS + 1) / 200.0, 1e-6 * rng.standard_normal((ROWS, 6))])
    table[:, 6] -= 9.8 / 200
    table.tofile(path)
    return path


def novatel(path: Path) -> Path:
    """Write a binary RAWIMUSX log at 200 Hz of an HG4930."""
    rng = np.random.default_rng(3)
    counts = rng.integers(-9000, 9000, (COUNTS, 6)).tolist()
    with path.open("wb") as file:
        for k, row in enumerate(counts):
            body = struct.pack("<BBHdI6i", 4, 58, 2209, k / 200.0, 0, *row)
            frame = struct.pack("<3sBHHI", b"\xaa\x44\x13", len(body), 1462, 2209, 0) + body
            crc = zlib.crc32(frame, 0xFFFFFFFF) ^ 0xFFFFFFFF
            file.write(frame + struct.pack("<I", crc))
    return path


def loop(path: Path) -> None:
    """Read a bag as rosbags' documentation shows."""
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages(connections=reader.connections):
            reader.deserialize(raw, connection.msgtype)


def once(job: Callable[[], object]) -> float:
    """Return how long a job takes, s."""
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def run() -> list[dict[str, Any]]:
    """Time each pair in turn; the shortest of several runs counts."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pairs: list[tuple[str, Callable[[], object], Callable[[], object] | None]] = []
        for kind in ("ros1", "sqlite", "mcap"):
            path = bag(folder / f"{kind}{'.bag' if kind == 'ros1' else ''}", kind)
            pairs.append((
                f"{MESSAGES} messages of a {kind} bag, beside rosbags' loop",
                lambda path=path: sc.read(path), lambda path=path: loop(path),
            ))  # fmt: skip
        log, table = ulog(folder / "a.ulg"), kfgins(folder / "a.bin")
        raw = novatel(folder / "a.gps")
        pairs += [
            (f"{MESSAGES} rows of a ULog, beside pyulog", lambda: sc.read(log),
             lambda: ULog(str(log), ["sensor_combined"])),
            (f"{ROWS // 10**6} million rows of KF-GINS, beside numpy.fromfile",
             lambda: sc.read(table, format="kf-gins"), lambda: np.fromfile(table)),
            (f"{COUNTS // 10**6} million messages of NovAtel", lambda: sc.read(raw), None),
        ]  # fmt: skip
        for what, ours, peer in pairs:
            times: dict[bool, list[float]] = {True: [], False: []}
            # In turn, so that a slow minute hits both alike; the first round is warm-up.
            for round_ in range(REPEATS + 1):
                for mine, job in ((True, ours), (False, peer)):
                    if job is not None:
                        seconds = once(job)
                        times[mine] += [seconds] if round_ else []
            best = min(times[True])
            other = min(times[False], default=None)
            rows.append(
                {
                    "what": what,
                    "ours": best,
                    "peer": other,
                    "ratio": None if other is None else other / best,
                    "unit": "s",
                }
            )
    return rows
