"""What ``schuler info`` says of a file of fixes, speeds, heights, headings or velocities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler import __version__
from schuler.cli.command import echo, wants_text
from schuler.cli.common import emit_json, say_warnings
from schuler.units import time_text

if TYPE_CHECKING:
    from schuler.aiding import GnssFixes

__all__ = ["aid_info"]

_QUALITY = {
    "1": "fixed", "2": "float", "3": "SBAS", "4": "differential", "5": "single", "6": "precise",
}  # fmt: skip


def aid_info(path: str, kind: str, topic: str | None, json_to: str | None) -> None:
    """Print what a file of an aid holds, and write it as JSON.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    make = {
        "fixes": _fixes, "speeds": _speeds, "heights": _heights, "headings": _headings,
        "body-velocities": _body_velocities,
    }[kind]  # fmt: skip
    data, warnings = make(path, topic)
    data = {
        "schema": "schuler.aid/1", "schuler": __version__, "file": path, "kind": kind, **data,
        "warnings": warnings,
    }  # fmt: skip
    if json_to is not None:
        emit_json(data, json_to)
    if wants_text():
        _print(data)
    say_warnings(warnings)


def _fixes(path: str, topic: str | None) -> tuple[dict[str, Any], list[str]]:
    from schuler.aiding.consistency import consistency
    from schuler.io import read_gnss

    fixes: GnssFixes = read_gnss(path, height="stated", topic=topic)
    told = fixes.describe()
    dropped = told.pop("dropped")
    found = consistency(fixes)
    data = {
        "format": fixes.format, "rows": told.pop("fixes"), **told, "dropped": dropped,
        "consistency": None if found is None else found.to_dict(), "notes": list(fixes.notes),
    }  # fmt: skip
    warnings = fixes.contradictions()
    if fixes.height_above == "geoid":
        warnings.append(
            "the heights are above the geoid and the file does not say where that is: say "
            "--gnss-height where the fixes are used"
        )
    return data, warnings


def _speeds(path: str, topic: str | None) -> tuple[dict[str, Any], list[str]]:
    from schuler.io import read_speed
    from schuler.io.aiding import speed_roles
    from schuler.io.odometer import counts_pulses

    # A file does not say how long a pulse is: its speed is in pulses a second here.
    pulses = counts_pulses(speed_roles(path))
    speed = read_speed(path, topic=topic, pulse_length=1.0 if pulses else None)
    value, time = np.asarray(speed.value), np.asarray(speed.time)
    size = value if value.ndim == 1 else np.linalg.norm(value, axis=1)
    unit, sigma = ("pulses_s", {}) if pulses else ("m_s", {"sigma_m_s": speed.sigma})
    data = {
        "format": "table", "rows": len(speed), **_span(time), "axes": 1 if value.ndim == 1 else 3,
        **sigma, f"mean_{unit}": float(np.mean(size)),
        f"largest_{unit}": float(np.max(np.abs(size))), "dropped": dict(speed.dropped),
        **({"notes": list(speed.notes)} if speed.notes else {}),
    }  # fmt: skip
    return data, []


def _heights(path: str, topic: str | None) -> tuple[dict[str, Any], list[str]]:
    from schuler.io import read_height

    found = read_height(path)
    height = np.asarray(found.height)
    return {
        **_rows(found), "sigma_m": [float(np.median(np.asarray(found.sigma)))],
        "least_m": float(np.min(height)), "largest_m": float(np.max(height)),
    }, []  # fmt: skip


def _headings(path: str, topic: str | None) -> tuple[dict[str, Any], list[str]]:
    from schuler.io import read_heading

    found = read_heading(path)
    turn = np.abs((np.diff(np.asarray(found.heading)) + np.pi) % (2.0 * np.pi) - np.pi)
    return {
        **_rows(found), "sigma_deg": float(np.degrees(np.median(np.asarray(found.sigma)))),
        "largest_step_deg": float(np.degrees(np.max(turn, initial=0.0))),
    }, []  # fmt: skip


def _body_velocities(path: str, topic: str | None) -> tuple[dict[str, Any], list[str]]:
    from schuler.io import read_dvl

    found = read_dvl(path, topic=topic)
    velocity = np.asarray(found.velocity)
    return {
        **_rows(found), "axes": 3, "sigma_m_s": float(np.median(np.asarray(found.sigma))),
        "mean_m_s": float(np.mean(np.linalg.norm(velocity, axis=1))),
        "largest_m_s": float(np.max(np.linalg.norm(velocity, axis=1))),
        "mean_axes_m_s": [float(x) for x in velocity.mean(axis=0)],
    }, []  # fmt: skip


