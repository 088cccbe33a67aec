"""Trajectories: what is written is read again, in every format and layout."""

from __future__ import annotations

import time
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import schuler as sc
from schuler.aiding.clock import utc_of_zero
from schuler.errors import InputError
from schuler.io import read_trajectory
from schuler.io.trajectory_stream import can_stream
from schuler.motion import Manoeuvre, Route

SITE = sc.Site(-33.5, 179.999, 120.0)


@pytest.fixture(scope="module")
def drive():
    motion = Route(
        heading=70.0, manoeuvres=[Manoeuvre(20.0, speed=30.0), Manoeuvre(10.0, turn=80.0)]
    )
    return sc.simulate(motion, SITE, 40.0, 10.0)


@pytest.mark.parametrize(
    ("name", "layout"),
    [("a.parquet", "schuler"), ("a.csv", "schuler"), ("a.npz", "schuler"), ("a.csv", "pyins"),
     ("a.parquet", "pyins"), ("a.txt", "psins"), ("a.pq", "schuler"), ("a.jsonl", "schuler"),
     ("a.jsonl", "pyins"), ("a.mat", "psins"), ("a.csv", "psins"), ("a.npz", "psins")],
)  # fmt: skip
def test_what_is_written_is_read_again(drive, tmp_path, name, layout):
    path, truth = tmp_path / name, drive.truth
    sc.write_trajectory(truth, path, layout=layout)
    again = sc.read_trajectory(path, layout=layout)
    assert np.array_equal(again.time, truth.time)
    # Degrees and radians, angles and quaternions: rounding, and no more.
    metres = np.abs(again.position - truth.position) * [6.4e6, 6.4e6, 1.0]
    assert metres.max() < 1e-8
    np.testing.assert_allclose(again.v_n, truth.v_n, atol=1e-12)
    same = np.sum(again.quat_nb * truth.quat_nb, axis=1)
    np.testing.assert_allclose(np.abs(same), 1.0, atol=1e-14)


