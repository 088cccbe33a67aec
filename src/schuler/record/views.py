"""A record as a pandas table or an xarray dataset, with units, for other programs to work on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError, installed

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from schuler.record.imu import ImuRecord

__all__ = ["UNITS", "about", "channels", "to_pandas", "to_xarray"]

#: units of what a record holds
UNITS = {"time": "s", "dt": "s", "dtheta": "rad", "dvel": "m/s"}


def about(record: ImuRecord) -> dict[str, Any]:
    """Return what a table's numbers do not say themselves."""
    return {
        "kind": "increments",
        "axes": "RFU",
        "name": record.name,
        "coning_corrected": record.coning_corrected,
        "sculling_corrected": record.sculling_corrected,
    }


def channels(stem: str, count: int) -> list[str]:
    """Return the names of a sensor's channels: by axis, or by number for a redundant array."""
    return [f"{stem}_{axis}" for axis in ("xyz" if count == 3 else range(1, count + 1))]


def pandas_module() -> Any:
    """Return pandas.

    Raises
    ------
    InputError
        If it is not installed.
    """
    with installed("a table needs pandas", "pandas", InputError):
        import pandas as pd
    return pd


def to_pandas(record: ImuRecord) -> pd.DataFrame:
    """See `ImuRecord.to_pandas`."""
    pd = pandas_module()
    names = ["dt"]
    for stem, array in (("dtheta", record.dtheta), ("dvel", record.dvel)):
        names += channels(stem, array.shape[1])
    frame = pd.DataFrame(
        np.column_stack([record.dt, record.dtheta, record.dvel]),
        index=pd.Index(record.time, name="time"),
        columns=names,
    )
    frame.attrs.update(about(record), units=dict(UNITS))
    return frame


def to_xarray(record: ImuRecord) -> xr.Dataset:
    """See `ImuRecord.to_xarray`."""
    with installed("a dataset needs xarray", "xarray", InputError):
        import xarray as xr
    variables: dict[str, Any] = {"dt": ("time", record.dt, {"units": UNITS["dt"]})}
    coordinates: dict[str, Any] = {"time": ("time", record.time, {"units": UNITS["time"]})}
    for key, array, axis in (
        ("dtheta", record.dtheta, "gyro"), ("dvel", record.dvel, "accel"),
    ):  # fmt: skip
        count = array.shape[1]
        variables[key] = (("time", axis), array, {"units": UNITS[key]})
        names = ["x", "y", "z"] if count == 3 else [str(k + 1) for k in range(count)]
        coordinates[axis] = (axis, names)
    flags = {k: int(v) if isinstance(v, bool) else v for k, v in about(record).items()}
    return xr.Dataset(variables, coordinates, attrs=flags)
