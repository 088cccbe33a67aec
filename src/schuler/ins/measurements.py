"""Measurements of a filter: each kind with its times, values and noise, and what it adds.

A measurement that schuler does not know is a class with `time`, `name`, `handling` and
`rows(state)`, as `CustomMeasurement` says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.ins.layout import Layout
from schuler.kernels import ins_layout as kernel

__all__ = [
    "Attitude", "BodyVelocity", "ConstantBase", "CustomMeasurement", "Handling", "Heading",
    "Height", "Measurement", "NonHolonomic", "OutputEpoch", "Position", "Rate", "State",
    "Velocity", "ZeroDisplacement", "ZeroForce", "ZeroRate", "ZeroVelocity",
]  # fmt: skip

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


@dataclass(frozen=True, eq=False)
class Position(Measurement):
    """Position of a point of the body: latitude, longitude (rad) and height (m).

    sigma is east, north and up, m.
    """

    KIND: ClassVar[int] = kernel.POSITION_FIX
    LABEL: ClassVar[str] = "position"


@dataclass(frozen=True, eq=False)
class Velocity(Measurement):
    """Velocity of a point of the body: east, north, up, m/s."""

    KIND: ClassVar[int] = kernel.VELOCITY_FIX
    LABEL: ClassVar[str] = "velocity"


@dataclass(frozen=True, eq=False)
class ZeroVelocity(Velocity):
    """A point of the body is at rest."""

    LABEL: ClassVar[str] = "zero_velocity"


@dataclass(frozen=True, eq=False)
class BodyVelocity(Measurement):
    """Velocity of a point over ground along the axes of a sensor: DVL, odometer.

    Parameters
    ----------
    mount : (4,) array_like
        Quaternion from the body to the axes of the sensor.
    scale : float
        Scale factor: (1 + scale) times the true velocity is measured.
    mount_axes : str
        Axes about which an estimated mounting rotates, of "xyz".
    """

    mount: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    scale: float = 0.0
    mount_axes: str = "xyz"

    KIND: ClassVar[int] = kernel.BODY_VELOCITY
    STATES: ClassVar[Mapping[str, int]] = {"scale": 1, "mount": 3, "lever": 3}
    LABEL: ClassVar[str] = "body_velocity"

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Groups of error states that it adds to a layout."""
        sizes = {**self.STATES, "mount": len(self.mount_axes)}
        return [(self.group(part), sizes[part]) for part in sizes if part in self.estimate]

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = super().parameters(layout, sources)
        aid[kernel.A_MOUNT : kernel.A_MOUNT + 4] = self.mount
        aid[kernel.A_SCALE] = self.scale
        first = layout.index(self.group("mount")) if "mount" in self.estimate else -1
        for k, axis in enumerate(self.mount_axes):
            if first >= 0:
                aid[kernel.A_AT_MOUNT + "xyz".index(axis)] = first + k
        return aid


@dataclass(frozen=True, eq=False)
class _OfMaster(Measurement):
    """What another navigation on the same vehicle says of its own body.

    Parameters
    ----------
    mount : (4,) array_like
        Quaternion M from the body to that of the master, C = C_m M; an estimated mounting is a
        rotation vector m in the body's axes, M exp([m x]).
    """

    mount: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    rate_now: bool = True

    STATES: ClassVar[Mapping[str, int]] = {"mounting": 3, "delay": 1}

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = super().parameters(layout, sources)
        aid[kernel.A_MOUNT : kernel.A_MOUNT + 4] = self.mount
        if "mounting" in self.estimate:
            aid[kernel.A_AT_MOUNT] = layout.index(self.group("mounting"))
        return aid


@dataclass(frozen=True, eq=False)
class Attitude(_OfMaster):
    """Attitude of a master: rotation vectors of its C_b^n, East-North-Up, rad.

    sigma is east, north and up, rad. With the group "flexure" in the layout the master's mounting
    also bends.
    """

    KIND: ClassVar[int] = kernel.ATTITUDE_FIX
    LABEL: ClassVar[str] = "attitude"


@dataclass(frozen=True, eq=False)
class Rate(_OfMaster):
    """Angular rate of a master against inertial space, its own body axes, rad/s.

    sigma is along the axes of the body that is navigated, rad/s.
    """

    KIND: ClassVar[int] = kernel.RATE_FIX
    LABEL: ClassVar[str] = "rate"


@dataclass(frozen=True, eq=False)
class NonHolonomic(BodyVelocity):
    """A wheeled vehicle moves neither sideways nor up where its wheels touch the ground.

    sigma is one number for both, m/s.
    """

    mount_axes: str = "xz"

    LABEL: ClassVar[str] = "non_holonomic"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        out = super().table(aid)
        out[:, kernel.M_SIGMA + 1] = 0.0
        return out


@dataclass(frozen=True, eq=False)
class ZeroRate(Measurement):
    """Mean angular rate of a body at rest, as the gyros read it, rad/s."""

    KIND: ClassVar[int] = kernel.ZERO_RATE
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "zero_rate"


