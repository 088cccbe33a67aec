"""Does each condition of a published experiment that can be set act on its figures?

``python -m tests.published.conditions_check`` (make validate) runs every experiment twice over with
each of its conditions changed, and ends with exit code 1 where one changes nothing or fails.
"""

from __future__ import annotations

import sys
from typing import Any

from schuler import published
from schuler.errors import SchulerError

#: other values, each in its own document's units
CHANGED: dict[str, dict[str, Any]] = {
    "guo2015": {
        "best_runs": 2, "gate_runs": 2, "simulation.step": 0.2, "simulation.short": 80.0,
        "simulation.long": 600.0, "gate.lat": 50.0, "gate.grade": "navigation-rlg",
        "gate.duration": 60.0, "gate.rate": 50.0, "gate.estimator": "wahba", "gate.cutoff": 0.1,
        "gate.width": 0.001, "gate.crew.moving_mm": 5.0, "gate.crew.moving_deg": 0.05,
        "gate.crew.boarding_per_minute": 0.5, "gate.crew.slams_per_minute": 0.0, "site.lat": 50.0,
        "site.euler_deg": [10.0, 1.0, 2.0],
    },
    "fang2006": {
        "site.lat": 50.0, "simulation.rate": 10.0, "simulation.dwell": 100.0,
        "filter.velocity_noise": 0.01, "filter.step": 2.0, "filter.velocity": 0.1,
        "filter.tilt_arcsec": 20.0, "filter.azimuth_arcmin": 60.0, "filter.wide_tilt_deg": 0.5,
        "filter.wide_azimuth_deg": 5.0, "filter.accelerometer_ug": 50.0, "filter.gyro_deg_h": 0.05,
        "gyro.bias": "0.05 deg/h", "gyro.angle_random_walk": "0.005 deg/sqrt(h)",
        "accelerometer.bias": "50 ug", "accelerometer.velocity_random_walk": "50 ug/sqrt(Hz)",
    },
    "yu_emd": {
        "site.lat": -50.0, "simulation.grade": "navigation-rlg", "simulation.duration": 200.0,
        "simulation.rate": 50.0, "simulation.ends": [120.0, 300.0], "simulation.curve_from": 100.0,
        "simulation.settled_arcmin": 20.0, "filter.stop": 0.3, "filter.rank": 10, "filter.order": 3,
        "filter.lowpass": 0.2, "filter.step": 2.0, "gyro.bias": "0.1 deg/h",
        "gyro.angle_random_walk": "0.01 deg/sqrt(h)", "accelerometer.bias": "100 ug",
        "accelerometer.velocity_random_walk": "50 ug/sqrt(Hz)",
    },
    "du2016": {
        "array.names": ["cone5"], "array.life_h": 1000.0, "headings.psi": [45.0, 10.0],
        "headings.places": [[20.0, 45.0]], "headings.all_psi_step": 15.0,
        "one_way.latitudes": [10.0], "simulation.duration": "4 h", "simulation.array": "cone4",
        "site.lat": 30.0,
        "errors.gyro_bias": ["0.01 deg/h", "0.0015 deg/h", "0.002 deg/h", "0.003 deg/h"],
        "errors.gyro_scale": "10 ppm", "errors.accel_bias": "60 ug",
        "single_axis.scheme": "reciprocating-from-end", "single_axis.rate": "4 deg/s",
        "two_axis.scheme": "two-axis-8", "two_axis.rate": "5 deg/s", "two_axis.dwell": "40 s",
    },
    "xu2017": {
        "simulation.order": "zyx", "simulation.dwell": 50.0, "simulation.passes": 2,
        "search.rounds": 2, "search.seed": 2, "plant.force": 20.0, "plant.rate": 90.0,
        "plant.latitude": 60.0, "plant.noise": 20.0, "plant.sampling": 100.0,
        "plant.attitude_prior": 1e-5,
    },
    "niu2025": {
        "site.lat": 50.0, "site.height": 500.0, "simulation.rate": 50.0,
        "simulation.duration": 900.0, "gnss.sigma": 0.05, "gnss.rate": 2.0, "outages.length": 30.0,
        "outages.period": 120.0, "outages.shifts": [0.0], "outages.settle": 200.0,
        "start.tilt_deg": 1.0, "start.heading_deg": 5.0, "gyro.bias": "0.1 deg/h",
        "gyro.angle_random_walk": "0.01 deg/sqrt(h)", "gyro.scale_factor": "100 ppm",
        "accelerometer.bias": "30 mGal", "accelerometer.velocity_random_walk": "0.1 m/s/sqrt(h)",
        "accelerometer.scale_factor": "100 ppm", "drive.speed": 8.0, "drive.heading": 0.0,
        "drive.speeds": [3.0, -3.0], "drive.turns": [90.0, -90.0], "drive.slope": 2.0,
    },
}  # fmt: skip
#: what has to be set with another condition
TOGETHER: dict[tuple[str, str], dict[str, Any]] = {
    ("yu_emd", "simulation.duration"): {"simulation.ends": [100.0, 150.0, 200.0]},
    ("niu2025", "drive.speeds"): {"drive.turns": [90.0, -60.0]},
    ("niu2025", "drive.turns"): {"drive.speeds": [3.0, -5.0]},
}
RUNS = 3


def figures(name: str, changes: dict[str, Any]) -> list[Any]:
    """Return all figures of an experiment, without those that are times of this machine."""
    found = published.run(name, runs=RUNS, workers=1, changes=changes)
    return [
        (row.quantity, row.document_method, row.best, row.limit) for row in found.rows
        if not row.quantity.startswith("time of the filter")
    ]  # fmt: skip


def main() -> None:
    """Run all, and say what changes nothing."""
    bad = []
    for name in published.EXPERIMENTS:
        left = set(published.changeable(name)) - set(CHANGED[name])
        bad += [f"{name} {key}: has no other value here" for key in sorted(left)]
        plain = figures(name, {})
        for key, value in CHANGED[name].items():
            more = TOGETHER.get((name, key), {})
            before = figures(name, more) if more and key != "simulation.duration" else plain
            try:
                same = figures(name, {**more, key: value}) == before
            except SchulerError as error:
                bad.append(f"{name} {key} = {value}: {error}")
                continue
            print(f"{name} {key} = {value}: {'changes nothing' if same else 'acts'}", flush=True)
            if same:
                bad.append(f"{name} {key} = {value}: changes nothing")
    print("\n".join(bad) or "every condition acts")
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
