"""Saving a record: Parquet, CSV, npz, .mat or HDF5, whole or not at all, bit for bit."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from schuler._arrow import column_of
from schuler._files import replacing
from schuler.errors import InputError, how_to_install
from schuler.io.arrays import OWN
from schuler.io.dialect import MAGIC
from schuler.io.sealed import write_sealed
from schuler.io.trajectory_write import matlab_bytes
from schuler.record import ImuRecord

__all__ = ["write"]


def _columns(gyros: int) -> list[str]:
    """Return the columns of a saved table: increments over (t - dt, t], in right-forward-up axes.

    The gyros of an array, each along its own axis, are numbered from 1.
    """
    names = ("gx", "gy", "gz") if gyros == 3 else tuple(f"g{k}" for k in range(1, gyros + 1))
    return ["t [s]", "dt [s]", *(f"{g} [rad]" for g in names), "ax [m/s]", "ay [m/s]", "az [m/s]"]


def write(
    record: ImuRecord, path: str | Path, *, overwrite: bool = True, layout: str = "schuler"
) -> None:
    """Save a record; `read` gives its numbers and flags back bit for bit.

    The file appears whole or not at all: it is written under another name in the same folder
    and then renamed.

    Parameters
    ----------
    record : ImuRecord
        With three gyros, or the gyros of an array, and three accelerometers.
    path : str or Path
        Its suffix chooses the format: .parquet, .csv, .npz, .mat or .h5.
    overwrite : bool
        Whether a file of that name may be replaced.
    layout : {"schuler", "psins", "pyins"}
        "psins": a .mat whose ``imu`` has a row to a sample, three angle and three velocity
        increments (rad, m/s, right-forward-up) and the time at its end; "pyins": a .csv table of
        increments in forward-right-down, which begins a row early (`to_pyins`).

    Raises
    ------
    InputError
        If the suffix is unknown, the file exists and must not be replaced, the record is empty
        or has not three gyros or more, or the file cannot be written.

    Examples
    --------
    >>> sc.write(record, "again.parquet")
    >>> len(sc.read("again.parquet"))
    1200
    """
    path = Path(path)
    writers = _LAYOUTS.get(layout)
    if writers is None:
        raise InputError(f"layout must be one of {', '.join(_LAYOUTS)}, got '{layout}'")
    save = writers.get(path.suffix.lower())
    if save is None:
        own = "" if layout == "schuler" else f" in the layout of {layout}"
        raise InputError(
            f"{path}: cannot write the format '{path.suffix}'{own}; use {', '.join(writers)}"
        )
    if not len(record):
        raise InputError(f"{path}: the record has no samples, so there is nothing to write")
    if record.dtheta.shape[1] < 3 or record.dvel.shape[1] != 3:
        raise InputError(
            f"{path}: only records of three gyros or more and three accelerometers can be written, "
            f"this has {record.dtheta.shape[1]} and {record.dvel.shape[1]}"
        )
    if path.exists() and not overwrite:
        raise InputError(f"{path}: is there already; remove it or allow it to be replaced")
    gyros = record.dtheta.shape[1]
    about = json.dumps(
        {
            **({} if gyros == 3 else {"gyros": gyros}),
            "version": 1,
            "kind": "increments",
            "axes": "RFU",
            "name": record.name,
            "coning_corrected": record.coning_corrected,
            "sculling_corrected": record.sculling_corrected,
        }
    )
    with replacing(path) as part:
        save(record, part, about)


def _table(record: ImuRecord) -> Any:
    import pyarrow as pa

    columns = [record.time, record.dt, *record.dtheta.T, *record.dvel.T]
    return pa.table(
        [column_of(column) for column in columns],
        names=_columns(record.dtheta.shape[1]),
    )


def _write_parquet(record: ImuRecord, path: Path, about: str) -> None:
    # Measured values hardly repeat: a dictionary of them only costs.
    write_sealed(
        _table(record), path, {"schuler": about},
        compression="zstd", use_dictionary=False, row_group_size=1 << 18,
    )  # fmt: skip


def _write_csv(record: ImuRecord, path: Path, about: str) -> None:
    from pyarrow import csv

    with path.open("wb") as file:
        file.write(f"{MAGIC}{about}\n{','.join(_columns(record.dtheta.shape[1]))}\n".encode())
        options = csv.WriteOptions(include_header=False, quoting_style="none")
        # Arrow writes the shortest text that reads back as the same number.
        csv.write_csv(_table(record), file, options)


def _arrays(record: ImuRecord) -> dict[str, Any]:
    return {
        "time": record.time, "dt": record.dt, "dtheta": record.dtheta, "dvel": record.dvel,
    }  # fmt: skip


def _codes(about: str) -> Any:
    """Return a text as the codes of its characters: numbers go into any file of arrays."""
    return np.frombuffer(about.encode(), np.uint8)


def _write_npz(record: ImuRecord, path: Path, about: str) -> None:
    with path.open("wb") as file:
        np.savez(file, **_arrays(record), schuler=np.array(about))


def _write_mat(record: ImuRecord, path: Path, about: str) -> None:
    path.write_bytes(matlab_bytes({**_arrays(record), OWN: _codes(about)}, "a record"))


def _write_hdf5(record: ImuRecord, path: Path, about: str) -> None:
    try:
        import h5py
    except ImportError:
        raise InputError(f"HDF5 needs h5py: {how_to_install('mat')}") from None
    with h5py.File(path, "w", track_order=True) as file:
        for name, values in {**_arrays(record), OWN: _codes(about)}.items():
            # MATLAB keeps its columns as rows of HDF5, and so do its 7.3 files.
            file.create_dataset(name, data=values.T, track_times=False)


def _write_psins(record: ImuRecord, path: Path, _: str) -> None:
    if record.dtheta.shape[1] != 3:
        raise InputError(f"PSINS takes three gyros, this record has {record.dtheta.shape[1]}")
    path.write_bytes(
        matlab_bytes(
            {"imu": np.column_stack([record.dtheta, record.dvel, record.time])}, "imu of PSINS"
        )
    )


def _write_pyins(record: ImuRecord, path: Path, _: str) -> None:
    from schuler.io.frames import to_pyins

    to_pyins(record).to_csv(path, index_label="time", lineterminator="\n")


_Writer = Callable[[ImuRecord, Path, str], None]

_LAYOUTS: dict[str, dict[str, _Writer]] = {
    "schuler": {
        ".parquet": _write_parquet,
        ".csv": _write_csv,
        ".npz": _write_npz,
        ".mat": _write_mat,
        ".h5": _write_hdf5,
        ".hdf5": _write_hdf5,
    },
    "psins": {".mat": _write_psins},
    "pyins": {".csv": _write_pyins},
}
