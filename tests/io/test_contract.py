"""What every format must do, on one stationary vehicle: be known by its content, be read whole or
in pieces with the same bits, and give `schuler info` and `schuler align` the same answer."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from schuler import InputError, Mapping, Site, align, open_source, read, write
from schuler.cli import main
from schuler.io import readers
from schuler.motion import Static
from schuler.record import ImuRecord
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.io.conftest import HEADER, Array, make_text, same
from tests.io.makers import (
    novatel_ascii,
    novatel_binary,
    novatel_row,
    sensor_combined,
    ulog_file,
    vehicle_imu,
    write_bag,
)

HEADING = 30.0
SITE = Site(40.0, 116.0, 50.0)
FRD = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def record() -> ImuRecord:
    """Return two minutes at 25 Hz of a base at rest; increments."""
    rng = np.random.default_rng(4)
    motion = Static(HEADING, 1.0, -2.0)
    return simulate(motion, SITE, 120.0, 25.0, GRADES["navigation-fog"], rng).record


def table(record: ImuRecord, axes: Array, rates: bool = False) -> Array:
    """Return rows of time and increments, or mean rates, in other axes."""
    values = (record.gyro, record.accel) if rates else (record.dtheta, record.dvel)
    return np.column_stack([record.time, *(v @ axes.T for v in values)])


def counts(record: ImuRecord) -> list[tuple[float, list[int]]]:
    made = np.rint(np.column_stack([record.dtheta / 1e-9, record.dvel / 2e-8])).astype(int)
    return list(zip(record.time.tolist(), made.tolist(), strict=True))


def bag(kind: str) -> Callable[[ImuRecord, Path], Path]:
    return lambda r, p: write_bag(p / "a.bag", {"/imu": table(r, FLU, True)}, kind)


def put(name: str, data: Callable[[ImuRecord], bytes]) -> Callable[[ImuRecord, Path], Path]:
    def make(record: ImuRecord, folder: Path) -> Path:
        (folder / name).write_bytes(data(record))
        return folder / name

    return make


def own(suffix: str) -> Callable[[ImuRecord, Path], Path]:
    def make(record: ImuRecord, folder: Path) -> Path:
        write(record, folder / f"a{suffix}")
        return folder / f"a{suffix}"

    return make


def mat(record: ImuRecord, folder: Path) -> Path:
    savemat(folder / "a.mat", {"time": record.time, "dtheta": record.dtheta, "dvel": record.dvel})
    return folder / "a.mat"


def mat_structure(record: ImuRecord, folder: Path) -> Path:
    imu = {"t": record.time[:, None], "wb": record.dtheta, "fb": record.dvel, "freq": 25.0}
    savemat(folder / "b.mat", {"imu": imu, "note": "at rest", "offset": 3.0})
    return folder / "b.mat"


def npy(record: ImuRecord, folder: Path) -> Path:
    np.save(folder / "a.npy", table(record, np.eye(3)))
    return folder / "a.npy"


def psins(record: ImuRecord) -> bytes:
    rows = np.rint(np.column_stack([record.dtheta, record.dvel]) / 1e-9).astype(int)
    size, ug = np.degrees(1e-9) * 3600, 1e-9 / 9.8e-6
    head = f"% PSINS\n0 0 0 0 0 0\n40 116 50 0 40 9.8\n{size} {size} {size} {ug} {ug} {ug}\n"
    return (head + "\n".join(" ".join(map(str, row)) for row in rows.tolist()) + "\n").encode()


def novatel(make: Callable[..., bytes]) -> Callable[[ImuRecord], bytes]:
    return lambda record: b"".join(
        make("RAWIMUSX", novatel_row("RAWIMUSX", 2209, t, c, imu_type=26))
        for t, c in counts(record)
    )


INCREMENTS = {"gyro": "rad", "accel": "m/s"}
MEAN = {"mean_rates": True}

#: name -> reader, how the file is made, what must be said
FORMATS: dict[str, tuple[str, Callable[[ImuRecord, Path], Path], dict[str, object]]] = {
    "csv": ("text", put("a.csv", lambda r: make_text(table(r, np.eye(3)), header=HEADER).encode()),
            INCREMENTS),
    "parquet": ("parquet", own(".parquet"), {}),
    "npz": ("npz", own(".npz"), {}),
    "csv.gz": ("text", put("a.csv.gz", lambda r: gzip.compress(make_text(
        table(r, np.eye(3)), header=HEADER).encode())), INCREMENTS),
    "npy": ("npy", npy, INCREMENTS),
    "mat": ("mat", mat, {}),
    "mat-structure": ("mat", mat_structure, INCREMENTS),
    "psins": ("psins", put("a.imu", psins), {}),
    "bin": ("bin", put("a.bin", lambda r: table(r, np.eye(3)).tobytes()), INCREMENTS),
    "ros1": ("ros", bag("ros1"), MEAN),
    "ros2-sqlite": ("ros", bag("sqlite"), MEAN),
    "ros2-mcap": ("ros", bag("mcap"), MEAN),
    "ulog": ("ulog", put("a.ulg", lambda r: ulog_file([
        ("vehicle_imu", 0, vehicle_imu(table(r, FRD), (40_000, 40_000)))])), {}),
    "ulog-rates": ("ulog", put("a.ulg", lambda r: ulog_file([
        ("sensor_combined", 0, sensor_combined(table(r, FRD, True)))])), {}),
    "novatel-ascii": ("novatel", put("a.asc", novatel(novatel_ascii)), {}),
    "novatel-binary": ("novatel", put("a.gps", novatel(novatel_binary)), {}),
    "kf-gins-text": ("kf-gins", put("a.txt", lambda r: make_text(
        table(r, FRD), " ", header=None).encode()), {"format": "kf-gins"}),
    "kf-gins-binary": ("kf-gins", put("a.bin", lambda r: table(r, FRD).tobytes()),
                       {"format": "kf-gins"}),
}  # fmt: skip

#: formats that round, to counts or to float32
ROUNDED = ("psins", "ulog", "novatel")


@pytest.fixture(scope="module")
def files(record: ImuRecord, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a file of each format."""
    pytest.importorskip("rosbags")
    pytest.importorskip("pyulog")
    return {k: make(record, tmp_path_factory.mktemp(k)) for k, (_, make, _) in FORMATS.items()}


