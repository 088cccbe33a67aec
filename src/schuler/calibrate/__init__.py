"""Calibration: what the coefficients are, and which test shows them best."""

from __future__ import annotations

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
from schuler.calibrate.objective import Judgement, Objective, judge, time_to_reach
from schuler.calibrate.plan import Limits, Plan, Problem, evaluate, explore, plan

__all__ = [
    "PUBLISHED_POSITIONS",
    "PUBLISHED_TRUTH",
    "Judgement",
    "Limits",
    "Objective",
    "Plan",
    "Plant",
    "Problem",
    "coefficient_names",
    "coefficient_units",
    "direct_information",
    "evaluate",
    "explore",
    "judge",
    "plan",
    "published_truth",
    "scheme_information",
    "time_to_reach",
]
