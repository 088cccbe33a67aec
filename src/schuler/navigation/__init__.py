"""Free-inertial navigation, its error covariance, and its evaluation against a reference."""

from __future__ import annotations

from schuler.navigation.error_model import error_matrix
from schuler.navigation.evaluate import (
    Components,
    Evaluation,
    cep,
    components,
    evaluate,
    schuler_rate,
)
from schuler.navigation.lever import at_lever
from schuler.navigation.navigator import Navigator, Start, navigate
from schuler.navigation.options import Gravity, Vertical, parse_gravity, parse_vertical

__all__ = [
    "Components",
    "Evaluation",
    "Gravity",
    "Navigator",
    "Start",
    "Vertical",
    "at_lever",
    "cep",
    "components",
    "error_matrix",
    "evaluate",
    "navigate",
    "parse_gravity",
    "parse_vertical",
    "schuler_rate",
]
