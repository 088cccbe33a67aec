"""Fitted noise as the densities that other filters take, in SI.

White noise N of a gyro in rad/s/sqrt(Hz), which is the angle random walk in rad/sqrt(s), and the
random walk K of its bias in rad/s^2/sqrt(Hz); of an accelerometer m/s^2/sqrt(Hz) and
m/s^3/sqrt(Hz). Filters of other tools have one figure for three axes: the rms over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.allan_variance.noise_fit import MOVED, NoiseFit, NoiseTerm
from schuler.errors import InputError

__all__ = ["UNITS_SI", "Densities", "Density", "densities"]

#: unit of each term of a fit in SI, by the term's place (Q, N, B, K, R) of gyros, accelerometers
UNITS_SI = {
    "gyro": ("rad", "rad/s/sqrt(Hz)", "rad/s", "rad/s^2/sqrt(Hz)", "rad/s^2"),
    "accel": ("m/s", "m/s^2/sqrt(Hz)", "m/s^2", "m/s^3/sqrt(Hz)", "m/s^3"),
}
_NOISE, _WALK = 1, 3


@dataclass(frozen=True)
class Density:
    """One density, the rms over the axes.

    Parameters
    ----------
    value : float
        SI. An axis in which it is not observable enters with the limit under which it is with 95 %.
    seen : int
        Axes that show it.
    axes : int

    Examples
    --------
    >>> densities(noise_fit).gyro_noise.axes
    3
    """

    value: float
    seen: int
    axes: int

    @property
    def origin(self) -> str:
        """Say in words where the value is from."""
        if self.seen == self.axes:
            return f"rms of {self.axes} axes"
        if self.seen == 0:
            return "not seen in this record: the limit under which it is with 95 %"
        return f"rms of {self.seen} axes, and the 95 % limit of {self.axes - self.seen}"

    def times(self, factor: float) -> Density:
        """Return a density that is larger by a factor."""
        return Density(self.value * factor, self.seen, self.axes)


@dataclass(frozen=True)
class Densities:
    """White noise and random walk of the bias, of gyros and accelerometers, SI.

    Parameters
    ----------
    gyro_noise, gyro_walk, accel_noise, accel_walk : Density
    rate : float
        Of the record, Hz.
    name : str
        Of the record.
    duration : float
        s.
    """

    gyro_noise: Density
    gyro_walk: Density
    accel_noise: Density
    accel_walk: Density
    rate: float
    name: str
    duration: float

    def times(self, factor: float) -> Densities:
        """Return all densities larger by a factor.

        Raises
        ------
        InputError
            If the factor is not positive.
        """
        if not (np.isfinite(factor) and factor > 0.0):
            raise InputError(f"densities are multiplied by a positive factor, got {factor:g}")
        parts: dict[str, Any] = {
            name: getattr(self, name).times(factor)
            for name in ("gyro_noise", "gyro_walk", "accel_noise", "accel_walk")
        }
        return Densities(**parts, rate=self.rate, name=self.name, duration=self.duration)


def _of(terms: list[NoiseTerm]) -> Density:
    values = [t.below if t.value is None else t.value for t in terms]
    rms = float(np.sqrt(np.mean(np.square(values))))
    return Density(rms, sum(t.value is not None for t in terms), len(terms))


def densities(fit: NoiseFit) -> Densities:
    """Return the densities of a fit.

    Raises
    ------
    InputError
        If the fit has no gyros, or no accelerometers, or is that of a record in motion.

    Examples
    --------
    >>> found = densities(noise_fit)
    >>> found.rate
    20.0
    """
    moved = [name for name, channel in fit.channels.items() if channel.misfit > MOVED]
    if moved:
        raise InputError(
            f"{', '.join(moved)}: this is not the noise of an instrument at rest, so there are no "
            "densities to export; take a stretch at rest with --start and --stop"
        )
    found: dict[str, Density] = {}
    for part, what in (("gyro", "gyros"), ("accel", "accelerometers")):
        own = [list(c.terms.values()) for name, c in fit.channels.items() if name.startswith(part)]
        if not own:
            raise InputError(f"the noise of {what} is needed too: leave --channel out")
        found[f"{part}_noise"] = _of([terms[_NOISE] for terms in own])
        found[f"{part}_walk"] = _of([terms[_WALK] for terms in own])
    source = fit.source
    return Densities(**found, rate=1.0 / source.interval, name=source.name,
                     duration=source.duration)  # fmt: skip
