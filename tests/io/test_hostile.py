"""Files that ask for too much, point elsewhere, never end, or hide what is missing."""

from __future__ import annotations

import io
import os
import socket
import struct
import threading
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read, write
from schuler.errors import shown
from schuler.io.dialect import NUMBER
from schuler.io.expansion import expansion
from schuler.io.limits import LEAST, available_memory, check_size
from schuler.io.trajectory import read_trajectory
from schuler.record import ImuRecord
from tests.io.conftest import HEADER, Array, make_rows, make_text, same
from tests.io.makers import ulog_file, ulog_message, vehicle_imu, write_bag

Put = Callable[..., Path]
NESTED = "[" * 100_000


def fails(path: Path | str, part: str, **options: object) -> str:
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    text = str(error.value)
    assert text.isprintable()
    return text


# -- declared sizes --------------------------------------------------------------------


def test_sizes_are_bounded_by_the_file_and_the_machine() -> None:
    check_size(LEAST, 10, "it")
    check_size(40 << 20, 1 << 20, "it")
    with pytest.raises(InputError, match=r"it announces \d+ MB in a file of 10 bytes, more than"):
        check_size(LEAST + 1, 10, "it")
    with pytest.raises(InputError, match=r"MB of memory, and \d+ MB are free; cut the"):
        check_size(available_memory(), available_memory(), "it")


def npz_header(shape: str, descr: str = "'<f8'") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (63 - (10 + len(text)) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def npz(path: Path, **arrays: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in arrays.items():
            archive.writestr(f"{name}.npy", data)
    return path


def test_an_npz_that_expands_is_refused(tmp_path: Path) -> None:
    n = 3_000_000
    column = npz_header(f"({n},)") + bytes(8 * n)
    three = npz_header(f"({n}, 3)") + bytes(24 * n)
    path = npz(tmp_path / "a.npz", t=column, gyro=three, acc=three)
    assert path.stat().st_size < 200_000
    assert "save it without compression" in fails(path, r"array '\w+' announces 1\d\d MB in a file")
    # The shape alone, where the bytes are not there; numbers of one byte that become eight.
    fails(npz(path, t=column, gyro=npz_header("(900000000, 3)"), acc=three), "gyro' announces")
    small = npz_header("(9000000, 3)", "'|i1'") + bytes(27_000_000)
    fails(npz(path, t=column, gyro=small, acc=small), "gyro' announces 216 MB")


@pytest.mark.parametrize(
    "header",
    [
        npz_header("(3,)")[:40],
        npz_header("(" * 5000),
        npz_header("('a',)"),
        npz_header("(3,)", "'<f8'" + "[" * 200),
        b"\x93NUMPY\x09\x00" + npz_header("(3,)")[8:],
        npz_header("(3,)").replace(b"False", b"'\x00'  "),
    ],
)
def test_a_damaged_npz_header_is_one_sentence(tmp_path: Path, header: bytes) -> None:
    fails(npz(tmp_path / "a.npz", t=header, gyro=header, acc=header), "array 'gyro' is damaged")


def test_npz_arrays_that_vanish_or_differ_are_said(tmp_path: Path) -> None:
    rows = make_rows()
    np.savez(tmp_path / "a.npz", t=rows[:-1, 0], gyro=rows[:, 1:4], acc=rows[:, 4:])
    fails(tmp_path / "a.npz", r"array 't' has shape \(39,\), expected 40 values")
    write(ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:]), tmp_path / "a.npz")
    data = (tmp_path / "a.npz").read_bytes()
    at = data.rfind(b"PK\x01\x02")
    (tmp_path / "a.npz").write_bytes(data[:at] + data[data.rfind(b"PK\x05\x06") :])
    # Which of them sees it first is a matter of the zipfile of each Python.
    fails(tmp_path / "a.npz", "of 5 arrays are listed|damaged npz archive|is not an npz archive")


def mat_matrix(
    dims: tuple[int, int], data: bytes, kind: int = 6, name: bytes = b"gyro", more: int = 0
) -> bytes:
    body = struct.pack("<IIII", 6, 8, kind, 0) + struct.pack("<IIii", 5, 8, *dims)
    body += struct.pack("<II", 1, len(name)) + name.ljust(8, b"\0") + data
    return struct.pack("<II", 14, len(body) + more) + body


def mat(*elements: bytes, compress: bool = False) -> bytes:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    for element in elements:
        packed = zlib.compress(element)
        head += struct.pack("<II", 15, len(packed)) + packed if compress else element
    return head


