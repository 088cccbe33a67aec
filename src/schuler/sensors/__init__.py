"""What an instrument is: its errors by type, and named grades."""

from __future__ import annotations

from schuler.sensors.draw import Imperfections, draw
from schuler.sensors.errors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec, load_spec

__all__ = [
    "GRADES",
    "AccelerometerSpec",
    "GyroSpec",
    "Imperfections",
    "ImuSpec",
    "draw",
    "load_spec",
]
