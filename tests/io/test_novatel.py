"""NovAtel logs: the manual's own examples, made messages of every kind, and damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.io.novatel import IMU_TYPES, NovatelReader
from schuler.record import ImuRecord
from tests.io.conftest import Array, make_rows, same
from tests.io.makers import (
    NUMBERS,
    novatel_ascii,
    novatel_binary,
    novatel_frame,
    novatel_row,
)

Put = Callable[..., Path]

# OEM7 documentation, examples of RAWIMUSX, RAWIMUS and RAWIMUX; and NovAtel's answer "Acceleration
# and Angular Rate from the RAWIMU log", of an iMAR FSAS at 200 Hz.
MANUAL = {
    "RAWIMUSX": "%RAWIMUSXA,2209,491674.014;04,41,2209,491674.013699,ea59fe00,329308016,-2706935,"
    "4508389,196192,417138,-1000837*038422a7",
    "RAWIMUS": "%RAWIMUSA,2209,491612.254;2209,491612.253588,ea5afe00,329303960,-2512321,4410363,"
    "309705,607017,-1009773*1fb76c28",
    "RAWIMUX": "#RAWIMUXA,USB1,0,64.5,FINESTEERING,2209,491740.110,02000020,0dc5,16809;04,41,2209,"
    "491740.109817,ea57fe00,329394068,-2396829,4481425,321199,257329,-936077*cf9c035d",
    "FSAS": "%RAWIMUSA,1500,202729.304;1500,202729.304063700,00000000,31695,617,378,1536,15615,"
    "-7680*fc8f8ff8",
}
RAD, FORCE = 2.0**-33, 2.0**-29  # HG4930, rad and m/s


def fails(path: Path, part: str, **options: object) -> None:
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def counts(rows: Array) -> list[list[int]]:
    scale = np.array([0.01 / RAD] * 3 + [0.01 / FORCE] * 3)
    return np.rint(rows[:, 1:] * scale).astype(int).tolist()


def log(rows: Array, kind: str, form: str, week: int = 2209, start: float = 1e5) -> list[bytes]:
    make = novatel_ascii if form == "ascii" else novatel_binary
    return [
        make(kind, novatel_row(kind, week, start + row[0], c))
        for row, c in zip(rows.tolist(), counts(rows), strict=True)
    ]


def expected(rows: Array, start: float = 1e5) -> ImuRecord:
    made = np.array(counts(rows)) * ([RAD] * 3 + [FORCE] * 3)
    return ImuRecord.from_increments(start + rows[:, 0], made[:, :3], made[:, 3:])


@pytest.mark.parametrize("name", list(MANUAL))
def test_examples_of_the_manual(put: Put, name: str) -> None:
    path = put(MANUAL[name] + "\n", "a.log")
    assert NovatelReader().sniff(path.read_bytes())
    source = open_source(path, imu_type="IMAR_FSAS" if name == "FSAS" else "41")
    time, values, _ = next(source._content.blocks())
    assert time is not None
    factors = source._content.factors
    assert factors is not None
    rate = 200 if name == "FSAS" else 125
    gyro, force = np.split(np.array([v[0] for v in values]) * factors * rate, 2)
    if name == "FSAS":
        # "[31695 * (0.05*2^-15)]/0.005 = 9.67m/s^2"
        assert force[2] == pytest.approx(9.67, abs=5e-3)
        assert time[0] == 202729.3040637
        # -(Y) is 617 and 15615: along minus y.
        assert force[1] == pytest.approx(-617 * 0.05 / 2**15 * 200)
        assert gyro[1] == pytest.approx(-15615 * 0.1 / 256 * 200 / 3600 * np.pi / 180)
        return
    # 0.2 mg / 65536 and 0.008 deg/s / 65536 a count, as rates.
    assert np.linalg.norm(force) == pytest.approx(9.81, rel=0.01)
    assert force[2] == pytest.approx(int(MANUAL[name].split(",")[-6]) * 0.2 / 65536 * 9.80665e-3)
    last = int(MANUAL[name].split(",")[-1].partition("*")[0])
    assert gyro[0] == pytest.approx(last * 0.008 / 65536 * np.pi / 180)


@pytest.mark.parametrize("form", ["ascii", "binary"])
@pytest.mark.parametrize("kind", list(NUMBERS))
def test_every_message(put: Put, rows: Array, kind: str, form: str) -> None:
    path = put(b"".join(log(rows, kind, form)), "a.gps")
    said = {} if kind.endswith("X") else {"imu_type": "58"}
    source = open_source(path, **said)
    assert (source.format, source.kind) == ("novatel", "increments")
    assert source.meaning == (
        "increments in counts of HG4930_AN01 (1.16415e-10 rad and 1.86265e-09 m/s), axes RFU, "
        f"time from the seconds of {kind}, from the start of week 2209 in s"
    )
    assert same(source.read(), expected(rows))
    assert source.progress == 1.0
    assert source.notes == []


def test_signs_of_the_three_axes(put: Put) -> None:
    # At rest, level: +1 g along z. Turning about +y: the message holds minus y.
    c = [0, 1000, 0, 0, 0, round(9.8 * 0.01 / FORCE)]
    lines = [novatel_ascii("RAWIMUSX", novatel_row("RAWIMUSX", 1, 0.01 * k, c)) for k in range(5)]
    assert b",-1000," in lines[0]
    record = read(put(b"".join(lines), "a.gps"))
    assert np.allclose(record.dtheta, [0, 1000 * RAD, 0])
    assert np.allclose(record.accel, [0, 0, 9.8])


def test_the_instrument(put: Put, rows: Array) -> None:
    path = put(b"".join(log(rows, "RAWIMUS", "binary")), "a.gps")
    fails(path, r"RAWIMUS does not say which instrument .* --imu-type \(.*58 HG4930_AN01.* --gyro")
    fails(path, "type 'HG9999' is not in the table", imu_type="HG9999")
    fails(path, "type '77' is not in the table", imu_type="77")
    for name in ("HG4930_AN01", "hg4930-an01", "58"):
        assert same(read(path, imu_type=name), expected(rows))
    by_hand = read(path, gyro=f"{RAD!r} rad", accel=f"{FORCE!r} m/s")
    assert same(by_hand, expected(rows))
    odd = [
        novatel_binary("RAWIMUX", novatel_row("RAWIMUX", 1, r[0], c, imu_type=99))
        for r, c in zip(rows.tolist(), counts(rows), strict=True)
    ]
    fails(put(b"".join(odd), "b.gps"), "the IMU type '99' is not in the table")
    mixed = log(rows[:20], "RAWIMUSX", "binary")
    for t in rows[20:, 0].tolist():
        fields = novatel_row("RAWIMUSX", 2209, 1e5 + t, [0] * 6, imu_type=8)
        mixed.append(novatel_binary("RAWIMUSX", fields))
    fails(put(b"".join(mixed), "c.gps"), "changes from type 58 to 8 at t = 100000.21 s")


def test_sizes_of_counts() -> None:
    """A few of the table, computed again by hand; a foot is 0.3048 m."""
    by_number = {t.number: t for t in IMU_TYPES.values()}
    assert len(by_number) == len(IMU_TYPES) == 23
    for number, gyro, accel in (
        (8, 1.9073486328125e-06, 6.103515625e-05),
        (11, 1.1641532182693481e-10, 2.2709369659423828e-09),
        (12, 1.1641532182693481e-10, 4.5418739318847656e-09),
        (26, 1e-9, 2e-8),
        (31, 720 / 2147483648 / 57.29577951308232, 200 / 2147483648),
        (32, 1 / 2097152 / 57.29577951308232, 1 / 4194304),
        (61, 0.0151515 / 65536 / 57.29577951308232 / 200, 0.4 / 65536 * 0.00980665 / 200),
    ):
        assert by_number[number].gyro == pytest.approx(gyro, rel=1e-12)
        assert by_number[number].accel == pytest.approx(accel, rel=1e-12)


def test_messages_among_others(put: Put, rows: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other messages, ASCII among binary, noise, and chunks that end anywhere."""
    rng = np.random.default_rng(5)
    parts = [b"$GPGGA,1,2*00\r\n", novatel_frame(42, bytes(range(200)), False), b"\xaa\x44\x12\x00"]
    for k, message in enumerate(log(rows, "RAWIMUSX", "binary")):
        parts.append(message)
        if k % 3 == 0:
            parts.append(novatel_frame(507, bytes(rng.integers(0, 256, 88, np.uint8)), True))
        if k % 5 == 0:
            parts.append(rng.integers(0, 256, int(rng.integers(1, 90)), np.uint8).tobytes())
    path = put(b"".join(parts), "any")
    source = open_source(path)
    assert same(source.read(), expected(rows))
    for chunk in (97, 200, 1000):
        monkeypatch.setattr("schuler.io.novatel._CHUNK", chunk)
        assert same(read(path), expected(rows))
    text = put(b"noise#\r\n" + b"".join(log(rows, "RAWIMUX", "ascii")), "t")
    for chunk in (150, 333):
        monkeypatch.setattr("schuler.io.novatel._CHUNK", chunk)
        assert same(read(text), expected(rows))
    both = log(rows, "RAWIMUSX", "binary")
    ascii_ = log(rows, "RAWIMUSX", "ascii")
    both[1::2] = ascii_[1::2]
    assert same(read(put(b"".join(both), "both")), expected(rows))


