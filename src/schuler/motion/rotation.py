"""Schemes of rotation modulation as data: what the table does, and what it may not do.

A scheme is a list of dwells, turns and spins that repeats, with the limits of its table: rate,
acceleration, travel of an axis without slip ring, and the encoder's resolution.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._files import check_keys, number, read_toml
from schuler.attitude import euler_to_quat, multiply
from schuler.constants import DEG
from schuler.errors import InputError, located
from schuler.motion.base import Carried, Motion, Track
from schuler.motion.turntable import AXES, Dwell, Spin, Turn, Turntable

__all__ = ["Limits", "NorthLocked", "Scheme", "carrier_attitude"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Limits:
    """What a table can do.

    Parameters
    ----------
    rate, acceleration : float
        deg/s and deg/s^2.
    travel : float or None
        Furthest that an axis may be from its start, deg; None is a slip ring: no limit.
    encoder : float
        Resolution of the angle encoders, deg; 0 is perfect.

    Examples
    --------
    >>> Limits(rate=20.0, travel=370.0).rate
    20.0
    """

    rate: float = 10.0
    acceleration: float = 20.0
    travel: float | None = None
    encoder: float = 0.0

    def __post_init__(self) -> None:
        if not (self.rate > 0 and self.acceleration > 0):
            raise InputError(
                f"a table's rate and acceleration must be positive, got {self.rate} deg/s and "
                f"{self.acceleration} deg/s^2"
            )
        if self.travel is not None and not self.travel > 0:
            raise InputError(f"a table's travel must be positive, got {self.travel} deg")
        if not self.encoder >= 0:
            raise InputError(f"an encoder's resolution cannot be negative, got {self.encoder} deg")

    def read(self, angle: ArrayLike) -> Array:
        """Return angles (rad) as the encoder says them."""
        a = np.asarray(angle, np.float64)
        if self.encoder == 0.0:
            return a
        step = self.encoder * DEG
        return np.asarray(step * np.round(a / step))


@dataclass(frozen=True)
class Scheme:
    """A scheme of rotation: steps that repeat, on a table with limits.

    Parameters
    ----------
    name : str
    steps : tuple of Dwell, Turn and Spin
    limits : Limits

    Raises
    ------
    InputError
        If a step needs more than the table can do.

    Examples
    --------
    >>> from schuler.motion import Dwell, Turn
    >>> steps = (Dwell(60.0), Turn("psi", 180.0), Dwell(60.0), Turn("psi", -180.0))
    >>> Scheme("to and fro", steps).period
    158.0
    """

    name: str
    steps: tuple[Dwell | Turn | Spin, ...]
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not self.steps or not self.period > 0:
            raise InputError(f"scheme '{self.name}': it has no step that takes time")
        for k, step in enumerate(self.steps, 1):
            if isinstance(step, Dwell):
                continue
            where = f"scheme '{self.name}', step {k}"
            if abs(step.rate) > self.limits.rate * (1 + 1e-12):
                raise InputError(
                    f"{where}: {abs(step.rate):g} deg/s is more than the table's "
                    f"{self.limits.rate:g} deg/s"
                )
            most = self.limits.acceleration * (1 + 1e-12)
            if isinstance(step, Turn) and step.acceleration > most:
                raise InputError(
                    f"{where}: {step.acceleration:g} deg/s^2 is more than the table's "
                    f"{self.limits.acceleration:g} deg/s^2"
                )
        if self.limits.travel is None:
            return
        for axis, (low, high, net) in self.travel().items():
            if abs(net) > 1e-9:
                raise InputError(
                    f"scheme '{self.name}': {axis} winds up by {net:g} deg a period, which only a "
                    "slip ring can follow; turn back, or leave the travel out"
                )
            if max(-low, high) > self.limits.travel * (1 + 1e-12):
                raise InputError(
                    f"scheme '{self.name}': {axis} goes {max(-low, high):g} deg from its start, "
                    f"more than its travel of {self.limits.travel:g} deg"
                )

    @property
    def period(self) -> float:
        """Time of all steps, s."""
        return float(sum(step.time for step in self.steps))

    def travel(self) -> dict[str, tuple[float, float, float]]:
        """Return for each axis its lowest and highest angle and the net turn in a period, deg."""
        out = {}
        for axis in AXES:
            turns = [s.angle for s in self.steps if not isinstance(s, Dwell) and s.axis == axis]
            way = np.concatenate([[0.0], np.cumsum(turns)])
            out[axis] = (float(way.min()), float(way.max()), float(way[-1]))
        return out

    def turntable(self, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Turntable:
        """Return the motion, from a start psi, theta, gamma (deg)."""
        return Turntable(self.steps, start, repeat=True)

    def angles(self, t: ArrayLike) -> Array:
        """Return the table's psi, theta, gamma at times t (n,), rad, (n, 3)."""
        time = np.atleast_1d(np.asarray(t, np.float64))
        return np.asarray(self.turntable().track(time).angles[:, 0, :, 0])

    def quaternion(self, t: ArrayLike) -> Array:
        """Return the IMU against the table's base at times t (n,), (n, 4)."""
        return euler_to_quat(self.angles(t))

    def on(self, carrier: Motion, locked: str = "carrier") -> Motion:
        """Return the IMU's motion on a carrier.

        Parameters
        ----------
        carrier : Motion
            With one turning frame.
        locked : {"carrier", "north"}
            Whether the scheme turns against the carrier, or against its start in the level frame:
            then the outer axis takes the carrier's heading out.

        Raises
        ------
        InputError
            For another word.
        """
        if locked == "carrier":
            return Carried(carrier, self.turntable())
        if locked == "north":
            return NorthLocked(carrier, self.turntable())
        raise InputError(f"a scheme is locked to the carrier or to north, got '{locked}'")

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` takes."""
        steps: list[dict[str, Any]] = []
        for s in self.steps:
            if isinstance(s, Dwell):
                steps.append({"dwell": s.time})
            elif isinstance(s, Spin):
                steps.append({"spin": s.axis, "rate": s.rate, "time": s.time})
            else:
                steps.append({"turn": s.axis, "angle": s.angle, "rate": s.rate,
                              "acceleration": s.acceleration})  # fmt: skip
        limits: dict[str, Any] = {
            "rate": self.limits.rate, "acceleration": self.limits.acceleration,
            "encoder": self.limits.encoder,
        }  # fmt: skip
        if self.limits.travel is not None:
            limits["travel"] = self.limits.travel
        return {"name": self.name, "limits": limits, "step": steps}

    @classmethod
    def from_dict(cls, data: dict[str, Any], name: str = "scheme") -> Scheme:
        """Make a scheme of plain values: ``{"limits": {...}, "step": [{"dwell": 60}, ...]}``.

        Numbers are s, deg, deg/s and deg/s^2. A turn that names no rate or acceleration takes the
        limits'.

        Raises
        ------
        InputError
            For an unknown key, a value of another kind, or more than the table can do.
        """
        check_keys(data, ("name", "about", "limits", "step"), "scheme")
        name = str(data.get("name", name))
        given = data.get("limits", {})
        check_keys(given, ("rate", "acceleration", "travel", "encoder"), f"scheme '{name}', limits")
        limits = Limits(**{k: number(v, f"limits.{k}") for k, v in given.items()})
        steps: list[Dwell | Turn | Spin] = []
        if not isinstance(data.get("step"), list):
            raise InputError(f"scheme '{name}': [[step]] tables are missing")
        for k, table in enumerate(data["step"], 1):
            where = f"scheme '{name}', step {k}"
            check_keys(
                table, ("dwell", "turn", "spin", "angle", "rate", "acceleration", "time"), where
            )
            kinds = [kind for kind in ("dwell", "turn", "spin") if kind in table]
            if len(kinds) != 1:
                raise InputError(f"{where}: say one of dwell, turn and spin")
            keys = {"dwell": (), "turn": ("angle", "rate", "acceleration"),
                    "spin": ("rate", "time")}[kinds[0]]  # fmt: skip
            check_keys(table, (kinds[0], *keys), where)
            value = {key: number(table[key], f"{where}: {key}") for key in keys if key in table}
            for key in {"turn": ("angle",), "spin": ("rate", "time")}.get(kinds[0], ()):
                if key not in value:
                    raise InputError(f"{where}: {key} is missing")
            if kinds[0] == "dwell":
                steps.append(Dwell(number(table["dwell"], f"{where}: dwell")))
            elif kinds[0] == "spin":
                steps.append(Spin(str(table["spin"]), value["rate"], value["time"]))
            else:
                steps.append(Turn(
                    str(table["turn"]), value["angle"], value.get("rate", limits.rate),
                    value.get("acceleration", limits.acceleration),
                ))  # fmt: skip
        return cls(name, tuple(steps), limits)

    @classmethod
    def from_toml(cls, path: str | Path) -> Scheme:
        """Read a scheme from a TOML file.

        Raises
        ------
        InputError
            If the file cannot be read, is not TOML, or holds a bad value.
        """
        path = Path(path)
        data = read_toml(path)
        with located(path):
            return cls.from_dict(data, path.stem)


@dataclass(frozen=True)
class NorthLocked:
    """A table on a carrier whose outer axis takes the carrier's heading out.

    Examples
    --------
    >>> from schuler.motion import Dwell, Static, Turntable
    >>> locked = NorthLocked(Static(30.0), Turntable([Dwell(10.0)]))
    >>> locked.track(np.array([0.0])).quat_nb.shape
    (1, 4)
    """

    carrier: Motion
    table: Motion

    def track(self, t: Array) -> Track:
        """Return the chain of both at times t (n,), s."""
        outer = self.carrier.track(t)
        if outer.angles.shape[1] != 1:
            raise InputError("only a carrier with one turning frame can have its heading undone")
        inner = self.table.track(t)
        angles = inner.angles.copy()
        angles[:, 0, 0] -= outer.angles[:, 0, 0]
        return Track(
            outer.path,
            np.concatenate([outer.angles, angles], axis=1),
            np.concatenate([outer.levers, inner.levers]),
        )


def carrier_attitude(imu: ArrayLike, encoder: ArrayLike) -> Array:
    """Return the carrier's quat_nb from the IMU's and the table's angles.

    Parameters
    ----------
    imu : (..., 4) array_like
        q of the IMU, to n.
    encoder : (..., 3) array_like
        The table's psi, theta, gamma, rad.

    Examples
    --------
    >>> carrier_attitude([1.0, 0.0, 0.0, 0.0], [np.pi / 2, 0.0, 0.0]).round(3).tolist()
    [0.707, 0.0, 0.0, -0.707]
    """
    return multiply(imu, euler_to_quat(encoder) * [1.0, -1.0, -1.0, -1.0])
