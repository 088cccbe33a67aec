"""What an aid says is held against the fixes before a filter takes it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.clock import no_overlap
from schuler.aiding.gnss import GnssFixes
from schuler.aiding.speed import BodySpeed
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["check_speed", "inside"]

Array = NDArray[np.float64]

_FEWEST, _SLOW = 20, 2.0
"""Speeds above 2 m/s that a comparison needs, and how fast they are."""

_UNITS = {3.6: "km/h", 2.2369: "mph", 1.9438: "knots", 0.27778: "m/s read as km/h", 100.0: "cm/s",
          1000.0: "mm/s"}  # fmt: skip
_UNIT_OFF, _OFF = 0.12, 0.3
"""A ratio is that of a unit within so much; one further from 1 than the second is a mistake."""

_SIDE = 0.5
"""Share of the speed along another axis than forward that is no slip."""


def inside(name: str, time: Array, record: ImuRecord, clock: str = "unstated") -> NDArray[np.bool_]:
    """Return which times of an aid lie within a record.

    Raises
    ------
    InputError
        If there are none: it names both spans and the likely cause.
    """
    within = np.asarray((time > record.start) & (time <= record.end))
    if not np.any(within):
        span = float(time[0]), float(time[-1])
        raise no_overlap(name, clock, span, (record.start, record.end))
    return within


def check_speed(speed: BodySpeed, gnss: GnssFixes) -> None:
    """Refuse speeds that have other units, another sign or other axes than they are said to have.

    Parameters
    ----------
    speed : BodySpeed
    gnss : GnssFixes
        Without velocities nothing is checked.

    Raises
    ------
    InputError
        With the numbers and the likely cause.
    """
    if gnss.v_n is None:
        return
    when, time = np.asarray(gnss.time) - gnss.delay, np.asarray(speed.time)
    own = np.asarray(speed.value, np.float64)
    triple = own if own.ndim == 2 else np.column_stack([0.0 * own, own, 0.0 * own])
    within = (when >= time[0]) & (when <= time[-1])
    truth = np.linalg.norm(np.asarray(gnss.v_n)[within], axis=1)
    moving = truth > _SLOW
    if moving.sum() < _FEWEST:
        return
    truth = truth[moving]
    said = np.column_stack([np.interp(when[within][moving], time, c) for c in triple.T])
    ratio = (said * truth[:, None]).sum(axis=0) / np.sum(truth**2)
    whole = float(np.median(np.linalg.norm(said, axis=1) / truth))
    told = f"{speed.name}: where the fixes are at {np.sqrt(np.mean(truth**2)):.3g} m/s rms, "
    for factor, unit in _UNITS.items():
        if abs(whole / factor - 1.0) < _UNIT_OFF:
            raise InputError(
                f"{told}its speed is {whole:.3g} times theirs: it seems to be in {unit}; name the "
                "unit in the column, as speed [km/h]"
            )
    if abs(whole - 1.0) > _OFF:
        raise InputError(
            f"{told}its speed is {whole:.3g} times theirs: are its unit and its clock right?"
        )
    largest = int(np.argmax(np.abs(ratio)))
    if own.ndim == 2 and largest != 1 and abs(ratio[largest]) > _SIDE + abs(ratio[1]):
        axis = ["right", "forward", "up"][largest]
        raise InputError(
            f"{told}it has {ratio[largest]:.2f} of it along the axis that is read as {axis} and "
            f"{ratio[1]:.2f} forward: its axes are not right, forward, up; say its frame, as FRD"
        )
    if ratio[1] < 0.0:
        raise InputError(
            f"{told}its forward speed is {ratio[1]:.2f} times theirs: its sign is turned"
        )