def test_kinds(put: Put, rows: Array) -> None:
    both = [*log(rows, "RAWIMUX", "binary"), *log(rows, "RAWIMUS", "binary")]
    path = put(b"".join(both), "a.gps")
    fails(path, r"several kinds \(RAWIMUX, RAWIMUS\): say --topic")
    fails(path, "no messages 'RAWIMU'; of raw IMU it has RAWIMUX, RAWIMUS", topic="RAWIMU")
    assert same(read(path, topic="rawimux"), expected(rows))
    other = novatel_frame(42, bytes(100), False)
    fails(put(other, "b.gps"), "no whole message of RAWIMU, .*; log RAWIMUSX")


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_damage(put: Put, rows: Array, form: str) -> None:
    messages = log(rows, "RAWIMUSX", form)
    hurt = bytearray(messages[7])
    hurt[-12] ^= 1
    messages[7] = bytes(hurt)
    source = open_source(put(b"".join(messages)[:-11], "a.gps"))
    record = source.read()
    assert source.notes == [
        "1 messages RAWIMUSX have a wrong checksum and were left out",
        "1 message RAWIMUSX at the end is cut off and was left out",
    ]
    source.read()
    assert len(source.notes) == 2
    # The one inside is filled in, the last is wanting.
    assert len(record) == len(rows) - 1
    assert record.quality is not None
    assert (record.quality.gaps, record.quality.interpolated) == (1, 1)
    short = novatel_frame(1462, bytes(12), True)
    fails(put(b"".join(messages[:3]) + short, "b.gps"), "RAWIMUSX has 12 bytes, expected 40")


