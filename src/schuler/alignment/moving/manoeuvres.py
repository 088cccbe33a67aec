"""Which manoeuvre helps the heading most: the bound after each of a set of them.

Each begins after the same steady drive, takes the same time and stays within what the vehicle can
do; its path is simulated without errors, and the bound along it is that of `limit_on`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.alignment.moving.path_bound import PathLimit
from schuler.alignment.moving.planned import PlannedAid, axes_of, planned_limits
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import Manoeuvre, Route
from schuler.motion.base import Motion, Track
from schuler.sensors import ImuSpec, load_spec
from schuler.simulation import simulate

__all__ = ["VEHICLES", "DrivePlan", "PlannedManoeuvre", "Vehicle", "plan_drive"]

Array = NDArray[np.float64]

_RATE = 50.0
"""Of the simulated path, Hz."""

_ROCK, _ROCK_HZ, _RAMP = 12.0, 0.35, 2.0
"""Wing rock: amplitude (deg), frequency, and the time in which it sets in, s."""


@dataclass(frozen=True)
class Vehicle:
    """What a vehicle can do.

    Parameters
    ----------
    lateral : float
        Largest acceleration across its way in a turn, m/s^2.
    along : float
        Largest acceleration when it brakes, m/s^2.
    flies : bool
        Banks in turns, and can rock its wings.
    """

    lateral: float
    along: float
    flies: bool = False


#: kind -> what it can do
VEHICLES = {
    "car": Vehicle(3.0, 3.0),
    "ship": Vehicle(0.3, 0.1),
    "aircraft": Vehicle(10.0, 1.5, True),
}


@dataclass(frozen=True)
class _Rocking:
    """A route on which the wings rock from a time on."""

    route: Route
    begin: float

    def track(self, t: Array) -> Track:
        """Return the track at times t (n,), s."""
        out = self.route.track(t)
        u = np.clip((t - self.begin) / _RAMP, 0.0, 1.0)
        ramp = np.column_stack([
            u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 30.0 * u**2 * (1.0 - u) ** 2 / _RAMP,
            60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / _RAMP**2,
        ])  # fmt: skip
        w = 2.0 * np.pi * _ROCK_HZ
        s, c = np.sin(w * (t - self.begin)), w * np.cos(w * (t - self.begin))
        roll = np.column_stack([
            ramp[:, 0] * s, ramp[:, 1] * s + ramp[:, 0] * c,
            ramp[:, 2] * s + 2.0 * ramp[:, 1] * c - w * w * ramp[:, 0] * s,
        ])  # fmt: skip
        angles = out.angles.copy()
        angles[:, 0, 2] += _ROCK * DEG * roll
        return Track(out.path, angles, out.levers)


@dataclass(frozen=True, eq=False)
class PlannedManoeuvre:
    """A manoeuvre and the bound after it.

    Parameters
    ----------
    name : str
    what : str
        In words.
    limit : PathLimit
    """

    name: str
    what: str
    limit: PathLimit


@dataclass(frozen=True, eq=False)
class DrivePlan:
    """Manoeuvres of one length, the one that leaves the least sigma of the heading first.

    Parameters
    ----------
    spec : ImuSpec
    vehicle : str
    speed : float
        m/s.
    before, time : float
        Length of the steady drive before, and of the manoeuvre, s.
    aids : tuple of PlannedAid
    start : PathLimit
        The bound after the steady drive alone.
    manoeuvres : tuple of PlannedManoeuvre
    left_out : dict of str to float
        Manoeuvres for which the time is too short, and the time that they need, s.
    """

    spec: ImuSpec
    vehicle: str
    speed: float
    before: float
    time: float
    aids: tuple[PlannedAid, ...]
    start: PathLimit
    manoeuvres: tuple[PlannedManoeuvre, ...]
    left_out: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return the plan with the keys of the JSON schema `schuler.drive-plan/1`."""
        return {
            "schema": "schuler.drive-plan/1", "spec": self.spec.name, "vehicle": self.vehicle,
            "speed_m_s": self.speed, "before_s": self.before, "time_s": self.time,
            "aids": [str(aid) for aid in self.aids], "start_sigma_arcmin": axes_of(self.start),
            "manoeuvres": [
                {
                    "name": each.name, "what": each.what, "sigma_arcmin": axes_of(each.limit),
                    **_mounting_of(each.limit),
                }
                for each in self.manoeuvres
            ],
            "left_out": self.left_out,
        }  # fmt: skip

    def __str__(self) -> str:
        up = float(self.start.sigma_arcmin[2])
        known = f"{up:.3g}'" if up < 600.0 else f"{up / 60.0:.0f} deg"
        lines = [
            f"{self.vehicle} at {self.speed:g} m/s, {self.spec.name}, "
            f"{' '.join(map(str, self.aids))}: heading ± {known} after {self.before:g} s "
            f"straight on; limit after {self.time:g} s more",
            f"{'manoeuvre':<16}  {'east':>9}  {'north':>9}  {'up':>9}   "
            f"{'' if self.start.mounting_arcmin is None else ' mounting   '}what",
        ]
        for each in self.manoeuvres:
            east, north, heading = each.limit.sigma_arcmin
            mounting = each.limit.mounting_arcmin
            worst = "" if mounting is None else f"{max(mounting):8.4g}'   "
            lines.append(
                f"{each.name:<16}  {east:8.4g}'  {north:8.4g}'  {heading:8.4g}'   {worst}"
                f"{each.what}"
            )
        lines += [
            f"{name} needs {needs:.3g} s at this speed" for name, needs in self.left_out.items()
        ]
        return "\n".join(lines)


