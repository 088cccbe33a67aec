"""Tables in memory: pandas, xarray and pyins in, and pyins out.

pyins (N. Mayorov) keeps IMU samples in a table whose index is time (s) and whose columns are
``gyro_x`` ... ``accel_z``, in SI: instantaneous rates at the row's time ('rate'), or increments
over the interval that ends there ('increment'). Its navigation frame is north-east-down, so body
axes that agree with it at rest are front-right-down. The first row of increments is one before
the beginning and its interval is unknown: pyins integrates from the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError, installed
from schuler.io.axes import parse_axes
from schuler.io.columns import choose
from schuler.io.content import Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.io.meaning import settle
from schuler.io.own import own_mapping
from schuler.record import ImuRecord, Intake

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["from_pandas", "from_pyins", "from_xarray", "to_pyins"]

_PYINS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
_TYPES = ("rate", "increment")


def from_pandas(
    frame: pd.DataFrame,
    mapping: Mapping | None = None,
    *,
    max_gap: float | None = None,
    **mapping_overrides: Any,
) -> ImuRecord:
    """Make a record from a table, as `schuler.read` does from a file with named columns.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns by name, as in a text file: ``t, gx ... az`` and their like, units in brackets; an
        index of numbers that has a name is one of them. What `ImuRecord.to_pandas` made says
        itself what it holds.
    mapping, max_gap, **mapping_overrides
        As for `schuler.open_source`.

    Raises
    ------
    InputError
        As `schuler.read`.

    Examples
    --------
    >>> from_pandas(record.to_pandas()).dtheta.shape
    (1200, 3)
    """
    given = (mapping or Mapping()).merged(Mapping.from_cli(**mapping_overrides))
    own = frame.attrs if frame.attrs.get("kind") == "increments" else None
    names = _names(frame)
    columns = [frame.iloc[:, k] for k in range(len(names))]
    index = frame.index
    numbered = isinstance(index.dtype, np.dtype) and index.dtype.kind in "iuf"
    if given.rate is None and numbered and index.name is not None:
        names, columns = [str(index.name), *names], [index, *columns]
    whole = Mapping(array=given.array)
    chosen = choose(names, len(names), whole if own else given)
    picked: dict[int, Array] = {}
    for k in chosen.all:
        if not isinstance(columns[k].dtype, np.dtype) or columns[k].dtype.kind not in "iuf":
            raise InputError(
                f"column '{names[k]}' is of type {columns[k].dtype}, not numbers; convert it "
                "(time to seconds)"
            )
        picked[k] = np.asarray(columns[k], np.float64)
    said = own_mapping(dict(own)).merged(chosen.said()) if own else chosen.said()
    content = Content(
        blocks=lambda: iter([(
            None if chosen.t is None else picked[chosen.t],
            [picked[k] for k in chosen.values],
            None if chosen.dt is None else picked[chosen.dt],
        )]),
        said=said,
        mark=chosen.mark,
        stamps=None if chosen.t is None else picked[chosen.t],
        name=str(own.get("name", "table")) if own else "table",
        complete=own is not None,
    )  # fmt: skip
    return _record(content, given, max_gap)


def from_xarray(dataset: xr.Dataset, *, max_gap: float | None = None) -> ImuRecord:
    """Make a record from a dataset that `ImuRecord.to_xarray` made, or one like it.

    Parameters
    ----------
    dataset : xarray.Dataset
        ``dtheta`` and ``dvel`` over time and an axis of three, ``dt`` where it is known, in rad,
        m/s and s; time as a coordinate, s.
    max_gap : float, optional
        As for `schuler.open_source`.

    Raises
    ------
    InputError
        If something is missing or of another shape or unit, and as `schuler.read`.

    Examples
    --------
    >>> from_xarray(record.to_xarray()).dtheta.shape
    (1200, 3)
    """
    arrays: dict[str, Array] = {}
    for key, unit in (("time", "s"), ("dtheta", "rad"), ("dvel", "m/s"), ("dt", "s")):
        if key not in dataset.variables:
            if key == "dt":
                continue
            raise InputError(f"the dataset has no '{key}'; it has {', '.join(map(str, dataset))}")
        found = dataset[key]
        if found.attrs.get("units", unit) != unit:
            raise InputError(f"'{key}' is in {found.attrs['units']}, expected {unit}; convert it")
        arrays[key] = np.asarray(found.values, np.float64)
    n = len(arrays["time"])
    for key in ("dtheta", "dvel"):
        if arrays[key].shape != (n, 3):
            raise InputError(f"'{key}' has shape {arrays[key].shape}, expected ({n}, 3)")
    values = np.hstack([arrays["dtheta"], arrays["dvel"]])
    content = Content(
        blocks=lambda: iter([(arrays["time"], values, arrays.get("dt"))]),
        said=own_mapping(dict(dataset.attrs)),
        name=str(dataset.attrs.get("name", "dataset")),
        complete=True,
    )
    return _record(content, Mapping(), max_gap)


def from_pyins(
    imu: pd.DataFrame,
    sensor_type: str,
    *,
    axes: str = "FRD",
    name: str = "pyins",
    max_gap: float | None = None,
) -> ImuRecord:
    """Make a record from a table of pyins.

    Parameters
    ----------
    imu : pandas.DataFrame
        As in the module's docstring.
    sensor_type : {"rate", "increment"}
        As for `pyins.strapdown.compute_increments_from_imu`.
    axes : str
        Where x, y, z point (`schuler.io.axes`).
    name, max_gap
        As for `schuler.record.Intake`.

    Raises
    ------
    InputError
        If columns are missing, the type is unknown, or a row cannot be used.

    Examples
    --------
    >>> from_pyins(to_pyins(record), "increment").dtheta.shape
    (1200, 3)
    """
    if sensor_type not in _TYPES:
        raise InputError(f"sensor_type must be 'rate' or 'increment', got '{sensor_type}'")
    missing = [column for column in _PYINS if column not in _names(imu)]
    if missing:
        raise InputError(
            f"the table has no {', '.join(missing)}; pyins names them {', '.join(_PYINS)}"
        )
    try:
        time = np.asarray(imu.index, np.float64)
        values = imu[list(_PYINS)].to_numpy(np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"the table's index and columns must be numbers ({error})") from None
    if len(time) < 2:
        raise InputError(f"the table has {len(time)} rows: at least two are needed")
    dt = None
    if sensor_type == "increment":
        dt, time, values = np.diff(time), time[1:], values[1:]
        if not np.all(dt > 0):
            row = int(np.argmin(dt > 0))
            raise InputError(f"time does not advance after row {row + 1} (t = {time[row]:.9g} s)")
    gyro, accel = ("rad/s", "m/s^2") if dt is None else ("rad", "m/s")
    content = Content(
        blocks=lambda: iter([(time, values, dt)]),
        said=Mapping(gyro=gyro, accel=accel, axes=axes),
        name=name,
    )
    return _record(content, Mapping(), max_gap)


def to_pyins(record: ImuRecord, *, axes: str = "FRD") -> pd.DataFrame:
    """Return a record as pyins takes it: increments, with one row before the beginning.

    pyins itself corrects increments for coning and sculling, so a record that is corrected
    already is refused.

    Parameters
    ----------
    record : ImuRecord
        With three gyros and three accelerometers, each sample beginning where the last one ends.
    axes : str
        Where the table's x, y, z point (`schuler.io.axes`).

    Returns
    -------
    pandas.DataFrame
        For `pyins.strapdown.compute_increments_from_imu` with ``sensor_type="increment"``.

    Raises
    ------
    InputError
        If pandas is not installed or the record is not as above.

    Examples
    --------
    >>> to_pyins(record).columns.tolist()[:3]
    ['gyro_x', 'gyro_y', 'gyro_z']
    """
    with installed("a table needs pandas", "pandas", InputError):
        import pandas as pd
    if not len(record) or record.dtheta.shape[1] != 3 or record.dvel.shape[1] != 3:
        raise InputError(
            f"pyins takes samples of three gyros and three accelerometers, got {len(record)} of "
            f"{record.dtheta.shape[1]} and {record.dvel.shape[1]}"
        )
    if record.coning_corrected or record.sculling_corrected:
        raise InputError(
            "pyins corrects increments for coning and sculling itself, and those of "
            f"'{record.name}' are corrected already"
        )
    time = np.concatenate([[record.start], record.time])
    hole = np.abs(np.diff(time) - record.dt) > 1e-3 * record.dt
    if np.any(hole):
        raise InputError(
            f"'{record.name}' has a hole before t = {record.time[np.argmax(hole)]:.9g} s, which a "
            "table of pyins cannot hold; cut the record there"
        )
    way = parse_axes(axes)
    values = np.empty((len(time), 6))
    for body in range(3):
        k, sign = way.take[body], way.sign[body]
        values[1:, k] = sign * record.dtheta[:, body]
        values[1:, 3 + k] = sign * record.dvel[:, body]
    values[0] = values[1]
    return pd.DataFrame(values, index=pd.Index(time, name="time"), columns=list(_PYINS))


def _names(frame: pd.DataFrame) -> list[str]:
    """Return a table's column names as texts."""
    return [str(name) for name in frame.columns]


def _record(content: Content, given: Mapping, max_gap: float | None) -> ImuRecord:
    """Settle what the numbers mean, check the rows and make the record."""
    meaning = settle(content, given, Mapping())
    m = meaning.mapping
    intake = Intake(
        meaning.kind,
        rate=m.rate,
        max_gap=max_gap,
        coning_corrected=bool(m.coning_corrected),
        sculling_corrected=bool(m.sculling_corrected),
        name=content.name or "table",
    )
    parts = []
    blocks: Iterator[Block] = content.blocks()
    done = 0
    for block in blocks:
        time, values, dt = meaning.convert(block, done)
        done += len(time)
        parts.append(intake.push(time, values, dt))
    parts.append(intake.close())
    return ImuRecord.concatenate([p for p in parts if len(p)], quality=intake.quality())
