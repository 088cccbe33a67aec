"""What an instrument is taken for where nothing was said of it."""

from __future__ import annotations

from schuler.constants import DEG
from schuler.sensors.errors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["CONSUMER_MEMS"]

CONSUMER_MEMS = ImuSpec(
    GyroSpec(
        bias=0.3 * DEG, angle_random_walk=6.0 * DEG / 60.0, rate_random_walk=1e-4,
        scale_factor=0.01, misalignment=0.01,
    ),
    AccelerometerSpec(
        bias=0.2, velocity_random_walk=0.03, acceleration_random_walk=5e-4,
        scale_factor=0.02, misalignment=0.01,
    ),
    name="a MEMS of consumer grade (assumed)",
)  # fmt: skip
"""A poor instrument on a road vehicle, vibration and all.

The angle random walk is several times that of its sheet: with it, errors in outages of a real
drive are what their sigma says; with a third of it they are twice as large.
"""
