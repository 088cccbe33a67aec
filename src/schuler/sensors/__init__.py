"""What an instrument is: its errors by type, and named grades."""

from __future__ import annotations

from schuler.sensors.errors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec, load_spec

__all__ = ["GRADES", "AccelerometerSpec", "GyroSpec", "ImuSpec", "load_spec"]
