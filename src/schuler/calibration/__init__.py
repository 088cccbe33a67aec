"""Calibration: an instrument's coefficients from poses, turns and tables."""

from __future__ import annotations

from schuler.calibration.apply import Calibration
from schuler.calibration.doppler import BodyVelocityFit, fit_body_velocity
from schuler.calibration.export import export_calibration
from schuler.calibration.poses import PosesFit, calibrate_poses, find_rests
from schuler.calibration.systematic import NAMES as SYSTEMATIC_NAMES
from schuler.calibration.systematic import SystematicFit, calibrate_systematic
from schuler.calibration.table_test import (
    Position,
    RateTurn,
    TableTest,
    calibrate_positions,
    calibrate_rates,
    positions_from_toml,
    turns_from_toml,
)
from schuler.calibration.turntable import TableFit, combine, rate_test, scheme, static_test

__all__ = [
    "SYSTEMATIC_NAMES",
    "BodyVelocityFit",
    "Calibration",
    "PosesFit",
    "Position",
    "RateTurn",
    "SystematicFit",
    "TableFit",
    "TableTest",
    "calibrate_poses",
    "calibrate_positions",
    "calibrate_rates",
    "calibrate_systematic",
    "combine",
    "export_calibration",
    "find_rests",
    "fit_body_velocity",
    "positions_from_toml",
    "rate_test",
    "scheme",
    "static_test",
    "turns_from_toml",
]
