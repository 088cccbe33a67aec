"""`GnssFixes`: positions and velocities of an antenna, checked when they are made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.clock import CLOCKS
from schuler.earth import radii
from schuler.errors import InputError
from schuler.units import time_text

__all__ = ["GnssFixes"]

Array = NDArray[np.float64]

LEAST_SIGMA = (0.005, 0.005)
"""Of a position (m) and of a velocity (m/s): no receiver is better."""

LARGEST_SIGMA = 1e4
"""A fix that is said to be worse than this (m) is none."""

_MOVES = 1.0
"""A vehicle that is faster than this (m/s) does not stand."""

_METRES = (6.37e6, 6.37e6, 1.0)
"""Of a radian of latitude and longitude at the equator, and of height."""

PARTS = ("delay", "lever")
ABOVE = ("unstated", "ellipsoid", "geoid")


@dataclass(frozen=True, eq=False)
class GnssFixes:
    """Fixes of a GNSS antenna.

    Rows that cannot be fixes are left out and counted in `dropped`: times that repeat, numbers that
    are not finite, latitude and longitude both zero, a sigma of nothing or of kilometres, and a
    position that stands still to the last bit while the velocity does not.

    Parameters
    ----------
    time : (n,) array_like
        On the record's clock, s.
    lat, lon : (n,) array_like
        rad.
    height : (n,) array_like
        Above the ellipsoid, m.
    sigma : float or (n, 3) array_like
        1-sigma of the position, east, north, up, m.
    v_n : (n, 3) array_like, optional
        Velocity, east, north, up, m/s.
    v_sigma : float or (n, 3) array_like
        1-sigma of the velocity, m/s.
    quality : (n,) array_like, optional
        As RTKLIB: 1 fixed, 2 float, 4 differential, 5 single.
    lever : (3,) array_like
        From the IMU to the antenna, body axes, m.
    delay : float
        A fix stamped t is valid at t - delay, s.
    estimate : tuple of str
        Which of "lever" and "delay" are estimated.
    delay_sigma : float
        1-sigma of a delay that is estimated, before anything is measured, s.
    name : str
    dropped : mapping of str to int
        Rows that were left out, by reason.
    clock : str
        What the times count, of `schuler.aiding.clock.CLOCKS`; "unstated" where it is not known.
    epoch : str
        The week or day that they count from, in words, where it is known.
    height_above : {"ellipsoid", "geoid", "unstated"}
        What the heights are above.
    notes : tuple of str
        What else a reader found.
    format : str
        Of the file that they were read from.

    Raises
    ------
    InputError
        For arrays of other shapes, latitudes that are no angles in rad, or fewer than two fixes.

    Examples
    --------
    >>> import numpy as np
    >>> fixes = GnssFixes(np.arange(4.0), np.full(4, 0.7), [0, 1e-6, 2e-6, 2e-6], np.zeros(4), 3.0)
    >>> len(fixes)
    4
    """

    time: ArrayLike
    lat: ArrayLike
    lon: ArrayLike
    height: ArrayLike
    sigma: ArrayLike = 3.0
    v_n: ArrayLike | None = None
    v_sigma: ArrayLike = 0.1
    quality: ArrayLike | None = None
    lever: ArrayLike = (0.0, 0.0, 0.0)
    delay: float = 0.0
    estimate: tuple[str, ...] = ()
    delay_sigma: float = field(default=0.3, kw_only=True)
    name: str = "gnss"
    dropped: Mapping[str, int] = field(default_factory=dict)
    clock: str = "unstated"
    epoch: str = ""
    height_above: str = "unstated"
    notes: tuple[str, ...] = ()
    format: str = ""

    def __post_init__(self) -> None:
        time = np.asarray(self.time, np.float64)
        n = len(time)
        columns: dict[str, Any] = {"time": time}
        for name in ("lat", "lon", "height"):
            columns[name] = np.asarray(getattr(self, name), np.float64)
        if self.quality is not None:
            columns["quality"] = np.asarray(self.quality, np.float64)
        for name in ("sigma", "v_sigma"):
            value = np.asarray(getattr(self, name), np.float64)
            value = value[:, None] if value.shape == (n,) and n != 3 else value
            columns[name] = np.array(np.broadcast_to(value, (n, 3)))
        if self.v_n is not None:
            columns["v_n"] = np.asarray(self.v_n, np.float64)
        for name, value in columns.items():
            shape = (n, 3) if name in ("sigma", "v_sigma", "v_n") else (n,)
            if value.shape != shape:
                raise InputError(f"{self.name}: {name} must be of shape {shape}, got {value.shape}")
        unknown = set(self.estimate) - set(PARTS)
        if unknown:
            raise InputError(f"{self.name}: cannot estimate {min(unknown)}; say lever or delay")
        if self.clock not in CLOCKS or self.height_above not in ABOVE:
            raise InputError(
                f"{self.name}: clock must be one of {', '.join(CLOCKS)} and height_above one of "
                f"{', '.join(ABOVE)}, got {self.clock} and {self.height_above}"
            )
        lever = np.asarray(self.lever, np.float64)
        if lever.shape != (3,) or not np.all(np.isfinite(lever)) or np.abs(lever).max() > 100.0:
            raise InputError(
                f"{self.name}: a lever arm has three numbers of at most 100 m, got {self.lever}"
            )
        if not (np.isfinite(self.delay) and abs(self.delay) < 10.0):
            raise InputError(f"{self.name}: a delay is less than 10 s, got {self.delay}")
        dropped = dict(self.dropped)
        if not 0.0 < self.delay_sigma < 10.0:
            raise InputError(
                f"{self.name}: 1-sigma of a delay is above 0 and below 10 s, got {self.delay_sigma}"
            )
        keep = _usable(columns, dropped)
        order = np.flatnonzero(keep)
        late = int(np.sum(np.diff(time[order]) < 0.0))
        order = order[np.argsort(time[order], kind="stable")]
        first = np.diff(time[order], prepend=-np.inf) > 0.0
        _count(dropped, "a time that repeats", len(order) - int(np.sum(first)))
        order = order[first]
        order = order[_moving(columns, order, dropped)]
        if len(order) < 2:
            said = ", ".join(f"{count} with {reason}" for reason, count in dropped.items())
            raise InputError(
                f"{self.name}: fewer than two usable fixes of {n}{': ' + said if said else ''}"
            )
        for name, value in columns.items():
            object.__setattr__(self, name, np.ascontiguousarray(value[order]))
        for name, least in zip(("sigma", "v_sigma"), LEAST_SIGMA, strict=True):
            np.maximum(getattr(self, name), least, out=getattr(self, name))
        object.__setattr__(self, "lever", lever)
        object.__setattr__(self, "dropped", dropped)
        if late:
            said = f"{late} times go back: the rows were sorted"
            object.__setattr__(self, "notes", (*self.notes, said))

    def __len__(self) -> int:
        return len(np.asarray(self.time))

    def rows(self, which: NDArray[Any]) -> GnssFixes:
        """Return some of the fixes.

        Raises
        ------
        InputError
            If fewer than two are left.
        """
        cut = {
            name: np.asarray(getattr(self, name))[which]
            for name in ("time", "lat", "lon", "height", "v_n", "quality")
            if getattr(self, name) is not None
        }
        sigma = np.asarray(self.sigma)[which], np.asarray(self.v_sigma)[which]
        return replace(self, sigma=sigma[0], v_sigma=sigma[1], **cut)

    @property
    def speed(self) -> Array | None:
        """Level speed, m/s, (n,)."""
        if self.v_n is None:
            return None
        return np.asarray(np.linalg.norm(np.asarray(self.v_n)[:, :2], axis=1))

    @property
    def moving(self) -> tuple[Array, NDArray[np.bool_]] | None:
        """When the fixes are valid, and whether the speed is one beyond its noise; None without.

        At rest one level speed in 300,000 is larger than five times the sigma of an axis; the mean
        of five fixes is held to less, so that a vehicle that creeps does not pass for one at rest.
        """
        speed = self.speed
        if speed is None:
            return None
        noise = np.asarray(self.v_sigma)[:, :2].max(axis=1)
        fast = speed > np.maximum(5.0 * noise, 0.2)
        count = min(5, len(self))
        mean = [np.convolve(c, np.ones(count) / count, "same") for c in np.asarray(self.v_n).T[:2]]
        fast |= np.hypot(*mean) > np.maximum(5.0 * noise / np.sqrt(count), 0.2)
        return np.asarray(self.time) - self.delay, fast

    def local(self) -> Array:
        """Return east, north, up of the first fix, m, (n, 3)."""
        lat, lon, height = (np.asarray(x) for x in (self.lat, self.lon, self.height))
        meridian, transverse = radii(lat)
        turn = (lon - lon[0] + np.pi) % (2.0 * np.pi) - np.pi
        return np.column_stack([
            turn * (transverse + height) * np.cos(lat), (lat - lat[0]) * (meridian + height),
            height - height[0],
        ])  # fmt: skip

    def contradictions(self) -> list[str]:
        """Hold the positions against the velocities; return what cannot be, in sentences.

        A swapped pair, degrees read as radians, or a velocity down read as up shows there.
        """
        from schuler.aiding.consistency import contradictions

        return contradictions(self)

    def describe(self) -> dict[str, Any]:
        """Return rate, span, quality and gaps in plain values."""
        time = np.asarray(self.time)
        dt = np.diff(time)
        usual = float(np.median(dt))
        out: dict[str, Any] = {
            "fixes": len(self), "start_s": float(time[0]), "end_s": float(time[-1]),
            "rate_hz": 1.0 / usual, "gaps": int(np.sum(dt > 2.5 * usual)),
            "longest_gap_s": float(dt.max()),
            "sigma_m": [float(x) for x in np.median(np.asarray(self.sigma), axis=0)],
            "velocity": self.v_n is not None, "dropped": dict(self.dropped),
            "clock": self.clock, "epoch": self.epoch, "height_above": self.height_above,
        }  # fmt: skip
        if self.quality is not None:
            values, counts = np.unique(np.asarray(self.quality), return_counts=True)
            out["quality"] = {f"{v:g}": int(c) for v, c in zip(values, counts, strict=True)}
        return out


def _count(dropped: dict[str, int], reason: str, count: int) -> None:
    if count:
        dropped[reason] = dropped.get(reason, 0) + count


def _usable(columns: Mapping[str, Array], dropped: dict[str, int]) -> NDArray[np.bool_]:
    """Return which rows are numbers that a fix can have."""
    lat, lon, height = columns["lat"], columns["lon"], columns["height"]
    finite = np.isfinite(columns["time"])
    for name in ("lat", "lon", "height", "sigma", "v_sigma", "v_n"):
        if name in columns:
            x = columns[name]
            finite &= np.isfinite(x if x.ndim == 1 else x.sum(axis=1))
    _count(dropped, "a value that is no number", int(np.sum(~finite)))
    keep = finite.copy()
    with np.errstate(invalid="ignore"):
        nowhere = keep & (lat == 0.0) & (lon == 0.0)
        _count(dropped, "latitude and longitude zero", int(np.sum(nowhere)))
        keep &= ~nowhere
        sigma = columns["sigma"]
        bad = keep & (np.any(sigma <= 0.0, axis=1) | np.any(sigma > LARGEST_SIGMA, axis=1))
        _count(dropped, "a sigma of nothing or of kilometres", int(np.sum(bad)))
        keep &= ~bad
        wrong = keep & (
            (np.abs(lat) > 0.5 * np.pi) | (np.abs(lon) > 2.0 * np.pi) | (np.abs(height) > 1e5)
        )
    if np.any(wrong):
        k = int(np.flatnonzero(wrong)[0])
        raise InputError(
            f"a fix at t = {time_text(columns['time'][k])} s has latitude {lat[k]:.6g} rad, "
            "longitude "
            f"{lon[k]:.6g} rad and height {height[k]:.6g} m, which is no place: check its units "
            "and that latitude and longitude are not exchanged"
        )
    return keep


def _moving(
    columns: Mapping[str, Array], order: NDArray[np.int64], dropped: dict[str, int]
) -> NDArray[np.bool_]:
    """Return which of the rows are not a stale position of a receiver that lost its fixes."""
    same = np.zeros(len(order), bool)
    if len(order) < 3:
        return np.asarray(~same)
    place = np.column_stack([columns[name][order] for name in ("lat", "lon", "height")])
    repeats = np.zeros(len(order), bool)
    repeats[1:] = np.all(place[1:] == place[:-1], axis=1)
    if "v_n" in columns:
        speed = np.linalg.norm(columns["v_n"][order], axis=1)
        same = repeats & (speed > _MOVES)
        _count(dropped, "a position that stands while the velocity does not", int(np.sum(same)))
        return np.asarray(~same)
    # Without a velocity, the jump after three alike says that the receiver moved meanwhile.
    time = columns["time"][order]
    first = np.flatnonzero(~repeats)
    for begin, after in pairwise(first):
        if after - begin < 3:
            continue
        step = (place[after] - place[begin]) * _METRES
        step[1] *= np.cos(place[begin, 0])
        if np.linalg.norm(step) > _MOVES * (time[after] - time[begin]):
            same[begin + 2 : after] = True
    _count(dropped, "a position that stands and then jumps", int(np.sum(same)))
    return np.asarray(~same)
