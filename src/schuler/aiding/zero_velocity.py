"""`ZeroVelocity`: spans in which a vehicle is known, or found, to stand still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.gnss import GnssFixes
from schuler.aiding.still import find_rest
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["ZeroVelocity"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ZeroVelocity:
    """Spans at rest: the velocity there is nothing but what crew and wind make of it.

    Parameters
    ----------
    spans : (k, 2) array_like
        Begin and end of each, on the record's clock, s.
    sigma : float
        1-sigma of the velocity at one instant, m/s: that of the swaying.
    window : float
        Time between two such instants, s.
    name : str

    Raises
    ------
    InputError
        For spans that do not end after they begin, or a sigma or window that is not positive.

    Examples
    --------
    >>> rest = ZeroVelocity([(0.0, 25.0), (190.0, 205.0)])
    >>> float(rest.times(0.0, 200.0)[-1])
    200.0
    """

    spans: ArrayLike
    sigma: float = 0.01
    window: float = 0.5
    name: str = "zero_velocity"

    def __post_init__(self) -> None:
        spans = np.asarray(self.spans, np.float64)
        if spans.ndim != 2 or spans.shape[1] != 2 or not np.all(np.isfinite(spans)):
            raise InputError(f"{self.name}: spans are rows of two times, got shape {spans.shape}")
        if not len(spans):
            raise InputError(f"{self.name}: there is no span at rest")
        if np.any(spans[:, 1] <= spans[:, 0]):
            k = int(np.argmax(spans[:, 1] <= spans[:, 0]))
            raise InputError(
                f"{self.name}: a span ends at t = {spans[k, 1]:.9g} s, not after its begin at "
                f"{spans[k, 0]:.9g} s"
            )
        for what, value in (("sigma", self.sigma), ("window", self.window)):
            if not 0.0 < value < np.inf:
                raise InputError(f"{self.name}: {what} is positive, got {value}")
        object.__setattr__(self, "spans", spans[np.argsort(spans[:, 0])])

    def times(self, begin: float, end: float) -> Array:
        """Return the instants within the spans that are taken, from `begin` to `end`, (k,)."""
        out = [np.zeros(0)]
        for first, last in np.asarray(self.spans):
            # The edges of a span belong to the motion.
            out.append(np.arange(first + self.window, last - 0.5 * self.window, self.window))
        time = np.concatenate(out)
        return np.asarray(np.unique(time[(time >= begin) & (time <= end)]))

    @classmethod
    def found(
        cls, record: ImuRecord, fixes: GnssFixes | None = None, *, shortest: float = 5.0,
        sigma: float = 0.01,
    ) -> ZeroVelocity:  # fmt: skip
        """Find the spans at rest by the scatter of the samples, and by the fixes' speeds.

        Parameters
        ----------
        record : ImuRecord
        fixes : GnssFixes, optional
            With velocities, they tell rest from smooth motion.
        shortest : float
            A span is at least so long, s.
        sigma : float
            As in the class.

        Raises
        ------
        InputError
            If the record shows no rest.
        """
        spans = find_rest(record, moving=None if fixes is None else fixes.moving).spans
        long = spans[spans[:, 1] - spans[:, 0] >= shortest]
        if not len(long):
            raise InputError(
                f"{record.name}: no rest of {shortest:g} s or more was found in the record"
            )
        return cls(long, sigma)
