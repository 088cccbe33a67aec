"""Calibration: an instrument's coefficients from poses, turns and tables."""

from __future__ import annotations

from schuler.calibration.apply import Calibration
from schuler.calibration.poses import PosesFit, calibrate_poses, find_rests
from schuler.calibration.systematic import NAMES as SYSTEMATIC_NAMES
from schuler.calibration.systematic import SystematicFit, calibrate_systematic
from schuler.calibration.turntable import TableFit, combine, rate_test, scheme, static_test

__all__ = [
    "SYSTEMATIC_NAMES",
    "Calibration",
    "PosesFit",
    "SystematicFit",
    "TableFit",
    "calibrate_poses",
    "calibrate_systematic",
    "combine",
    "find_rests",
    "rate_test",
    "scheme",
    "static_test",
]