def test_error_bit_and_week(put: Put, rows: Array) -> None:
    made = []
    for k, (row, c) in enumerate(zip(rows.tolist(), counts(rows), strict=True)):
        t = 604799.85 + row[0]
        week, t = (2210, t - 604800) if t >= 604800 else (2209, t)
        made.append(novatel_binary("RAWIMUX", novatel_row("RAWIMUX", week, t, c, info=k == 5)))
    source = open_source(put(b"".join(made), "a.gps"))
    record = source.read()
    assert source.notes == ["1 samples carry the mark of an IMU error and were dropped"]
    assert record.end == pytest.approx(604799.85 + rows[-1, 0])
    assert record.duration == pytest.approx(0.4)
    assert record.quality is not None
    assert (len(record), record.quality.interpolated) == (40, 1)


def test_nothing_else_is_taken_for_novatel() -> None:
    reader = NovatelReader()
    assert not reader.sniff(b"")
    assert not reader.sniff(MANUAL["RAWIMUS"].replace("491612.254", "491612.255").encode())
    assert not reader.sniff(b"\xaa\x44\x12" * 500)
    rng = np.random.default_rng(1)
    assert not reader.sniff(rng.integers(0, 256, 65536, np.uint8).tobytes())
    assert not reader.sniff(make_rows(500).tobytes())
