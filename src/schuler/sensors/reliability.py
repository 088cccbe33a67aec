"""Reliability of an array, exactly: which sets of sensors still work, and how long they live.

An array works while its working sensors measure all three axes. With N_k such sets of k sensors,
survival p(t) of one, and coverage c (the chance that a failure is found and excluded),

    R(t) = sum over k of N_k p^k (c (1 - p))^(n - k).

A failure that is not covered ends the mission, though a working set be left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["Lifetime", "Reliability"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lifetime:
    """How long one sensor lives.

    Parameters
    ----------
    mtbf : float
        Mean life, h.
    shape : float
        Weibull's: 1 is exponential, above 1 wears out, below 1 fails early.

    Examples
    --------
    >>> round(float(Lifetime(5000.0).survival(5000.0)), 3)
    0.368
    """

    mtbf: float = 5000.0
    shape: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mtbf) and self.mtbf > 0):
            raise InputError(f"a mean life must be positive, got {self.mtbf} h")
        if not 0.2 <= self.shape <= 20.0:
            raise InputError(f"a Weibull shape must be 0.2 to 20, got {self.shape}")

    @property
    def scale(self) -> float:
        """Characteristic life, h: the time by which 63 % have failed."""
        return self.mtbf / math.gamma(1.0 + 1.0 / self.shape)

    def survival(self, time: ArrayLike) -> Array:
        """Return the chance to live to a time, h."""
        return np.exp(-((np.asarray(time, np.float64) / self.scale) ** self.shape))

    def draw(self, rng: np.random.Generator, size: tuple[int, ...]) -> Array:
        """Draw lives, h."""
        return self.scale * rng.weibull(self.shape, size)


@dataclass(frozen=True, eq=False)
class Reliability:
    """An array's reliability.

    Parameters
    ----------
    array : SensorArray
    life : Lifetime
    coverage : float
        Chance that a failure is detected, isolated and excluded, 0 to 1.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> round(float(Reliability(named_array("symmetric4"), Lifetime(5000.0)).at(1000.0)), 3)
    0.847
    """

    array: SensorArray
    life: Lifetime = Lifetime()
    coverage: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.coverage <= 1.0:
            raise InputError(f"coverage is a chance from 0 to 1, got {self.coverage}")

    def counts(self) -> dict[int, int]:
        """Return how many sets of k sensors measure all axes, by k."""
        out: dict[int, int] = {}
        for s in self.array.subsets():
            out[len(s)] = out.get(len(s), 0) + 1
        return out

    def at(self, time: ArrayLike) -> Array:
        """Return R(t) for times in h; R of a mission is R of its length."""
        t = np.asarray(time, np.float64)
        if np.any(~np.isfinite(t)) or np.any(t < 0):
            raise InputError("times of reliability must be 0 h or more")
        p, n = self.life.survival(t), len(self.array)
        return np.asarray(
            sum(c * p**k * (self.coverage * (1.0 - p)) ** (n - k) for k, c in self.counts().items())
        )

    @property
    def mtbf(self) -> float:
        """Mean time to failure of the array, h: the integral of R, in closed form."""
        n, shape = len(self.array), self.life.shape
        total = 0.0
        for k, count in self.counts().items():
            m = n - k
            # (1 - p)^m by the binomial theorem; the integral of p^j is mtbf j^(-1/shape).
            terms = math.fsum(
                (-1) ** i * math.comb(m, i) * (k + i) ** (-1.0 / shape) for i in range(m + 1)
            )
            total += count * self.coverage**m * terms
        return self.life.mtbf * total

    def simulate(self, rng: np.random.Generator, runs: int) -> Array:
        """Draw lives of the array, h, (runs,): sensors fail one by one till the array does."""
        n = len(self.array)
        lives = self.life.draw(rng, (runs, n))
        order = np.argsort(lives, axis=1)
        covered = rng.random((runs, n)) < self.coverage
        works = {frozenset(s) for s in self.array.subsets()}
        out = np.empty(runs)
        for r in range(runs):
            left = set(range(n))
            for j, lost in enumerate(order[r]):
                left.discard(int(lost))
                if not covered[r, j] or frozenset(left) not in works:
                    out[r] = lives[r, lost]
                    break
        return out
