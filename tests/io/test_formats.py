"""Formats other than text: what they say, that they agree, and that damage is named."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from schuler import InputError, open_source, read, write
from schuler.record import ImuRecord
from tests.io.conftest import HEADER, Array, make_text, same

Put = Callable[..., Path]
NAMES = HEADER.split(",")


def rates(rows: Array) -> ImuRecord:
    return ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:7])


def fails(path: Path, part: str, **options: object) -> None:
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


# -- PSINS -----------------------------------------------------------------------------

PSINS = """% PSINS-format SIMU log file.
% more
0 0 -90.6 0 0 0
34.25 108.9 380 5 10 9.78
0.1 0.1 0.2 125 125 250
"""


def psins_text(n: int = 20, head: str = PSINS) -> tuple[str, Array]:
    counts = np.random.default_rng(3).integers(-90, 90, (n, 6))
    return head + "\n".join("  ".join(map(str, row)) for row in counts.tolist()) + " \n", counts


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("name", ["log.imu", "log.txt"])
def test_psins(put: Put, end: str, name: str) -> None:
    text, counts = psins_text()
    source = open_source(put(text.replace("\n", end), name))
    record = source.read()
    assert source.format == "psins"
    assert source.position == (34.25, 108.9, 380.0)
    assert source.kind == "increments"
    assert source.meaning == (
        "increments in counts of 0.1/0.1/0.2 arcsec and 125/125/250 ug*s (g = 9.78 m/s^2), "
        "axes RFU, time from the rate 100 Hz, starting at 5 s"
    )
    # An independent reckoning of the counts' sizes.
    angle = counts[:, :3] * [0.1, 0.1, 0.2] * np.pi / 180 / 3600
    velocity = counts[:, 3:] * [125e-6, 125e-6, 250e-6] * 9.78
    assert np.allclose(record.dtheta, angle, rtol=1e-14, atol=0)
    assert np.allclose(record.dvel, velocity, rtol=1e-14, atol=0)
    assert np.allclose(record.time, 5 + 0.01 * np.arange(1, 21), rtol=0, atol=1e-12)


def test_psins_options_win(put: Put) -> None:
    text, counts = psins_text()
    record = read(put(text, "a.imu"), gyro="1 arcsec", axes="FRD", start_time=0, rate=50)
    arcsec = np.pi / 180 / 3600
    assert np.allclose(record.dtheta[:, 0], counts[:, 1] * arcsec, rtol=1e-14)
    assert np.allclose(record.dvel[:, 0], counts[:, 4] * 125e-6 * 9.78, rtol=1e-14)
    assert record.time[-1] == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("0 0 -90.6 0 0 0", "0 0 -90.6 0 0", r"line 3: PSINS header row 1 \(attitude"),
        ("34.25 108.9", "134.25 108.9", "no position in degrees"),
        ("380 5 10", "380 5 0", "interval is 0 ms"),
        ("10 9.78", "10 0.978", "g is 0.978"),
        ("0.1 0.1 0.2", "0.1 0 0.2", "size of a count is zero"),
        ("0.1 0.1 0.2", "0.1 x 0.2", "line 5: PSINS header row 3"),
    ],
)
def test_psins_header_errors(put: Put, old: str, new: str, part: str) -> None:
    fails(put(psins_text(head=PSINS.replace(old, new))[0], "a.imu"), part)


def test_psins_row_errors(put: Put) -> None:
    text = psins_text()[0]
    fails(put(PSINS, "a.imu"), "no data rows")
    fails(put("\n".join(PSINS.split("\n")[:4]) + "\n", "a.imu"), "2 of its 3 rows")
    fails(put(text + "1 2 3\n", "a.imu"), "line 26 has 3 cells, expected 6")
    fails(put(text + "1 2 3 4 5 6.x\n", "a.imu"), "line 26, column 'az': '6.x'")
    fails(put("1 2 3 4 5 6\n", "a.imu"), "no PSINS header")


# -- Parquet ---------------------------------------------------------------------------


def table(rows: Array, names: list[str] | None = None) -> pa.Table:
    return pa.table(list(rows.T), names=names or NAMES)


@pytest.mark.parametrize("name", ["a.parquet", "a.csv", "a"])
def test_parquet(tmp_path: Path, rows: Array, name: str) -> None:
    wide = table(rows).append_column("label", pa.array(["x"] * len(rows)))
    pq.write_table(wide, tmp_path / name, row_group_size=7)
    source = open_source(tmp_path / name)
    assert (source.format, source.rows) == ("parquet", len(rows))
    assert same(source.read(), rates(rows))
    assert source.progress == 1.0


def test_parquet_types_and_units(tmp_path: Path, rows: Array) -> None:
    names = ["t [ms]", *(f"g{c} [deg/s]" for c in "xyz"), *(f"a{c} [g]" for c in "xyz")]
    data = table(rows * ([1000.0] + [1.0] * 6), names)
    data = data.set_column(1, names[1], pa.array(rows[:, 1].astype(np.float32)))
    ints = [None if i == 4 else 5 for i in range(len(rows))]
    data = data.set_column(4, names[4], pa.array(ints, pa.int32()))
    pq.write_table(data, tmp_path / "a.parquet")
    record = read(tmp_path / "a.parquet")
    assert record.quality is not None
    assert record.quality.not_finite == 1
    assert np.allclose(record.accel[:, 0], 5 * 9.80665)
    expected = rows[:, 1].astype(np.float32)[:2].mean() * np.pi / 180
    assert record.gyro[0, 0] == pytest.approx(expected, rel=1e-6)


def test_parquet_errors(tmp_path: Path, rows: Array) -> None:
    path = tmp_path / "a.parquet"
    stamps = pa.array(np.arange(len(rows)), pa.timestamp("ns"))
    pq.write_table(table(rows).set_column(0, "t", stamps), path)
    fails(path, r"column 't' is of type timestamp\[ns\], not numbers")
    pq.write_table(table(rows).rename_columns(["t", *"abcdef"]), path)
    fails(path, "no column for gx, gy, gz, ax, ay, az")
    pq.write_table(table(rows[:0]), path)
    fails(path, "no data rows")
    pq.write_table(table(rows).replace_schema_metadata({"schuler": "[1"}), path)
    fails(path, "metadata is damaged")
    pq.write_table(table(rows), path)
    whole = path.read_bytes()
    for content in (whole[: len(whole) // 2], whole[:4], b"PAR1" + bytes(100) + b"PAR1"):
        path.write_bytes(content)
        fails(path, "damaged or truncated Parquet")
    path.write_text("t,gx\n")
    fails(path, "damaged or truncated Parquet")
    hole = bytearray(whole)
    hole[4:200] = bytes(196)
    path.write_bytes(bytes(hole))
    fails(path, "damaged or truncated Parquet")


# -- npz -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.npz", "a.dat"])
def test_npz(tmp_path: Path, rows: Array, name: str) -> None:
    with (tmp_path / name).open("wb") as file:
        np.savez_compressed(file, t=rows[:, :1], gyro=rows[:, 1:4], acc=rows[:, 4:].T, extra="x")
    source = open_source(tmp_path / name)
    assert (source.format, source.rows) == ("npz", len(rows))
    assert same(source.read(), rates(rows))


def test_npz_names_and_kinds(tmp_path: Path, rows: Array) -> None:
    path = tmp_path / "a.npz"
    t, w, f = rows[:, 0], rows[:, 1:4], rows[:, 4:]
    np.savez(path, q=w, p=f, clock=t)
    assert same(read(path, variables={"gyro": "q", "accel": "p", "time": "clock"}), rates(rows))
    assert read(path, variables="gyro=q,accel=p", rate=100).time[0] == 0.01
    np.savez(path, imu=rows[:, ::-1])
    assert same(read(path, columns="az,ay,ax,gz,gy,gx,t"), rates(rows))
    np.savez(path, imu=rows, other=rows)
    assert same(read(path, variables="matrix=imu"), rates(rows))
    np.savez(path, time=t, dtheta=w, dvel=f)
    source = open_source(path)
    assert source.meaning.startswith("increments in rad and m/s")
    assert same(source.read(), ImuRecord.from_increments(t, w, f))
    np.savez(path, gyro=np.ones((9, 3), np.int16), accel=np.ones((9, 3), np.int16))
    record = read(path, rate=10, gyro="0.05 deg/s", accel="2 g")
    assert np.allclose(record.accel, 2 * 9.80665)


@pytest.mark.parametrize(
    ("arrays", "options", "part"),
    [
        ({"w": (9, 3)}, {}, "no array for the accel was found among w"),
        ({"gyro": (9, 3), "accel": (9, 3)}, {}, "no time array"),
        ({"gyro": (9, 3), "accel": (8, 3), "t": (9,)}, {}, "'gyro' has 9 rows, but 'accel' has 8"),
        ({"gyro": (9, 3), "accel": (9, 3), "t": (8,)}, {}, "expected 9 values"),
        ({"gyro": (9, 2), "accel": (9, 3), "t": (9,)}, {}, r"'gyro' has shape \(9, 2\)"),
        ({"gyro": (0, 3), "accel": (0, 3), "t": (0,)}, {}, "no data rows"),
        ({"gyro": (9, 3), "w": (9, 3), "acc": (9, 3), "t": (9,)}, {}, "gyro, w could all be"),
        ({"gyro": (9, 3)}, {"variables": "gyro=g,accel=a"}, "no array 'g' for gyro; .* gyro"),
        ({"m": (9, 5, 2)}, {"variables": "matrix=m"}, "expected a table of columns"),
        ({"m": (9, 9)}, {}, "9 columns without names"),
    ],
)
def test_npz_errors(
    tmp_path: Path, arrays: dict[str, tuple[int, ...]], options: dict[str, object], part: str
) -> None:
    np.savez(tmp_path / "a.npz", **{key: np.ones(shape) for key, shape in arrays.items()})
    fails(tmp_path / "a.npz", part, **options)


def test_npz_damage_and_pickles(tmp_path: Path, rows: Array) -> None:
    path = tmp_path / "a.npz"
    objects = np.array([[{}, {}, {}]] * 9, dtype=object)
    np.savez(path, gyro=objects, accel=rows[:9, 4:], t=rows[:9, 0])
    fails(path, "'gyro' holds Python objects, which are not loaded for safety")
    np.savez(path, gyro=np.array([["a"] * 3] * 9), accel=rows[:9, 4:], t=rows[:9, 0])
    fails(path, "'gyro' is of type <U1, not real numbers")
    np.savez(path, gyro=rows[:, 1:4], accel=rows[:, 4:], t=rows[:, 0])
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    fails(path, "not an npz archive, or a truncated one")
    for place in (200, 300):
        path.write_bytes(whole[:place] + b"\xaa\xaa" + whole[place + 2 :])
        fails(path, "is damaged")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("gyro.npy", b"nonsense")
        archive.writestr("accel.npy", b"\x93NUMPY\x01\x00\x10\x00{'descr': 'x'}  ")
        archive.writestr("t.npy", b"")
    fails(path, "damaged|not real numbers|holds Python")
    np.savez(path, t=rows[:, 0], dt=rows[:, 0], dtheta=rows[:, 1:4], dvel=rows[:, 4:], schuler="{")
    fails(path, "array 'schuler' is damaged")


# -- MATLAB ----------------------------------------------------------------------------


def test_mat_5(tmp_path: Path, rows: Array) -> None:
    path = tmp_path / "a.mat"
    for compress in (False, True):
        savemat(
            path,
            {"t": rows[:, 0], "gyro": rows[:, 1:4], "acc": rows[:, 4:], "s": {"a": 1}},
            do_compression=compress,
        )
        source = open_source(path)
        assert source.format == "mat"
        assert same(source.read(), rates(rows))
    savemat(path, {"imu": rows})
    assert same(read(path), rates(rows))
    savemat(path, {"x": rows, "y": rows[:, :2]}, format="4")
    assert same(read(path, variables="matrix=x"), rates(rows))


def test_mat_7_3(tmp_path: Path, rows: Array) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = rows[:, :1].T
        file["gyro"] = rows[:, 1:4].T
        file["acc"] = rows[:, 4:].T
        file.create_group("#refs#")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: test".ljust(512))
    source = open_source(path)
    assert source.format == "mat"
    assert same(source.read(), rates(rows))
    whole = path.read_bytes()
    path.write_bytes(whole[:1500])
    fails(path, "damaged or truncated .mat")


def test_mat_errors(tmp_path: Path, rows: Array, monkeypatch: pytest.MonkeyPatch, put: Put) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"q": rows[:, :3]})
    fails(path, "no array for the gyro was found among q")
    savemat(path, {"gyro": rows[:, 1:4] * 1j, "acc": rows[:, 4:], "t": rows[:, 0]})
    fails(path, "complex128, not real numbers")
    savemat(path, {"t": rows[:, 0], "gyro": rows[:, 1:4], "acc": rows[:, 4:]})
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    fails(path, "damaged or truncated .mat")
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(300))
    fails(path, ": ")
    # Many a .mat is a table in text.
    assert same(read(put(make_text(rows, "   ", header=None), "t.mat")), rates(rows))
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n")
    fails(path, r"needs h5py: pip install 'h5py>=")


# -- float64 records -------------------------------------------------------------------


def test_binary(put: Put, rows: Array) -> None:
    path = put(rows.astype("<f8").tobytes(), "a.bin")
    source = open_source(path)
    assert (source.format, source.rows) == ("bin", len(rows))
    assert same(source.read(), rates(rows))
    assert source.progress == 1.0
    last = np.column_stack([rows[:, 1:], rows[:, 0]])
    path = put(last.astype("<f8").tobytes(), "a.bin")
    assert same(read(path, columns="gx,gy,gz,ax,ay,az,t"), rates(rows))
    assert same(read(path, columns="7,1,2,3,4,5,6"), rates(rows))
    wide = np.column_stack([rows, rows])
    path = put(wide.astype("<f8").tobytes(), "a.bin")
    assert same(read(path, columns="t,gx,gy,gz,ax,ay,az,_,_,_,_,_,_,_"), rates(rows))
    path = put(rows[:, 1:].astype("<f8").tobytes(), "a.bin")
    assert len(read(path, columns="gx,gy,gz,ax,ay,az", rate=100)) == 39


@pytest.mark.filterwarnings("ignore:overflow")  # where kernels run uncompiled
def test_binary_errors(put: Put, rows: Array) -> None:
    whole = rows.astype("<f8").tobytes()
    fails(put(whole[:-3], "a.bin"), "2237 bytes are 39 rows of 56 bytes and 53 bytes more")
    fails(put(whole, "a.bin"), "no column for az", columns="t,gx,gy,gz,ax,ay,_")
    fails(put(rows.astype(">f8").tobytes(), "a.bin"), "data row")
    fails(put(b"", "a.bin"), "is empty")
    fails(put(bytes(range(256)) * 9, "a.xyz"), "neither text nor a known binary format")


# -- writing ---------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".npz", ".CSV"])
def test_what_is_written_cannot_be_half_there(tmp_path: Path, rows: Array, suffix: str) -> None:
    record = rates(rows)
    path = tmp_path / f"a{suffix}"
    write(record, path)
    write(record, path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    with pytest.raises(InputError, match="is there already"):
        write(record, path, overwrite=False)


def test_write_errors(tmp_path: Path, rows: Array) -> None:
    record = rates(rows)
    with pytest.raises(InputError, match=r"cannot write the format '.imu'; use .parquet"):
        write(record, tmp_path / "a.imu")
    with pytest.raises(InputError, match="no folder"):
        write(record, tmp_path / "no" / "a.csv")
    with pytest.raises(InputError, match="no samples"):
        write(record.rows(0, 0), tmp_path / "a.csv")
    two = ImuRecord(record.time, record.dt, np.ones((39, 2)), record.dvel)
    with pytest.raises(InputError, match="this has 2 and 3"):
        write(two, tmp_path / "a.csv")


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, rows: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(b"old")

    def full(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(InputError, match=r"cannot be written \(No space left"):
        write(rates(rows), path)
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_own_parquet_says_what_it_holds(tmp_path: Path, rows: Array) -> None:
    write(rates(rows), tmp_path / "a.parquet")
    metadata = json.loads(pq.read_schema(tmp_path / "a.parquet").metadata[b"schuler"])
    assert metadata["kind"] == "increments"
    assert metadata["axes"] == "RFU"


def test_damaged_own_csv(tmp_path: Path, rows: Array) -> None:
    write(rates(rows), tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text()
    (tmp_path / "a.csv").write_text(text.replace('{"version"', '"version"'))
    fails(tmp_path / "a.csv", "line 1: the description that schuler wrote there is damaged")
    (tmp_path / "a.csv").write_text(text.replace(",0.01,", ",-0.01,"))
    fails(tmp_path / "a.csv", r"the interval dt = -0\.01 s must be a positive")
