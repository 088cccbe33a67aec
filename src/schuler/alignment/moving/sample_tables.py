"""Samples as tables of numbers and back, for a state that is saved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["check_table", "copied", "records_of", "table_of"]

Array = NDArray[np.float64]

_WIDTH = 8
"""Time, interval, angle and velocity increments."""


def copied(record: ImuRecord) -> ImuRecord:
    """Return a record that does not keep the larger one alive which it is cut from."""
    out = replace(
        record, time=record.time.copy(), dt=record.dt.copy(), dtheta=record.dtheta.copy(),
        dvel=record.dvel.copy(), quality=None,
    )  # fmt: skip
    return out.with_values(None if record.values is None else record.values.copy())


def table_of(name: str, parts: list[ImuRecord]) -> dict[str, Array]:
    """Return samples as arrays: rows, what the instrument has corrected, rates as they came."""
    if not parts:
        none = np.zeros((0, _WIDTH))
        return {name: none, f"{name}_flags": np.zeros(2), f"{name}_rates": none[:, :6]}
    whole = ImuRecord.concatenate(parts)
    return {
        name: np.column_stack([whole.time, whole.dt, whole.dtheta, whole.dvel]),
        f"{name}_flags": np.array([whole.coning_corrected, whole.sculling_corrected], np.float64),
        f"{name}_rates": np.zeros((0, 6)) if whole.values is None else whole.values,
    }


def records_of(name: str, arrays: Mapping[str, Array], record: str) -> list[ImuRecord]:
    """Return the samples that `table_of` made arrays of: one record, or none.

    Raises
    ------
    InputError
        If the arrays are not of that kind.
    """
    table = check_table(name, arrays.get(name), _WIDTH)
    rates = check_table(f"{name}_rates", arrays.get(f"{name}_rates"), 6, grows=False)
    flags = arrays.get(f"{name}_flags")
    if (
        flags is None or flags.shape != (2,) or not np.all(np.isfinite(table))
        or np.any(table[:, 1] <= 0.0) or len(rates) not in (0, len(table) + 1)
        or not np.all(np.isfinite(rates))
    ):  # fmt: skip
        raise InputError(f"the saved state of an alignment in motion is damaged: '{name}'")
    if not len(table):
        return []
    out = ImuRecord(
        table[:, 0].copy(), table[:, 1].copy(), table[:, 2:5].copy(), table[:, 5:8].copy(),
        bool(flags[0]), bool(flags[1]), record,
    )  # fmt: skip
    return [out.with_values(rates.copy() if len(rates) else None)]


def check_table(name: str, table: Array | None, width: int, *, grows: bool = True) -> Array:
    """Return a table of a saved state.

    Parameters
    ----------
    name : str
    table : (n, width) float64 or None
    width : int
    grows : bool
        Whether its first column are times, which increase.

    Raises
    ------
    InputError
        If it is missing, of another shape, or its times do not increase.
    """
    if (
        table is None or table.ndim != 2 or table.shape[1] != width
        or (grows and (not np.all(np.isfinite(table[:, 0])) or np.any(np.diff(table[:, 0]) <= 0.0)))
    ):  # fmt: skip
        raise InputError(f"the saved state of an alignment in motion is damaged: '{name}'")
    return table