def _mounting_of(limit: PathLimit) -> dict[str, list[float]]:
    """Return what JSON says of a slave's mounting; nothing without a master."""
    mounting = limit.mounting_arcmin
    return {} if mounting is None else {"mounting_sigma_arcmin": mounting}


def _candidates(
    vehicle: Vehicle, speed: float, before: float, time: float
) -> tuple[dict[str, tuple[Motion, str]], dict[str, float]]:  # fmt: skip
    """Return motions and words by name, and the manoeuvres that take longer."""

    def route(*legs: Manoeuvre) -> Route:
        return Route(
            [Manoeuvre(before), *legs], speed=speed, coordinated=vehicle.flies
        )  # fmt: skip

    half = 0.5 * time
    # The peak rate of a smooth step is twice its mean.
    widest = vehicle.lateral * time / (2.0 * max(speed, 1e-3)) / DEG
    turn, bend = min(90.0, widest), min(60.0, 0.5 * widest)
    change = min(0.5 * speed, 0.25 * vehicle.along * time)
    out: dict[str, tuple[Motion, str]] = {
        "straight": (route(Manoeuvre(time)), "steady and straight on"),
        "brake": (
            route(Manoeuvre(half, speed=-change), Manoeuvre(half, speed=change)),
            f"{change:.3g} m/s slower in {half:g} s, and back",
        ),
        "turn": (route(Manoeuvre(time, turn=turn)), f"{turn:.3g} deg in {time:g} s"),
        "S": (
            route(Manoeuvre(half, turn=bend), Manoeuvre(half, turn=-bend)),
            f"{bend:.3g} deg right in {half:g} s, and back",
        ),
    }  # fmt: skip
    left_out = {}
    if 0.5 * widest >= 360.0:
        circle = route(Manoeuvre(half, turn=360.0), Manoeuvre(half, turn=-360.0))
        out["figure of eight"] = (circle, f"a circle right and one left, {half:g} s each")
    else:
        left_out["figure of eight"] = 720.0 / widest * time
    if vehicle.flies:
        rock = _Rocking(route(Manoeuvre(time)), before)
        out["wing rock"] = (rock, f"{_ROCK:g} deg at {_ROCK_HZ:g} Hz")
    return out, left_out


@with_one_blas_thread
def plan_drive(
    spec: ImuSpec | str | Path, aids: Sequence[PlannedAid] = (PlannedAid("gnss", 0.1, 3.0),), *,
    vehicle: str = "car", speed: float = 12.0, time: float = 20.0, before: float = 30.0,
    site: Site | None = None,
) -> DrivePlan:  # fmt: skip
    """Return which manoeuvre helps the heading most in the next seconds.

    Parameters
    ----------
    spec : ImuSpec, str or path
        The instrument.
    aids : sequence of PlannedAid
        What is measured beside it.
    vehicle : {"car", "ship", "aircraft"}
        A key of `VEHICLES`.
    speed : float
        m/s.
    time : float
        Of the manoeuvre, s.
    before : float
        Of the steady drive before it, which the alignment has as well, s.
    site : Site, optional
        45 deg north when not given.

    Raises
    ------
    InputError
        For a vehicle that there is not, or numbers that are not positive.

    Examples
    --------
    >>> from schuler.alignment import plan_drive
    >>> plan_drive("tactical-fog", time=20.0).manoeuvres[0].name
    'turn'
    """
    instrument = load_spec(spec)
    if instrument is None:
        raise InputError("a plan needs an instrument: give its specification")
    if vehicle not in VEHICLES:
        raise InputError(f"vehicle must be one of {', '.join(VEHICLES)}, got '{vehicle}'")
    for name, value, least in (("speed", speed, 0.1), ("time", time, 2.0), ("before", before, 2.0)):
        if not (np.isfinite(value) and least <= value <= 3600.0):
            raise InputError(f"{name} must be from {least:g} to 3600, got {value:g}")
    place = site or Site(45.0)
    motions, left_out = _candidates(VEHICLES[vehicle], speed, before, time)
    found, start = [], None
    for name, (motion, what) in motions.items():
        made = simulate(motion, place, before + time, _RATE, name=name)
        first, last = planned_limits(
            made.truth, instrument, aids, [before, before + time], record=made.record
        )
        start = start or first
        found.append(PlannedManoeuvre(name, what, last))
    assert start is not None
    found.sort(key=lambda each: float(each.limit.sigma_arcmin[2]))
    return DrivePlan(
        instrument, vehicle, speed, before, time, tuple(aids), start, tuple(found), left_out
    )
