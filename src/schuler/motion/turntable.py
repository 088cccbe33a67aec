"""Turntables and rotation schemes: dwells and turns with limits on rate and acceleration.

A turn's acceleration is a raised cosine, so that angle, rate and acceleration are continuous and
no limit is broken: speeding up by w takes 2 w / alpha.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.motion.base import Track, angles_track

__all__ = [
    "Dwell", "Spin", "Turn", "Turntable", "continuous_rotation", "four_position", "two_axis_16",
]  # fmt: skip

Array = NDArray[np.float64]

AXES = ("psi", "theta", "gamma")


@dataclass(frozen=True)
class Dwell:
    """Stand still for a time, s.

    Examples
    --------
    >>> Turntable((Dwell(60.0),)).period
    60.0
    """

    time: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.time) and self.time >= 0):
            raise InputError(f"a dwell must be a time of 0 s or more, got {self.time}")


@dataclass(frozen=True)
class Turn:
    """Turn one axis by an angle.

    Parameters
    ----------
    axis : {"psi", "theta", "gamma"}
        Outer, middle or inner axis; positive angles are counter-clockwise.
    angle : float
        deg.
    rate, acceleration : float
        Limits, deg/s and deg/s^2.

    Examples
    --------
    >>> Turn("psi", 90.0, rate=10.0, acceleration=20.0).time
    10.0
    """

    axis: str
    angle: float
    rate: float = 10.0
    acceleration: float = 20.0

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise InputError(f"a turn's axis must be psi, theta or gamma, got '{self.axis}'")
        if not np.isfinite(self.angle):
            raise InputError(f"a turn's angle must be finite, got {self.angle}")
        if not (self.rate > 0 and self.acceleration > 0):
            raise InputError(
                f"a turn's limits must be positive, got {self.rate} deg/s and "
                f"{self.acceleration} deg/s^2"
            )

    @property
    def profile(self) -> tuple[float, float, float]:
        """Rate that is reached (deg/s), time to reach it and time at it (s)."""
        way = abs(self.angle)
        # A turn too short for the full rate speeds up half of its way.
        rate = min(self.rate, np.sqrt(0.5 * self.acceleration * way))
        if rate == 0.0:
            return 0.0, 0.0, 0.0
        ramp = 2.0 * rate / self.acceleration
        return float(rate), float(ramp), float(way / rate - ramp)

    @property
    def time(self) -> float:
        """How long it takes, s."""
        _, ramp, hold = self.profile
        return 2.0 * ramp + hold

    def at(self, x: Array) -> Array:
        """Return angle, rate and acceleration (n, 3), rad, at times x since its start."""
        rate, ramp, hold = self.profile
        if rate == 0.0:
            return np.zeros((len(x), 3))
        x = np.clip(x, 0.0, self.time)
        up, down = np.minimum(x, ramp), np.maximum(x - ramp - hold, 0.0)
        middle = np.clip(x - ramp, 0.0, hold)

        def speed_up(y: Array) -> tuple[Array, Array, Array]:
            u = y / ramp
            angle = rate * ramp * (0.5 * u**2 + (np.cos(2 * np.pi * u) - 1.0) / (4 * np.pi**2))
            return (
                angle,
                rate * (u - np.sin(2 * np.pi * u) / (2 * np.pi)),
                rate / ramp * (1.0 - np.cos(2 * np.pi * u)),
            )

        a0, r0, c0 = speed_up(up)
        a1, r1, c1 = speed_up(down)
        out = np.column_stack([a0 + rate * middle + rate * down - a1, r0 - r1, c0 - c1])
        return np.asarray(np.sign(self.angle) * DEG * out)


@dataclass(frozen=True)
class Spin:
    """Turn one axis at a constant rate for a time, with no speeding up: for ever if it repeats.

    Parameters
    ----------
    axis : {"psi", "theta", "gamma"}
    rate : float
        deg/s, counter-clockwise positive.
    time : float
        s.

    Examples
    --------
    >>> Spin("psi", rate=6.0, time=10.0).angle
    60.0
    """

    axis: str
    rate: float
    time: float

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise InputError(f"a spin's axis must be psi, theta or gamma, got '{self.axis}'")
        if not (np.isfinite(self.rate) and np.isfinite(self.time) and self.time > 0):
            raise InputError(
                f"a spin needs a finite rate and a positive time, got {self.rate} deg/s for "
                f"{self.time} s"
            )

    @property
    def angle(self) -> float:
        """How far it turns, deg."""
        return self.rate * self.time

    def at(self, x: Array) -> Array:
        """Return angle, rate and acceleration (n, 3), rad, at times x since its start."""
        inside = (x >= 0.0) & (x <= self.time)
        angle = self.rate * np.clip(x, 0.0, self.time)
        return DEG * np.column_stack([angle, self.rate * inside, np.zeros(len(x))])


@dataclass(frozen=True)
class Turntable:
    """A turntable with up to three axes that runs a list of steps, once or for ever.

    Parameters
    ----------
    steps : sequence of Dwell, Turn and Spin
    start : (3,) tuple
        psi, theta, gamma at the start, deg.
    repeat : bool
        Begin again after the last step.
    lever : (3,) tuple
        From the axes' crossing to the IMU, in body axes, m.

    Examples
    --------
    >>> table = Turntable((Dwell(60.0), Turn("psi", 180.0)), start=(30.0, 0.0, 0.0))
    >>> round(table.period, 1)
    79.0
    """

    steps: Sequence[Dwell | Turn | Spin]
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    repeat: bool = False
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def period(self) -> float:
        """Time of all steps, s."""
        return float(sum(step.time for step in self.steps))

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        angles = np.zeros((len(t), 3, 3))
        angles[:, :, 0] = np.array(self.start) * DEG
        period = self.period
        if not period > 0:
            return angles_track(angles, self.lever)
        turns = np.floor_divide(t, period) if self.repeat else np.zeros(len(t))
        turns = np.maximum(turns, 0.0)
        x = t - turns * period
        begin = 0.0
        for step in self.steps:
            if not isinstance(step, Dwell):
                k = AXES.index(step.axis)
                angles[:, k] += step.at(x - begin)
                # What earlier rounds have left turned.
                angles[:, k, 0] += turns * step.angle * DEG
            begin += step.time
        return angles_track(angles, self.lever)


def four_position(
    dwell: float, *, rate: float = 10.0, acceleration: float = 20.0, axis: str = "psi"
) -> Turntable:
    """Return the single-axis four-position scheme: +180, +90, -180, -90 deg, dwells between.

    Parameters
    ----------
    dwell : float
        s.
    rate, acceleration : float
        deg/s and deg/s^2.
    axis : {"psi", "theta", "gamma"}

    Examples
    --------
    >>> round(four_position(60.0).period)
    298
    """
    steps: list[Dwell | Turn] = []
    for angle in (180.0, 90.0, -180.0, -90.0):
        steps += [Dwell(dwell), Turn(axis, angle, rate, acceleration)]
    return Turntable(tuple(steps), repeat=True)


def two_axis_16(dwell: float, *, rate: float = 10.0, acceleration: float = 20.0) -> Turntable:
    """Return a two-axis scheme of sixteen half turns about psi and gamma that undo each other.

    Parameters
    ----------
    dwell : float
        s.
    rate, acceleration : float
        deg/s and deg/s^2.

    Examples
    --------
    >>> len(two_axis_16(20.0).steps)
    32
    """
    order = [("psi", 1), ("gamma", 1), ("psi", 1), ("gamma", 1),
             ("gamma", 1), ("psi", 1), ("gamma", 1), ("psi", 1)]  # fmt: skip
    steps: list[Dwell | Turn] = []
    for sign in (1, -1):
        for axis, way in order:
            steps += [Dwell(dwell), Turn(axis, 180.0 * sign * way, rate, acceleration)]
    return Turntable(tuple(steps), repeat=True)


def continuous_rotation(
    rate: float, *, turns: int = 1, acceleration: float = 20.0, axis: str = "psi"
) -> Turntable:
    """Return continuous rotation: so many turns one way, then as many back.

    Parameters
    ----------
    rate, acceleration : float
        deg/s and deg/s^2.
    turns : int
        Whole turns before it reverses.
    axis : {"psi", "theta", "gamma"}

    Examples
    --------
    >>> round(continuous_rotation(6.0).period)
    121
    """
    if turns < 1:
        raise InputError(f"turns must be 1 or more, got {turns}")
    angle = 360.0 * turns
    return Turntable(
        (Turn(axis, angle, rate, acceleration), Turn(axis, -angle, rate, acceleration)),
        repeat=True,
    )
