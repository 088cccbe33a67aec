"""Forward speed of an odometer: a speed, the counts of pulses, a distance, or four wheels."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError

__all__ = ["ODOMETER_NAMES", "PAIRS", "ForwardSpeed", "counts_pulses", "forward_speed"]

Array = NDArray[np.float64]

_WHEELS = ("fl", "fr", "rl", "rr")
_LONG = {"fl": "frontleft", "fr": "frontright", "rl": "rearleft", "rr": "rearright"}

#: which wheels a speed is the mean of; the unsteered pair is the rear one of nearly every car
PAIRS = {"rear": ("rl", "rr"), "front": ("fl", "fr"), "all": _WHEELS}

#: plain column name -> role
ODOMETER_NAMES = {
    **dict.fromkeys(("pulses", "pulsecount", "counts", "ticks", "encoder"), "pulses"),
    **dict.fromkeys(("distance", "odometerdistance", "travelled"), "distance"),
    **{
        form: wheel
        for wheel in _WHEELS
        for form in (wheel, f"wheel{wheel}", f"wheelspeed{wheel}", f"v{wheel}", f"speed{wheel}",
                     _LONG[wheel], f"wheel{_LONG[wheel]}")
    },
}  # fmt: skip

_INTERVAL = 0.1
"""Least time over which counts are differenced, s: shorter, a pulse is a coarse speed."""

_FASTEST = 150.0
"""Speed (m/s) that a count cannot show: it has wrapped, or started anew."""

_JUMPS = 0.02
"""Share of such rows beyond which counts are something else."""


@dataclass(frozen=True, eq=False)
class ForwardSpeed:
    """Forward speeds at times.

    Parameters
    ----------
    time, speed : (n,) float64
    sigma : float
        1-sigma that counting adds, m/s.
    dropped : dict of str to int
        Rows left out, by reason.
    notes : tuple of str
        How the speed was made.
    """

    time: Array
    speed: Array
    sigma: float = 0.0
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def counts_pulses(names: Collection[str]) -> bool:
    """Say whether columns of these roles give a speed by pulses, whose length must be said."""
    return "pulses" in names and not {"speed", *_WHEELS} & set(names)


def forward_speed(
    table: dict[str, Array], pulse_length: float | None, wheels: str | None
) -> ForwardSpeed:
    """Return forward speed from the columns of a table.

    Parameters
    ----------
    table : dict of str to array
        Times ``t``, and ``speed``, ``pulses`` or ``distance`` (both counted since the start), or
        wheels ``fl``, ``fr``, ``rl``, ``rr``.
    pulse_length : float or None
        Metres to a pulse.
    wheels : {"rear", "front", "all"} or None

    Raises
    ------
    InputError
        If there is no such column, a pulse has no length, or counts are not counts.
    """
    if wheels is not None and wheels not in PAIRS:
        raise InputError(f"wheels must be {', '.join(PAIRS)}, got '{wheels}'")
    there = [wheel for wheel in _WHEELS if wheel in table]
    counts = next((name for name in ("pulses", "distance") if name in table), None)
    if pulse_length is not None and counts != "pulses":
        raise InputError("a length of a pulse is for a column pulses, which there is not")
    if wheels is None and "speed" in table:
        return ForwardSpeed(table["t"], table["speed"])
    if there:
        return _mean(table, there, wheels or "rear")
    if wheels is not None:
        raise InputError("wheels are columns fl, fr, rl, rr (front left ...), and there are none")
    if counts is None:
        raise InputError(
            "no column of speeds was found; name it speed, pulses or distance, fl, fr, rl, rr of "
            "four wheels, or vx, vy, vz"
        )
    if counts == "distance":
        return _differences(table["t"], table["distance"], 0.0, "distance")
    if pulse_length is None or not np.isfinite(pulse_length) or pulse_length <= 0.0:
        raise InputError(
            "it counts pulses: say how many metres one is, as 0.0208 (--odometer-scale)"
        )
    return _differences(table["t"], pulse_length * table["pulses"], pulse_length, "pulses")


def _mean(table: dict[str, Array], there: list[str], wheels: str) -> ForwardSpeed:
    wanted = PAIRS[wheels]
    missing = [wheel for wheel in wanted if wheel not in there]
    if missing:
        raise InputError(
            f"the {wheels} wheels need columns {', '.join(wanted)}; there is {', '.join(there)}"
        )
    speed = np.mean([table[wheel] for wheel in wanted], axis=0)
    which = "all four" if wheels == "all" else f"the two {wheels}"
    return ForwardSpeed(table["t"], speed, notes=(f"speed is the mean of {which} wheels",))


def _differences(time: Array, way: Array, step: float, what: str) -> ForwardSpeed:
    """Return speeds over intervals, at their middles, from a way that is counted in steps."""
    whole = np.isfinite(time) & np.isfinite(way)
    dropped = {"a value that is no number": int(np.sum(~whole))} if not np.all(whole) else {}
    time, way = time[whole], way[whole]
    order = np.argsort(time, kind="stable")
    order = order[np.diff(time[order], prepend=-np.inf) > 0.0]
    time, way = time[order], way[order]
    if len(time) < 3:
        raise InputError(f"{what} need three rows at least")
    stride = max(round(_INTERVAL / float(np.median(np.diff(time)))), 1)
    time, way = time[::stride], way[::stride]
    span = np.diff(time)
    speed = np.diff(way) / span
    jumps = np.abs(speed) > _FASTEST
    turns = np.sum(speed[1:] * speed[:-1] < 0.0)
    if np.mean(jumps) > _JUMPS or turns > 0.3 * len(speed):
        raise InputError(
            f"its {what} do not grow as those of a vehicle do: they must be counted since the "
            "start, and not by the row; is the unit right?"
        )
    if np.any(jumps):
        dropped["a count that jumps"] = int(np.sum(jumps))
    # Each end of an interval is cut to a whole step.
    sigma = step / np.sqrt(6.0) / float(np.median(span))
    note = f"speed is {what} over {float(np.median(span)):.3g} s"
    return ForwardSpeed(
        (0.5 * (time[1:] + time[:-1]))[~jumps], speed[~jumps], sigma, dropped, (note,)
    )
