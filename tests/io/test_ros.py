"""ROS bags: every container, the choice of the topic, what the message itself may say, damage."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.io.ros import _decode
from schuler.record import ImuRecord
from tests.io.conftest import Array, make_rows
from tests.io.makers import IMU, imu_message, write_bag

pytest.importorskip("rosbags")
typesys = pytest.importorskip("rosbags.typesys")

# x forward, y left, z up -> right, forward, up
FLU = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def expected(rows: Array) -> ImuRecord:
    return ImuRecord.from_rates(rows[:, 0], rows[:, 1:4] @ FLU.T, rows[:, 4:] @ FLU.T)


def fails(path: Path, part: str, **options: object) -> None:
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def close(a: ImuRecord, b: ImuRecord) -> bool:
    """Whether values are the same bits but for the stamps' last one."""
    return (
        np.allclose(a.time, b.time, rtol=0, atol=1e-9)
        and np.allclose(a.dtheta, b.dtheta, rtol=1e-12, atol=1e-18)
        and np.allclose(a.dvel, b.dvel, rtol=1e-12, atol=1e-18)
    )


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_each_container(tmp_path: Path, rows: Array, kind: str) -> None:
    path = write_bag(tmp_path / "log.bag", {"/imu/data": rows}, kind)
    source = open_source(path)
    assert (source.format, source.rows, source.kind) == ("ros", len(rows), "rates")
    assert source.meaning == (
        "instantaneous rates in rad/s and m/s^2, axes FLU, time from the stamps of topic "
        "'/imu/data' in s"
    )
    assert close(source.read(), expected(rows))
    assert source.progress == 1.0
    assert (source.size or 0) > 0
    assert read(path, mean_rates=True).dtheta.shape == (len(rows), 3)
    if kind == "ros1":
        assert open_source(path.rename(tmp_path / "x.dat")).format == "ros"
        return
    # The file in the folder is enough, whatever its name.
    (inner,) = (p for p in path.iterdir() if p.name != "metadata.yaml")
    assert close(read(inner), expected(rows))
    shutil.copy(inner, tmp_path / "plain")
    assert close(read(tmp_path / "plain"), expected(rows))


@pytest.mark.parametrize("frame", ["", "a", "imu", "imu_link", "a_frame_of_some_length"])
@pytest.mark.parametrize("ros1", [True, False])
def test_messages_are_cut_as_rosbags_reads_them(frame: str, ros1: bool) -> None:
    name = typesys.Stores.ROS1_NOETIC if ros1 else typesys.Stores.ROS2_HUMBLE
    store = typesys.get_typestore(name)
    rows = make_rows(5)
    messages = [imu_message(store, row, frame, ros1) for row in rows.tolist()]
    if ros1:
        packed = [bytes(store.serialize_ros1(m, IMU)) for m in messages]
    else:
        packed = [bytes(store.serialize_cdr(m, IMU)) for m in messages]
        big = [bytes(store.serialize_cdr(m, IMU, little_endian=False)) for m in messages]
        assert np.array_equal(_decode(big, False, "x")[1], rows[:, 1:])
    time, values = _decode(packed, ros1, "x")
    assert np.allclose(time, rows[:, 0], rtol=0, atol=1e-12)
    assert np.array_equal(values, rows[:, 1:])


def test_topics(tmp_path: Path, rows: Array) -> None:
    other = rows + np.array([0, 1, 1, 1, 0, 0, 0])
    path = write_bag(tmp_path / "two.bag", {"/a/imu": rows, "/b/imu": other[:30]}, "ros1")
    fails(
        path,
        r"several topics of type sensor_msgs/Imu: /a/imu \(40 messages\), /b/imu "
        r"\(30 messages\); say which with --topic",
    )
    assert close(read(path, topic="/b/imu"), expected(other[:30]))
    fails(path, "there is no topic '/c'; .* /a/imu", topic="/c")
    fails(path, "'/chatter' is of type std_msgs/msg/String, not sensor_msgs", topic="/chatter")
    path = write_bag(tmp_path / "none.bag", {}, "ros1")
    fails(path, "no topic of type sensor_msgs/Imu; its topics are /chatter")
    path = write_bag(tmp_path / "empty", {"/imu": rows[:0]}, "sqlite")
    fails(path, "topic '/imu' has no messages")


def test_a_value_that_the_message_says_is_not_there(tmp_path: Path, rows: Array) -> None:
    minus = np.array([-1.0, *[0.0] * 8])
    path = write_bag(tmp_path / "a.bag", {"/imu": rows}, "ros1", gyro=minus)
    fails(path, r"topic '/imu' says that it has no angular velocity \(its covariance")
    path = write_bag(tmp_path / "b.bag", {"/imu": rows}, "ros1", accel=minus)
    fails(path, "no linear acceleration")


