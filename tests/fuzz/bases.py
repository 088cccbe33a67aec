"""A small sound file of each format that schuler reads, to be damaged."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from schuler import write
from schuler.record import ImuRecord
from tests.io import gnss_makers as gnss
from tests.io.conftest import HEADER, make_rows, make_text
from tests.io.makers import (
    novatel_ascii,
    novatel_binary,
    novatel_row,
    sensor_combined,
    ulog_file,
    vehicle_imu,
    write_bag,
)

ROWS = make_rows(120)
COUNTS = [
    (float(t), [int(v) for v in counts])
    for t, counts in zip(ROWS[:, 0], np.rint(ROWS[:, 1:] / 1e-5), strict=True)
]
Make = Callable[[Path], Path]


def record() -> ImuRecord:
    made = ImuRecord.from_rates(ROWS[:, 0], ROWS[:, 1:4], ROWS[:, 4:7])
    return ImuRecord(made.time, made.dt, made.dtheta, made.dvel, coning_corrected=True)


def put(name: str, data: Callable[[], str | bytes]) -> Make:
    def make(folder: Path) -> Path:
        content = data()
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def own(suffix: str) -> Make:
    def make(folder: Path) -> Path:
        write(record(), folder / f"a{suffix}")
        return folder / f"a{suffix}"

    return make


def foreign_parquet(folder: Path) -> Path:
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.table(dict(zip(HEADER.split(","), ROWS.T.copy(), strict=True)))
    parquet.write_table(table, folder / "a.parquet", row_group_size=50)
    return folder / "a.parquet"


def foreign_npz(folder: Path) -> Path:
    np.savez_compressed(folder / "a.npz", t=ROWS[:, 0], gyro=ROWS[:, 1:4], acc=ROWS[:, 4:])
    return folder / "a.npz"


def npy(folder: Path) -> Path:
    np.save(folder / "a.npy", ROWS)
    return folder / "a.npy"


def mat_structure(folder: Path) -> Path:
    from scipy.io import savemat

    imu = {"t": ROWS[:, 0], "wb": ROWS[:, 1:4], "fb": ROWS[:, 4:], "freq": 100.0}
    savemat(folder / "a.mat", {"imu": imu}, do_compression=True)
    return folder / "a.mat"


def mat(**options: Any) -> Make:
    def make(folder: Path) -> Path:
        from scipy.io import savemat

        arrays = {"t": ROWS[:, 0], "gyro": ROWS[:, 1:4], "acc": ROWS[:, 4:]}
        savemat(folder / "a.mat", arrays, **options)
        return folder / "a.mat"

    return make


def hdf5(folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file["t"] = ROWS[:, 0]
        for name, columns in (("gyro", ROWS[:, 1:4]), ("acc", ROWS[:, 4:])):
            file.create_dataset(name, data=columns.T, chunks=(3, 40), compression="gzip")
    data = bytearray((folder / "a.mat").read_bytes())
    data[:19] = b"MATLAB 7.3 MAT-file"
    (folder / "a.mat").write_bytes(data)
    return folder / "a.mat"


def bag(kind: str, part: str = "*.*[!l]", **options: Any) -> Make:
    """Return a maker of a bag; of a folder it gives the file that matches `part`."""

    def make(folder: Path) -> Path:
        from rosbags import rosbag1, rosbag2

        settings = dict(options)
        if "lz4" in settings or "bz2" in settings:
            (name,) = settings
            settings = {"compression": (getattr(rosbag1.Writer.CompressionFormat, name.upper()),)}
        elif "mode" in settings:
            mode = getattr(rosbag2.CompressionMode, settings.pop("mode"))
            settings["compression"] = (mode, rosbag2.CompressionFormat.ZSTD)
        path = write_bag(folder / "a.bag", {"/imu": ROWS}, kind, **settings)
        return next(path.glob(part)) if path.is_dir() else path

    return make


def sidecar(folder: Path) -> Path:
    put("a.csv", lambda: make_text(ROWS))(folder)
    return put("a.csv.toml", lambda: SIDECAR)(folder)


def asked(name: str, damaged: Path) -> Path:
    """Return what is read where this file is damaged."""
    if name.startswith(FOLDERS):
        return damaged.parent
    return damaged.with_suffix("") if name == "sidecar" else damaged


def psins() -> str:
    rows = np.rint(ROWS[:, 1:] / 1e-5).astype(int).tolist()
    head = "% PSINS\n0 0 0 0 0 0\n40 116 50 0 10 9.8\n0.1 0.1 0.1 20 20 20\n"
    return head + "\n".join(" ".join(map(str, row)) for row in rows) + "\n"


def novatel(make: Callable[..., bytes]) -> bytes:
    rows = (novatel_row("RAWIMUSX", 2209, t, c, imu_type=26) for t, c in COUNTS)
    return b"".join(make("RAWIMUSX", row) for row in rows)


def reference() -> str:
    head = "t [s],lat [deg],lon [deg],height [m],heading [deg],pitch [deg],roll [deg]\n"
    rows = [f"{t:.2f},40.{k:05d},116.0,50.0,30.0,0.1,0.2" for k, t in enumerate(ROWS[:, 0])]
    return head + "\n".join(rows) + "\n"


def truth(folder: Path) -> Path:
    import pyarrow as pa

    from schuler.io.sealed import write_sealed

    n = len(ROWS)
    names = ("lat [deg]", "lon [deg]", "height [m]")
    table = pa.table({"t [s]": ROWS[:, 0], **{k: np.linspace(1.0, 2.0, n) for k in names}})
    about = {"schuler": json.dumps({"seed": 1})}
    write_sealed(table, folder / "a.parquet", about, compression="zstd", use_dictionary=False)
    return folder / "a.parquet"


SIDECAR = """columns = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
gyro = "0.1 deg/s"
accel = "mg"
time = "s"
axes = "FRD"
delimiter = ","
skip_rows = 0
header = true
mean_rates = false
"""
KF = {"format": "kf-gins"}
RAD = {"gyro": "rad", "accel": "m/s"}

#: of a bag's folder, one file is damaged and the folder is read
FOLDERS = "folder-"

#: name -> (what the worker does, how the file is made, options, sealed by a checksum)
BASES: dict[str, tuple[str, Make, dict[str, Any], bool]] = {
    "csv": ("record", put("a.csv", lambda: make_text(ROWS)), {}, False),
    "csv-own": ("record", own(".csv"), {}, False),
    "csv-semicolons": ("record", put("a.csv", lambda: make_text(ROWS, ";").replace(".", ",")),
                       {}, False),
    "text-blanks": ("record", put("a.txt", lambda: make_text(ROWS, " ", header=None)), {}, False),
    "csv-gzip": ("record", put("a.csv.gz", lambda: gzip.compress(make_text(ROWS).encode())),
                 {}, False),
    "parquet-own": ("record", own(".parquet"), {}, True),
    "parquet": ("record", foreign_parquet, {}, False),
    "npz-own": ("record", own(".npz"), {}, True),
    "npz": ("record", foreign_npz, {}, False),
    "npy": ("record", npy, {}, False),
    "mat-structure": ("record", mat_structure, {}, False),
    "mat-5": ("record", mat(), {}, False),
    "mat-5-zlib": ("record", mat(do_compression=True), {}, False),
    "mat-4": ("record", mat(format="4"), {}, False),
    "mat-7.3": ("record", hdf5, {}, False),
    "psins": ("record", put("a.imu", psins), {}, False),
    "bin": ("record", put("a.bin", ROWS.tobytes), {}, False),
    "ros1": ("record", bag("ros1"), {}, False),
    "ros1-lz4": ("record", bag("ros1", lz4=True), {}, False),
    "ros1-bz2": ("record", bag("ros1", bz2=True), {}, False),
    "ros2-sqlite": ("record", bag("sqlite"), {}, False),
    "ros2-mcap": ("record", bag("mcap"), {}, False),
    "ros2-mcap-zstd": ("record", bag("mcap", mode="STORAGE"), {}, False),
    "folder-sqlite": ("record", bag("sqlite", "*.yaml"), {}, False),
    "folder-messages": ("record", bag("sqlite", mode="MESSAGE"), {}, False),
    "folder-file": ("record", bag("sqlite", "*.zstd", mode="FILE"), {}, False),
    "ulog": ("record", put("a.ulg", lambda: ulog_file([("vehicle_imu", 0, vehicle_imu(ROWS))])),
             {}, False),
    "ulog-rates": ("record", put("a.ulg", lambda: ulog_file(
        [("sensor_combined", 0, sensor_combined(ROWS))])), {}, False),
    "novatel-ascii": ("record", put("a.asc", lambda: novatel(novatel_ascii)), {}, False),
    "novatel-binary": ("record", put("a.gps", lambda: novatel(novatel_binary)), {}, False),
    "kf-gins-text": ("record", put("a.txt", lambda: make_text(ROWS, " ", header=None)), KF, False),
    "kf-gins-binary": ("record", put("a.bin", ROWS.tobytes), KF, False),
    "sidecar": ("record", sidecar, {}, False),
    "reference": ("reference", put("a.csv", reference), {}, False),
    "truth": ("reference", truth, {}, True),
    "gnss-nmea": ("gnss", put("a.txt", lambda: gnss.nmea(sigma=True)), {}, False),
    "gnss-ubx": ("gnss", put("a.ubx", gnss.ubx), {}, False),
    "gnss-novatel": ("gnss", put("a.gps", gnss.novatel_binary), {}, False),
    "gnss-novatel-ascii": ("gnss", put("a.asc", gnss.novatel_ascii), {}, False),
    "gnss-inspvax": ("gnss", put("a.gps", lambda: gnss.novatel_binary("INSPVAX")), {}, False),
    "gnss-psins": ("gnss", gnss.psins, {}, False),
    "gnss-ulog": ("gnss", put("a.ulg", gnss.ulog), {}, False),
    "gnss-ros1": ("gnss", gnss.bag, {"velocity_topic": "/vel"}, False),
    "gnss-mcap": ("gnss", lambda folder: gnss.bag(folder, "mcap"), {}, False),
    "gnss-table": ("gnss", put("a.csv", gnss.csv), {}, False),
    "gnss-gzip": ("gnss", put("a.gz", lambda: gzip.compress(gnss.csv())), {}, False),
    "gnss-rtklib": ("gnss", put("a.pos", gnss.rtklib), {}, False),
    "aid-heading": ("aid", put("a.txt", gnss.nmea), {"read": "read_heading"}, False),
    "aid-height": ("aid", put("a.csv", lambda: "time,pressure [hPa],sd\n" + "".join(
        f"{k},{1013.25 + 0.1 * k},0.5\n" for k in range(60))), {"read": "read_height"}, False),
    "aid-dvl": ("aid", put("a.csv", lambda: "time,vx,vy,vz,valid\n" + "".join(
        f"{k},0.1,{2.0 + 0.01 * k},0,1\n" for k in range(60))), {"read": "read_dvl"}, False),
    "aid-speed": ("aid", put("a.csv", lambda: "time,speed [km/h]\n" + "".join(
        f"{k},{30 + k}\n" for k in range(60))), {"read": "read_speed"}, False),
    "aid-odometry": ("aid", gnss.bag, {"read": "read_dvl", "topic": "/odom"}, False),
    "gnss-kf-gins": ("gnss", put("a.txt", gnss.kfgins), {}, False),
}  # fmt: skip
