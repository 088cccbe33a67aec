"""Aided navigation of a car, 100 Hz and four fixes a second, beside pyins' feedback filter.

The same two minutes, instrument, fixes and start; pyins predicts its covariance each 0.25 s, which
is its largest useful step here, and schuler each 0.1 s. Processor time of one process, the two in
turn. The hour is schuler's alone: at pyins' speed it takes six minutes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.aiding import GnssFixes
from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.earth import Site, radii
from schuler.motion import Manoeuvre, Route
from schuler.navigation import AidingOptions, Start, navigate_aided
from schuler.sensors import GRADES
from schuler.simulation import Simulation, simulate

SITE, SPEC = Site(40.0, 10.0, 100.0), GRADES["tactical-fog"]
RATE, REPEATS = 100.0, 3
OPTIONS = AidingOptions(vibration=1e-6)


def drive(duration: float) -> tuple[Simulation, GnssFixes]:
    """Return a simulated car and its fixes."""
    legs: list[Manoeuvre] = []
    for speed, turn in zip((3, -5, 4, -3, 1), (90, -60, 90, 30, -90), strict=True):
        legs += [Manoeuvre(12.0, speed=speed), Manoeuvre(8.0, turn=turn), Manoeuvre(14.0)]
    route = Route(tuple(legs * int(duration / 170.0 + 1.0)), heading=40.0, speed=12.0)
    rng = np.random.default_rng(1)
    made = simulate(route, SITE, duration, RATE, SPEC, rng)
    truth = made.truth
    k = np.arange(round(RATE), len(truth.time), round(RATE / 4.0))
    off = 3.0 * rng.standard_normal((len(k), 3))
    lat = truth.lat[k]
    meridian, transverse = radii(lat)
    v_n = truth.known("v_n")[k] + 0.1 * rng.standard_normal((len(k), 3))
    return made, GnssFixes(
        truth.time[k], lat + off[:, 1] / meridian,
        truth.lon[k] + off[:, 0] / (transverse * np.cos(lat)), truth.height[k] + off[:, 2],
        3.0, v_n, 0.1,
    )  # fmt: skip


def pyins_job(made: Simulation, gnss: GnssFixes) -> Callable[[], Any] | None:
    """Return pyins' feedback filter as a job; None where it is not installed."""
    try:
        import pandas as pd
        from pyins import filters, inertial_sensor, measurements, strapdown
    except ImportError:
        return None
    r, truth = made.record, made.truth
    begin = round(RATE)
    rows = [x[begin:, [1, 0, 2]] * [1, 1, -1] for x in (r.dtheta, r.dvel)]
    imu = pd.DataFrame(
        np.vstack([np.zeros((1, 6)), np.hstack(rows)]),
        index=np.concatenate([[r.time[begin - 1]], r.time[begin:]]),
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    psi, theta, gamma = quat_to_euler(truth.known("quat_nb")[begin])
    east, north, up = truth.known("v_n")[begin]
    pva = pd.Series(
        [truth.lat[begin] / DEG, truth.lon[begin] / DEG, truth.height[begin], north, east, -up,
         gamma / DEG, theta / DEG, psi_to_heading(psi) / DEG],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=r.time[begin - 1],
    )  # fmt: skip
    time_, v_n = np.asarray(gnss.time)[1:], np.asarray(gnss.v_n)[1:]
    place = pd.DataFrame(
        {"lat": np.asarray(gnss.lat)[1:] / DEG, "lon": np.asarray(gnss.lon)[1:] / DEG,
         "alt": np.asarray(gnss.height)[1:]}, index=time_,
    )  # fmt: skip
    speed = pd.DataFrame({"VN": v_n[:, 1], "VE": v_n[:, 0], "VD": -v_n[:, 2]}, index=time_)
    gyro = inertial_sensor.EstimationModel(SPEC.gyro.bias, SPEC.gyro.white)
    accel = inertial_sensor.EstimationModel(SPEC.accelerometer.bias, SPEC.accelerometer.white)

    def job() -> Any:
        increments = strapdown.compute_increments_from_imu(imu, "increment")
        return filters.run_feedback_filter(
            pva, 5.0, 0.5, 1.0, 5.0, increments, gyro, accel,
            measurements=[measurements.Position(place, 3.0), measurements.NedVelocity(speed, 0.1)],
            time_step=0.25,
        )  # fmt: skip

    return job


def processor(job: Callable[[], Any]) -> float:
    """Return the processor time of a job, s."""
    begin = time.process_time()
    job()
    return time.process_time() - begin


def run() -> list[dict[str, Any]]:
    """Time both filters, the smoother, and an hour."""
    made, gnss = drive(120.0)
    begin = round(RATE)
    start = Start(SITE, made.truth.known("quat_nb")[begin], v_n=made.truth.known("v_n")[begin])

    def ours(options: AidingOptions) -> Callable[[], Any]:
        return lambda: navigate_aided(made.record, gnss, start=start, spec=SPEC, options=options)

    peer = pyins_job(made, gnss)
    scaled = AidingOptions(vibration=1e-6, scale=True)
    jobs = [ours(OPTIONS), ours(scaled), *([peer] if peer is not None else [])]
    for job in jobs[:2]:
        job()
    best = np.min([[processor(job) for job in jobs] for _ in range(REPEATS)], axis=0)
    each = 1e6 / len(made.record)
    rows = [
        {"what": f"aided navigation, {states} states, a sample", "ours": best[k] * each,
         "peer": best[2] * each if peer is not None else None,
         "ratio": best[2] / best[k] if peer is not None else None, "unit": "us"}
        for k, states in ((0, 15), (1, 21))
    ]  # fmt: skip
    hour, fixes = drive(3600.0)

    def whole(smooth: bool) -> float:
        options = AidingOptions(vibration=1e-6, smooth=smooth)
        return min(
            processor(lambda: navigate_aided(hour.record, fixes, spec=SPEC, options=options))
            for _ in range(REPEATS)
        )

    forward, both = whole(smooth=False), whole(smooth=True)
    rows += [
        {"what": "the same over an hour, a sample", "ours": forward * 1e6 / len(hour.record),
         "peer": None, "ratio": None, "unit": "us"},
        {"what": "smoothing of an hour, an epoch", "ours": (both - forward) * 1e6 / len(fixes),
         "peer": None, "ratio": None, "unit": "us"},
    ]  # fmt: skip
    return rows