def _rows(found: Any) -> dict[str, Any]:
    """Return what all tables of rows have."""
    return {
        "format": "table" if found.clock == "unstated" else "log", "rows": len(found),
        **_span(np.asarray(found.time)), "clock": found.clock, "epoch": "",
        "dropped": dict(found.dropped),
    }  # fmt: skip


def _span(time: np.ndarray[Any, Any]) -> dict[str, Any]:
    """Return span, rate and gaps of times, as `GnssFixes.describe` has them."""
    step = np.diff(time)
    usual = float(np.median(step)) if len(step) else 0.0
    return {
        "start_s": float(time[0]), "end_s": float(time[-1]),
        "rate_hz": 1.0 / usual if usual else None, "gaps": int(np.sum(step > 2.5 * usual)),
        "longest_gap_s": float(np.max(step, initial=0.0)),
    }  # fmt: skip


def _print(data: Mapping[str, Any]) -> None:
    from schuler.aiding import CLOCKS

    rate = data["rate_hz"]
    rows = [
        ("file", f"{data['file']} ({data['format']})"),
        ("kind", data["kind"]),
        ("rows", f"{data['rows']}, {time_text(data['start_s'])} to {time_text(data['end_s'])} s"),
        ("rate", "one row" if rate is None else f"{rate:.6g} Hz, {data['gaps']} gaps, the longest "
                 f"{data['longest_gap_s']:.4g} s"),
    ]  # fmt: skip
    if "clock" in data:
        epoch = f" ({data['epoch']})" if data["epoch"] else ""
        rows += [("clock", CLOCKS[data["clock"]] + epoch)]
    if "height_above" in data:
        rows += [("heights", _HEIGHTS[data["height_above"]])]
    if "sigma_m" in data:
        said = ", ".join(f"{x:.3g}" for x in data["sigma_m"])
        axes = "; east, north, up" if len(data["sigma_m"]) == 3 else ""
        rows += [("sigma", f"{said} m (median{axes})")]
    if "largest_m" in data:
        rows += [("heights", f"{data['least_m']:.6g} to {data['largest_m']:.6g} m")]
    if "largest_step_deg" in data:
        rows += [
            ("sigma", f"{data['sigma_deg']:.3g} deg (median)"),
            ("steps", f"at most {data['largest_step_deg']:.4g} deg from row to row"),
        ]
    if data.get("quality"):
        parts = (f"{n} {_QUALITY.get(q, q)}" for q, n in data["quality"].items())
        rows += [("quality", ", ".join(parts))]
    if "velocity" in data:
        rows += [("velocity", _agreement(data))]
    if "largest_m_s" in data:
        rows += [
            ("speed", f"{data['axes']} axes, mean {data['mean_m_s']:.4g} m/s, at most "
                      f"{data['largest_m_s']:.4g} m/s, 1-sigma {data['sigma_m_s']:.3g} m/s"),
        ]  # fmt: skip
    if "mean_pulses_s" in data:
        rows += [
            ("pulses", f"{data['mean_pulses_s']:.4g} a second on average, at most "
                       f"{data['largest_pulses_s']:.4g}; navigate --odometer-scale takes the "
                       "metres of one"),
        ]  # fmt: skip
    if "mean_axes_m_s" in data:
        said = ", ".join(f"{x:.4g}" for x in data["mean_axes_m_s"])
        rows += [("mean", f"{said} m/s (as right, forward, up)")]
    for reason, count in data.get("dropped", {}).items():
        rows.append(("left out", f"{count} with {reason}"))
    rows += [("note", note) for note in data.get("notes", ())]
    seen = ""
    for name, text in rows:
        echo(f"{name if name != seen else '':>10}  {text}")
        seen = name


_HEIGHTS = {
    "ellipsoid": "above the ellipsoid", "geoid": "above the geoid (sea level)",
    "unstated": "the file does not say what they are above; taken as above the ellipsoid",
}  # fmt: skip


def _agreement(data: Mapping[str, Any]) -> str:
    if not data["velocity"]:
        return "none"
    found = data["consistency"]
    if found is None:
        return "too few fixes to hold it against the positions"

    def triple(values: Any) -> str:
        return ", ".join(f"{x:.3g}" for x in values)

    text = f"d(position)/dt differs by {triple(found['rms_m_s'])} m/s rms (east, north, up)"
    if found["lag_s"]:
        text += (
            f", by {triple(found['rms_at_lag_m_s'])} with velocities {found['lag_s']:+.3f} s late"
        )
    return text
