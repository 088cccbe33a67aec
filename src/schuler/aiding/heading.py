"""`HeadingFixes`: directions of a baseline, of two antennas or a compass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.rows import checked_rows
from schuler.constants import DEG
from schuler.errors import InputError

__all__ = ["HeadingFixes"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeadingFixes:
    """Headings of a baseline that is fixed in the body.

    Rows that cannot be used are left out and counted in `dropped`.

    Parameters
    ----------
    time : (n,) array_like
        On the record's clock, s.
    heading : (n,) array_like
        Clockwise from north, rad; any multiple of a turn may be in it.
    sigma : float or (n,) array_like
        1-sigma, rad.
    baseline : (3,) array_like
        Its direction in body axes (right, forward, up): from the first antenna to the second, or
        forward of a compass.
    name : str
    dropped : mapping of str to int
        Rows that were left out, by reason.
    clock : str
        What the times count, of `schuler.aiding.CLOCKS`.

    Raises
    ------
    InputError
        For arrays of other shapes, no usable row, values that are no angles in rad, or a baseline
        without a level part.

    Examples
    --------
    >>> len(HeadingFixes([0.0, 1.0], [0.3, 6.5]))
    2
    """

    time: ArrayLike
    heading: ArrayLike
    sigma: ArrayLike = 0.2 * DEG
    baseline: ArrayLike = (0.0, 1.0, 0.0)
    name: str = "heading"
    dropped: Mapping[str, int] = field(default_factory=dict)
    clock: str = "unstated"

    def __post_init__(self) -> None:
        baseline = np.asarray(self.baseline, np.float64)
        if (
            baseline.shape != (3,)
            or not np.all(np.isfinite(baseline))
            or not np.hypot(baseline[0], baseline[1]) > 0.1 * np.linalg.norm(baseline)
        ):
            raise InputError(
                f"{self.name}: a baseline has three finite numbers and is not along the body's up, "
                f"got {self.baseline}"
            )
        time, columns, sigma, dropped = checked_rows(
            self.name, self.time, {"heading": self.heading}, self.sigma, 1, self.dropped
        )
        heading = columns["heading"]
        if np.any(np.abs(heading) > 4.0 * np.pi):
            k = int(np.argmax(np.abs(heading) > 4.0 * np.pi))
            raise InputError(
                f"{self.name}: a heading of {heading[k]:.6g} rad at t = {time[k]:.9g} s is more "
                "than two turns: is it in deg?"
            )
        for key, value in (
            ("time", time), ("heading", heading), ("sigma", sigma), ("baseline", baseline),
            ("dropped", dropped),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(np.asarray(self.time))
