"""Align a CSV whose units, axes and clock are not schuler's: say what the columns are.

The file is made here, so that the example runs by itself; replace `path` by your own.
"""

from pathlib import Path

import numpy as np

import schuler as sc
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulation import simulate

path = Path("my_log.csv")
site = sc.Site(lat=48.1, lon=11.6, height=520.0)


def make_log() -> None:
    """Write deg/s and g in front-right-down axes, milliseconds, a temperature in between."""
    rng = np.random.default_rng(2)
    truck = DisturbedVehicle.draw(rng, 200.0, heading=123.0)
    r = simulate(truck, site, 200.0, 100.0, GRADES["navigation-fog"], rng).record
    to_frd = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    gyro = np.degrees(r.gyro @ to_frd.T)
    force = r.accel @ to_frd.T / 9.80665
    warm = np.full(len(r), 31.5)
    np.savetxt(
        path,
        np.column_stack([1e3 * r.time, warm, gyro, force]),
        delimiter=";",
        header="stamp;temp;wx;wy;wz;fx;fy;fz",
        comments="",
        fmt="%.10g",
    )


make_log()

mapping = sc.Mapping(
    columns=("stamp", "wx", "wy", "wz", "fx", "fy", "fz"),
    gyro="deg/s",
    accel="g",
    time="ms",
    axes="FRD",
    mean_rates=True,  # this logger averages over each interval
)
print(sc.open_source(path, mapping).meaning)

fix = sc.align(sc.read(path, mapping), site, spec="navigation-fog")
print(fix)

# Typed once: from now on `sc.read(path)` and `schuler align my_log.csv` know all of this.
mapping.to_toml(f"{path}.toml")
assert sc.align(sc.read(path), site, spec="navigation-fog").heading_deg == fix.heading_deg
