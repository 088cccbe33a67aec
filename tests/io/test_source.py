"""Sources, round trips, following, plugins and the real records."""

from __future__ import annotations

import io
import os
import sys
import threading
import time as clock
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

import schuler.io.registry as registry
from schuler import InputError, Mapping, open_source, read, write
from schuler.io import Content, readers, register
from schuler.io.flow import prefetch
from schuler.record import ImuRecord
from tests.io.conftest import HEADER, Array, make_rows, make_text, same

Put = Callable[..., Path]


def rates(rows: Array) -> ImuRecord:
    return ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:7])


# -- round trips -----------------------------------------------------------------------

finite = st.floats(-1e6, 1e6, allow_subnormal=True)


@st.composite
def records(draw: st.DrawFn) -> ImuRecord:
    n = draw(st.integers(1, 12))
    dt = draw(npst.arrays(np.float64, n, elements=st.floats(1e-3, 2e-3)))
    start = draw(st.floats(-1e5, 1e5))
    values = draw(npst.arrays(np.float64, (n, 6), elements=finite))
    # Rows that repeat their forerunner are dropped only where time stands still.
    return ImuRecord(
        start + np.cumsum(dt),
        dt,
        values[:, :3],
        values[:, 3:],
        coning_corrected=draw(st.booleans()),
        sculling_corrected=draw(st.booleans()),
        name=draw(st.text(max_size=9)),
    )


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
@given(record=records())
def test_round_trip(
    suffix: str, record: ImuRecord, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / f"round{suffix}"
    write(record, path)
    back = read(path)
    assert same(back, record)
    assert back.name == record.name
    assert back.quality is not None
    assert back.quality.rows == len(record)


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
def test_a_bridged_gap_stays_bridged(tmp_path: Path, suffix: str) -> None:
    rows = np.delete(make_rows(50), slice(20, 30), axis=0)
    record = ImuRecord.from_increments(rows[:, 0], rows[:, 1:4], rows[:, 4:], max_gap=1.0)
    assert record.dt.max() == pytest.approx(0.11)
    write(record, tmp_path / f"a{suffix}")
    # Without being allowed again: the interval says that the time is covered.
    back = read(tmp_path / f"a{suffix}")
    assert same(back, record)
    assert back.quality is not None
    assert back.quality.gaps == 1


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
def test_own_file_with_a_hole_or_overlap_is_refused(tmp_path: Path, suffix: str) -> None:
    rows = make_rows(50)
    record = ImuRecord.from_increments(rows[:, 0], rows[:, 1:4], rows[:, 4:])
    time = record.time.copy()
    time[20:] += 5.0
    write(ImuRecord(time, record.dt, record.dtheta, record.dvel), tmp_path / f"a{suffix}")
    with pytest.raises(InputError, match=r"a gap of 5\.01 s"):
        read(tmp_path / f"a{suffix}")
    write(
        ImuRecord(record.time, record.dt * 2, record.dtheta, record.dvel), tmp_path / f"b{suffix}"
    )
    with pytest.raises(InputError, match=r"its interval dt is longer than the 0\.01 s"):
        read(tmp_path / f"b{suffix}")


@pytest.mark.parametrize("suffix", [".parquet", ".npz", ".csv"])
@pytest.mark.parametrize("size", [1, 7, 256, 1000])
def test_chunks_of_every_format(
    tmp_path: Path, suffix: str, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("parquet", "arrays"):
        monkeypatch.setattr(f"schuler.io.{module}.BLOCK_ROWS", 100)
    rows = make_rows(600)
    record = rates(rows)
    write(record, tmp_path / f"a{suffix}")
    source = open_source(tmp_path / f"a{suffix}")
    parts = list(source.chunks(size))
    assert max(len(part) for part in parts) <= size
    assert same(ImuRecord.concatenate(parts), record)


# -- sources ---------------------------------------------------------------------------


def test_source_before_and_after_reading(csv: Path, rows: Array) -> None:
    source = open_source(csv)
    assert (source.path, source.format, source.kind) == (csv, "text", "rates")
    assert source.size == csv.stat().st_size
    assert (source.rows, source.position, source.quality) == (None, None, None)
    assert source.progress == 0.0
    assert source.mapping == Mapping(
        gyro="rad/s", accel="m/s^2", axes="RFU", time="s", mean_rates=False
    )
    assert "instantaneous rates" in repr(source)
    record = source.read()
    assert record.name == "truck"
    assert record.quality == source.quality
    assert same(record, source.read())


def test_mapping_may_be_a_toml_file(csv: Path, tmp_path: Path) -> None:
    Mapping(gyro="deg/s", axes="FRD").to_toml(tmp_path / "m.toml")
    source = open_source(csv, tmp_path / "m.toml", axes="FLU")
    assert (source.mapping.gyro, source.mapping.axes) == ("deg/s", "FLU")


def test_max_gap(put: Put) -> None:
    rows = np.delete(make_rows(50), slice(20, 30), axis=0)
    path = put(make_text(rows))
    with pytest.raises(InputError, match=r"file\.csv: data row 21 .* a gap of 0.11 s"):
        read(path)
    assert len(read(path, max_gap=0.2)) == 39


def test_abandoned_reading_ends_its_thread(put: Put, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("schuler.io.text._BLOCK_BYTES", 1000)
    before = threading.active_count()
    chunks = open_source(put(make_text(make_rows(500)))).chunks(10)
    next(chunks)
    chunks.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_prefetch_is_one_block_ahead() -> None:
    made = []

    def blocks() -> Iterator[int]:
        for i in range(5):
            made.append(i)
            yield i

    ahead = prefetch(blocks())  # type: ignore[arg-type]
    assert next(ahead) == 0
    clock.sleep(0.05)
    assert made == [0, 1]
    assert list(ahead) == [1, 2, 3, 4]


def test_prefetch_passes_errors_on() -> None:
    def blocks() -> Iterator[int]:
        yield 1
        raise KeyboardInterrupt

    ahead = prefetch(blocks())  # type: ignore[arg-type]
    assert next(ahead) == 1
    with pytest.raises(KeyboardInterrupt):
        next(ahead)


# -- standard input and growing files --------------------------------------------------


class Pipe(io.RawIOBase):
    """A pipe that gives one piece a time."""

    def __init__(self, pieces: list[bytes]) -> None:
        self.pieces = pieces

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        piece = self.pieces.pop(0) if self.pieces else b""
        buffer[: len(piece)] = piece
        return len(piece)


def feed(monkeypatch: pytest.MonkeyPatch, pieces: list[bytes]) -> None:
    stdin = SimpleNamespace(buffer=io.BufferedReader(Pipe(pieces), 1 << 16))
    monkeypatch.setattr(sys, "stdin", stdin)


@pytest.mark.parametrize("step", [1, 13, 100, 5000])
@pytest.mark.parametrize("way", ["read", "follow"])
def test_standard_input(monkeypatch: pytest.MonkeyPatch, rows: Array, step: int, way: str) -> None:
    text = make_text(rows).encode()
    feed(monkeypatch, [text[i : i + step] for i in range(0, len(text), step)])
    source = open_source("-")
    assert source.size is None
    parts = [source.read()] if way == "read" else list(source.follow())
    record = ImuRecord.concatenate(parts)
    assert same(record, rates(rows))
    assert record.name == "stdin"
    with pytest.raises(InputError, match="standard input: standard input can be read only once"):
        source.read()


def test_standard_input_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    feed(monkeypatch, [b""])
    with pytest.raises(InputError, match="standard input: is empty"):
        open_source("-")
    feed(monkeypatch, [HEADER.encode(), b"\n0,1,2,3,4,5,6\n", b"1,1,2,3,4,5,6\n1,x,2,3,4,5,6\n"])
    with pytest.raises(InputError, match="standard input: line 4, column 'gx': 'x'"):
        read("-")


def test_follow_passes_whole_lines_on_when_eight_more_are_there(put: Put) -> None:
    rows = make_rows(300)
    lines = make_text(rows).splitlines(keepends=True)
    path = put("".join(lines[:290]))
    source = open_source(path)
    stages: list[Callable[[], object]] = []

    def add(text: str) -> None:
        with path.open("a") as file:
            file.write(text)

    stages = [lambda: add(lines[290]), lambda: add(lines[291][:30]),
              lambda: add(lines[291][30:] + "".join(lines[292:]) + "3.01,1")]  # fmt: skip

    def stop() -> bool:
        if not stages:
            return False
        stages.pop(0)()
        return False

    # `stop` is asked once after each piece and once at each quiet look.
    got = [len(part) for part in source.follow(poll=0.005, idle=0.05, stop=stop)]
    assert got[0] == 280
    assert 1 in got
    assert sum(got) == 299
    assert source.quality is not None
    assert source.quality.rows == 300


def test_follow_gives_the_same_bits_and_the_short_rest(put: Put, rows: Array) -> None:
    source = open_source(put(make_text(rows)))
    parts = list(source.follow(poll=0.001, idle=0.002))
    assert same(ImuRecord.concatenate(parts), rates(rows))
    parts = list(open_source(put(make_text(rows))).follow(poll=0.001, stop=lambda: True))
    assert same(ImuRecord.concatenate(parts), rates(rows))


def test_follow_with_a_rate_waits_for_256_rows_too(put: Put) -> None:
    text = make_text(make_rows(300)).splitlines(keepends=True)
    source = open_source(put("".join(text)), rate=100)
    following = source.follow()
    assert len(next(following)) == 291
    following.close()  # type: ignore[attr-defined]
    short = open_source(put("".join(text[:200])), rate=100)
    assert [len(part) for part in short.follow(poll=0.001, idle=0.002)] == [198]


def test_follow_errors(put: Put, rows: Array, tmp_path: Path) -> None:
    path = put(make_text(rows))
    following = open_source(path).follow(poll=0.001)

    def shorten() -> bool:
        path.write_text(HEADER)
        return False

    with pytest.raises(InputError, match="has become shorter"):
        list(open_source(path).follow(poll=0.001, stop=shorten))
    following.close()  # type: ignore[attr-defined]
    path = put(make_text(rows) + "1,2,x,3,4,5,6\n")
    with pytest.raises(InputError, match="line 42, column 'gy'"):
        list(open_source(path).follow(poll=0.001, idle=0.001))
    with pytest.raises(InputError, match="poll"):
        list(open_source(path).follow(poll=0))
    write(rates(rows), tmp_path / "a.npz")
    with pytest.raises(InputError, match="a npz file cannot be followed, only text can"):
        list(open_source(tmp_path / "a.npz").follow())


# -- readers of other packages ---------------------------------------------------------


class Toy:
    """A format of one magic word."""

    name = "toy"
    suffixes: tuple[str, ...] = (".toy",)

    def sniff(self, head: bytes) -> bool:
        return head.startswith(b"TOY!")

    def open(self, path: Path, mapping: Mapping) -> object:
        rows = make_rows(40)
        if path.stat().st_size > 10:
            raise InputError("is too long a toy")
        if path.suffix == ".plain":
            return [(rows[:9, 0], rows[:9, 1:]), (rows[9:, 0], rows[9:, 1:])]
        said = Mapping(gyro="rad", accel="m/s", rate=100)
        return Content(blocks=lambda: iter([(None, rows[:, 1:], None)]), said=said)


class Broken:
    """No reader at all."""


def entries(monkeypatch: pytest.MonkeyPatch, *pairs: tuple[str, str]) -> None:
    made = [EntryPoint(name, value, registry.GROUP) for name, value in pairs]
    monkeypatch.setattr(registry, "entry_points", lambda group: made)


def test_readers_lists_the_built_in(monkeypatch: pytest.MonkeyPatch) -> None:
    entries(monkeypatch)
    assert set(readers()) == {
        "parquet",
        "npz",
        "npy",
        "mat",
        "ros",
        "ulog",
        "novatel",
        "psins",
        "kf-gins",
        "bin",
        "text",
    }


def test_another_packages_reader(monkeypatch: pytest.MonkeyPatch, put: Put, rows: Array) -> None:
    entries(monkeypatch, ("toy", "tests.io.test_source:Toy"))
    assert "toy" in readers()
    for name in ("a.toy", "a.plain"):
        source = open_source(put(b"TOY!\0", name))
        assert source.format == "toy"
        record = source.read()
        if name == "a.plain":
            assert same(record, rates(rows))
        else:
            assert np.array_equal(record.dtheta, rows[:, 1:4])
    with pytest.raises(InputError, match=r"a\.toy: is too long a toy"):
        open_source(put(b"TOY!" * 9, "a.toy"))


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        (("x", "no.such.module:X"), "the reader 'x' of 'no.such.module:X' cannot be loaded"),
        (("x", "tests.io.test_source:Broken"), "is no reader: it needs name"),
        (("text", "tests.io.test_source:Toy"), "the name of a reader that is already there"),
    ],
)
def test_bad_readers_are_named_when_needed(
    monkeypatch: pytest.MonkeyPatch, put: Put, csv: Path, entry: tuple[str, str], part: str
) -> None:
    entries(monkeypatch, entry)
    assert len(read(csv)) == 39
    with pytest.raises(InputError, match=part):
        readers()
    with pytest.raises(InputError, match=part):
        read(put(b"TOY!\0", "a.toy"))


def test_register(monkeypatch: pytest.MonkeyPatch, put: Put) -> None:
    monkeypatch.setattr(registry, "_registered", {})
    register(Toy())  # type: ignore[arg-type]
    assert open_source(put(b"TOY!", "a.x")).format == "toy"
    toy = Toy()
    toy.name = "npz"
    with pytest.raises(InputError, match="one of schuler's own"):
        register(toy)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="is no reader"):
        register(Broken())  # type: ignore[arg-type]