def test_a_mat_file_that_announces_too_much_is_refused(put: Put) -> None:
    huge = mat_matrix((20_000_000, 3), struct.pack("<II", 9, 480_000_000), more=480_000_000)
    acc = mat_matrix((1, 3), struct.pack("<II", 9, 24) + bytes(24), name=b"acc")
    fails(put(mat(huge, acc, compress=True), "a.mat"), "array 'gyro' announces 480 MB")
    fails(put(mat(huge), "a.mat"), r"bytes where \d+ are announced")
    short = mat_matrix((20_000_000, 3), struct.pack("<II", 9, 24) + bytes(24))
    fails(put(mat(short), "a.mat"), "array of 20000000x3 values in 24 bytes")
    # A sparse array has no values to be read: scipy took 1.9 GB for one.
    sparse = mat_matrix((1 << 28, 3), struct.pack("<II", 5, 0), kind=5)
    fails(put(mat(sparse), "a.mat"), "no array for the gyro")


def test_hdf5_that_points_elsewhere_is_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    secret = tmp_path / "secret.txt"
    secret.write_bytes(bytes(range(240)))
    rows = make_rows(10)
    path = tmp_path / "a.mat"

    def make(**links: object) -> Path:
        with h5py.File(path, "w") as file:
            file["t"], file["acc"] = rows[:, 0], rows[:, 4:].T
            for name, link in links.items():
                file[name] = link
        return path

    fails(make(gyro=h5py.SoftLink("/gyro")), "array 'gyro' is a link to somewhere else")
    fails(make(gyro=h5py.SoftLink("/acc")), "array 'gyro' is a link to somewhere else")
    fails(make(gyro=h5py.ExternalLink("b.mat", "/x")), "array 'gyro' is a link to somewhere else")
    with h5py.File(make(), "a") as file:
        file.create_dataset("gyro", (10, 3), "<f8", external=[(str(secret), 0, 240)])
    fails(path, "array 'gyro' keeps its values in other files")
    layout = h5py.VirtualLayout((3, 10), "<f8")
    layout[:] = h5py.VirtualSource("b.mat", "x", (3, 10))
    with h5py.File(make(), "a") as file:
        file.create_virtual_dataset("gyro", layout)
    fails(path, "array 'gyro' keeps its values in other files")


def test_hdf5_that_expands_is_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file.create_dataset("gyro", (3, 30_000_000), "<f8", chunks=(3, 1000), compression="gzip")
        file["acc"] = np.zeros((3, 100))
    fails(tmp_path / "a.mat", "array 'gyro' announces 720 MB")
    with h5py.File(tmp_path / "a.mat", "w") as file:
        gyro = file.create_dataset("gyro", (3, 100), "<f8", chunks=(3, 100), compression="gzip")
        gyro.id.write_direct_chunk((0, 0), zlib.compress(bytes(200 << 20), 9))
        file["acc"], file["t"] = np.zeros((3, 100)), np.arange(100.0)
    fails(tmp_path / "a.mat", "a chunk that expands to more than its 2400 bytes")


def test_a_parquet_page_that_expands_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.table(dict(zip(HEADER.split(","), make_rows(20).T.copy(), strict=True)))
    path = tmp_path / "a.parquet"
    parquet.write_table(table, path, use_dictionary=False)
    assert len(read(path)) == 19
    data = path.read_bytes()
    # The first page's type, then what it expands to, as zigzag numbers: the second becomes -1.
    assert data[4:7] == b"\x15\x00\x15"
    path.write_bytes(data[:7] + b"\x81\x00" + data[9:])
    fails(path, "column 't' has a page that does not fit the column")
    path.write_bytes(data)
    monkeypatch.setattr("schuler.io.limits.LEAST", 100)
    monkeypatch.setattr("schuler.io.limits.RATIO", 0)
    fails(path, "column 't' announces 0.000[0-9]+ MB in a file")