@pytest.mark.skipif(
    not can_stream("a.parquet"), reason="this pyarrow writes no metadata at the end of a file"
)
@pytest.mark.parametrize("layout", ["schuler", "pyins"])
def test_what_is_written_in_pieces_is_what_is_written_at_once(drive, tmp_path, monkeypatch, layout):
    from schuler.io import trajectory_stream as streams

    monkeypatch.setattr(streams, "_GROUP", 100)
    truth = drive.truth
    with streams.streamed_trajectory(tmp_path / "pieces.parquet", layout) as stream:
        for begin, end in ((0, 3), (3, 3), (3, 250), (250, len(truth))):
            stream.write(truth.rows(slice(begin, end)))
    sc.write_trajectory(truth, tmp_path / "whole.parquet", layout=layout)
    one, other = (
        sc.read_trajectory(tmp_path / f"{name}.parquet", layout=layout)
        for name in ("pieces", "whole")
    )
    for name in ("time", "lat", "lon", "height", "v_n", "quat_nb"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    # It has a seal: a damaged byte of what the footer says is found.
    data = (tmp_path / "pieces.parquet").read_bytes()
    at = data.rindex(b"schuler.sha256") + 20
    (tmp_path / "hurt.parquet").write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
    with pytest.raises(InputError, match="damaged"):
        sc.read_trajectory(tmp_path / "hurt.parquet", layout=layout)


def test_a_stream_without_rows_leaves_no_file(tmp_path):
    from schuler.io.trajectory_stream import streamed_trajectory

    with (
        pytest.raises(InputError, match="no rows"),
        streamed_trajectory(tmp_path / "none.parquet"),
    ):
        pass
    assert not list(tmp_path.iterdir())


def test_an_error_on_the_way_leaves_no_file(drive, tmp_path, monkeypatch):
    from schuler.io import trajectory_stream as streams

    monkeypatch.setattr(streams, "_GROUP", 10)

    def interrupted():
        with streams.streamed_trajectory(tmp_path / "half.parquet") as stream:
            stream.write(drive.truth)
            raise RuntimeError("on the way")

    with pytest.raises(RuntimeError, match="on the way"):
        interrupted()
    assert not list(tmp_path.iterdir())


def test_a_path_is_evaluated_against_the_truth_and_its_file(drive, tmp_path):
    truth = drive.truth
    path = sc.navigate(drive.record, sc.Start(SITE, truth.quat_nb[0], truth.v_n[0]))
    found = sc.evaluate(path, truth)
    sc.write_trajectory(truth, tmp_path / "truth.csv")
    from_file = sc.evaluate(path, sc.read_trajectory(tmp_path / "truth.csv"))
    assert np.abs(found.position).max() < 0.01
    np.testing.assert_allclose(from_file.position, found.position, atol=1e-8)
    np.testing.assert_allclose(from_file.phi, found.phi, atol=1e-12)


def test_position_alone_is_a_trajectory(drive, tmp_path):
    t = drive.truth
    bare = sc.Trajectory(t.time, t.lat, t.lon, t.height)
    sc.write_trajectory(bare, tmp_path / "bare.csv")
    again = sc.read_trajectory(tmp_path / "bare.csv")
    assert again.v_n is None
    assert again.quat_nb is None
    with pytest.raises(InputError, match="has no velocity"):
        sc.evaluate(bare, t)
    with pytest.raises(InputError, match="has no attitude"):
        sc.write_trajectory(bare, tmp_path / "bare.txt", layout="psins")
    assert not (tmp_path / "bare.txt").exists()


def test_a_table_has_named_columns(drive):
    pytest.importorskip("pandas")
    table = drive.truth.to_pandas()
    assert len(table) == len(drive.truth)
    assert np.array_equal(table["height [m]"], drive.truth.height)


@pytest.mark.parametrize(
    ("change", "text"),
    [({"v_n": np.zeros((3, 2))}, "v_n of shape"), ({"lat": np.zeros(2)}, "lat of shape")],
)
def test_other_shapes_are_refused(change, text):
    arrays = {name: np.zeros(3) for name in ("time", "lat", "lon", "height")}
    with pytest.raises(InputError, match=text):
        sc.Trajectory(**(arrays | change))


@pytest.mark.parametrize(
    ("content", "layout", "text"),
    [("1 2 3\n4 5 6\n", "psins", "10 columns"), ("t,lat,lon\n", None, "height not found"),
     ("t,lat,lon,height\n0,1,2,3\n0,1,2,3\n", None, "does not advance"),
     ("t,lat,lon,height\n0,1,2,3\n", None, "two whole rows"), ("x", "nmea", "layout must be"),
     ("t,lat,lon,height,qw,qx,qy,qz\n0,1,2,3,1,1,0,0\n1,1,2,3,1,0,0,0\n", None, "unit")],
)  # fmt: skip
def test_a_bad_file_is_one_sentence(tmp_path, content, layout, text):
    path = tmp_path / "bad.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=text):
        sc.read_trajectory(path, layout=layout)


_ROWS = [(345600.0 + 0.1 * k, 48.0 + 1e-7 * k, 11.0, 500.0, 1.0, 2.0, -3.0, 40.0, 5.0, -6.0)
         for k in range(3)]  # fmt: skip


@pytest.mark.parametrize(
    ("head", "order", "comma"),
    [
        ("GPSTime,Latitude,Longitude,H-Ell,VEast,VNorth,VUp,Heading,Pitch,Roll", (), ","),
        ("GPSTime Latitude Longitude H-Ell VEast VNorth VUp Azimuth Pitch Roll\n"
         "(sec) (deg) (deg) (m) (m/s) (m/s) (m/s) (deg) (deg) (deg)", (), " "),
        ("time;lat;lon;alt;vel_e;vel_n;vel_u;yaw;pitch;roll", (), ";"),
        ("t [ms],lat,lon,height [km],ve,vn,vu [km/h],heading,pitch,roll", (), ","),
        ("", (0, 1, 2, 3, 5, 4, 6, 9, 8, 7), " "),
    ],
    ids=["export", "row of units", "semicolons", "other units", "kf-gins"],
)  # fmt: skip
def test_tables_of_other_programs(tmp_path, head, order, comma):
    rows = np.array(_ROWS)
    if "[ms]" in head:
        rows[:, [0, 3, 6]] *= [1e3, 1e-3, 3.6]
    if not head:
        rows = np.column_stack([np.full(3, 2200.0), rows[:, order]])
        rows[:, 7] *= -1.0
    path = tmp_path / "master.txt"
    lines = [comma.join(f"{x:.10g}" for x in row) for row in rows]
    path.write_text("\n".join(([head] if head else []) + lines) + "\n")
    found = read_trajectory(path)
    assert found.time == pytest.approx(np.array(_ROWS)[:, 0])
    assert np.rad2deg(found.lat) == pytest.approx(np.array(_ROWS)[:, 1])
    assert found.height == pytest.approx(500.0)
    assert found.v_n[0] == pytest.approx([1.0, 2.0, -3.0])
    assert np.rad2deg(found.euler[0]) == pytest.approx([-40.0, 5.0, -6.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3 4\n2 2 3 4\n", "4 columns have no names"),
        ("0.5" + " 1" * 10 + "\n0.5" + " 2" * 10 + "\n", "no weeks"),
        ("t,lat,lon,height [furlong]\n0,1,2,3\n", "the unit of height must be one of"),
        ("t,lat,lon,height\n0,1,2,3\n1,x,2,3\n", "data row 2 has a cell that is not a number"),
    ],
)
def test_a_table_that_cannot_be_understood(tmp_path, text, said):
    path = tmp_path / "master.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_trajectory(path)


def test_damaged_npz_is_one_sentence(tmp_path):
    path = tmp_path / "bad.npz"
    path.write_bytes(b"PK\x03\x04 nothing of the kind")
    with pytest.raises(InputError, match="cannot be read"):
        sc.read_trajectory(path)


def test_angles_in_rad_and_gzip(tmp_path):
    import gzip

    rows = "0,0.2,0.7,10,1,2,-3,0.1,-0.05,-2.9\n1,0.2,0.7,10,1,2,-3,0.1,-0.05,-2.9\n"
    names = ("Time [s],Longitude [rad],Latitude [rad],Altitude [m],V North [m/s],V East [m/s],"
             "V Down [m/s],Roll [rad],Pitch [rad],Yaw [rad]\n")  # fmt: skip
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress((names + rows).encode()))
    found = read_trajectory(path)
    assert found.lat.tolist() == pytest.approx([0.7, 0.7])
    assert found.lon.tolist() == pytest.approx([0.2, 0.2])
    assert found.v_n[0].tolist() == [2.0, 1.0, 3.0]
    heading, pitch, roll = (float(x) for x in found.euler[0] * [-1.0, 1.0, 1.0])
    assert np.array([heading, pitch, roll]) == pytest.approx([-2.9, -0.05, 0.1])
    plain = tmp_path / "a.csv"
    plain.write_text("t,lat_rad,lon_rad,height\n0,0.7,0.2,1\n1,0.7,0.2,1\n")
    assert read_trajectory(plain).lat.tolist() == pytest.approx([0.7, 0.7])


