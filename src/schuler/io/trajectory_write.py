"""Writing trajectories: tables (CSV, Parquet, npz), JSON lines, GPX, KML, and peers' layouts."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._arrow import column_of
from schuler._files import replacing
from schuler.attitude import quat_to_euler
from schuler.errors import InputError
from schuler.io.sealed import write_sealed
from schuler.io.tracks import gpx_library, gpx_text, kml_text
from schuler.trajectory import Trajectory

__all__ = [
    "SUFFIXES", "check_trajectory_target", "matlab_bytes", "table_columns", "write_trajectory",
]  # fmt: skip

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

_MATLAB_HEAD = b"MATLAB 5.0 MAT-file, %s by schuler"
"""Text at the beginning of a .mat file; SciPy's own has the time of day in it."""

_MATLAB_TEXT = 116
"""Bytes of that text."""


@dataclass(frozen=True)
class _Kind:
    """A format: its layouts, and what writes it to a file."""

    layouts: tuple[str, ...]
    write: Callable[[Path, Trajectory, str, Mapping[str, Any]], None]


def check_trajectory_target(path: str | Path, layout: str = "schuler") -> None:
    """Refuse a name or layout that `write_trajectory` cannot write, before the work.

    Raises
    ------
    InputError
        For a suffix that is no format, a layout that the format has not, or a library that is
        missing.
    """
    if _kind_of(Path(path), layout) is _KINDS[".gpx"]:
        gpx_library()


def _kind_of(path: Path, layout: str) -> _Kind:
    if layout not in _LAYOUTS:
        raise InputError(f"layout must be one of {', '.join(_LAYOUTS)}, got '{layout}'")
    suffix = path.suffix.lower()
    fitting = [each for each, kind in _KINDS.items() if layout in kind.layouts]
    if suffix not in fitting:
        own = "a trajectory" if layout == "schuler" else f"a trajectory in the layout of {layout}"
        raise InputError(
            f"{path}: cannot write {own} as '{suffix}'; use {', '.join(fitting[:-1])} or "
            f"{fitting[-1]}"
        )
    return _KINDS[suffix]


def write_trajectory(
    trajectory: Trajectory,
    path: str | Path,
    about: Mapping[str, Any] | None = None,
    *,
    layout: str = "schuler",
) -> None:
    """Save a trajectory, whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
    path : str or Path
        Its suffix chooses the format: .parquet, .csv or .npz; .jsonl (an object to a row); .gpx
        and .kml (position alone, for maps); .txt and .mat for the layout of PSINS. Heights are
        above the ellipsoid in all of them.
    about : mapping, optional
        What else is worth keeping (scenario, seed, the errors that were put in), as JSON in the
        metadata of a Parquet file under ``schuler``. ``utc`` is the Unix time, s, at which the
        trajectory's time is zero: tracks in GPX have their times by it.
    layout : {"schuler", "pyins", "psins"}
        Names, order and units of the columns, as in `read_trajectory`.

    Raises
    ------
    InputError
        For another suffix or layout, a layout that needs what the trajectory lacks, or if the file
        cannot be written.

    Examples
    --------
    >>> sc.write_trajectory(made.truth, "truth.csv")
    >>> len(sc.read_trajectory("truth.csv").time)
    1201
    """
    path = Path(path)
    kind = _kind_of(path, layout)
    if not len(trajectory):
        raise InputError(f"{path}: the trajectory has no rows, so there is nothing to write")
    with replacing(path) as part:
        kind.write(part, trajectory, layout, about or {})


def _own(trajectory: Trajectory) -> dict[str, Array]:
    return trajectory.columns()


def _as_pyins(trajectory: Trajectory) -> dict[str, Array]:
    """Return the columns of a pyins table; velocity is north, east, down."""
    trajectory.known("quat_nb")
    own = trajectory.columns()
    east, north, up = trajectory.known("v_n").T
    return {
        "time": own["t [s]"], "lat": own["lat [deg]"], "lon": own["lon [deg]"],
        "alt": own["height [m]"], "VN": north, "VE": east, "VD": -up,
        "roll": own["roll [deg]"], "pitch": own["pitch [deg]"], "heading": own["heading [deg]"],
    }  # fmt: skip


def _as_psins(trajectory: Trajectory) -> dict[str, Array]:
    """Return the ten columns of PSINS's avp."""
    psi, theta, gamma = quat_to_euler(trajectory.known("quat_nb")).T
    east, north, up = trajectory.known("v_n").T
    return {
        "pitch": theta, "roll": gamma, "yaw": psi, "ve": east, "vn": north, "vu": up,
        "lat": trajectory.lat, "lon": trajectory.lon, "height": trajectory.height,
        "t": trajectory.time,
    }  # fmt: skip