def test_block_headers_bound_what_is_expanded() -> None:
    pa = pytest.importorskip("pyarrow")
    import bz2

    for size in (0, 1000, 300_000, 5_000_000):
        data = os.urandom(size // 2) + bytes(size - size // 2)
        for codec in ("zstd", "lz4", "bz2"):
            sink = pa.BufferOutputStream()
            with pa.CompressedOutputStream(sink, codec) as stream:
                stream.write(data)
            packed = bz2.compress(data) if codec == "bz2" else sink.getvalue().to_pybytes()
            found = expansion(io.BytesIO(b"--" + packed + b"--"), 2, len(packed), codec, 1 << 40)
            assert size <= found <= size + (4 << 20)
    bomb = bz2.compress(bytes(50 << 20))
    assert expansion(io.BytesIO(bomb), 0, len(bomb), "bz2", 1 << 20) > 1 << 20


# -- logs ------------------------------------------------------------------------------


def test_a_log_that_would_never_end_is_read_or_refused(put: Put) -> None:
    rows = make_rows(60)
    whole = ulog_file([("vehicle_imu", 0, vehicle_imu(rows))])
    # A size that leads beyond the end, in the definitions: pyulog went back for ever.
    at = whole.index(b"battery_status") - 3
    hurt = whole[:at] + b"\xff\x7f\xff" + whole[at + 3 :]
    source = open_source(put(hurt, "a.ulg"))
    assert len(source.read()) == 60
    assert "bytes belong to no whole message" in source.notes[0]
    # Formats inside each other, and arrays of arrays.
    for fields in ("b:b x;", "b:c[60000] x;", "b:c[9999999999] x;"):
        hurt = whole.replace(b"vehicle_imu:", b"vehicle_imx:", 1)
        hurt = hurt[:40 + 19] + b"".join(
            ulog_message("F", text.encode())
            for text in ("vehicle_imu:b x;", fields, "c:uint64_t[60000] x;")
        ) + hurt[40 + 19:]  # fmt: skip
        fails(put(hurt, "a.ulg"), "format of vehicle_imu has no size|has no samples")


def test_half_a_log_is_said(put: Put) -> None:
    whole = ulog_file([("vehicle_imu", 0, vehicle_imu(make_rows(60)))])
    source = open_source(put(whole[: len(whole) - 30 * 62 - 20], "a.ulg"))
    source.read()
    assert any("ends in the middle of a message" in note for note in source.notes)
    assert not open_source(put(whole, "a.ulg")).notes


def test_messages_that_a_bag_announces_and_has_not_are_said(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    rows = make_rows(4000)
    path = write_bag(tmp_path / "a", {"/imu": rows}, "mcap")
    (path,) = (p for p in path.iterdir() if p.suffix == ".mcap")
    source = open_source(path)
    assert len(source.read()) == 3999
    assert not source.notes
    data = bytearray(path.read_bytes())
    # The second chunk loses its checksum, and its messages become a record of another kind.
    place, chunks = 8, []
    while place < len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, place)
        if kind == 6:
            chunks.append((place + 9, length))
        place += 9 + length
    begin, length = chunks[1]
    data[begin + 24 : begin + 28] = bytes(4)
    name = struct.unpack_from("<I", data, begin + 28)[0]
    inside = length - 40 - name
    nothing = struct.pack("<BQ", 0x80, inside - 9) + bytes(inside - 9)
    data[begin + 40 + name : begin + length] = nothing
    path.write_bytes(data)
    source = open_source(path, max_gap=1e9)
    found = len(source.read()) + 1
    assert found < 4000
    assert source.notes == [
        f"the bag announces 4000 messages of '/imu', and {found} could be read: it is damaged"
    ]


# -- text ------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["%.6f", "%.8e", "%+.5f", "%d"])
def test_a_last_number_that_is_cut_is_dropped_and_said(put: Put, form: str) -> None:
    rows = np.round(1e4 * make_rows(30)) if form == "%d" else make_rows(30)
    rows[:, 6] = np.where(np.abs(rows[:, 6]) < 1e4, rows[:, 6] + 2e4 * (form == "%d"), rows[:, 6])
    text = "\n".join(",".join(form % v for v in row) for row in rows)
    whole = open_source(put(text), columns="t,gx,gy,gz,ax,ay,az")
    assert len(whole.read()) == 29
    assert not whole.notes
    for cut in (1, 3):
        source = open_source(put(text[:-cut]), columns="t,gx,gy,gz,ax,ay,az")
        assert len(source.read()) == 28
        assert len(source.notes) == 1
        assert source.notes[0].startswith("the last line has no line end, so its last number may")
    # A line end says that it is whole, and so does a column after it that nobody reads.
    assert len(read(put(text[:-1] + "\n"), columns="t,gx,gy,gz,ax,ay,az")) == 29
    more = "\n".join(f"{line},12.5" for line in text.split("\n"))
    assert len(read(put(more[:-2]), columns="t,gx,gy,gz,ax,ay,az")) == 29


def test_an_exponent_that_is_cut_is_dropped(put: Put) -> None:
    rows = make_rows(20)
    lines = [",".join(repr(float(v)) for v in (*row[:6], row[6] * 1e-9)) for row in rows]
    text = "\n".join(lines)
    source = open_source(put(text[: text.rindex("e")]), columns="t,gx,gy,gz,ax,ay,az")
    assert len(source.read()) == 18
    assert "may be cut off" in source.notes[0]


def test_endless_lines_and_cells_end_in_a_sentence(put: Put) -> None:
    many = ",".join(f"c{k}" for k in range(100_000))
    fails(put(f"{many}\n{',1' * 100_000}\n"), "columns, where 4096 are")
    fails(put(f"{many}\n1,2\n"), "names 100000 columns")
    rows = make_text(make_rows(5))
    fails(put(rows + "1" * 500_000 + "x,1,1,1,1,1,1\n"), "is not a number")
    assert NUMBER.fullmatch("1" * 500_000 + "x") is None
    fails(put(rows.replace("gx", f"gx [{'1' * 500_000}x]", 1)), "columns have different units")
    assert len(read(put(rows.replace("gx", "g" + " " * 500_000 + "x(", 1)))) == 4
    fails(put(rows.replace("gx", "(" * 500_000, 1).replace(",", " ")), "names")
    fails(put("# c\n" * 1000 + "#" * (2 << 20)), "longer than 1 MB|no data rows")


def test_what_a_terminal_would_obey_is_shown(put: Put, tmp_path: Path) -> None:
    assert shown("a\x1b[2J\x07\u202eb\ud800") == r"a\x1b[2J\x07\u202eb\ud800"
    assert shown("gx [°/s] µ²") == "gx [°/s] µ²"
    rows = make_text(make_rows(5))
    assert r"\x1b[31m" in fails(put(rows + "1,1,1,1,1,1,\x1b[31m\n"), "is not a number")
    assert r"\x1b[2Jx\x07" in fails(put(rows.replace("gx", "\x1b[2Jx\x07", 1)), "no column for gx")
    assert r"\x1b" in fails(tmp_path / "a\x1bb.csv", "no such file")
    assert r"\x00" in fails(str(tmp_path) + "/a\0b.csv", "no such file|cannot be read")
    assert len(str(InputError("x" * 100_000))) < 4100


# -- metadata --------------------------------------------------------------------------


def test_metadata_nested_without_end_is_one_sentence(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    rows = make_rows()
    table = pa.table(dict(zip(HEADER.split(","), rows.T.copy(), strict=True)))
    for text in (NESTED, '{"name": ' + NESTED, '{"name": %s}' % ("9" * 6000), '{"name": [1]}',
                 '{"name": "x", "coning_corrected": 3}'):  # fmt: skip
        parquet.write_table(
            table.replace_schema_metadata({"schuler": text}), tmp_path / "a.parquet"
        )
        fails(tmp_path / "a.parquet", "description that schuler wrote into its metadata is damaged")
        np.savez(tmp_path / "a.npz", time=rows[:, 0], schuler=np.array(text))
        fails(tmp_path / "a.npz", "wrote into the array 'schuler' is damaged")
        (tmp_path / "a.csv").write_text(f"# schuler {text}\n{make_text(rows)}")
        fails(tmp_path / "a.csv", "line 1: the description that schuler wrote there is damaged")


def test_numbers_without_end_in_a_mapping_are_one_sentence(csv: Path) -> None:
    for option in ({"columns": f"t,{'9' * 6000}"}, {"columns": [10**400]}, {"rate": 10**400},
                   {"skip_rows": 10**400}, {"gyro": "9" * 6000 + " deg/s"},
                   {"start_time": 10**400}, {"imu_type": "9" * 6000, "format": "novatel"},
                   {"axes": "x" * 6000}):  # fmt: skip
        assert len(fails(csv, "[a-z]", **option)) < 4200


# -- seals -----------------------------------------------------------------------------


def test_a_seal_notices_every_flipped_bit_of_the_footer(tmp_path: Path) -> None:
    rows = make_rows(30)
    record = ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:])
    write(record, tmp_path / "a.parquet")
    whole = (tmp_path / "a.parquet").read_bytes()
    rng = np.random.default_rng(5)
    refused = 0
    for bit in rng.integers(0, 8 * len(whole), 300).tolist():
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        (tmp_path / "a.parquet").write_bytes(data)
        try:
            back = read(tmp_path / "a.parquet")
        except InputError:
            refused += 1
        else:
            assert same(back, record)
            assert back.name == record.name
    assert refused > 200


