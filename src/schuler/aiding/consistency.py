"""Positions of GNSS fixes held against their own velocities: how well they agree, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.earth import radii

if TYPE_CHECKING:
    from schuler.aiding.gnss import GnssFixes

__all__ = ["Consistency", "consistency", "contradictions"]

Array = NDArray[np.float64]

_FEWEST = 8
_LAGS = np.linspace(-1.0, 1.0, 101)
_BETTER = 0.3
"""What explains a difference leaves less than this share of it."""

_LEAST = 0.3
"""A difference of velocities below this (m/s) is no contradiction unless the sigma say so."""


@dataclass(frozen=True, eq=False)
class Consistency:
    """How the change of positions agrees with velocities.

    Parameters
    ----------
    pairs : int
        Of neighbouring fixes that were compared.
    rms : (3,) float64
        Of d(position)/dt minus velocity, east, north, up, m/s.
    lag : float
        By which the velocities are older than their stamps, beside the positions: where the
        horizontal difference is least, s.
    rms_at_lag : (3,) float64
        The same there.
    """

    pairs: int
    rms: Array
    lag: float
    rms_at_lag: Array

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "pairs": self.pairs, "rms_m_s": [float(x) for x in self.rms], "lag_s": self.lag,
            "rms_at_lag_m_s": [float(x) for x in self.rms_at_lag],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Changes of position between neighbouring fixes, and what belongs to them."""

    middle: Array
    rate: Array
    near: NDArray[np.bool_]
    time: Array
    v_n: Array

    @classmethod
    def of(cls, time: Array, place: Array, v_n: Array) -> _Pairs:
        dt = np.diff(time)
        near = dt < 3.0 * np.median(dt)
        rate = np.diff(place, axis=0)[near] / dt[near, None]
        return cls((0.5 * (time[1:] + time[:-1]))[near], rate, near, time, v_n)

    def difference(self, lag: float = 0.0) -> Array:
        v = np.column_stack([np.interp(self.middle + lag, self.time, c) for c in self.v_n.T])
        return np.asarray(self.rate - v)


def consistency(fixes: GnssFixes) -> Consistency | None:
    """Compare positions with velocities; None where there are none, or fewer than eight fixes.

    Parameters
    ----------
    fixes : GnssFixes

    Examples
    --------
    >>> import numpy as np
    >>> from schuler.aiding import GnssFixes
    >>> t = np.arange(0.0, 60.0, 0.25)
    >>> speed = 10.0 + 5.0 * np.sin(0.5 * t)
    >>> north = 10.0 * t - 10.0 * (np.cos(0.5 * t) - 1.0)
    >>> late = 10.0 + 5.0 * np.sin(0.5 * (t - 0.2))
    >>> v = np.column_stack([0.0 * t, late, 0.0 * t])
    >>> found = consistency(GnssFixes(t, 0.7 + north / 6.36e6, 0.0 * t, 0.0 * t, 0.1, v))
    >>> print(f"{found.lag:.2f} s")
    0.20 s
    """
    if fixes.v_n is None or len(fixes) < _FEWEST:
        return None
    pairs = _Pairs.of(np.asarray(fixes.time), fixes.local(), np.asarray(fixes.v_n))
    cost = np.array([np.mean(pairs.difference(lag)[:, :2] ** 2) for lag in _LAGS])
    k = int(np.argmin(cost))
    lag = float(_LAGS[k])
    if 0 < k < len(_LAGS) - 1:
        before, here, after = cost[k - 1 : k + 2]
        curvature = before - 2.0 * here + after
        if curvature > 0.0:
            lag += float(0.5 * (before - after) / curvature * (_LAGS[1] - _LAGS[0]))
    # Without a change of velocity all lags are alike.
    lag = lag if cost[k] < 0.9 * cost[len(_LAGS) // 2] else 0.0

    def rms(x: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(x**2, axis=0)))

    return Consistency(len(pairs.middle), rms(pairs.difference()), lag, rms(pairs.difference(lag)))


def contradictions(fixes: GnssFixes) -> list[str]:
    """Return what of positions and velocities cannot be, in sentences with the likely cause."""
    if fixes.v_n is None or len(fixes) < _FEWEST:
        return []
    time, v = np.asarray(fixes.time), np.asarray(fixes.v_n)
    pairs = _Pairs.of(time, fixes.local(), v)
    off = pairs.difference()
    moved = pairs.rate - off
    dt = np.diff(time)[pairs.near]
    noise = 3.0 * np.median(
        np.asarray(fixes.sigma)[1:][pairs.near] / dt[:, None]
        + np.asarray(fixes.v_sigma)[1:][pairs.near], axis=0,
    )  # fmt: skip
    # A sigma that was not stated may be far too large: what scatters from pair to pair is noise,
    # and what stays is none.
    scatter = np.median(np.abs(np.diff(off, axis=0)), axis=0)
    noise = np.minimum(noise, np.maximum(3.0 * scatter, _LEAST))
    found = []
    for axis, name in enumerate(("east", "north", "up")):
        spread = float(np.median(np.abs(off[:, axis])))
        if spread <= max(noise[axis], 0.5 * float(np.median(np.abs(moved[:, axis])))):
            continue
        size = float(np.sqrt(np.mean(moved[:, axis] ** 2)))
        if axis == 2:
            reverse = float(np.median(np.abs(pairs.rate[:, 2] + moved[:, 2])))
            advice = "its sign seems turned (down read as up?)" if reverse < _BETTER * spread else (
                "are the heights and the vertical velocity right?"
            )  # fmt: skip
        else:
            advice = _likely(fixes, float(np.median(np.linalg.norm(off[:, :2], axis=1))))
        found.append(
            f"{fixes.name}: the positions change {name} by other than the velocity says (median "
            f"difference {spread:.3g} m/s, velocity {size:.3g} m/s rms): {advice}"
        )
    return found


def _likely(fixes: GnssFixes, spread: float) -> str:
    """Return which mistake would explain a horizontal difference."""
    time, v = np.asarray(fixes.time), np.asarray(fixes.v_n)
    lat, lon, height = (np.asarray(x) for x in (fixes.lat, fixes.lon, fixes.height))
    swapped = v[:, [1, 0, 2]]
    tries = [
        ("its components seem exchanged (north, east read as east, north?)", lat, lon, swapped),
        ("its sign seems turned (south, west read as north, east?)", lat, lon, -v),
        ("latitude and longitude seem exchanged", lon, lat, v),
        ("latitude and longitude seem to be in rad, read as deg", lat / DEG, lon / DEG, v),
        ("latitude and longitude seem to be in deg, read as rad", lat * DEG, lon * DEG, v),
        ("the velocity seems to be in km/h, read as m/s", lat, lon, v / 3.6),
    ]  # fmt: skip
    best, cause = _BETTER * spread, "are latitude and longitude, their units and the axes right?"
    for text, north, east, velocity in tries:
        if np.max(np.abs(north)) > 0.5 * np.pi or np.max(np.abs(east)) > 2.0 * np.pi:
            continue
        meridian, transverse = radii(north)
        turn = (east - east[0] + np.pi) % (2.0 * np.pi) - np.pi
        place = np.column_stack([
            turn * (transverse + height) * np.cos(north), (north - north[0]) * (meridian + height),
            height - height[0],
        ])  # fmt: skip
        off = _Pairs.of(time, place, velocity).difference()
        left = float(np.median(np.linalg.norm(off[:, :2], axis=1)))
        if left < best:
            best, cause = left, text
    return cause