_LAYOUTS: dict[str, Callable[[Trajectory], dict[str, Array]]] = {
    "schuler": _own, "pyins": _as_pyins, "psins": _as_psins
}  # fmt: skip


def table_columns(trajectory: Trajectory, layout: str) -> dict[str, Array]:
    """Return the columns of a layout of `write_trajectory` by their names."""
    return _LAYOUTS[layout](trajectory)


def _npz(part: Path, trajectory: Trajectory, layout: str, _: Mapping[str, Any]) -> None:
    columns: Any = _LAYOUTS[layout](trajectory)
    with part.open("wb") as file:
        np.savez(file, **columns)


def _parquet(part: Path, trajectory: Trajectory, layout: str, about: Mapping[str, Any]) -> None:
    import pyarrow as pa

    columns = _LAYOUTS[layout](trajectory)
    table = pa.table({k: column_of(v) for k, v in columns.items()})
    write_sealed(
        table, part, {"schuler": json.dumps(dict(about), allow_nan=False)},
        compression="zstd", use_dictionary=False, row_group_size=1 << 18,
    )  # fmt: skip


def _csv(part: Path, trajectory: Trajectory, layout: str, _: Mapping[str, Any]) -> None:
    columns = _LAYOUTS[layout](trajectory)
    _write_rows(part, None if layout == "psins" else ",".join(columns), columns, ",")


def _txt(part: Path, trajectory: Trajectory, layout: str, _: Mapping[str, Any]) -> None:
    _write_rows(part, None, _LAYOUTS[layout](trajectory), "  ")


def _write_rows(part: Path, names: str | None, columns: Columns, apart: str) -> None:
    with part.open("w", encoding="utf-8", newline="\n") as file:
        if names is not None:
            file.write(f"{names}\n")
        for row in np.column_stack(list(columns.values())).tolist():
            file.write(apart.join(map(repr, row)) + "\n")


def _jsonl(part: Path, trajectory: Trajectory, layout: str, _: Mapping[str, Any]) -> None:
    columns = _LAYOUTS[layout](trajectory)
    # JSON's names have no brackets: "v_east [m/s]" is v_east_mps.
    names = [
        name.replace(" [", "_").replace("]", "").replace("m/s", "mps") for name in columns
    ]  # fmt: skip
    with part.open("w", encoding="utf-8", newline="\n") as file:
        for row in np.column_stack(list(columns.values())).tolist():
            file.write(json.dumps(dict(zip(names, row, strict=True)), allow_nan=False) + "\n")


def _gpx(part: Path, trajectory: Trajectory, _: str, about: Mapping[str, Any]) -> None:
    part.write_text(gpx_text(trajectory, about.get("utc")), encoding="utf-8", newline="\n")


def _kml(part: Path, trajectory: Trajectory, _: str, __: Mapping[str, Any]) -> None:
    part.write_text(kml_text(trajectory), encoding="utf-8", newline="\n")


def _mat(part: Path, trajectory: Trajectory, layout: str, _: Mapping[str, Any]) -> None:
    avp = np.column_stack(list(_LAYOUTS[layout](trajectory).values()))
    part.write_bytes(matlab_bytes({"avp": avp}, "avp of PSINS"))


def matlab_bytes(arrays: Mapping[str, Any], what: str) -> bytes:
    """Return a MATLAB 5 file of arrays, the same bytes for the same values.

    Parameters
    ----------
    arrays : mapping of str to array
    what : str
        What they are, for the file's head.
    """
    from scipy.io import savemat

    held = io.BytesIO()
    savemat(held, dict(arrays), do_compression=True, oned_as="column")
    head = (_MATLAB_HEAD % what.encode()).ljust(_MATLAB_TEXT)
    return head + held.getvalue()[_MATLAB_TEXT:]


_TABLES = ("schuler", "pyins")
_KINDS = {
    ".parquet": _Kind(_TABLES, _parquet), ".pq": _Kind(_TABLES, _parquet),
    ".csv": _Kind((*_TABLES, "psins"), _csv), ".npz": _Kind((*_TABLES, "psins"), _npz),
    ".jsonl": _Kind(_TABLES, _jsonl), ".gpx": _Kind(("schuler",), _gpx),
    ".kml": _Kind(("schuler",), _kml), ".txt": _Kind(("psins",), _txt),
    ".mat": _Kind(("psins",), _mat),
}  # fmt: skip

#: suffixes of names that `write_trajectory` can write
SUFFIXES = tuple(_KINDS)