def test_every_reader_of_ours_is_here() -> None:
    assert {reader for reader, _, _ in FORMATS.values()} == set(readers())


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_read_is_what_was_there(
    name: str, files: dict[str, Path], record: ImuRecord
) -> None:
    reader, _, said = FORMATS[name]
    source = open_source(files[name], **said)
    found = source.read()
    assert source.format == reader
    assert len(found) == len(record)
    rounding = {"dtheta": 6e-10, "dvel": 2e-8} if name.startswith(ROUNDED) else {}
    assert np.allclose(found.time, record.time, rtol=0, atol=1e-8)
    assert np.allclose(found.dtheta, record.dtheta, rtol=2e-7, atol=rounding.get("dtheta", 1e-15))
    assert np.allclose(found.dvel, record.dvel, rtol=2e-7, atol=rounding.get("dvel", 1e-15))
    for size in (777, 65536):
        assert same(ImuRecord.concatenate(list(source.chunks(size))), found)
    assert source.progress == pytest.approx(1.0)
    part = source.read(start=10.0, stop=20.0)
    assert part.duration == pytest.approx(10.0, abs=0.08)
    # From a sidecar as well as from keywords.
    assert same(read(files[name], Mapping.from_cli(**said)), found)


@pytest.mark.parametrize("name", FORMATS)
def test_the_command_line_reads_it(
    name: str, files: dict[str, Path], record: ImuRecord, capsys: pytest.CaptureFixture[str]
) -> None:
    options = []
    for key, value in FORMATS[name][2].items():
        options += [f"--{key.replace('_', '-')}", *([] if value is True else [str(value)])]
    place = ["--lat", "40", "--height", "50"]
    outputs = []
    for command, more in (("info", place), ("align", [*place, "--method", "centred"])):
        with pytest.raises(SystemExit) as stop:
            main([command, str(files[name]), *options, *more, "--json", "-"])
        out, err = capsys.readouterr()
        assert not stop.value.code, err
        outputs.append(json.loads(out))
    info, aligned = outputs
    assert info["format"] == FORMATS[name][0]
    assert info["time"]["samples"] == len(record)
    assert info["mean_force_norm_m_s2"] == pytest.approx(9.80, abs=0.4)
    there = align(record, SITE, "centred").heading_deg
    assert aligned["heading_deg"] == pytest.approx(there, abs=0.01)
    assert aligned["heading_deg"] == pytest.approx(HEADING, abs=2.0)


BINARY = ("ros1", "ros2-sqlite", "ros2-mcap", "ulog", "novatel-binary", "novatel-ascii",
          "kf-gins-binary")  # fmt: skip


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.parametrize("name", BINARY)
def test_any_damage_is_one_sentence_or_is_survived(
    name: str, files: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bytes set at random, or the end cut off: a record or an `InputError`, never anything else."""
    rng = np.random.default_rng(12)
    path = files[name]
    if path.is_dir():
        (path,) = (p for p in path.iterdir() if p.name != "metadata.yaml")
    whole = path.read_bytes()
    sentences: list[str] = []
    for trial in range(30):
        hurt = bytearray(whole)
        # Half of the slips are in the beginning, where most of what matters stands.
        reach = len(whole) if trial % 2 else min(len(whole), 3000)
        for place in rng.integers(0, reach, 1 + trial % 5):
            hurt[place] = rng.integers(0, 256)
        if trial % 4 == 3:
            hurt = hurt[: int(rng.integers(16, len(whole)))]
        (tmp_path / path.name).write_bytes(hurt)
        try:
            read(tmp_path / path.name, max_gap=1e9, **FORMATS[name][2])
        except InputError as error:
            sentences.append(str(error))
    assert not any("\n" in text or len(text) > 1500 for text in sentences)
    # Checksums let a NovAtel log lose only what is hurt.
    assert bool(sentences) != name.startswith("novatel")
    assert capsys.readouterr().out == ""
