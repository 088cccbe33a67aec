"""What makes a scheme good, as a value, and a scheme's judgement by every measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.centrifuge.coefficients import coefficient_names, published_truth
from schuler.centrifuge.information import Tables, position_matrices, scheme_information
from schuler.centrifuge.plant import Plant
from schuler.errors import InputError

__all__ = ["OBJECTIVES", "Judgement", "Objective", "default_wanted", "judge", "time_to_reach"]

Array = NDArray[np.float64]

#: name -> (number in `schuler.kernels.scheme`, what it is)
OBJECTIVES = {
    "sum-rho": (0, "sum of |correlation| over all pairs of coefficients"),
    "a": (1, "mean of (sigma / wanted)^2"),
    "d": (2, "log det of the covariance over the wanted, per coefficient"),
    "e": (3, "largest eigenvalue of the covariance over the wanted"),
    "min-max": (4, "largest sigma / wanted"),
    "time": (4, "time at each position until every sigma is the wanted one, s"),
}


def default_wanted(plant: Plant) -> Array:
    """Return the accuracy that counts as one: 1 % of the published coefficients.

    D_OO, which the source leaves out, is wanted like D_II.
    """
    truth = published_truth()
    if plant.d_oo:
        truth = np.concatenate([truth[:27], truth[12:15], truth[27:]])
    return 0.01 * truth


@dataclass(frozen=True)
class Objective:
    """What is made small.

    Parameters
    ----------
    name : str
        One of `OBJECTIVES`.
    wanted : tuple of float, optional
        Accuracy of each coefficient that counts as one, in rad/s, g and rad; `default_wanted`
        where empty. Sum-rho does not depend on it.

    Examples
    --------
    >>> Objective("min-max").kind
    4
    """

    name: str = "min-max"
    wanted: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.name not in OBJECTIVES:
            raise InputError(f"unknown objective '{self.name}'; known: {', '.join(OBJECTIVES)}")
        if not all(np.isfinite(w) and w > 0 for w in self.wanted):
            raise InputError("an objective's wanted accuracies must be positive numbers")

    @property
    def kind(self) -> int:
        """Number of the objective in the kernel."""
        return OBJECTIVES[self.name][0]

    def scale(self, plant: Plant) -> Array:
        """Return the wanted accuracies (n,)."""
        if not self.wanted:
            return default_wanted(plant)
        if len(self.wanted) != plant.unknowns:
            raise InputError(f"expected {plant.unknowns} wanted accuracies, got {len(self.wanted)}")
        return np.asarray(self.wanted, dtype=np.float64)


@dataclass(frozen=True)
class Judgement:
    """A scheme by every measure.

    Parameters
    ----------
    covariance : (n, n) float64
        rad/s, g, rad.
    correlation : (n, n) float64
    sigma : (n,) float64
    relative : (n,) float64
        sigma / wanted.
    values : dict
        Objective's name -> value, `time` aside.
    singular : (n,) float64
        Singular values of the scaled information, falling.
    weakest : list of (float, dict)
        The three weakest combinations: their singular value and the coefficients with most part.
    """

    covariance: Array
    correlation: Array
    sigma: Array
    relative: Array
    values: dict[str, float]
    singular: Array
    weakest: list[tuple[float, dict[str, float]]]


def judge(
    plant: Plant, positions: ArrayLike, dwell: float, objective: Objective | None = None,
    information: Array | None = None,
) -> Judgement:  # fmt: skip
    """Judge a scheme by every measure.

    Raises
    ------
    InputError
        If a coefficient is not observable in the scheme, naming the one most in what is not seen.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> judge(Plant(), PUBLISHED_POSITIONS, 20.0).sigma.shape
    (45,)
    """
    from schuler.estimate.information import covariance_of
    from schuler.kernels.scheme import objective as value_of

    if information is None:
        information = scheme_information(plant, positions, dwell)
    names = coefficient_names(plant.d_oo)
    wanted = (objective or Objective()).scale(plant)
    covariance = covariance_of(information, names)
    sigma = np.sqrt(np.diag(covariance))
    n = len(names)
    work, inverse = np.zeros((n, n)), np.zeros((n, n))
    values = {
        name: float(value_of(information, wanted, kind, work, inverse))
        for name, (kind, _) in OBJECTIVES.items()
        if name != "time"
    }
    diagonal = np.sqrt(np.diag(information))
    u, s, _ = np.linalg.svd(information / np.outer(diagonal, diagonal))
    weakest = []
    for k in range(1, 4):
        order = np.argsort(-np.abs(u[:, -k]))[:4]
        weakest.append((float(s[-k]), {names[i]: float(u[i, -k]) for i in order}))
    return Judgement(
        covariance, covariance / np.outer(sigma, sigma), sigma, sigma / wanted, values, s, weakest
    )


def time_to_reach(
    plant: Plant, positions: ArrayLike, objective: Objective | None = None, longest: float = 3600.0
) -> float:
    """Return the dwell at each position, s, after which every sigma is the wanted one.

    A whole number of turns of the arm, by bisection; infinite where `longest` is not enough.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> time_to_reach(Plant(), PUBLISHED_POSITIONS, longest=600.0) > 0.0
    True
    """
    from schuler.kernels.scheme import LARGEST_SIGMA
    from schuler.kernels.scheme import objective as value_of

    wanted = (objective or Objective()).scale(plant)
    n = plant.unknowns
    work, inverse = np.zeros((n, n)), np.zeros((n, n))

    def enough(turns: int) -> bool:
        tables = Tables(plant, turns * plant.period)
        total = position_matrices(tables, positions).sum(axis=0)
        return float(value_of(total, wanted, LARGEST_SIGMA, work, inverse)) <= 1.0

    low, high = 0, max(1, int(longest / plant.period))
    if not enough(high):
        return float("inf")
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high * plant.period
