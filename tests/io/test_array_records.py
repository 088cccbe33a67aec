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


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz", ".mat", ".h5"])
def test_each_format_holds_all_gyros(array, rng, tmp_path, suffix):
    if suffix == ".h5":
        pytest.importorskip("h5py")
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


def rates_of(rng, n=300):
    """Return time, five gyros and three forces, (n, 9): mean rates, as another program has them."""
    gyros = named_array("cone5").h @ rng.standard_normal((3, n))
    rows = [0.01 * np.arange(1, n + 1), *gyros, *np.zeros((2, n))]
    return np.column_stack([*rows, np.full(n, 9.8)])


def saved_npz(path, rows):
    np.savez(path, t=rows[:, 0], gyro=rows[:, 1:6], accel=rows[:, 6:])


def saved_npy(path, rows):
    np.save(path, rows)


def saved_fields(path, rows):
    names = ["t", *(f"g{k}" for k in range(1, 6)), "ax", "ay", "az"]
    np.save(path, np.rec.fromarrays(rows.T, names=names))


def saved_mat(path, rows):
    from scipy.io import savemat

    savemat(path, {"imu": {"t": rows[:, 0], "wb": rows[:, 1:6], "fb": rows[:, 6:]}})


def saved_hdf5(path, rows):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, part in (("t", rows[:, 0]), ("gyro", rows[:, 1:6]), ("accel", rows[:, 6:])):
            file[name] = part.T


def saved_gzip(path, rows):
    import gzip

    names = ",".join(["t", *(f"g{k}" for k in range(1, 6)), "ax", "ay", "az"])
    lines = [names, *(",".join(map(repr, row)) for row in rows.tolist())]
    path.write_bytes(gzip.compress("\n".join(lines).encode()))


@pytest.mark.parametrize(
    ("name", "save"),
    [("r.npz", saved_npz), ("r.npy", saved_npy), ("f.npy", saved_fields), ("r.mat", saved_mat),
     ("r.h5", saved_hdf5), ("r.csv.gz", saved_gzip)],
)  # fmt: skip
def test_files_of_other_programs_hold_all_gyros(tmp_path, rng, name, save):
    """Five gyros of a cone are read, each along its own axis, and fused."""
    rows = rates_of(rng)
    save(tmp_path / name, rows)
    options = {"array": "cone5", "gyro": "rad/s", "accel": "m/s^2", "mean_rates": True}
    if name == "r.npy":
        options["columns"] = (1, 2, 3, 4, 5, 6, 7, 8, 9)
    _, increments, interval = array_increments(open_source(tmp_path / name, **options))
    assert interval == pytest.approx(0.01)
    np.testing.assert_allclose(increments, rows[:, 1:6] * 0.01, rtol=1e-12)
    fused = sc.read(tmp_path / name, **options)
    back = rows[:, 1:6] @ named_array("cone5").estimator().T * 0.01
    np.testing.assert_allclose(fused.dtheta, back, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("suffix", [".mat", ".h5"])
def test_arrays_are_written_bit_for_bit_with_their_flags(tmp_path, rng, suffix):
    if suffix == ".h5":
        pytest.importorskip("h5py")
    r = record_of(rng, 7)
    r = sc.ImuRecord(r.time, r.dt, r.dtheta, r.dvel, name="λ", coning_corrected=True)
    sc.write(r, tmp_path / f"a{suffix}")
    sc.write(r, tmp_path / f"b{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
    back = sc.read(tmp_path / f"a{suffix}")
    assert (back.name, back.coning_corrected, back.sculling_corrected) == ("λ", True, False)
    for key in ("time", "dt", "dtheta", "dvel"):
        np.testing.assert_array_equal(getattr(back, key), getattr(r, key))
    with pytest.raises(InputError, match="schuler"):
        sc.read(tmp_path / f"a{suffix}", gyro="deg")


def test_a_description_that_is_no_text_is_damage(tmp_path):
    from scipy.io import savemat

    t = 0.01 * np.arange(1, 20)
    arrays = {"time": t, "dt": np.full(19, 0.01), "dtheta": np.ones((19, 3)),
              "dvel": np.ones((19, 3))}  # fmt: skip
    for description in (np.array([1.0, 2.0]), np.frombuffer(b"{", np.uint8)):
        savemat(tmp_path / "r.mat", {**arrays, "schuler": description})
        with pytest.raises(InputError, match=r"the array 'schuler' is damaged"):
            sc.read(tmp_path / "r.mat")
