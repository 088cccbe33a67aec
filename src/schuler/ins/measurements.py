"""Measurements of a filter: each kind with what it adds to `Measurement`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.ins.layout import Layout
from schuler.ins.measurement import Measurement
from schuler.kernels import ins_layout as kernel
from schuler.kernels import measurement_rows

__all__ = [
    "Attitude", "BodyVelocity", "ConstantBase", "Heading", "Height", "NonHolonomic",
    "OutputEpoch", "Position", "Rate", "Velocity", "ZeroDisplacement", "ZeroForce", "ZeroRate",
    "ZeroVelocity",
]  # fmt: skip

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Position(Measurement):
    """Position of a point of the body: latitude, longitude (rad) and height (m).

    sigma is east, north and up, m.

    Examples
    --------
    >>> place = [[site.latitude, site.longitude, site.height]]
    >>> Position([1.0], place, [1.0, 1.0, 2.0], name="gnss", estimate=("lever",)).groups
    [('gnss.lever', 3)]
    """

    KIND: ClassVar[int] = measurement_rows.POSITION_FIX
    LABEL: ClassVar[str] = "position"


@dataclass(frozen=True, eq=False)
class Velocity(Measurement):
    """Velocity of a point of the body: east, north, up, m/s.

    Examples
    --------
    >>> Velocity([1.0, 2.0], [[10.0, 0.0, 0.0], [10.1, 0.0, 0.0]], 0.05, name="gnss").label
    'gnss'
    """

    KIND: ClassVar[int] = measurement_rows.VELOCITY_FIX
    LABEL: ClassVar[str] = "velocity"


@dataclass(frozen=True, eq=False)
class ZeroVelocity(Velocity):
    """A point of the body is at rest.

    Examples
    --------
    >>> ZeroVelocity([1.0, 2.0], sigma=0.01).label
    'zero_velocity'
    """

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

    Examples
    --------
    >>> speeds = [[0.0, 10.0, 0.0], [0.0, 10.1, 0.0]]
    >>> BodyVelocity([1.0, 2.0], speeds, 0.05, name="odometer", estimate=("scale",)).groups
    [('odometer.scale', 1)]
    """

    mount: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    scale: float = 0.0
    mount_axes: str = "xyz"

    KIND: ClassVar[int] = measurement_rows.BODY_VELOCITY
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

    Examples
    --------
    >>> Attitude([1.0, 2.0], np.zeros((2, 3)), 1e-3, name="master").label
    'master'
    """

    KIND: ClassVar[int] = measurement_rows.ATTITUDE_FIX
    LABEL: ClassVar[str] = "attitude"


@dataclass(frozen=True, eq=False)
class Rate(_OfMaster):
    """Angular rate of a master against inertial space, its own body axes, rad/s.

    sigma is along the axes of the body that is navigated, rad/s.

    Examples
    --------
    >>> Rate([1.0, 2.0], np.zeros((2, 3)), 1e-4, name="master").label
    'master'
    """

    KIND: ClassVar[int] = measurement_rows.RATE_FIX
    LABEL: ClassVar[str] = "rate"


@dataclass(frozen=True, eq=False)
class NonHolonomic(BodyVelocity):
    """A wheeled vehicle moves neither sideways nor up where its wheels touch the ground.

    sigma is one number for both, m/s.

    Examples
    --------
    >>> NonHolonomic([1.0, 2.0], sigma=0.1, estimate=("mount",)).groups
    [('non_holonomic.mount', 2)]
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
    """Mean angular rate of a body at rest, as the gyros read it, rad/s.

    Examples
    --------
    >>> ZeroRate([1.0, 2.0], [[1e-5, 0.0, 0.0], [1e-5, 0.0, 0.0]], 1e-6).label
    'zero_rate'
    """

    KIND: ClassVar[int] = measurement_rows.ZERO_RATE
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

    Examples
    --------
    >>> Height([1.0, 2.0], [500.0, 501.0], 1.0, estimate=("offset",)).groups
    [('height.offset', 1)]
    """

    offset: float = 0.0

    KIND: ClassVar[int] = measurement_rows.HEIGHT_FIX
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

    Examples
    --------
    >>> Heading([1.0, 2.0], [0.5, 0.51], 0.003).label
    'heading'
    """

    baseline: ArrayLike = (0.0, 1.0, 0.0)

    KIND: ClassVar[int] = measurement_rows.HEADING_FIX
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "heading"

    def parameters(self, layout: Layout, sources: tuple[str, ...]) -> Array:
        """Return the kernel's description of the aid, (A_SIZE,)."""
        aid = super().parameters(layout, sources)
        aid[kernel.A_BASELINE : kernel.A_BASELINE + 3] = self.baseline
        return aid


@dataclass(frozen=True, eq=False)
class OutputEpoch(Measurement):
    """An instant at which nothing is measured: a row of output, and an epoch of the smoother.

    Examples
    --------
    >>> OutputEpoch([1.0, 2.0]).label
    'output_epoch'
    """

    KIND: ClassVar[int] = measurement_rows.VELOCITY_FIX
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "output_epoch"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        out = super().table(aid)
        out[:, kernel.M_SIGMA : kernel.M_RATE] = 0.0
        return out


@dataclass(frozen=True, eq=False)
class ZeroDisplacement(Measurement):
    """A point of a stationary vehicle stays where it was at the start, m.

    Examples
    --------
    >>> ZeroDisplacement([1.0, 2.0], sigma=0.01).label
    'zero_displacement'
    """

    KIND: ClassVar[int] = measurement_rows.ZERO_DISPLACEMENT
    STATES: ClassVar[Mapping[str, int]] = {"lever": 3}
    LABEL: ClassVar[str] = "zero_displacement"


@dataclass(frozen=True, eq=False)
class ConstantBase(Measurement):
    """The base of a stationary vehicle has not rotated since the start, rad.

    Examples
    --------
    >>> ConstantBase([1.0, 2.0], sigma=1e-4).groups
    [('base', 3)]
    """

    KIND: ClassVar[int] = measurement_rows.CONSTANT_BASE
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "constant_base"

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Groups of error states that it adds to a layout."""
        return [("base", 3)]


@dataclass(frozen=True, eq=False)
class ZeroForce(Measurement):
    """The horizontal specific force of a stationary vehicle is zero on average, m/s^2.

    Examples
    --------
    >>> ZeroForce([1.0, 2.0], sigma=0.01).label
    'zero_force'
    """

    KIND: ClassVar[int] = measurement_rows.ZERO_FORCE
    STATES: ClassVar[Mapping[str, int]] = {}
    LABEL: ClassVar[str] = "zero_force"

    def table(self, aid: int) -> Array:
        """Return the rows of the kernel's table of measurements, (m, M_SIZE)."""
        out = super().table(aid)
        out[:, kernel.M_SIGMA + 2] = 0.0
        return out
