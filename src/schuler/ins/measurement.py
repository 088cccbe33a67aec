"""What every measurement of a filter has: times, values, noise, and how it is judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.ins.layout import Layout
from schuler.kernels import ins_layout as kernel

__all__ = ["Handling", "Measurement", "handled"]

Array = NDArray[np.float64]

_RULES = {None: kernel.PLAIN, "huber": kernel.HUBER, "igg3": kernel.IGG3}
_BOUNDS = {None: (1.345, np.inf), "huber": (1.345, np.inf), "igg3": (1.5, 4.0)}


@dataclass(frozen=True)
class Handling:
    """How measurements of one aid are judged.

    Parameters
    ----------
    gate : float or None
        Quantile of chi-square that the squared innovation of all rows of an instant must not
        exceed; None takes everything.
    guard_count, guard_time : float
        After so many instants refused in a row, or so many seconds without one that was taken,
        the covariance of position and velocity is widened by the innovation and it is taken.
    robust : {None, "huber", "igg3"}
        Weigh down, or refuse, single rows that are far off.
    adaptive : float
        Part of the noise that is learned anew from each innovation, never below the stated
        noise; 0 is off.
    source : str
        What its noise counts as in a budget.

    Examples
    --------
    >>> Handling(gate=0.999, robust="huber").robust
    'huber'
    """

    gate: float | None = None
    guard_count: float = 5.0
    guard_time: float = 10.0
    robust: str | None = None
    adaptive: float = 0.0
    source: str = "disturbance"

    def __post_init__(self) -> None:
        if self.robust not in _RULES:
            raise InputError(f"robust must be None, huber or igg3, got {self.robust}")
        if self.gate is not None and not 0.0 < self.gate < 1.0:
            raise InputError(f"gate must be a quantile between 0 and 1, got {self.gate}")
        if not 0.0 <= self.adaptive < 1.0:
            raise InputError(f"adaptive must be from 0 to below 1, got {self.adaptive}")


def _table(values: ArrayLike, count: int, what: str) -> Array:
    """Return values as (count, 3)."""
    array = np.asarray(values, np.float64)
    if array.ndim == 1 and array.shape != (3,) and count == len(array):
        array = array[:, None] * [1.0, 0.0, 0.0]
    try:
        return np.ascontiguousarray(np.broadcast_to(array, (count, 3)))
    except ValueError:
        raise InputError(
            f"{what}: expected {count} rows of three, got shape {array.shape}"
        ) from None


@dataclass(frozen=True, eq=False)
class Measurement:
    """What all kinds share.

    Parameters
    ----------
    time : (m,) array_like
        Instants on the record's clock, s, increasing.
    value : (m, 3) or (3,) array_like
        What was measured.
    sigma : (m, 3) or (3,) array_like
        1 sigma; 0 for an axis that is not measured.
    name : str
        Of the aid: it leads the names of its states.
    handling : Handling
    lever : (3,) array_like
        From the IMU to the point that is measured, body axes, m.
    delay : float
        A measurement stamped t is valid at t - delay, s.
    estimate : tuple of str
        Which of "lever", "delay", "scale", "mount", "mounting" and "offset" are states: what is
        given is then only their start.
    shared : mapping of str to str, optional
        Which of these states are those of another aid, and of which.
    rate_now : bool
        Take the angular rate at the instant, from the last two samples, for the lever arm's
        velocity, in place of the mean of the last sample.
    rates : (m, 6) array_like, optional
        The body's rate against n and its rate of change at the instants, body axes, rad/s and
        rad/s^2, where they are better known than by the gyros: their noise does not then enter a
        row of H, where it would make lever arms and delays look observable.

    Examples
    --------
    >>> from schuler.ins import Velocity
    >>> speed = Velocity([1.0], [10.0, 0.0, 0.0], 0.05, name="gnss", estimate=("delay",))
    >>> isinstance(speed, Measurement), speed.groups
    (True, [('gnss.delay', 1)])
    """

    time: ArrayLike
    value: ArrayLike = 0.0
    sigma: ArrayLike = 1.0
    name: str = ""
    handling: Handling = field(default_factory=Handling)
    lever: ArrayLike = (0.0, 0.0, 0.0)
    delay: float = 0.0
    estimate: tuple[str, ...] = ()
    shared: Mapping[str, str] = field(default_factory=dict)
    rate_now: bool = False
    rates: ArrayLike | None = None

    KIND: ClassVar[int] = -1
    STATES: ClassVar[Mapping[str, int]] = {"lever": 3, "delay": 1}
    LABEL: ClassVar[str] = ""

    def __post_init__(self) -> None:
        time = np.asarray(self.time, np.float64)
        if time.ndim != 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time) < 0.0):
            raise InputError(f"{self.label}: times must be finite and must not decrease")
        unknown = set(self.estimate) - set(self.STATES)
        if unknown:
            raise InputError(
                f"{self.label}: cannot estimate {min(unknown)}; it has {', '.join(self.STATES)}"
            )
        lever = np.asarray(self.lever, np.float64)
        if lever.shape != (3,) or not np.all(np.isfinite(lever)):
            raise InputError(f"{self.label}: a lever arm has three finite numbers")
        table = self.table(0)
        if not np.all(np.isfinite(table)) or np.any(table[:, kernel.M_SIGMA : kernel.M_RATE] < 0.0):
            raise InputError(f"{self.label}: values and sigma must be finite, sigma not negative")

    @property
    def label(self) -> str:
        """Name of the aid, by default that of its kind."""
        return self.name or self.LABEL

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Groups of error states that it adds to a layout."""
        return [
            (self.group(part), size) for part, size in self.STATES.items() if part in self.estimate
        ]

    def group(self, part: str) -> str:
        """Return the name of the group of a part: its own, or that of the aid that shares it."""
        return f"{self.shared.get(part, self.label)}.{part}"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        time = np.asarray(self.time, np.float64)
        out = np.zeros((len(time), kernel.M_SIZE))
        out[:, kernel.M_TIME] = time
        out[:, kernel.M_AID], out[:, kernel.M_KIND] = aid, self.KIND
        out[:, kernel.M_VALUE : kernel.M_VALUE + 3] = _table(self.value, len(time), self.label)
        out[:, kernel.M_SIGMA : kernel.M_SIGMA + 3] = _table(self.sigma, len(time), self.label)
        if self.rates is not None:
            rates = np.asarray(self.rates, np.float64)
            if rates.shape != (len(time), 6):
                raise InputError(
                    f"{self.label}: expected {len(time)} rows of six rates, got {rates.shape}"
                )
            out[:, kernel.M_RATE : kernel.M_RATE + 6] = rates
        return out

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = handled(self.handling, sources)
        aid[kernel.A_LEVER : kernel.A_LEVER + 3] = self.lever
        aid[kernel.A_DELAY] = self.delay
        aid[kernel.A_RATE_NOW] = 2.0 if self.rates is not None else float(self.rate_now)
        for part, place in (
            ("lever", kernel.A_AT_LEVER), ("delay", kernel.A_AT_DELAY),
            ("scale", kernel.A_AT_SCALE), ("offset", kernel.A_AT_OFFSET),
        ):  # fmt: skip
            aid[place] = layout.index(self.group(part)) if part in self.estimate else -1
        return aid


