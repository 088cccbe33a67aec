"""Tables in memory: pandas, xarray, and pyins as the oracle of its own convention."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler import InputError
from schuler.io import from_pandas, from_pyins, from_xarray, to_pyins
from schuler.record import ImuRecord
from tests.io.conftest import HEADER, Array, same

pd = pytest.importorskip("pandas")


@pytest.fixture
def record(rows: Array) -> ImuRecord:
    made = ImuRecord.from_increments(rows[:, 0], rows[:, 1:4] * 0.01, rows[:, 4:] * 0.01)
    return replace(made, coning_corrected=True, name="truck")


# -- pandas and xarray -----------------------------------------------------------------


def test_pandas_round_trip(record: ImuRecord) -> None:
    frame = record.to_pandas()
    assert list(frame.columns) == [
        "dt", *(f"d{s}_{c}" for s in ("theta", "vel") for c in "xyz"),
    ]  # fmt: skip
    assert frame.index.name == "time"
    assert frame.attrs["units"] == {"time": "s", "dt": "s", "dtheta": "rad", "dvel": "m/s"}
    assert frame.attrs["axes"] == "RFU"
    back = from_pandas(frame)
    assert same(back, record)
    assert back.name == "truck"
    with pytest.raises(InputError, match="says itself what it holds; drop 'axes'"):
        from_pandas(frame, axes="FRD")
    # A table that has lost its attributes is one of increments by its names.
    frame.attrs.clear()
    assert np.array_equal(from_pandas(frame).dtheta, record.dtheta)


def test_a_table_of_one_s_own(rows: Array) -> None:
    expected = ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:])
    frame = pd.DataFrame(rows, columns=HEADER.split(","))
    assert same(from_pandas(frame), expected)
    assert same(from_pandas(frame.set_index("t")), expected)
    renamed = frame.rename(columns={"gx": "p"})
    named = from_pandas(renamed, columns="t,p,gy,gz,ax,ay,az")
    assert same(named, expected)
    indexed = from_pandas(renamed.set_index("t"), columns="t,p,gy,gz,ax,ay,az")
    assert same(indexed, expected)
    turned = from_pandas(frame, gyro="deg/s", axes="FRD")
    assert np.allclose(turned.dtheta[:, 0], expected.dtheta[:, 1] * np.pi / 180)
    clock = from_pandas(frame.drop(columns="t"), rate=100)
    assert np.allclose(clock.time, rows[1:, 0] - rows[0, 0])


def test_tables_that_cannot_be_used(rows: Array) -> None:
    frame = pd.DataFrame(rows, columns=HEADER.split(","))
    stamped = frame.assign(t=pd.to_datetime(frame.t, unit="s"))
    with pytest.raises(InputError, match=r"column 't' is of type datetime64\[.*\], not numbers"):
        from_pandas(stamped)
    with pytest.raises(InputError, match="no column for az"):
        from_pandas(frame.drop(columns="az"))
    with pytest.raises(InputError, match="there is no time column"):
        from_pandas(frame.drop(columns="t").set_index(pd.Index(list("ab" * 20))))
    with pytest.raises(InputError, match=r"data row 2 \(t = 0\.1 s\): time goes backward"):
        from_pandas(frame.iloc[[20, 9, *range(21, 40)]])


def test_xarray_round_trip(record: ImuRecord) -> None:
    pytest.importorskip("xarray")
    dataset = record.to_xarray()
    assert dataset["dtheta"].attrs["units"] == "rad"
    assert dataset["time"].attrs["units"] == "s"
    assert dataset["dvel"].sel(accel="z").values.tolist() == record.dvel[:, 2].tolist()
    back = from_xarray(dataset)
    assert same(back, record)
    assert back.name == "truck"
    part = from_xarray(dataset.isel(time=slice(5, 20)))
    assert np.array_equal(part.dtheta, record.dtheta[5:20])
    with pytest.raises(InputError, match="the dataset has no 'dvel'"):
        from_xarray(dataset.drop_vars("dvel"))
    with pytest.raises(InputError, match=r"'dtheta' has shape \(40, 2\), expected \(40, 3\)"):
        from_xarray(dataset.isel(gyro=slice(0, 2)))
    dataset["dtheta"].attrs["units"] = "deg"
    with pytest.raises(InputError, match="'dtheta' is in deg, expected rad"):
        from_xarray(dataset)


def test_redundant_gyros_keep_their_numbers(record: ImuRecord) -> None:
    pytest.importorskip("xarray")
    four = replace(record, dtheta=np.ones((len(record), 4)))
    assert "dtheta_4" in four.to_pandas().columns
    assert four.to_xarray()["gyro"].values.tolist() == ["1", "2", "3", "4"]


def test_without_the_libraries(record: ImuRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    monkeypatch.setitem(__import__("sys").modules, "xarray", None)
    with pytest.raises(InputError, match=r"pip install 'pandas>=[0-9.]+'$"):
        record.to_pandas()
    with pytest.raises(InputError, match=r"pip install 'pandas>=[0-9.]+'$"):
        to_pyins(replace(record, coning_corrected=False))
    with pytest.raises(InputError, match=r"pip install 'pandas>=[0-9.]+' 'xarray>="):
        record.to_xarray()


# -- pyins -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["rate", "increment"])
def test_pyins_simulates_and_we_read(kind: str) -> None:
    """A body that climbs north-east with heading 30, pitch 4, roll -3 deg: by its own simulator."""
    sim = pytest.importorskip("pyins.sim")
    time = np.arange(0, 20, 0.01)
    rph = np.tile([-3.0, 4.0, 30.0], (len(time), 1))
    _, imu = sim.generate_imu(time, [50.0, 10.0, 100.0], rph, np.zeros((len(time), 3)), kind)
    record = from_pyins(imu, kind)
    # Ours: right, forward, up; pitch nose up, roll right side down, heading clockwise.
    p, r, h = np.radians([4.0, -3.0, 30.0])
    up = np.array([-np.cos(p) * np.sin(r), np.sin(p), np.cos(p) * np.cos(r)])
    force = record.dvel.sum(0) / record.duration
    assert np.allclose(force / np.linalg.norm(force), up, atol=1e-6)
    rate = record.dtheta.sum(0) / record.duration
    north = 7.292115e-5 * np.cos(np.radians(50.0))
    above = 7.292115e-5 * np.sin(np.radians(50.0))
    forward = np.array([np.sin(h) * np.cos(p), np.cos(h) * np.cos(p), np.sin(p)])
    assert rate[1] == pytest.approx(north * forward[1] + above * forward[2], abs=1e-9)
    assert np.linalg.norm(rate) == pytest.approx(7.292115e-5, rel=1e-6)
    assert record.time[0] == pytest.approx(0.01)
    assert len(record) == len(time) - 1


def test_what_pyins_gets_is_what_we_have(record: ImuRecord) -> None:
    strapdown = pytest.importorskip("pyins.strapdown")
    plain = replace(record, coning_corrected=False)
    imu = to_pyins(plain)
    assert len(imu) == len(plain) + 1
    assert imu.index[0] == plain.start
    increments = strapdown.compute_increments_from_imu(imu, "increment")
    assert np.allclose(increments["dt"], plain.dt, rtol=1e-9)
    # Its vectors are front, right, down; its corrections are small of the second order.
    theta = increments[["theta_y", "theta_x", "theta_z"]].to_numpy() * [1, 1, -1]
    assert np.allclose(theta, plain.dtheta, rtol=0, atol=1e-8)
    back = from_pyins(imu, "increment", name="truck")
    assert np.array_equal(back.dtheta, plain.dtheta)
    assert np.array_equal(back.dvel, plain.dvel)
    assert np.allclose(back.time, plain.time, rtol=0, atol=0)
    flu = to_pyins(plain, axes="FLU")
    assert np.array_equal(from_pyins(flu, "increment", axes="FLU").dvel, plain.dvel)


def test_pyins_errors(record: ImuRecord) -> None:
    plain = replace(record, coning_corrected=False)
    imu = to_pyins(plain)
    with pytest.raises(InputError, match="'rate' or 'increment', got 'rates'"):
        from_pyins(imu, "rates")
    with pytest.raises(InputError, match="has no gyro_z; pyins names them"):
        from_pyins(imu.drop(columns="gyro_z"), "rate")
    with pytest.raises(InputError, match="has 1 rows: at least two"):
        from_pyins(imu.iloc[:1], "rate")
    with pytest.raises(InputError, match="time does not advance after row 1"):
        from_pyins(imu.iloc[::-1], "increment")
    with pytest.raises(InputError, match="must be numbers"):
        from_pyins(imu.set_index(pd.Index(["x"] * len(imu))), "rate")
    with pytest.raises(InputError, match="are corrected already"):
        to_pyins(record)
    with pytest.raises(InputError, match=r"a hole before t = 0\.31 s"):
        to_pyins(replace(plain, time=plain.time - np.repeat([1.0, 0.0], [30, 10])))
    with pytest.raises(InputError, match="three gyros and three accelerometers"):
        to_pyins(replace(plain, dtheta=np.ones((40, 4))))
