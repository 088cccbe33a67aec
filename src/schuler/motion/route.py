"""Routes: a vehicle, ship or aircraft that accelerates, turns and climbs.

Speed, course and climb change by smooth steps, one manoeuvre after the other; the body points
along its velocity and, where asked, banks so that its passengers do not slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG, STANDARD_GRAVITY
from schuler.errors import InputError
from schuler.motion.base import Track

__all__ = ["Manoeuvre", "Route"]

Array = NDArray[np.float64]

_GRID = 0.05
_GAUSS: tuple[Array, Array] = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class Manoeuvre:
    """What changes over a time.

    Parameters
    ----------
    time : float
        s.
    speed, turn, climb : float
        Change of speed (m/s), of course (deg, clockwise) and of the path's angle above level
        (deg).

    Examples
    --------
    >>> Manoeuvre(10.0, speed=5.0, turn=90.0)
    Manoeuvre(time=10.0, speed=5.0, turn=90.0, climb=0.0)
    """

    time: float
    speed: float = 0.0
    turn: float = 0.0
    climb: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.time) and self.time > 0):
            raise InputError(f"a manoeuvre must take a positive time, got {self.time} s")


def _step(x: Array) -> Array:
    """Return a smooth step from 0 to 1 with three derivatives, (n, 4), for x from 0 to 1."""
    inside = (x > 0) & (x < 1)
    u = np.clip(x, 0.0, 1.0)
    a = 2 * np.pi * u
    return np.column_stack(
        [
            u - np.sin(a) / (2 * np.pi),
            np.where(inside, 1.0 - np.cos(a), 0.0),
            np.where(inside, 2 * np.pi * np.sin(a), 0.0),
            np.where(inside, 4 * np.pi**2 * np.cos(a), 0.0),
        ]
    )


@dataclass(frozen=True)
class Route:
    """A route; after its last manoeuvre it goes on straight.

    Parameters
    ----------
    manoeuvres : sequence of Manoeuvre
    heading : float
        Course at the start, clockwise from north, deg.
    speed : float
        m/s at the start.
    coordinated : bool
        Bank in turns.
    lever : (3,) tuple
        To the IMU, body axes, m.

    Examples
    --------
    >>> route = Route([Manoeuvre(10.0, turn=90.0)], speed=10.0)
    >>> route.duration
    10.0
    """

    manoeuvres: Sequence[Manoeuvre]
    heading: float = 0.0
    speed: float = 0.0
    coordinated: bool = False
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def duration(self) -> float:
        """Time of all manoeuvres, s."""
        return float(sum(m.time for m in self.manoeuvres))

    def _controls(self, t: Array) -> tuple[Array, Array, Array]:
        """Return speed, psi and climb with three derivatives, (n, 4) each; m/s and rad."""
        if len(t) > 1 and np.any(t[1:] < t[:-1]):
            order = np.argsort(t)
            back = np.empty_like(order)
            back[order] = np.arange(len(t))
            speed, psi, climb = self._controls(t[order])
            return speed[back], psi[back], climb[back]
        speed, psi, climb = (np.zeros((len(t), 4)) for _ in range(3))
        speed[:, 0] = self.speed
        psi[:, 0] = -self.heading * DEG
        begin = 0.0
        for m in self.manoeuvres:
            # Before a manoeuvre nothing of it is there, after it all: only between is it computed,
            # and one row more at each end, as the times at both are rounded.
            first = max(0, int(np.searchsorted(t, begin)) - 1)
            last = int(np.searchsorted(t, begin + m.time, "right")) + 1
            during, after = slice(first, last), slice(last, None)
            shape = _step((t[during] - begin) / m.time) / m.time ** np.arange(4)
            for state, change in ((speed, m.speed), (psi, -m.turn * DEG), (climb, m.climb * DEG)):
                state[during] += change * shape
                state[after, 0] += change
            begin += m.time
        return speed, psi, climb

    def _velocity(self, t: Array) -> tuple[Array, Array]:
        """Return velocity and acceleration east, north, up, (n, 3)."""
        (s, ds), (p, dp), (c, dc) = (x[:, :2].T for x in self._controls(t))
        sp, cp, sc, cc = np.sin(p), np.cos(p), np.sin(c), np.cos(c)
        ahead = np.column_stack([-sp * cc, cp * cc, sc])
        turn = np.column_stack([-cp * cc, -sp * cc, 0 * sc]) * dp[:, None]
        lift = np.column_stack([sp * sc, -cp * sc, cc]) * dc[:, None]
        return s[:, None] * ahead, ds[:, None] * ahead + s[:, None] * (turn + lift)

    @cached_property
    def _way(self) -> Array:
        """Way at a grid of times to the end of the last manoeuvre, (k, 3)."""
        n = int(np.ceil(self.duration / _GRID)) + 1
        edges: Array = _GRID * np.arange(n + 1, dtype=np.float64)
        return np.vstack([np.zeros(3), np.cumsum(self._between(edges[:-1], edges[1:]), axis=0)])

    def _between(self, a: Array, b: Array) -> Array:
        """Return the way from times a to b, (n, 3)."""
        half, middle = 0.5 * (b - a), 0.5 * (a + b)
        out = np.zeros((len(a), 3))
        for x, w in zip(*_GAUSS, strict=True):
            out += w * self._velocity(middle + half * x)[0]
        return half[:, None] * out

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        grid = self._way
        k = np.clip((t / _GRID).astype(np.int64), 0, len(grid) - 1)
        velocity, acceleration = self._velocity(t)
        way = grid[k] + self._between(_GRID * k.astype(np.float64), t)
        path = np.stack([way, velocity, acceleration], axis=-1)
        speed, psi, climb = self._controls(t)
        angles = np.zeros((len(t), 1, 3, 3))
        angles[:, 0, 0] = psi[:, :3]
        angles[:, 0, 1] = climb[:, :3]
        if self.coordinated:
            angles[:, 0, 2] = _bank(speed, psi)
        return Track(path, angles, np.array([self.lever], np.float64))


def _bank(speed: Array, psi: Array) -> Array:
    """Return the roll that turns gravity and the turn's force into the floor, (n, 3)."""
    s, ds, dds = speed[:, :3].T
    w, dw, ddw = psi[:, 1:].T
    # Counter-clockwise turns (psi growing) lean to the left: roll is positive to the right.
    u = -s * w / STANDARD_GRAVITY
    du = -(ds * w + s * dw) / STANDARD_GRAVITY
    ddu = -(dds * w + 2 * ds * dw + s * ddw) / STANDARD_GRAVITY
    d = 1.0 + u**2
    return np.column_stack([np.arctan(u), du / d, ddu / d - 2 * u * du**2 / d**2])
