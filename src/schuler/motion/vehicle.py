"""A stationary vehicle: engine idling, wind, crew at work, boarding, slamming doors.

Everything is displacement-bounded. Boarding is a step of tilt and height that settles with the
suspension's ringing; a slammed door is a push of a few milliseconds on the same suspension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG, STANDARD_GRAVITY
from schuler.motion.base import Track
from schuler.motion.sway import CHANNELS, Band, Lines, Sway

__all__ = ["Crew", "DisturbedVehicle", "Event", "quiet_crew"]

Array = NDArray[np.float64]

_SETTLING = 0.15
"""Time constant with which a settling step without ringing comes to rest, s."""


@dataclass(frozen=True)
class Event:
    """Something that happens once.

    Parameters
    ----------
    time : float
        When it begins, s.
    channel : str
        One of `CHANNELS`.
    size : float
        Where the channel settles (deg or m) for a step; for a push the peak of the displacement
        that its ringing reaches, were it undamped.
    kind : {"settle", "board", "slam"}
        A smooth step; a step that rings; a push that rings and leaves nothing.
    ringing : float
        Hz.
    decay : float
        Time constant of the ringing, s.
    """

    time: float
    channel: str
    size: float
    kind: str = "settle"
    ringing: float = 1.5
    decay: float = 0.4

    @property
    def life(self) -> float:
        """Time after which it has settled to the last bit, s."""
        return 45.0 * (_SETTLING if self.kind == "settle" else self.decay)

    def _target(self, path: Array, angles: Array) -> tuple[Array, float]:
        """Return the channel (n, 3) in its array, and the size in rad or m."""
        k = CHANNELS.index(self.channel)
        if k >= 3:
            return path[:, k - 3], self.size
        return angles[:, k], self.size * DEG * (-1.0 if k == 0 else 1.0)

    def leave(self, path: Array, angles: Array) -> None:
        """Add what is left of the event once it has settled."""
        if self.kind != "slam":
            target, size = self._target(path, angles)
            target[:, 0] += size

    def add(self, t: Array, path: Array, angles: Array) -> None:
        """Add the event to a path and to the angles of one frame, both (n, 3, 3); t ascends."""
        target, size = self._target(path, angles)
        begin, end = np.searchsorted(t, [self.time, self.time + self.life])
        x = t[begin:end] - self.time
        if self.kind == "settle":
            value = _settle(x, _SETTLING)
        else:
            value = _ring(x, self.ringing, self.decay, self.kind == "board")
        target[begin:end] += size * value
        if self.kind != "slam":
            target[end:, 0] += size


def _settle(x: Array, tau: float) -> Array:
    """Return 1 - e^-u (1 + u + u^2/2 + u^3/6), u = x / tau, with derivatives (n, 3)."""
    u = x / tau
    e = np.exp(-u)
    return np.column_stack(
        [
            1.0 - e * (1.0 + u + u**2 / 2 + u**3 / 6),
            e * u**3 / 6 / tau,
            e * (u**2 / 2 - u**3 / 6) / tau**2,
        ]
    )


def _ring(x: Array, frequency: float, decay: float, step: bool) -> Array:
    """Return a damped ringing with derivatives (n, 3): towards a step, or towards nothing.

    It begins through the smooth rise of `_settle`, a twentieth of a period long, so that force
    and rate have no jump.
    """
    w = 2 * np.pi * frequency
    e = np.exp(-x / decay)
    s, c = np.sin(w * x), np.cos(w * x)
    a = 1.0 / decay
    if step:
        # 1 - e^(-ax) (cos wx + (a/w) sin wx): the answer of a damped spring to a step.
        value = 1.0 - e * (c + a / w * s)
        rate = e * (w + a * a / w) * s
        curve = (w + a * a / w) * e * (w * c - a * s)
    else:
        value, rate = e * s, e * (w * c - a * s)
        curve = e * ((a * a - w * w) * s - 2 * a * w * c)
    rise = _settle(x, 0.05 / frequency / 3.0)
    return np.column_stack(
        [
            value * rise[:, 0],
            rate * rise[:, 0] + value * rise[:, 1],
            curve * rise[:, 0] + 2 * rate * rise[:, 1] + value * rise[:, 2],
        ]
    )


@dataclass(frozen=True)
class Crew:
    """How busy a vehicle is; the defaults are a truck with its crew at work.

    Parameters
    ----------
    idle_g : float
        Amplitude of the engine's line, g (its two harmonics have a third and a ninth).
    idle_hz : (2,) tuple
        The line lies between, Hz.
    wind_deg, wind_band : float, (2,) tuple
        Roll rms (pitch has half) and Hz.
    moving_deg, moving_mm, moving_band : float, float, (2,) tuple
        Rms of pitch and roll (heading a sixth), of the horizontal way (up half), and Hz.
    boarding_per_minute, boarding_deg : float
        How often someone boards or leaves, and the tilt step, deg.
    slams_per_minute, slam_g : float
        How often a door slams, and the peak it makes, g.

    Examples
    --------
    >>> Crew(wind_deg=0.0).wind_deg
    0.0
    """

    idle_g: float = 0.02
    idle_hz: tuple[float, float] = (20.0, 35.0)
    wind_deg: float = 0.05
    wind_band: tuple[float, float] = (0.05, 0.5)
    moving_deg: float = 0.1
    moving_mm: float = 2.0
    moving_band: tuple[float, float] = (0.3, 2.0)
    boarding_per_minute: float = 0.5
    boarding_deg: float = 0.15
    slams_per_minute: float = 0.5
    slam_g: float = 0.3

    def bands(self) -> list[Band]:
        """Return what moves at random."""
        low, high = self.moving_band
        return [
            Band("roll", self.wind_deg, *self.wind_band),
            Band("pitch", 0.5 * self.wind_deg, *self.wind_band),
            Band("heading", self.moving_deg / 6, low, high),
            Band("pitch", self.moving_deg, low, high),
            Band("roll", self.moving_deg, low, high),
            Band("east", 1e-3 * self.moving_mm, low, high),
            Band("north", 1e-3 * self.moving_mm, low, high),
            Band("up", 0.5e-3 * self.moving_mm, low, high),
        ]

    def idle(self, rng: np.random.Generator) -> list[Lines]:
        """Draw the engine's lines, on three axes."""
        f = rng.uniform(*self.idle_hz)
        frequency = f * np.array([1.0, 2.0, 3.0])
        force = self.idle_g * STANDARD_GRAVITY * np.array([1.0, 1.0 / 3.0, 1.0 / 9.0])
        way = force / (2 * np.pi * frequency) ** 2
        return [
            Lines(channel, frequency, share * way, rng.uniform(0, 2 * np.pi, 3))
            for channel, share in (("up", 1.0), ("east", 0.5), ("north", 0.5))
        ]

    def events(self, rng: np.random.Generator, duration: float) -> list[Event]:
        """Draw who boards and which doors slam."""
        out = []
        for time in _arrivals(rng, self.boarding_per_minute, duration):
            size = rng.uniform(0.5, 1.5) * self.boarding_deg * rng.choice([-1.0, 1.0])
            ringing = rng.uniform(1.0, 2.0)
            out += [
                Event(time, "roll", size, "board", ringing),
                Event(time, "pitch", 0.3 * size, "board", ringing),
                Event(time, "up", -0.01 * abs(size), "board", ringing),
            ]
        for time in _arrivals(rng, self.slams_per_minute, duration):
            ringing = rng.uniform(8.0, 15.0)
            way = self.slam_g * STANDARD_GRAVITY / (2 * np.pi * ringing) ** 2
            angle = rng.uniform(0, 2 * np.pi)
            out += [
                Event(time, "east", way * np.cos(angle), "slam", ringing, 0.1),
                Event(time, "north", way * np.sin(angle), "slam", ringing, 0.1),
            ]
        return out


