"""A ship: a wave spectrum, and how the hull responds to it in roll, pitch, yaw and heave.

The surface is a sum of waves drawn from a Pierson-Moskowitz or JONSWAP spectrum. Roll and pitch
answer the wave's slope, heave its height, each as a damped oscillator with the hull's natural
period; surge and sway follow the water's orbits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG, STANDARD_GRAVITY
from schuler.errors import InputError
from schuler.motion.sway import Lines, Sway

__all__ = ["Hull", "Sea", "moored_ship"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sea:
    """A sea state.

    Parameters
    ----------
    height : float
        Significant wave height, m.
    period : float
        Period of the spectrum's peak, s.
    gamma : float
        JONSWAP's peak enhancement; 1 is Pierson-Moskowitz, 3.3 the usual North Sea value.

    Examples
    --------
    >>> Sea(height=2.0, period=8.0, gamma=3.3).spectrum(np.array([0.125])).shape
    (1,)
    """

    height: float
    period: float
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if not (self.height >= 0 and self.period > 0 and self.gamma >= 1):
            raise InputError(
                "a sea needs a height of 0 m or more, a positive period and gamma of 1 or more, "
                f"got {self.height}, {self.period} and {self.gamma}"
            )

    def spectrum(self, f: Array) -> Array:
        """Return the one-sided density of the surface's height, m^2/Hz.

        Hasselmann et al. (1973), scaled so that four standard deviations are the height.
        """
        grid = np.linspace(0.2, 10.0, 4000) / self.period
        shape = self._shape(grid)
        area = float(np.sum(0.5 * (shape[1:] + shape[:-1]) * np.diff(grid)))
        return np.asarray(self._shape(f) * (0.25 * self.height) ** 2 / area)

    def _shape(self, f: Array) -> Array:
        x = np.maximum(f * self.period, 1e-9)
        width = np.where(x <= 1.0, 0.07, 0.09)
        peak = self.gamma ** np.exp(-0.5 * ((x - 1.0) / width) ** 2)
        return np.asarray(x**-5.0 * np.exp(-1.25 * x**-4.0) * peak)


@dataclass(frozen=True)
class Hull:
    """How a hull responds: natural periods (s), damping ratios, and shares of slope and height.

    Defaults are those of a ship of some thousand tons.

    Examples
    --------
    >>> Hull(roll_period=10.0).roll_period
    10.0
    """

    roll_period: float = 12.0
    roll_damping: float = 0.1
    pitch_period: float = 7.0
    pitch_damping: float = 0.3
    heave_period: float = 8.0
    heave_damping: float = 0.4
    yaw_share: float = 0.1
    length: float = 100.0


def _answer(f: Array, period: float, damping: float) -> Array:
    """Return the complex answer of a damped oscillator."""
    x = f * period
    return np.asarray(1.0 / (1.0 - x**2 + 2j * damping * x))


def moored_ship(
    rng: np.random.Generator,
    sea: Sea,
    *,
    heading: float = 0.0,
    wave_direction: float = 60.0,
    hull: Hull | None = None,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
    lines: int = 40,
) -> Sway:
    """Draw a moored ship in a sea.

    Parameters
    ----------
    rng : numpy.random.Generator
    sea : Sea
    heading : float
        Clockwise from north, deg.
    wave_direction : float
        Where the waves come from against the bow, deg: 0 head, 90 beam.
    hull : Hull, optional
    lever : (3,) tuple
        From the centre of rotation to the IMU, in body axes, m.
    lines : int
        Waves drawn.

    Examples
    --------
    >>> ship = moored_ship(np.random.default_rng(1), Sea(2.0, 8.0), heading=45.0)
    >>> ship.heading
    45.0
    """
    hull = hull or Hull()
    edges = np.geomspace(0.5, 4.0, lines + 1) / sea.period
    share = np.diff(edges)
    f = edges[:-1] + share * rng.uniform(0, 1, lines)
    height = np.sqrt(2.0 * sea.spectrum(f) * share)
    phase = rng.uniform(0, 2 * np.pi, lines)
    k = (2 * np.pi * f) ** 2 / STANDARD_GRAVITY
    # Waves shorter than the hull average out along it.
    short = np.exp(-0.5 * (k * hull.length / 4.0) ** 2)
    slope = k * height * short / DEG
    across, along = np.sin(wave_direction * DEG), np.cos(wave_direction * DEG)
    roll = _answer(f, hull.roll_period, hull.roll_damping) * across
    pitch = _answer(f, hull.pitch_period, hull.pitch_damping) * along
    heave = _answer(f, hull.heave_period, hull.heave_damping)
    bow = np.array([np.sin(heading * DEG), np.cos(heading * DEG)])
    side = np.array([bow[1], -bow[0]])
    orbit = height * short
    surge, drift = along * bow + across * side, 0.5 * np.pi

    def part(channel: str, answer: Array, size: Array) -> Lines:
        return Lines(channel, f, np.abs(answer) * size, phase + np.angle(answer))

    quarter = np.exp(1j * drift)
    return Sway(
        heading=heading,
        lines=(
            part("roll", roll, slope),
            part("pitch", pitch * quarter, slope),
            part("heading", quarter * hull.yaw_share * across * along, slope),
            part("up", heave, orbit),
            part("east", quarter * heave * surge[0], orbit),
            part("north", quarter * heave * surge[1], orbit),
        ),
        lever=lever,
    )
