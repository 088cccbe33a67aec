"""Sway and vibration as sums of sinusoids: named lines, or drawn in a band.

Every derivative is exact and displacement is bounded: acceleration is its second derivative,
never white noise on its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.motion.base import Track

__all__ = ["CHANNELS", "Band", "Lines", "Sway"]

Array = NDArray[np.float64]

CHANNELS = ("heading", "pitch", "roll", "east", "north", "up")
"""Angles in degrees (heading clockwise), ways in metres."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Sinusoids of one channel: a sin(2 pi f t + p).

    Parameters
    ----------
    channel : str
        One of `CHANNELS`.
    frequency : (k,) float64
        Hz.
    amplitude : (k,) float64
        deg or m.
    phase : (k,) float64
        rad.

    Examples
    --------
    >>> Lines("roll", np.array([0.1]), np.array([0.2]), np.array([0.0])).channel
    'roll'
    """

    channel: str
    frequency: Array
    amplitude: Array
    phase: Array

    def __post_init__(self) -> None:
        if self.channel not in CHANNELS:
            raise InputError(
                f"a line's channel must be one of {', '.join(CHANNELS)}, got '{self.channel}'"
            )
        for name in ("frequency", "amplitude", "phase"):
            value = np.atleast_1d(np.asarray(getattr(self, name), np.float64))
            object.__setattr__(self, name, value)
        if not self.frequency.shape == self.amplitude.shape == self.phase.shape:
            raise InputError("lines need as many frequencies as amplitudes and phases")


@dataclass(frozen=True)
class Band:
    """Random motion of one channel in a band: Gaussian in the limit of many lines.

    Parameters
    ----------
    channel : str
        One of `CHANNELS`.
    rms : float
        deg or m.
    low, high : float
        Hz.
    lines : int
        Sinusoids drawn, evenly in frequency with a random place in their share of the band.

    Examples
    --------
    >>> Band("roll", rms=0.2, low=0.1, high=1.0).draw(np.random.default_rng(1)).channel
    'roll'
    """

    channel: str
    rms: float
    low: float
    high: float
    lines: int = 16

    def draw(self, rng: np.random.Generator) -> Lines:
        """Draw the lines."""
        if not 0 < self.low <= self.high:
            raise InputError(f"a band needs 0 < low <= high, got {self.low} to {self.high} Hz")
        if self.lines < 1:
            raise InputError(f"a band needs one line at least, got {self.lines}")
        share = (self.high - self.low) / self.lines
        frequency = self.low + share * (np.arange(self.lines) + rng.uniform(0, 1, self.lines))
        amplitude = np.full(self.lines, self.rms * np.sqrt(2.0 / self.lines))
        return Lines(self.channel, frequency, amplitude, rng.uniform(0, 2 * np.pi, self.lines))


def _even_step(t: Array) -> float:
    """Return the step of evenly spaced times, rounded so that chunks agree on it, else 0."""
    if len(t) < 2:
        return 0.0
    step = float(f"{float(t[-1] - t[0]) / (len(t) - 1):.11g}")
    even = t[0] + step * np.arange(len(t))
    return step if float(np.max(np.abs(t - even))) < 1e-9 * (abs(float(t[-1])) + step) else 0.0


@dataclass(frozen=True, eq=False)
class Sway:
    """A body that sways about a mean attitude.

    Parameters
    ----------
    heading, pitch, roll : float
        Mean attitude, deg.
    lines : sequence of Lines
        What moves.
    lever : (3,) tuple
        From the centre of rotation to the IMU, in body axes, m.

    Examples
    --------
    >>> swell = Lines("roll", np.array([0.1]), np.array([2.0]), np.array([0.0]))
    >>> Sway(heading=30.0, lines=(swell,)).track(np.array([0.0, 2.5])).quat_nb.shape
    (2, 4)
    """

    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    lines: Sequence[Lines] = field(default_factory=tuple)
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def draw(
        cls, rng: np.random.Generator, bands: Sequence[Band], *, heading: float = 0.0,
        pitch: float = 0.0, roll: float = 0.0, lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Sway:  # fmt: skip
        """Draw a sway from bands."""
        return cls(heading, pitch, roll, tuple(band.draw(rng) for band in bands), lever)

    @cached_property
    def _all(self) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Channel, frequency (rad/s), phase and amplitude (rad or m) of every line, by channel."""
        which = [CHANNELS.index(x.channel) for x in self.lines]
        scale = np.array([-DEG, DEG, DEG, 1.0, 1.0, 1.0])
        order = sorted(range(len(which)), key=lambda k: which[k])
        if not order:
            none = np.empty(0)
            return np.empty(0, np.int64), none, none, none
        picked = [self.lines[k] for k in order]
        channel = np.concatenate([np.full(len(self.lines[k].phase), which[k]) for k in order])
        return (
            channel.astype(np.int64),
            2.0 * np.pi * np.concatenate([x.frequency for x in picked]),
            np.concatenate([x.phase for x in picked]),
            scale[channel] * np.concatenate([x.amplitude for x in picked]),
        )

    @cached_property
    def _tables(self) -> dict[float, tuple[Array, Array]]:
        return {}

    def _table(self, step: float) -> tuple[Array, Array]:
        """Return cosines and sines of every line's turn in 0, 1, 2 ... steps, kept for reuse."""
        from schuler.kernels.motion import BLOCK

        if step == 0.0:
            return np.empty((0, 0)), np.empty((0, 0))
        if step not in self._tables:
            turn = step * np.arange(BLOCK)[:, None] * self._all[1]
            self._tables.clear()
            self._tables[step] = (np.cos(turn), np.sin(turn))
        return self._tables[step]

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        from schuler.kernels.motion import add_lines

        path, angles = np.zeros((len(t), 3, 3)), np.zeros((len(t), 3, 3))
        angles[:, :, 0] = np.array([-self.heading, self.pitch, self.roll]) * DEG
        table = self._table(_even_step(t))
        work = np.empty((2, len(self._all[0])))
        add_lines(np.ascontiguousarray(t), *table, *self._all, path, angles, work)
        return Track(path, angles[:, None], np.array([self.lever], np.float64))
