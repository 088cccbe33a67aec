"""Truth: motions of a body about a site, analytic in time, which compose."""

from __future__ import annotations

from schuler.motion.base import Carried, Motion, Sum, Track
from schuler.motion.centrifuge import Centrifuge
from schuler.motion.named_schemes import SCHEMES, load_scheme, named_scheme
from schuler.motion.rotation import Limits, NorthLocked, Scheme, carrier_attitude
from schuler.motion.route import Manoeuvre, Route
from schuler.motion.sea import Hull, Sea, moored_ship
from schuler.motion.static import Static
from schuler.motion.sway import Band, Lines, Sway
from schuler.motion.turntable import (
    Dwell,
    Spin,
    Turn,
    Turntable,
    continuous_rotation,
    four_position,
    two_axis_16,
)
from schuler.motion.vehicle import Crew, DisturbedVehicle, Event, quiet_crew

__all__ = [
    "SCHEMES",
    "Band",
    "Carried",
    "Centrifuge",
    "Crew",
    "DisturbedVehicle",
    "Dwell",
    "Event",
    "Hull",
    "Limits",
    "Lines",
    "Manoeuvre",
    "Motion",
    "NorthLocked",
    "Route",
    "Scheme",
    "Sea",
    "Spin",
    "Static",
    "Sum",
    "Sway",
    "Track",
    "Turn",
    "Turntable",
    "carrier_attitude",
    "continuous_rotation",
    "four_position",
    "load_scheme",
    "moored_ship",
    "named_scheme",
    "quiet_crew",
    "two_axis_16",
]
