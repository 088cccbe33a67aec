"""Headers of public loggers, each with the columns and units that they mean."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.io.dialect import detect
from schuler.io.mapping import Mapping
from tests.io.conftest import Array, make_rows, make_text, same

Put = Callable[..., Path]

EUROC = ("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
         "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]")  # fmt: skip
ROS = ",".join(f"field.{v}.{a}" for v in ("angular_velocity", "linear_acceleration") for a in "xyz")
PX4 = ",".join(["timestamp", *(f"gyro_rad[{k}]" for k in range(3)),
                *(f"accelerometer_m_s2[{k}]" for k in range(3))])  # fmt: skip


@pytest.mark.parametrize(
    ("header", "gyro", "accel", "time"),
    [
        ("Time (s),Gyro X (dps),Gyro Y (dps),Gyro Z (dps),Accel X (G),Accel Y (G),Accel Z (G)",
         "dps", "G", "s"),
        ("time_s,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g", "deg/s", "g", "s"),
        ("timestamp_us,gx_mdps,gy_mdps,gz_mdps,ax_mg,ay_mg,az_mg", "mdps", "mg", "us"),
        ("TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", None, None, "us"),
        ("t_ms,wx_rad_s,wy_rad_s,wz_rad_s,fx_m_s2,fy_m_s2,fz_m_s2", "rad/s", "m/s^2", "ms"),
        ("SampleTimeFine,Gyr_X,Gyr_Y,Gyr_Z,Acc_X,Acc_Y,Acc_Z", None, None, "0.0001 s"),
        ("GPSTime (sec),GyroX (deg/s),GyroY (deg/s),GyroZ (deg/s),AccX (m/s^2),AccY (m/s^2),"
         "AccZ (m/s^2)", "deg/s", "m/s^2", "sec"),
        (EUROC, "rad s^-1", "m s^-2", "ns"),
        ("stamp," + ROS, None, None, None),
        ("%time," + ROS, None, None, None),
        (PX4, "rad/s", "m/s^2", None),
        ("imu.t,imu.gyro.x,imu.gyro.y,imu.gyro.z,imu.acc.x,imu.acc.y,imu.acc.z", None, None, None),
        ("t,angular_rate_x_deg_h,angular_rate_y_deg_h,angular_rate_z_deg_h,ax,ay,az", "deg/h",
         None, None),
        ("t,delta_angle[0],delta_angle[1],delta_angle[2],delta_velocity[0],delta_velocity[1],"
         "delta_velocity[2]", "rad", "m/s", None),
    ],
)  # fmt: skip
def test_names_and_their_units(
    header: str, gyro: str | None, accel: str | None, time: str | None, put: Put
) -> None:
    rows = make_rows(100)
    path = put(make_text(rows, header=header))
    source = open_source(path)
    m = source.mapping
    assert m.gyro == (gyro or "rad/s")
    assert m.accel == (accel or "m/s^2")
    assert m.time == (time or "s")
    plain = read(put(make_text(rows), "plain.csv"), gyro=m.gyro, accel=m.accel, time=m.time)
    assert same(source.read(), plain)


@pytest.mark.parametrize(
    ("header", "axes"),
    [(EUROC, "FLU"), ("stamp," + ROS, "FLU"), (PX4, "FRD"),
     ("TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "FRD"), ("t,gx,gy,gz,ax,ay,az", None)],
)  # fmt: skip
def test_names_that_are_a_mark_of_axes_are_said(header: str, axes: str | None, put: Put) -> None:
    path = put(make_text(make_rows(100), header=header))
    source = open_source(path)
    (first, *_) = source.assumed
    assert first.startswith("axes right-forward-up (RFU)")
    assert first.endswith(f"with --axes {axes} they are read so" if axes else "(RFU)")
    # What is said is not assumed.
    assert open_source(path, axes="FRD", gyro="deg/s", accel="g").assumed == []


def test_the_instrument_s_stamp_comes_before_the_logger_s(put: Put) -> None:
    rows = make_rows(60)
    table = np.column_stack([rows[:, 0] + 5.0, np.arange(60), rows])
    path = put(make_text(table, header="%time,field.header.seq,field.header.stamp," + ROS))
    assert read(path).start == pytest.approx(0.01)


def lines(header: list[str], delimiter: str = ",") -> str:
    return "\n".join(header) + "\n" + make_text(make_rows(60), delimiter, header=None)


@pytest.mark.parametrize(
    "text",
    [
        lines(["t,gx,gy,gz,ax,ay,az", "s,deg/s,deg/s,deg/s,g,g,g"]),
        lines(["t,gx,gy,gz,ax,ay,az", "(s),(dps),(dps),(dps),(G),(G),(G)"]),
        lines(["# t gx gy gz ax ay az", "# s deg/s deg/s deg/s g g g"], " "),
        lines(["% t,gx,gy,gz,ax,ay,az", "% [s],[deg/s],[deg/s],[deg/s],[g],[g],[g]"]),
        lines(["t gx gy gz ax ay az", "(s) (deg/s) (deg/s) (deg/s) (g) (g) (g)"], " "),
        lines(["# t [s], gx [deg/s], gy [deg/s], gz [deg/s], ax [g], ay [g], az [g]"], " "),
    ],
)
def test_units_below_the_names(text: str, put: Put) -> None:
    source = open_source(put(text))
    expected = read(put(make_text(make_rows(60)), "plain.csv"), gyro="deg/s", accel="g")
    assert same(source.read(), expected)
    assert not any(text.startswith("unit") for text in source.assumed)


def test_a_text_in_the_first_row_is_no_header(put: Put) -> None:
    rows = make_rows(60)
    body = [f"{r[0]!r},imu_link," + ",".join(map(repr, r[1:])) for r in rows.tolist()]
    path = put("\n".join(body) + "\n")
    found = read(path, columns="t,_,gx,gy,gz,ax,ay,az")
    assert same(found, read(put(make_text(rows), "plain.csv")))
    with pytest.raises(InputError, match="8 columns without names"):
        read(path)
    # A bad cell in the first row is a bad cell.
    with pytest.raises(InputError, match=r"line 1, column 3: 'err' is not a number"):
        read(put(make_text(rows, header="0.0,1e-3,err,2e-3,0.1,0.2,9.8")))


@pytest.mark.parametrize(
    ("first", "second", "names"),
    [
        ("a,b,c", "1,2,3", True),
        ("t,1,2,3", "0.1,0.2,0.3,0.4", True),
        ("1,x,3", "4,y,6", False),
        ("0.5,x,3", "4,5,6", False),
        ("2026-11-27 10:00:00,1,2", "2026-11-27 10:00:01,1,2", False),
    ],
)
def test_what_is_a_header(first: str, second: str, names: bool) -> None:
    found = detect(f"{first}\n{second}\n".encode(), True, Mapping())
    assert found.line == (2 if names else 1)
    assert (found.names is not None) == names


def test_advice_names_the_file_s_own_columns(put: Put) -> None:
    rows = make_rows(30)
    path = put(make_text(rows[:, :4], header="time,x,y,z"))
    with pytest.raises(InputError, match=r"its columns are time, x, y, z; name .*--accel-file"):
        read(path)


def rates_apart(f: float, n: int, shift: float) -> tuple[Array, Array]:
    """Return a table of gyros at 100 Hz, and one of accelerometers at another rate."""
    t = 0.01 * np.arange(1, n + 1)
    gyro = np.column_stack([t, 0.1 * np.sin(t), 0.2 * np.cos(t), 0.01 * t])
    s = shift + np.arange(int(n * 0.01 * f) + 2) / f
    return gyro, np.column_stack([s, 0.5 * s, 1.0 - 0.1 * s, 9.8 + 0.01 * s])


@pytest.mark.parametrize("f", [40.0, 100.0, 250.0])
def test_two_files_are_joined_on_the_gyros_clock(f: float, put: Put) -> None:
    gyro, accel = rates_apart(f, 500, 0.004)
    put(make_text(accel, header="time,x,y,z"), "acc.csv")
    path = put(make_text(gyro, header="time,x,y,z"), "gyro.csv")
    source = open_source(path, accel_file=str(path.parent / "acc.csv"), axes="RFU")
    found = source.read()
    # Straight lines are interpolated exactly.
    t = found.time - 0.5 * found.dt
    assert np.allclose(found.accel, np.column_stack([0.5 * t, 1 - 0.1 * t, 9.8 + 0.01 * t]),
                       rtol=0, atol=1e-12)  # fmt: skip
    assert "by linear interpolation, which lowers the white noise" in source.notes[0]
    assert same(read(path, accel_file="acc.csv", axes="RFU"), found)
    # In pieces of any size, the same bits.
    assert same(type(found).concatenate(list(source.chunks(77))), found)


def test_the_effect_on_the_noise_is_as_said(put: Put) -> None:
    rng = np.random.default_rng(3)
    n = 20_000
    t = 0.01 * np.arange(1, n + 1)
    gyro = np.column_stack([t, np.zeros((n, 3))])
    accel = np.column_stack([t - 0.005, rng.normal(size=(n, 3))])
    put(make_text(accel, header="time,x,y,z"), "acc.csv")
    path = put(make_text(gyro, header="time,x,y,z"), "gyro.csv")
    source = open_source(path, accel_file="acc.csv", mean_rates=True)
    # Half way between two: 1/sqrt(2). One run of 60,000 values: 1 sigma is 0.3 %.
    assert "white noise of a sample by 29 %" in source.notes[0]
    assert np.std(source.read().accel) == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_rows_that_alternate_are_joined(put: Put) -> None:
    gyro, accel = rates_apart(100.0, 300, 0.005)
    rows = [(r[0], ",".join([repr(r[0]), *map(repr, r[1:]), "", "", ""])) for r in gyro.tolist()]
    rows += [(r[0], ",".join([repr(r[0]), "", "", "", *map(repr, r[1:])])) for r in accel.tolist()]
    text = "t,gx,gy,gz,ax,ay,az\n" + "\n".join(line for _, line in sorted(rows)) + "\n"
    source = open_source(put(text), axes="RFU")
    found = source.read()
    assert "put on the gyros' clock" in source.notes[0]
    assert found.rate == pytest.approx(100.0)
    t = found.time - 0.5 * found.dt
    assert np.allclose(found.accel[:, 2], 9.8 + 0.01 * t, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rate": 100.0}, "joined by their stamps, which --rate replaces"),
        ({"gyro": "deg"}, "increments of two tables cannot be joined"),
        ({"accel_file": "nowhere.csv"}, "the accelerometers' file 'nowhere.csv' is not there"),
    ],
)
def test_what_cannot_be_joined(change: dict[str, object], words: str, put: Put) -> None:
    gyro, accel = rates_apart(100.0, 300, 0.005)
    put(make_text(accel, header="time,x,y,z"), "acc.csv")
    path = put(make_text(gyro, header="time,x,y,z"), "gyro.csv")
    with pytest.raises(InputError, match=words):
        open_source(path, **{"accel_file": "acc.csv", **change})


def test_a_gap_of_the_accelerometers_is_not_interpolated_over(put: Put) -> None:
    gyro, accel = rates_apart(100.0, 300, 0.005)
    put(make_text(np.delete(accel, slice(100, 130), axis=0), header="time,x,y,z"), "acc.csv")
    path = put(make_text(gyro, header="time,x,y,z"), "gyro.csv")
    with pytest.raises(InputError, match=r"'acc.csv'\) have a gap of 0.31 s after t = 0.995 s"):
        read(path, accel_file="acc.csv")
    assert read(path, accel_file="acc.csv", max_gap=1.0).duration == pytest.approx(2.99)
    put(make_text(np.add(accel, [99.0, 0, 0, 0]), header="time,x,y,z"), "acc.csv")
    with pytest.raises(InputError, match="share no time"):
        read(path, accel_file="acc.csv")
