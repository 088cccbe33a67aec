"""One check of what a record shows, shared by all commands: units by gravity and Earth rate, axes.

It takes sums over the record (`Summary`) and how its values were read (`Reading`), and says what
gravity and the Earth's rate contradict. It never changes a value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE, STANDARD_GRAVITY
from schuler.units import UNITS

if TYPE_CHECKING:
    from schuler.earth import Site
    from schuler.record.summary import Summary

__all__ = ["Reading", "axis_hint", "check_record", "force_hint", "rate_hint"]


_RATES = ("rad/s", "deg/s", "deg/h", "mrad/s", "arcsec/s")
_FORCES = ("m/s^2", "g", "mg", "ug")
_ANGLES = ("rad", "deg", "mrad", "arcsec")
_VELOCITIES = ("m/s", "g*s", "mg*s", "ug*s")


@dataclass(frozen=True)
class Reading:
    """How values were read: what is known of them limits what a hint may say.

    Parameters
    ----------
    kind : str
        As for `Intake`; ``"unknown"`` for a record made in memory.
    gyro_unit, accel_unit : str or None
        Units as they were read; None where they have a scale of their own.
    fixed : bool
        The file's format fixes units, so that no other can be meant.
    axes_said : bool
        Somebody said where the axes point.
    units_said : bool
        Somebody said the units, or they are not those of a file.

    Examples
    --------
    >>> Reading(kind="rates", gyro_unit="deg/s", accel_unit="m/s^2").kind
    'rates'
    """

    kind: str = "unknown"
    gyro_unit: str | None = None
    accel_unit: str | None = None
    fixed: bool = False
    axes_said: bool = False
    units_said: bool = True


def _candidates(
    interval: float, reading: Reading, unit: str | None, rates: tuple[str, ...],
    increments: tuple[str, ...],
) -> list[tuple[str, float]]:  # fmt: skip
    """Return (what to say, factor by which the SI reading would change)."""
    if reading.fixed:
        return []
    found = []
    units = increments if reading.kind == "increments" else rates
    current = UNITS[unit][0] if unit in UNITS else 1.0
    if unit is not None or reading.kind == "unknown":
        found = [(f"in {u}", UNITS[u][0] / current) for u in units if u != (unit or units[0])]
    if reading.kind != "increments":
        found.append(("increments over each interval, not rates", 1.0 / interval))
    if reading.kind in ("increments", "unknown"):
        found.append(("rates, not increments over each interval", interval))
    return found


def _fitting(ratio: float, candidates: list[tuple[str, float]], tolerance: float) -> str | None:
    """Return the reading that brings a ratio (shown to expected) nearest to one."""
    best = min(candidates, key=lambda c: abs(math.log(ratio * c[1])), default=None)
    if best is None or abs(math.log(ratio * best[1])) >= tolerance:
        return None
    return best[0]


def force_hint(
    mean_force: float, gravity: float, interval: float, reading: Reading | None = None,
    small: bool = True,
) -> str | None:  # fmt: skip
    """Return a sentence when a standing record's mean |f| is not gravity, else None.

    Parameters
    ----------
    mean_force, gravity : float
        m/s^2.
    interval : float
        Sampling interval, s.
    reading : Reading, optional
        How the values were read.
    small : bool
        Say differences below 10 % as well, which only a vehicle at rest cannot have.
    """
    reading = reading or Reading()
    if not (mean_force > 0 and math.isfinite(mean_force)):
        return "the accelerometers read nothing: their mean |f| is zero; check their columns"
    ratio = mean_force / gravity
    if abs(ratio - 1.0) < (0.005 if small else 0.1):
        return None
    text = f"the mean |f| is {mean_force:.5g} m/s^2, where gravity is {gravity:.5g} m/s^2"
    if abs(ratio - 1.0) < 0.1:
        return (
            f"{text}: {100 * (ratio - 1.0):+.2f} %; check the accelerometers' scale, the height, "
            "or whether the vehicle accelerates"
        )
    if reading.kind == "increments":
        for share, said in ((0.5, "half"), (2.0, "twice")):
            if abs(ratio / share - 1.0) < 0.01:
                return (
                    f"{text}: {said} of it, so a row's increments cover {said} the time to the row "
                    "before: rows are missing or doubled, or the rate (--rate) is another"
                )
    candidates = _candidates(interval, reading, reading.accel_unit, _FORCES, _VELOCITIES)
    fit = _fitting(ratio, candidates, 0.1)
    if fit:
        both = "" if reading.units_said else " (both units were assumed: say --gyro and --accel)"
        return f"{text}; it would fit if the accelerometer values were {fit}{both}"
    if reading.fixed:
        return (
            f"{text}, and the format fixes the unit: check the instrument's scale, and whether the "
            "vehicle accelerates"
        )
    return f"{text}; no usual unit fits: check the accelerometer columns and their unit"


def rate_hint(
    mean_rate: float, interval: float, bias: float = 0.0, noise: float = 0.0,
    reading: Reading | None = None,
) -> str | None:  # fmt: skip
    """Return a sentence when a standing record's mean |w| is not the Earth's rate, else None.

    Parameters
    ----------
    mean_rate : float
        |mean of w|, rad/s: sway averages out of it.
    interval : float
        Sampling interval, s.
    bias, noise : float
        What the instrument and the sway may add (1-sigma, rad/s).
    reading : Reading, optional
        How the values were read.
    """
    reading = reading or Reading()
    if mean_rate == 0.0:
        return "the gyros read nothing: their mean |w| is zero; check their columns"
    ratio = mean_rate / EARTH_RATE
    if abs(mean_rate - EARTH_RATE) < max(0.1 * EARTH_RATE, 4.0 * math.hypot(bias, noise)):
        return None
    shown = f"{mean_rate / DEG_PER_HOUR:.5g} deg/h"
    text = f"the mean |w| is {shown}, where the Earth turns at 15.04 deg/h"
    fit = _fitting(ratio, _candidates(interval, reading, reading.gyro_unit, _RATES, _ANGLES), 0.1)
    if fit:
        return f"{text}; it would fit if the gyro values were {fit}"
    unit = "columns are wrong" if reading.fixed else "unit or columns are wrong"
    return (
        f"{text}; the gyros have a bias of that size (see --spec), or the vehicle turned, or {unit}"
    )


def axis_hint(mean_force: tuple[float, float, float], gravity: float) -> str | None:
    """Return a sentence when the force does not point along +z as on a level RFU body."""
    x, y, z = (v / gravity for v in mean_force)
    if z > 0.7 or x * x + y * y + z * z < 0.5:
        return None
    if z < -0.7:
        return (
            "the force points along -z, down in right-front-up axes: the body lies on its back, or "
            "--axes is not what the file has (FRD for front-right-down)"
        )
    axis, value = ("x", x) if abs(x) > abs(y) else ("y", y)
    sign = "+" if value > 0 else "-"
    if abs(value) > 0.7:
        return (
            f"the force points along {sign}{axis}: the body lies on its side, or the axes are "
            "not right-front-up; name them with --axes"
        )
    return "the body is tilted by more than 45 deg, or the axes are not right-front-up (--axes)"


def check_record(
    summary: Summary, reading: Reading | None = None, site: Site | None = None, *,
    gyro_bias: float = 0.0, at_rest: bool = True,
) -> list[str]:  # fmt: skip
    """Return what looks wrong with the units and axes of a record, in sentences.

    Parameters
    ----------
    summary : Summary
    reading : Reading, optional
        How the values were read; without it, any unit may be meant.
    site : Site, optional
        For local gravity and the latitude; standard gravity without it.
    gyro_bias : float
        Bias that the instrument may have (1-sigma, rad/s).
    at_rest : bool
        The vehicle is meant to be at rest. Else only what no motion explains is said: over a
        record, the mean |f| of a vehicle is gravity within a tenth.

    Examples
    --------
    >>> check_record(fix.summary, site=site)
    []
    """
    gravity = STANDARD_GRAVITY if site is None else site.gravity
    force = summary.steady_force(gravity)
    if not at_rest or summary.turned:
        found = force_hint(force, gravity, summary.interval, reading, small=False)
        return [found] if found else []
    spread = summary.wander_rate / np.sqrt(max(summary.duration, 1.0))
    # A swing of a fraction of a degree between the two ends is no unit error.
    spread = float(np.hypot(spread, 0.2 * DEG / max(summary.duration, 1.0)))
    size = float(np.linalg.norm(summary.mean_rate))
    hints = [
        force_hint(force, gravity, summary.interval, reading),
        rate_hint(size, summary.interval, gyro_bias, spread, reading),
    ]
    if hints[0] is None:
        x, y, z = (float(v) for v in summary.mean_force)
        hints.append(axis_hint((x, y, z), gravity))
    if site is not None and hints[0] is None and hints[1] is None:
        hints.append(_latitude_hint(summary, site, gyro_bias, spread))
    return [text for text in hints if text]


def _latitude_hint(summary: Summary, site: Site, gyro_bias: float, spread: float) -> str | None:
    w, f = summary.mean_rate, summary.mean_force
    size = float(np.linalg.norm(w))
    sine = float(w @ f) / (size * float(np.linalg.norm(f)))
    own = float(np.arcsin(np.clip(sine, -1.0, 1.0))) / DEG
    # Near a pole the arc sine is steep: compare sines, in units of what they can be off.
    off = abs(sine - np.sin(site.latitude))
    if off < max(0.15, 4.0 * np.hypot(gyro_bias, spread) / size):
        return None
    advice = (
        "is the sign of the latitude right?"
        if abs(sine + np.sin(site.latitude)) < 0.15
        else "do the gyros and the accelerometers share their axes (--axes, --columns)?"
    )
    return (
        f"the angle between the mean rate and the mean force says latitude {own:.1f} deg, "
        f"not {site.lat:.1f} deg: {advice}"
    )