# -- cheap import ----------------------------------------------------------------------


def test_import_brings_no_heavy_library(run_python: Callable[..., str]) -> None:
    code = (
        "import sys, schuler.io; "
        "print([m for m in ('pyarrow', 'scipy', 'h5py', 'numba') if m in sys.modules])"
    )
    assert run_python(code).strip() == "[]"


# -- real records ----------------------------------------------------------------------


@pytest.mark.realdata
def test_ring_laser_on_a_vehicle(data_dir: Path) -> None:
    source = open_source(data_dir / "psins_lasergyro_vehicle" / "lasergyro.imu")
    record = source.read()
    assert source.position == (34.246048, 108.909664, 380.0)
    assert len(record) == 184718
    assert record.rate == pytest.approx(100)
    assert record.duration == pytest.approx(1847.18)
    quiet = record.between(600, 930)
    deg_h = np.pi / 180 / 3600
    # As measured independently (README of the record).
    assert np.allclose(
        quiet.dtheta.sum(0) / quiet.duration / deg_h, [-12.418, -0.006, 8.371], atol=2e-3
    )
    force = np.linalg.norm(quiet.dvel.sum(0)) / quiet.duration
    assert 9.7953 < force < 9.7957


@pytest.mark.realdata
def test_adis16405(data_dir: Path) -> None:
    source = open_source(
        data_dir / "adis16405_static_3h" / "adis16405_imu1.npz",
        rate=100, gyro="0.05 deg/s", accel="0.00333 g",
        variables={"gyro": "gyro_counts", "accel": "accel_counts"},
    )  # fmt: skip
    record = source.read()
    assert source.rows == 1_000_000
    assert len(record) == 999_999
    mean = record.dtheta.mean(0) / 0.01 * 180 / np.pi
    assert np.allclose(mean, [0.402, -0.416, -0.294], atol=1e-3)
    assert np.linalg.norm(record.dvel.mean(0)) / 0.01 / 9.80665 == pytest.approx(1.0161, abs=2e-3)


