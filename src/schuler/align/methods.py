"""Alignment methods as values: small frozen dataclasses that flags, files and sweeps share."""

from __future__ import annotations

from dataclasses import dataclass

from schuler.errors import InputError

__all__ = ["METHODS", "Analytic", "Inertial", "Method", "parse_method"]

ESTIMATORS = ("centred", "wahba", "integral-triad", "instants-triad")
BASES = ("gravity", "earth-rate")


@dataclass(frozen=True)
class Inertial:
    """Alignment in the frozen inertial frame: gravity seen from there turns with the Earth.

    Angular sway drops out exactly, because the gyros carry the force into a frame that does not
    sway.

    Parameters
    ----------
    estimator : {"centred", "wahba", "integral-triad", "instants-triad"}
        "centred" (default): least squares between all velocity integrals and their theory, both
        centred, so that an unknown constant velocity drops out. "wahba": the same without
        centring. "integral-triad": the integrals at the middle and at the end.
        "instants-triad": the specific force at the middle and at the end.
    subsamples : int, optional
        Samples to one coning and sculling update, 1 to 4 (1 uses the sample before as well);
        by default chosen from the sampling rate.
    """

    estimator: str = "centred"
    subsamples: int | None = None

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise InputError(
                f"estimator must be one of {', '.join(ESTIMATORS)}, got '{self.estimator}'"
            )
        if self.subsamples is not None and self.subsamples not in (1, 2, 3, 4):
            raise InputError(f"subsamples must be 1, 2, 3 or 4, got {self.subsamples}")

    def __str__(self) -> str:
        return self.estimator


@dataclass(frozen=True)
class Analytic:
    """The traditional analytic method: mean force and mean rate as the two vectors.

    It needs a base that stands still: sway enters in full.

    Parameters
    ----------
    base : {"gravity", "earth-rate"}
        The vector that is fitted exactly (where the Gram-Schmidt process starts).
    """

    base: str = "gravity"

    def __post_init__(self) -> None:
        if self.base not in BASES:
            raise InputError(f"base must be one of {', '.join(BASES)}, got '{self.base}'")

    def __str__(self) -> str:
        return "analytic" if self.base == "gravity" else "analytic-earth-rate"


Method = Inertial | Analytic

#: the names of the command line and of scenario files
METHODS: dict[str, Method] = {
    **{name: Inertial(name) for name in ESTIMATORS},
    "analytic": Analytic(),
    "analytic-earth-rate": Analytic("earth-rate"),
}


def parse_method(method: str | Method | None) -> Method:
    """Return the method of a name (`METHODS`); None is the default, centred.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if method is None:
        return Inertial()
    if isinstance(method, (Inertial, Analytic)):
        return method
    found = METHODS.get(str(method).strip().lower())
    if found is None:
        raise InputError(f"unknown method '{method}'; the methods are {', '.join(METHODS)}")
    return found
