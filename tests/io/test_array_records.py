"""Records with a column for each gyro of an array: written, read, fused, and read unfused."""

from __future__ import annotations

import numpy as np
import pytest

import schuler as sc
from schuler.errors import InputError
from schuler.io import array_increments, open_source
from schuler.sensors import named_array


@pytest.fixture(params=["symmetric4", "cone5", "dodecahedron"])
def array(request):
    return named_array(request.param)


def record_of(rng, n=200):
    t = 0.01 * np.arange(1, n + 1)
    return sc.ImuRecord(
        t, np.full(n, 0.01), 1e-4 * rng.standard_normal((n, 3)),
        0.0981 + 1e-4 * rng.standard_normal((n, 3)),
    )  # fmt: skip


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_each_format_holds_all_gyros(array, rng, tmp_path, suffix):
    triad = record_of(rng)
    many = array.measure(triad)
    path = tmp_path / f"r{suffix}"
    sc.write(many, path)
    back = sc.read(path, array=array.name)
    np.testing.assert_allclose(back.dtheta, triad.dtheta, atol=1e-12)
    np.testing.assert_array_equal(back.dvel, triad.dvel)
    np.testing.assert_array_equal(back.dt, triad.dt)
    time, increments, interval = array_increments(open_source(path, array=array.name))
    np.testing.assert_array_equal(increments, many.dtheta)
    np.testing.assert_array_equal(time, many.time)
    assert interval == pytest.approx(0.01)
    with pytest.raises(InputError, match="--array"):
        sc.read(path)
    sc.write(triad, path)
    source = open_source(path)
    with pytest.raises(InputError, match="name the array"):
        array_increments(source)


def test_three_gyros_are_written_as_before(rng, tmp_path):
    sc.write(record_of(rng), tmp_path / "r.csv")
    head = (tmp_path / "r.csv").read_text(encoding="utf-8").splitlines()[:2]
    assert "gyros" not in head[0]
    assert head[1].startswith("t [s],dt [s],gx [rad]")


def test_less_than_three_are_not_written(rng, tmp_path):
    r = record_of(rng)
    with pytest.raises(InputError, match="three gyros or more"):
        sc.write(sc.ImuRecord(r.time, r.dt, r.dtheta[:, :2], r.dvel), tmp_path / "r.csv")


def test_rates_become_increments(tmp_path, rng):
    t = 0.01 * np.arange(300)
    rates = rng.standard_normal((300, 4))
    rows = np.column_stack([t, rates, np.zeros((300, 2)), np.full(300, 9.8)])
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="t,g1,g2,g3,g4,ax,ay,az",
               comments="")  # fmt: skip
    source = open_source(tmp_path / "r.csv", array="symmetric4", gyro="deg/s", accel="m/s^2")
    _, increments, _ = array_increments(source)
    np.testing.assert_allclose(increments, np.deg2rad(rates) * 0.01, rtol=1e-9)
    rows[7, 2] = np.nan
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="t,g1,g2,g3,g4,ax,ay,az",
               comments="")  # fmt: skip
    source = open_source(tmp_path / "r.csv", array="symmetric4", gyro="deg/s", accel="m/s^2")
    with pytest.raises(InputError, match="row 8"):
        array_increments(source)
