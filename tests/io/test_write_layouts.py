"""Records in the layouts of PSINS and pyins: what these tools would read is the record."""

from __future__ import annotations

import numpy as np
import pytest

import schuler as sc
from schuler.errors import InputError
from schuler.io import from_pyins
from schuler.record import ImuRecord


@pytest.fixture
def record(rng):
    n = 50
    return ImuRecord(
        100.0 + 0.01 * np.arange(1, n + 1), np.full(n, 0.01), 1e-5 * rng.standard_normal((n, 3)),
        np.array([0.0, 0.0, 0.098]) + 1e-4 * rng.standard_normal((n, 3)), name="bench",
    )  # fmt: skip


def test_psins_s_mat_has_increments_and_the_time_at_their_end(record, tmp_path):
    from scipy.io import loadmat

    path = tmp_path / "bench.mat"
    sc.write(record, path, layout="psins")
    imu = loadmat(path)["imu"]
    np.testing.assert_array_equal(imu, np.column_stack([record.dtheta, record.dvel, record.time]))
    first = path.read_bytes()
    sc.write(record, path, layout="psins")
    assert path.read_bytes() == first


def test_pyins_s_table_is_read_back_and_integrated_by_it(record, tmp_path):
    pd = pytest.importorskip("pandas")
    path = tmp_path / "bench.csv"
    sc.write(record, path, layout="pyins")
    table = pd.read_csv(path, index_col="time")
    assert list(table.columns) == ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    back = from_pyins(table, "increment", axes="FRD")
    np.testing.assert_allclose(back.dtheta, record.dtheta, rtol=1e-12)
    np.testing.assert_allclose(back.dvel, record.dvel, rtol=1e-12)
    np.testing.assert_allclose(back.time, record.time, rtol=1e-12)


def test_a_layout_or_ending_that_is_not_there_is_said(record, tmp_path):
    with pytest.raises(InputError, match="schuler, psins, pyins, got 'gtsam'"):
        sc.write(record, tmp_path / "a.csv", layout="gtsam")
    with pytest.raises(InputError, match=r"'.csv' in the layout of psins; use .mat"):
        sc.write(record, tmp_path / "a.csv", layout="psins")
    with pytest.raises(InputError, match=r"'.imu'; use .parquet, .csv, .npz"):
        sc.write(record, tmp_path / "a.imu")