def handled(handling: Handling, sources: tuple[str, ...]) -> Array:
    """Return the kernel's description of an aid of which only the handling is known."""
    aid = np.zeros(kernel.A_SIZE)
    for place in (
        kernel.A_AT_LEVER, kernel.A_AT_DELAY, kernel.A_AT_SCALE, kernel.A_AT_OFFSET,
        *range(kernel.A_AT_MOUNT, kernel.A_AT_MOUNT + 3),
    ):  # fmt: skip
        aid[place] = -1.0
    aid[kernel.A_MOUNT] = 1.0
    aid[kernel.A_RULE] = _RULES[handling.robust]
    aid[kernel.A_LOW], aid[kernel.A_HIGH] = _BOUNDS[handling.robust]
    aid[kernel.A_MEMORY] = handling.adaptive
    aid[kernel.A_GATED] = handling.gate is not None
    aid[kernel.A_GUARD_COUNT], aid[kernel.A_GUARD_TIME] = handling.guard_count, handling.guard_time
    if handling.gate is not None:
        from scipy.special import gammaincinv

        degrees = np.arange(1, kernel.MOST_ROWS + 1)
        aid[kernel.A_GATE : kernel.A_GATE + kernel.MOST_ROWS] = 2.0 * gammaincinv(
            0.5 * degrees, handling.gate
        )
    aid[kernel.A_SOURCE] = sources.index(handling.source)
    return aid
