"""Each kind of bad input of an aid: one sentence with numbers, or rows left out and counted."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.aiding import CLOCKS, BodySpeed, GnssFixes, no_overlap
from schuler.aiding.checks import check_speed, inside
from schuler.aiding.consistency import consistency
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.io import read_gnss
from schuler.record import ImuRecord

RADIUS = 6.37e6


def drive(n=240, lat=40.0, lon=10.0, velocity=True):
    """Return fixes at 4 Hz of a level bend with a hill, 12 m/s."""
    t = 0.25 * np.arange(n)
    course = 0.4 + 0.02 * t
    v = 12.0 * np.column_stack([np.sin(course), np.cos(course), 0.1 * np.sin(0.2 * t)])
    place = np.cumsum(0.125 * (v[1:] + v[:-1]), axis=0)
    place = np.vstack([np.zeros(3), place])
    here = {
        "lat": lat * DEG + place[:, 1] / RADIUS,
        "lon": lon * DEG + place[:, 0] / (RADIUS * np.cos(lat * DEG)),
        "height": 100.0 + place[:, 2],
    }
    return {"time": t, **here, "sigma": 0.05, **({"v_n": v, "v_sigma": 0.05} if velocity else {})}


def test_a_good_drive_is_not_doubted():
    fixes = GnssFixes(**drive())
    assert fixes.contradictions() == []
    assert fixes.dropped == {}
    assert fixes.notes == ()


def test_rows_out_of_order_are_sorted_and_said():
    made = drive()
    order = np.arange(240)
    order[50:60] = order[50:60][::-1]
    fixes = GnssFixes(**{k: v[order] if np.ndim(v) else v for k, v in made.items()})
    assert np.all(np.diff(fixes.time) > 0.0)
    assert fixes.notes == ("9 times go back: the rows were sorted",)
    assert fixes.rows(np.arange(100)).notes == fixes.notes


@pytest.mark.parametrize("velocity", [True, False])
def test_stale_fixes_are_dropped(velocity):
    made = drive(velocity=velocity)
    for name in ("lat", "lon", "height"):
        made[name][100:112] = made[name][100]
    found = GnssFixes(**made)
    reason = "stands while the velocity" if velocity else "stands and then jumps"
    (said,) = found.dropped
    assert reason in said
    # With a velocity all but the first are known to be stale, else all after the second.
    assert len(found) == 240 - (11 if velocity else 10)
    assert len(found.rows(np.arange(200))) == 200


def test_a_vehicle_that_rests_is_not_stale():
    made = drive(velocity=False)
    for name in ("lat", "lon", "height"):
        made[name][:100] = made[name][100]
    assert GnssFixes(**made).dropped == {}


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda m: {"lat": m["lat"] * DEG, "lon": m["lon"] * DEG}, "in rad, read as deg"),
     (lambda m: {"lat": m["lon"], "lon": m["lat"]}, "latitude and longitude seem exchanged"),
     (lambda m: {"v_n": m["v_n"][:, [1, 0, 2]] * [1, 1, -1]}, "components seem exchanged"),
     (lambda m: {"v_n": m["v_n"] * [1, 1, -1]}, "down read as up"),
     (lambda m: {"v_n": -m["v_n"]}, "south, west read as north, east"),
     (lambda m: {"v_n": 3.6 * m["v_n"]}, "in km/h, read as m/s")],
)  # fmt: skip
def test_what_positions_say_of_velocities(change, words):
    made = drive()
    found = GnssFixes(**{**made, **change(made)}).contradictions()
    assert any(words in text for text in found), found
    assert all("m/s" in text for text in found)


def test_latitudes_that_are_no_angle_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(f"{k},{10 + 1e-5 * k},{140.0},100\n" for k in range(9))
    path.write_text("time,lat,lon,height\n" + rows)
    assert len(read_gnss(path)) == 9
    path.write_text("time,lon,lat,height\n" + rows)
    with pytest.raises(InputError, match="latitude and longitude are not exchanged"):
        read_gnss(path)


@pytest.mark.parametrize("lever", [(0, 101.0, 0), (0, np.nan, 0), (1.0, 2.0)])
def test_a_lever_arm_is_short(lever):
    with pytest.raises(InputError, match="at most 100 m"):
        GnssFixes(**drive(), lever=lever)
    with pytest.raises(InputError, match="at most 100 m"):
        BodySpeed([0.0, 1.0], [0.0, 1.0], lever=lever)


@pytest.mark.parametrize(
    ("speed", "words"),
    [(lambda v: 3.6 * v, "in km/h"), (lambda v: -v, "its sign is turned"),
     (lambda v: 2.2369 * v, "in mph"), (lambda v: 1.6 * v, "1.6 times theirs"),
     (lambda v: np.column_stack([v, 0.1 * v, 0.0 * v]), "say its frame, as FRD")],
)  # fmt: skip
def test_speeds_are_held_against_the_fixes(speed, words):
    gnss = GnssFixes(**drive())
    time = np.arange(-1.0, 70.0, 0.1)
    with pytest.raises(InputError, match=words):
        check_speed(BodySpeed(time, speed(np.full(len(time), 12.0))), gnss)


def test_good_speeds_are_taken():
    """Nothing is raised."""
    gnss = GnssFixes(**drive())
    time = np.arange(-1.0, 70.0, 0.1)
    forward = np.full(len(time), 12.1)
    check_speed(BodySpeed(time, forward), gnss)
    check_speed(BodySpeed(time, np.column_stack([-0.3 * forward, forward, 0 * time])), gnss)
    # Too slow, too few, or no velocity: nothing is said.
    check_speed(BodySpeed(time, 9.0 * forward), GnssFixes(**drive(velocity=False)))
    check_speed(BodySpeed(time[:20], 9.0 * forward[:20]), gnss)


@pytest.mark.parametrize(
    ("off", "words"),
    [(18.0, "1 x 18 s: the leap seconds"), (-18.0, "-1 x 18 s"),
     (7200.0, "2 x 3600 s: a time zone"),
     (172800.0, "2 x 86400 s: seconds of the day"), (604800.0 * 2300, "2300 x 604800 s: weeks"),
     (315964800.0, "since 1970")],
)  # fmt: skip
def test_clocks_apart_are_named_with_the_cause(off, words):
    text = str(no_overlap("gnss", "gps-week", (5.0 + off, 11.0 + off), (5.0, 10.0)))
    assert words in text
    assert "seconds of the GPS week" in text
    assert "from t = " in text
    assert "\n" not in text


def test_no_cause_is_invented():
    text = str(no_overlap("gnss", "unstated", (1234.5, 1300.0), (0.0, 10.0)))
    assert "near" not in text


def test_an_aid_outside_the_record_is_refused():
    record = ImuRecord(np.arange(1.0, 11.0), np.ones(10), np.zeros((10, 3)), np.zeros((10, 3)))
    assert inside("dvl", np.arange(20.0), record).sum() == 10
    with pytest.raises(InputError, match="dvl: its times, seconds of the day in UTC"):
        inside("dvl", 86400.0 + np.arange(20.0), record, "utc-day")
    assert set(CLOCKS) >= {"unstated", "utc-day"}


@pytest.mark.parametrize("late", [-0.31, 0.0, 0.12])
def test_the_lag_of_velocities_is_found(late, rng):
    t = np.arange(0.0, 100.0, 0.2)
    speed = lambda x: 10.0 + 4.0 * np.sin(0.4 * x)  # noqa: E731
    north = 10.0 * t - 10.0 * (np.cos(0.4 * t) - 1.0) + 0.01 * rng.standard_normal(len(t))
    v = np.column_stack([0.0 * t, speed(t - late), 0.0 * t]) + 0.02 * rng.standard_normal((500, 3))
    found = consistency(GnssFixes(t, 0.7 + north / RADIUS, 0.0 * t, 0.0 * t, 0.1, v))
    assert found.lag == pytest.approx(late, abs=0.02)
    assert found.rms_at_lag[1] < 0.2
    assert found.pairs == 499
