"""Navigation, free-inertial and aided, its error covariance, and its evaluation."""

from __future__ import annotations

from schuler.navigation.aided import navigate_aided
from schuler.navigation.aided_result import AidedNavigation
from schuler.navigation.aiding_options import AidingOptions
from schuler.navigation.error_model import error_matrix
from schuler.navigation.evaluate import (
    Components,
    Evaluation,
    cep,
    components,
    evaluate,
    schuler_rate,
)
from schuler.navigation.free_result import FreeNavigation
from schuler.navigation.lever import at_lever
from schuler.navigation.motion_start import MotionStart, motion_start
from schuler.navigation.navigator import Navigator
from schuler.navigation.options import Gravity, Vertical, parse_gravity, parse_vertical
from schuler.navigation.outages import Outages, OutageScore
from schuler.navigation.run import navigate
from schuler.navigation.start import Start

__all__ = [
    "AidedNavigation",
    "AidingOptions",
    "Components",
    "Evaluation",
    "FreeNavigation",
    "Gravity",
    "MotionStart",
    "Navigator",
    "OutageScore",
    "Outages",
    "Start",
    "Vertical",
    "at_lever",
    "cep",
    "components",
    "error_matrix",
    "evaluate",
    "motion_start",
    "navigate",
    "navigate_aided",
    "parse_gravity",
    "parse_vertical",
    "schuler_rate",
]
