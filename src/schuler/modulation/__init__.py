"""Rotation modulation: what a rotating IMU leaves of its errors, and which scheme leaves least."""

from __future__ import annotations

from schuler.modulation.case import RotationCase
from schuler.modulation.compare import RotationComparison, compare_rotation, strapdown_end
from schuler.modulation.history import RotationHistory, rotation_history
from schuler.modulation.propagation import (
    TriadErrors,
    Turned,
    end_errors,
    error_series,
    turned,
)
from schuler.modulation.residual import SchemeResidual, optimise_scheme, scheme_residual

__all__ = [
    "RotationCase",
    "RotationComparison",
    "RotationHistory",
    "SchemeResidual",
    "TriadErrors",
    "Turned",
    "compare_rotation",
    "end_errors",
    "error_series",
    "optimise_scheme",
    "rotation_history",
    "scheme_residual",
    "strapdown_end",
    "turned",
]
