"""PX4 logs, their bytes put together by the file format's specification."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.record import ImuRecord
from tests.io.conftest import Array, make_rows
from tests.io.makers import sensor_combined, ulog_file, ulog_message, vehicle_imu

pytest.importorskip("pyulog")

Put = Callable[..., Path]

# x forward, y right, z down -> right, forward, up
FRD = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture
def rows() -> Array:
    """Return rows of whole microseconds, and values that float32 holds."""
    made = make_rows(60)
    made[:, 0] += 12.0
    made[:, 1:] = made[:, 1:].astype(np.float32)
    return made


def turned(rows: Array) -> tuple[Array, Array, Array]:
    return rows[:, 0], rows[:, 1:4] @ FRD.T, rows[:, 4:] @ FRD.T


def increments(rows: Array) -> Array:
    made = rows * np.array([1.0, *[0.01] * 6])
    made[:, 1:] = made[:, 1:].astype(np.float32)
    return made


def same(a: ImuRecord, b: ImuRecord) -> bool:
    return (
        np.allclose(a.time, b.time, rtol=0, atol=1e-9)
        and np.allclose(a.dtheta, b.dtheta, rtol=1e-9, atol=1e-16)
        and np.allclose(a.dvel, b.dvel, rtol=1e-9, atol=1e-16)
    )


def fails(path: Path, part: str, **options: object) -> None:
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["log.ulg", "log"])
def test_sensor_combined(put: Put, rows: Array, name: str) -> None:
    path = put(ulog_file([("sensor_combined", 0, sensor_combined(rows))]), name)
    source = open_source(path)
    assert (source.format, source.rows, source.kind) == ("ulog", 60, "mean-rates")
    assert source.meaning == (
        "rates averaged over each interval in rad/s and m/s^2, axes FRD, time from the stamps of "
        "sensor_combined:0 in us"
    )
    assert same(source.read(), ImuRecord.from_mean_rates(*turned(rows)))
    assert source.notes == []
    assert source.progress == 1.0


def test_vehicle_imu(put: Put, rows: Array) -> None:
    made = increments(rows)
    streams = [("vehicle_imu", 0, vehicle_imu(made)), ("sensor_combined", 0, sensor_combined(rows)),
               ("battery_status", 0, [])]  # fmt: skip
    source = open_source(put(ulog_file(streams), "a.ulg"))
    record = source.read()
    assert source.kind == "increments"
    assert record.coning_corrected
    assert not record.sculling_corrected
    assert same(record, ImuRecord.from_increments(*turned(made)))
    other = open_source(source.path, topic="sensor_combined")
    assert other.kind == "mean-rates"


def test_intervals_of_the_two_sensors_may_differ(put: Put, rows: Array) -> None:
    made = increments(rows)
    bodies = vehicle_imu(made, (10_000, 12_500))
    record = read(put(ulog_file([("vehicle_imu", 0, bodies)]), "a.ulg"))
    made[:, 4:] *= 10 / 12.5
    assert same(record, ImuRecord.from_increments(*turned(made)))


def test_increments_that_were_not_all_logged(put: Put, rows: Array) -> None:
    # One in four: a loss that must not be taken for a slow turn.
    some = increments(rows)[::4]
    lonely = put(ulog_file([("vehicle_imu", 0, vehicle_imu(some))]), "a.ulg")
    fails(lonely, r"not all of them: they cover 25 % of the time \(vehicle_imu:0 \(15 rows\)\)")
    source = open_source(lonely, topic="vehicle_imu:0")
    assert source.kind == "mean-rates"
    assert "cover 25 % of the time: each is read as a rate" in source.notes[0]
    # float32 has rounded the increments.
    assert np.allclose(source.read().gyro, turned(rows[::4])[1], rtol=1e-6, atol=1e-9)
    streams = [("vehicle_imu", 0, vehicle_imu(some)), ("sensor_combined", 0, sensor_combined(rows))]
    assert same(read(put(ulog_file(streams), "b.ulg")), ImuRecord.from_mean_rates(*turned(rows)))


def test_instances(put: Put, rows: Array) -> None:
    a, b = increments(rows), increments(rows + np.array([0, 1, 0, 0, 0, 0, 0]))
    streams = [("vehicle_imu", 0, vehicle_imu(a)), ("vehicle_imu", 1, vehicle_imu(b))]
    path = put(ulog_file(streams), "a.ulg")
    fails(path, r"several instruments: vehicle_imu:0 \(60 rows\), vehicle_imu:1 .* with --topic")
    fails(path, "several instruments", topic="vehicle_imu")
    fails(path, "there is no 'vehicle_imu:2'; it has vehicle_imu:0", topic="vehicle_imu:2")
    assert same(read(path, topic="vehicle_imu:1"), ImuRecord.from_increments(*turned(b)))


def test_accelerometer_stamps(put: Put, rows: Array) -> None:
    late = put(ulog_file([("sensor_combined", 0, sensor_combined(rows, -2000))]), "a.ulg")
    source = open_source(late)
    assert "differ from the gyros' by up to 2 ms" in source.notes[0]
    bodies = sensor_combined(rows)
    bodies[7] = sensor_combined(rows[7:8], 0x7FFFFFFF)[0]
    source = open_source(put(ulog_file([("sensor_combined", 0, bodies)]), "b.ulg"))
    assert source.notes == ["1 rows have no valid accelerometer values"]
    quality = source.read().quality
    assert quality is not None
    assert quality.not_finite == 1


def test_damage_is_said(
    put: Put, rows: Array, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = ulog_file([("sensor_combined", 0, sensor_combined(rows))])
    fails(put(whole[:12], "a.ulg"), "damaged or truncated ULog")
    fails(put(whole[:600], "a.ulg"), "has no samples of vehicle_imu or sensor_combined; what")
    fails(put(ulog_file([("battery_status", 0, [bytes(12)])]), "a.ulg"), "has no samples")
    # Power fails in the middle of a message.
    assert len(read(put(whole[:-20], "a.ulg"))) == 59
    noise = ulog_message("D", b"\x09\x09" + bytes(30))
    source = open_source(put(whole + noise, "a.ulg"))
    assert source.notes == [
        "parts of the log are damaged and were left out: 35 bytes belong to no whole message"
    ]
    dropout = ulog_message("O", b"\x10\x00")
    assert "1 dropouts of 16 ms" in open_source(put(whole + dropout, "a.ulg")).notes[0]
    assert capsys.readouterr().out == ""
    renamed = whole.replace(b"gyro_rad", b"gyro_xyz")
    fails(put(renamed, "a.ulg"), r"its sensor_combined has no gyro_rad\[0\]")
    monkeypatch.setitem(__import__("sys").modules, "pyulog", None)
    fails(put(whole, "a.ulg"), r"needs pyulog: pip install 'pyulog>=")
