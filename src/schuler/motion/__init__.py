"""Truth: motions of a body about a site, analytic in time, which compose."""

from __future__ import annotations

from schuler.motion.base import Carried, Motion, Sum, Track
from schuler.motion.centrifuge import Centrifuge
from schuler.motion.route import Manoeuvre, Route
from schuler.motion.sea import Hull, Sea, moored_ship
from schuler.motion.static import Static
from schuler.motion.sway import Band, Lines, Sway
from schuler.motion.turntable import (
    Dwell,
    Turn,
    Turntable,
    continuous_rotation,
    four_position,
    two_axis_16,
)
from schuler.motion.vehicle import Crew, DisturbedVehicle, Event, quiet_crew

__all__ = [
    "Band",
    "Carried",
    "Centrifuge",
    "Crew",
    "DisturbedVehicle",
    "Dwell",
    "Event",
    "Hull",
    "Lines",
    "Manoeuvre",
    "Motion",
    "Route",
    "Sea",
    "Static",
    "Sum",
    "Sway",
    "Track",
    "Turn",
    "Turntable",
    "continuous_rotation",
    "four_position",
    "moored_ship",
    "quiet_crew",
    "two_axis_16",
]