@pytest.mark.parametrize(
    ("name", "layout"), [("a.mat", "psins"), ("a.npz", "schuler"), ("a.gpx", "schuler")]
)
def test_the_same_path_makes_the_same_bytes(drive, tmp_path, monkeypatch, name, layout):
    sc.write_trajectory(drive.truth, tmp_path / name, layout=layout)
    first = (tmp_path / name).read_bytes()
    monkeypatch.setattr(time, "asctime", lambda *_: "Thu Jan  1 00:00:00 1970")
    sc.write_trajectory(drive.truth, tmp_path / name, layout=layout)
    assert (tmp_path / name).read_bytes() == first


def test_psins_has_its_array_by_name(drive, tmp_path):
    loadmat = pytest.importorskip("scipy.io").loadmat
    sc.write_trajectory(drive.truth, tmp_path / "avp.mat", layout="psins")
    avp = loadmat(str(tmp_path / "avp.mat"))["avp"]
    truth = drive.truth
    assert avp.shape == (len(truth), 10)
    np.testing.assert_allclose(avp[:, 2], truth.euler[:, 0], atol=1e-14)  # counter-clockwise
    np.testing.assert_allclose(avp[:, 3:6], truth.v_n)
    np.testing.assert_allclose(avp[:, 6:], np.column_stack([truth.position, truth.time]))


