"""`Scatter`: how the errors of many alignments compare with what each said of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.constants import ARCMIN

__all__ = ["FALSE_ALARM", "Scatter"]

Array = NDArray[np.float64]

FALSE_ALARM = 0.01
"""A consistent covariance leaves the band of the NEES so often."""


@dataclass(frozen=True, eq=False)
class Scatter(Result):
    """Errors of n alignments whose truth is known.

    Parameters
    ----------
    method : str
    values : mapping
        What was set, where something was swept.
    phi, sigma, limit : (n, 3) float64
        Misalignment, its stated 1 sigma, and the Cramér-Rao limit: east, north, up, rad.
    nees : (n,) float64
        phi weighted by the inverse of its stated covariance: 3 in the mean if that is consistent.
    heading_error : (n,) float64
        rad.
    """

    method: str
    values: Mapping[str, Any]
    phi: Array = field(repr=False)
    sigma: Array = field(repr=False)
    limit: Array = field(repr=False)
    nees: Array = field(repr=False)
    heading_error: Array = field(repr=False)

    @property
    def runs(self) -> int:
        """How many, n."""
        return len(self.nees)

    @property
    def label(self) -> str:
        """What was set: ``motion.heading = 90``; empty where nothing was swept."""
        return ", ".join(f"{key} = {value}" for key, value in self.values.items())

    @property
    def mean(self) -> float:
        """Mean of the heading error, arcmin."""
        return float(np.mean(self.heading_error)) / ARCMIN

    @property
    def std(self) -> float | None:
        """Standard deviation of the heading error, arcmin; None for a single run."""
        if self.runs < 2:
            return None
        return float(np.std(self.heading_error, ddof=1)) / ARCMIN

    @property
    def rms(self) -> float:
        """Root mean square of the heading error, arcmin."""
        return float(np.sqrt(np.mean(self.heading_error**2))) / ARCMIN

    @property
    def predicted(self) -> float:
        """Root mean square of the stated sigma of the heading, arcmin."""
        return float(np.sqrt(np.mean(self.sigma[:, 2] ** 2))) / ARCMIN

    @property
    def bound(self) -> float | None:
        """Limit of the heading, arcmin; None without an instrument."""
        value = float(np.sqrt(np.mean(self.limit[:, 2] ** 2))) / ARCMIN
        return value if np.isfinite(value) else None

    @property
    def ratio(self) -> float | None:
        """Rms of the heading error over its limit."""
        return None if self.bound is None else self.rms / self.bound

    @property
    def nees_ratio(self) -> float:
        """Mean NEES over 3: 1 for a consistent covariance, above 1 where sigma is too small."""
        return float(np.mean(self.nees)) / 3.0

    @property
    def nees_band(self) -> tuple[float, float]:
        """Where `nees_ratio` lies in 99 of 100 cases if the covariance is consistent."""
        from scipy.special import chdtri, gammaincinv

        n = 3 * self.runs
        return 2.0 * float(gammaincinv(0.5 * n, FALSE_ALARM / 2)) / n, float(
            chdtri(n, FALSE_ALARM / 2)
        ) / n

    @property
    def consistent(self) -> bool:
        """Whether `nees_ratio` lies in its band."""
        low, high = self.nees_band
        return low <= self.nees_ratio <= high

    @property
    def normalised(self) -> Array:
        """Heading errors over their stated sigma, (n,)."""
        return np.asarray(self.heading_error / self.sigma[:, 2])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures with their units in the keys."""
        return {
            "method": self.method,
            "sweep": dict(self.values),
            "runs": self.runs,
            "mean_arcmin": self.mean,
            "std_arcmin": self.std,
            "rms_arcmin": self.rms,
            "heading_sigma_arcmin": self.predicted,
            "limit_arcmin": self.bound,
            "rms_over_limit": self.ratio,
            "nees_over_3": self.nees_ratio,
            "nees_over_3_band": list(self.nees_band),
            "consistent": self.consistent,
        }
