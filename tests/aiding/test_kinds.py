"""Heights, headings and Doppler velocities: rows that cannot be used, frames, and their files."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.aiding import BodyVelocity, HeadingFixes, Height, ZeroRate, pressure_height
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io import read_dvl, read_heading, read_height, read_speed
from tests.io import gnss_makers as make


def test_rows_that_cannot_be_used_are_counted():
    t = np.arange(8.0)
    t[5] = t[4]
    value = np.arange(8.0)
    value[1] = np.nan
    sigma = np.ones(8)
    sigma[2], sigma[3] = 0.0, 1e9
    found = Height(t[::-1], value[::-1], sigma[::-1])
    assert found.time.tolist() == [0.0, 4.0, 6.0, 7.0]
    assert found.dropped == {
        "a value that is no number": 1, "a sigma of nothing or without bound": 2,
        "a time that repeats": 1,
    }  # fmt: skip


def test_marks_of_no_value_are_left_out():
    velocity = np.tile([2.0, 0.1, 0.2], (6, 1))
    velocity[1] = -32.768
    valid = np.array([1, 1, 0, 1, np.nan, 1])
    found = BodyVelocity(np.arange(6.0), velocity, frame="FLU", valid=valid)
    assert found.dropped == {"the instrument's mark of no value": 3}
    np.testing.assert_allclose(found.velocity, np.tile([-0.1, 2.0, 0.2], (3, 1)))
    fast = BodyVelocity([0.0], [[40.0, 0.0, -33.0]])
    assert fast.velocity.tolist() == [[40.0, 0.0, -33.0]]
    again = BodyVelocity(found.time, found.velocity, found.sigma, found.frame)
    np.testing.assert_array_equal(again.velocity, found.velocity)


@pytest.mark.parametrize(
    ("make_it", "words"),
    [(lambda: Height([0.0], [np.nan]), "no usable row of 1: 1 with a value"),
     (lambda: Height([0.0, 1.0], [1.0]), "height must be of shape"),
     (lambda: Height([0.0], [1.0], offset_sigma=-1.0), "a finite sigma and a positive time"),
     (lambda: Height([0.0], [1.0], lever=(0, 0, 1e3)), "at most 100 m"),
     (lambda: Height([0.0, 1.0], [1.0, 2.0], np.ones(3)), "sigma must be a number or"),
     (lambda: HeadingFixes([0.0], [250.0]), "is it in deg"),
     (lambda: HeadingFixes([0.0], [1.0], baseline=(0, 0, 1.0)), "not along the body's up"),
     (lambda: BodyVelocity([0.0], [[1.0, 2.0, 3.0]], frame="NED"), "frame must be one of"),
     (lambda: BodyVelocity([0.0], np.ones((1, 3)), valid=[1, 0]), "valid must be of shape"),
     (lambda: BodyVelocity([0.0], [1.0]), "velocity must be of shape"),
     (lambda: BodyVelocity([0.0], np.ones((1, 3)), estimate=("delay",)), "cannot estimate delay"),
     (lambda: BodyVelocity([0.0], np.ones((1, 3)), mount=(0, 0, 9.0)), "half a turn"),
     (lambda: BodyVelocity([0.0], np.ones((1, 3)), scale=0.7), "below 0.5"),
     (lambda: ZeroRate([(3.0, 2.0)]), "not after its begin"),
     (lambda: ZeroRate([1.0, 2.0]), "rows of two times"),
     (lambda: ZeroRate([(1.0, 2.0)], window=0.0), "a window is positive")],
)  # fmt: skip
def test_what_cannot_be_is_one_sentence(make_it, words):
    with pytest.raises(InputError, match=words) as caught:
        make_it()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("height", "pressure"),
    [(0.0, 101325.0), (1000.0, 89874.6), (5000.0, 54019.9), (-300.0, 104981)],
)  # fmt: skip
def test_pressure_is_that_of_the_standard_atmosphere(height, pressure):
    """Pressures of ICAO Doc 7488, tables by geopotential altitude."""
    assert float(pressure_height(pressure)) == pytest.approx(height, abs=0.1)


def test_heights_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,pressure [hPa],sd [m]\n0,1013.25,0.5\n1,898.746,0.5\n")
    found = read_height(path, offset=10.0)
    assert found.height == pytest.approx([0.0, 1000.0], abs=0.1)
    assert found.time.tolist() == [10.0, 11.0]
    assert found.sigma.tolist() == [0.5, 0.5]
    path.write_text("time,depth [m]\n0,3\n1,4\n")
    assert read_height(path).height.tolist() == [-3.0, -4.0]
    path.write_text("time,height [ft]\n0,100\n")
    assert read_height(path, sigma=2.0).height == pytest.approx([30.48])
    for text, words in (
        ("time,depth,height\n1,2,3\n", "which of them is meant"),
        ("time,x\n1,2\n", "need a column"), ("time,pressure\n0,1013.25\n", "is the unit right"),
    ):  # fmt: skip
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            read_height(path)


def test_headings_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,heading,sd [deg]\n0,90,0.1\n1,359,0.1\n")
    found = read_heading(path, declination=2.0 * DEG)
    assert found.heading / DEG == pytest.approx([92.0, 361.0])
    assert found.sigma / DEG == pytest.approx([0.1, 0.1])
    path.write_bytes(make.nmea())
    found = read_heading(path)
    want = make.fixes()
    assert found.clock == "utc-day"
    assert found.heading == pytest.approx(0.3 + 0.05 * want["t"], abs=1e-5)
    assert found.time == pytest.approx(make.BEGIN % 86400 + want["t"], abs=1e-6)
    path.write_text("time,course\n1,2\n")
    with pytest.raises(InputError, match="one named heading"):
        read_heading(path)


def test_doppler_velocities_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time [s],DVL X [m/s],DVL Y [m/s],DVL Z [cm/s],valid\n0,2,1,3,1\n1,2,1,3,0\n")
    with pytest.raises(InputError, match="unit must be one of"):
        read_dvl(path)
    path.write_text(path.read_text().replace("cm/s", "m/s"))
    assert read_dvl(path, frame="FRD").velocity.tolist() == [[1.0, 2.0, -3.0]]
    assert read_dvl(path).velocity.tolist() == [[2.0, 1.0, 3.0]]
    path.write_text("time,vx,vy\n0,1,2\n")
    with pytest.raises(InputError, match="z not found"):
        read_dvl(path)


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_odometry_of_ros_is_forward_left_up(tmp_path, kind):
    pytest.importorskip("rosbags")
    path = make.bag(tmp_path, kind)
    with pytest.raises(InputError, match=r"several topics .* /odom, /vel; say which"):
        read_dvl(path)
    found = read_dvl(path, topic="/odom")
    np.testing.assert_allclose(found.velocity, np.tile([0.5, 12.0, 0.25], (20, 1)))
    assert found.clock == "utc"
    np.testing.assert_allclose(found.time, 1.7e9 + make.fixes()["t"], atol=1e-6)
    east = read_dvl(path, topic="/vel", frame="RFU")
    np.testing.assert_allclose(east.velocity[:, 0], make.fixes()["ve"])
    speed = read_speed(path, topic="/odom")
    np.testing.assert_allclose(speed.value, 12.0)


def test_rows_of_speeds_are_sorted_and_counted(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,speed [km/h]\n2,36\n1,72\n1,72\n3,\n4,18\n")
    found = read_speed(path)
    assert found.time.tolist() == [1.0, 2.0, 4.0]
    assert found.value == pytest.approx([20.0, 10.0, 5.0])
    assert found.dropped == {"a value that is no number": 1, "a time that repeats": 1}
