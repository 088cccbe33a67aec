"""Truth: motions of a vehicle about a site, analytic in time."""

from __future__ import annotations

from schuler.motion.base import Motion, Pose
from schuler.motion.static import Static
from schuler.motion.vehicle import DisturbedVehicle

__all__ = ["DisturbedVehicle", "Motion", "Pose", "Static"]
