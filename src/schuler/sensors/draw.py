"""The constant errors of three sensors on three axes: drawn from a specification, or given."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import skew
from schuler.errors import InputError
from schuler.sensors.errors import AccelerometerSpec, GyroSpec

__all__ = ["Imperfections", "draw"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Imperfections:
    """Constant errors: measured = (I + matrix) x + asymmetry |x| + bias + terms in f and T.

    Parameters
    ----------
    bias : (3,) float64
        rad/s or m/s^2.
    matrix : (3, 3) float64
        Scale factor errors on the diagonal; misalignment of the triad and non-orthogonality of
        its axes off it.
    asymmetry : (3,) float64
        Half the difference of the scale factors for positive and negative input.
    g_sensitivity : (3, 3) float64
        Bias that a specific force makes, per m/s^2 (gyros).
    g2_sensitivity : (3,) float64
        Bias that the square of the force along the axis makes, per (m/s^2)^2.
    temperature : (3,) float64
        Change of the bias per K.
    """

    bias: Array = field(default_factory=lambda: np.zeros(3))
    matrix: Array = field(default_factory=lambda: np.zeros((3, 3)))
    asymmetry: Array = field(default_factory=lambda: np.zeros(3))
    g_sensitivity: Array = field(default_factory=lambda: np.zeros((3, 3)))
    g2_sensitivity: Array = field(default_factory=lambda: np.zeros(3))
    temperature: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for name, shape in (
            ("bias", (3,)), ("matrix", (3, 3)), ("asymmetry", (3,)),
            ("g_sensitivity", (3, 3)), ("g2_sensitivity", (3,)), ("temperature", (3,)),
        ):  # fmt: skip
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != shape:
                raise InputError(f"expected {name} of shape {shape}, got {value.shape}")
            object.__setattr__(self, name, value)

    def with_bias(self, bias: ArrayLike) -> Imperfections:
        """Return the same errors with another bias (3,)."""
        return replace(self, bias=np.asarray(bias, np.float64))


def draw(part: GyroSpec | AccelerometerSpec, rng: np.random.Generator) -> Imperfections:
    """Draw the constant errors of a triad from a specification.

    Numbers are drawn in a fixed order whatever the specification holds, so that one more error
    type leaves the others' draws as they were.

    Examples
    --------
    >>> from schuler.sensors import draw
    >>> draw(spec.gyro, np.random.default_rng(0)).bias.shape
    (3,)
    """
    z = rng.standard_normal((9, 3))
    # A rigid turn of the triad, then axes that lean towards one another.
    lean = np.zeros((3, 3))
    lean[0, 1], lean[0, 2], lean[1, 2] = z[3]
    matrix = (
        np.diag(part.by_axis("scale_factor") * z[1])
        - part.misalignment * skew(z[2])
        + part.non_orthogonality * lean
    )
    force = (
        np.reshape(part.by_axis("g_sensitivity"), (-1, 1)) if isinstance(part, GyroSpec) else 0.0
    )
    return Imperfections(
        bias=part.by_axis("bias") * z[0],
        matrix=matrix,
        asymmetry=part.by_axis("scale_factor_asymmetry") * z[4],
        g_sensitivity=np.reshape(force, (-1, 1)) * z[5:8],
        g2_sensitivity=part.by_axis("g2_sensitivity") * z[8],
        temperature=part.by_axis("temperature_sensitivity") * rng.standard_normal(3),
    )