def test_a_seal_is_of_names_and_metadata_too(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    from schuler.io.sealed import read_sealed, write_sealed

    path = tmp_path / "a.parquet"
    table = pa.table({"x": [1.0, 2.0], "method": ["a", "b"], "run": pa.array([1, 2], pa.int32())})
    write_sealed(table, path, {"schuler": "{}"})
    back, about, sealed = read_sealed(path, 2)
    assert back.to_pydict() == table.to_pydict()
    assert (about, sealed) == ({b"schuler": b"{}"}, True)
    metadata = parquet.read_schema(path).metadata
    changes = [
        (table, {**metadata, b"schuler": b"[]"}),
        (table.rename_columns(["y", "method", "run"]), metadata),
        (table.set_column(2, "run", pa.array([1, 3], pa.int32())), metadata),
        (table.slice(0, 1), metadata),
        (table, {k: v for k, v in metadata.items() if k != b"schuler.sha256"}),
        (table, {k: v[:-1] + b"0" if b"sha256" in k else v for k, v in metadata.items()}),
    ]
    for changed, about in changes:
        parquet.write_table(changed.replace_schema_metadata(about), path)
        with pytest.raises(InputError, match="is damaged"):
            read_sealed(path)
    parquet.write_table(table, path)
    with pytest.raises(InputError, match="has 2 rows, expected 3"):
        read_sealed(path, 3)


# -- what is no file -------------------------------------------------------------------


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Callable[[bytes, str], Path]]:
    """Return a function that makes a FIFO which gives some bytes once."""
    threads = []

    def make(data: bytes, name: str) -> Path:
        path = tmp_path / name
        os.mkfifo(path)
        thread = threading.Thread(target=path.write_bytes, args=(data,), daemon=True)
        thread.start()
        threads.append(thread)
        return path

    yield make
    for thread in threads:
        thread.join(20)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_a_pipe_is_read_as_the_file_would_be(
    suffix: str, pipe: Callable[[bytes, str], Path], tmp_path: Path, rows: Array,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    spool = tmp_path / "spool"
    spool.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(spool))
    record = ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:])
    write(record, tmp_path / f"a{suffix}")
    fifo = pipe((tmp_path / f"a{suffix}").read_bytes(), f"b{suffix}")
    source = open_source(fifo)
    assert len(list(spool.iterdir())) == 1
    assert same(source.read(), record)
    assert same(source.read(), record)
    del source
    assert not list(spool.iterdir())


