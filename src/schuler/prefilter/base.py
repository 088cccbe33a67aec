"""What every prefilter is, and how channels of a record are taken apart and put together."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import rotate
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = [
    "CHANNELS",
    "FRAMES",
    "Chain",
    "Prefilter",
    "PrefilterStream",
    "check_channels",
    "each_channel",
    "even_interval",
    "uneven_sample",
]

Array = NDArray[np.float64]

CHANNELS = ("accel", "gyro", "both")
FRAMES = ("inertial", "body")


class PrefilterStream(Protocol):
    """A prefilter that takes a record in chunks; the bits of its samples do not depend on them."""

    def push(self, chunk: ImuRecord) -> ImuRecord:
        """Take a chunk and return the filtered samples that are ready, possibly none."""

    def close(self) -> ImuRecord:
        """Return the samples that are still held, possibly none: the stream has ended."""

    def copy(self) -> PrefilterStream:
        """Return a stream that continues by itself from here."""


@dataclass(frozen=True)
class Prefilter(ABC):
    """Record to record; options are the fields of the dataclass.

    ``LowPass(0.05) | Gate(0.003)`` is a `Chain`.

    Examples
    --------
    >>> isinstance(sc.LowPass(1.0), Prefilter)
    True
    """

    @property
    def streams(self) -> bool:
        """Whether the filter can take a record in chunks, in memory that does not grow."""
        return False

    def stream(self) -> PrefilterStream:
        """Return a filter of the same options that takes chunks.

        Raises
        ------
        InputError
            If the filter needs the whole record.
        """
        raise InputError(f"the prefilter {self} needs the whole record: it cannot run on a stream")

    @abstractmethod
    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record."""

    def at(self, gravity: float) -> Prefilter:
        """Return the filter for a place with so much gravity, m/s^2."""
        return self

    def __or__(self, other: Prefilter) -> Chain:
        return Chain((*_links(self), *_links(other)))

    def to_table(self) -> Any:
        """Return name and options, or a list of them."""
        from schuler.prefilter.registry import PREFILTERS

        return PREFILTERS.to_table(self)

    def __str__(self) -> str:
        from schuler.prefilter.registry import PREFILTERS

        return PREFILTERS.text(self)


@dataclass(frozen=True)
class Chain(Prefilter):
    """Prefilters one after another.

    Parameters
    ----------
    filters : tuple of Prefilter
        In the order in which they are applied.

    Examples
    --------
    >>> chain = sc.LowPass(cutoff=0.1) | sc.Gate(width=0.003)
    >>> len(chain.filters)
    2
    """

    filters: tuple[Prefilter, ...]

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the record after the last filter."""
        for each in self.filters:
            record = each(record)
        return record

    def at(self, gravity: float) -> Prefilter:
        """Return the chain for a place with so much gravity, m/s^2."""
        return Chain(tuple(each.at(gravity) for each in self.filters))

    @property
    def streams(self) -> bool:
        """Whether each of the filters can take a record in chunks."""
        return all(each.streams for each in self.filters)

    def stream(self) -> PrefilterStream:
        """Return the chain for chunks.

        Raises
        ------
        InputError
            If one of the filters needs the whole record.
        """
        return _ChainStream([each.stream() for each in self.filters])

    def to_table(self) -> list[dict[str, Any]]:
        """Return name and options of each filter."""
        return [each.to_table() for each in self.filters]

    def __str__(self) -> str:
        return " | ".join(map(str, self.filters))


class _ChainStream:
    """Streams one after another."""

    def __init__(self, streams: list[PrefilterStream]) -> None:
        self._streams = streams

    def push(self, chunk: ImuRecord) -> ImuRecord:
        for each in self._streams:
            chunk = each.push(chunk)
        return chunk

    def close(self) -> ImuRecord:
        rest = self._streams[0].close()
        for each in self._streams[1:]:
            ready = each.push(rest)
            rest = ImuRecord.concatenate([ready, each.close()])
        return rest

    def copy(self) -> PrefilterStream:
        return _ChainStream([each.copy() for each in self._streams])


def _links(each: Prefilter) -> tuple[Prefilter, ...]:
    return each.filters if isinstance(each, Chain) else (each,)


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
    uneven = uneven_sample(record, interval)
    if uneven is not None:
        raise InputError(uneven)
    return interval


def uneven_sample(record: ImuRecord, interval: float) -> str | None:
    """Return which sample is far from an interval, s, in a sentence; None if none is."""
    uneven = np.flatnonzero(np.abs(record.dt - interval) > 0.05 * interval)
    if not len(uneven):
        return None
    return (
        "a prefilter needs even sampling, but the sample at "
        f"t = {record.time[uneven[0]]:.9g} s took {record.dt[uneven[0]]:.4g} s instead of "
        f"{interval:.4g} s: cut the record there (--start, --stop)"
    )


def check_channels(channels: str, frame: str) -> None:
    """Refuse a choice that `each_channel` does not have.

    Raises
    ------
    InputError
        Naming the choices.
    """
    if channels not in CHANNELS:
        raise InputError(f"channels must be accel, gyro or both, got '{channels}'")
    if frame not in FRAMES:
        raise InputError(f"frame must be inertial or body, got '{frame}'")


def each_channel(
    record: ImuRecord, channels: str, frame: str, function: Callable[[Array], Array]
) -> ImuRecord:
    """Apply a function to the rate of each channel and return the record of the results.

    Channels go to threads side by side: the kernels release the interpreter's lock.

    Parameters
    ----------
    record : ImuRecord
    channels : {"accel", "gyro", "both"}
    frame : {"inertial", "body"}
        Where the force is filtered. In the inertial frame that the gyros hold, gravity turns with
        the Earth only, and a body's sway does not look like a disturbance.
    function : callable
        (n,) rates to (n,) rates, rad/s or m/s^2.

    Raises
    ------
    InputError
        For another choice of channels or frame.
    """
    check_channels(channels, frame)
    dt = record.dt[:, None]
    rates = {}
    if channels != "accel":
        rates["dtheta"] = record.gyro
    turn: Array | None = None
    if channels != "gyro":
        rates["dvel"] = record.accel
        if frame == "inertial":
            turn = held_frame(record)
            rates["dvel"] = rotate(turn, record.accel)
    jobs = [(name, k) for name, x in rates.items() for k in range(x.shape[1])]

    def run(job: tuple[str, int]) -> Array:
        name, k = job
        return function(np.ascontiguousarray(rates[name][:, k]))

    with ThreadPoolExecutor() as pool:
        found = dict(zip(jobs, pool.map(run, jobs), strict=True))
    out = {
        name: np.column_stack([found[name, k] for k in range(x.shape[1])])
        for name, x in rates.items()
    }
    if turn is not None:
        out["dvel"] = rotate(turn * [1.0, -1.0, -1.0, -1.0], out["dvel"])
    return replace(
        record,
        dtheta=out["dtheta"] * dt if "dtheta" in out else record.dtheta,
        dvel=out["dvel"] * dt if "dvel" in out else record.dvel,
    )


def held_frame(record: ImuRecord) -> Array:
    """Return quat_ib0_b (n, 4) at the middle of each sample: the frame that the gyros hold."""
    from schuler.kernels.tracking import attitudes

    out = np.empty((len(record), 4))
    start = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    attitudes(start, float(not record.coning_corrected), record.dtheta, out)
    return out
