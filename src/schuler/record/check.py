"""One check of what a record shows, shared by all commands: units by gravity and Earth rate, axes.

It takes sums over the record (`Summary`) and how its values were read (`Reading`), and says what
gravity and the Earth's rate contradict. It never changes a value.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from schuler.constants import DEG, STANDARD_GRAVITY
from schuler.record.hints import Reading, axis_hint, force_hint, rate_hint

if TYPE_CHECKING:
    from schuler.earth import Site
    from schuler.record.summary import Summary

__all__ = ["check_record"]


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
