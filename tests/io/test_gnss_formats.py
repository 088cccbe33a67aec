"""One drive in every format of GNSS fixes: the same fixes come back, whatever the file's name."""

from __future__ import annotations

import gzip
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io import read_gnss
from schuler.io.aid_kind import aid_kind
from schuler.io.gnss import aid_reader, gnss_readers
from schuler.io.gnss.registry import head_of
from tests.io import gnss_makers as make
from tests.io.gnss_makers import BEGIN, SEPARATION, fixes

RTK = {"sigma": (0.2, 0.3, 0.6)}


def written(content: Callable[[], bytes]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / "file.dat").write_bytes(content())
        return folder / "file.dat"

    return write


#: name -> (reader, how the file is made, options, clock, first time, what is expected)
FORMATS = {
    "nmea": ("nmea", written(lambda: make.nmea(sigma=True)), {}, "utc-day", BEGIN % 86400, RTK),
    "ubx": ("ubx", written(make.ubx), {}, "gps-week", BEGIN,
            {"sigma": (0.14, 0.14, 0.21), "v_sigma": 0.055}),
    "novatel": ("novatel", written(make.novatel_binary), {}, "gps-week", BEGIN, RTK),
    "novatel-ascii": ("novatel", written(make.novatel_ascii), {}, "gps-week", BEGIN, RTK),
    "inspvas": ("novatel", written(lambda: make.novatel_binary("INSPVAS")), {}, "gps-week", BEGIN,
                {"sigma": 3.0}),
    "inspvax": ("novatel", written(lambda: make.novatel_binary("INSPVAX")), {}, "gps-week", BEGIN,
                {**RTK, "v_sigma": (0.02, 0.03, 0.05)}),
    "psins-7": ("psins", make.psins, {}, "unstated", BEGIN, {"sigma": 3.0}),
    "ulog": ("ulog", written(make.ulog), {}, "logger", 20.0,
             {"sigma": (0.2, 0.2, 0.6), "v_sigma": 0.055}),
    "ulog-new": ("ulog", written(lambda: make.ulog(True)), {}, "logger", 20.0, {}),
    "ulog-sensor": ("ulog", written(lambda: make.ulog(True, "sensor_gps")), {}, "logger", 20.0, {}),
    **{f"ros-{kind}": ("ros", lambda folder, k=kind: make.bag(folder, k),
                       {"velocity_topic": "/vel"}, "utc", 1.7e9, RTK)
       for kind in ("ros1", "sqlite", "mcap")},
    "csv": ("table", written(make.csv), {}, "unstated", BEGIN, {"sigma": 3.0}),
    "csv-gzip": ("table", written(lambda: gzip.compress(make.csv())), {}, "unstated", BEGIN, {}),
    "rtklib": ("rtklib", written(make.rtklib), {"velocity": None}, "gps-week", BEGIN, RTK),
    "kf-gins": ("kf-gins", written(make.kfgins), {}, "gps-week", BEGIN,
                {**RTK, "v_sigma": 0.1}),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_fixes_come_back(name: str, tmp_path: Path) -> None:
    reader, write, options, clock, begin, expected = FORMATS[name]
    path = write(tmp_path)
    found = read_gnss(path, **options)
    want = fixes()
    if name != "csv-gzip":
        assert aid_reader(path).name == reader
    assert len(found) == len(want["t"])
    assert found.clock == clock
    assert found.dropped == {}
    np.testing.assert_allclose(found.time, begin + want["t"], atol=2e-6)
    # 5 decimals of a minute are 18 mm, 1e-7 deg are 11 mm.
    np.testing.assert_allclose(found.lat, want["lat"] * DEG, atol=0.02 / 6.37e6)
    np.testing.assert_allclose(found.lon, want["lon"] * DEG, atol=0.03 / 6.37e6)
    np.testing.assert_allclose(found.height, want["height"], atol=1.1e-3)
    stated = name.startswith(("csv",))
    assert found.height_above == ("unstated" if stated else "ellipsoid")
    if name == "rtklib":
        assert found.v_n is None
    else:
        up = 0.0 if name == "nmea" else want["vu"]
        velocity = np.column_stack([want["ve"], want["vn"], np.broadcast_to(up, len(found))])
        np.testing.assert_allclose(found.v_n, velocity, atol=1.5e-3)
        assert found.contradictions() == []
    for key, value in expected.items():
        np.testing.assert_allclose(getattr(found, key)[3], np.broadcast_to(value, 3), rtol=1e-6)


def test_every_reader_is_tested() -> None:
    assert {entry[0] for entry in FORMATS.values()} == set(gnss_readers())


@pytest.mark.parametrize("name", FORMATS)
def test_each_file_has_one_reader(name: str, tmp_path: Path) -> None:
    path = FORMATS[name][1](tmp_path)
    if name == "csv-gzip":
        return
    head = head_of(path)
    claiming = {r.name for r in gnss_readers().values() if r.sniff(head)}
    assert claiming == {FORMATS[name][0]}
    assert gnss_readers()[FORMATS[name][0]].alone(path)


def test_heights_above_the_geoid(tmp_path: Path) -> None:
    path = tmp_path / "a.nmea"
    lines = [
        line.split(b"*")[0].replace(b"%.2f,M" % SEPARATION, b",") for line in
        make.nmea().splitlines() if b"GGA" in line
    ]  # fmt: skip

    def summed(line: bytes) -> bytes:
        total = 0
        for byte in line[1:]:
            total ^= byte
        return line + b"*%02X\r\n" % total

    path.write_bytes(b"".join(summed(line) for line in lines))
    with pytest.raises(InputError, match=r"above the geoid .* say geoid"):
        read_gnss(path)
    found = read_gnss(path, height="geoid")
    assert found.height_above == "geoid"
    np.testing.assert_allclose(found.height, fixes()["height"] - SEPARATION, atol=2e-3)
    assert read_gnss(path, height="ellipsoid").height_above == "ellipsoid"
    path.write_bytes(make.rtklib())
    with pytest.raises(InputError, match="above the ellipsoid, and it has none"):
        read_gnss(path, height="geoid")
    path.write_bytes(make.csv("t,lat,lon,altitude_msl [m],ve,vn,vu"))
    with pytest.raises(InputError, match="above the geoid"):
        read_gnss(path)
    path.write_bytes(make.csv("t,lat,lon,height,ve,vn,separation"))
    with pytest.raises(InputError, match="does not say what"):
        read_gnss(path)


def test_known_sentences() -> None:
    """Two sentences of the literature, decoded by hand: 48 deg 7.038' N, 11 deg 31' E, 545.4 m."""
    from schuler.io.gnss.nmea import _epochs

    text = (
        b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
        b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n"
    )
    epochs, damaged, date = _epochs(text)
    assert damaged == 0
    assert f"{date:%Y-%m-%d}" == "1994-03-23"
    (one,) = epochs
    assert one["t"] == 12 * 3600 + 35 * 60 + 19
    assert one["lat"] / DEG == pytest.approx(48 + 7.038 / 60, abs=1e-9)
    assert one["lon"] / DEG == pytest.approx(11 + 31 / 60, abs=1e-9)
    assert one["height"] + one["separation"] == pytest.approx(592.3)
    assert one["speed"] == pytest.approx(22.4 * 1852 / 3600)
    assert one["course"] / DEG == pytest.approx(84.4)


def test_a_message_of_u_blox_byte_by_byte(tmp_path: Path) -> None:
    """NAV-PVT put together by the interface description, without the library that decodes it."""
    frames = b""
    for k in range(3):
        body = struct.pack(
            "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHHIihH",
            302_400_250 + 250 * k, 2025, 11, 5, 12, 0, 0, 0b111, 20, -250, 3, 0b0100_0011, 0, 17,
            -1_224_723_050, 377_209_977 + k, 12_345, 43_210, 810, 1_250, -7_100, 3_300 + k, 40,
            7_829, 0, 210, 0, 120, 0, 0, 0, 0, 0,
        )  # fmt: skip
        assert len(body) == 92
        content = b"\x01\x07" + struct.pack("<H", 92) + body
        a = b = 0
        for byte in content:
            a = (a + byte) % 256
            b = (a + b) % 256
        frames += b"$junk\xb5\x62" + content + bytes([a, b])
    path = tmp_path / "a.ubx"
    path.write_bytes(frames)
    found = read_gnss(path)
    assert found.time == pytest.approx([302_400.25, 302_400.5, 302_400.75])
    assert found.lat[1] / DEG == pytest.approx(37.7209978, abs=1e-9)
    assert found.lon[0] / DEG == pytest.approx(-122.472305, abs=1e-9)
    assert found.height[0] == pytest.approx(12.345)
    assert found.v_n[2] == pytest.approx([3.302, -7.1, -0.04])
    assert found.sigma[0] == pytest.approx([0.81, 0.81, 1.25])
    assert found.v_sigma[0] == pytest.approx(0.21)
    # A floating ambiguity; that the solution is differential as well says less.
    assert found.quality.tolist() == [2.0, 2.0, 2.0]
    assert found.epoch == "the GPS week of 2025-11-05"


def test_times_increase_over_midnight_and_the_week_s_end(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(make.nmea(begin=86400.0 - 3.0))
    assert np.diff(read_gnss(path).time) == pytest.approx(0.5)
    path.write_bytes(make.rtklib().replace(b"2391 1000", b"2390 7047"))
    assert np.all(np.diff(read_gnss(path).time) > 0.0)


@pytest.mark.parametrize(
    ("content", "reason"),
    [(lambda: make.ubx(gnssFixOk=0), "no fix in three"), (lambda: make.ubx(fixType=2), "no fix in"),
     (lambda: make.novatel_binary(status=1), "does not call computed"),
     (lambda: make.novatel_binary(position=19), "no fix of satellites"),
     (lambda: make.ulog(fix=2), "no fix in three"), (lambda: make.nmea(quality=0), "no fix")],
)  # fmt: skip
def test_what_a_receiver_calls_no_fix_is_dropped(
    tmp_path: Path, content: Callable[[], bytes], reason: str
) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(content())
    with pytest.raises(InputError, match=f"fewer than two usable fixes of 0: 20 with .*{reason}"):
        read_gnss(path)


def test_a_kind_of_solution_that_is_newer_than_the_table_is_single(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    for content in (
        make.novatel_binary(position=99),
        b"".join(_renamed(line) for line in make.novatel_ascii().splitlines(keepends=True)),
    ):
        path.write_bytes(content)
        found = read_gnss(path)
        assert len(found) == 20
        assert np.all(found.quality == 5.0)


def _renamed(line: bytes) -> bytes:
    from tests.io.makers import novatel_crc

    body = line[1:].split(b"*")[0].replace(b"NARROW_INT", b"BETTER_THAN_PPP")
    return b"#" + body + b"*%08x\r\n" % novatel_crc(body)


def test_damaged_messages_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    for content in (make.ubx, make.nmea):
        data = bytearray(content())
        data[len(data) // 2 + 30] ^= 1
        path.write_bytes(data)
        found = read_gnss(path)
        assert sum(found.dropped.values()) >= 1
        assert len(found) >= 19


def test_a_course_at_rest_may_be_missing(tmp_path: Path) -> None:
    from pynmeagps import GET, NMEAMessage

    text = make.nmea()
    (first, *_), rest = text.split(b"$GNRMC"), text
    vtg = NMEAMessage("GN", "VTG", GET, cogtUnit="T", cogmUnit="M", sogn=0.02, sognUnit="N",
                      sogk=0.04, sogkUnit="K", posMode="A").serialize()  # fmt: skip
    lines = [line for line in rest.splitlines(keepends=True) if b"RMC" not in line]
    path = tmp_path / "a.dat"
    path.write_bytes(b"".join(line + (vtg if b"GGA" in line else b"") for line in lines))
    found = read_gnss(path)
    assert len(found) == 20
    assert np.all(np.linalg.norm(found.v_n, axis=1) < 0.02)
    assert first.startswith(b"$GNGGA")


def test_a_level_velocity_has_a_wide_vertical_sigma(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(make.nmea())
    found = read_gnss(path)
    assert found.v_sigma[0] == pytest.approx([0.1, 0.1, 0.5 + 0.2 * 12.0], abs=0.01)


def test_psins_without_velocity_and_by_name(tmp_path: Path) -> None:
    from scipy.io import savemat

    assert read_gnss(make.psins(tmp_path, 4)).v_n is None
    f = fixes()
    table = np.column_stack([np.radians(f["lat"]), np.radians(f["lon"]), f["height"], f["t"]])
    savemat(tmp_path / "b.mat", {"one": table, "two": table + 1e-6})
    with pytest.raises(InputError, match="'one', 'two' could be the fixes"):
        read_gnss(tmp_path / "b.mat")
    assert len(read_gnss(tmp_path / "b.mat", variable="two")) == 20
    with pytest.raises(InputError, match="no array 'three'"):
        read_gnss(tmp_path / "b.mat", variable="three")
    savemat(tmp_path / "c.mat", {"one": table[:, :3]})
    with pytest.raises(InputError, match="no array of 4 or 7 columns"):
        read_gnss(tmp_path / "c.mat")


def test_tables_of_pyins_are_read_apart(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    f = fixes()
    index = pd.Index(f["t"])
    pd.DataFrame(
        {"lat": f["lat"], "lon": f["lon"], "alt": f["height"]}, index=index
    ).to_csv(tmp_path / "position.csv")  # fmt: skip
    pd.DataFrame(
        {"VN": f["vn"], "VE": f["ve"], "VD": -f["vu"]}, index=index
    ).iloc[2:].to_csv(tmp_path / "velocity.csv")  # fmt: skip
    found = read_gnss(tmp_path / "position.csv", velocity=tmp_path / "velocity.csv")
    assert len(found) == 18
    assert found.dropped == {"a position without the velocity of its time": 2}
    np.testing.assert_allclose(found.v_n[0], [f["ve"][2], f["vn"][2], 0.25])
    assert found.contradictions() == []


def test_topics_are_named_where_there_is_a_choice(tmp_path: Path) -> None:
    path = make.bag(tmp_path, "ros1")
    found = read_gnss(path)
    assert found.v_n is None
    assert "/vel" in found.notes[0]
    for topic, words in (("/odom", "is of type nav_msgs/Odometry"), ("/no", "there is no topic")):
        with pytest.raises(InputError, match=words):
            read_gnss(path, topic=topic)
    (tmp_path / "n.dat").write_bytes(make.novatel_binary())
    with pytest.raises(InputError, match="there are no messages 'INSPVA'"):
        read_gnss(tmp_path / "n.dat", topic="INSPVA")


@pytest.mark.parametrize(
    ("name", "module"),
    [("nmea", "pynmeagps"), ("ubx", "pyubx2"), ("ulog", "pyulog"), ("ros-ros1", "rosbags")],
)  # fmt: skip
def test_a_missing_library_is_named(
    name: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = FORMATS[name][1](tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=f"{module}: pip install '{module}>="):
        read_gnss(path)


def test_an_offset_is_added(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(make.ubx())
    assert read_gnss(path, offset=-BEGIN + 18.0).time[0] == pytest.approx(18.0)
    with pytest.raises(InputError, match="must be finite"):
        read_gnss(path, offset=np.nan)
    with pytest.raises(InputError, match=r"no-such\.dat: there is no such file"):
        read_gnss(tmp_path / "no-such.dat")


def test_a_record_whose_comments_have_a_latitude_is_no_solution(tmp_path):
    path = tmp_path / "record.imu"
    path.write_text(
        "% 2nd line of the data includes:\n"
        "%   [latitude0(deg), longitude0(deg), height0(m), t0(s), sampling-interval(ms)].\n"
        "0 0 2 0 0 80\n0 0 7 0 0 80\n"
    )
    assert aid_kind(path) is None
    path.write_text(
        "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)\n"
        "2200 1.0 48.1 11.5 520.0 1 9 0.01 0.01 0.02 0 0 0\n"
    )
    assert aid_kind(path) == "fixes"
