"""`compare_records` holds two records of one pose, by two instruments or on two days, together.

Both are aligned; their attitudes differ by phi, whose covariance is the sum of both, since what
disturbs one says nothing of the other. phi' P^-1 phi is chi-square with three degrees of freedom
where the poses are the same and both sigmas are right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result, table_of_rows
from schuler.alignment.result import AXES, Alignment
from schuler.attitude import multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.units import percent

__all__ = ["RecordComparison", "compare_records"]

Array = NDArray[np.float64]

DIFFERENT = 0.01
"""Chance below which two equal poses are called different."""


@dataclass(frozen=True, eq=False)
class RecordComparison(Result):
    """Two alignments held against each other.

    Parameters
    ----------
    names : (str, str)
        Of the records.
    first, second : Alignment
    phi : (3,) float64
        Attitude of the second less that of the first: east, north, up, rad.
    covariance : (3, 3) float64
        Of phi, rad^2.
    """

    names: tuple[str, str]
    first: Alignment
    second: Alignment
    phi: Array
    covariance: Array

    @property
    def sigma(self) -> Array:
        """1-sigma of phi, (3,), rad."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def chi_square(self) -> float:
        """Of phi, three degrees of freedom."""
        return float(self.phi @ np.linalg.solve(self.covariance, self.phi))

    @property
    def probability(self) -> float:
        """Chance of a difference as large or larger, if the poses are the same."""
        from scipy.special import chdtrc

        return float(chdtrc(3, self.chi_square))

    @property
    def equal(self) -> bool:
        """Whether nothing says that the poses differ: `probability` is 1 % or more."""
        return self.probability >= DIFFERENT

    @property
    def contradictions(self) -> tuple[str, ...]:
        """What either record contradicts, with its name."""
        both = zip(self.names, (self.first, self.second), strict=True)
        return tuple(f"{name}: {text}" for name, fix in both for text in fix.contradictions)

    def rows(self) -> list[dict[str, Any]]:
        """Return the difference about each axis: arcmin, with its sigma and their ratio."""
        return [
            {"axis": axis, "difference_arcmin": float(p) / ARCMIN,
             "sigma_arcmin": float(s) / ARCMIN, "ratio": float(p / s)}
            for axis, p, s in zip(AXES, self.phi, self.sigma, strict=True)
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison with the keys of the JSON schema `schuler.record-comparison/1`."""
        return {
            "schema": "schuler.record-comparison/1",
            "equal": self.equal,
            "probability": self.probability,
            "chi_square": self.chi_square,
            "rows": self.rows(),
            "contradictions": list(self.contradictions),
            "records": [
                {
                    "record": name, "heading_deg": fix.heading_deg,
                    "heading_sigma_arcmin": fix.heading_sigma_arcmin,
                    "pitch_deg": fix.pitch_deg, "roll_deg": fix.roll_deg,
                    "duration_s": fix.duration, "method": str(fix.method),
                }
                for name, fix in zip(self.names, (self.first, self.second), strict=True)
            ],
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each axis."""
        return table_of_rows(self.rows())

    def __str__(self) -> str:
        lines = [f"INCONSISTENT: {text}" for text in self.contradictions]
        told = "no difference shows" if self.equal else "the poses differ"
        lines.append(
            f"{told}: chi-square {self.chi_square:.3g} of three degrees of freedom, as large by "
            f"chance in {percent(self.probability)}"
        )
        lines.append(
            f"{'record':<30}  {'heading deg':>11}  {'sigma':>8}  {'pitch':>9}  {'roll':>9}"
        )
        for name, fix in zip(self.names, (self.first, self.second), strict=True):
            lines.append(
                f"{name[-30:]:<30}  {fix.heading_deg:11.4f}  {fix.heading_sigma_arcmin:7.3g}'  "
                f"{fix.pitch_deg:9.4f}  {fix.roll_deg:9.4f}"
            )
        lines += [
            f"about {row['axis']:<5}  {row['difference_arcmin']:+9.4g}' ± "
            f"{row['sigma_arcmin']:.3g}'  ({row['ratio']:+.2f} sigma)"
            for row in self.rows()
        ]
        return "\n".join(lines)


def compare_records(
    first: Alignment, second: Alignment, names: tuple[str, str] = ("first", "second")
) -> RecordComparison:
    """Hold two alignments of one pose against each other.

    Parameters
    ----------
    first, second : Alignment
    names : (str, str)
        Of their records.

    Examples
    --------
    >>> from schuler.alignment import compare_records
    >>> before = sc.align(record.between(None, 30.0), site, spec=spec)
    >>> after = sc.align(record.between(30.0, None), site, spec=spec)
    >>> compare_records(before, after).equal
    True
    """
    back = first.quat_nb * np.array([1.0, -1.0, -1.0, -1.0])
    # C_second = (I - [phi x]) C_first, so the rotation from one to the other is -phi.
    phi = -quat_to_rotvec(multiply(second.quat_nb, back))
    return RecordComparison(names, first, second, phi, first.covariance + second.covariance)
