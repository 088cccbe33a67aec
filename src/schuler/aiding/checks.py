"""What an aid says is held against the fixes before a filter takes it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.aiding.clock import no_overlap
from schuler.aiding.gnss import GnssFixes
from schuler.aiding.speed import BodySpeed
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["check_clock", "check_speed", "inside"]

Array = NDArray[np.float64]

_FEWEST, _SLOW = 20, 2.0
"""Speeds above 2 m/s that a comparison needs, and how fast they are."""

_UNITS = {3.6: "km/h", 2.2369: "mph", 1.9438: "knots", 0.27778: "m/s read as km/h", 100.0: "cm/s",
          1000.0: "mm/s"}  # fmt: skip
_UNIT_OFF, _OFF = 0.12, 0.3
"""A ratio is that of a unit within so much; one further from 1 than the second is a mistake."""

_BIN, _FARTHEST = 0.5, 25.0
"""Turn rates are compared in steps of so long, at lags of at most so much, s."""

_LAG, _ALIKE = 0.9, 0.8
"""A lag of the fixes beyond the first (s) is one of clocks where the turns correlate so well."""

_TURNS = 0.03
"""Root mean square of the turn rate that a comparison needs, rad/s."""

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


def check_clock(record: ImuRecord, gnss: GnssFixes) -> None:
    """Refuse fixes whose turns are those of the record at another time.

    The rate about the vertical needs no axes: the vertical is where the mean specific force points.

    Parameters
    ----------
    record : ImuRecord
    gnss : GnssFixes
        Without velocities, or without turns, nothing is checked.

    Raises
    ------
    InputError
        With the difference of the clocks.
    """
    if gnss.v_n is None or len(gnss) < _FEWEST:
        return
    time, v = np.asarray(gnss.time) - gnss.delay, np.asarray(gnss.v_n)
    edges = np.arange(max(time[0], record.start), min(time[-1], record.end), _BIN)
    if len(edges) < 4 * _FARTHEST / _BIN:
        return
    middle = 0.5 * (edges[1:] + edges[:-1])
    course = np.unwrap(np.arctan2(v[:, 1], v[:, 0]))
    turn = np.diff(np.interp(edges, time, course)) / _BIN
    speed = np.interp(middle, time, np.hypot(v[:, 0], v[:, 1]))
    near = np.interp(middle, time[1:], np.diff(time)) < 2.0
    force = record.accel.mean(axis=0)
    stamps = np.concatenate([[record.start], record.time])
    angle = np.concatenate([[0.0], np.cumsum(record.dtheta @ (force / np.linalg.norm(force)))])
    use = (speed > _SLOW) & near
    if use.sum() < len(middle) / 4 or np.sqrt(np.mean(turn[use] ** 2)) < _TURNS:
        return
    lags, found = _correlations(stamps, angle, edges, turn, use)
    best, now = int(np.argmax(found)), float(found[len(lags) // 2])
    # The nearer to one, the less it takes to be clearly better than as stamped.
    clear = 1.0 - now > 3.0 * (1.0 - found[best]) + 0.05
    if abs(lags[best]) < _LAG or found[best] < _ALIKE or not clear:
        return
    lag = float(lags[best])
    cause = "leap seconds?" if abs(abs(lag) - 18.0) < 0.75 else "are both on one clock?"
    raise InputError(
        f"{gnss.name}: its turns are those of the record with its times moved by {lag:+.1f} s "
        f"(correlation {found[best]:.2f} there, {now:.2f} as stamped): {cause} An offset of "
        f"{lag:+.1f} s of its times brings them together"
    )


def _correlations(
    stamps: Array, angle: Array, edges: Array, turn: Array, use: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return lags, and how turn rates of fixes agree with those of the record so much later."""
    most, n = round(_FARTHEST / _BIN), len(turn)
    steps = np.arange(-most, most + 1)
    grid = edges[0] + _BIN * np.arange(-most, n + most + 1)
    rate = np.diff(np.interp(grid, stamps, angle)) / _BIN
    known = (grid[:-1] >= stamps[0]) & (grid[1:] <= stamps[-1])
    window = np.lib.stride_tricks.sliding_window_view
    inside = window(known, n) & use
    count = np.maximum(inside.sum(axis=1), 1)[:, None]
    a, b = np.where(inside, turn, 0.0), np.where(inside, window(rate, n), 0.0)
    a = np.where(inside, a - a.sum(axis=1, keepdims=True) / count, 0.0)
    b = np.where(inside, b - b.sum(axis=1, keepdims=True) / count, 0.0)
    size = np.sqrt(np.sum(a**2, axis=1) * np.sum(b**2, axis=1))
    found = np.sum(a * b, axis=1) / np.maximum(size, 1e-300)
    lags = np.asarray(_BIN * steps, np.float64)
    return lags, np.asarray(np.where(inside.sum(axis=1) < _FEWEST, 0.0, found))
