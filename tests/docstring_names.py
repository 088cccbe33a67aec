"""What the examples in docstrings find when they run: the names that `docs/api.md` lists."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import schuler as sc
from schuler.aiding import GnssFixes
from schuler.constants import DEG
from schuler.motion import Manoeuvre, Route, Static

SCENE = """duration = "60 s"
rate = "20 Hz"
seed = 1
instrument = "navigation-fog"

[site]
lat = 48.1

[motion]
kind = "vehicle"
heading = 30
shake_mm = 2
"""

ROTATION = """array = "triad"
duration = "1 h"
heading = 0.0
headings = [0.0]
latitudes = [45.0]

[site]
lat = 45.0
lon = 0.0

[errors]
gyro_bias = ["0.01 deg/h", "0.01 deg/h", "0.01 deg/h"]

[single_axis]
scheme = "four-position"

[two_axis]
scheme = "two-axis-16"
"""


@cache
def _made() -> dict[str, Any]:
    site, spec = sc.Site(48.1, 11.6, 500.0), sc.load_spec("navigation-fog")
    rng = np.random.default_rng(1)
    made = sc.simulate(Static(30.0), site, 60.0, 20.0, spec, rng)
    legs = [Manoeuvre(10.0), Manoeuvre(8.0, speed=5.0), Manoeuvre(8.0, turn=90.0)]
    drove = sc.simulate(Route(legs, heading=30.0, speed=10.0), site, 60.0, 20.0, spec, rng)
    truth = drove.truth
    rows = slice(20, -1, 20)
    gnss = GnssFixes(
        truth.time[rows], truth.lat[rows], truth.lon[rows], truth.height[rows], 3.0,
        truth.v_n[rows] + 0.1 * rng.standard_normal(truth.v_n[rows].shape), 0.1,
    )  # fmt: skip
    return {
        "np": np, "sc": sc, "site": site, "spec": spec, "made": made, "record": made.record,
        "fix": sc.align(made.record, site, spec=spec),
        "noise_fit": sc.fit_noise(sc.allan(made.record)),
        "drive": drove.record, "driven": truth, "gnss": gnss,
        "aided": sc.navigate(drove.record, aiding=[gnss], spec=spec, smooth=True),
    }  # fmt: skip


def namespace() -> dict[str, Any]:
    """Return the names, and write the files that examples read into the working folder."""
    names = dict(_made())
    truth, gnss = names["driven"], names["gnss"]
    sc.write(names["record"], "imu.csv")
    sc.write(names["drive"], "drive.csv")
    table = [gnss.time, gnss.lat / DEG, gnss.lon / DEG, gnss.height, gnss.v_n]
    np.savetxt("gnss.csv", np.column_stack(table), "%.10g", ",", comments="",
               header="time,lat,lon,height,ve,vn,vu")  # fmt: skip
    speed = np.linalg.norm(truth.v_n[::20], axis=1)
    np.savetxt("speed.csv", np.column_stack([truth.time[::20], speed]), "%.10g", ",", comments="",
               header="time,speed")  # fmt: skip
    path = sc.Trajectory(truth.time[::20], truth.lat[::20], truth.lon[::20], truth.height[::20])
    sc.write_trajectory(path, "path.csv")
    with open("truck.toml", "w", encoding="utf-8") as file:
        file.write(SCENE)
    with open("rotation.toml", "w", encoding="utf-8") as file:
        file.write(ROTATION)
    return names
