"""Aids of a path that is only planned, as ``gnss=0.1m/s,3m@1Hz``, and the bound they allow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler._result import Result
from schuler.aiding import BodySpeed
from schuler.aiding.gnss import LARGEST_SIGMA
from schuler.alignment.limit_table import limit_columns, limit_lines
from schuler.alignment.moving.path_bound import PathLimit, limits_on, planned_fixes
from schuler.alignment.moving.setup import Aid
from schuler.attitude import quat_to_matrix
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, load_spec
from schuler.trajectory import Trajectory

__all__ = ["PathTable", "PlannedAid", "axes_of", "path_table", "planned_limits"]

KINDS = ("gnss", "odometer", "dvl", "master")

#: unit -> what it is of, and its size in SI; one that ends like another goes before it
_UNITS = {"mrad": ("attitude", 1e-3), "m/s": ("velocity", 1.0), "m": ("position", 1.0)}

_NO_POSITION = LARGEST_SIGMA
"""Sigma of a receiver that gives velocity alone, m: beside the 100 m of the start it is nothing."""

_EXAMPLE = (
    "gnss=0.1m/s,3m@1Hz, odometer=0.1m/s@10Hz, dvl=0.02m/s@1Hz or master=0.1mrad,0.02m/s@10Hz"
)


@dataclass(frozen=True)
class PlannedAid:
    """What will be measured along a path, how well and how often.

    Parameters
    ----------
    kind : {"gnss", "odometer", "dvl", "master"}
        A master is the navigation of another unit on the same vehicle, whose mounting, lever arm
        and delay are not known.
    velocity : float or None
        1-sigma, m/s; None for positions alone.
    position : float or None
        1-sigma, m, of gnss or a master; None for velocities alone.
    rate : float
        Hz.
    attitude : float or None
        1-sigma, rad, of a master; None for a master of velocity alone.

    Raises
    ------
    InputError
        For a kind that there is not, nothing measured, or numbers that are not positive.

    Examples
    --------
    >>> PlannedAid("gnss", velocity=0.05, position=1.0, rate=1.0)
    PlannedAid(kind='gnss', velocity=0.05, position=1.0, rate=1.0, attitude=None)
    """

    kind: str
    velocity: float | None = None
    position: float | None = None
    rate: float = 1.0
    attitude: float | None = None

    def __post_init__(self) -> None:
        numbers = [
            x for x in (self.velocity, self.position, self.attitude, self.rate) if x is not None
        ]
        if self.kind not in KINDS or len(numbers) < 2:
            raise InputError(f"a planned aid is {_EXAMPLE}; got {self}")
        if not all(math.isfinite(x) and x > 0.0 for x in numbers):
            raise InputError(f"sigma and rate of {self.kind} must be positive")
        if self.attitude is not None and self.kind != "master":
            raise InputError(f"{self.kind} measures no attitude, only a master does")
        if (self.kind != "gnss" and self.velocity is None) or (
            self.kind in ("odometer", "dvl") and self.position is not None
        ):
            raise InputError(f"{self.kind} measures a velocity: give its sigma, as 0.1m/s")

    @classmethod
    def parse(cls, text: str) -> PlannedAid:
        """Return the aid that a text says, as ``gnss=0.1m/s,3m@1Hz``.

        Raises
        ------
        InputError
            For any other text.
        """
        kind, _, rest = text.strip().partition("=")
        sigmas, at, rate = rest.partition("@")
        found: dict[str, float] = {}
        try:
            if at:
                found["rate"] = float(rate.strip().removesuffix("Hz"))
            for cell in sigmas.split(","):
                number = cell.strip()
                unit = next((unit for unit in _UNITS if number.endswith(unit)), None)
                if unit is None or _UNITS[unit][0] in found:
                    raise ValueError
                name, factor = _UNITS[unit]
                found[name] = factor * float(number.removesuffix(unit))
        except ValueError:
            raise InputError(f"an aid is said as {_EXAMPLE}; got '{text}'") from None
        if kind not in KINDS:
            raise InputError(f"an aid is said as {_EXAMPLE}; got '{text}'")
        return cls(kind, **found)

    def along(self, path: Trajectory) -> Aid:
        """Return what it would measure along a path, without noise.

        Raises
        ------
        InputError
            For a master, whose path is that of the vehicle (`planned_limits`).
        """
        if self.kind == "master":
            raise InputError("a master is no aid of its own measurements: take planned_limits")
        if self.kind == "gnss":
            position = _NO_POSITION if self.position is None else self.position
            return planned_fixes(path, self.rate, position, self.velocity)
        assert self.velocity is not None
        count = int(np.floor((path.time[-1] - path.time[0]) * self.rate + 1e-6)) + 1
        time = path.time[0] + np.arange(count) / self.rate
        body = np.einsum("iab,ia->ib", quat_to_matrix(path.known("quat_nb")), path.known("v_n"))
        value = np.column_stack([np.interp(time, path.time, c) for c in body.T])
        return BodySpeed(
            time, value[:, 1] if self.kind == "odometer" else value, self.velocity, name=self.kind
        )

    def __str__(self) -> str:
        parts = []
        if self.attitude is not None:
            parts.append(f"{1e3 * self.attitude:g}mrad")
        if self.velocity is not None:
            parts.append(f"{self.velocity:g}m/s")
        if self.position is not None:
            parts.append(f"{self.position:g}m")
        return f"{self.kind}={','.join(parts)}@{self.rate:g}Hz"


@dataclass(frozen=True, eq=False)
class PathTable(Result):
    """The bound of an alignment on a path, for several lengths of it.

    Parameters
    ----------
    spec : ImuSpec
    path : str
        Its name.
    aids : tuple of PlannedAid
    limits : tuple of PathLimit
        One to each length.
    """

    spec: ImuSpec
    path: str
    aids: tuple[PlannedAid, ...]
    limits: tuple[PathLimit, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the table with the keys of the JSON schema `schuler.path-limit/1`."""
        rows = []
        for each in self.limits:
            _, velocity, position = np.split(np.sqrt(np.diag(each.covariance)), 3)
            mounting = each.mounting_arcmin
            rows.append({
                "time_s": each.duration,
                "sigma_arcmin": axes_of(each),
                **({} if mounting is None else {"mounting_sigma_arcmin": mounting}),
                "velocity_m_s": [float(v) for v in velocity],
                "position_m": [float(v) for v in position],
                "gyro_bias_deg_h": [float(v) / DEG_PER_HOUR for v in each.gyro_bias],
                "accelerometer_bias_ug": [float(v) / MICRO_G for v in each.accel_bias],
            })  # fmt: skip
        return {
            "schema": "schuler.path-limit/1", "spec": self.spec.name, "path": self.path,
            "aids": [str(aid) for aid in self.aids], "rows": rows,
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return the limits, one row to a length."""
        return limit_columns(self.to_dict()["rows"])

    def __str__(self) -> str:
        lines = [
            f"limit of phi along {self.path}, and what it leaves of the biases (body x, y, z): "
            f"{self.spec.name}, {' '.join(map(str, self.aids))}",
            *limit_lines(self.limits),
        ]
        if self.limits[0].mounting_arcmin is not None:
            lines.append("what it leaves of the slave's mounting (body x, y, z):")
            for limit in self.limits:
                each = "  ".join(f"{v:8.4g}'" for v in limit.mounting_arcmin or ())
                lines.append(f"{limit.duration:10.6g}  {each}")
        return "\n".join(lines)


def planned_limits(
    path: Trajectory, spec: ImuSpec, aids: Sequence[PlannedAid], times: Sequence[float] | None, *,
    record: ImuRecord | None = None,
) -> list[PathLimit]:  # fmt: skip
    """Return the bounds along a path with planned aids, or with a master.

    Parameters
    ----------
    path, spec, times, record
        As in `limits_on`.
    aids : sequence of PlannedAid

    Raises
    ------
    InputError
        As `limits_on`, and for a master beside other aids.
    """
    from schuler.alignment.transfer.master import MasterNoise
    from schuler.alignment.transfer.path_bound import master_limits

    masters = [aid for aid in aids if aid.kind == "master"]
    if not masters:
        along = [aid.along(path) for aid in aids]
        return limits_on(path, spec, along, times, record=record)
    if len(aids) > 1:
        raise InputError("a master has the other aids in its own navigation: say it alone")
    master = masters[0]
    assert master.velocity is not None
    usual = MasterNoise()
    noise = MasterNoise(
        usual.attitude if master.attitude is None else master.attitude, master.velocity,
        usual.position if master.position is None else master.position,
    )  # fmt: skip
    parts = [
        name
        for name, sigma in (
            ("velocity", master.velocity), ("attitude", master.attitude),
            ("position", master.position),
        ) if sigma is not None
    ]  # fmt: skip
    return master_limits(path, spec, noise, master.rate, times, parts=tuple(parts), record=record)


def axes_of(limit: PathLimit) -> dict[str, float]:
    """Return the 1-sigma of phi by axis, arcmin."""
    return dict(zip(("east", "north", "up"), map(float, limit.sigma_arcmin), strict=True))


def path_table(
    path: Trajectory, spec: ImuSpec | str | Path, aids: Sequence[PlannedAid],
    times: Sequence[float] | None = None, *, record: ImuRecord | None = None,
) -> PathTable:  # fmt: skip
    """Return the bound of an alignment on a path for several lengths of it.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    spec : ImuSpec, str or path
    aids : sequence of PlannedAid
    times : sequence of float, optional
        s since the path's start, increasing; its whole length when not given.
    record : ImuRecord, optional
        What a perfect instrument has along the path.

    Raises
    ------
    InputError
        As `limit_on`, and for a time that the path does not last.

    Examples
    --------
    >>> planned = [PlannedAid("gnss", position=1.0, velocity=0.05)]
    >>> table = path_table(driven, spec, planned, [30.0, 60.0])
    >>> first, last = (each.sigma_arcmin[2] for each in table.limits)
    >>> bool(last < first)
    True
    """
    instrument = load_spec(spec)
    if instrument is None or not aids:
        raise InputError("a bound on a path needs an instrument and at least one aid")
    found = planned_limits(path, instrument, aids, times, record=record)
    return PathTable(instrument, path.name, tuple(aids), tuple(found))