@pytest.mark.skipif(not os.path.isdir("/dev/fd"), reason="no /dev/fd here")
def test_a_shell_s_process_substitution_is_read(rows: Array) -> None:
    take, give = os.pipe()
    text = make_text(rows).encode()
    os.write(give, text)
    os.close(give)
    try:
        assert len(read(f"/dev/fd/{take}")) == 39
    finally:
        os.close(take)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
def test_a_pipe_cannot_be_followed_by_name(
    tmp_path: Path, pipe: Callable[[bytes, str], Path]
) -> None:
    os.mkfifo(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"a\.csv: is a pipe, which cannot be followed"):
        open_source(tmp_path / "a.csv", wait=1.0)
    source = open_source(pipe(make_text(make_rows(9)).encode(), "b.csv"))
    with pytest.raises(InputError, match=r"b\.csv: is a pipe, which cannot be followed"):
        next(source.follow())


def test_a_reference_comes_through_a_pipe(pipe: Callable[[bytes, str], Path]) -> None:
    text = b"t,lat,lon,height\n0,1,2,3\n1,1,2,3\n"
    assert len(read_trajectory(pipe(text, "ref.csv"))) == 2


def test_sockets_devices_and_folders_are_refused(tmp_path: Path) -> None:
    fails("/dev/null", "/dev/null: is a device, not a file")
    fails(tmp_path, "is a folder")
    with socket.socket(socket.AF_UNIX) as server:
        # The path of a socket has to be short.
        here = os.open(tmp_path, os.O_RDONLY)
        try:
            server.bind(f"/proc/self/fd/{here}/s.csv" if os.path.isdir("/proc/self/fd") else
                        os.path.relpath(tmp_path / "s.csv"))  # fmt: skip
        finally:
            os.close(here)
        fails(tmp_path / "s.csv", "is a socket, not a file")
