"""Vectors and quaternions in arrays, as tuples."""

from __future__ import annotations

from schuler.kernels._jit import helper


@helper
def three(a, i):
    """Return three entries of an array as a vector."""
    return a[i], a[i + 1], a[i + 2]


@helper
def put_three(a, i, v) -> None:
    """Write a vector into an array."""
    a[i], a[i + 1], a[i + 2] = v


@helper
def four(a, i):
    """Return four entries of an array as a quaternion."""
    return a[i], a[i + 1], a[i + 2], a[i + 3]


@helper
def put_four(a, i, q) -> None:
    """Write a quaternion into an array."""
    a[i], a[i + 1], a[i + 2], a[i + 3] = q
