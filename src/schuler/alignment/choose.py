"""Which method a record calls for, and why."""

from __future__ import annotations

from schuler.alignment.methods import Inertial
from schuler.alignment.stationary.optimal import OptimalAlignment
from schuler.sensors import ImuSpec

__all__ = ["choose"]


def choose(
    best: OptimalAlignment, spec: ImuSpec | None, subsamples: int | None
) -> tuple[Inertial, str]:
    """Return the method for a history and the reason in a sentence.

    With a specification the optimal estimate is the choice on any base: it weighs the attitude of
    the base and gravity's turn by what the record shows of both. Without one its weights rest on
    the record alone, and are taken only on a base at rest, where they promise a clear gain.

    Parameters
    ----------
    best : OptimalAlignment
        The optimal estimate, which says what the record shows.
    spec : ImuSpec or None
    subsamples : int or None
        For the method.
    """
    dwells = len(best.dwells)
    if spec is not None:
        if dwells > 1:
            why = f"the unit was turned between {dwells} dwells, which shows its biases"
        elif dwells == 0:
            why = "the unit turns all the time, which shows its biases"
        elif best.still:
            why = "the base is at rest: its attitude and gravity both count"
        else:
            why = "the base moves: gravity's turn counts, weighted by the noise of the instrument"
        return Inertial("optimal", subsamples), why
    if dwells == 1 and best.still:
        return (
            Inertial("optimal", subsamples),
            "the base is at rest: its attitude and gravity both count",
        )
    return (
        Inertial("centred", subsamples),
        "no specification says how the noise of the instrument is to be weighed",
    )