def test_blocks_and_compression(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: Array
) -> None:
    from rosbags import rosbag1, rosbag2

    monkeypatch.setattr("schuler.io.ros._ROWS", 7)
    path = write_bag(
        tmp_path / "a.bag", {"/imu": rows}, "ros1",
        compression=(rosbag1.Writer.CompressionFormat.LZ4,),
    )  # fmt: skip
    parts = list(open_source(path).chunks(5))
    assert max(map(len, parts)) == 5
    assert close(ImuRecord.concatenate(parts), expected(rows))
    for mode in ("MESSAGE", "FILE"):
        folder = write_bag(
            tmp_path / mode, {"/imu": rows}, "sqlite",
            compression=(getattr(rosbag2.CompressionMode, mode), rosbag2.CompressionFormat.ZSTD),
        )  # fmt: skip
        assert close(read(folder), expected(rows))
    chunks = open_source(path).chunks(3)
    next(chunks)
    chunks.close()  # type: ignore[attr-defined]


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_damage(tmp_path: Path, rows: Array, kind: str) -> None:
    path = write_bag(tmp_path / "log.bag", {"/imu": rows}, kind)
    if kind != "ros1":
        (path,) = (p for p in path.iterdir() if p.name != "metadata.yaml")
    whole = path.read_bytes()
    # The end of a database's last page may hold nothing.
    ends = (len(whole) // 2, len(whole) - 9, 40)[:: 2 if kind == "sqlite" else 1]
    for end in ends:
        path.write_bytes(whole[:end])
        with pytest.raises(InputError) as error:
            read(path)
        assert "\n" not in str(error.value)
        if end > 40:
            assert "is a damaged or truncated ROS bag (" in str(error.value)
    if kind != "ros1":
        (path.parent / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
        fails(path.parent, "damaged or truncated ROS bag")
        (path.parent / "metadata.yaml").unlink()
        fails(path.parent, "is a folder; name a file in it")


def test_messages_of_another_kind() -> None:
    with pytest.raises(InputError, match="a message of 20 bytes, too few"):
        _decode([bytes(20)], True, "/x")
    with pytest.raises(InputError, match="a message of 9 bytes, too few"):
        _decode([b"\0\1" + bytes(7)], False, "/x")
    with pytest.raises(InputError, match="serialised as 0007"):
        _decode([struct.pack(">HH", 7, 0) + bytes(400)], False, "/x")


def test_without_the_library(tmp_path: Path, rows: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_bag(tmp_path / "log.bag", {"/imu": rows}, "ros1")
    monkeypatch.setitem(__import__("sys").modules, "rosbags", None)
    fails(path, r"needs rosbags: pip install 'rosbags>=")


def test_the_door_checks_bags_too(tmp_path: Path, rows: Array) -> None:
    rows[20, 3] = np.nan
    rows[30] = rows[29]
    record = read(write_bag(tmp_path / "a.bag", {"/imu": rows}, "ros1"))
    assert record.quality is not None
    assert (record.quality.not_finite, record.quality.repeated) == (1, 1)
    rows[35, 0] = 0.05
    fails(write_bag(tmp_path / "b.bag", {"/imu": rows}, "ros1"), "data row")


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_two_topics_are_joined(kind: str, tmp_path: Path) -> None:
    t = 0.01 * np.arange(1, 301)
    gyro = np.column_stack([t, 0.1 * t, 0.2 * t, 0.3 * t, np.zeros((300, 3))])
    accel = np.column_stack([t + 0.003, np.zeros((300, 3)), 0.5 * t, 1.0 - t, 9.8 + 0.0 * t])
    bag = write_bag(tmp_path / "a.bag", {"/gyro/sample": gyro, "/accel/sample": accel}, kind)
    source = open_source(bag, topic="/gyro/sample", accel_topic="/accel/sample")
    found = source.read()
    assert source.notes[0].startswith("the accelerometers of topic '/accel/sample' were put on")
    # Forward, left, up become right, forward, up; straight lines are interpolated exactly.
    middle = found.time - 0.5 * found.dt
    assert np.allclose(found.gyro, middle[:, None] * [-0.2, 0.1, 0.3], atol=1e-9)
    assert np.allclose(found.accel[:, 1], 0.5 * (middle - 0.003), rtol=0, atol=1e-6)
    assert source.assumed == []
