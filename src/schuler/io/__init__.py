"""Files in and out: one sample has one meaning, settled on import.

`read` gives a whole record, `open_source` a `Source` that is read in pieces or while it grows,
`write` saves a record; `read_trajectory` and `write_trajectory` are for trajectories. Formats: text
tables (CSV, TSV, semicolons, blanks), Parquet, NumPy's npz, MATLAB's mat, PSINS .imu, ROS bags, PX4
ULog, NovAtel SPAN, KF-GINS and plain float64 records;
`readers` lists them, `register` adds one. Tables of pandas, xarray and pyins come in and go out in
memory.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from schuler.errors import expect
from schuler.io.aid_kind import AID_KINDS, aid_kind
from schuler.io.aid_tables import read_dvl, read_heading, read_height
from schuler.io.aiding import read_gnss, read_speed
from schuler.io.content import Content, Reader
from schuler.io.frames import from_pandas, from_pyins, from_xarray, to_pyins
from schuler.io.mapping import Mapping
from schuler.io.redundant import array_increments
from schuler.io.registry import readers, register
from schuler.io.source import Source
from schuler.io.span import Span
from schuler.io.trajectory import read_trajectory
from schuler.io.trajectory_write import write_trajectory
from schuler.io.write import write
from schuler.record import ImuRecord

__all__ = [
    "AID_KINDS",
    "Content",
    "Mapping",
    "Reader",
    "Source",
    "aid_kind",
    "array_increments",
    "from_pandas",
    "from_pyins",
    "from_xarray",
    "open_source",
    "read",
    "read_dvl",
    "read_gnss",
    "read_heading",
    "read_height",
    "read_speed",
    "read_trajectory",
    "readers",
    "register",
    "to_pyins",
    "write",
    "write_trajectory",
]


def open_source(
    path: str | Path,
    mapping: Mapping | str | Path | None = None,
    *,
    max_gap: float | None = None,
    keep_spikes: bool = False,
    wait: float | None = None,
    gyro_bias: float | None = None,
    **mapping_overrides: Any,
) -> Source:
    """Open a file and settle what its numbers mean, without reading them.

    Parameters
    ----------
    path : str or Path
        The file, or the folder of a ROS 2 bag; ``"-"`` is standard input (text).
    mapping : Mapping, str or Path, optional
        What is known about the file, or a TOML file that says it. A sidecar ``truck.csv.toml``
        beside ``truck.csv`` is used by itself; what is given here wins over it.
    max_gap : float, optional
        Longest gap that is bridged, s; six and a half sampling intervals when not given.
    keep_spikes : bool
        Take single bad samples as they are, instead of naming them and leaving them out.
    wait : float, optional
        How long to wait for the first row of a text file that has only begun to grow, s.
    gyro_bias : float, optional
        What a gyro's bias may be (1 sigma, rad/s): the gyros of an array may differ by that.
    **mapping_overrides
        Single fields of `Mapping`, which win over `mapping`: ``gyro="deg/s"``, ``axes="FRD"``.

    Returns
    -------
    Source
        Its `meaning` says in one sentence what the numbers are taken for.

    Raises
    ------
    InputError
        If the file cannot be opened or understood.

    Examples
    --------
    >>> source = sc.open_source("imu.csv")
    >>> sum(len(chunk) for chunk in source.chunks())
    1200
    """
    if mapping is not None and not isinstance(mapping, Mapping):
        mapping = Mapping.from_toml(mapping)
    if mapping_overrides:
        mapping = (mapping or Mapping()).merged(Mapping.from_cli(**mapping_overrides))
    return Source(
        path, mapping, max_gap=max_gap, keep_spikes=keep_spikes, wait=wait, gyro_bias=gyro_bias
    )


def read(
    path: str | Path,
    mapping: Mapping | str | Path | None = None,
    *,
    start: float | str | None = None,
    stop: float | str | None = None,
    max_gap: float | None = None,
    keep_spikes: bool = False,
    **mapping_overrides: Any,
) -> ImuRecord:
    """Read a file into a record.

    Parameters
    ----------
    path, mapping, max_gap, keep_spikes, **mapping_overrides
        As for `open_source`.
    start, stop : float or str, optional
        Read only this stretch of the file's own time, s; rows outside are not checked. With a
        plus, ``"+60s"``, it counts from the first row.

    Returns
    -------
    ImuRecord
        Increments in SI and body axes (RFU), with `quality` set.

    Raises
    ------
    InputError
        If the file cannot be opened or understood, or a row cannot be used: one sentence with
        the file, the row, its time and what to do.

    Examples
    --------
    >>> len(sc.read("imu.csv")), len(sc.read("imu.csv", start=10.0, stop=20.0))
    (1200, 200)
    """
    expect(path, (str, Path), "path", "a table in memory is read by schuler.io.from_pandas")
    Span.of(start, stop)  # a bad one is said before the file is opened
    source = open_source(
        path, mapping, max_gap=max_gap, keep_spikes=keep_spikes, **mapping_overrides
    )
    return source.read(start=start, stop=stop)