def _arrivals(rng: np.random.Generator, per_minute: float, duration: float) -> list[float]:
    count = int(rng.poisson(per_minute * duration / 60.0))
    return sorted(float(x) for x in rng.uniform(0.0, duration, count))


def quiet_crew() -> Crew:
    """Return a vehicle left alone, engine off: wind only.

    Examples
    --------
    >>> from schuler.motion import DisturbedVehicle, quiet_crew
    >>> rng = np.random.default_rng(0)
    >>> truck = DisturbedVehicle.with_crew(rng, 60.0, quiet_crew(), heading=30.0)
    >>> len(sc.simulate(truck, site, 60.0, 20.0, spec, rng).record)
    1200
    """
    return Crew(
        idle_g=0.0, wind_deg=0.01, moving_deg=0.0, moving_mm=0.0,
        boarding_per_minute=0.0, slams_per_minute=0.0,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class DisturbedVehicle:
    """A disturbed vehicle: sway and events about a centre of rotation.

    Parameters
    ----------
    sway : Sway
        Mean attitude, lines and lever arm.
    events : sequence of Event

    Examples
    --------
    >>> truck = DisturbedVehicle.with_crew(np.random.default_rng(1), 60.0, heading=30.0)
    >>> truck.track(np.array([0.0, 1.0])).quat_nb.shape
    (2, 4)
    """

    sway: Sway
    events: Sequence[Event] = field(default_factory=tuple)

    @classmethod
    def with_crew(
        cls, rng: np.random.Generator, duration: float, crew: Crew | None = None, *,
        heading: float = 0.0, pitch: float = 0.0, roll: float = 0.0,
        lever: tuple[float, float, float] = (0.3, -0.5, 0.8),
    ) -> DisturbedVehicle:  # fmt: skip
        """Draw a vehicle with its crew.

        Parameters
        ----------
        rng : numpy.random.Generator
        duration : float
            Span over which the events are spread, s.
        crew : Crew, optional
        heading, pitch, roll : float
            Mean attitude, deg.
        lever : (3,) tuple
            From the centre of rotation to the IMU, in body axes, m.
        """
        crew = crew or Crew()
        lines = tuple(band.draw(rng) for band in crew.bands() if band.rms > 0)
        sway = Sway(heading, pitch, roll, (*lines, *crew.idle(rng)), lever)
        return cls(sway, tuple(crew.events(rng, duration)))

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        duration: float,
        *,
        heading: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        sway_deg: tuple[float, float, float] = (0.05, 0.2, 0.3),
        sway_band: tuple[float, float] = (0.2, 2.0),
        shake_mm: tuple[float, float, float] = (4.0, 4.0, 2.0),
        shake_band: tuple[float, float] = (0.2, 5.0),
        steps: int = 6,
        step_mm: float = 3.0,
    ) -> DisturbedVehicle:
        """Draw a vehicle from the rms of its sway and displacement.

        Parameters
        ----------
        rng : numpy.random.Generator
        duration : float
            Span over which the steps are spread, s.
        heading, pitch, roll : float
            Mean attitude, deg.
        sway_deg : (3,) tuple
            Rms of heading, pitch and roll, deg.
        shake_mm : (3,) tuple
            Rms of the displacement east, north, up, mm.
        sway_band, shake_band : (2,) tuple
            Hz.
        steps : int
            Number of settling steps, each of `step_mm` in a random horizontal direction.
        step_mm : float
            mm.
        """
        rms = (*sway_deg, *(1e-3 * v for v in shake_mm))
        bands = [
            Band(channel, value, *(sway_band if k < 3 else shake_band))
            for k, (channel, value) in enumerate(zip(CHANNELS, rms, strict=True))
            if value > 0
        ]
        sway = Sway.draw(rng, bands, heading=heading, pitch=pitch, roll=roll)
        events = []
        for time in np.sort(rng.uniform(0, duration, steps)):
            angle = rng.uniform(0, 2 * np.pi)
            for channel, share in (("east", np.cos(angle)), ("north", np.sin(angle))):
                events.append(Event(float(time), channel, 1e-3 * step_mm * float(share)))
        return cls(sway, tuple(events))

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        track = self.sway.track(t)
        angles = track.angles[:, 0]
        begin, end = float(t[0]), float(t[-1])
        for event in self.events:
            if event.time >= end:
                continue
            if event.time + event.life <= begin:
                event.leave(track.path, angles)
            else:
                event.add(t, track.path, angles)
        return track
