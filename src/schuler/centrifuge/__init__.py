"""The centrifuge test: a platform's 45 coefficients, and the positions that show them best."""

from __future__ import annotations

from schuler.centrifuge.coefficients import (
    PUBLISHED_ESTIMATES,
    PUBLISHED_TRUTH,
    coefficient_names,
    coefficient_units,
    published_truth,
)
from schuler.centrifuge.files import plant_from_toml, scheme_from_toml
from schuler.centrifuge.filter import Ekf, PlatformFit, fit_platform
from schuler.centrifuge.information import direct_information, scheme_information
from schuler.centrifuge.objective import (
    OBJECTIVES,
    Judgement,
    Objective,
    judge,
    time_to_reach,
)
from schuler.centrifuge.outputs import read_outputs, write_outputs
from schuler.centrifuge.plan import Plan, compare_objectives, explore, plan
from schuler.centrifuge.plant import PUBLISHED_POSITIONS, Plant
from schuler.centrifuge.result import CentrifugeTest, identify
from schuler.centrifuge.scheme import CentrifugeScheme
from schuler.centrifuge.scorecard import Scorecard, by_objective, score
from schuler.centrifuge.search import AngleLimits, Problem, evaluate_positions
from schuler.centrifuge.simulate import simulate_platform

__all__ = [
    "OBJECTIVES",
    "PUBLISHED_ESTIMATES",
    "PUBLISHED_POSITIONS",
    "PUBLISHED_TRUTH",
    "AngleLimits",
    "CentrifugeScheme",
    "CentrifugeTest",
    "Ekf",
    "Judgement",
    "Objective",
    "Plan",
    "Plant",
    "PlatformFit",
    "Problem",
    "Scorecard",
    "by_objective",
    "coefficient_names",
    "coefficient_units",
    "compare_objectives",
    "direct_information",
    "evaluate_positions",
    "explore",
    "fit_platform",
    "identify",
    "judge",
    "plan",
    "plant_from_toml",
    "published_truth",
    "read_outputs",
    "scheme_from_toml",
    "scheme_information",
    "score",
    "simulate_platform",
    "time_to_reach",
    "write_outputs",
]