def over_the_date_line():
    lon = np.radians([179.9998, 179.9999, -180.0 + 1e-5, -179.9998])
    return sc.Trajectory(
        np.arange(4.0), np.radians([10.0, 10.1, 10.2, 10.3]), lon, np.full(4, 5.0), name="a <b> & c"
    )


def test_gpx_has_a_segment_on_each_side_of_the_date_line(tmp_path):
    gpxpy = pytest.importorskip("gpxpy")
    sc.write_trajectory(over_the_date_line(), tmp_path / "a.gpx")
    found = gpxpy.parse((tmp_path / "a.gpx").read_text(encoding="utf-8"))
    assert found.tracks[0].name == "a <b> & c"
    assert [len(segment.points) for segment in found.tracks[0].segments] == [2, 2]
    point = found.tracks[0].segments[1].points[0]
    assert (point.latitude, point.elevation, point.time) == (pytest.approx(10.2), 5.0, None)
    assert point.longitude == pytest.approx(-180.0 + 1e-5, abs=1e-9)
    assert "ellipsoid" in found.description


def test_gpx_has_times_where_the_zero_is_known(tmp_path):
    gpxpy = pytest.importorskip("gpxpy")
    about = {"utc": utc_of_zero("gps-week", "GPS week 2390")}
    sc.write_trajectory(over_the_date_line(), tmp_path / "a.gpx", about)
    found = gpxpy.parse((tmp_path / "a.gpx").read_text(encoding="utf-8"))
    times = [p.time.isoformat() for segment in found.tracks[0].segments for p in segment.points]
    # The week begins on 26 October at midnight of GPS time, eighteen seconds ahead of UTC.
    assert times[0] == "2025-10-25T23:59:42+00:00"
    assert times[3] == "2025-10-25T23:59:45+00:00"


@pytest.mark.parametrize(
    ("clock", "epoch", "zero"),
    [
        ("utc", "the stamps of topic '/fix'", 0.0),
        ("utc-week", "week 2390", 1761436800.0),
        ("gps-week", "the GPS week of 2025-11-01", 1761436782.0),
        ("utc-day", "2025-10-26", 1761436800.0),
        ("utc-day", "", None),
        ("gps-week", "", None),
        ("unstated", "", None),
        ("logger", "2025-10-26", None),
    ],
)
def test_the_zero_of_a_clock_is_that_of_its_week_or_day(clock, epoch, zero):
    assert utc_of_zero(clock, epoch) == zero


def test_kml_has_a_line_on_each_side_of_the_date_line(tmp_path):
    sc.write_trajectory(over_the_date_line(), tmp_path / "a.kml")
    space = "{http://www.opengis.net/kml/2.2}"
    found = ET.parse(tmp_path / "a.kml").getroot()
    assert found.find(f"{space}Document/{space}name").text == "a <b> & c"
    lines = [line.text.split() for line in found.iter(f"{space}coordinates")]
    assert [len(line) for line in lines] == [2, 2]
    assert [float(x) for x in lines[0][0].split(",")] == pytest.approx([179.9998, 10.0, 5.0])


@pytest.mark.parametrize(
    ("name", "layout", "words"),
    [("a.gpx", "pyins", "in the layout of pyins as '.gpx'; use .parquet"),
     ("a.mat", "schuler", "as '.mat'; use .parquet"), ("a", "schuler", "cannot write")],
)  # fmt: skip
def test_a_format_without_the_layout_is_refused(drive, tmp_path, name, layout, words):
    with pytest.raises(InputError, match=words):
        sc.write_trajectory(drive.truth, tmp_path / name, layout=layout)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "words"),
    [("[1, 2]", "line 3 is no JSON object"), ("{", "line 3 is not JSON"),
     ('{"t_s": 2.0, "lat_deg": "x"}', "line 3 lacks a number")],
)  # fmt: skip
def test_damaged_json_lines_are_named(tmp_path, line, words):
    row = '{"t_s": %d, "lat_deg": 1.0, "lon_deg": 2.0, "height_m": 3.0}\n'
    path = tmp_path / "a.jsonl"
    path.write_text(row % 0 + row % 1 + line + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        sc.read_trajectory(path)
