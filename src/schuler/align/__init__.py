"""Finding the attitude of a standing vehicle, with its uncertainty."""

from __future__ import annotations

from schuler._face import callable_room
from schuler.align.aligner import Aligner, align
from schuler.align.budget import (
    analytic_error,
    bias_formula,
    inertial_error,
    inertial_frame_error,
)
from schuler.align.convergence import Convergence, convergence
from schuler.align.disturbance import Residual, residual
from schuler.align.fine import FinePass
from schuler.align.latitude import LatitudeFix, align_without_latitude
from schuler.align.limit import Limit, Position, limit, load_positions, position_limit
from schuler.align.live import LiveAligner
from schuler.align.methods import (
    METHODS,
    PREFILTERS,
    Analytic,
    Auto,
    Fine,
    Gyrocompass,
    Inertial,
    Method,
    parse_method,
    parse_prefilter,
    with_prefilter,
)
from schuler.align.positions import Fixture, Suggestion, suggest_position
from schuler.align.result import Alignment
from schuler.align.session import LiveSession
from schuler.align.windows import Windows, align_windows

__all__ = [
    "METHODS",
    "PREFILTERS",
    "Aligner",
    "Alignment",
    "Analytic",
    "Auto",
    "Convergence",
    "Fine",
    "FinePass",
    "Fixture",
    "Gyrocompass",
    "Inertial",
    "LatitudeFix",
    "Limit",
    "LiveAligner",
    "LiveSession",
    "Method",
    "Position",
    "Residual",
    "Suggestion",
    "Windows",
    "align",
    "align_windows",
    "align_without_latitude",
    "analytic_error",
    "bias_formula",
    "convergence",
    "inertial_error",
    "inertial_frame_error",
    "limit",
    "load_positions",
    "parse_method",
    "parse_prefilter",
    "position_limit",
    "residual",
    "suggest_position",
    "with_prefilter",
]

callable_room(__name__)