@pytest.mark.realdata
def test_xsens_counts_in_text(data_dir: Path, tmp_path: Path) -> None:
    folder = data_dir / "imu_tk_xsens_multipos"
    with pytest.raises(InputError, match="it has 4 columns without names"):
        read(folder / "xsens_acc.mat")
    gyro = (folder / "xsens_gyro.mat").read_text().splitlines()[:6000]
    accel = (folder / "xsens_acc.mat").read_text().splitlines()[:6000]
    both = "\n".join(g + a for g, a in zip(gyro, accel, strict=True))
    (tmp_path / "both.mat").write_text(both)
    source = open_source(tmp_path / "both.mat", columns="t,gx,gy,gz,_,ax,ay,az")
    assert source.format == "text"
    record = source.read()
    first = record.between(None, 50)
    assert np.allclose(first.gyro.mean(0), [32777.2, 32459.8, 32511.9], atol=1.0)


@pytest.mark.realdata
def test_single_gyro_in_another_encoding(data_dir: Path) -> None:
    path = data_dir / "fog_singleaxis_turntable" / "6-1.txt"
    with pytest.raises(InputError, match=r"6-1\.txt: line 2 .* --skip-rows"):
        open_source(path)
    with pytest.raises(InputError, match="it has 2 columns without names"):
        open_source(path, skip_rows=2)
    with pytest.raises(InputError, match="no column for gy, gz, ax, ay, az"):
        open_source(path, skip_rows=2, columns="t,gx")


def test_file_that_grows_in_another_process_is_read_to_its_end(put: Put, rows: Array) -> None:
    path = put(make_text(rows[:5]))

    def grow() -> None:
        rest = make_text(rows[5:], header=None).encode()
        with path.open("ab", buffering=0) as file:
            for i in range(0, len(rest), 97):
                file.write(rest[i : i + 97])
                os.fsync(file.fileno())

    writer = threading.Thread(target=grow)
    following = open_source(path).follow(poll=0.002, idle=0.3)
    writer.start()
    parts = list(following)
    writer.join()
    assert same(ImuRecord.concatenate(parts), rates(rows))
