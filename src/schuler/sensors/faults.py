"""Faults of the sensors of an array, and the isolation of one by a rate that is known.

With four sensors the parity (`schuler.sensors.parity`) is one number: a fault is detected, but all
sensors project on it alike and none can be isolated. Isolation then needs a known rate, as an
alignment at rest gives it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["Fault", "Isolation", "isolate_by_rate"]

Array = NDArray[np.float64]

KINDS = ("step", "drift", "stuck", "noise", "scale")


@dataclass(frozen=True)
class Fault:
    """What goes wrong with one sensor from a time on.

    Parameters
    ----------
    sensor : int
        Counted from 0.
    kind : {"step", "drift", "stuck", "noise", "scale"}
        A bias; a bias that grows; the reading of the start for ever; more noise; a scale factor.
    size : float
        rad/s; rad/s^2; not used; factor of the standard deviation; relative.
    start : float
        s.
    end : float
        s; the fault heals then.

    Examples
    --------
    >>> time, dt, rng = np.arange(4.0), np.ones(4), np.random.default_rng(1)
    >>> fault = Fault(2, "step", size=1e-5, start=1.5)
    >>> fault.apply(time, dt, np.zeros((4, 6)), 1e-6, rng)[:, 2].tolist()
    [0.0, 0.0, 1e-05, 1e-05]
    """

    sensor: int
    kind: str = "step"
    size: float = 0.0
    start: float = 0.0
    end: float = np.inf

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"a fault must be one of {', '.join(KINDS)}, got '{self.kind}'")
        if not (np.isfinite(self.size) and np.isfinite(self.start) and self.end > self.start):
            raise InputError(f"a fault needs a finite size and start, and a later end; got {self}")

    def apply(
        self, time: Array, dt: Array, measured: Array, sigma: float, rng: np.random.Generator
    ) -> Array:
        """Return increments (k, n) with the fault in.

        Parameters
        ----------
        time, dt : (k,) float64
            s.
        measured : (k, n) float64
            Increments, rad.
        sigma : float
            Standard deviation of one increment, for a noise fault, rad.
        rng : numpy.random.Generator
        """
        if not 0 <= self.sensor < measured.shape[1]:
            raise InputError(f"the fault is of sensor {self.sensor}, but there are "
                             f"{measured.shape[1]}")  # fmt: skip
        out = measured.copy()
        on = (time > self.start) & (time <= self.end)
        if not np.any(on):
            return out
        c = out[on, self.sensor]
        if self.kind == "step":
            c = c + self.size * dt[on]
        elif self.kind == "drift":
            c = c + self.size * (time[on] - self.start) * dt[on]
        elif self.kind == "stuck":
            c = np.full_like(c, c[0])
        elif self.kind == "noise":
            # On top of the noise that is there.
            c = c + np.sqrt(max(self.size**2 - 1.0, 0.0)) * sigma * rng.standard_normal(len(c))
        else:
            c = c * (1.0 + self.size)
        out[on, self.sensor] = c
        return out


@dataclass(frozen=True, eq=False)
class Isolation:
    """Which sensor is at fault.

    Parameters
    ----------
    sensor : int or None
        None where it cannot be told.
    size : float or None
        The fault's size as estimated, rad a sample.
    reason : str
        In a sentence.
    """

    sensor: int | None
    size: float | None
    reason: str


def isolate_by_rate(
    array: SensorArray, measured: ArrayLike, rate: ArrayLike, sigma: float,
    false_alarm: float = 1e-3,
) -> Isolation:  # fmt: skip
    """Isolate a sensor by a rate that is known from elsewhere.

    At rest an alignment (made before the fault, or with the other sets of sensors) tells the rate
    in the body; while rotating the table's encoder adds its part. Then each sensor is tested by
    itself, and four are enough.

    Parameters
    ----------
    array : SensorArray
    measured : (k, n) array_like
        Increments, rad.
    rate : (k, 3) or (3,) array_like
        The known increments of the body, rad.
    sigma : float
        Standard deviation of one increment, rad.
    false_alarm : float
        For the largest of all sensors together.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> array, rng = named_array("symmetric4"), np.random.default_rng(1)
    >>> measured = 1e-6 * rng.standard_normal((100, 4))
    >>> measured[:, 1] += 1e-5
    >>> isolate_by_rate(array, measured, [0.0, 0.0, 0.0], 1e-6).sensor
    1
    """
    from scipy.special import ndtri

    m = np.asarray(measured, np.float64)
    left = (m - np.broadcast_to(np.asarray(rate, np.float64), (len(m), 3)) @ array.h.T).mean(axis=0)
    z = left / (sigma / np.sqrt(len(m)))
    j = int(np.argmax(np.abs(z)))
    limit = float(-ndtri(0.5 * false_alarm / len(array)))
    if abs(z[j]) < limit:
        return Isolation(None, None, f"no sensor differs from the known rate by {limit:.1f} sigma")
    return Isolation(
        j, float(left[j]), f"sensor {j} differs from the known rate by {abs(z[j]):.1f} sigma"
    )
