"""The chi-square distribution's upper tail, without the seconds that SciPy takes to be imported."""

from __future__ import annotations

import math

__all__ = ["chi_square_tail"]


def chi_square_tail(freedom: int, value: float) -> float:
    """Return how likely chance makes a chi-square that is larger than a value.

    The finite sums of Abramowitz and Stegun (1964), 26.4.4 and 26.4.5.

    Parameters
    ----------
    freedom : int
        Degrees of freedom, 1 or more.
    value : float

    Examples
    --------
    >>> round(chi_square_tail(1, 3.841458820694124), 12), round(chi_square_tail(2, 0.0), 12)
    (0.05, 1.0)
    """
    if not value > 0.0:
        return 1.0
    half = 0.5 * value
    if freedom % 2:
        total, next_divisor = math.erfc(math.sqrt(half)), 1.5
        term = math.sqrt(half) / math.gamma(1.5) * math.exp(-half)
    else:
        total, next_divisor = 0.0, 1.0
        term = math.exp(-half)
    for _ in range(freedom // 2):
        total += term
        term *= half / next_divisor
        next_divisor += 1.0
    return total
