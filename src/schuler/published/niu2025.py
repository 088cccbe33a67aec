"""GNSS outages of a minute on a car with a tactical instrument (Niu and others, 2025)."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.attitude import multiply, quat_to_rotvec
from schuler.constants import DEG
from schuler.earth import Site, radii
from schuler.errors import InputError
from schuler.motion import Manoeuvre, Route
from schuler.navigation import AidedNavigation, AidingOptions, Outages, Start, navigate_aided
from schuler.published.figures import Curve, Figure
from schuler.published.result import (
    Experiment,
    Options,
    Row,
    conditions,
    each_run,
    experiment,
    instrument,
    rms_error,
)
from schuler.simulation import Simulation, simulate
from schuler.trajectory import Trajectory

__all__ = ["drive_of", "run", "worst_errors"]

Array = NDArray[np.float64]

_KEYS = ("level", "height", "space", "heading")
_TEXT = {
    "level": ("largest level error of an outage, rms", "m"),
    "height": ("largest height error of an outage, rms", "m"),
    "space": ("largest error of an outage in three dimensions, rms", "m"),
    "heading": ("largest heading error of an outage, rms", "deg"),
}


def drive_of(case: dict[str, Any]) -> Route:
    """Return the route: legs of speed, turn and slope until the record ends."""
    drive, legs = case["drive"], []
    total = 0.0
    for speed, turn in cycle(zip(drive["speeds"], drive["turns"], strict=True)):
        legs += [
            Manoeuvre(12.0, speed=speed), Manoeuvre(8.0, turn=turn),
            Manoeuvre(8.0, climb=drive["slope"]), Manoeuvre(6.0, climb=-drive["slope"]),
        ]  # fmt: skip
        total += 34.0
        if total >= case["simulation"]["duration"]:
            break
    return Route(tuple(legs), heading=drive["heading"], speed=drive["speed"])


def fixes_of(made: Simulation, case: dict[str, Any], rng: np.random.Generator) -> GnssFixes:
    """Return fixes of the true positions with white noise."""
    truth, rate, sigma = made.truth, case["gnss"]["rate"], case["gnss"]["sigma"]
    time = np.arange(1.0, case["simulation"]["duration"], 1.0 / rate)
    k = np.searchsorted(truth.time, time - 1e-6)
    off = sigma * rng.standard_normal((len(time), 3))
    lat, height = truth.lat[k], truth.height[k]
    meridian, transverse = radii(lat)
    east = (transverse + height) * np.cos(lat)
    return GnssFixes(
        truth.time[k], lat + off[:, 1] / (meridian + height), truth.lon[k] + off[:, 0] / east,
        height + off[:, 2], sigma,
    )  # fmt: skip


def worst_errors(path: Trajectory, truth: Trajectory, spans: Array) -> tuple[Array, Array]:
    """Return the largest errors in each span, (k, 4) level, height, space (m), heading (deg).

    Its largest sigma of the same, as the path's variances say, comes second.

    Parameters
    ----------
    path, truth : Trajectory
        With attitude; rows of the path are rows of the truth.
    spans : (k, 2) float64
    """
    found, stated = [], []
    for first, last in spans:
        rows = (path.time > first) & (path.time <= last)
        k = np.searchsorted(truth.time, path.time[rows] - 1e-6)
        meridian, transverse = radii(truth.lat[k])
        east = (path.lon[rows] - truth.lon[k]) * transverse * np.cos(truth.lat[k])
        north = (path.lat[rows] - truth.lat[k]) * meridian
        up = path.height[rows] - truth.height[k]
        back = truth.known("quat_nb")[k] * [1.0, -1.0, -1.0, -1.0]
        turn = quat_to_rotvec(multiply(path.known("quat_nb")[rows], back))[:, 2] / DEG
        found.append([
            np.hypot(east, north).max(), np.abs(up).max(),
            np.sqrt(east**2 + north**2 + up**2).max(), np.abs(turn).max(),
        ])  # fmt: skip
        p = path.known("variances")[rows]
        stated.append([
            np.sqrt(p[:, 6:8].sum(axis=1).max()), np.sqrt(p[:, 8].max()),
            np.sqrt(p[:, 6:9].sum(axis=1).max()), np.sqrt(p[:, 2].max()) / DEG,
        ])  # fmt: skip
    return np.array(found), np.array(stated)


def _navigated(
    made: Simulation, fixes: GnssFixes, case: dict[str, Any], shift: float, scale: bool
) -> tuple[AidedNavigation, Array]:
    """Return a navigation with its outages, and their spans."""
    out, told, truth = case["outages"], case["start"], made.truth
    spec = instrument(case, "niu2025")
    k = int(np.searchsorted(truth.time, float(np.asarray(fixes.time)[0]) - 1e-6))
    tilt, heading = told["tilt_deg"] * DEG, told["heading_deg"] * DEG
    covariance = np.zeros((15, 15))
    covariance[:3, :3] = np.diag([tilt**2, tilt**2, heading**2])
    site = Site(case["site"]["lat"], case["site"]["lon"], case["site"]["height"])
    start = Start(site, truth.known("quat_nb")[k], v_n=truth.known("v_n")[k], covariance=covariance)
    outages = Outages(out["length"], out["period"], shift, out["settle"])
    found = navigate_aided(
        made.record, fixes, start=start, spec=spec, outages=outages,
        options=AidingOptions(scale=scale, smooth=scale, vibration=1e-6),
    )  # fmt: skip
    return found, outages.spans(float(truth.time[k]), float(np.asarray(fixes.time)[-1]))


def _drive(k: int, seed: int, changes: tuple[tuple[str, Any], ...]) -> dict[str, Array]:
    """Return the worst errors of all outages of one drive."""
    case = conditions("niu2025", changes)
    rng = np.random.default_rng([seed, 2025, k])
    site = Site(case["site"]["lat"], case["site"]["lon"], case["site"]["height"])
    settings = case["simulation"]
    made = simulate(
        drive_of(case), site, settings["duration"], settings["rate"],
        instrument(case, "niu2025"), rng,
    )  # fmt: skip
    fixes = fixes_of(made, case, rng)
    keys = ("forward", "sigma", "smoothed", "smoothed_sigma", "fifteen")
    out: dict[str, list[Any]] = {key: [] for key in keys}
    for shift in case["outages"]["shifts"]:
        found, spans = _navigated(made, fixes, case, shift, scale=True)
        errors, sigma = worst_errors(found.forward, made.truth, spans)
        out["forward"].append(errors)
        out["sigma"].append(sigma)
        errors, sigma = worst_errors(found.path, made.truth, spans)
        out["smoothed"].append(errors)
        out["smoothed_sigma"].append(sigma)
        plain, _ = _navigated(made, fixes, case, shift, scale=False)
        out["fifteen"].append(worst_errors(plain.forward, made.truth, spans)[0])
    return {key: np.concatenate(value) for key, value in out.items()}


def run(options: Options) -> Experiment:
    """Redo the outages, each run a drive of its own.

    Parameters
    ----------
    options : Options

    Raises
    ------
    InputError
        For a record without an outage.
    """
    case = conditions("niu2025", options.changes)
    if len(case["drive"]["speeds"]) != len(case["drive"]["turns"]):
        raise InputError("niu2025: drive.speeds and drive.turns must have one value for each leg")
    settle = case["outages"]["settle"] + max(case["outages"]["shifts"])
    if case["simulation"]["duration"] < settle + case["outages"]["length"] + 10.0:
        raise InputError(
            "niu2025: simulation.duration must be longer than outages.settle, the largest shift "
            "and one outage together"
        )
    runs = options.runs or case["runs"]
    jobs = [(k, options.seed, options.changes) for k in range(runs)]
    done = list(each_run(_drive, jobs, options))
    found = {key: np.concatenate([part[key] for part in done]) for key in done[0]}
    rows = []
    for i, key in enumerate(_KEYS):
        text, unit = _TEXT[key]
        forward, error = rms_error(found["forward"][:, i])
        smooth, spread = rms_error(found["smoothed"][:, i])
        fifteen, _ = rms_error(found["fifteen"][:, i])
        bound, below = (
            float(np.sqrt(np.mean(found[name][:, i] ** 2))) for name in ("sigma", "smoothed_sigma")
        )
        outages = f"{len(found['forward'])} outages"
        rows += [
            Row(text, unit, case["printed"][key], forward, None, bound,
                f"± {error:.2g}, {outages}"),
            Row(f"{text}, 15 states", unit, None, fifteen, forward, bound,
                "best: with the six scale factors"),
            Row(f"{text}, smoothed", unit, None, None, smooth, below,
                f"± {spread:.2g}, {outages}"),
        ]  # fmt: skip
    figure = Figure(
        "Largest level errors of the outages, in their order of size",
        "share of the outages, %", "level error, m",
        tuple(
            Curve(name, 100.0 * (np.arange(len(values)) + 0.5) / len(values), np.sort(values))
            for name, values in (
                ("21 states", found["forward"][:, 0]), ("15 states", found["fifteen"][:, 0]),
                ("21 states, smoothed", found["smoothed"][:, 0]),
            )
        ), log_y=True,
    )  # fmt: skip
    return experiment(case, "niu2025", options, runs, rows, (figure,))
