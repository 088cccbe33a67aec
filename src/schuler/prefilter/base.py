"""What every prefilter is, and how channels of a record are taken apart and put together."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["CHANNELS", "Prefilter", "each_channel", "even_interval"]

Array = NDArray[np.float64]

CHANNELS = ("accel", "gyro", "both")


class Prefilter(Protocol):
    """Record to record."""

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record."""
        ...


def even_interval(record: ImuRecord) -> float:
    """Return the sampling interval, s.

    Raises
    ------
    InputError
        If the record is too short or its sampling is uneven: filters count samples.
    """
    if len(record) < 16:
        raise InputError(f"a prefilter needs 16 samples at least, the record has {len(record)}")
    interval = float(np.median(record.dt))
    uneven = np.flatnonzero(np.abs(record.dt - interval) > 0.05 * interval)
    if len(uneven):
        raise InputError(
            "a prefilter needs even sampling, but the sample at "
            f"t = {record.time[uneven[0]]:.9g} s took {record.dt[uneven[0]]:.4g} s instead of "
            f"{interval:.4g} s: cut the record there (--start, --stop)"
        )
    return interval


def each_channel(record: ImuRecord, channels: str, function: Callable[[Array], Array]) -> ImuRecord:
    """Apply a function to the rate of each channel and return the record of the results.

    Channels go to threads side by side: the kernels release the interpreter's lock.

    Parameters
    ----------
    record : ImuRecord
    channels : {"accel", "gyro", "both"}
    function : callable
        (n,) rates to (n,) rates, rad/s or m/s^2.

    Raises
    ------
    InputError
        For another choice of channels.
    """
    if channels not in CHANNELS:
        raise InputError(f"channels must be accel, gyro or both, got '{channels}'")
    jobs: list[tuple[str, int]] = []
    if channels in ("gyro", "both"):
        jobs += [("dtheta", k) for k in range(record.dtheta.shape[1])]
    if channels in ("accel", "both"):
        jobs += [("dvel", k) for k in range(record.dvel.shape[1])]
    out = {"dtheta": record.dtheta.copy(), "dvel": record.dvel.copy()}

    def run(job: tuple[str, int]) -> None:
        name, k = job
        rate = np.ascontiguousarray(getattr(record, name)[:, k] / record.dt)
        out[name][:, k] = function(rate) * record.dt

    with ThreadPoolExecutor() as pool:
        list(pool.map(run, jobs))
    return replace(record, dtheta=out["dtheta"], dvel=out["dvel"])