@dataclass(frozen=True, eq=False)
class _Scalar(Measurement):
    """A measurement of one number: value and sigma (m,) or a number."""

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        time = np.asarray(self.time, np.float64)
        out = np.zeros((len(time), kernel.M_SIZE))
        out[:, kernel.M_TIME] = time
        out[:, kernel.M_AID], out[:, kernel.M_KIND] = aid, self.KIND
        for place, values in ((kernel.M_VALUE, self.value), (kernel.M_SIGMA, self.sigma)):
            array = np.asarray(values, np.float64)
            if array.shape not in ((), (len(time),)):
                raise InputError(
                    f"{self.label}: expected {len(time)} numbers, got shape {array.shape}"
                )
            out[:, place] = array
        return out


@dataclass(frozen=True, eq=False)
class Height(_Scalar):
    """Height of a point of the body, m; of a barometer with an offset.

    Parameters
    ----------
    offset : float
        Measured minus true height, m.
    """

    offset: float = 0.0

    KIND: ClassVar[int] = kernel.HEIGHT_FIX
    STATES: ClassVar[Mapping[str, int]] = {"lever": 3, "offset": 1}
    LABEL: ClassVar[str] = "height"

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = super().parameters(layout, sources)
        aid[kernel.A_OFFSET] = self.offset
        return aid


@dataclass(frozen=True, eq=False)
class Heading(_Scalar):
    """Direction of a baseline, clockwise from north, rad.

    Parameters
    ----------
    baseline : (3,) array_like
        In body axes; forward by default.
    """

    baseline: ArrayLike = (0.0, 1.0, 0.0)

    KIND: ClassVar[int] = kernel.HEADING_FIX
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "heading"

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = super().parameters(layout, sources)
        aid[kernel.A_BASELINE : kernel.A_BASELINE + 3] = self.baseline
        return aid


@dataclass(frozen=True, eq=False)
class OutputEpoch(Measurement):
    """An instant at which nothing is measured: a row of output, and an epoch of the smoother."""

    KIND: ClassVar[int] = kernel.VELOCITY_FIX
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "output_epoch"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        out = super().table(aid)
        out[:, kernel.M_SIGMA : kernel.M_RATE] = 0.0
        return out


@dataclass(frozen=True, eq=False)
class ZeroDisplacement(Measurement):
    """A point of a stationary vehicle stays where it was at the start, m."""

    KIND: ClassVar[int] = kernel.ZERO_DISPLACEMENT
    STATES: ClassVar[Mapping[str, int]] = {"lever": 3}
    LABEL: ClassVar[str] = "zero_displacement"


@dataclass(frozen=True, eq=False)
class ConstantBase(Measurement):
    """The base of a stationary vehicle has not rotated since the start, rad."""

    KIND: ClassVar[int] = kernel.CONSTANT_BASE
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "constant_base"

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Groups of error states that it adds to a layout."""
        return [("base", 3)]


@dataclass(frozen=True, eq=False)
class ZeroForce(Measurement):
    """The horizontal specific force of a stationary vehicle is zero on average, m/s^2."""

    KIND: ClassVar[int] = kernel.ZERO_FORCE
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "zero_force"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        out = super().table(aid)
        out[:, kernel.M_SIGMA + 2] = 0.0
        return out


@dataclass(frozen=True, eq=False)
class State:
    """What a measurement may ask of a filter at its instant.

    Parameters
    ----------
    time : float
    quat_nb : (4,) float64
        From the body to n, East-North-Up, or the wander frame once the vehicle has moved.
    v_n : (3,) float64
    rate_b : (3,) float64
        Angular rate of the body, without the estimated bias, rad/s.
    lat, lon, height : float
        rad and m.
    east : float
        Angle from the x axis of n to east, counter-clockwise, rad: zero at the start.
    parameters : dict of str to array
        Estimates of all other groups.
    layout : Layout
        Where the columns of H are.
    index : int
        Which measurement of the aid is asked for.
    """

    time: float
    quat_nb: Array
    v_n: Array
    rate_b: Array
    lat: float
    lon: float
    height: float
    east: float
    parameters: Mapping[str, Array]
    layout: Layout
    index: int

    def row(self, columns: Mapping[str, ArrayLike]) -> Array:
        """Return a row of H from its parts by group; other columns are zero."""
        out = np.zeros(self.layout.size)
        for group, part in columns.items():
            out[self.layout[group]] = part
        return out


@runtime_checkable
class CustomMeasurement(Protocol):
    """What a user's own measurement must have.

    `rows` returns predicted minus measured (k,), the rows of H (k, n) and the variances (k,), for
    up to six numbers; errors are those that `schuler.ins` says, estimate minus truth but for the
    sensors' errors, which are truth minus estimate. Where it has an attribute `states`, a sequence
    of `StateGroup`, `schuler.navigation.navigate_aided` adds them to its filter.
    """

    @property
    def time(self) -> ArrayLike:
        """Instants, s, increasing."""

    @property
    def name(self) -> str:
        """Of the aid."""

    @property
    def handling(self) -> Handling:
        """How it is judged."""

    def rows(self, state: State) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
        """Return predicted minus measured, rows of H, variances."""
