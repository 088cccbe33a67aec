"""Rotation modulation: what a rotating IMU leaves of its errors, and which scheme leaves least."""

from __future__ import annotations

from schuler.modulation.compare import (
    Comparison,
    RotationCase,
    compare_rotation,
    strapdown_end,
)
from schuler.modulation.propagation import (
    TriadErrors,
    Turned,
    end_errors,
    error_series,
    turned,
)
from schuler.modulation.residual import Residual, optimise_scheme, residual

__all__ = [
    "Comparison",
    "Residual",
    "RotationCase",
    "TriadErrors",
    "Turned",
    "compare_rotation",
    "end_errors",
    "error_series",
    "optimise_scheme",
    "residual",
    "strapdown_end",
    "turned",
]
