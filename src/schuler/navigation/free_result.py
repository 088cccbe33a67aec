"""`FreeNavigation`: a free-inertial path with its start, its model and its errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from schuler._result import Result
from schuler.navigation.evaluate import Evaluation
from schuler.trajectory import Trajectory

__all__ = ["FreeNavigation"]


@dataclass(frozen=True, eq=False)
class FreeNavigation(Result):
    """A free-inertial navigation.

    Parameters
    ----------
    path : Trajectory
    gravity, vertical : str
        Names of the gravity model and of what the vertical channel does.
    alignment : mapping or None
        What the alignment at the start found, where there was one: ``consistent``,
        ``contradictions``, ``heading_deg`` and ``sigma_arcmin`` by axis.
    evaluation : Evaluation or None
        Against a reference.

    Examples
    --------
    >>> start = sc.Start.from_alignment(site, fix)
    >>> flown = FreeNavigation(sc.navigate(record, start), "somigliana", "off")
    >>> flown.to_dict()["vertical"]
    'off'
    """

    path: Trajectory
    gravity: str
    vertical: str
    alignment: Mapping[str, Any] | None = None
    evaluation: Evaluation | None = field(default=None, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return what the JSON schema `schuler.navigation/3` has of a free-inertial navigation."""
        return {
            "gravity": self.gravity,
            "vertical": self.vertical,
            "start": self.path.rows(slice(0, 1)).final,
            "final": self.path.final,
            "sigma": self.path.sigma,
            "alignment": None if self.alignment is None else dict(self.alignment),
            "error": None if self.evaluation is None else self.evaluation.to_dict(),
        }

    def columns(self) -> dict[str, Any]:
        """Return the path, a row to each time."""
        return dict(self.path.columns())

    def __str__(self) -> str:
        t = self.path.time
        lines = [
            f"{self.path.name}: {t[-1] - t[0]:.6g} s by free-inertial navigation", str(self.path)
        ]  # fmt: skip
        if self.evaluation is not None:
            lines.append(str(self.evaluation))
        return "\n".join(lines)
