"""Plain-language hints: which unit or which axes would fit what the record shows."""

from __future__ import annotations

import math

from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE, STANDARD_GRAVITY

__all__ = ["axis_hint", "force_hint", "rate_hint"]


def _candidates(interval: float, unit: float, names: dict[str, float]) -> list[tuple[str, float]]:
    """Return (what to say, factor by which the SI reading would change)."""
    found = [(f"in {name}", factor / unit) for name, factor in names.items()]
    found.append(("increments over each interval, not rates", 1.0 / interval))
    found.append(("rates, not increments over each interval", interval))
    return found


def _fitting(ratio: float, candidates: list[tuple[str, float]], tolerance: float) -> str | None:
    """Return the reading that brings a ratio (shown to expected) nearest to one."""
    best = min(candidates, key=lambda c: abs(math.log(ratio * c[1])))
    return best[0] if abs(math.log(ratio * best[1])) < tolerance else None


def force_hint(mean_force: float, gravity: float, interval: float) -> str | None:
    """Return a sentence when a standing record's mean |f| is not gravity, else None.

    Parameters
    ----------
    mean_force, gravity : float
        m/s^2.
    interval : float
        Sampling interval, s.
    """
    if not (mean_force > 0 and math.isfinite(mean_force)):
        return "the accelerometers read nothing: their mean |f| is zero; check their columns"
    ratio = mean_force / gravity
    if abs(ratio - 1.0) < 0.005:
        return None
    text = f"the mean |f| is {mean_force:.5g} m/s^2, where gravity is {gravity:.5g} m/s^2"
    if abs(ratio - 1.0) < 0.1:
        return (
            f"{text}: {100 * (ratio - 1.0):+.2f} %; check the accelerometers' scale, the height, "
            "or whether the vehicle accelerates"
        )
    names = {"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY}
    fit = _fitting(ratio, _candidates(interval, 1.0, names), 0.1)
    return f"{text}; " + (
        f"it would fit if the accelerometer values were {fit}"
        if fit
        else "no usual unit fits: check the accelerometer columns and their unit"
    )


def rate_hint(
    mean_rate: float, interval: float, bias: float = 0.0, noise: float = 0.0
) -> str | None:
    """Return a sentence when a standing record's mean |w| is not the Earth's rate, else None.

    Parameters
    ----------
    mean_rate : float
        |mean of w|, rad/s: sway averages out of it.
    interval : float
        Sampling interval, s.
    bias, noise : float
        What the instrument and the sway may add (1-sigma, rad/s).
    """
    if mean_rate == 0.0:
        return "the gyros read nothing: their mean |w| is zero; check their columns"
    ratio = mean_rate / EARTH_RATE
    if abs(mean_rate - EARTH_RATE) < max(0.1 * EARTH_RATE, 4.0 * math.hypot(bias, noise)):
        return None
    shown = f"{mean_rate / DEG_PER_HOUR:.5g} deg/h"
    text = f"the mean |w| is {shown}, where the Earth turns at 15.04 deg/h"
    names = {"deg/s": DEG, "deg/h": DEG_PER_HOUR, "mrad/s": 1e-3, "arcsec/s": DEG / 3600.0}
    fit = _fitting(ratio, _candidates(interval, 1.0, names), 0.1)
    if fit:
        return f"{text}; it would fit if the gyro values were {fit}"
    return (
        f"{text}; the gyros have a bias of that size (see --spec), or the vehicle turned, "
        "or unit or columns are wrong"
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
