"""3-vectors as tuples of scalars: they read like mathematics and cost nothing."""

from __future__ import annotations

from schuler.kernels._jit import helper

Vec = tuple[float, float, float]


@helper
def add(a: Vec, b: Vec) -> Vec:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@helper
def scale(s: float, a: Vec) -> Vec:
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@helper
def axpy(s: float, a: Vec, b: Vec) -> Vec:
    """Return s a + b."""
    return s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2]


@helper
def cross(a: Vec, b: Vec) -> Vec:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@helper
def dot(a: Vec, b: Vec) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
