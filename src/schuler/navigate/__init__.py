"""Pure inertial navigation, its error state, its evaluation, and what rotation does to it."""

from __future__ import annotations

from schuler._face import callable_room
from schuler.navigate.evaluate import (
    Components,
    Evaluation,
    cep,
    components,
    evaluate,
    schuler_rate,
)
from schuler.navigate.lever import at_lever
from schuler.navigate.navigator import Navigator, Start, navigate
from schuler.navigate.options import Gravity, Vertical, parse_gravity, parse_vertical
from schuler.navigate.path import Path
from schuler.navigate.propagation import (
    TriadErrors,
    Turned,
    end_errors,
    error_matrix,
    error_series,
    turned,
)
from schuler.navigate.residual import Residual, optimise_scheme, residual
from schuler.navigate.rotation import (
    Comparison,
    RotationCase,
    compare_rotation,
    strapdown_end,
)

__all__ = [
    "Comparison",
    "Components",
    "Evaluation",
    "Gravity",
    "Navigator",
    "Path",
    "Residual",
    "RotationCase",
    "Start",
    "TriadErrors",
    "Turned",
    "Vertical",
    "at_lever",
    "cep",
    "compare_rotation",
    "components",
    "end_errors",
    "error_matrix",
    "error_series",
    "evaluate",
    "navigate",
    "optimise_scheme",
    "parse_gravity",
    "parse_vertical",
    "residual",
    "schuler_rate",
    "strapdown_end",
    "turned",
]

callable_room(__name__)
