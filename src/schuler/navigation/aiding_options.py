"""`AidingOptions`: what an aided navigation uses beside its fixes, and what it estimates."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

__all__ = ["VIBRATION", "AidingOptions"]

VIBRATION = 0.03
"""Velocity random walk of a strapdown unit on a road vehicle, m/s/sqrt(s), at least."""


@dataclass(frozen=True)
class AidingOptions:
    """What is used beside the fixes, and what is estimated.

    Parameters
    ----------
    non_holonomic : bool
        A wheeled vehicle moves neither sideways nor up.
    constraint_sigma : float
        Of that, m/s.
    constraint_interval : float
        Time between two such measurements, s: side slips are correlated.
    constraint_lever : (3,) array_like
        From the IMU to the rear axle's middle, body axes, m.
    constraint_estimate : tuple of str
        Of "mount" and "lever".
    zero_velocity : bool
        Use rest that the record shows: no velocity, and no rate but the Earth's.
    scale : bool
        Estimate scale factors of gyros and accelerometers.
    scale_sigma : (float, float)
        Their 1-sigma before, gyros and accelerometers, where the specification has none.
    axes : bool, optional
        Estimate misalignments with the scale factors, nine states to a triad; where the
        specification has misalignments, when not given.
    axes_sigma : (float, float)
        Their 1-sigma before, gyros and accelerometers, rad, where the specification has none.
    vibration : float
        Velocity random walk on the vehicle, m/s/sqrt(s); the specification's where that is larger.
    clock_drift : float
        1-sigma of the rate by which the clocks of record and aids drift apart, s/s: an estimated
        delay is a random walk that reaches so much times the record's length.
    robust : {None, "huber", "igg3"}
    adaptive : float
        Part of an aid's noise that is learned anew from each of its innovations, never below the
        stated one (Sage and Husa, 1969); 0 is off.
    smooth : bool
        Smooth afterwards.
    longest_interval : float
        Time between rows of output where nothing is measured, s; half as much more is let pass.

    Examples
    --------
    >>> options = AidingOptions(non_holonomic=True, robust="huber")
    >>> sc.navigate(drive, aiding=[gnss], spec=spec, options=options).consistent
    True
    """

    non_holonomic: bool = False
    constraint_sigma: float = 0.1
    constraint_interval: float = 0.25
    constraint_lever: ArrayLike = (0.0, 0.0, 0.0)
    constraint_estimate: tuple[str, ...] = ("mount",)
    zero_velocity: bool = False
    scale: bool = False
    scale_sigma: tuple[float, float] = (0.01, 0.02)
    axes: bool | None = None
    axes_sigma: tuple[float, float] = (0.002, 0.002)
    vibration: float = VIBRATION
    clock_drift: float = 0.0
    robust: str | None = None
    adaptive: float = 0.0
    smooth: bool = False
    longest_interval: float = 1.0
