"""Calibration: what the coefficients are, and which test shows them best."""

from __future__ import annotations

from schuler.calibrate.apply import Calibration
from schuler.calibrate.centrifuge import (
    PUBLISHED_POSITIONS,
    PUBLISHED_TRUTH,
    Plant,
    coefficient_names,
    coefficient_units,
    direct_information,
    published_truth,
    scheme_information,
)
from schuler.calibrate.objective import (
    OBJECTIVES,
    Judgement,
    Objective,
    judge,
    time_to_reach,
)
from schuler.calibrate.plan import Limits, Plan, Problem, evaluate, explore, plan
from schuler.calibrate.platform import Ekf, PlatformFit, fit_platform, simulate_platform
from schuler.calibrate.poses import PosesFit, calibrate_poses, find_dwells
from schuler.calibrate.systematic import NAMES as SYSTEMATIC_NAMES
from schuler.calibrate.systematic import SystematicFit, calibrate_systematic
from schuler.calibrate.turntable import TableFit, combine, rate_test, scheme, static_test

__all__ = [
    "OBJECTIVES",
    "PUBLISHED_POSITIONS",
    "PUBLISHED_TRUTH",
    "SYSTEMATIC_NAMES",
    "Calibration",
    "Ekf",
    "Judgement",
    "Limits",
    "Objective",
    "Plan",
    "Plant",
    "PlatformFit",
    "PosesFit",
    "Problem",
    "SystematicFit",
    "TableFit",
    "calibrate_poses",
    "calibrate_systematic",
    "coefficient_names",
    "coefficient_units",
    "combine",
    "direct_information",
    "evaluate",
    "explore",
    "find_dwells",
    "fit_platform",
    "judge",
    "plan",
    "published_truth",
    "rate_test",
    "scheme",
    "scheme_information",
    "simulate_platform",
    "static_test",
    "time_to_reach",
]
