"""Simulate a truck with its crew at work, find north, compare with the truth, draw a report."""

import numpy as np

import schuler as sc
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulation import simulate

site = sc.Site(lat=52.5, lon=13.4, height=40.0)
spec = GRADES["navigation-rlg"]
rng = np.random.default_rng(1)

truck = DisturbedVehicle.draw(rng, 300.0, heading=271.0, pitch=0.6, roll=-0.4)
made = simulate(truck, site, 300.0, 100.0, spec, rng, name="truck")

fix = sc.align(made.record, site, spec=spec)
print(fix)

off = 60 * (fix.heading_deg - made.heading_deg())
print(f"truth {made.heading_deg():.3f} deg, off by {off:+.2f}', sigma {fix.sigma_arcmin[2]:.2f}'")

sc.report(fix, "truck.html")
print("report: truck.html")
