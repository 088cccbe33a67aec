"""Which position to turn the unit to next: the one after which the limit is lowest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schuler.alignment.bound import Limit, Position, position_limit
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import ImuSpec

__all__ = ["Fixture", "Suggestion", "suggest_position"]


@dataclass(frozen=True)
class Fixture:
    """What the fixture under the unit can do.

    Parameters
    ----------
    yaw_deg : (2,) tuple
        Range of psi against the last position.
    tilt_deg : float
        Largest pitch and roll; 0 is a table that only turns.
    step_deg : float
        Of the grid that is looked at; the best point of it is refined to a degree.

    Examples
    --------
    >>> Fixture(yaw_deg=(-90.0, 90.0), step_deg=45.0)
    Fixture(yaw_deg=(-90.0, 90.0), tilt_deg=0.0, step_deg=45.0)
    """

    yaw_deg: tuple[float, float] = (0.0, 360.0)
    tilt_deg: float = 0.0
    step_deg: float = 15.0

    def __post_init__(self) -> None:
        low, high = self.yaw_deg
        if not (np.isfinite(low) and np.isfinite(high) and low <= high):
            raise InputError(f"the yaw range must be low:high in degrees, got {low:g}:{high:g}")
        if not 0 <= self.tilt_deg <= 180:
            raise InputError(f"the tilt must be between 0 and 180 deg, got {self.tilt_deg:g}")
        if not self.step_deg > 0:
            raise InputError(f"the step must be positive, got {self.step_deg:g}")


@dataclass(frozen=True, eq=False)
class Suggestion:
    """A next position and the limit with it."""

    position: Position
    limit: Limit


def suggest_position(
    spec: ImuSpec,
    site: Site,
    positions: Sequence[Position],
    fixture: Fixture,
    *,
    dwell: float = 300.0,
    turn: float = 0.0,
    interval: float = 0.01,
) -> Suggestion:
    """Return the next position that lowers the limit of the heading most.

    Parameters
    ----------
    spec : ImuSpec
    site : Site
    positions : sequence of Position
        Those that are done; one at least.
    fixture : Fixture
    dwell : float
        Of the next position, s.
    turn : float
        How long the gyros track the turn there, s.
    interval : float
        Sampling interval, s.

    Raises
    ------
    InputError
        As `position_limit`.

    Examples
    --------
    >>> best = suggest_position(spec, site, [Position(300.0)], Fixture(step_deg=90.0))
    >>> round(best.position.heading_ccw_deg % 180.0)
    120
    """
    if not positions:
        raise InputError("a next position needs one that is done")
    last = positions[-1]

    def limit(yaw: float, pitch: float, roll: float) -> Suggestion:
        new = Position(last.heading_ccw_deg + yaw, pitch, roll, dwell, turn)
        return Suggestion(new, position_limit(spec, site, [*positions, new], interval))

    def grid(low: float, high: float, step: float) -> list[float]:
        count = max(1, round((high - low) / step)) if high > low else 0
        return [float(v) for v in np.linspace(low, high, count + 1)]

    tilt = fixture.tilt_deg
    tilts = grid(-tilt, tilt, max(2 * tilt / 6, fixture.step_deg)) if tilt else [0.0]
    found = [
        limit(yaw, pitch, roll)
        for yaw in grid(*fixture.yaw_deg, fixture.step_deg)
        for pitch in (tilts if tilt else [last.pitch_deg])
        for roll in (tilts if tilt else [last.roll_deg])
    ]
    best = min(found, key=lambda s: float(s.limit.sigma_arcmin[2]))
    step = fixture.step_deg / 2
    while step >= 1.0:
        at = best.position
        yaw = at.heading_ccw_deg - last.heading_ccw_deg
        near = [
            limit(
                float(np.clip(yaw + a * step, *fixture.yaw_deg)),
                float(np.clip(at.pitch_deg + b * step, -tilt, tilt)) if tilt else at.pitch_deg,
                float(np.clip(at.roll_deg + c * step, -tilt, tilt)) if tilt else at.roll_deg,
            )
            for a, b, c in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
        ]
        nearest = min(near, key=lambda s: float(s.limit.sigma_arcmin[2]))
        if nearest.limit.sigma_arcmin[2] < best.limit.sigma_arcmin[2] * (1 - 1e-9):
            best = nearest
        else:
            step /= 2
    return best
