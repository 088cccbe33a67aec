"""Finding the attitude of a vehicle, at rest or in motion, with its uncertainty."""

from __future__ import annotations

from schuler.alignment.aligner import Aligner
from schuler.alignment.bound import Limit, Position, limit, load_positions, position_limit
from schuler.alignment.compare import Comparison, compare
from schuler.alignment.compare_records import RecordComparison, compare_records
from schuler.alignment.convergence import Convergence, convergence
from schuler.alignment.latitude import LatitudeFix, align_without_latitude
from schuler.alignment.limit_table import LimitTable, limit_table
from schuler.alignment.live import LiveAligner
from schuler.alignment.method import Estimate, Method, Problem
from schuler.alignment.methods import (
    METHODS,
    Analytic,
    Auto,
    Gyrocompass,
    Inertial,
    KalmanAlignment,
    parse_method,
)
from schuler.alignment.moving.live import LiveAids, MovingLiveSession
from schuler.alignment.moving.manoeuvres import VEHICLES, DrivePlan, plan_drive
from schuler.alignment.moving.path_bound import PathLimit, limit_on, planned_fixes, record_on
from schuler.alignment.moving.planned import PathTable, PlannedAid, path_table
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.stream import MovingStream
from schuler.alignment.moving.stream_setting import StreamSetting
from schuler.alignment.moving.windows import MovingWindows, align_moving_windows
from schuler.alignment.next_position import Fixture, Suggestion, suggest_position
from schuler.alignment.result import Alignment
from schuler.alignment.run import align
from schuler.alignment.session import LiveSession
from schuler.alignment.stationary.error_formulas import (
    analytic_error,
    bias_formula,
    inertial_error,
    inertial_frame_error,
)
from schuler.alignment.stationary.inertial import Residual, residual
from schuler.alignment.stationary.kalman import FilterHistory
from schuler.alignment.windows import Windows, align_windows

__all__ = [
    "METHODS",
    "VEHICLES",
    "Aligner",
    "Alignment",
    "Analytic",
    "Auto",
    "Comparison",
    "Convergence",
    "DrivePlan",
    "Estimate",
    "FilterHistory",
    "Fixture",
    "Gyrocompass",
    "Inertial",
    "KalmanAlignment",
    "LatitudeFix",
    "Limit",
    "LimitTable",
    "LiveAids",
    "LiveAligner",
    "LiveSession",
    "Method",
    "MovingAlignment",
    "MovingLiveSession",
    "MovingStream",
    "MovingWindows",
    "PathLimit",
    "PathTable",
    "PlannedAid",
    "Position",
    "Problem",
    "RecordComparison",
    "Residual",
    "StreamSetting",
    "Suggestion",
    "Windows",
    "align",
    "align_moving_windows",
    "align_windows",
    "align_without_latitude",
    "analytic_error",
    "bias_formula",
    "compare",
    "compare_records",
    "convergence",
    "inertial_error",
    "inertial_frame_error",
    "limit",
    "limit_on",
    "limit_table",
    "load_positions",
    "parse_method",
    "path_table",
    "plan_drive",
    "planned_fixes",
    "position_limit",
    "record_on",
    "residual",
    "suggest_position",
]
