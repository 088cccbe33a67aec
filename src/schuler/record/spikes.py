"""Single bad samples: what is known of each, and how to leave them out of a record in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.kernels.states import IntakeRow, SpikeRow

if TYPE_CHECKING:
    from schuler.record.imu import ImuRecord

__all__ = ["Spike", "spike_text", "spikes_warning", "without_spikes"]

Array = NDArray[np.float64]

#: rows that are looked at before anything is judged; fixed, so that chunking cannot matter
WARM_UP = 256

_ALLOWED, _ALLOWED_A_ROW = 10, 1e-4
"""Bad samples that are left out: so many, and so many more to a row."""

_SHOWN = 5
"""Spikes that a warning lists."""


@dataclass(frozen=True)
class Spike:
    """A sample that was left out.

    Parameters
    ----------
    row : int
        Data row of the file, or sample of a record in memory, counted from 1.
    time : float
        s.
    channel : str
        ``"gyro x"`` ... ``"accel z"``.
    value, replaced_by : float
        What came and what took its place, SI.
    unit : str
        Unit of both: rad/s, m/s^2, or for increments rad, m/s.
    """

    row: int
    time: float
    channel: str
    value: float
    replaced_by: float
    unit: str

    @classmethod
    def from_row(cls, found: Array, kind: str) -> Spike:
        """Make one of what `schuler.kernels.spikes.screen` found."""
        from schuler.record.quality import CHANNELS

        row = SpikeRow(found)
        j = int(row.channel)
        increments = kind == "increments"
        unit = ("rad" if j < 3 else "m/s") if increments else ("rad/s" if j < 3 else "m/s^2")
        return cls(
            int(row.row),
            float(row.time),
            CHANNELS[j],
            float(row.value),
            float(row.replaced_by),
            unit,
        )


def spike_text(spike: Spike) -> str:
    """Say where a spike is and what it was, in the field's units."""
    value, unit = spike.value, spike.unit
    if unit.startswith("rad"):
        value, unit = value / DEG, unit.replace("rad", "deg")
    return f"row {spike.row} (t = {spike.time:.10g} s), {spike.channel}, {value:.6g} {unit}"


def spikes_warning(spikes: Sequence[Spike]) -> str:
    """Say in one sentence which samples were left out."""
    rows = len({spike.row for spike in spikes})
    listed = "; ".join(spike_text(spike) for spike in spikes[:_SHOWN])
    more = f" and {len(spikes) - _SHOWN} more" if len(spikes) > _SHOWN else ""
    said = "1 sample was left out as a spike" if rows == 1 else (
        f"{rows} samples were left out as spikes"
    )  # fmt: skip
    return f"{said}: {listed}{more}"


def allowed(rows: int) -> int:
    """Return how many bad samples are left out of so many rows."""
    return int(_ALLOWED + _ALLOWED_A_ROW * rows)


def check_count(found: Array, kind: str) -> None:
    """Refuse more than a few bad samples; rows (n, 5) as `schuler.kernels.spikes.screen` gives.

    Raises
    ------
    InputError
        At the first that is too many, whatever follows.
    """
    over = np.flatnonzero(
        np.arange(1, len(found) + 1) > _ALLOWED + _ALLOWED_A_ROW * SpikeRow(found).row
    )
    if len(over):
        last = SpikeRow(found[over[0]])
        raise InputError(
            f"{over[0] + 1} samples up to data row {int(last.row)} (t = {float(last.time):.10g} s) "
            "stand far beyond both neighbours, the first at "
            f"{spike_text(Spike.from_row(found[0], kind))}: more than a few bad samples; mend the "
            "record, or keep them with --keep-spikes"
        )


def without_spikes(record: ImuRecord) -> tuple[ImuRecord, tuple[Spike, ...]]:
    """Return a record with its single bad samples replaced, and what they were.

    The tests are those that rows of a file undergo (`schuler.kernels.spikes`); a record that has
    been through an `Intake`, as its `quality` says, needs no more of them.

    Parameters
    ----------
    record : ImuRecord
        Of three gyros and three accelerometers; another comes back as it is.

    Raises
    ------
    InputError
        If more than a few samples are bad.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler.record import ImuRecord, without_spikes
    >>> time = np.arange(1, 301) / 100
    >>> noise = np.random.default_rng(1).normal(scale=1e-6, size=(300, 6))
    >>> noise[100, 2] = 0.05
    >>> bad = ImuRecord(time, np.full(300, 0.01), noise[:, :3], noise[:, 3:])
    >>> good, spikes = without_spikes(bad)
    >>> [(spike.row, spike.channel) for spike in spikes]
    [(101, 'gyro z')]
    """
    from schuler.kernels import spikes as k

    n = len(record)
    if n < k.LEAST or record.dtheta.shape[1] != 3 or record.dvel.shape[1] != 3:
        return record, ()
    named = IntakeRow.zeros(n)
    named.number = np.arange(1.0, n + 1)
    named.time = record.time
    named.values = np.hstack([record.dtheta, record.dvel])
    named.missing = np.where(np.abs(record.dt / np.median(record.dt) - 1.0) > 0.2, -1.0, 0.0)
    rows = named.data
    settings = np.zeros((6, k.SETTING))
    first = min(n, WARM_UP)
    k.set_smallest(settings, float(np.median(record.dt)), True)
    k.learn(rows, first, settings, np.empty(first))
    found = np.empty((allowed(n) + 1, SpikeRow.size))
    _, count = k.screen(
        rows, n, 0, first, True, settings, found, np.empty(k.WORK), np.zeros(6, np.int64)
    )
    if not count:
        return record, ()
    check_count(found[:count], "increments")
    mended = replace(record, dtheta=named.values[:, :3].copy(), dvel=named.values[:, 3:].copy())
    return mended, tuple(Spike.from_row(row, "increments") for row in found[:count])
