"""The adaptive gate: samples whose force is not gravity's size are not believed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.prefilter.base import Prefilter, even_interval
from schuler.record import ImuRecord

__all__ = ["Gate"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gate(Prefilter):
    """Replace the force of samples outside the gate by the straight line between their neighbours.

    Parameters
    ----------
    width : float
        Part of gravity by which |f| may differ (0.003 in the document).
    two_sided : bool
        Reject forces that are too small as well; the document prints only those too large
        (equation 44), which biases what is left upwards.
    gravity : float, optional
        m/s^2; an alignment gives that of its site.

    Examples
    --------
    >>> fix = sc.align(record, site, sc.Inertial("wahba", prefilter=sc.Gate(width=0.003)), spec)
    >>> fix.consistent
    True
    """

    width: float = 0.003
    two_sided: bool = True
    gravity: float | None = field(default=None, metadata={"unit": "acceleration"})

    def __post_init__(self) -> None:
        if not (self.width > 0 and (self.gravity is None or self.gravity > 0)):
            raise InputError("a gate needs a positive gravity and width")

    def at(self, gravity: float) -> Gate:
        """Return the gate for a place with so much gravity, m/s^2."""
        return self if self.gravity is not None else replace(self, gravity=gravity)

    def rejected(self, record: ImuRecord) -> NDArray[np.bool_]:
        """Return which samples the gate rejects, (n,).

        Raises
        ------
        InputError
            If gravity is not known.

        Examples
        --------
        >>> int(sc.Gate(0.5).at(site.gravity).rejected(record).sum())
        0
        """
        if self.gravity is None:
            raise InputError("a gate needs gravity: say Gate(gravity=site.gravity)")
        size = np.linalg.norm(record.accel, axis=1) - self.gravity
        bound = self.width * self.gravity
        return np.asarray(np.abs(size) > bound if self.two_sided else size >= bound)

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the record with the rejected forces bridged.

        Raises
        ------
        InputError
            If everything is rejected, or the record is short or unevenly sampled.
        """
        even_interval(record)
        bad = self.rejected(record)
        good = np.flatnonzero(~bad)
        if not len(good):
            raise InputError(
                f"the gate of {100 * self.width:g} % of g rejects every sample: the force is too "
                "noisy sample by sample; low-pass it first, or widen the gate"
            )
        accel = record.accel
        middle = record.time - 0.5 * record.dt
        filled = np.column_stack([np.interp(middle, middle[good], x) for x in accel[good].T])
        return replace(
            record, dvel=np.where(bad[:, None], filled * record.dt[:, None], record.dvel)
        )
