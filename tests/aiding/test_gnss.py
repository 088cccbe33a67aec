"""Fixes that cannot be, and what positions say of their velocities."""

from dataclasses import replace

import numpy as np
import pytest

from schuler.aiding import BodySpeed, GnssFixes, find_rest
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io import read_gnss, read_speed
from schuler.record import ImuRecord


def circle(n=200, speed=10.0):
    t = 0.25 * np.arange(n)
    v = speed * np.column_stack([np.cos(0.1 * t), np.sin(0.1 * t), 0.05 * np.cos(0.3 * t)])
    place = np.cumsum(v * 0.25, axis=0)
    lat = 40.0 * DEG + place[:, 1] / 6.36e6
    return t, lat, 0.2 + place[:, 0] / (6.386e6 * np.cos(lat)), 100.0 + place[:, 2], v


def test_rows_that_cannot_be_fixes_are_counted():
    t, lat, lon, height, v = circle()
    lat[3] = np.nan
    lat[5] = lon[5] = 0.0
    sigma = np.full((200, 3), 0.5)
    sigma[7], sigma[8] = 0.0, 1e9
    t[11] = t[10]
    for x in (lat, lon, height):
        x[20:24] = x[20]
    found = GnssFixes(t, lat, lon, height, sigma, v)
    assert found.dropped == {
        "a value that is no number": 1, "latitude and longitude zero": 1,
        "a sigma of nothing or of kilometres": 2, "a time that repeats": 1,
        "a position that stands while the velocity does not": 3,
    }  # fmt: skip
    assert len(found) == 200 - 8
    assert found.describe()["rate_hz"] == pytest.approx(4.0)


def test_positions_are_held_against_velocities():
    t, lat, lon, height, v = circle()
    assert GnssFixes(t, lat, lon, height, 0.02, v, 0.1).contradictions() == []
    turned = v * [1.0, 1.0, -1.0]
    steep = 100.0 + 5.0 * np.sin(0.3 * t)
    up = np.gradient(steep, t)
    said = GnssFixes(t, lat, lon, steep, 0.02, np.c_[turned[:, :2], -up], 0.05).contradictions()
    assert len(said) == 1
    assert "its sign seems turned" in said[0]
    said = GnssFixes(t, lat, lon, height, 0.02, v[:, [1, 0, 2]], 0.05).contradictions()
    assert any("components seem exchanged" in text for text in said)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"lat": np.full(4, 40.0)}, "which is no place"), ({"lever": (0, 200.0, 0)}, "at most 100 m"),
     ({"estimate": ("scale",)}, "cannot estimate scale"), ({"delay": 30.0}, "less than 10 s"),
     ({"height": np.zeros(3)}, "height must be of shape"),
     ({"lon": np.full(4, np.nan)}, "fewer than two usable fixes of 4")],
)  # fmt: skip
def test_bad_fixes_are_one_sentence(change, words):
    good = {"time": np.arange(4.0), "lat": np.full(4, 0.7), "lon": np.full(4, 0.1),
            "height": np.zeros(4)}  # fmt: skip
    with pytest.raises(InputError, match=words):
        GnssFixes(**{**good, **change})


CSV = "time [s],lat [deg],lon [deg],alt [m],vn [m/s],ve [m/s],vd [m/s],sd_e [m],sd_n [m],sd_u [m]\n"
POS = (
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
    "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"
    "2025/07/08 12:00:0{}.500   40.0   10.0   100.0   1  12   0.2   0.1   0.3   0   0   0  0.0  9\n"
)


def test_known_texts_agree(tmp_path):
    rows = "".join(f"{216000.5 + k},40,10,{100 + k},1,2,-3,0.1,0.2,0.3\n" for k in range(3))
    (tmp_path / "a.csv").write_text(CSV + rows)
    head, row = POS.splitlines(keepends=True)
    (tmp_path / "b.pos").write_text(head + "".join(row.format(k) for k in range(3)))
    (tmp_path / "c.txt").write_text(
        "".join(
            f"{216000.5 + k} 40 10 {100 + k} 0.2 0.1 0.3 1 2 -3 0.1 0.1 0.1\n" for k in range(3)
        )
    )
    csv, pos, text = (read_gnss(tmp_path / name) for name in ("a.csv", "b.pos", "c.txt"))
    for one in (csv, pos, text):
        assert one.time == pytest.approx(216000.5 + np.arange(3.0))
        assert one.lat == pytest.approx(40.0 * DEG)
        assert one.sigma[0] == pytest.approx([0.1, 0.2, 0.3])
    for one in (csv, text):
        assert one.v_n[0] == pytest.approx([2.0, 1.0, 3.0])
    assert pos.v_n is None


@pytest.mark.parametrize(
    ("text", "words"),
    [("a,b\n1,2\n", "lat, lon, height not found"), ("time,lat,lon,height\n1,2,x,4\n", "'x' is not"),
     ("time,lat,lon,height\n1,2\n", "row 1 has 2 cells of 4"), ("", "no rows"),
     ("time,lat [parsec],lon,height\n1,2,3,4\n", "parsec"),
     ("1 2 3 4 5 6 7 8\n", "7, 10 or 13")],
)  # fmt: skip
def test_a_bad_file_is_one_sentence(tmp_path, text, words):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_gnss(path)
    with pytest.raises(InputError, match="ellipsoid or geoid, got 'sea'"):
        read_gnss(path, height="sea")


def test_a_receiver_s_centimetre_is_doubled_once(tmp_path):
    rows = "".join(f"{k},40,10,{100 + k},0.01,0.01,0.03\n" for k in range(6))
    path = tmp_path / "rtk.csv"
    path.write_text("time,lat,lon,height,sd_e [m],sd_n [m],sd_u [m]\n" + rows)
    found = read_gnss(path)
    for one in (found, found.rows(np.arange(4)), replace(found, estimate=("delay",))):
        assert one.sigma[0] == pytest.approx([0.02, 0.02, 0.03])


def test_speeds(tmp_path):
    (tmp_path / "o.csv").write_text("time,speed [km/h]\n0,36\n1,72\n")
    found = read_speed(tmp_path / "o.csv", estimate=("scale",))
    assert found.value == pytest.approx([10.0, 20.0])
    with pytest.raises(InputError, match="does not advance"):
        BodySpeed([1.0, 1.0], [0.0, 0.0])


def test_rest_is_found_by_its_noise(rng):
    n = 4000
    accel = np.array([0.0, 0.0, 9.81]) + 0.02 * rng.standard_normal((n, 3))
    gyro = 0.01 + 1e-3 * rng.standard_normal((n, 3))
    move = slice(1000, 3000)
    accel[move] += np.sin(0.05 * np.arange(2000))[:, None]
    gyro[move] += 0.02 * rng.standard_normal((2000, 3))
    dt = np.full(n, 0.01)
    record = ImuRecord(0.01 * np.arange(1, n + 1), dt, gyro * 0.01, accel * 0.01)
    found = find_rest(record)
    assert found.spans == pytest.approx(np.array([[0.0, 10.0], [30.0, 40.0]]), abs=1.0)
    assert found.rate.mean(axis=0) == pytest.approx(0.01, abs=1e-4)
    with pytest.raises(InputError, match="windows"):
        find_rest(record.between(0.0, 1.0))
