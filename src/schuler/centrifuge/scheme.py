"""`CentrifugeScheme`: the positions of a centrifuge test, and the time and force at each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.centrifuge.plant import PUBLISHED_POSITIONS, Plant
from schuler.errors import InputError

__all__ = ["CentrifugeScheme", "published_test"]


@dataclass(frozen=True)
class CentrifugeScheme:
    """Positions of a test, the time at each, and the force there.

    Parameters
    ----------
    positions : tuple of (float, float, float)
        alpha, beta, gamma, deg.
    dwell : float
        s at each.
    forces : tuple of float, optional
        Centripetal force at each position, g; the plant's own where empty.

    Examples
    --------
    >>> CentrifugeScheme(dwell=20.0).to_dict()["dwell"]
    20.0
    """

    positions: tuple[tuple[float, float, float], ...] = PUBLISHED_POSITIONS
    dwell: float = 100.0
    forces: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        rows = np.asarray(self.positions, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all():
            raise InputError("a scheme's positions must be rows of alpha, beta, gamma in deg")
        if not (np.isfinite(self.dwell) and self.dwell > 0):
            raise InputError(f"a scheme's dwell must be positive, got {self.dwell}")
        if self.forces and (
            len(self.forces) != len(rows) or not all(np.isfinite(f) and f > 0 for f in self.forces)
        ):
            raise InputError(
                f"a scheme's forces must be {len(rows)} positive numbers of g, one to a position, "
                f"got {list(self.forces)}"
            )
        object.__setattr__(self, "positions", tuple(map(tuple, rows.tolist())))
        object.__setattr__(self, "forces", tuple(map(float, self.forces)))

    def to_dict(self) -> dict[str, Any]:
        """Return the scheme as its TOML table."""
        return {
            "dwell": self.dwell,
            "positions": [list(row) for row in self.positions],
            **({"forces": list(self.forces)} if self.forces else {}),
        }


def published_test(plant: Plant, dwell: float = 100.0) -> CentrifugeScheme:
    """Return the published six positions; with D_OO at the plant's force and at half of it."""
    if not plant.d_oo:
        return CentrifugeScheme(dwell=dwell)
    return CentrifugeScheme(
        PUBLISHED_POSITIONS * 2, dwell, (plant.force,) * 6 + (0.5 * plant.force,) * 6
    )
