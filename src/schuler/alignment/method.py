"""What an alignment method is: a frozen dataclass that makes an estimate of a problem."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from schuler.prefilter.base import Prefilter

if TYPE_CHECKING:
    from schuler.alignment.bound import Position
    from schuler.alignment.history import History
    from schuler.alignment.stationary.kalman import FilterHistory
    from schuler.alignment.stationary.optimal import Linearisation, OptimalAlignment
    from schuler.earth import Site
    from schuler.record import ImuRecord
    from schuler.sensors import ImuSpec

__all__ = ["Estimate", "Method", "Problem"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """What a method is given.

    Parameters
    ----------
    history : History
        The tracker's running sums at up to 4097 instants.
    site : Site
    spec : ImuSpec or None
        The instrument.
    at_end : bool
        Whether the attitude is that at the end, and not at the start.
    about : Linearisation or None
        Where the estimate is made again about what was found.
    samples : callable
        Returns the record, for a method that needs the samples.

    Examples
    --------
    >>> given = Problem(fix.history, site, spec, True, None, lambda: record)
    >>> sc.Inertial("centred").solve(given).attitude.shape
    (3, 3)
    """

    history: History
    site: Site
    spec: ImuSpec | None
    at_end: bool
    about: Linearisation | None
    samples: Callable[[], ImuRecord]


@dataclass(frozen=True, kw_only=True)
class Method(ABC):
    """An alignment method; its options are the fields of the dataclass.

    `needs` says whether the tracker's running sums are enough, so that memory stays constant, or
    whether the samples are kept.

    Parameters
    ----------
    prefilter : Prefilter, optional
        Applied first: to the whole record, which is then held in memory, or to the stream where it
        can be (`Prefilter.streams`).
    """

    needs: ClassVar[Literal["sums", "samples"]] = "sums"

    prefilter: Prefilter | None = None

    @abstractmethod
    def solve(self, problem: Problem) -> Estimate:
        """Return the attitude with its covariance by source.

        Raises
        ------
        InputError
            If the problem fixes no attitude.
        """

    def attitude(self, problem: Problem) -> Array:
        """Return the attitude alone, mat_nb (3, 3); a method may know a shorter way to it.

        Raises
        ------
        InputError
            As `solve`.
        """
        return self.solve(problem).attitude

    @property
    def wanted_subsamples(self) -> int | None:
        """Samples to one coning and sculling update; None leaves it to the sampling rate."""
        wanted: int | None = getattr(self, "subsamples", None)
        return wanted

    def with_prefilter(self, prefilter: Prefilter | None) -> Method:
        """Return the method with another prefilter.

        Examples
        --------
        >>> str(sc.Inertial("centred").with_prefilter(sc.LowPass(1.0)))
        'centred(prefilter=lowpass(cutoff=1.0))'
        """
        return replace(self, prefilter=prefilter)

    def to_table(self) -> dict[str, Any]:
        """Return name and options, as in JSON and in scenario files."""
        from schuler.alignment.methods import METHODS

        return METHODS.to_table(self)

    def __str__(self) -> str:
        from schuler.alignment.methods import METHODS

        return METHODS.text(self)


@dataclass(frozen=True, eq=False)
class Estimate:
    """An attitude with its covariance, before it becomes an `Alignment`.

    Parameters
    ----------
    method : Method
        What made it.
    attitude : (3, 3) float64
        mat_nb.
    budget : dict of str to (3, 3) float64
        Covariance of phi by source, rad^2.
    orthonormality : float or None
        Error of the analytic method, rad.
    noise_ratio : float or None
        How the residual's power compares with the specification's white noise.
    spec : ImuSpec or None
        What was used: a record that is surely quieter than its instrument is said to be has its
        white noise scaled down.
    biases, bias_covariance : (6,), (6, 6) float64 or None
        Where they were estimated.
    why : str
        Why the method was chosen, where it was.
    filter_history : FilterHistory or None
        What a filter said on its way.
    positions : tuple of Position
        The dwells, where there are several.
    best : OptimalAlignment or None
        The optimal estimate, where it was made on the way.
    """

    method: Method
    attitude: Array
    budget: dict[str, Array]
    orthonormality: float | None = None
    noise_ratio: float | None = None
    spec: ImuSpec | None = None
    biases: Array | None = None
    bias_covariance: Array | None = None
    why: str = ""
    filter_history: FilterHistory | None = None
    positions: tuple[Position, ...] = ()
    best: OptimalAlignment | None = None

    @property
    def covariance(self) -> Array:
        """Sum of the budget, rad^2, (3, 3)."""
        return np.asarray(sum(self.budget.values(), np.zeros((3, 3))))
